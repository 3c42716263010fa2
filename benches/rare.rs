//! Rare failures: repeats of the estimator on the benchmark of `benches/rare-failures` (its README says what the cases are).
//!
//! ```sh
//! cargo bench --bench rare -- repeats 20              # a CSV row per case and seed
//! cargo bench --bench rare -- repeats 200 cut-in 1000 # cases whose name contains it; the first seed
//! cargo bench --bench rare -- truth 50                # a row per case: the mean over seeds that no repeat uses
//! cargo bench --bench rare -- crude 1e8 cut-in        # crude lanes: failures, and by kernel the shares of the largest
//! ```
//!
//! LANESWEEP_HALF_WIDTH (0.1) and LANESWEEP_CRUDE (1e8, draws of the density) change what is asked for;
//! LANESWEEP_ASSURANCE=search is `--assurance search`.

#[allow(dead_code)] // some of it is for tests only
#[path = "../tests/common/reliability.rs"]
mod reliability;

use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use lanesweep::Result;
use lanesweep::engine::{CpuBackend, Executor, Headway};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{LaneLimitState, Question, SampleHeadways, truncated};
use lanesweep::stats::density::{DensityModel, Mixture, read_density};
use lanesweep::stats::estimate::{Density, Estimate, Goal, LimitState, Search, SearchRun};
use lanesweep::stats::random::Stream;
use reliability::{StandardNormal, adaptive};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/rare-failures");
/// The first seed of repeats, and of truths.
const FIRST_SEED: u64 = 1000;
const FIRST_SEED_OF_TRUTHS: u64 = 1_000_000;

struct Case {
    name: String,
    truth: Option<f64>,
    problem: Problem,
}

enum Problem {
    Textbook(usize, Box<dyn LimitState>),
    Lanes { density: Box<DensityModel>, question: Question, headways: SampleHeadways },
}

