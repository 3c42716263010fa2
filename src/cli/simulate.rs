//! `lanesweep simulate`: one concrete case, step by step, as an engineer checks it by hand.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::case_flags::{CaseFlags, from_csv, from_toml};
use super::rerun::plan_of;
use super::{Exit, ProfileFlags, console};
use crate::criterion::Criterion;
use crate::driver::{ModelId, View};
use crate::parameterization::ParameterizationOptions;
use crate::profile::Profile;
use crate::scalar::Real;
use crate::scenario::{Category, Tables, read_scenarios};
use crate::sweep::{Constants, EndReason, Headway, LaneCase, NO_STEP, Outcome, Start, Step, StudyOptions, plan_study};
use crate::{Error, Place, Result};

/// Run one concrete scenario and print its time series
///
/// The case comes from flags, from a TOML file, from a row of a CSV table (the flags' names with `_` as
/// keys or columns; flags win), or from a scenario file with a lane key. The series goes to stdout as CSV,
/// the outcome to stderr.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  lanesweep simulate --category cut-in --model FSM --ego-speed 30 --speed 20 \
                        --thw 1.2 --lateral-speed 1.0\n  lanesweep simulate --scenarios scenarios.jsonl --lane \
                        01_cut_in_81_74_836/S/1.2s/RSS")]
pub struct Simulate {
    #[command(flatten)]
    case: CaseFlags,
    /// TOML file with the case
    #[arg(long, value_name = "FILE", conflicts_with = "table")]
    case_file: Option<PathBuf>,
    /// CSV table with one case per row
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Row of the table, counted from 1 after the header
    #[arg(long, value_name = "N", default_value_t = 1)]
    row: usize,
    /// Scenario file (JSON Lines) for --lane
    #[arg(long, value_name = "FILE", requires = "lane")]
    scenarios: Option<PathBuf>,
    /// Folder (--out) of a `lanesweep sample` run, for --lane: reruns that lane, bit for bit
    #[arg(long, value_name = "DIR", requires = "lane", conflicts_with_all = ["scenarios", "case_file", "table", "profile", "dt"])]
    from: Option<PathBuf>,
    /// Lane key: scenario/variant/headway/model, as errors and tables print it
    #[arg(long, value_name = "KEY")]
    lane: Option<String>,
    #[command(flatten)]
    profile: ProfileFlags,
}

impl Simulate {
    pub fn run(&self) -> Result<Exit> {
        if self.lane.is_some() && self.scenarios.is_none() && self.from.is_none() {
            let help = "add --scenarios FILE for a study's lane, or --from DIR for a sampled one";
            return Err(Error::usage(Place::item("--lane"), "a key alone does not say what it is of", help));
        }
        let profile = self.profile.load()?;
        let (text, summary) = match (&self.scenarios, &self.lane) {
            (_, Some(_)) if self.case != CaseFlags::default() => {
                return Err(Error::usage(
                    Place::item("--lane"),
                    "the lane is a whole case: the other flags would not be heeded",
                    "leave the case's flags out, or --scenarios and --lane",
                ));
            }
            (Some(scenarios), Some(lane)) => run_lane_of_study(&profile, scenarios, lane)?,
            (None, Some(lane)) => run_sampled_lane(self.from.as_deref().unwrap_or(Path::new(".")), lane)?,
            _ => {
                let flags = self.flags()?;
                let mut tables = Tables::default();
                let case = LaneCase::encode(&flags.case(&profile)?, &profile, &mut tables);
                let model = flags.model()?;
                trace(&profile, flags.category()?, &case, &tables, flags.headway()?, model)
            }
        };
        console::print(&text)?;
        eprint!("{summary}");
        Ok(Exit::Ok)
    }

    fn flags(&self) -> Result<CaseFlags> {
        let file = match (&self.case_file, &self.table) {
            (Some(path), _) => from_toml(path)?,
            (None, Some(path)) => from_csv(path, self.row)?,
            (None, None) => CaseFlags::default(),
        };
        Ok(self.case.over(file))
    }
}

/// Reruns exactly one lane of a study, f64, from its key.
fn run_lane_of_study(profile: &Profile, scenarios: &Path, lane: &str) -> Result<(String, String)> {
    let mut scenarios = read_scenarios(scenarios)?;
    let id = lane.rsplitn(4, '/').last().unwrap_or(lane);
    // A scenario that the filters dropped can still be looked at.
    if let Some(wanted) = scenarios.iter_mut().find(|s| s.id == id) {
        wanted.kept = true;
    }
    let mut options = StudyOptions { parameterization: ParameterizationOptions::default(), ..StudyOptions::default() };
    let asked = lane.rsplit('/').nth(1).and_then(|h| h.strip_suffix('s')).and_then(|h| h.parse::<f64>().ok());
    if let Some(thw) = asked.filter(|t| t.is_finite() && *t >= 0.0) {
        options.headways = vec![Headway::ThwS(thw)];
    }
    let plan = plan_study(&scenarios, profile, &options)?.plan;
    let key = plan.parse_key(lane).ok_or_else(|| {
        Error::usage(
            Place::item("--lane"),
            format!("there is no lane `{lane}`"),
            "a key is scenario/variant/headway/model, for instance 01_cut_in_81_74_836/S/1.2s/RSS",
        )
    })?;
    let case = plan.case(key.block, key.unit, key.variant);
    let category = plan.blocks[key.block].category;
    Ok(trace(profile, category, &case, plan.tables(), plan.headways[key.headway], plan.models[key.model]))
}

