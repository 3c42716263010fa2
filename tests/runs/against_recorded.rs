//! Rates of samples beside those of the recorded scenarios: which of them are sound.

use crate::common::mined;
use lanesweep::Place;
use lanesweep::prelude::*;
use lanesweep::run::sampling::{EstimateRow, Estimator};
use lanesweep::stats::estimate::{Verdict, Warning};

fn density_of(key: &str, with_thw: bool) -> DensityModel {
    mined::density_of(30, Category::CutIn, key, with_thw)
}

fn density(key: &str) -> DensityModel {
    density_of(key, false)
}

fn sampled(density: DensityModel, headways: SampleHeadways) -> Vec<EstimateRow> {
    let models = vec![ModelId::Cchdm, ModelId::Fsm];
    let options = SampleOptions { models, ..SampleOptions::new(Estimator::Crude, 4000, headways) };
    let sample = Sample::plan(density, &Profile::load("paper").unwrap(), &options).unwrap();
    sample.run(&Executor::new(CpuBackend::lane_arithmetic())).unwrap().rows
}

fn each() -> SampleHeadways {
    SampleHeadways::Each(Headway::paper())
}

fn overall(rows: &[EstimateRow]) -> Vec<&EstimateRow> {
    rows.iter().filter(|row| row.headway == "all" && row.criterion == Criterion::Collision).collect()
}

/// The warning about recorded scenarios says something.
fn is_flagged(row: &EstimateRow) -> bool {
    row.estimate.trust.warnings.iter().any(|w| matches!(w, Warning::AgainstRecorded { .. }))
}

/// Draws, density and data leave nothing to say.
fn is_sound(row: &EstimateRow) -> bool {
    let trust = &row.estimate.trust;
    let is_sound = (trust.draws(), trust.density(), trust.data()) == (Verdict::Sound, "agrees", "enough");
    assert_eq!(is_sound, trust.warnings.is_empty(), "{trust:?}");
    is_sound
}

#[test]
fn rates_that_are_sound_do_not_exclude_each_other() {
    let mut sound: Vec<(String, EstimateRow)> = Vec::new();
    for key in ["1", "2", "3", "4", "6", "7"] {
        let rows = sampled(density(key), each());
        for row in overall(&rows) {
            let ratios = row.recorded.unwrap();
            let agrees = ratios.replayed.agrees() && ratios.sampled.unwrap().agrees();
            assert_eq!(is_flagged(row), !agrees, "{key}: {row:?}");
            eprintln!("{key} {:?}: {:?} {}", row.model, row.estimate.interval, is_sound(row));
            if is_sound(row) {
                assert!(agrees);
                sound.push((key.to_owned(), row.clone()));
            }
        }
        if key == "3" {
            // The cutter is in the lane at once: a driver has no time to see it come.
            assert!(overall(&rows).iter().all(|row| !is_sound(row)));
        }
    }
    assert!(sound.len() >= 2, "nothing is sound: {}", sound.len());
    for (a, of_a) in &sound {
        for (b, of_b) in sound.iter().filter(|(_, row)| row.model == of_a.model) {
            let (own, other) = (of_a.estimate.interval, of_b.estimate.interval);
            assert!(own.low <= other.high && other.low <= own.high, "{a} and {b}: {of_a:?} {of_b:?}");
        }
    }
}

/// A density that draws its headway is compared with S from its recorded gaps; under a condition nothing is compared.
#[test]
fn no_rate_is_sound_that_is_compared_with_nothing() {
    let mut without = density("2");
    without.scenarios.clear();
    for row in sampled(without, each()) {
        assert!(row.recorded.is_none() && !is_sound(&row), "{row:?}");
        assert!(row.estimate.trust.warnings.contains(&Warning::NotCompared));
    }
    for row in &sampled(density_of("2", true), SampleHeadways::Sampled) {
        let ratios = row.recorded.expect("S starts from its recorded gaps");
        let agrees = ratios.replayed.agrees() && ratios.sampled.unwrap().agrees();
        assert!(agrees || !is_sound(row), "{row:?}");
    }
}

#[test]
fn a_density_file_holds_its_scenarios_and_refuses_others() {
    let written = density("2");
    let place = Place::item("density.json");
    let read = DensityModel::from_json(&written.to_json().unwrap(), &place).unwrap();
    assert_eq!(read.scenarios, written.scenarios);
    assert_eq!(read.scenarios.len(), read.kde.points().len());
    let refused = |change: fn(&mut Vec<Scenario>)| {
        let mut changed = written.clone();
        change(&mut changed.scenarios);
        DensityModel::from_json(&changed.to_json().unwrap(), &place).unwrap_err().to_string()
    };
    let few = refused(|scenarios| drop(scenarios.pop()));
    assert!(few.contains("column `scenarios`") && few.contains("one per kernel"), "{few}");
    let other = refused(|scenarios| scenarios[0].category = Category::Lvd);
    assert!(other.contains("is no cut-in") || other.contains("is no Cut-in"), "{other}");
    let empty = refused(|scenarios| scenarios[0].target.v.clear());
    assert!(empty.contains("target.v"), "{empty}");
}
