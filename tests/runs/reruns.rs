//! Any lane of a finished run, run again from the run's folder and the lane's key, is the run's lane: the same words.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::sync::OnceLock;

use crate::common::program::{flat, lanesweep};
use lanesweep::Place;
use lanesweep::engine::{Backend, CpuBackend, Headway, LanePlan, LaneRunner, Outcome, Wanted, words};
use lanesweep::model::driver::MODELS;
use lanesweep::model::profile::Profile;
use lanesweep::run::parts::read_sealed_line;
use lanesweep::run::sampling::{Estimator, SampleHeadways, SampleOptions, plan_samples};
use lanesweep::run::study::{StudyHead, StudyOptions, plan_study};
use lanesweep::scenario::DataProvenance;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::traffic::mining::{MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

type Row = HashMap<String, String>;

fn done(dir: &Path, args: &[&str]) -> (String, String) {
    let (code, out, err) = lanesweep(dir, args);
    assert_eq!(code, 0, "{args:?}: {err}");
    (out, err)
}

fn refused(dir: &Path, args: &[&str], code: i32, said: &str) {
    let (found, out, err) = lanesweep(dir, args);
    let err = flat(&err);
    assert!(found == code && out.is_empty() && err.contains(said), "{args:?} gave {found}: {err}");
}

/// A well-mixed number below `below` (SplitMix64).
fn drawn(index: u64, below: u64) -> u64 {
    let mut z = (157 + index).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ (z >> 31)) % below
}

/// The scenarios of the default study.
fn scenarios() -> &'static [Scenario] {
    static MINED: OnceLock<Vec<Scenario>> = OnceLock::new();
    MINED.get_or_init(|| {
        let generator = GeneratorOptions { recordings: 24, ..GeneratorOptions::default() };
        mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios
    })
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

fn rows(path: &Path) -> Vec<Row> {
    csv::Reader::from_path(path).unwrap().deserialize().map(Result::unwrap).collect()
}

fn key_of(row: &Row) -> String {
    format!("{}/{}/{}s/{}", row["id"], row["param"], row["thw"], row["model"])
}

/// Reruns a lane by the program and compares with the study's row, every field.
fn compare_with_row(dir: &Path, from: &str, row: &Row, wide: bool) {
    let key = key_of(row);
    let (series, summary) = done(dir, &["simulate", "--from", from, "--lane", &key]);
    // The summary is for people; the document has every digit.
    let (document, _) = done(dir, &["simulate", "--from", from, "--lane", &key, "--format", "json"]);
    let document: serde_json::Value = serde_json::from_str(&document).unwrap();
    let outcome = &document["lanes"][0]["outcome"];
    let word = |name: &str| match &outcome[name] {
        serde_json::Value::String(text) if text == "Infinity" => f64::INFINITY.to_string(),
        number => number.as_f64().unwrap().to_string(),
    };
    for (name, column) in [("Collision", "collision"), ("TTC", "ttc"), ("BTN", "btn")] {
        let verdict = if row[column] == "1" { "FAIL" } else { "pass" };
        assert!(summary.contains(&format!("{name} {verdict}")), "{key}: {summary}");
    }
    let same = |column: &str, found: &str| {
        let (theirs, ours): (f64, f64) = (row[column].parse().unwrap(), found.parse().unwrap());
        // The study's table has the shortest text of the arithmetic's number.
        let is_same = if wide { theirs == ours } else { theirs as f32 == ours as f32 };
        assert!(is_same, "{key}: {column} is {theirs}, rerun {ours}");
    };
    same("min_ttc", &word("min_ttc_s"));
    same("max_btn", &word("max_btn"));
    same("t_end", &word("end_s"));
    assert_eq!(row["t_react"].is_empty(), outcome["reaction_s"].is_null(), "{key}");
    assert_eq!(row["t_react"].is_empty(), summary.contains("reacted: never"), "{key}: {summary}");
    if !row["t_react"].is_empty() {
        same("t_react", &word("reaction_s"));
    }
    let contact = ["nothing", "side contact, closing at ", "rear-end contact, closing at "];
    let contact = contact[row["crash_type"].parse::<usize>().unwrap()];
    assert_eq!(row["crash_type"] == "0", !summary.contains("contact, closing at"), "{key}: {summary}");
    if row["crash_type"] != "0" {
        assert!(summary.contains(contact), "{key}: {summary}");
        assert_eq!(word("contact_type"), row["crash_type"]);
        same("impact_speed", &word("impact_speed_mps"));
        same("t_crash", &word("contact_s"));
    }
    let last = series.lines().last().unwrap();
    same("t_end", last.split(',').next().unwrap());
    assert_eq!(last.ends_with("contact"), row["crash_type"] != "0", "{key}: {last}");
    assert_eq!(summary.contains("f64"), !wide, "what f64 gives is said beside f32: {summary}");
}

