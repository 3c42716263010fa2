//! `lanesweep simulate`: one concrete case, step by step, as an engineer checks it by hand.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Deserialize;

use super::{Exit, ProfileFlags, console};
use crate::criterion::Criterion;
use crate::driver::ModelId;
use crate::parameterization::ParameterizationOptions;
use crate::profile::Profile;
use crate::scenario::{Ahead, Case, Category, Lateral, Participant, Speed, Tables, read_scenarios};
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
    /// Lane key: scenario/variant/headway/model, as errors and tables print it
    #[arg(long, value_name = "KEY", requires = "scenarios")]
    lane: Option<String>,
    #[command(flatten)]
    profile: ProfileFlags,
}

/// A case in words. Speeds in m/s, lengths in m, accelerations in m/s², times in s.
#[derive(Debug, Clone, Default, Deserialize, Args)]
#[serde(deny_unknown_fields, default)]
struct CaseFlags {
    /// Kind of scenario: cut-in, cut-out, lvd
    #[arg(long, value_name = "NAME")]
    category: Option<String>,
    /// Driver model: Reg157, CCHDM, RSS, FSM
    #[arg(long, value_name = "NAME")]
    model: Option<String>,
    /// Initial speed of the ego, m/s
    #[arg(long, value_name = "MPS")]
    ego_speed: Option<f64>,
    /// Initial speed of the other vehicle, m/s [default: the ego's]
    #[arg(long, value_name = "MPS")]
    speed: Option<f64>,
    /// Initial gap, m, bumper to bumper
    #[arg(long, value_name = "M", conflicts_with = "thw")]
    gap: Option<f64>,
    /// Initial time headway, s, instead of the gap
    #[arg(long, value_name = "SECONDS")]
    thw: Option<f64>,
    /// Cut-in, cut-out: lateral speed, m/s
    #[arg(long, value_name = "MPS")]
    lateral_speed: Option<f64>,
    /// Cut-in: lateral distance at the start; cut-out: at the end [default: 3.5]
    #[arg(long, value_name = "M")]
    lateral_distance: Option<f64>,
    /// Acceleration of the other vehicle, m/s² [default: 0]
    #[arg(long, value_name = "MPS2")]
    acceleration: Option<f64>,
    /// Speed at which the acceleration ends, m/s [default: standstill, or never]
    #[arg(long, value_name = "MPS")]
    end_speed: Option<f64>,
    /// Cut-out: speed of the vehicle ahead of the cutting-out one, m/s [default: 0]
    #[arg(long, value_name = "MPS")]
    ahead_speed: Option<f64>,
    /// Cut-out: gap between the two, m, bumper to bumper
    #[arg(long, value_name = "M")]
    ahead_gap: Option<f64>,
    /// Length of every vehicle, m [default: the profile's]
    #[arg(long, value_name = "M")]
    length: Option<f64>,
    /// Width of every vehicle, m [default: the profile's]
    #[arg(long, value_name = "M")]
    width: Option<f64>,
}

impl CaseFlags {
    /// `self` where it says something, else `other`.
    fn over(&self, other: CaseFlags) -> CaseFlags {
        // A gap typed here replaces a headway of the file, and the other way round.
        let (gap, thw) = match (self.gap, self.thw) {
            (None, None) => (other.gap, other.thw),
            typed => typed,
        };
        CaseFlags {
            category: self.category.clone().or(other.category),
            model: self.model.clone().or(other.model),
            ego_speed: self.ego_speed.or(other.ego_speed),
            speed: self.speed.or(other.speed),
            gap,
            thw,
            lateral_speed: self.lateral_speed.or(other.lateral_speed),
            lateral_distance: self.lateral_distance.or(other.lateral_distance),
            acceleration: self.acceleration.or(other.acceleration),
            end_speed: self.end_speed.or(other.end_speed),
            ahead_speed: self.ahead_speed.or(other.ahead_speed),
            ahead_gap: self.ahead_gap.or(other.ahead_gap),
            length: self.length.or(other.length),
            width: self.width.or(other.width),
        }
    }

