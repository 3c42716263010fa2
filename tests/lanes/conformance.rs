//! Our lanes against the outputs of other people's simulators, row by row: labels equal in all rows, values in robust ones.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use lanesweep::engine::{Constants, EndReason, LaneCase, NO_STEP, Start, Step};
use lanesweep::model::driver::DriverProfile;
use lanesweep::model::scalar::Real;
use lanesweep::prelude::*;
use lanesweep::run::grid::jrc_case::{self, Front, NATIVE_THW_S, native_distance_fsm, native_distance_rss};
use lanesweep::scenario::parameterization::{ParameterizationOptions, recorded_case};
use lanesweep::scenario::{Case, Tables};

use crate::common;
use crate::common::lane_sets::run_lane;

const TOLERANCE: f64 = 1e-6;

struct Row {
    cells: HashMap<String, String>,
    place: String,
}

impl Row {
    fn text(&self, column: &str) -> &str {
        self.cells.get(column).unwrap_or_else(|| panic!("{}: no column {column}", self.place))
    }

    /// `None` if the event did not happen.
    fn optional(&self, column: &str) -> Option<f64> {
        let text = self.text(column);
        (!text.is_empty()).then(|| text.parse().unwrap_or_else(|_| panic!("{}: {column} is `{text}`", self.place)))
    }

    fn number(&self, column: &str) -> f64 {
        self.optional(column).unwrap_or_else(|| panic!("{}: {column} is empty", self.place))
    }

    fn flag(&self, column: &str) -> bool {
        self.number(column) == 1.0
    }

    fn model(&self) -> ModelId {
        ModelId::parse(self.text("model")).unwrap()
    }

    /// How our value differs from the table's. `scale` divides both.
    fn difference(&self, column: &str, ours: Option<f64>, scale: f64) -> Option<String> {
        let theirs = self.optional(column);
        let is_equal = match (ours, theirs) {
            (Some(a), Some(b)) => a == b || (a - b).abs() <= TOLERANCE * scale,
            _ => ours == theirs,
        };
        (!is_equal).then(|| format!("{}, {column}: we have {ours:?}, the table {theirs:?}", self.place))
    }
}

fn rows(path: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let read = reader.deserialize().enumerate();
    read.map(|(at, cells)| Row { cells: cells.unwrap(), place: format!("{}:{}", path.display(), at + 2) }).collect()
}

/// The outcome of a lane, its steps, and the minima of TTC and gap.
type Ran = (Outcome<f64>, Vec<Step<f64>>, [f64; 2]);

struct Replay {
    model: ModelId,
    profile: Profile,
    case: Case,
    gap_m: f64,
    /// Number of run-up steps before the nominal start.
    run_up: u32,
}

impl Replay {
    fn of(row: &Row, profile: &Profile) -> Replay {
        let (model, mut profile, mps) = (row.model(), profile.clone(), |column| row.number(column) / 3.6);
        let dt = profile.frame.dt_s;
        if row.text("scenario") == "cut_in" {
            let (v_ego, v_other, run_up) = (mps("ego_kmh"), mps("cutin_kmh"), row.number("n_prepended") as u32);
            profile.frame.time_cap_s += f64::from(run_up) * dt;
            profile.cchdm.abort_on_large_ttc = row.text("variant") == "comparison";
            let case = jrc_case::cut_in(v_ego, v_other, row.number("vlat"), run_up, dt);
            let gap_m = jrc_case::gap_before_run_up(row.number("dist_ref"), v_ego, v_other, run_up, dt);
            return Replay { model, profile, case, gap_m, run_up };
        }
        if row.text("check") == "cutin_check" {
            profile.reg157.always_unsafe.clear();
            profile.cchdm.always_unsafe.clear();
        }
        let case = if row.text("scenario") == "lvd" {
            jrc_case::lvd(mps("v0_kmh"), mps("v1_kmh").max(0.0), row.number("lead_dec"))
        } else {
            let (length_m, distance_m) = (row.number("front_length"), row.number("front_dist"));
            let front = Front { speed_mps: mps("vfront_kmh"), length_m, distance_m };
            jrc_case::cut_out(mps("v0_kmh"), row.number("vlat"), front, dt)
        };
        Replay { model, profile, case, gap_m: row.number("initial_gap_nominal"), run_up: 0 }
    }

