//! A device counts its lanes itself: the tallies are those of the host, whatever the density, the headways, the map, the
//! criterion of the worst lanes and the cut into chunks; and a wrong count is found.

use std::sync::OnceLock;

use crate::common::device::{open, patched};
use lanesweep::engine::gpu::GpuOptions;
use lanesweep::engine::{Backend, CpuBackend, Executor, Headway};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{
    Estimator, MapAxes, SampleHeadways, SampleOptions, SampleTally, plan_samples, sample_crude,
};
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, DataProvenance, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::traffic::mining::{MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;
use lanesweep::{Error, Result};

fn scenarios() -> &'static [Scenario] {
    static SCENARIOS: OnceLock<Vec<Scenario>> = OnceLock::new();
    SCENARIOS.get_or_init(|| {
        let generator = GeneratorOptions { recordings: 12, ..GeneratorOptions::default() };
        mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios
    })
}

fn density(category: Category, key: &str, with_thw: bool) -> DensityModel {
    let facts =
        DataProvenance { data: "synthetic".to_owned(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let fit = FitOptions { representativeness: false, valid_draws: 100, with_thw, ..FitOptions::default() };
    DensityModel::fit(Parameterization::find(category, key).unwrap(), scenarios(), &facts, &fit).unwrap().model
}

/// A tally of `n` samples in chunks of `chunk_lanes` lanes.
fn tally(
    density: &DensityModel,
    options: &SampleOptions,
    n: u64,
    backend: &dyn Backend,
    chunk_lanes: Option<u64>,
) -> Result<SampleTally> {
    let profile = Profile::load("paper").unwrap();
    let plan = plan_samples(density, &density.mixture().unwrap(), &profile, options).unwrap();
    let executor = Executor { chunk_lanes, ..Executor::new(backend).with_recheck(1) };
    Ok(sample_crude(&plan, 0..n, &executor, options, None, None)?.tally)
}

/// Without a list of worst lanes every chunk is counted; with one, those after the first samples.
fn options_of(
    density: &DensityModel,
    n: u64,
    worst: usize,
    headways: SampleHeadways,
    criterion: Criterion,
) -> SampleOptions {
    let names: Vec<&str> = density.space.parameters().iter().map(|p| p.name.as_str()).collect();
    let map = Some(MapAxes::of(density, names[0], names[1]).unwrap());
    SampleOptions { worst, map, criterion, ..SampleOptions::new(Estimator::CRUDE, n, headways) }
}

#[test]
fn a_device_counts_what_the_host_counts() {
    let Some(gpu) = open(GpuOptions { first_lanes: 3000, ..GpuOptions::default() }) else { return };
    let cpu = CpuBackend::lane_arithmetic();
    let each = || SampleHeadways::Each([0.3, 0.5, 1.0, 2.0].map(Headway::ThwS).to_vec());
    for (category, key, with_thw, n, worst) in [
        (Category::CutIn, "2", false, 5000, 5),
        (Category::CutIn, "6", true, 1500, 0),
        (Category::CutOut, "b", false, 1500, 0),
        (Category::CutOut, "f", false, 1500, 0),
        (Category::Lvd, "ii", true, 1500, 0),
    ] {
        let density = density(category, key, with_thw);
        for criterion in Criterion::ALL.into_iter().skip(if worst == 0 { 2 } else { 0 }) {
            let headways = if with_thw { SampleHeadways::Sampled } else { each() };
            let options = options_of(&density, n, worst, headways, criterion);
            let expected = tally(&density, &options, n, &cpu, None).unwrap();
            assert!(expected.failures.iter().sum::<u64>() > 0 && expected.close_lanes > 0, "{key}");
            assert!(expected.map.as_ref().unwrap().samples.iter().sum::<u64>() > n / 2, "{key}");
            for chunk_lanes in [None, Some(4_000)].into_iter().skip(worst.min(1)) {
                let counted = tally(&density, &options, n, &gpu, chunk_lanes).unwrap();
                assert!(counted == expected, "{category:?} {key}, {criterion:?}, {chunk_lanes:?}");
            }
        }
    }
}

#[test]
fn samples_that_fit_no_list_are_counted_by_the_host() {
    let Some(gpu) = patched("atomicAdd(&left[0], 1u)", "atomicAdd(&left[0], 100000u)") else { return };
    let density = density(Category::CutIn, "2", false);
    let headways = SampleHeadways::Each(vec![Headway::ThwS(0.5)]);
    let options = options_of(&density, 5000, 5, headways, Criterion::Collision);
    let expected = tally(&density, &options, 5000, &CpuBackend::lane_arithmetic(), None).unwrap();
    assert!(tally(&density, &options, 5000, &gpu, None).unwrap() == expected);
}

#[test]
fn a_wrong_count_stops_the_run() {
    let density = density(Category::CutIn, "2", false);
    let headways = SampleHeadways::Each([0.5, 1.0].map(Headway::ThwS).to_vec());
    let options = options_of(&density, 1500, 0, headways, Criterion::Collision);
    for (from, to) in [
        ("failed * failed", "failed + failed"),
        ("point.component % tally_groups", "(point.component + 1u) % tally_groups"),
        ("value >= number(first + k)", "value > number(first + k) + 0.5"),
    ] {
        let Some(gpu) = patched(from, to) else { return };
        let error = tally(&density, &options, 1500, &gpu, None).unwrap_err();
        assert!(matches!(&error, Error::Verification(_)), "{to}: {error}");
        assert!(error.to_string().contains("counted samples 0 to"), "{error}");
    }
}
