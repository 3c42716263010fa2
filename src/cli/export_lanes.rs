//! The lanes of an export: found, run again in their own arithmetic, and put into words.

use std::path::Path;

use super::case_flags::CaseFlags;
use super::export_worst::{worst_of_sample, worst_of_study};
use super::simulate_lanes::{Run, find, find_run, model, refuse_void};
use super::source::scenarios_of;
use crate::engine::{EndReason, Headway, LaneCase, LaneKey, LanePlan, LaneRunner, NO_STEP, Trace, check_time_step};
use crate::interop::openscenario::{Concrete, EgoMotion, PlayedVehicle, paths, sizes_of_case};
use crate::model::criterion::Criterion;
use crate::model::driver::{ModelId, NEVER};
use crate::model::profile::{CutOutTarget, Profile};
use crate::model::scalar::Real;
use crate::run::study::{StudyOptions, plan_study};
use crate::scenario::parameterization::{Sizes, VehicleSize};
use crate::scenario::{Category, LATERAL_SAMPLED, SPEED_SAMPLED, Scenario, Side, Tables};
use crate::stats::density::DensityModel;
use crate::support::plausibility::Implausible;
use crate::support::repeats::refuse_repeats;
use crate::{Error, Place, Result};

/// What the flags say beside the lanes.
pub(super) struct Extras {
    pub ego: EgoMotion,
    /// End of a scenario whose ego is the user's.
    pub duration_s: Option<f64>,
    pub side: Option<Side>,
    pub lane_width_m: Option<f64>,
    pub implausible: Implausible,
}

/// Which lanes are asked for by name.
pub(super) struct Source<'a> {
    pub keys: &'a [String],
    /// Instead of the keys' own models; of the worst lanes, only these.
    pub models: Option<Vec<ModelId>>,
}

/// Scenarios ready to be written, and what a reader should know of them.
pub(super) struct Exported {
    pub scenarios: Vec<Concrete>,
    pub notes: Vec<String>,
    /// Other scenarios of the file were left out.
    pub incomplete: bool,
}

/// Width of a lane where nothing tells it, m.
const LANE_WIDTH_M: f64 = 3.5;

/// How long a scenario goes on after the last event where the ego is the user's, s.
const AFTERWARDS_S: f64 = 10.0;

/// What is known of a lane beside its case.
struct Known<'a> {
    key: &'a str,
    profile: &'a Profile,
    sizes: Option<Sizes>,
    scenario: Option<&'a Scenario>,
    data: &'a str,
    arithmetic: &'static str,
    is_synthetic: bool,
    /// Parameters of a sampled point.
    drawn: Vec<(String, f64)>,
}

