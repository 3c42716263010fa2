//! The parts of a study one by one, with criterion's statistics: reading, mining, the decomposition, planning,
//! sweeping, scoring; and the study end to end.
//!
//! `cargo bench --bench parts [-- FILTER]`. Synthetic data.

mod common;

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};

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

/// Reading one recording, mining it, and both for a folder of four.
fn recordings(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let options = GeneratorOptions { recordings: 4, ..GeneratorOptions::default() };
    for index in 0..options.recordings {
        let recording = generate_one(&options, index).unwrap();
        highd::write(folder.path(), &recording).unwrap();
    }
    let files = HighdFiles::named(folder.path(), "01");
    let bytes = std::fs::metadata(&files.tracks).unwrap().len();
    let all: u64 = std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().metadata().unwrap().len()).sum();
    let recording = highd::read(&files).unwrap().recording;
    let mining = MiningOptions::default();
    let mut group = criterion.benchmark_group("recordings");
    group.throughput(Throughput::Bytes(bytes)).sample_size(20);
    group.bench_function("read one", |b| b.iter(|| highd::read(black_box(&files)).unwrap()));
    group.bench_function("mine one", |b| b.iter(|| mine(black_box(&recording), &mining)));
    group.throughput(Throughput::Bytes(all));
    group.bench_function("read and mine a folder", |b| {
        b.iter(|| mine_folder(folder.path(), &mining, Default::default(), || Ok(())).unwrap())
    });
    group.finish();
}

/// The decomposition and the plan of a study of the paper's size.
fn planning(criterion: &mut Criterion) {
    let scenarios = paper_size_scenarios();
    let profile = Profile::load("paper").unwrap();
    let mut group = criterion.benchmark_group("planning");
    group.sample_size(20);
    for category in Category::ALL {
        let of: Vec<&Scenario> = scenarios.iter().filter(|s| s.category == category).collect();
        let options = ParameterizationOptions::default();
        group.bench_function(format!("svd {} ({} scenarios)", category.key(), of.len()), |b| {
            b.iter(|| Reduction::fit(category, black_box(&of), &options).unwrap());
        });
    }
    let options = StudyOptions::default();
    group.bench_function("plan", |b| b.iter(|| plan_study(black_box(&scenarios), &profile, &options).unwrap()));
    group.finish();
}

/// Lanes of each category and model, and the scores of a study.
fn sweeping(criterion: &mut Criterion) {
    let scenarios = paper_size_scenarios();
    let profile = Profile::load("paper").unwrap();
    let cpu = CpuBackend::lane_arithmetic();
    let mut group = criterion.benchmark_group("sweep");
    group.sample_size(10);
    for category in Category::ALL {
        for model in ModelId::ALL {
            let options = StudyOptions { categories: vec![category], models: vec![model], ..Default::default() };
            let plan = plan_study(&scenarios, &profile, &options).unwrap();
            group.throughput(Throughput::Elements(common::lane_steps(&plan, &cpu)));
            let name = format!("{} {}", category.key(), model.name());
            group.bench_function(name, |b| b.iter(|| swept(black_box(&plan), &cpu)));
        }
    }
    group.finish();
    let plan = plan_study(&scenarios, &profile, &StudyOptions::default()).unwrap();
    let partial = swept(&plan, &cpu);
    criterion.bench_function("score", |b| b.iter(|| score(&plan, &partial, &ScoreOptions::default()).unwrap()));
}

/// The default study: generated recordings to scores.
fn study(criterion: &mut Criterion) {
    let profile = Profile::load("paper").unwrap();
    let cpu = CpuBackend::lane_arithmetic();
    let mut group = criterion.benchmark_group("study");
    group.sample_size(10);
    group.bench_function("default, end to end", |b| {
        b.iter_batched(
            GeneratorOptions::default,
            |generator| {
                let mined = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap();
                let plan = plan_study(&mined.scenarios, &profile, &StudyOptions::default()).unwrap();
                let partial = swept(&plan, &cpu);
                score(&plan, &partial, &ScoreOptions::default()).unwrap()
            },
            BatchSize::PerIteration,
        );
    });
    group.finish();
}

criterion_group!(parts, recordings, planning, sweeping, study);
criterion_main!(parts);