#[test]
fn a_thousand_random_lanes_of_the_default_study_are_the_studys_lanes() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    done(dir, &["-q", "study", "--synth-recordings", "24", "--backend", "cpu", "--out", "result"]);
    // The study itself, as it sweeps: in batches, on the widest instructions.
    let study = plan_study(scenarios(), &Profile::load("paper").unwrap(), &StudyOptions::default()).unwrap();
    let mut session = CpuBackend::lane_arithmetic().prepare(&study).unwrap();
    let outcomes: Vec<Outcome<f64>> = session.run(0..study.unit_count(), Wanted::Outcomes).unwrap().outcomes;
    assert_eq!(outcomes.len() as u64, study.lane_count());
    // The reruns: from the folder.
    let plan = left_plan(&dir.join("result/run-plan.json"));
    assert_eq!(plan.hash(), study.hash());
    let record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("result/run.json")).unwrap()).unwrap();
    assert_eq!(record["plan_sha256"], plan.hash());
    let runner = LaneRunner::<f32>::new(&plan);
    let mut seen = BTreeSet::new();
    for index in 0..1000 {
        let lane = drawn(index, study.lane_count());
        let text = study.key_text(&study.key(lane).unwrap());
        let key = plan.parse_key(&text).unwrap();
        let trace = runner.trace(&key);
        assert_eq!(words(&trace.outcome), words(&outcomes[lane as usize]), "{text}");
        assert_eq!(trace.steps.len() as u64, u64::from(trace.outcome.end_step) + 1, "{text}");
        seen.insert(format!("category {}", key.block));
        seen.insert(format!("variant {} {}", key.block, key.variant));
        seen.insert(format!("headway {}", key.headway));
        seen.insert(format!("model {}", key.model));
    }
    let variants: usize = plan.blocks.iter().map(|block| block.variants.len()).sum();
    assert_eq!(seen.len(), plan.blocks.len() + variants + plan.headways.len() + plan.models.len(), "{seen:?}");
}

#[test]
fn lanes_run_again_by_the_program_are_the_rows_of_the_studys_table() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let study = ["-q", "study", "--synth-recordings", "2", "--backend", "cpu", "--out", "r", "--rows", "lanes.csv"];
    done(dir, &study);
    let table = rows(&dir.join("lanes.csv"));
    for index in 1000..1012 {
        compare_with_row(dir, "r", &table[drawn(index, table.len() as u64) as usize], false);
    }
    let crash = table.iter().find(|row| row["crash_type"] != "0").unwrap();
    compare_with_row(dir, "r", crash, false);
}

