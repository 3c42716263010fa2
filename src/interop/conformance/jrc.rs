//! The JRC's tables. Simulated cases: every row becomes a case, is run in f64 under `jrc-2021`, and is compared.
//! Functions: surrogates, distances and thresholds as plain values. Tables of both are shipped, so that a build can
//! check itself.

use std::path::Path;

use super::table::{Row, Table};
use super::tally::Tally;
use crate::engine::{Constants, EndReason, LaneCase, NO_STEP, Outcome, Start, Step};
use crate::model::driver::{DriverProfile, ModelId};
use crate::model::profile::Profile;

use crate::run::grid::jrc_case::{
    self, Front, MIN_LATERAL_MPS, NATIVE_THW_S, native_distance_fsm, native_distance_rss,
};
use crate::scenario::{Case, Category, Tables};
use crate::{Error, Result};

/// Instants at which the tables contain the ego's speed and position, s.
const SPEED_INSTANTS_S: [(&str, f64); 12] = [
    ("v@0.5", 0.5),
    ("v@1", 1.0),
    ("v@1.5", 1.5),
    ("v@2", 2.0),
    ("v@2.5", 2.5),
    ("v@3", 3.0),
    ("v@4", 4.0),
    ("v@5", 5.0),
    ("v@6", 6.0),
    ("v@8", 8.0),
    ("v@10", 10.0),
    ("v@15", 15.0),
];
const POSITION_INSTANTS_S: [(&str, f64); 5] = [("x@1", 1.0), ("x@2", 2.0), ("x@3", 3.0), ("x@5", 5.0), ("x@10", 10.0)];

/// One row to be simulated.
struct Replay {
    model: ModelId,
    profile: Profile,
    case: Case,
    gap_m: f64,
    /// Number of run-up steps before the nominal start.
    run_up: u32,
}

/// Result of a replay.
struct Replayed {
    outcome: Outcome<f64>,
    /// Ego speed at each evaluated index, m/s.
    speed: Vec<f64>,
    min_ttc: f64,
    min_gap: f64,
}

/// Compares every row of a case table; one tally per category, check and model.
pub fn compare_jrc(table: &Table, profile: &Profile) -> Result<Vec<Tally>> {
    let mut tallies: Vec<Tally> = Vec::new();
    for row in table.rows() {
        let replay = Replay::of(&row, profile)?;
        let ours = replay.run();
        let kind = if table.has("variant") { row.text("variant")? } else { row.text("check")? };
        let label = format!("{} {kind}", replay.case.category.label());
        let at = match tallies.iter().position(|t| t.label == label && t.model == Some(replay.model)) {
            Some(at) => at,
            None => {
                tallies.push(Tally::new(label, Some(replay.model)));
                tallies.len() - 1
            }
        };
        compare(&mut tallies[at], &row, &replay, &ours)?;
    }
    tallies.sort_by(|a, b| a.label.cmp(&b.label).then(a.model.cmp(&b.model)));
    Ok(tallies)
}

impl Replay {
    fn of(row: &Row, profile: &Profile) -> Result<Replay> {
        let name = row.text("model")?;
        let model = ModelId::parse(name).ok_or_else(|| {
            Error::input(
                row.place("model"),
                format!("there is no model `{name}`"),
                format!("known: {}; CC_human_driver is CCHDM", ModelId::names()),
            )
        })?;
        let mut profile = profile.clone();
        match row.text("scenario")? {
            "cut_in" => Replay::cut_in(row, profile, model),
            scenario @ ("lvd" | "cut_out") => {
                if row.text("check")? == "cutin_check" {
                    profile.reg157.always_unsafe.clear();
                    profile.cchdm.always_unsafe.clear();
                }
                if scenario == "lvd" { Replay::lvd(row, profile, model) } else { Replay::cut_out(row, profile, model) }
            }
            other => Err(Error::input(
                row.place("scenario"),
                format!("there is no scenario `{other}`"),
                "known: cut_in, cut_out, lvd",
            )),
        }
    }

    fn cut_in(row: &Row, mut profile: Profile, model: ModelId) -> Result<Replay> {
        let dt = profile.frame.dt_s;
        let (v_ego, v_other) = (row.not_negative("ego_kmh")? / 3.6, row.not_negative("cutin_kmh")? / 3.6);
        let v_lateral = lateral_speed(row)?;
        let run_up = row.number("n_prepended")?;
        if !(0.0..=1e4).contains(&run_up) || run_up.fract() != 0.0 {
            return Err(Error::input(row.place("n_prepended"), format!("{run_up}"), "expected 0 or a small count"));
        }
        let run_up = run_up as u32;
        profile.frame.time_cap_s += f64::from(run_up) * dt;
        profile.cchdm.abort_on_large_ttc = row.text("variant")? == "comparison";
        let case = jrc_case::cut_in(v_ego, v_other, v_lateral, run_up, dt);
        let gap_m = jrc_case::gap_before_run_up(row.number("dist_ref")?, v_ego, v_other, run_up, dt);
        Ok(Replay { model, profile, case, gap_m, run_up })
    }

