//! Rare failures: the truth by crude lanes, repeats of the adaptive estimator on lanes, and textbook problems.
//!
//! ```sh
//! cargo bench --bench rare -- truth 1e9 777           # a CSV row per case: failures of so many crude lanes, with this seed
//! cargo bench --bench rare -- repeats 200 truth.csv    # a row per case and seed; truths are the sums of that file
//! cargo bench --bench rare -- textbook 200             # a row per problem and seed
//! ```
//!
//! A fourth argument selects the cases whose name contains it; a fifth is the first seed of the repeats instead of 1000. `LANESWEEP_SUMO` and `LANESWEEP_DLR_HT` name folders of
//! recordings in highD's format; without one, its cases are left out, with a line on stderr.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Instant;

use lanesweep::Result;
use lanesweep::engine::{CpuBackend, Executor, Headway};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{
    Estimator, LaneLimitState, Question, SampleHeadways, SampleOptions, plan_samples, sample_crude, truncated,
};
use lanesweep::scenario::DataProvenance;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::stats::estimate::{Density, Goal, LimitState, Search, StandardNormal, adaptive};
use lanesweep::traffic::mining::{MiningOptions, mine_folder, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

/// Data, category, parameterization, model, headway [s]; all of collisions.
const CASES: [(&str, Category, &str, ModelId, f64); 15] = [
    ("default", Category::CutIn, "1", ModelId::Rss, 2.4),
    ("default", Category::CutIn, "2", ModelId::Fsm, 2.0),
    ("sumo", Category::CutIn, "3", ModelId::Fsm, 4.0),
    ("dlr", Category::CutIn, "2", ModelId::Fsm, 2.0),
    ("dlr", Category::CutIn, "2", ModelId::Rss, 2.2),
    ("default", Category::CutOut, "b", ModelId::Rss, 2.0),
    ("default", Category::CutOut, "c", ModelId::Reg157, 0.8),
    ("sumo", Category::CutOut, "b", ModelId::Rss, 1.6),
    ("dlr", Category::CutOut, "b", ModelId::Rss, 2.0),
    ("default", Category::Lvd, "i", ModelId::Rss, 0.7),
    ("default", Category::Lvd, "iv", ModelId::Fsm, 1.6),
    ("sumo", Category::Lvd, "i", ModelId::Fsm, 0.9),
    ("sumo", Category::Lvd, "iv", ModelId::Rss, 1.2),
    ("dlr", Category::Lvd, "i", ModelId::Fsm, 0.5),
    ("dlr", Category::Lvd, "iv", ModelId::Reg157, 2.0),
];

/// The first seed of repeats.
const FIRST_SEED: u64 = 1000;

struct Case {
    name: String,
    density: DensityModel,
    model: ModelId,
    headways: SampleHeadways,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let at = |index: usize| arguments.get(index).map(String::as_str).unwrap_or_default();
    let number = |text: &str| text.parse::<f64>().expect("a number") as u64;
    match at(0) {
        "truth" => {
            println!("case,lanes,failures,seed,seconds");
            cases(at(3)).iter().for_each(|case| truth(case, number(at(1)), number(at(2))));
        }
        "repeats" => {
            let truths = truths(at(2));
            let first = if at(4).is_empty() { FIRST_SEED } else { number(at(4)) };
            println!("{HEADING}");
            for case in cases(at(3)) {
                let Some(truth) = truths.get(&case.name) else { continue };
                let profile = Profile::load("paper").expect("the profile");
                let backend = CpuBackend::lane_arithmetic();
                let question = Question { model: case.model, criterion: Criterion::Collision, headway: 0 };
                let executor = Executor::new(&backend);
                let lanes = LaneLimitState::new(&case.density, &profile, &case.headways, &[question], executor);
                repeats(
                    &case.name,
                    *truth,
                    &truncated(&case.density).expect("a density"),
                    &lanes,
                    first..first + number(at(1)),
                );
            }
        }
        "textbook" => {
            println!("{HEADING}");
            for (name, truth, dimensions, limit_state) in problems() {
                if name.contains(at(3)) {
                    repeats(
                        &name,
                        truth,
                        &StandardNormal { dimensions },
                        &*limit_state,
                        FIRST_SEED..FIRST_SEED + number(at(1)),
                    );
                }
            }
        }
        // `cargo test --benches` calls without arguments: nothing to measure then.
        _ => (),
    }
}

fn cases(of: &str) -> Vec<Case> {
    let mut mined: BTreeMap<&str, Vec<Scenario>> = BTreeMap::new();
    let folder = |variable: &str| {
        let dir = std::env::var_os(variable).map(PathBuf::from);
        if dir.is_none() {
            eprintln!("SKIPPED: needs {variable}, a folder of recordings in highD's format");
        }
        let options = MiningOptions::default();
        dir.map(|dir| mine_folder(&dir, &options, Default::default(), || Ok(())).expect("recordings").scenarios)
    };
    let generated = mine_generated(&GeneratorOptions::default(), &MiningOptions::default(), || Ok(()));
    mined.insert("default", generated.expect("scenarios").scenarios);
    mined.extend(folder("LANESWEEP_SUMO").map(|scenarios| ("sumo", scenarios)));
    mined.extend(folder("LANESWEEP_DLR_HT").map(|scenarios| ("dlr", scenarios)));
    let mut all = Vec::new();
    for (data, category, key, model, thw_s) in CASES {
        let name = format!("{data} {} {key} {} {thw_s}s", category.key(), model.name());
        let Some(scenarios) = mined.get(data).filter(|_| name.contains(of)) else { continue };
        let provenance =
            DataProvenance { data: data.to_owned(), synthetic: false, scenarios_sha256: String::new(), driven: None };
        // P_valid must be known better than the probabilities: it is in no interval.
        let options = FitOptions { representativeness: false, valid_draws: 4_000_000, ..FitOptions::default() };
        let id = Parameterization::find(category, key).expect("a parameterization");
        let density = DensityModel::fit(id, scenarios, &provenance, &options).expect("a density").model;
        all.push(Case { name, density, model, headways: SampleHeadways::Each(vec![Headway::ThwS(thw_s)]) });
    }
    all
}

fn truth(case: &Case, lanes: u64, seed: u64) {
    let options = SampleOptions {
        seed,
        models: vec![case.model],
        ..SampleOptions::new(Estimator::CRUDE, lanes, case.headways.clone())
    };
    let profile = Profile::load("paper").expect("the profile");
    let mixture = case.density.mixture().expect("a density");
    let plan = plan_samples(&case.density, &mixture, &profile, &options).expect("a plan");
    let backend = CpuBackend::lane_arithmetic();
    let started = Instant::now();
    let run = sample_crude(&plan, 0..lanes, &Executor::new(&backend), &options, None, |_| Ok(())).expect("lanes");
    let row = run.rows.iter().find(|row| row.criterion == Criterion::Collision).expect("a row");
    let Case { name, .. } = case;
    println!("{name},{lanes},{},{seed},{:.1}", row.estimate.failures, started.elapsed().as_secs_f64());
}

/// Failures over lanes, summed over the rows of a case.
fn truths(path: &str) -> BTreeMap<String, f64> {
    let text = std::fs::read_to_string(path).expect("a file that `truth` printed");
    let mut sums: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [lanes, failures] = [1, 2].map(|at| cells[at].parse::<f64>().expect("a number"));
        let sum = sums.entry(cells[0].to_owned()).or_default();
        (sum[0], sum[1]) = (sum[0] + lanes, sum[1] + failures);
    }
    sums.into_iter().map(|(name, [lanes, failures])| (name, failures / lanes)).collect()
}