impl Case {
    /// Gives density and limit state to some work.
    fn with<T>(&self, work: impl FnOnce(&dyn Density, &dyn LimitState) -> T) -> T {
        match &self.problem {
            Problem::Textbook(dimensions, limit) => work(&StandardNormal { dimensions: *dimensions }, &**limit),
            Problem::Lanes { density, question, headways } => {
                let profile = Profile::load("paper").expect("the profile");
                let backend = CpuBackend::lane_arithmetic();
                let executor = Executor::new(&backend);
                let lanes = LaneLimitState::new(density, &profile, headways, &[*question], executor);
                work(&truncated(density).expect("a density"), &lanes)
            }
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let at = |index: usize| arguments.get(index).map(String::as_str).unwrap_or_default();
    let number = |text: &str| text.parse::<f64>().expect("a number") as u64;
    let first = if at(3).is_empty() { FIRST_SEED } else { number(at(3)) };
    match at(0) {
        "repeats" => {
            println!(
                "case,truth,seed,probability,low,high,runs,rounds,effective_failures,crude_fraction,verdict,seconds"
            );
            cases(at(2)).iter().for_each(|case| repeats(case, first..first + number(at(1))));
        }
        "truth" => {
            println!("case,seeds,truth,relative_error");
            let seeds = FIRST_SEED_OF_TRUTHS..FIRST_SEED_OF_TRUTHS + number(at(1));
            cases(at(2)).iter().for_each(|case| truth(case, seeds.clone()));
        }
        "crude" => {
            println!("case,draws,failures,probability,failing_kernels,first_share,second_share,seconds");
            cases(at(2)).iter().for_each(|case| crude(case, number(at(1))));
        }
        // `cargo test --benches` calls without arguments: nothing to measure then.
        _ => (),
    }
}

fn cases(of: &str) -> Vec<Case> {
    let mut reader = csv::Reader::from_path(Path::new(FOLDER).join("cases.csv")).expect("the cases");
    let rows = reader.records().map(|row| row.expect("a case"));
    let case = |row: csv::StringRecord| {
        let problem = match row[1].strip_prefix("standard normal ") {
            Some(dimensions) => Problem::Textbook(dimensions.parse().expect("a number"), textbook(&row[2])),
            None => {
                let density = read_density(&Path::new(FOLDER).join("densities").join(&row[1])).expect("a density");
                let model = ModelId::parse(&row[2]).expect("a driver model");
                let criterion = Criterion::parse(&row[3]).expect("a criterion");
                let headways = SampleHeadways::Each(vec![Headway::ThwS(row[4].parse().expect("a headway"))]);
                let question = Question { model, criterion, headway: 0 };
                Problem::Lanes { density: Box::new(density), question, headways }
            }
        };
        Case { name: row[0].to_owned(), truth: row[5].parse().ok(), problem }
    };
    rows.filter(|row| row[0].contains(of)).map(case).collect()
}

fn setting(name: &str, default: f64) -> f64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
}

fn estimate(density: &dyn Density, limit_state: &dyn LimitState, seed: u64) -> (Vec<Estimate>, SearchRun) {
    let is_bounded = std::env::var("LANESWEEP_ASSURANCE").as_deref() != Ok("search");
    // Of a search alone as many as `sample` draws.
    let crude = setting("LANESWEEP_CRUDE", if is_bounded { 1e8 } else { 20_000.0 }) as u64;
    let half_width = setting("LANESWEEP_HALF_WIDTH", 0.1);
    let goal = Goal { half_width, max_draws: 10_000_000, max_crude: if is_bounded { crude } else { 0 } };
    let search = Search { crude, is_bounded, ..Search::default() };
    adaptive(density, limit_state, &search, &goal, seed, 0.95).expect("an estimate")
}

fn repeats(case: &Case, seeds: Range<u64>) {
    let Some(truth) = case.truth else { return };
    let (mut held, mut errors, mut runs) = (0, Vec::new(), Vec::new());
    for seed in seeds {
        let started = Instant::now();
        let (estimates, search) = case.with(|density, limit_state| estimate(density, limit_state, seed));
        let estimate = &estimates[0];
        let interval = estimate.interval;
        held += u64::from(interval.holds(truth));
        errors.push((estimate.probability / truth - 1.0).abs());
        runs.push(estimate.runs);
        println!(
            "{},{truth:e},{seed},{:e},{:e},{:e},{},{},{:.1},{:.3},{},{:.3}",
            case.name,
            estimate.probability,
            interval.low,
            interval.high,
            estimate.runs,
            search.rounds.len(),
            estimate.weights.map_or(0.0, |weights| weights.effective_failures),
            estimate.weights.map_or(0.0, |weights| weights.crude_fraction),
            estimate.trust.draws(),
            started.elapsed().as_secs_f64()
        );
    }
    errors.sort_by(f64::total_cmp);
    runs.sort_unstable();
    let middle = runs.len() / 2;
    eprintln!(
        "{}: truth {truth:.3e}, held {held} of {}, median error {:.1} %, runs {}",
        case.name,
        errors.len(),
        100.0 * errors[middle],
        runs[middle],
    );
}

/// The mean of unbiased estimates, and its error from their scatter.
fn truth(case: &Case, seeds: Range<u64>) {
    let n = (seeds.end - seeds.start) as f64;
    let of = |seed| case.with(|density, limit_state| estimate(density, limit_state, seed)).0[0].probability;
    let all: Vec<f64> = seeds.map(of).collect();
    let mean = all.iter().sum::<f64>() / n;
    let variance = all.iter().map(|p| (p - mean) * (p - mean)).sum::<f64>() / (n - 1.0);
    println!("{},{n},{mean:.5e},{:.4}", case.name, (variance / n).sqrt() / mean);
}

/// Crude draws, and which kernels their failures come from.
fn crude(case: &Case, draws: u64) {
    let started = Instant::now();
    let (failures, shares) = case.with(|density, limit_state| {
        let failures = limit_state.failures(density, Stream { seed: 5, purpose: 77 }, 0..draws).expect("failures");
        let mixture = density.mixture();
        let kernel = |k: usize| {
            Mixture::new(vec![1.0], vec![mixture.mean(k).to_vec()], vec![mixture.factor(k).clone()], vec![0])
        };
        let kernels: Vec<Mixture> = (0..mixture.weights().len()).map(|k| kernel(k).expect("a kernel")).collect();
        let mut shares = vec![0.0_f64; kernels.len()];
        for failure in &failures {
            let own = kernels.iter().zip(mixture.weights());
            let own: Vec<f64> = own.map(|(of, weight)| weight * of.log_density(&failure.point).exp()).collect();
            let all = own.iter().sum::<f64>() * failures.len() as f64;
            shares.iter_mut().zip(own).for_each(|(sum, own)| *sum += own / all);
        }
        (failures.len(), shares)
    });
    let mut sorted = shares.clone();
    sorted.sort_by(|a: &f64, b: &f64| b.total_cmp(a));
    println!(
        "{},{draws},{failures},{:.4e},{:.2},{:.3},{:.3},{:.1}",
        case.name,
        failures as f64 / draws as f64,
        1.0 / shares.iter().map(|share| share * share).sum::<f64>(),
        sorted[0],
        sorted.get(1).unwrap_or(&0.0),
        started.elapsed().as_secs_f64()
    );
}

/// Limit states over independent standard normal parameters; twins of `rare_failures.py`.
fn textbook(name: &str) -> Box<dyn LimitState> {
    fn limit(value: impl Fn(&[f64]) -> f64 + Sync + 'static) -> Box<dyn LimitState> {
        Box::new(move |points: &[Vec<f64>]| -> Result<Vec<f64>> { Ok(points.iter().map(|x| value(x)).collect()) })
    }
    let four_branches = |near: f64, far: f64| {
        limit(move |x: &[f64]| {
            let (u, v) = ((x[0] + x[1]) / std::f64::consts::SQRT_2, (x[0] - x[1]) / std::f64::consts::SQRT_2);
            (near + 0.2 * v * v - u.abs()).min(far - v.abs())
        })
    };
    match name {
        "plane" => limit(|x| 4.753_424_308_822_899 - x.iter().sum::<f64>() / (x.len() as f64).sqrt()),
        "four_modes" => limit(|x| 4.5 - x[0].abs().max(x[1].abs())),
        "four_branches_3" => four_branches(3.0, 3.5),
        "four_branches_5" => four_branches(5.0, 5.2),
        "parabola" => limit(|x| 5.0 - x[1] - 0.5 * (x[0] - 0.1) * (x[0] - 0.1)),
        "metaball" => limit(|x| {
            let a = 4.0 * (x[0] + 2.0) * (x[0] + 2.0) / 9.0 + x[1] * x[1] / 25.0;
            let b = (x[0] - 2.5) * (x[0] - 2.5) / 4.0 + (x[1] - 0.5) * (x[1] - 0.5) / 25.0;
            30.0 / (a * a + 1.0) + 20.0 / (b * b + 1.0) - 5.0
        }),
        "needle" => limit(|x| libm::hypot(x[0] - 4.0, x[1]) - 0.3),
        other => panic!("there is no problem {other}"),
    }
}
