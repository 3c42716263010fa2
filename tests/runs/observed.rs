//! `--thw observed`: each scenario from its recorded gap; and how many failures come from close following.

use assert_cmd::Command;
use lanesweep::Error;
use lanesweep::engine::{CpuBackend, Executor, Headway, LaneKey, LaneRunner, Partial, Wanted};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::close_following::{CloseFollowing, close_units};
use lanesweep::run::parts::{Job, Shard};
use lanesweep::run::sampling::{Estimator, SampleHeadways, SampleOptions, SampleTally, plan_samples};
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
    let (merged, result) = Study::merge_parts(dir.path(), &|shard| shard.to_string()).unwrap();
    assert_eq!(result.counts, study.run(&executor).unwrap().counts);
    for (ours, theirs) in merged.facts().categories.iter().zip(&study.facts().categories) {
        assert_eq!(ours.close_units, theirs.close_units);
    }
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

/// Every lane of S of a plan, by (block, unit, headway, model).
fn failures_below(
    data: &Collection,
    options: &StudyOptions,
    limit_s: f64,
) -> (Vec<CloseFollowing>, Vec<CloseFollowing>) {
    let plan = plan_study(&data.scenarios, &Profile::load("paper").unwrap(), options).unwrap();
    let backend = CpuBackend::lane_arithmetic();
    let mut parts = Vec::new();
    let sweep = |chunk: lanesweep::engine::Chunk| {
        parts.push(Partial::from_chunk(&plan, &chunk)?);
        Ok(())
    };
    Executor::new(&backend).sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, sweep).unwrap();
    let counts = parts.into_iter().try_fold(Partial::empty(&plan), Partial::merge).unwrap();
    let runner = LaneRunner::<f32>::new(&plan);
    let (mut ours, mut by_hand) = (Vec::new(), Vec::new());
    for (at, block) in plan.blocks.iter().enumerate() {
        let scenarios = kept(data, block.category);
        let close = close_units(scenarios.iter().copied());
        ours.push(CloseFollowing::of_recorded(&plan, &counts, at, &close).unwrap().unwrap());
        let mut expected =
            CloseFollowing { failures: vec![[0; 2]; plan.models.len() * Criterion::ALL.len()], ..Default::default() };
        for (unit, scenario) in scenarios.iter().enumerate() {
            for (headway, of) in plan.headways.iter().enumerate() {
                let ego_mps = if block.category == Category::Lvd { scenario.target.v[0] } else { scenario.ego.v0 };
                let thw_s = match of {
                    Headway::ThwS(thw_s) => *thw_s,
                    _ => scenario.gap0.unwrap() / ego_mps,
                };
                let is_close = u64::from(thw_s < limit_s);
                expected.lanes += 1;
                expected.close_lanes += is_close;
                for model in 0..plan.models.len() {
                    let key = LaneKey { block: at, unit: unit as u64, variant: 0, headway, model };
                    let verdicts = runner.run(&key).verdicts;
                    for criterion in Criterion::ALL {
                        let [close, all] = &mut expected.failures[model * Criterion::ALL.len() + criterion.index()];
                        *close += is_close * u64::from(verdicts.failed(criterion));
                        *all += u64::from(verdicts.failed(criterion));
                    }
                }
            }
        }
        by_hand.push(expected);
    }
    (ours, by_hand)
}

#[test]
fn failures_from_headways_below_half_a_second_are_told_apart() {
    let data = recordings(2);
    let (imposed, by_hand) = failures_below(&data, &StudyOptions::default(), 0.5);
    assert_eq!(imposed, by_hand);
    assert!(imposed.iter().all(|of| 5 * of.close_lanes == of.lanes), "0.4 s and 0.2 s of ten");
    let (recorded, by_hand) = failures_below(&data, &observed(), 0.5);
    assert_eq!(recorded, by_hand);
    let collisions = |all: &[CloseFollowing]| all.iter().map(|of| of.failures[0][1]).sum::<u64>();
    assert!(collisions(&recorded) < collisions(&imposed), "recorded drivers keep more distance than 0.2 s");
}

#[test]
fn a_density_with_headways_draws_its_own_and_counts_those_below_half_a_second() {
    let data = recordings(4);
    let facts = DataProvenance { data: "test".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let id = Parameterization::find(Category::CutIn, "2").unwrap();
    let fit = |with_thw| {
        let options = FitOptions { with_thw, representativeness: false, valid_draws: 1000, ..FitOptions::default() };
        DensityModel::fit(id.clone(), &data.scenarios, &facts, &options).unwrap().model
    };
    let options = |headways| SampleOptions {
        seed: 5,
        models: vec![ModelId::Cchdm, ModelId::Fsm],
        ..SampleOptions::new(Estimator::CRUDE, 3000, headways)
    };
    let paper = Profile::load("paper").unwrap();
    let plan_of = |density: &DensityModel, headways| {
        plan_samples(density, &density.mixture().unwrap(), &paper, &options(headways))
    };
    let error = plan_of(&fit(false), SampleHeadways::Each(vec![Headway::Observed])).err().unwrap();
    assert!(error.help().unwrap_or_default().contains("with_thw"), "{error}");
    let density = fit(true);
    let plan = plan_of(&density, SampleHeadways::Sampled).unwrap();
    let counting = options(SampleHeadways::Sampled);
    let backend = CpuBackend::lane_arithmetic();
    let mut tally = SampleTally::empty(&plan, &counting);
    let mut expected = CloseFollowing { failures: vec![[0; 2]; 6], ..Default::default() };
    let generator = plan.generator().unwrap();
    let count = |chunk: lanesweep::engine::Chunk| {
        for (unit, lanes) in chunk.units.clone().zip(chunk.verdicts.chunks(2)) {
            let drawn = generator.draw(unit);
            if drawn.is_void() {
                continue;
            }
            let point: Vec<f64> = drawn.values[..density.space.dimensions()].iter().map(|v| f64::from(*v)).collect();
            let is_close = u64::from(density.space.thw_s(&point).unwrap() < 0.5);
            expected.lanes += 1;
            expected.close_lanes += is_close;
            for (at, cell) in expected.failures.iter_mut().enumerate() {
                let fails = u64::from(lanes[at / 3].failed(Criterion::ALL[at % 3]));
                *cell = [cell[0] + is_close * fails, cell[1] + fails];
            }
        }
        tally = tally.clone().merge(SampleTally::of_chunk(&plan, &chunk, &counting)?)?;
        Ok(())
    };
    Executor::new(&backend).sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, count).unwrap();
    assert_eq!(tally.close_following(), expected);
    assert!(0 < expected.close_lanes && expected.close_lanes < expected.lanes, "{expected:?}");
}

fn lanesweep(args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_lanesweep")).env("NO_COLOR", "1").args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn every_verb_takes_observed_headways_and_says_how_many_failures_come_from_close_following() {
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
    let sampled = run(&[&args[..], &[&path("sample")]].concat());
    assert!(sampled.contains("headways below 0.5 s"), "{sampled}");
    let (code, _, err) = lanesweep(&["-q", "study", "--thw", "observed,1.0"]);
    // The drawing breaks long lines.
    let err: String = err.split(|c: char| c.is_whitespace() || c == '│').filter(|word| !word.is_empty()).collect();
    assert!(code != Some(0) && err.contains("cannotbecombined"), "{err}");
}