    fn lvd(row: &Row, profile: Profile, model: ModelId) -> Result<Replay> {
        let v0 = row.not_negative("v0_kmh")? / 3.6;
        let v1 = (row.number("v1_kmh")? / 3.6).max(0.0);
        let deceleration = row.not_negative("lead_dec")?;
        let case = jrc_case::lvd(v0, v1, deceleration);
        Ok(Replay { model, profile, case, gap_m: row.number("initial_gap_nominal")?, run_up: 0 })
    }

    fn cut_out(row: &Row, profile: Profile, model: ModelId) -> Result<Replay> {
        let dt = profile.frame.dt_s;
        let v0 = row.not_negative("v0_kmh")? / 3.6;
        let front = Front {
            speed_mps: row.not_negative("vfront_kmh")? / 3.6,
            length_m: row.not_negative("front_length")?,
            distance_m: row.number("front_dist")?,
        };
        let case = jrc_case::cut_out(v0, lateral_speed(row)?, front, dt);
        Ok(Replay { model, profile, case, gap_m: row.number("initial_gap_nominal")?, run_up: 0 })
    }

    fn run(&self) -> Replayed {
        let mut tables = Tables::default();
        let lane = LaneCase::encode(&self.case, &self.profile, &mut tables);
        let constants = Constants::<f64>::resolve(&self.profile, self.case.category);
        let mut speed = Vec::with_capacity(400);
        let mut steps = Vec::with_capacity(400);
        let outcome = constants.run(self.model, &lane, &tables, Start::Gap(self.gap_m), &mut |step: &Step<f64>| {
            speed.push(step.v_ego);
            steps.push(*step);
        });
        let (min_ttc, min_gap) = if self.case.category == Category::CutOut {
            last_target_minima(&self.profile, &lane, &tables, &steps)
        } else {
            (outcome.min_ttc, outcome.min_gap)
        };
        Replayed { outcome, speed, min_ttc, min_gap }
    }
}

/// A lateral speed: 0, or one at which the lane change has a manageable number of samples.
fn lateral_speed(row: &Row) -> Result<f64> {
    let value = row.not_negative("vlat")?;
    if value == 0.0 || value >= MIN_LATERAL_MPS {
        return Ok(value);
    }
    Err(Error::input(row.place("vlat"), format!("{value}"), "expected 0 or at least 0.001 m/s"))
}

/// Cut-out: the table's minima are those of the last target over the whole run, including the time before it was the
/// target.
fn last_target_minima(
    profile: &Profile,
    lane: &LaneCase<f64>,
    tables: &Tables<f64>,
    steps: &[Step<f64>],
) -> (f64, f64) {
    let last = steps.len() as u32 - 1;
    let freeze = lane.others[0].present_from;
    let target = usize::from(last < freeze);
    let (mut min_ttc, mut min_gap) = (f64::INFINITY, f64::INFINITY);
    for step in steps {
        let mut view = step.seen[target].view;
        if target == 0 && step.index < freeze {
            // The stored offset of the frozen vehicle includes its step before the freeze; here that step is removed.
            view.gap -= lane.others[0].motion.speed(tables, freeze - 1) * profile.frame.dt_s;
        }
        if view.lateral_gap < 0.0 && !view.is_behind().holds() {
            min_gap = min_gap.min(view.gap);
            if view.closing() > 0.0 {
                min_ttc = min_ttc.min(view.gap.max(0.0) / view.closing());
            }
        }
    }
    (min_ttc, min_gap)
}