/// Lanes of a finished run, in its own arithmetic.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a folder without a run's plan; [`Error::Usage`] for a lane that the run does not
/// have.
pub(super) fn of_run(
    dir: &Path,
    source: &Source,
    worst: Option<(usize, &[String])>,
    criterion: Option<Criterion>,
    scenarios: Option<&Path>,
    extras: &Extras,
) -> Result<Exported> {
    let first = source.keys.first().map_or("", String::as_str);
    match find_run(dir, first)? {
        Run::Study(study) => {
            let (whole, facts) = (study.plan(), &study.facts());
            let mined = scenarios.map(|path| scenarios_of(path, extras.implausible)).transpose()?.unwrap_or_default();
            let (mined, incomplete) = mined;
            let keys = match worst {
                Some((count, variants)) => worst_of_study(
                    study.cases(),
                    facts.reference,
                    count,
                    criterion.unwrap_or(Criterion::Collision),
                    variants,
                    source.models.as_deref(),
                )?,
                None => named(whole, source)?,
            };
            let units = keys.iter().map(|key| whole.blocks[key.block].first_unit + key.unit);
            let span = units.clone().min().unwrap_or(0)..units.max().map_or(0, |last| last + 1);
            let plan = &study.cases().window(span)?;
            let about = About {
                data: &facts.data,
                is_synthetic: facts.synthetic || mined.iter().any(|scenario| scenario.synthetic),
                mined: &mined,
                density: None,
                are_alike: false,
                incomplete,
            };
            if facts.reference {
                lanes::<f64>(plan, &keys, &about, extras)
            } else {
                lanes::<f32>(plan, &keys, &about, extras)
            }
        }
        Run::Distribution(plan, data) => {
            if scenarios.is_some() || worst.is_some_and(|(_, variants)| !variants.is_empty()) {
                let problem = "a run of distributions has neither scenarios nor variants";
                return Err(Error::usage(Place::item("--scenarios, --variant"), problem, "leave them out"));
            }
            let keys = match worst {
                Some((count, _)) => worst_of_sample(dir, &plan, count, criterion, source.models.as_deref())?,
                None => named(&plan, source)?,
            };
            let about = About {
                data: &data,
                is_synthetic: false,
                mined: &[],
                density: None,
                are_alike: true,
                incomplete: false,
            };
            lanes::<f32>(&plan, &keys, &about, extras)
        }
        Run::Sample(plan, density) => {
            if scenarios.is_some() {
                let problem = "sampled lanes have the mean sizes of their density";
                return Err(Error::usage(Place::item("--scenarios"), problem, "leave it out"));
            }
            let keys = match worst {
                Some((_, variants)) if !variants.is_empty() => {
                    let problem = "a sampling run has one variant";
                    return Err(Error::usage(Place::item("--variant"), problem, "leave it out"));
                }
                Some((count, _)) => worst_of_sample(dir, &plan, count, criterion, source.models.as_deref())?,
                None => named(&plan, source)?,
            };
            let provenance = &density.provenance;
            let about = About {
                data: &provenance.data,
                is_synthetic: provenance.synthetic,
                mined: &[],
                density: Some(density.as_ref()),
                are_alike: false,
                incomplete: false,
            };
            lanes::<f32>(&plan, &keys, &about, extras)
        }
    }
}

/// Lanes of a scenario file, in f64; a scenario that the filters dropped too, and any headway.
///
/// # Errors
/// As [`scenarios_of`]; [`Error::Usage`] for a lane that the file does not have.
pub(super) fn of_scenarios(path: &Path, profile: &Profile, source: &Source, extras: &Extras) -> Result<Exported> {
    let (mut mined, incomplete) = scenarios_of(path, extras.implausible)?;
    let mut options = StudyOptions::default();
    let mut headways = Vec::new();
    for key in source.keys {
        let id = key.rsplitn(4, '/').last().unwrap_or(key);
        if let Some(wanted) = mined.iter_mut().find(|s| s.id == id) {
            wanted.kept = true;
        }
        if let Some(headway) = key.rsplit('/').nth(1).and_then(Headway::parse)
            && !headways.contains(&headway)
        {
            headways.push(headway);
        }
    }
    if !headways.is_empty() {
        options.headways = headways;
    }
    let plan = plan_study(&mined, profile, &options)?;
    let is_synthetic = mined.iter().any(|scenario| scenario.synthetic);
    let data = format!("scenarios of {}", path.file_name().unwrap_or_default().to_string_lossy());
    let about = About { data: &data, is_synthetic, mined: &mined, density: None, are_alike: false, incomplete };
    lanes::<f64>(&plan, &named(&plan, source)?, &about, extras)
}

