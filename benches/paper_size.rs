//! The whole study at the paper's size, part by part: reading and mining of 1 GB of highD files, planning
//! with the decompositions, the sweep of 493,600 lanes in f32 and f64, the scores.
//!
//! `cargo bench --bench paper_size` prints one CSV row per part and repetition to stdout (kept under
//! `benches/runs` with the machine's facts) and a summary to stderr. Synthetic data; repetitions in turn.

mod common;

use std::path::Path;
use std::time::Instant;

use common::{lane_steps, paper_size_scenarios, peak_memory_bytes, swept};
use lanesweep::engine::CpuBackend;
use lanesweep::model::profile::Profile;
use lanesweep::run::score::{ScoreOptions, score};
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::traffic::mining::{MiningOptions, mine_folder};
use lanesweep::traffic::trajectory::generator::{GeneratorOptions, generate_one};
use lanesweep::traffic::trajectory::highd;

const REPETITIONS: usize = 5;
const MIN_BYTES: u64 = 1_000_000_000;

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    println!("part,repetition,seconds,amount,unit");
    let scenarios = paper_size_scenarios();
    let profile = Profile::load("paper").unwrap();
    let plan = || plan_study(&scenarios, &profile, &StudyOptions::default()).unwrap();
    let made = plan();
    assert_eq!(made.lane_count(), 493_600);
    let narrow = CpuBackend::lane_arithmetic();
    let wide = CpuBackend::reference();
    let steps = lane_steps(&made, &narrow);
    let partial = swept(&made, &narrow);
    for repetition in 0..REPETITIONS {
        time("plan", repetition, made.lane_count(), "lanes", plan);
        time("sweep f32", repetition, steps, "lane-steps", || swept(&made, &narrow));
        time("sweep f64", repetition, steps, "lane-steps", || swept(&made, &wide));
        time("score", repetition, 1000, "draws", || score(&made, &partial, &ScoreOptions::default()).unwrap());
    }
    let folder = tempfile::tempdir().unwrap();
    let bytes = write_recordings(folder.path());
    for repetition in 0..3 {
        time("read and mine", repetition, bytes, "bytes", || {
            mine_folder(folder.path(), &MiningOptions::default(), Default::default(), || Ok(())).unwrap()
        });
    }
    if let Some(peak) = peak_memory_bytes() {
        println!("peak memory,0,,{peak},bytes");
        eprintln!("peak memory {:.0} MB, the benchmark's own data included", peak as f64 / 1e6);
    }
}

fn time<T>(part: &str, repetition: usize, amount: u64, unit: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    let seconds = start.elapsed().as_secs_f64();
    println!("{part},{repetition},{seconds},{amount},{unit}");
    eprintln!("{part:>14} {seconds:8.3} s  {:9.2} M {unit}/s", amount as f64 / seconds / 1e6);
    result
}

/// Recordings of ever new seeds until there is a gigabyte of files.
fn write_recordings(dir: &Path) -> u64 {
    let mut bytes = 0;
    let mut index = 0;
    while bytes < MIN_BYTES {
        let options = GeneratorOptions { seed: 1000 + index, recordings: 1, ..GeneratorOptions::default() };
        let mut recording = generate_one(&options, 0).unwrap();
        recording.id = format!("{:03}", index + 1);
        highd::write(dir, &recording).unwrap();
        index += 1;
        bytes = std::fs::read_dir(dir).unwrap().map(|file| file.unwrap().metadata().unwrap().len()).sum();
    }
    bytes
}
