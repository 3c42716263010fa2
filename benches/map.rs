//! The grids of the JRC's evidence, 140,793 simulations of up to 362 steps: planned and swept.
//!
//! `cargo bench --bench map` prints one CSV row per part and repetition to stdout and a summary to stderr, with the CPU
//! time of the process beside the time on the clock: other work on the machine lengthens the latter alone.

use std::time::Instant;

use lanesweep::engine::{CpuBackend, Executor};
use lanesweep::model::profile::Profile;
use lanesweep::run::grid::presets::{self, Presets};
use lanesweep::run::grid::{GridMap, GridPlan};
use lanesweep::scenario::Category;

const REPETITIONS: u32 = 20;

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    println!("part,repetition,seconds,simulations");
    let profile = Profile::load(presets::JRC_PROFILE).unwrap();
    let plans = || -> Vec<GridPlan> {
        let presets = Category::ALL.into_iter().flat_map(|category| Presets::Jrc.of(category, &profile).unwrap());
        presets.map(|preset| GridPlan::new(preset.grid, &profile, &preset.models).unwrap()).collect()
    };
    let planned = plans();
    let simulations: u64 = planned.iter().map(GridPlan::lane_count).sum();
    assert_eq!(simulations, 140_793);
    let backend = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&backend);
    time("plan", simulations, || plans().len());
    time("sweep", simulations, || {
        planned.iter().map(|plan| GridMap::sweep(plan, &executor).unwrap().0.cell_count()).sum::<usize>()
    });
}

fn time(part: &str, simulations: u64, work: impl Fn() -> usize) {
    let cpu_before = cpu_s();
    let mut all = Vec::new();
    for repetition in 0..REPETITIONS {
        let start = Instant::now();
        std::hint::black_box(work());
        let seconds = start.elapsed().as_secs_f64();
        println!("{part},{repetition},{seconds},{simulations}");
        all.push(seconds);
    }
    all.sort_by(f64::total_cmp);
    let cpu = cpu_before.zip(cpu_s()).map(|(before, after)| (after - before) / f64::from(REPETITIONS));
    let cpu = cpu.map_or(String::new(), |s| format!(", {s:.3} s of CPU time each"));
    let (min, median) = (all[0], all[all.len() / 2]);
    eprintln!("{part:>6}: {simulations} simulations, median {median:.3} s, least {min:.3} s{cpu}");
}

/// Linux: user and system time of the process so far, s; the kernel counts in hundredths of a second.
fn cpu_s() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // Fields after the name in parentheses; user and system time are the 14th and 15th of all.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}
