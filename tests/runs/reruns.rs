//! Any lane of a finished run, run again from the run's folder and the lane's key, is the run's lane: the same words.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::common::mined::scenarios_of;
use crate::common::plans::mixed;
use crate::common::program::{json, lanesweep, ran, table, words};
use lanesweep::Place;
use lanesweep::engine::{Backend, CpuBackend, LanePlan, LaneRunner, Outcome, Wanted, words as bits};
use lanesweep::model::profile::Profile;
use lanesweep::run::parts::read_sealed_line;
use lanesweep::run::study::{StudyHead, StudyOptions, plan_study};

type Row = BTreeMap<String, String>;

/// A number below `below`.
fn drawn(index: u64, below: u64) -> u64 {
    mixed(157, index) % below
}

/// The plan that a study left in its folder, read as a process does that recomputes nothing.
fn left_plan(path: &Path) -> LanePlan {
    #[derive(serde::Deserialize)]
    struct File {
        plan: StudyHead,
    }
    let (file, _, mut records) = read_sealed_line::<File>("study plan", path, 1 << 26, "").unwrap();
    let study = file.plan.read(&mut records, &Place::file(path), |units| 0..units).unwrap();
    study.window(0..study.outline().unit_count()).unwrap()
}

fn key_of(row: &Row) -> String {
    format!("{}/{}/{}/{}", row["id"], row["variant"], row["headway"], row["model"])
}

/// Reruns a lane by the program and compares with the study's row, every number that both have.
fn compare_with_row(dir: &Path, from: &str, row: &Row, wide: bool) {
    let key = key_of(row);
    let simulate = format!("simulate --from {from} --lane {key}");
    let (_, series, summary) = lanesweep(dir, &words(&simulate));
    // The summary is for people; the document has every digit.
    let document: serde_json::Value = ran(dir, &format!("{simulate} --format json")).parse().unwrap();
    let outcome = &document["lanes"][0]["outcome"];
    for (name, column) in [("Collision", "collision"), ("TTC", "ttc"), ("BTN", "btn")] {
        let verdict = if row[column] == "1" { "FAIL" } else { "pass" };
        assert!(summary.contains(&format!("{name} {verdict}")), "{key}: {summary}");
    }
    for name in ["min_ttc_s", "max_btn", "end_s", "reaction_s", "contact_type", "impact_speed_mps", "contact_s"] {
        let found = if outcome[name] == "Infinity" { Some(f64::INFINITY) } else { outcome[name].as_f64() };
        let (theirs, ours) = (row[name].parse::<f64>().ok(), found);
        // The study's table has the shortest text of the arithmetic's number.
        let is_same = if wide { theirs == ours } else { theirs.map(|x| x as f32) == ours.map(|x| x as f32) };
        assert!(
            is_same || name == "impact_speed_mps" && row["contact_type"] == "0",
            "{key}: {name} is {theirs:?}, rerun {ours:?}"
        );
    }
    assert_eq!(row["reaction_s"].is_empty(), summary.contains("reacted: never"), "{key}: {summary}");
    let last = series.lines().last().unwrap();
    assert_eq!(last.ends_with("contact"), row["contact_type"] != "0", "{key}: {last}");
    assert_eq!(summary.contains("f64"), !wide, "what f64 gives is said beside f32: {summary}");
}

#[test]
fn random_lanes_of_a_study_are_the_studys_lanes() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, "-q study --synth-recordings 12 --backend cpu --out result");
    // The study itself, as it sweeps: in batches, on the widest instructions.
    let options = StudyOptions { folds: Some(5), ..StudyOptions::default() };
    let study = plan_study(scenarios_of(12), &Profile::load("paper").unwrap(), &options).unwrap();
    let mut session = CpuBackend::lane_arithmetic().prepare(&study).unwrap();
    let outcomes: Vec<Outcome<f64>> = session.run(0..study.unit_count(), Wanted::Outcomes).unwrap().outcomes;
    assert_eq!(outcomes.len() as u64, study.lane_count());
    // The reruns: from the folder.
    let plan = left_plan(&dir.join("result/run-plan.json"));
    assert_eq!(plan.hash(), study.hash());
    assert_eq!(json(&dir.join("result/run.json"))["plan_sha256"], plan.hash());
    let runner = LaneRunner::<f32>::new(&plan);
    let mut seen = BTreeSet::new();
    for index in 0..500 {
        let lane = drawn(index, study.lane_count());
        let text = study.key_text(&study.key(lane).unwrap());
        let key = plan.parse_key(&text).unwrap();
        let trace = runner.trace(&key);
        assert_eq!(bits(&trace.outcome), bits(&outcomes[lane as usize]), "{text}");
        assert_eq!(trace.steps.len() as u64, u64::from(trace.outcome.end_step) + 1, "{text}");
        seen.insert(format!("category {}", key.block));
        seen.insert(format!("variant {} {}", key.block, key.variant));
        seen.insert(format!("headway {}", key.headway));
        seen.insert(format!("model {}", key.model));
    }
    let variants: usize = plan.blocks.iter().map(|block| block.variants.len()).sum();
    assert_eq!(seen.len(), plan.blocks.len() + variants + plan.headways.len() + plan.models.len(), "{seen:?}");
}

const STUDY: &str = "-q study --synth-recordings 2 --thw 0.4,1.2";

/// The table of a study of two recordings.
fn study(dir: &Path, more: &str) -> Vec<Row> {
    ran(dir, &format!("{STUDY} --rows lanes.csv {more}"));
    table(&dir.join("lanes.csv"))
}

#[test]
fn a_rerun_takes_profile_time_step_options_and_arithmetic_from_the_run() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    std::fs::write(dir.join("study.toml"), "[parameterization]\nafter_duration = \"unlimited\"\n").unwrap();
    let base = "--config study.toml --profile un-r157 --dt 0.1 --out";
    for (out, flags) in [("narrow", "--backend cpu"), ("wide", "--config study.reference=true")] {
        let table = study(dir, &format!("{base} {out} {flags}"));
        for index in 0..6 {
            compare_with_row(dir, out, &table[drawn(index, table.len() as u64) as usize], out == "wide");
        }
    }
}
