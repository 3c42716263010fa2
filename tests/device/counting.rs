//! A device counts its lanes itself: the tallies are those of the host, and a wrong count is found.

use crate::common::device::{open, patched};
use crate::common::mined::density_of;
use lanesweep::engine::gpu::GpuOptions;
use lanesweep::engine::{Backend, SampleTally};
use lanesweep::prelude::*;
use lanesweep::run::sampling::Estimator;

/// A tally of all samples in chunks of `chunk_lanes` lanes.
fn tally(
    density: &DensityModel,
    options: &SampleOptions,
    backend: &dyn Backend,
    chunk_lanes: Option<u64>,
) -> Result<SampleTally> {
    let sample = Sample::plan(density.clone(), &Profile::load("paper").unwrap(), options)?;
    let executor = Executor { chunk_lanes, ..Executor::new(backend).with_recheck(1) };
    Ok(sample.run(&executor)?.crude.unwrap())
}

#[test]
fn a_device_counts_what_the_host_counts() {
    let Some(gpu) = open(GpuOptions { first_lanes: 3000, ..GpuOptions::default() }) else { return };
    let cpu = CpuBackend::lane_arithmetic();
    let each = || SampleHeadways::Each([0.3, 0.5, 1.0, 2.0].map(Headway::ThwS).to_vec());
    for (category, key, with_thw, n) in [
        (Category::CutIn, "2", false, 5000),
        (Category::CutIn, "6", true, 1500),
        (Category::CutOut, "b", false, 1500),
        (Category::CutOut, "f", false, 1500),
        (Category::Lvd, "ii", true, 1500),
    ] {
        let density = density_of(24, category, key, with_thw);
        let headways = if with_thw { SampleHeadways::Sampled } else { each() };
        let models = vec![ModelId::Reg157, ModelId::Fsm];
        let options = SampleOptions { models, ..SampleOptions::new(Estimator::Crude, n, headways) };
        let expected = tally(&density, &options, &cpu, None).unwrap();
        assert!(expected.failures.iter().sum::<u64>() > 0 && expected.by_kernel.is_some(), "{key}");
        for chunk_lanes in [None, Some(4_000)] {
            let counted = tally(&density, &options, &gpu, chunk_lanes).unwrap();
            assert!(counted == expected, "{category:?} {key}, {chunk_lanes:?}");
        }
    }
}

#[test]
fn a_wrong_count_stops_the_run() {
    let density = density_of(24, Category::CutIn, "2", false);
    let headways = SampleHeadways::Each([0.5, 1.0].map(Headway::ThwS).to_vec());
    let options = SampleOptions { models: vec![ModelId::Fsm], ..SampleOptions::new(Estimator::Crude, 1500, headways) };
    for (from, to) in [
        ("failed * failed", "failed + failed"),
        ("point.component % tally_groups", "(point.component + 1u) % tally_groups"),
    ] {
        let Some(gpu) = patched(from, to) else { return };
        let error = tally(&density, &options, &gpu, None).unwrap_err();
        assert!(matches!(&error, Error::Verification(_)), "{to}: {error}");
        assert!(error.to_string().contains("counted samples 0 to"), "{error}");
    }
}