    fn category(&self) -> Result<Category> {
        let text = needed(self.category.as_ref(), "category", "cut-in, cut-out or lvd")?;
        Category::parse(text).ok_or_else(|| {
            Error::usage(
                Place::item("category"),
                format!("there is no category `{text}`"),
                "use cut-in, cut-out or lvd",
            )
        })
    }

    fn model(&self) -> Result<ModelId> {
        let text = needed(self.model.as_ref(), "model", "Reg157, CCHDM, RSS or FSM")?;
        ModelId::parse(text).ok_or_else(|| {
            let problem = format!("there is no model `{text}`");
            Error::usage(Place::item("model"), problem, "use Reg157, CCHDM, RSS or FSM")
        })
    }

    fn headway(&self) -> Result<Headway> {
        match (self.gap, self.thw) {
            (Some(gap), None) => Ok(Headway::GapM(at_least(gap, 0.0, "gap")?)),
            (None, Some(thw)) => Ok(Headway::ThwS(at_least(thw, 0.0, "thw")?)),
            (Some(_), Some(_)) => {
                Err(Error::usage(Place::item("gap, thw"), "both are given", "give the gap or the time headway"))
            }
            (None, None) => Err(Error::usage(
                Place::item("gap, thw"),
                "the initial distance is missing",
                "give --gap in metres or --thw in seconds",
            )),
        }
    }

    fn case(&self, profile: &Profile) -> Result<Case> {
        let category = self.category()?;
        let ego_speed_mps =
            at_least(*needed(self.ego_speed.as_ref(), "ego_speed", "a speed in m/s")?, 0.0, "ego_speed")?;
        let length_m = above_zero(self.length.unwrap_or(profile.frame.default_length_m), "length")?;
        let width_m = above_zero(self.width.unwrap_or(profile.frame.default_width_m), "width")?;
        let initial_mps = at_least(self.speed.unwrap_or(ego_speed_mps), 0.0, "speed")?;
        let acceleration_mps2 = at_least(self.acceleration.unwrap_or(0.0), f64::NEG_INFINITY, "acceleration")?;
        let end_mps = at_least(self.end_speed.unwrap_or(0.0), 0.0, "end_speed")?;
        let until_s = match (acceleration_mps2, self.end_speed) {
            (0.0, _) => 0.0,
            (a, None) if a > 0.0 => profile.frame.time_cap_s,
            (a, _) if (end_mps - initial_mps) / a < 0.0 => {
                return Err(Error::usage(
                    Place::item("end_speed"),
                    format!("{end_mps} m/s cannot be reached from {initial_mps} m/s with {a} m/s²"),
                    "change the sign of the acceleration or the end speed",
                ));
            }
            (a, _) => (end_mps - initial_mps) / a,
        };
        let distance_m = at_least(self.lateral_distance.unwrap_or(3.5), 0.0, "lateral_distance")?;
        let (lateral, change_s) = match category {
            Category::Lvd => (Lateral::Centred, 0.0),
            Category::CutIn | Category::CutOut => {
                let rate = *needed(self.lateral_speed.as_ref(), "lateral_speed", "a speed in m/s")?;
                let rate = above_zero(rate, "lateral_speed")?;
                let lateral = if category == Category::CutIn {
                    Lateral::Kinematic { start_m: distance_m, rate_mps: -rate, end_m: 0.0 }
                } else {
                    Lateral::Kinematic { start_m: 0.0, rate_mps: rate, end_m: distance_m }
                };
                (lateral, distance_m / rate)
            }
        };
        let ahead = if category == Category::CutOut {
            let gap_m = at_least(*needed(self.ahead_gap.as_ref(), "ahead_gap", "a gap in m")?, 0.0, "ahead_gap")?;
            let speed = Speed::constant(at_least(self.ahead_speed.unwrap_or(0.0), 0.0, "ahead_speed")?);
            Some(Ahead { vehicle: Participant { length_m, width_m, speed, lateral: Lateral::Centred }, gap_m })
        } else {
            None
        };
        let speed = Speed::Kinematic { initial_mps, acceleration_mps2, until_s };
        Ok(Case {
            category,
            ego_length_m: length_m,
            ego_width_m: width_m,
            ego_speed_mps,
            principal: Participant { length_m, width_m, speed, lateral },
            ahead,
            horizon_s: until_s.max(change_s).min(profile.frame.time_cap_s),
        })
    }
}