    /// The outcome, every step, and the minima of TTC and gap as the tables have them.
    fn run(&self) -> Ran {
        let (mut tables, mut steps) = (Tables::default(), Vec::new());
        let lane = LaneCase::encode(&self.case, &self.profile, &mut tables);
        let constants = Constants::<f64>::resolve(&self.profile, self.case.category);
        let mut keep = |step: &Step<f64>| steps.push(*step);
        let outcome = run_lane(&constants, self.model, (&lane, &tables), Start::Gap(self.gap_m), &mut keep);
        let mut minima = [outcome.min_ttc, outcome.min_gap];
        if self.case.category == Category::CutOut {
            minima = last_target_minima(&self.profile, &lane, &tables, &steps);
        }
        (outcome, steps, minima)
    }
}

/// Cut-out: the table's minima are those of the last target over the whole run, including the time before it was the
/// target.
fn last_target_minima(profile: &Profile, lane: &LaneCase<f64>, tables: &Tables<f64>, steps: &[Step<f64>]) -> [f64; 2] {
    let freeze = lane.others[0].present_from;
    let target = usize::from((steps.len() as u32 - 1) < freeze);
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
    [min_ttc, min_gap]
}

fn time(step: u32, dt: f64) -> Option<f64> {
    (step != NO_STEP).then(|| f64::from(step) * dt)
}

/// Differences of one lane from its row of a JRC case table.
fn case_differences(row: &Row, replay: &Replay, (ours, steps, minima): &Ran) -> Vec<String> {
    let dt = replay.profile.frame.dt_s;
    let collided = ours.end == EndReason::Contact;
    let label = row.difference("collision", Some(f64::from(u8::from(collided))), 1.0);
    if !row.flag("robust") {
        return label.into_iter().collect();
    }
    let at_impact = |value: f64| collided.then_some(value);
    let mut values = vec![
        ("crash_type", Some(f64::from(ours.contact.code()))),
        ("t_react", time(ours.reaction_step, dt)),
        ("t_crash", time(ours.contact_step, dt)),
        ("impact_speed", at_impact(ours.impact_speed)),
        ("impact_rel_speed", at_impact(ours.impact_closing_speed)),
        ("min_ttc", Some(minima[0])),
        ("min_gap", Some(minima[1])),
    ];
    let mut positions = vec![(1.0 - f64::from(replay.run_up)) * replay.case.ego_speed_mps * dt];
    steps.iter().skip(1).for_each(|step| positions.push(positions[positions.len() - 1] + step.v_ego * dt));
    // Columns such as `v@2.5` and `x@3`: speed and position at an instant, blank after the lane's end.
    for column in row.cells.keys() {
        if let Some((quantity, at)) = column.split_once('@') {
            let index = (at.parse::<f64>().unwrap() / dt).round() as usize;
            let speed = steps.get(index).map(|step| step.v_ego);
            values.push((column, if quantity == "v" { speed } else { positions.get(index).copied() }));
        }
    }
    label.into_iter().chain(values.into_iter().filter_map(|(column, ours)| row.difference(column, ours, 1.0))).collect()
}

/// Differences of all rows of a JRC case table. Every model must react and collide in some row of every kind, if that is
/// `asked`.
fn jrc_differences(rows: &[Row], asked: bool) -> Vec<String> {
    let profile = Profile::load("jrc-2021").unwrap();
    let [mut all, mut reacted, mut collided] = [BTreeSet::new(), BTreeSet::new(), BTreeSet::new()];
    let mut differences = Vec::new();
    for row in rows {
        let replay = Replay::of(row, &profile);
        let ran = replay.run();
        differences.extend(case_differences(row, &replay, &ran));
        let kind = (row.cells.get("variant").or(row.cells.get("check")), replay.model);
        all.insert(kind);
        reacted.extend((ran.0.reaction_step != NO_STEP).then_some(kind));
        collided.extend((ran.0.end == EndReason::Contact).then_some(kind));
    }
    assert!(!asked || (reacted == all && collided == all), "{all:?} {reacted:?} {collided:?}");
    differences
}

