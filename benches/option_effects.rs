//! What each named option of the method changes on the default recordings, and whether it brings the study nearer to
//! the published numbers.
//!
//! ```text
//! cargo bench --bench option_effects > effects.csv
//! ```
//!
//! Each row changes one option. `s_points` is the root mean square change of the shares of failures of S, per cent;
//! `f1_change` the mean absolute change of the F1 that are defined in both runs; the misfits are those to the published
//! shares and to the published F1 of LVD. `claims` are those whose verdict differs from the default's. In the row
//! `recorded track` S runs on with the recorded motions after T, as long as every vehicle is in view, and then holds.

use std::error::Error;

use lanesweep::engine::{Chunk, CpuBackend, Executor, Partial, Wanted};
use lanesweep::model::profile::Profile;
use lanesweep::run::parts::Job;
use lanesweep::run::score::{ClaimResult, Misfit, ScoreTable, check_claims, f1};
use lanesweep::run::study::Study;
use lanesweep::scenario::parameterization::ParameterizationOptions;
use lanesweep::scenario::{Other, Scenario};
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::{GeneratorOptions, generate_one};
use lanesweep::traffic::trajectory::{Recording, Track};

/// Where an option stands, its key, and another value of it in TOML.
const OPTIONS: [(&str, &str, &str); 63] = [
    ("frame", "dt_s", "0.01"),
    ("frame", "dt_s", "0.1"),
    ("frame", "time_cap_s", "60.0"),
    ("frame", "time_cap_s", "30.0"),
    ("frame", "time_cap_s", "20.0"),
    ("frame", "time_cap_s", "300.0"),
    ("frame", "start_shift", "true"),
    ("frame", "end_when_settled", "false"),
    ("frame", "cut_out_target", "\"exposed\""),
    ("frame", "cut_out_judged", "\"ahead\""),
    ("criteria", "gate", "\"overlap\""),
    ("criteria", "btn", "\"exact\""),
    ("criteria", "btn", "\"distance-ratio\""),
    ("criteria", "btn_contact", "\"gated\""),
    ("reg157", "margin_s", "0.0"),
    ("reg157", "margin_s", "0.2"),
    ("reg157", "visible_lateral_movement_s", "0.72"),
    ("reg157", "lane_intrusion_m", "0.3"),
    ("reg157", "ttc_only_while_closing", "true"),
    ("reg157", "always_unsafe", "[\"lvd\", \"cut_out\"]"),
    ("cchdm", "ttc_only_while_closing", "true"),
    ("cchdm", "delay_s", "0.75"),
    ("cchdm", "delay_s", "1.15"),
    ("cchdm", "coasting_mps2", "0.0"),
    ("cchdm", "always_unsafe", "[\"lvd\", \"cut_out\"]"),
    ("cchdm", "abort_on_large_ttc", "true"),
    ("cchdm", "wandering_m", "0.375"),
    ("cchdm", "perception_time_s", "0.4"),
    ("cchdm", "cut_out_headway_s", "2.0"),
    ("cchdm", "lead_deceleration_trigger_mps2", "5.0"),
    ("parameterization", "after_duration", "\"unlimited\""),
    ("parameterization", "lateral_speed", "\"initial\""),
    ("parameterization", "lateral_start", "\"recorded\""),
    ("parameterization", "lane_change_m", "3.75"),
    ("parameterization", "sinusoid_intervals", "200"),
    ("parameterization", "svd_instants", "20"),
    ("parameterization", "svd_instants", "200"),
    ("parameterization", "series_scale", "\"per-series\""),
    ("parameterization", "svd_lateral", "\"mirrored\""),
    ("parameterization", "svd_fit", "\"all\""),
    ("mining", "leader_max_thw_s", "3.0"),
    ("mining.ego_view", "range_m", "150.0"),
    ("mining.ego_view", "cut_m", "50.0"),
    ("mining.longitudinal", "window_s", "0.5"),
    ("mining.longitudinal", "window_s", "2.0"),
    ("mining.longitudinal", "min_speed_change_mps", "2.0"),
    ("mining.longitudinal", "min_cruise_s", "2.0"),
    ("mining.lateral", "window_s", "0.5"),
    ("mining.lateral", "quiescent_speed_mps", "0.1"),
    ("mining.lateral", "search_s", "5.0"),
    ("mining.lateral", "lc_end", "\"published\""),
    ("mining.cut_in", "max_speed_share", "0.9"),
    ("mining.cut_in", "max_speed_share", "1.0"),
    ("mining.cut_in", "max_thw_s", "1.0"),
    ("mining.cut_out", "require_slower_lead", "false"),
    ("mining.lvd", "min_duration_s", "2.0"),
    ("mining.lvd", "min_peak_deceleration_mps2", "1.5"),
    ("mining.lvd", "min_peak_deceleration_mps2", "3.0"),
    ("generator", "event_rate_factor", "1.0"),
    ("generator", "event_rate_factor", "8.0"),
    ("profile", "name", "\"paper-fit\""),
    ("profile", "name", "\"jrc-2021\""),
    ("profile", "name", "\"un-r157\""),
];

