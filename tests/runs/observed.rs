//! `--thw observed`: each scenario from its recorded gap.

use crate::common::mined::{density_of, kept, scenarios_of};
use lanesweep::engine::{LaneKey, LaneRunner};
use lanesweep::prelude::*;
use lanesweep::run::sampling::{Estimator, plan_samples};
use lanesweep::run::study::plan_study;

fn observed() -> StudyOptions {
    StudyOptions { headways: vec![Headway::Observed], ..StudyOptions::default() }
}

#[test]
fn s_and_every_s_prime_start_from_the_recorded_gap() {
    let data = scenarios_of(3);
    let paper = Profile::load("paper").unwrap();
    let plan = plan_study(data, &paper, &observed()).unwrap();
    let imposed = StudyOptions { headways: vec![Headway::GapM(0.0)], ..StudyOptions::default() };
    let imposed = plan_study(data, &paper, &imposed).unwrap();
    assert_ne!(plan.hash(), imposed.hash());
    let runner = LaneRunner::<f64>::new(&plan);
    for (at, block) in plan.blocks.iter().enumerate() {
        for (unit, scenario) in kept(data, block.category).into_iter().enumerate() {
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
fn a_scenario_without_a_recorded_gap_is_named_and_a_mixture_of_headways_is_refused() {
    let mut data = scenarios_of(1).to_vec();
    let scenario = data.iter_mut().find(|s| s.kept).unwrap();
    (scenario.gap0, scenario.thw0) = (None, None);
    let id = scenario.id.clone();
    let paper = Profile::load("paper").unwrap();
    let error = plan_study(&data, &paper, &observed()).err().unwrap();
    assert!(matches!(&error, Error::Input { .. }) && error.to_string().contains(&id), "{error}");
    assert!(error.to_string().contains("gap0"), "{error}");
    let mixed = StudyOptions { headways: vec![Headway::Observed, Headway::ThwS(1.0)], ..StudyOptions::default() };
    let error = plan_study(scenarios_of(1), &paper, &mixed).err().unwrap().to_string();
    assert!(error.contains("cannot be combined"), "{error}");
    // A density without headways cannot draw observed ones.
    let density = density_of(2, Category::CutIn, "2", false);
    let options = SampleOptions::new(Estimator::Crude, 100, SampleHeadways::Each(vec![Headway::Observed]));
    let error = plan_samples(&density, &paper, &options).err().unwrap();
    assert!(error.help().unwrap_or_default().contains("with_thw"), "{error}");
}