#[test]
fn sampled_lanes_are_the_runs_lanes_too() {
    let profile = Profile::load("paper").unwrap();
    let facts =
        DataProvenance { data: "synthetic".to_owned(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let options = FitOptions { valid_draws: 1000, ..FitOptions::default() };
    let mut lanes = 0;
    for (category, key) in [(Category::CutIn, "2"), (Category::CutOut, "b"), (Category::Lvd, "iv")] {
        let id = Parameterization::find(category, key).unwrap();
        let density = DensityModel::fit(id, scenarios(), &facts, &options).unwrap().model;
        let options = SampleOptions {
            seed: 3,
            ..SampleOptions::new(
                Estimator::CRUDE,
                5000,
                SampleHeadways::Each(vec![Headway::ThwS(1.4), Headway::ThwS(0.4)]),
            )
        };
        let plan = plan_samples(&density, &profile, &options).unwrap();
        let outcomes = CpuBackend::lane_arithmetic().prepare(&plan).unwrap();
        let outcomes = { outcomes }.run(0..plan.unit_count(), Wanted::Outcomes).unwrap().outcomes;
        let runner = LaneRunner::<f32>::new(&plan);
        for index in 0..300 {
            let lane = drawn(index, plan.lane_count());
            let key = plan.key(lane).unwrap();
            if plan.generator().unwrap().draw(key.unit).is_void() {
                continue;
            }
            assert_eq!(words(&runner.trace(&key).outcome), words(&outcomes[lane as usize]), "{}", plan.key_text(&key));
            lanes += 1;
        }
    }
    assert!(lanes > 800, "{lanes}");
}

#[test]
fn a_rerun_takes_profile_time_step_options_and_arithmetic_from_the_run() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    std::fs::write(dir.join("study.toml"), "[parameterization]\nafter_duration = \"unlimited\"\n").unwrap();
    let base =
        ["-q", "study", "--synth-recordings", "2", "--config", "study.toml", "--profile", "un-r157", "--dt", "0.1"];
    for (out, flags) in [("narrow", &["--backend", "cpu"][..]), ("wide", &["--config", "study.reference=true"])] {
        let lanes = format!("{out}.csv");
        done(dir, &[&base[..], flags, &["--out", out, "--rows", &lanes]].concat());
        let table = rows(&dir.join(&lanes));
        for index in 0..6 {
            compare_with_row(dir, out, &table[drawn(index, table.len() as u64) as usize], out == "wide");
        }
    }
}

#[test]
fn a_lane_of_a_run_in_parts_can_be_looked_at_before_and_after_the_merge() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let study = ["-q", "study", "--synth-recordings", "2", "--backend", "cpu"];
    done(dir, &[&study[..], &["--out", "whole", "--rows", "lanes.csv"]].concat());
    done(dir, &[&study[..], &["--out", "parts", "--shard", "0/2"]].concat());
    let table = rows(&dir.join("lanes.csv"));
    let key = key_of(&table[table.len() / 2]);
    let trace = |from: &str| done(dir, &["simulate", "--from", from, "--lane", &key]);
    let of_whole = trace("whole");
    assert_eq!(trace("parts"), of_whole);
    done(dir, &[&study[..], &["--out", "parts", "--shard", "1/2"]].concat());
    done(dir, &["-q", "merge", "parts"]);
    assert_eq!(trace("parts"), of_whole);
    // A sampling run's parts as well.
    let fit = ["-q", "fit", "--synth-recordings", "3", "--categories", "cut-in", "--parameterizations", "2"];
    done(dir, &[&fit[..], &["--out", "densities"]].concat());
    let sample = ["-q", "sample", "densities/cut-in-2.json", "--samples", "3000", "--thw", "0.6", "--backend", "cpu"];
    done(dir, &[&sample[..], &["--out", "sampled"]].concat());
    done(dir, &[&sample[..], &["--out", "shard", "--shard", "1/2"]].concat());
    let trace = |from: &str| done(dir, &["simulate", "--from", from, "--lane", "#77/2/0.6s/FSM", "--models", "all"]);
    assert_eq!(trace("shard"), trace("sampled"));
}