/// Everything that a study of generated recordings follows from.
#[derive(Clone)]
struct Settings {
    generator: GeneratorOptions,
    mining: MiningOptions,
    parameterization: ParameterizationOptions,
    profile: Profile,
}

impl Settings {
    fn with(&self, table: &str, key: &str, value: &str) -> Result<Settings, Box<dyn Error>> {
        let mut changed = self.clone();
        let set = |old: toml::Table, at: &str| -> Result<toml::Table, Box<dyn Error>> {
            let text = if at.is_empty() { format!("{key} = {value}") } else { format!("[{at}]\n{key} = {value}") };
            Ok(merged(old, toml::from_str(&text)?))
        };
        match table.split_once('.').unwrap_or((table, "")) {
            ("generator", at) => changed.generator = set(toml::Table::try_from(&self.generator)?, at)?.try_into()?,
            ("mining", at) => changed.mining = set(toml::Table::try_from(&self.mining)?, at)?.try_into()?,
            ("parameterization", at) => {
                changed.parameterization = set(toml::Table::try_from(&self.parameterization)?, at)?.try_into()?;
            }
            ("profile", _) => changed.profile = Profile::load(value.trim_matches('"'))?,
            (at, _) => changed.profile = set(toml::Table::try_from(&self.profile)?, at)?.try_into()?,
        }
        Ok(changed)
    }

    fn study(&self, collection: &Collection) -> lanesweep::Result<Study> {
        let mut study = Study::builder(collection, self.profile.clone());
        study.options.parameterization = self.parameterization.clone();
        study.plan()
    }

    fn scores(&self, collection: &Collection) -> Result<Scored, Box<dyn Error>> {
        let study = self.study(collection)?;
        let backend = CpuBackend::lane_arithmetic();
        Ok(Scored::of(&study, &study.run(&Executor::new(&backend))?.counts)?)
    }

    /// The scores of S with the recorded motions after T, and of the same S' as ever.
    fn scores_of_recorded_track(&self, collection: &Collection) -> Result<Scored, Box<dyn Error>> {
        let recording = |index| generate_one(&self.generator, index);
        let recordings = (0..self.generator.recordings).map(recording).collect::<lanesweep::Result<Vec<_>>>()?;
        let mut longer =
            Collection { scenarios: collection.scenarios.clone(), synthetic: true, ..Collection::default() };
        for scenario in longer.scenarios.iter_mut().filter(|scenario| scenario.kept) {
            let of = recordings.iter().find(|recording| recording.id == scenario.recording).ok_or("no recording")?;
            prolong(scenario, of).ok_or("a vehicle is not in its recording")?;
        }
        let (study, prolonged) = (self.study(collection)?, self.study(&longer)?);
        let (mut chunks, of_s) = (verdicts(&study)?, verdicts(&prolonged)?);
        let plan = study.plan();
        let mut counts = Partial::empty(plan);
        for (chunk, other) in chunks.iter_mut().zip(&of_s) {
            assert_eq!(chunk.units, other.units);
            for (at, verdict) in chunk.verdicts.iter_mut().enumerate() {
                if plan.key(chunk.first_lane + at as u64).is_some_and(|key| key.variant == 0) {
                    *verdict = other.verdicts[at];
                }
            }
            counts = counts.merge(Partial::from_chunk(plan, chunk)?)?;
        }
        Ok(Scored::of(&study, &counts)?)
    }
}

/// The verdicts of every lane, one chunk per unit, in order.
fn verdicts(study: &Study) -> lanesweep::Result<Vec<Chunk>> {
    let backend = CpuBackend::lane_arithmetic();
    let mut chunks = Vec::new();
    for unit in 0..study.plan().unit_count() {
        study.cases().sweep(unit..unit + 1, Wanted::Verdicts, &Executor::new(&backend), |_, chunk| {
            chunks.push(chunk);
            Ok(())
        })?;
    }
    Ok(chunks)
}

/// Adds what is recorded after T while every vehicle of the scenario is in view.
fn prolong(scenario: &mut Scenario, recording: &Recording) -> Option<()> {
    let of = |id: u32| recording.tracks.iter().find(|track| track.id == id);
    let (target, lead) = (of(scenario.target_id)?, scenario.lead_id.and_then(of));
    let last = target.last_frame().min(lead.map_or(i64::MAX, Track::last_frame));
    let (frame1, sign) = (scenario.frame1, scenario.side.sign());
    let add = |other: &mut Other, track: &Track| {
        let (from, to) = (track.index_of(frame1)?, track.index_of(last)?);
        let y = *other.y.last()?;
        other.v.extend(&track.v_s_mps[from + 1..=to]);
        other.y.extend(track.d_m[from + 1..=to].iter().map(|d| y + sign * (d - track.d_m[from])));
        Some(())
    };
    add(&mut scenario.target, target)?;
    scenario.lead.as_mut().zip(lead).map_or(Some(()), |(other, track)| add(other, track))?;
    scenario.frame1 = last;
    Some(())
}

