//! The parts of a study one by one: reading, mining, the decomposition, planning, sweeping, scoring; and the study end to end.
//!
//! `cargo bench --bench parts [-- FILTER]` prints a CSV row per part: the median and the least of its repetitions. Synthetic data.

mod common;

use std::hint::black_box;
use std::time::Instant;

use common::{paper_size_scenarios, swept};
use lanesweep::engine::CpuBackend;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::score::{ScoreOptions, score};
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::scenario::parameterization::{ParameterizationOptions, Reduction};
use lanesweep::scenario::{Category, Scenario};
use lanesweep::traffic::mining::{MiningOptions, mine, mine_folder, mine_generated};
use lanesweep::traffic::trajectory::generator::{GeneratorOptions, generate_one};
use lanesweep::traffic::trajectory::highd::{self, HighdFiles};

const REPETITIONS: usize = 20;

/// Times a part whose name holds the filter, and prints its row.
fn time<T>(part: &str, amount: u64, unit: &str, work: impl Fn() -> T) {
    let filter = std::env::args().skip(1).find(|arg| !arg.starts_with('-')).unwrap_or_default();
    if !part.contains(&filter) {
        return;
    }
    let once = |_| {
        let start = Instant::now();
        black_box(work());
        start.elapsed().as_secs_f64()
    };
    once(0);
    let mut seconds: Vec<f64> = (0..REPETITIONS).map(once).collect();
    seconds.sort_by(f64::total_cmp);
    println!("{part},{},{},{amount},{unit}", seconds[REPETITIONS / 2], seconds[0]);
}

/// Reading one recording, mining it, and both for a folder of four.
fn recordings() {
    let folder = tempfile::tempdir().unwrap();
    let options = GeneratorOptions { recordings: 4, ..GeneratorOptions::default() };
    for index in 0..options.recordings {
        highd::write(folder.path(), &generate_one(&options, index).unwrap()).unwrap();
    }
    let files = HighdFiles::named(folder.path(), "01");
    let bytes = std::fs::metadata(&files.tracks).unwrap().len();
    let all: u64 = std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().metadata().unwrap().len()).sum();
    let recording = highd::read(&files).unwrap().recording;
    let mining = MiningOptions::default();
    time("read one", bytes, "bytes", || highd::read(black_box(&files)).unwrap());
    time("mine one", bytes, "bytes", || mine(black_box(&recording), &mining));
    let folder = || mine_folder(folder.path(), &mining, Default::default(), || Ok(())).unwrap();
    time("read and mine a folder", all, "bytes", folder);
}

/// The decomposition, the plan, lanes of each category and model, and the scores of a study of the paper's size.
fn paper_size() {
    let scenarios = paper_size_scenarios();
    let profile = Profile::load("paper").unwrap();
    let cpu = CpuBackend::lane_arithmetic();
    for category in Category::ALL {
        let of: Vec<&Scenario> = scenarios.iter().filter(|s| s.category == category).collect();
        let options = ParameterizationOptions::default();
        let fit = || Reduction::fit(category, black_box(&of), &options).unwrap();
        time(&format!("svd {}", category.key()), of.len() as u64, "scenarios", fit);
        for model in ModelId::ALL {
            let options = StudyOptions { categories: vec![category], models: vec![model], ..Default::default() };
            let plan = plan_study(&scenarios, &profile, &options).unwrap();
            let name = format!("sweep {} {}", category.key(), model.name());
            time(&name, common::lane_steps(&plan, &cpu), "lane-steps", || swept(black_box(&plan), &cpu));
        }
    }
    let plan = || plan_study(black_box(&scenarios), &profile, &StudyOptions::default()).unwrap();
    let made = plan();
    time("plan", made.lane_count(), "lanes", plan);
    let partial = swept(&made, &cpu);
    time("score", made.lane_count(), "lanes", || score(&made, &partial, &ScoreOptions::default()).unwrap());
}

/// The default study: generated recordings to scores.
fn study() {
    let profile = Profile::load("paper").unwrap();
    let cpu = CpuBackend::lane_arithmetic();
    time("study, end to end", 1, "studies", || {
        let mined = mine_generated(&GeneratorOptions::default(), &MiningOptions::default(), || Ok(())).unwrap();
        let plan = plan_study(&mined.scenarios, &profile, &StudyOptions::default()).unwrap();
        score(&plan, &swept(&plan, &cpu), &ScoreOptions::default()).unwrap()
    });
}

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    println!("part,median_s,least_s,amount,unit");
    recordings();
    paper_size();
    study();
}