/// One case of flags, with each of its models, in f64.
///
/// # Errors
/// [`Error::Usage`] for flags that make no case.
pub(super) fn of_case(flags: &CaseFlags, profile: &Profile, extras: &Extras) -> Result<Exported> {
    let (category, headway) = (flags.category()?, flags.headway()?);
    let described = flags.case(profile, extras.implausible)?;
    let mut tables = Tables::default();
    let case = LaneCase::encode(&described, profile, &mut tables);
    profile.check_time_step(&flags.models()?)?;
    check_time_step(&case, &tables, profile.frame.dt_s, || Place::item("the case"))?;
    let size = |length_m, width_m| VehicleSize { length_m, width_m };
    let sizes = Sizes {
        ego: size(described.ego_length_m, described.ego_width_m),
        target: size(described.principal.length_m, described.principal.width_m),
        lead: described.ahead.as_ref().map(|a| size(a.vehicle.length_m, a.vehicle.width_m)),
    };
    let mut scenarios = Vec::new();
    for model in flags.models()? {
        let trace = Trace::record(profile, category, &case, &tables, headway, model);
        let key = format!("{}/{headway}/{}", category.key(), model.name());
        let known = Known {
            key: &key,
            profile,
            sizes: Some(sizes),
            scenario: None,
            data: "a case of flags",
            arithmetic: "binary64",
            is_synthetic: false,
            drawn: Vec::new(),
        };
        scenarios.push(concrete(&trace, (&case, &tables), &case, &known, extras)?);
    }
    Ok(Exported { scenarios, notes: Vec::new(), incomplete: false })
}

fn named(plan: &LanePlan, source: &Source) -> Result<Vec<LaneKey>> {
    let mut keys = Vec::new();
    for text in source.keys {
        let key = find(plan, text)?;
        refuse_void(plan, &key)?;
        match &source.models {
            None => keys.push(key),
            Some(models) => {
                for id in models {
                    keys.push(LaneKey { model: model(plan, *id)?, ..key });
                }
            }
        }
    }
    refuse_repeats(|| Place::item("--lane"), keys.iter().map(|key| (*key, plan.key_text(key))))?;
    Ok(keys)
}

/// What is known of a run's lanes.
struct About<'a> {
    data: &'a str,
    is_synthetic: bool,
    mined: &'a [Scenario],
    density: Option<&'a DensityModel>,
    /// Every vehicle has the same size.
    are_alike: bool,
    /// Other scenarios of the file were left out.
    incomplete: bool,
}

fn lanes<R: Real>(plan: &LanePlan, keys: &[LaneKey], about: &About, extras: &Extras) -> Result<Exported> {
    let runner = LaneRunner::<R>::new(plan);
    let arithmetic = if std::mem::size_of::<R>() == 4 { "binary32" } else { "binary64" };
    let (mut scenarios, mut are_lengths_told) = (Vec::new(), true);
    for key in keys {
        let text = plan.key_text(key);
        let (case, tables) = runner.case(key.block, key.unit, key.variant);
        let id = plan.blocks[key.block].units.name(key.unit);
        let scenario = about.mined.iter().find(|s| s.id == id);
        let drawn = match (plan.generator(), about.density) {
            (Some(generator), Some(density)) => {
                let values = generator.draw(key.unit).values;
                let shortest = |v: &f32| v.to_string().parse::<f64>().unwrap_or(f64::from(*v));
                let names = density.space.parameters().iter().map(|p| p.name.clone());
                names.zip(values.iter().map(shortest)).collect()
            }
            _ => Vec::new(),
        };
        let wide = match plan.generator() {
            Some(_) => widened(&case),
            None => plan.case(key.block, key.unit, key.variant),
        };
        let size = VehicleSize { length_m: wide.others[0].half_lengths, width_m: wide.ego_width };
        let alike = || Sizes { ego: size, target: size, lead: (wide.pair != 0).then_some(size) };
        let told = about.density.map(|d| d.sizes).or_else(|| scenario.map(Sizes::of));
        let sizes = told.or_else(|| about.are_alike.then(alike));
        are_lengths_told &= sizes.is_some();
        let known = Known {
            key: &text,
            profile: &plan.profile,
            sizes,
            scenario,
            data: about.data,
            arithmetic,
            is_synthetic: about.is_synthetic,
            drawn,
        };
        scenarios.push(concrete(&runner.trace(key), (&case, &tables), &wide, &known, extras)?);
    }
    let note = "a study's plan has only the sum of two lengths: the ego gets the profile's \
                length, the others the remainder; gaps and contacts do not change (--scenarios FILE has the lengths)";
    let notes = if are_lengths_told { Vec::new() } else { vec![note.to_owned()] };
    Ok(Exported { scenarios, notes, incomplete: about.incomplete })
}