fn needed<'a, T>(value: Option<&'a T>, key: &str, what: &str) -> Result<&'a T> {
    value.ok_or_else(|| {
        let flag = key.replace('_', "-");
        Error::usage(Place::item(key), "it is missing", format!("give {what} with --{flag} or as `{key}` in the file"))
    })
}

fn at_least(value: f64, least: f64, key: &str) -> Result<f64> {
    if value.is_finite() && value >= least {
        return Ok(value);
    }
    let expected =
        if least.is_finite() { format!("a finite number of at least {least}") } else { "a finite number".into() };
    Err(Error::usage(Place::item(key), format!("{value} cannot be used"), format!("give {expected}")))
}

fn above_zero(value: f64, key: &str) -> Result<f64> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Error::usage(Place::item(key), format!("{value} cannot be used"), "give a finite number above 0"))
}

impl Simulate {
    pub fn run(&self) -> Result<Exit> {
        let profile = self.profile.load()?;
        let (text, summary) = match (&self.scenarios, &self.lane) {
            (Some(scenarios), Some(lane)) => run_lane_of_study(&profile, scenarios, lane)?,
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

fn from_toml(path: &Path) -> Result<CaseFlags> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
    toml::from_str(&text).map_err(|e| {
        let mut place = Place::file(path);
        place.row = e.span().map(|span| 1 + text[..span.start].matches('\n').count() as u64);
        Error::usage(place, e.message().to_owned(), "the keys are the flags of `simulate --help` with `_`")
    })
}

fn from_csv(path: &Path, row: usize) -> Result<CaseFlags> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let records = reader.deserialize::<CaseFlags>();
    let line = row as u64 + 1;
    let found = row.checked_sub(1).and_then(|skip| records.into_iter().nth(skip)).ok_or_else(|| {
        Error::usage(Place::file(path), format!("there is no row {row}"), "rows count from 1 after the header")
    })?;
    found.map_err(|e| {
        Error::input(
            Place::file(path).row(line),
            e.to_string(),
            "the columns are the flags of `simulate --help` with `_`",
        )
    })
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

/// The time series as CSV and the outcome in words.
fn trace(
    profile: &Profile,
    category: Category,
    case: &LaneCase<f64>,
    tables: &Tables<f64>,
    headway: Headway,
    model: ModelId,
) -> (String, String) {
    let constants = Constants::<f64>::resolve(profile, category);
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
    let mut row = |step: &Step<f64>| {
        if let Some(v) = v_before.replace(step.v_ego) {
            let _: f64 = v;
            x_ego += step.v_ego * dt;
        }
        let hazard = step.hazard;
        let demand = if hazard.is_unsafe { hazard.demand.to_string() } else { String::new() };
        let _ = write!(
            text,
            "{},{x_ego},{},{},{},{demand}",
            round(f64::from(step.index) * dt),
            step.v_ego,
            step.seen[0].view.a_ego,
            u8::from(hazard.is_unsafe)
        );
        for seen in &step.seen[..vehicles] {
            let view = seen.view;
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
                seen.lateral, view.v_other, view.gap, view.lateral_gap
            );
        }
        text.push('\n');
    };
    let outcome = constants.run(model, case, tables, headway.start::<f64>(), &mut row);
    let gap = match headway.start::<f64>() {
        Start::Headway(thw) => thw * case.ego_speed,
        Start::Gap(gap) => gap,
    };
    (text, summary(category, model, gap, &outcome, dt))
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