#[test]
fn models_and_variants_stand_together_in_the_table_and_on_the_sheet() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    done(dir, &["-q", "study", "--synth-recordings", "2", "--backend", "cpu", "--out", "r", "--rows", "lanes.csv"]);
    let table = rows(&dir.join("lanes.csv"));
    let row = table.iter().find(|row| row["category"] == "cut_in" && row["param"] == "2").unwrap();
    let key = key_of(row);
    let of_lane = |flags: &[&str]| done(dir, &[&["simulate", "--from", "r", "--lane", &key][..], flags].concat()).0;
    let lanes = |table: &str| {
        let mut lanes: Vec<String> = Vec::new();
        for line in table.lines().skip(1) {
            let lane = line.split(',').next().unwrap();
            if lanes.last().is_none_or(|last| last != lane) {
                lanes.push(lane.to_owned());
            }
        }
        lanes
    };
    let alone = of_lane(&["--plot", "one.svg"]);
    let compared = of_lane(&["--compare", "--plot", "two.svg"]);
    let [recorded, own] = &lanes(&compared)[..] else { panic!("two lanes") };
    assert!(recorded.contains("/S/") && own.contains("/2/"), "S first: {recorded}, {own}");
    // The rows of the lane itself are those that it has alone.
    let rows_of_own: Vec<&str> = compared.lines().filter_map(|line| line.strip_prefix(&format!("{own},"))).collect();
    assert_eq!(rows_of_own, alone.lines().skip(1).collect::<Vec<_>>());
    assert_eq!(lanes(&of_lane(&["--models", "all", "--plot", "figures/all.svg"])).len(), MODELS);
    assert_eq!(lanes(&of_lane(&["--models", "RSS,FSM", "--compare", "S,1"])).len(), 6);
    for (figure, names) in [("one.svg", 1), ("two.svg", 2), ("figures/all.svg", MODELS)] {
        let svg = std::fs::read_to_string(dir.join(figure)).unwrap();
        assert!(svg.contains("SYNTHETIC DATA"), "{figure} says what its data are");
        assert_eq!(svg.matches("class=\"legend\"").count(), names, "{figure}");
    }
    refused(dir, &["simulate", "--from", "r", "--lane", &key, "--compare", "2"], 2, "this is the lane itself");
    refused(dir, &["simulate", "--from", "r", "--lane", &key, "--compare", "zz"], 2, "use S, 1, 2");
    refused(dir, &["simulate", "--from", "r", "--lane", "nobody/S/1s/FSM"], 2, "for instance");
    refused(dir, &["simulate", "--from", "r", "--lane", &key, "--plot", "one.png"], 2, "ends in .svg");
    refused(dir, &["simulate", "--from", "r", "--lane", &key, "--plot", "r/radar-lvd.svg"], 2, "a result of the run");
}

#[test]
fn a_folder_without_its_plan_says_how_to_make_it() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let study = ["-q", "study", "--synth-recordings", "2", "--backend", "cpu"];
    done(dir, &[&study[..], &["--out", "r", "--config", "study.keep_plan=never", "--rows", "lanes.csv"]].concat());
    assert!(!dir.join("r/run-plan.json").exists());
    let key = key_of(&rows(&dir.join("lanes.csv"))[0]);
    let rerun = ["simulate", "--from", "r", "--lane", &key];
    refused(dir, &rerun, 3, "there is no plan of its lanes beside it");
    refused(dir, &["simulate", "--from", ".", "--lane", &key], 3, "there is no run here");
    // Another study's plan is not taken for it; its own, made later, is.
    let only = |dt: &str| done(dir, &[&study[..], &["--dt", dt, "--plan-only", "--out", &format!("p{dt}")]].concat());
    only("0.08");
    std::fs::copy(dir.join("p0.08/plan.json"), dir.join("r/plan.json")).unwrap();
    refused(dir, &rerun, 3, "is not the plan that it records");
    only("0.04");
    std::fs::copy(dir.join("p0.04/plan.json"), dir.join("r/plan.json")).unwrap();
    done(dir, &rerun);
    // A damaged plan is refused.
    let mut text = std::fs::read(dir.join("r/plan.json")).unwrap();
    let at = text.len() / 2;
    text[at] ^= 1;
    std::fs::write(dir.join("r/plan.json"), text).unwrap();
    let (code, _, err) = lanesweep(dir, &rerun);
    assert_eq!(code, 3, "{err}");
}