/// The same numbers in f64.
fn widened<R: Real>(case: &LaneCase<R>) -> LaneCase<f64> {
    LaneCase {
        others: case.others.map(|o| crate::engine::LaneOther {
            motion: crate::scenario::Motion::resting(),
            half_lengths: o.half_lengths.to_f64(),
            half_widths: o.half_widths.to_f64(),
            gap_offset: o.gap_offset.to_f64(),
            present_from: o.present_from,
            present_until: o.present_until,
            attend_from: o.attend_from,
            used: o.used,
            judged: o.judged,
        }),
        ego_speed: case.ego_speed.to_f64(),
        ego_width: case.ego_width.to_f64(),
        horizon: case.horizon,
        pair: case.pair,
    }
}

fn concrete<R: Real>(
    trace: &Trace,
    (case, tables): (&LaneCase<R>, &Tables<R>),
    wide: &LaneCase<f64>,
    known: &Known,
    extras: &Extras,
) -> Result<Concrete> {
    let profile = known.profile;
    let from = case.others[0].present_from;
    let is_exposed = trace.category == Category::CutOut && profile.frame.cut_out_target == CutOutTarget::Exposed;
    if is_exposed && from != NEVER {
        let problem = "the cutting-out vehicle hits the one ahead, whose position the lane has only after that";
        let help = "use a profile that judges every vehicle of a cut-out, such as paper";
        return Err(Error::input(Place::item(format!("lane {}", known.key)), problem, help));
    }
    let sizes = sizes_of_case(known.key, wide, known.sizes.as_ref(), profile.frame.default_length_m)?;
    let last_traced = trace.steps.last().map_or(0, |s| s.step);
    let last = match extras.ego {
        EgoMotion::Model => last_traced,
        EgoMotion::External => {
            let steps = |seconds: f64| (seconds / trace.dt_s - 1e-9).ceil().max(0.0) as u32;
            let otherwise = || last_traced.max(case.horizon.min(profile.step_cap())) + steps(AFTERWARDS_S);
            extras.duration_s.map_or_else(otherwise, steps)
        }
    };
    // A trajectory has two vertices at least.
    let mut all = paths(trace, case, tables, last.max(1)).into_iter();
    let mut vehicle = |name, size: VehicleSize| PlayedVehicle {
        name,
        length_m: size.length_m,
        width_m: size.width_m,
        path: all.next().unwrap_or_default(),
    };
    let mut vehicles = vec![vehicle("Ego", sizes.sizes.ego), vehicle("Other", sizes.sizes.target)];
    if let Some(lead) = sizes.sizes.lead.filter(|_| trace.vehicles == 2) {
        vehicles.push(vehicle("Ahead", lead));
    }
    let scenario = known.scenario;
    Ok(Concrete {
        key: known.key.to_owned(),
        category: trace.category,
        ego: extras.ego,
        side: extras.side.or(scenario.map(|s| s.side)).unwrap_or(Side::Left),
        lane_width_m: extras.lane_width_m.or(scenario.map(|s| s.lane_width)).unwrap_or(LANE_WIDTH_M).clamp(1.0, 20.0),
        vehicles,
        parameters: parameters(trace, wide, known),
        properties: properties(trace, known, extras, sizes.are_lengths_known),
        is_synthetic: known.is_synthetic,
    })
}