#[test]
fn surrogates_distances_and_thresholds_equal_the_jrc_functions() {
    let rows = rows(&common::golden("functions.csv"));
    assert_eq!(rows.len(), 1165);
    let profile = Profile::load("jrc-2021").unwrap();
    let dt = profile.frame.dt_s;
    let fsm = profile.fsm.resolve::<f64>(dt, Category::CutIn);
    let rss = profile.rss.resolve::<f64>(dt, Category::CutIn);
    let reg157 = profile.reg157.resolve::<f64>(dt, Category::CutIn);
    let differences: Vec<String> = rows
        .iter()
        .filter_map(|row| {
            let (v_ego, v_lead, gap) = (row.number("v_ego"), || row.number("v_lead"), || row.number("gap"));
            let ours = match row.text("fn") {
                "PFS" => fsm.pfs(v_ego, v_lead(), gap()),
                "CFS" => fsm.cfs(v_ego, v_lead(), gap(), row.number("a_ego")),
                "RSS_dlon" => rss.longitudinal_distance(v_ego, v_lead()),
                "RSS_dlat" => rss.lateral_distance(v_ego),
                "Reg157_ttc_thr_JRC" => reg157.ttc_threshold(v_ego - v_lead()),
                "init_dist_FSM" => native_distance_fsm(&profile, v_ego),
                "init_dist_RSS" => native_distance_rss(&profile, v_ego),
                "init_dist_CC" => NATIVE_THW_S * v_ego,
                other => panic!("there is no function {other}"),
            };
            row.difference("value", Some(ours), 1.0)
        })
        .collect();
    assert!(differences.is_empty(), "{differences:#?}");
}

#[test]
fn every_case_of_the_jrc_ends_as_in_its_simulator() {
    let shared = |name| common::shared(&format!("golden/jrc/{name}.csv"));
    let tables = [(Some(common::golden("lvd.csv")), 718), (shared("cutin"), 2158), (shared("cutout"), 1726)];
    for (path, count) in tables.into_iter().filter_map(|(path, count)| Some((path?, count))) {
        let rows = rows(&path);
        assert_eq!(rows.len(), count);
        let differences = jrc_differences(&rows, count == 718);
        assert!(differences.is_empty(), "{differences:#?}");
    }
}

#[test]
fn a_wrong_value_in_a_table_is_found_with_its_line() {
    let mut rows = rows(&common::golden("lvd.csv"));
    rows.truncate(2);
    for (column, wrong) in [("collision", "0"), ("crash_type", "1"), ("t_react", ""), ("v@2", "8.33334")] {
        let right = rows[0].cells.insert(column.to_owned(), wrong.to_owned()).unwrap();
        let differences = jrc_differences(&rows, false);
        assert_eq!(differences.len(), 1, "{column}: {differences:#?}");
        assert!(differences[0].contains(&format!("lvd.csv:2, {column}: ")), "{differences:#?}");
        rows[0].cells.insert(column.to_owned(), right);
    }
}

/// The script that compares a table of somebody else's simulator.
#[test]
fn the_script_finds_equal_and_wrong_and_missing_rows() {
    let golden = common::golden("lvd.csv");
    let text = std::fs::read_to_string(&golden).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let own = dir.path().join("own.csv");
    let compared = |own_text: &str| {
        std::fs::write(&own, own_text).unwrap();
        let script = [common::golden("compare.py"), golden.clone(), own.clone()];
        let output = std::process::Command::new("python3").args(script).output().ok()?;
        Some((output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned()))
    };
    let Some(equal) = compared(&text) else { return common::skipped("needs python3") };
    assert_eq!(equal.0, Some(0), "{}", equal.1);
    let wrong = text.replacen(",1,2,2.5,", ",0,2,2.5,", 1);
    let fewer: Vec<&str> = text.lines().take(700).collect();
    let fewer = fewer.join("\n");
    for (own_text, status, says) in [
        (wrong.as_str(), 1, "lvd.csv:2: collision is 1, yours 0"),
        (fewer.as_str(), 1, "19 are missing"),
        ("scenario,model\nlvd,FSM\n", 2, ""),
        ("", 2, ""),
    ] {
        let (code, said) = compared(own_text).unwrap();
        assert!(code == Some(status) && said.contains(says), "{code:?}: {said}");
    }
}