/// Scores of a study with its claims.
struct Scored {
    table: ScoreTable,
    claims: Vec<ClaimResult>,
}

impl Scored {
    fn of(study: &Study, counts: &Partial) -> lanesweep::Result<Scored> {
        let table = study.score(counts)?;
        let claims = check_claims(&table, study.plan(), counts);
        Ok(Scored { table, claims })
    }
}

fn merged(mut old: toml::Table, new: toml::Table) -> toml::Table {
    for (key, value) in new {
        let both = (old.remove(&key), value);
        let value = match both {
            (Some(toml::Value::Table(old)), toml::Value::Table(new)) => toml::Value::Table(merged(old, new)),
            (_, value) => value,
        };
        old.insert(key, value);
    }
    old
}

/// Numbers with their names.
type Named = Vec<(String, f64)>;

/// Shares of failures of S, per cent, and F1.
fn numbers(scores: &ScoreTable) -> (Named, Named) {
    let (mut shares, mut f1s) = (Named::new(), Named::new());
    for category in &scores.categories {
        for cell in &category.cells {
            let what = format!("{} {} {}", category.category.label(), cell.model.name(), cell.criterion.label());
            if cell.variant == 0 {
                shares.push((what, 100.0 * cell.counts.tp as f64 / category.simulations as f64));
            } else if let Some(f1) = f1(&cell.counts) {
                f1s.push((format!("{} {what}", category.variants[cell.variant]), f1));
            }
        }
    }
    (shares, f1s)
}

/// Differences of the numbers that are in both.
fn changes<'a>(old: &'a [(String, f64)], new: &[(String, f64)]) -> Vec<(&'a str, f64)> {
    let find = |name: &str| new.iter().find(|(other, _)| other == name).map(|(_, value)| *value);
    old.iter().filter_map(|(name, old)| Some((name.as_str(), find(name)? - old))).collect()
}

/// The claims with another verdict than before, joined by semicolons.
fn other_verdicts(base: &[ClaimResult], claims: &[ClaimResult]) -> String {
    let other = |(old, new): (&ClaimResult, &ClaimResult)| {
        let verdict = new.verdict;
        (verdict != old.verdict).then(|| format!("{}: {}", new.claim.id.replace(',', " and"), verdict.text()))
    };
    base.iter().zip(claims).filter_map(other).collect::<Vec<_>>().join("; ")
}

fn row(base: &Scored, scores: &Scored) -> String {
    let ((old_shares, old_f1), (shares, f1s)) = (numbers(&base.table), numbers(&scores.table));
    let (shares, f1s) = (changes(&old_shares, &shares), changes(&old_f1, &f1s));
    let largest = |changes: &[(&str, f64)]| {
        let largest_change = changes.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        largest_change.map_or_else(String::new, |(name, change)| format!("{name} {change:+.2}"))
    };
    let n = |changes: &[(&str, f64)]| changes.len().max(1) as f64;
    let s_points = (shares.iter().map(|(_, d)| d * d).sum::<f64>() / n(&shares)).sqrt();
    let f1_change = f1s.iter().map(|(_, d)| d.abs()).sum::<f64>() / n(&f1s);
    let misfit = Misfit::of(&scores.table).expect("all models are published");
    let kept: Vec<String> = scores.table.categories.iter().map(|category| category.scenarios.to_string()).collect();
    format!(
        "{},{s_points:.2},{},{f1_change:.3},{},{:.2},{:.3},{}",
        kept.join(" "),
        largest(&shares),
        largest(&f1s),
        misfit.rate_rms_points,
        misfit.f1_mean,
        other_verdicts(&base.claims, &scores.claims)
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    // `cargo test --benches` calls without `--bench`: nothing to do then.
    if !std::env::args().any(|text| text == "--bench") {
        return Ok(());
    }
    let settings = Settings {
        generator: GeneratorOptions::default(),
        mining: MiningOptions::default(),
        parameterization: ParameterizationOptions::default(),
        profile: Profile::load("paper")?,
    };
    let mine = |settings: &Settings| mine_generated(&settings.generator, &settings.mining, || Ok(()));
    let collection = mine(&settings)?;
    let base = settings.scores(&collection)?;
    println!(
        "option,value,kept,s_points,largest_s_change,f1_change,largest_f1_change,misfit_points,misfit_lvd_f1,claims"
    );
    println!("(default),,{}", row(&base, &base));
    println!("S after T,recorded track,{}", row(&base, &settings.scores_of_recorded_track(&collection)?));
    for (table, key, value) in OPTIONS {
        let changed = settings.with(table, key, value)?;
        let scores = if table.starts_with("mining") || table == "generator" {
            changed.scores(&mine(&changed)?)?
        } else {
            changed.scores(&collection)?
        };
        println!("{table}.{key},{},{}", value.replace(['"', ','], ""), row(&base, &scores));
    }
    Ok(())
}