/// Reruns exactly one lane of a sampling run, in the lane arithmetic.
fn run_sampled_lane(dir: &Path, lane: &str) -> Result<(String, String)> {
    let plan = plan_of(dir)?;
    let (Some(key), Some(generator)) = (plan.parse_key(lane), plan.generator()) else {
        return Err(Error::usage(
            Place::item("--lane"),
            format!("there is no lane `{lane}` in {}", dir.display()),
            "a key is #sample/parameterization/headway/model, as worst.csv has it",
        ));
    };
    if generator.draw(key.unit).is_void() {
        return Err(Error::usage(
            Place::item("--lane"),
            "this sample is void",
            "no draw of it was valid: take another",
        ));
    }
    let mut tables = Tables::<f32>::default();
    let case = generator.case(key.unit, &mut tables);
    let category = plan.blocks[key.block].category;
    Ok(trace(&plan.profile, category, &case, &tables, plan.headways[key.headway], plan.models[key.model]))
}

/// The time series as CSV and the outcome in words.
fn trace<R: Real>(
    profile: &Profile,
    category: Category,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    headway: Headway,
    model: ModelId,
) -> (String, String) {
    let constants = Constants::<f64>::resolve(profile, category);
    let lane = Constants::<R>::resolve(profile, category);
    let dt = profile.frame.dt_s;
    let vehicles = if case.pair != 0 { 2 } else { 1 };
    let mut text = "t_s,x_ego_m,v_ego_mps,a_ego_mps2,unsafe,demand_mps2".to_owned();
    for prefix in &["other", "ahead"][..vehicles] {
        for column in ["x_m", "y_m", "v_mps", "gap_m", "lateral_gap_m", "ttc_s", "btn", "pfs", "cfs"] {
            let _ = write!(text, ",{prefix}_{column}");
        }
    }
    text.push('\n');
    let mut x_ego = 0.0;
    let mut v_before = None;
    let mut row = |step: &Step<R>| {
        let v_ego = step.v_ego.to_f64();
        if let Some(v) = v_before.replace(v_ego) {
            let _: f64 = v;
            x_ego += v_ego * dt;
        }
        let hazard = step.hazard;
        let demand = if hazard.is_unsafe { hazard.demand.to_f64().to_string() } else { String::new() };
        let _ = write!(
            text,
            "{},{x_ego},{},{},{},{demand}",
            round(f64::from(step.index) * dt),
            v_ego,
            step.seen[0].view.a_ego.to_f64(),
            u8::from(hazard.is_unsafe)
        );
        for seen in &step.seen[..vehicles] {
            let view = widened(&seen.view);
            let closing = view.closing();
            let x = x_ego + view.gap + view.half_lengths;
            let ttc = if closing > 0.0 { (view.gap.max(0.0) / closing).to_string() } else { "inf".to_owned() };
            let btn = constants.criteria.btn.at(view.gap, closing);
            let (pfs, cfs) = (
                constants.fsm.pfs(view.v_ego, view.v_other, view.gap),
                constants.fsm.cfs(view.v_ego, view.v_other, view.gap, view.a_ego),
            );
            let _ = write!(
                text,
                ",{x},{},{},{},{},{ttc},{btn},{pfs},{cfs}",
                seen.lateral.to_f64(),
                view.v_other,
                view.gap,
                view.lateral_gap
            );
        }
        text.push('\n');
    };
    let outcome = lane.run(model, case, tables, headway.start::<R>(), &mut row).widen();
    let gap = match headway.start::<f64>() {
        Start::Headway(thw) => thw * case.ego_speed.to_f64(),
        Start::Gap(gap) => gap,
    } + case.others[0].gap_offset.to_f64();
    (text, summary(category, model, gap, &outcome, dt))
}

/// What the driver sees, exactly, for columns that are worked out beside the lane.
fn widened<R: Real>(view: &View<R>) -> View<f64> {
    View {
        v_ego: view.v_ego.to_f64(),
        a_ego: view.a_ego.to_f64(),
        v_other: view.v_other.to_f64(),
        gap: view.gap.to_f64(),
        lateral_gap: view.lateral_gap.to_f64(),
        lateral_towards: view.lateral_towards.to_f64(),
        half_lengths: view.half_lengths.to_f64(),
    }
}

/// Times as people write them: without the rounding error of i·dt.
fn round(t: f64) -> f64 {
    (t * 1e9).round() / 1e9
}

fn summary(category: Category, model: ModelId, gap: f64, outcome: &Outcome<f64>, dt: f64) -> String {
    let time =
        |step: u32| if step == NO_STEP { "never".to_owned() } else { format!("{} s", round(f64::from(step) * dt)) };
    let verdict = |c: Criterion| format!("{} {}", c.label(), if outcome.verdicts.failed(c) { "FAIL" } else { "pass" });
    let verdicts: Vec<String> = Criterion::ALL.into_iter().map(verdict).collect();
    let end = match outcome.end {
        EndReason::Contact => format!("contact of type {} at {} m/s", outcome.contact.code(), outcome.impact_speed),
        EndReason::Settled => "nothing can happen any more".to_owned(),
        EndReason::Standstill => "the ego stands".to_owned(),
        EndReason::Cap => "time cap".to_owned(),
        EndReason::Aborted => "aborted at a large TTC (jrc-2021)".to_owned(),
    };
    format!(
        "{} {}, initial gap {gap} m: {}\n  reacted: {}  end: {} ({end})\n  min TTC {} s, max BTN {}, min gap {} m\n",
        category.label(),
        model.name(),
        verdicts.join(", "),
        time(outcome.reaction_step),
        time(outcome.end_step),
        outcome.min_ttc,
        outcome.max_btn,
        outcome.min_gap
    )
}