fn compare(tally: &mut Tally, row: &Row, replay: &Replay, ours: &Replayed) -> Result<()> {
    let dt = replay.profile.frame.dt_s;
    let robust = row.flag("robust")?;
    let collision = row.flag("collision")?;
    let collided = ours.outcome.end == EndReason::Contact;
    tally.rows += 1;
    tally.robust += u64::from(robust);
    tally.reacted += u64::from(ours.outcome.reaction_step != NO_STEP);
    tally.collided += u64::from(collided);
    let place = |column: &str| row.place(column).to_string();
    if collided == collision {
        tally.labels_equal += 1;
    } else {
        tally.complain(format!("{}: we have {collided}, the table has {collision}", place("collision")));
    }
    let theirs = row.number("crash_type")?;
    let same_type = f64::from(ours.outcome.contact.code()) == theirs;
    if robust {
        tally.types_equal += u64::from(same_type);
        if !same_type {
            let code = ours.outcome.contact.code();
            tally.complain(format!("{}: we have {code}, the table has {theirs}", place("crash_type")));
        }
    }
    let time = |step: u32| (step != NO_STEP).then(|| f64::from(step) * dt);
    let at_impact = |value: f64| collided.then_some(value);
    let mut agrees = same_type;
    let values = [
        ("t_react [s]", "t_react", time(ours.outcome.reaction_step)),
        ("t_crash [s]", "t_crash", time(ours.outcome.contact_step)),
        ("impact speed [m/s]", "impact_speed", at_impact(ours.outcome.impact_speed)),
        ("impact closing speed [m/s]", "impact_rel_speed", at_impact(ours.outcome.impact_closing_speed)),
        ("min TTC [s]", "min_ttc", Some(ours.min_ttc)),
        ("min gap [m]", "min_gap", Some(ours.min_gap)),
    ];
    for (quantity, column, value) in values {
        agrees &= tally.value(quantity, robust, value, row.optional(column)?, &|| place(column));
    }
    // After a contact or an abort the tables are blank, and our values are skipped.
    let index = |t: f64| (t / dt).round() as usize;
    for (column, t) in SPEED_INSTANTS_S {
        let value = ours.speed.get(index(t)).copied();
        agrees &= tally.value("speed [m/s]", robust, value, row.optional(column)?, &|| place(column));
    }
    let mut position = (1.0 - f64::from(replay.run_up)) * replay.case.ego_speed_mps * dt;
    let mut positions = vec![position];
    for v in ours.speed.iter().skip(1) {
        position += v * dt;
        positions.push(position);
    }
    for (column, t) in POSITION_INSTANTS_S {
        let value = positions.get(index(t)).copied();
        agrees &= tally.value("position [m]", robust, value, row.optional(column)?, &|| place(column));
    }
    if !robust && !agrees {
        tally.fragile_different += 1;
    }
    Ok(())
}

/// Compares every row of a function table with the profile's own functions; one tally per function.
pub fn compare_functions(table: &Table, profile: &Profile) -> Result<Vec<Tally>> {
    let dt = profile.frame.dt_s;
    let fsm = profile.fsm.resolve::<f64>(dt, Category::CutIn);
    let rss = profile.rss.resolve::<f64>(dt, Category::CutIn);
    let reg157 = profile.reg157.resolve::<f64>(dt, Category::CutIn);
    let mut tallies: Vec<Tally> = Vec::new();
    for row in table.rows() {
        let name = row.text("fn")?;
        let v_ego = row.number("v_ego")?;
        let ours = match name {
            "PFS" => fsm.pfs(v_ego, row.number("v_lead")?, row.number("gap")?),
            "CFS" => fsm.cfs(v_ego, row.number("v_lead")?, row.number("gap")?, row.number("a_ego")?),
            "RSS_dlon" => rss.longitudinal_distance(v_ego, row.number("v_lead")?),
            "RSS_dlat" => rss.lateral_distance(v_ego),
            "Reg157_ttc_thr_JRC" => reg157.ttc_threshold(v_ego - row.number("v_lead")?),
            "init_dist_FSM" => native_distance_fsm(profile, v_ego),
            "init_dist_RSS" => native_distance_rss(profile, v_ego),
            "init_dist_CC" => NATIVE_THW_S * v_ego,
            other => {
                return Err(Error::input(
                    row.place("fn"),
                    format!("there is no function `{other}`"),
                    "known: PFS, CFS, RSS_dlon, RSS_dlat, Reg157_ttc_thr_JRC, init_dist_FSM, init_dist_RSS, \
                     init_dist_CC",
                ));
            }
        };
        let theirs = row.number("value")?;
        let at = match tallies.iter().position(|t| t.label == name) {
            Some(at) => at,
            None => {
                tallies.push(Tally::new(name, None));
                tallies.len() - 1
            }
        };
        let tally = &mut tallies[at];
        tally.rows += 1;
        tally.robust += 1;
        tally.labels_equal += 1;
        tally.types_equal += 1;
        tally.value("value", true, Some(ours), Some(theirs), &|| row.place("value").to_string());
    }
    Ok(tallies)
}

/// Compares this build with the shipped tables for this category and profile: leader decelerations and model functions
/// under `jrc-2021`. There are no others.
///
/// # Errors
/// None for shipped tables.
pub fn check_shipped_tables(category: Category, profile: &Profile) -> Result<Vec<Tally>> {
    let table = |name: &str, text| Table::parse(text, Path::new(name));
    let jrc = Profile::load("jrc-2021")?;
    let mut all = Vec::new();
    if *profile != jrc {
        return Ok(all);
    }
    if category == Category::Lvd {
        all.extend(compare_jrc(&table("lvd.csv", include_str!("../../../tests/golden/lvd.csv"))?, &jrc)?);
    }
    all.extend(compare_functions(&table("functions.csv", include_str!("../../../tests/golden/functions.csv"))?, &jrc)?);
    Ok(all)
}