const HEADING: &str = "case,truth,seed,probability,low,high,coefficient_of_variation,runs,rounds,effective_failures,crude_fraction,verdict,seconds";

fn repeats(name: &str, truth: f64, nominal: &dyn Density, limit_state: &dyn LimitState, seeds: Range<u64>) {
    let crude = std::env::var("LANESWEEP_CRUDE").map_or(100_000_000, |text| text.parse().expect("a number"));
    let goal = Goal { half_width: 0.1, max_draws: 10_000_000, max_crude: crude };
    let options = Search { crude, ..Search::default() };
    let (mut held, mut errors, mut runs) = (0, Vec::new(), Vec::new());
    for seed in seeds {
        let started = Instant::now();
        let run = adaptive(nominal, limit_state, &options, &goal, seed, 0.95).expect("an estimate");
        let estimate = &run.estimates[0];
        let interval = estimate.interval;
        held += u64::from(interval.holds(truth));
        errors.push((estimate.probability / truth - 1.0).abs());
        runs.push(estimate.runs);
        println!(
            "{name},{truth:e},{seed},{:e},{:e},{:e},{:.4},{},{},{:.1},{:.3},{},{:.3}",
            estimate.probability,
            interval.low,
            interval.high,
            estimate.coefficient_of_variation,
            estimate.runs,
            run.search.rounds.len(),
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
        "{name}: truth {truth:.3e}, held {:.1} %, median error {:.1} %, runs {} (max {})",
        100.0 * held as f64 / errors.len() as f64,
        100.0 * errors[middle],
        runs[middle],
        runs[runs.len() - 1]
    );
}

type Problem = (String, f64, usize, Box<dyn LimitState>);

/// Problems over independent standard normal parameters, their probabilities by quadrature.
fn problems() -> Vec<Problem> {
    fn limit(value: impl Fn(&[f64]) -> f64 + Sync + 'static) -> Box<dyn LimitState> {
        Box::new(move |points: &[Vec<f64>]| -> Result<Vec<f64>> { Ok(points.iter().map(|x| value(x)).collect()) })
    }
    let tail = |beta: f64| 0.5 * libm::erfc(beta / std::f64::consts::SQRT_2);
    let density = |x: f64| libm::exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
    // ∫ φ(x) of(x) dx
    let integral = |from: f64, to: f64, of: &dyn Fn(f64) -> f64| {
        let steps = 200_000;
        let width = (to - from) / f64::from(steps);
        let middle = |i: i32| from + (f64::from(i) + 0.5) * width;
        (0..steps).map(|i| density(middle(i)) * of(middle(i)) * width).sum::<f64>()
    };
    let mut all: Vec<Problem> = Vec::new();
    for d in [2, 5, 10, 20] {
        let of = move |x: &[f64]| 4.753_424_308_822_899 - x.iter().sum::<f64>() / (x.len() as f64).sqrt();
        all.push((format!("plane d={d}"), 1e-6, d, limit(of)));
    }
    for d in [2, 5, 10, 20] {
        let both = 2.0 * tail(4.5);
        let of = |x: &[f64]| 4.5 - x[0].abs().max(x[1].abs());
        all.push((format!("four modes d={d}"), 2.0 * both - both * both, d, limit(of)));
    }
    for (near, far) in [(3.0, 3.5), (5.0, 5.2)] {
        let truth = integral(-far, far, &|v| 2.0 * tail(near + 0.2 * v * v)) + 2.0 * tail(far);
        let of = move |x: &[f64]| {
            let (u, v) = ((x[0] + x[1]) / std::f64::consts::SQRT_2, (x[0] - x[1]) / std::f64::consts::SQRT_2);
            (near + 0.2 * v * v - u.abs()).min(far - v.abs())
        };
        all.push((format!("four branches {near} {far}"), truth, 2, limit(of)));
    }
    let truth = integral(-12.0, 12.0, &|x| tail(5.0 - 0.5 * (x - 0.1) * (x - 0.1)));
    all.push(("parabola".to_owned(), truth, 2, limit(|x| 5.0 - x[1] - 0.5 * (x[0] - 0.1) * (x[0] - 0.1))));
    let ball = |x: f64, y: f64| {
        let a = 4.0 * (x + 2.0) * (x + 2.0) / 9.0 + y * y / 25.0;
        let b = (x - 2.5) * (x - 2.5) / 4.0 + (y - 0.5) * (y - 0.5) / 25.0;
        30.0 / (a * a + 1.0) + 20.0 / (b * b + 1.0) - 5.0
    };
    let truth = {
        // ∬ by the midpoint rule.
        let (steps, width) = (4000, 20.0 / 4000.0);
        let at = |i: i32| -10.0 + (f64::from(i) + 0.5) * width;
        let row = |i: i32| {
            let fails = |j: &i32| ball(at(i), at(*j)) <= 0.0;
            density(at(i)) * width * (0..steps).filter(fails).map(|j| density(at(j)) * width).sum::<f64>()
        };
        (0..steps).map(row).sum::<f64>()
    };
    all.push(("metaball".to_owned(), truth, 2, limit(move |x| ball(x[0], x[1]))));
    // A disc of radius 0.3 around (4, 0).
    let radius: f64 = 0.3;
    let half = |x: f64| (radius * radius - (x - 4.0) * (x - 4.0)).max(0.0).sqrt();
    let truth = integral(4.0 - radius, 4.0 + radius, &|x| 1.0 - 2.0 * tail(half(x)));
    all.push(("needle".to_owned(), truth, 2, limit(move |x| libm::hypot(x[0] - 4.0, x[1]) - radius)));
    all
}