/// The case's numbers by name; those of a sampled point as its density names them.
fn parameters(trace: &Trace, case: &LaneCase<f64>, known: &Known) -> Vec<(String, f64)> {
    // A product with the time step is a decimal again where that is the same product; else every digit counts.
    let decimal = |value: f64| {
        let short = (value * 1e9).round() / 1e9;
        if short * trace.dt_s == value * trace.dt_s { short } else { value }
    };
    let first = &trace.steps[0];
    let mut list = vec![
        ("ego_speed_mps", decimal(first.v_ego_mps)),
        ("other_speed_mps", decimal(first.others[0].v_mps)),
        ("gap_m", decimal(trace.initial_gap_m)),
    ];
    let motion = &case.others[0].motion;
    if known.drawn.is_empty() {
        if motion.kind & SPEED_SAMPLED == 0 && motion.speed_per_step != 0.0 {
            list.push(("other_acceleration_mps2", decimal(motion.speed_per_step / trace.dt_s)));
            list.push(("end_speed_mps", decimal(motion.speed_end)));
        }
        if motion.kind & LATERAL_SAMPLED == 0 && motion.lateral_per_step != 0.0 {
            list.push(("lateral_speed_mps", decimal(motion.lateral_per_step.abs() / trace.dt_s)));
            list.push(("lateral_distance_m", decimal((motion.lateral_end - motion.lateral_initial).abs())));
        }
    }
    if trace.vehicles == 2 {
        list.push(("ahead_speed_mps", decimal(first.others[1].v_mps)));
    }
    let mut list: Vec<(String, f64)> = list.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    let drawn = known.drawn.iter().filter(|(_, value)| value.is_finite());
    list.extend(drawn.map(|(name, value)| (format!("sampled_{name}"), *value)));
    list
}

/// What the lane is and how it ended. Times in s; what did not happen is empty.
fn properties(trace: &Trace, known: &Known, extras: &Extras, are_lengths_known: bool) -> Vec<(String, String)> {
    let outcome = &trace.outcome;
    let time = |step: u32| if step == NO_STEP { String::new() } else { trace.time_s(step).to_string() };
    let value = |v: f64| if v.is_finite() { v.to_string() } else { String::new() };
    let at_contact = |v: f64| if outcome.contact_step == NO_STEP { String::new() } else { value(v) };
    let verdict = |c: Criterion| if outcome.verdicts.failed(c) { "fail" } else { "pass" }.to_owned();
    let end = match outcome.end {
        EndReason::Contact => "contact",
        EndReason::Settled => "settled",
        EndReason::Standstill => "standstill",
        EndReason::Cap => "time cap",
        EndReason::Aborted => "aborted",
    };
    let ego = match extras.ego {
        EgoMotion::Model => "model",
        EgoMotion::External => "external",
    };
    let list = [
        ("lane", known.key.to_owned()),
        ("model", trace.model.name().to_owned()),
        ("profile", known.profile.name.clone()),
        ("dt_s", trace.dt_s.to_string()),
        ("arithmetic", known.arithmetic.to_owned()),
        ("data", known.data.to_owned()),
        ("ego", ego.to_owned()),
        ("lengths", if are_lengths_known { "known" } else { "sums" }.to_owned()),
        ("initial_gap_m", value(trace.initial_gap_m)),
        ("collision", verdict(Criterion::Collision)),
        ("ttc", verdict(Criterion::Ttc)),
        ("btn", verdict(Criterion::Btn)),
        ("min_ttc_s", value(outcome.min_ttc)),
        ("max_btn", value(outcome.max_btn)),
        ("min_gap_m", value(outcome.min_gap)),
        ("reaction_s", time(outcome.reaction_step)),
        ("contact_s", time(outcome.contact_step)),
        ("impact_speed_mps", at_contact(outcome.impact_speed)),
        ("impact_closing_speed_mps", at_contact(outcome.impact_closing_speed)),
        ("end_s", time(outcome.end_step)),
        ("end", end.to_owned()),
    ];
    list.into_iter().map(|(name, value)| (format!("lanesweep.{name}"), value)).collect()
}
