//! Sampled lanes: wall time of crude Monte Carlo over one density per kind of parameterization, and memory at 10⁶,
//! 10⁷ and 10⁸ samples (with `-- --large` at 10⁹ too).
//!
//! `cargo bench --bench sampling` prints one CSV row per run to stdout and a summary to stderr. Synthetic data of the
//! default size, profile `paper`, THW 1 s, all threads of the pool.

mod common;

use std::time::Instant;

use common::{density, peak_memory_bytes};
use lanesweep::engine::{CpuBackend, Executor, Headway};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{Estimator, Sample, SampleHeadways, SampleOptions};
use lanesweep::scenario::Category;
use lanesweep::stats::density::DensityModel;
use lanesweep::traffic::mining::{MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    println!("part,density,models,samples,lanes,seconds,peak_bytes,failures");
    let generator = GeneratorOptions { recordings: 24, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios;
    let million = 1_000_000;
    for (category, key) in [
        (Category::CutIn, "2"),
        (Category::CutIn, "6"),
        (Category::CutOut, "b"),
        (Category::CutOut, "f"),
        (Category::Lvd, "i"),
        (Category::Lvd, "ii"),
        (Category::Lvd, "iv"),
    ] {
        let density = density(category, key, &scenarios);
        run("speed", &density, &ModelId::ALL, million);
    }
    let density = density(Category::CutIn, "2", &scenarios);
    run("ten million", &density, &ModelId::ALL, 10 * million);
    let large = std::env::args().any(|arg| arg == "--large");
    for samples in [million, 10 * million, 100 * million, 1000 * million].into_iter().take(if large { 4 } else { 3 }) {
        run("memory", &density, &[ModelId::Fsm], samples);
    }
}

fn run(part: &str, density: &DensityModel, models: &[ModelId], samples: u64) {
    let options = SampleOptions {
        models: models.to_vec(),
        ..SampleOptions::new(Estimator::Crude, samples, SampleHeadways::Each(vec![Headway::ThwS(1.0)]))
    };
    let profile = Profile::load("paper").unwrap();
    let sample = Sample::plan(density.clone(), &profile, &options).unwrap();
    let backend = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&backend);
    let start = Instant::now();
    let tally = sample.run(&executor).unwrap().crude.unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let id = density.space.id();
    let name = format!("{} {}", id.category.key(), id.key);
    let (lanes, failures) = (sample.lane_count(), tally.failures.iter().sum::<u64>());
    let peak = peak_memory_bytes().unwrap_or(0);
    println!("{part},{name},{},{samples},{lanes},{seconds},{peak},{failures}", models.len());
    eprintln!(
        "{part}: {name}, {samples} samples, {lanes} lanes in {seconds:.2} s, {:.2} M lanes/s, peak {:.1} MB so far",
        lanes as f64 / seconds / 1e6,
        peak as f64 / 1e6
    );
}