/// Differences of a lane of the `paper` profile from its row.
fn lane_differences(row: &Row, ours: &Outcome<f64>, dt: f64) -> Vec<String> {
    let collided = ours.contact_step != NO_STEP;
    let verdicts = Criterion::ALL.map(|of| (of.key(), Some(f64::from(u8::from(ours.verdicts.failed(of))))));
    let values = [
        ("crash_type", Some(f64::from(ours.contact.code()))),
        ("min_ttc", Some(ours.min_ttc)),
        ("max_btn", Some(ours.max_btn)),
        ("t_react", time(ours.reaction_step, dt)),
        ("t_crash", time(ours.contact_step, dt)),
        ("impact_speed", collided.then_some(ours.impact_speed)),
    ];
    // The table rounds to nine digits, so large values have fewer decimals.
    let scale = |column: &str| row.optional(column).filter(|value| value.is_finite()).map_or(1.0, |v| v.abs().max(1.0));
    let all = verdicts.into_iter().chain(values);
    all.filter_map(|(column, ours)| row.difference(column, ours, scale(column))).collect()
}

fn run<R: Real>(
    constants: &[Constants<R>],
    (model, category): (ModelId, Category),
    (case, tables): (&LaneCase<R>, &Tables<R>),
    start: Start<R>,
) -> Outcome<f64> {
    let at = Category::ALL.iter().position(|known| *known == category).unwrap();
    run_lane(&constants[at], model, (case, tables), start, &mut |_| ()).widen()
}

#[test]
fn every_lane_of_the_paper_profile_equals_an_independent_implementation_in_f64_and_f32() {
    let scenarios = read_scenarios(&common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    let rows = rows(&common::golden("paper_sumo_01_02_lanes.csv"));
    assert_eq!(rows.len(), 3400);
    let profile = Profile::load("paper").unwrap();
    let dt = profile.frame.dt_s;
    // The golden lanes approximate the sinusoid by 201 points; all other options are the defaults.
    let options = ParameterizationOptions { sinusoid_intervals: 200, ..ParameterizationOptions::default() };
    let constants64 = Category::ALL.map(|category| Constants::<f64>::resolve(&profile, category));
    let constants32 = Category::ALL.map(|category| Constants::<f32>::resolve(&profile, category));
    type Encoded = (LaneCase<f64>, Tables<f64>);
    let mut encoded: HashMap<(&str, &str), Encoded> = HashMap::new();
    let (mut differences, mut ties) = (Vec::new(), Vec::new());
    for row in &rows {
        let (id, key) = (row.text("id"), row.text("param"));
        let scenario = scenarios.iter().find(|scenario| scenario.id == id).unwrap();
        let (case, tables) = encoded.entry((id, key)).or_insert_with(|| {
            let case = match key {
                "S" => recorded_case(scenario, dt).unwrap(),
                _ => {
                    let found = Parameterization::find(scenario.category, key).unwrap();
                    found.case(scenario, dt, &options, None).unwrap()
                }
            };
            let mut tables = Tables::default();
            (LaneCase::encode(&case, &profile, &mut tables), tables)
        });
        let (driven, thw, exact) = ((row.model(), scenario.category), row.number("thw"), (&*case, &*tables));
        let in_f64 = run(&constants64, driven, exact, Start::Headway(thw));
        let in_f32 = run(&constants32, driven, (&case.cast(), &tables.cast()), Start::Headway(f32::from_f64(thw)));
        if in_f64.verdicts != in_f32.verdicts {
            differences.push(format!("{}: the verdicts in f32 differ", row.place));
        }
        if !row.flag("robust") {
            continue;
        }
        let found = lane_differences(row, &in_f64, dt);
        // The table's flag moves the gap but compares verdicts only. If a change of 1e-9 m gives the table's values,
        // rounding decides.
        let nudged = |nudge_m: &f64| run(&constants64, driven, exact, Start::Gap(thw * case.ego_speed + nudge_m));
        let is_tie = || [1e-9, -1e-9].iter().any(|nudge_m| lane_differences(row, &nudged(nudge_m), dt).is_empty());
        if !found.is_empty() && is_tie() {
            ties.push(&row.place);
        } else {
            differences.extend(found);
        }
    }
    assert!(differences.is_empty(), "{differences:#?}");
    // Six lanes chatter around |TTC| = 2 s exactly; exact rational arithmetic gives the table's values.
    assert!(ties.len() <= 6, "{ties:?}");
}
