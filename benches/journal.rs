//! What it costs that nothing is lost: runs with and without a journal in turn, the time that the journal itself
//! took, and what sealing and checking the plan and the parts takes beside the run.
//!
//! `cargo bench --bench journal` prints one CSV row per repetition to stdout and a summary to stderr. Synthetic data:
//! a sampling run of 2·10⁶ samples of cut-in 2 against all models, and the study of the paper's size 20 times over.

mod common;

use std::path::Path;
use std::time::{Duration, Instant};

use common::paper_size_scenarios;
use lanesweep::engine::{CpuBackend, Executor, Headway, Partial, Wanted};
use lanesweep::model::profile::Profile;
use lanesweep::run::parts::{
    Job, Journal, Ledger, MergeableCounts, Part, read_part, read_sealed_line, seal, write_part,
};
use lanesweep::run::sampling::{Estimator, Sample, SampleCounts, SampleHeadways, SampleOptions};
use lanesweep::run::study::{StudyCases, StudyHead, StudyOptions, outline_study};
use lanesweep::scenario::DataProvenance;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::traffic::mining::{MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

const PAIRS: usize = 9;
const STUDIES: usize = 20;

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    println!("run,repetition,seconds_without,seconds_with,seconds_in_journal,seconds_part_written,seconds_part_read");
    let folder = tempfile::tempdir().unwrap();
    sampling(folder.path());
    study(folder.path());
}

fn sampling(folder: &Path) {
    let samples = 2_000_000;
    let options = SampleOptions::new(Estimator::Crude, samples, SampleHeadways::Each(vec![Headway::ThwS(1.0)]));
    let sample = Sample::plan(density(), &Profile::load("paper").unwrap(), &options).unwrap();
    let backend = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&backend);
    pairs("sample", folder, samples, &sample.cuts(), |ledger: &mut Ledger<SampleCounts>| {
        sample.compute(ledger, &executor, None).unwrap();
    });
}

fn study(folder: &Path) {
    let one = paper_size_scenarios();
    let many = (0..STUDIES).flat_map(|copy| {
        one.iter().map(move |scenario| {
            let mut scenario = scenario.clone();
            scenario.id = format!("{}~{copy}", scenario.id);
            scenario
        })
    });
    let scenarios: Vec<Scenario> = many.collect();
    let study = outline_study(&scenarios, &Profile::load("paper").unwrap(), &StudyOptions::default()).unwrap();
    let plan = study.window(0..study.outline().unit_count()).unwrap();
    let backend = CpuBackend::lane_arithmetic();
    pairs("study", folder, plan.unit_count(), &[], |ledger: &mut Ledger<Partial>| {
        let units = ledger.units();
        Executor::new(&backend)
            .sweep(&plan, units, Wanted::Verdicts, |chunk| ledger.add(Partial::from_chunk(&plan, &chunk)?, [0; 2]))
            .unwrap();
    });
    plan_file(folder, &study);
}

/// Runs with and without a journal in turn; what is counted last is written as a part and read again.
fn pairs<T: MergeableCounts>(name: &str, folder: &Path, units: u64, cuts: &[u64], run: impl Fn(&mut Ledger<T>)) {
    let (mut ratios, mut shares) = (Vec::new(), Vec::new());
    for repetition in 0..PAIRS {
        let timed = |with: bool| {
            let start = Instant::now();
            let mut ledger = Ledger::new(0..units, cuts);
            if with {
                let (journal, found) = Journal::open(&folder.join("run.journal"), "run", 0..units).unwrap();
                ledger.resume(journal, found).unwrap();
            }
            run(&mut ledger);
            let (segments, journal) = ledger.finish().unwrap();
            let spent = journal.as_ref().map_or(Duration::ZERO, Journal::spent);
            if let Some(journal) = journal {
                journal.remove().unwrap();
            }
            (start.elapsed().as_secs_f64(), spent.as_secs_f64(), segments)
        };
        // Each comes first every other time.
        let is_with_first = repetition % 2 == 0;
        let first = timed(is_with_first);
        let second = timed(!is_with_first);
        let (with, without) = if is_with_first { (first, second) } else { (second, first) };
        let (with_s, in_journal_s, segments) = with;
        let without_s = without.0;
        let path = folder.join("part.json");
        let start = Instant::now();
        let part = Part { run_sha256: "run".to_owned(), units: 0..units, lanes_redone_and_rechecked: [0; 2], segments };
        write_part(&path, &part).unwrap();
        let written_s = start.elapsed().as_secs_f64();
        read_part::<T>(&path, "run", &(0..units), "again").unwrap();
        let read_s = start.elapsed().as_secs_f64() - written_s;
        println!("{name},{repetition},{without_s},{with_s},{in_journal_s},{written_s},{read_s}");
        ratios.push(with_s / without_s);
        shares.push((in_journal_s + written_s + read_s) / with_s);
    }
    ratios.sort_by(f64::total_cmp);
    shares.sort_by(f64::total_cmp);
    eprintln!(
        "{name}: with over without {:.4} (median of {PAIRS} pairs, from {:.4} to {:.4}); journal, and part written and \
         read, by their own clocks {:.2} % of the run (median, at most {:.2} %)",
        ratios[PAIRS / 2],
        ratios[0],
        ratios[PAIRS - 1],
        100.0 * shares[PAIRS / 2],
        100.0 * shares[PAIRS - 1]
    );
}

/// What a shard that is given the plan pays for it, should it compute all of it.
fn plan_file(folder: &Path, study: &StudyCases) {
    let path = folder.join("plan.json");
    let start = Instant::now();
    let (head, _) = seal("plan", study.head()).unwrap();
    let mut bytes = Vec::new();
    study.write_file(&head, &mut bytes).unwrap();
    std::fs::write(&path, &bytes).unwrap();
    let written = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let (head, _, mut records) = read_sealed_line::<StudyHead>("plan", &path, 1 << 30, "again").unwrap();
    let parsed = start.elapsed().as_secs_f64();
    let again = head.read(&mut records, &lanesweep::Place::file(&path), |units| 0..units).unwrap();
    let read = start.elapsed().as_secs_f64();
    let plan = study.outline();
    assert_eq!(again.outline().hash(), plan.hash());
    println!("plan file of {} lanes and {} bytes,0,{written},{read},{parsed},,", plan.lane_count(), bytes.len());
    eprintln!(
        "plan file: {} lanes, {:.1} MB, written in {written:.2} s, read and checked in {read:.2} s",
        plan.lane_count(),
        bytes.len() as f64 / 1e6
    );
}

fn density() -> DensityModel {
    let facts =
        DataProvenance { data: "synthetic".to_owned(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let options = FitOptions { valid_draws: 1000, ..FitOptions::default() };
    let generator = GeneratorOptions { recordings: 24, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios;
    DensityModel::fit(Parameterization::find(Category::CutIn, "2").unwrap(), &scenarios, &facts, &options)
        .unwrap()
        .model
}
