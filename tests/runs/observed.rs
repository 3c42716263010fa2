//! `--thw observed`: each scenario from its recorded gap.

use assert_cmd::Command;
use lanesweep::Error;
use lanesweep::engine::{CpuBackend, Executor, Headway, LaneKey, LaneRunner};
use lanesweep::model::profile::Profile;
use lanesweep::run::parts::{Job, Shard};
use lanesweep::run::sampling::{Estimator, SampleHeadways, SampleOptions, plan_samples};
use lanesweep::run::study::{Study, StudyOptions, plan_study};
use lanesweep::scenario::DataProvenance;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

fn recordings(count: usize) -> Collection {
    let options = GeneratorOptions { recordings: count, ..GeneratorOptions::default() };
    mine_generated(&options, &MiningOptions::default(), || Ok(())).unwrap()
}

fn observed() -> StudyOptions {
    StudyOptions { headways: vec![Headway::Observed], ..StudyOptions::default() }
}

fn kept(data: &Collection, category: Category) -> Vec<&Scenario> {
    data.scenarios.iter().filter(|s| s.kept && s.category == category).collect()
}

#[test]
fn s_and_every_s_prime_start_from_the_recorded_gap() {
    let data = recordings(3);
    let paper = Profile::load("paper").unwrap();
    let plan = plan_study(&data.scenarios, &paper, &observed()).unwrap();
    let imposed = StudyOptions { headways: vec![Headway::GapM(0.0)], ..StudyOptions::default() };
    let imposed = plan_study(&data.scenarios, &paper, &imposed).unwrap();
    assert_ne!(plan.hash(), imposed.hash());
    let runner = LaneRunner::<f64>::new(&plan);
    for (at, block) in plan.blocks.iter().enumerate() {
        for (unit, scenario) in kept(&data, block.category).into_iter().enumerate() {
            let gap_m = scenario.gap0.unwrap();
            for variant in 0..block.variants.len() {
                let (ours, without) = (plan.case(at, unit as u64, variant), imposed.case(at, unit as u64, variant));
                for (ours, without) in ours.others.iter().zip(&without.others) {
                    assert_eq!(ours.gap_offset, without.gap_offset + gap_m, "{}", scenario.id);
                }
                let key = LaneKey { block: at, unit: unit as u64, variant, headway: 0, model: 0 };
                let trace = runner.trace(&key);
                assert!((trace.initial_gap_m - gap_m).abs() < 1e-9, "{}", plan.key_text(&key));
                assert_eq!(plan.parse_key(&plan.key_text(&key)), Some(key));
            }
        }
    }
}

#[test]
fn shards_from_recorded_gaps_give_the_counts_of_the_whole() {
    let data = recordings(2);
    let study = Study::builder(&data, Profile::load("paper").unwrap()).options(observed()).plan().unwrap();
    let backend = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&backend);
    let dir = tempfile::tempdir().unwrap();
    for index in 0..3 {
        study.run_shard(dir.path(), Shard { index, of: 3 }, &executor).unwrap();
    }
    let (_, result) = Study::merge_parts(dir.path(), &|shard| shard.to_string()).unwrap();
    assert_eq!(result.counts, study.run(&executor).unwrap().counts);
}

#[test]
fn a_scenario_without_a_recorded_gap_is_named_and_a_mixture_of_headways_is_refused() {
    let mut data = recordings(1);
    let scenario = data.scenarios.iter_mut().find(|s| s.kept).unwrap();
    (scenario.gap0, scenario.thw0) = (None, None);
    let id = scenario.id.clone();
    let paper = Profile::load("paper").unwrap();
    let error = plan_study(&data.scenarios, &paper, &observed()).err().unwrap();
    assert!(matches!(&error, Error::Input { .. }) && error.to_string().contains(&id), "{error}");
    assert!(error.to_string().contains("gap0"), "{error}");
    let mixed = StudyOptions { headways: vec![Headway::Observed, Headway::ThwS(1.0)], ..StudyOptions::default() };
    let error = plan_study(&recordings(1).scenarios, &paper, &mixed).err().unwrap().to_string();
    assert!(error.contains("cannot be combined"), "{error}");
}

#[test]
fn a_density_without_headways_cannot_draw_observed_ones() {
    let data = recordings(2);
    let facts = DataProvenance { data: "test".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let id = Parameterization::find(Category::CutIn, "2").unwrap();
    let fit = FitOptions { valid_draws: 1000, ..FitOptions::default() };
    let density = DensityModel::fit(id, &data.scenarios, &facts, &fit).unwrap().model;
    let options = SampleOptions::new(Estimator::CRUDE, 100, SampleHeadways::Each(vec![Headway::Observed]));
    let paper = Profile::load("paper").unwrap();
    let error = plan_samples(&density, &paper, &options).err().unwrap();
    assert!(error.help().unwrap_or_default().contains("with_thw"), "{error}");
}

fn lanesweep(args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_lanesweep")).env("NO_COLOR", "1").args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn every_verb_takes_observed_headways() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let small = ["--synth-recordings", "4", "--config", "generator.duration_s=300"];
    let run = |args: &[&str]| {
        let (code, out, err) = lanesweep(args);
        assert_eq!(code, Some(0), "{args:?}: {err}");
        out
    };
    let out = path("study");
    let answer = run(&[&["-q", "study", "--thw", "observed", "--backend", "cpu", "--out", &out], &small[..]].concat());
    assert!(answer.contains("recorded THW"), "{answer}");
    let density = path("i.json");
    run(&[&["-q", "fit", "--parameterizations", "i", "--with-thw", "--out", &density], &small[..]].concat());
    let args = ["-q", "sample", &density, "--samples", "2000", "--thw", "observed", "--backend", "cpu", "--out"];
    run(&[&args[..], &[&path("sample")]].concat());
    let (code, _, err) = lanesweep(&["-q", "study", "--thw", "observed,1.0"]);
    // The drawing breaks long lines.
    let err: String = err.split(|c: char| c.is_whitespace() || c == '│').filter(|word| !word.is_empty()).collect();
    assert!(code != Some(0) && err.contains("cannotbecombined"), "{err}");
}
