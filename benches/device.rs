//! A device beside the CPU, in one run: lanes and lane-steps per second of every category and model, end to
//! end and by the device's own clock, with the operations of a lane-step.
//!
//! `cargo bench --bench device -- --device NAME [--headways N] [--repetitions N] [--lanes-per-invocation N]...` prints one
//! CSV row per part and repetition to stdout (kept under `benches/runs` with the machine's facts) and a summary to stderr.
//! Synthetic data of the paper's size, at N time headways from 0.2 s to 2.0 s (10 unless told otherwise; a
//! real GPU needs 1,000 and more to be busy). Both compute the same lanes. The CPU runs ten headways.

mod common;
#[path = "../tests/common/counting.rs"]
mod counting;

use std::time::Instant;

use common::{lane_steps, paper_size_scenarios};
use counting::{Counting, OperationCount};
use lanesweep::engine::gpu::{Adapters, GpuBackend, GpuOptions, choose};
use lanesweep::engine::{Backend, BackendChoice, CpuBackend, Executor, Headway, LanePlan, LaneRunner, Wanted};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::scenario::{Category, Scenario};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !args.iter().any(|arg| arg == "--bench") {
        return;
    }
    let value = |flag: &str| args.iter().position(|a| a == flag).and_then(|at| args.get(at + 1));
    let headways = value("--headways").map_or(10, |n| n.parse().expect("--headways N"));
    let repetitions = value("--repetitions").map_or(3, |n| n.parse().expect("--repetitions N"));
    let name = value("--device").map(String::as_str);
    let adapters = Adapters::enumerate();
    let index = choose(adapters.cards(), BackendChoice::Gpu, name).expect("a device").expect("a device");
    let mut per_invocation: Vec<Option<u32>> = args
        .windows(2)
        .filter(|pair| pair[0] == "--lanes-per-invocation")
        .map(|pair| Some(pair[1].parse().expect("--lanes-per-invocation N")))
        .collect();
    // What the program chooses comes first.
    per_invocation.insert(0, None);
    let open = |lanes_per_invocation| {
        let options = GpuOptions { lanes_per_invocation, ..GpuOptions::default() };
        let name = lanes_per_invocation.map_or("device".to_owned(), |lanes| format!("device:{lanes}"));
        (name, GpuBackend::open(&adapters, index, options).expect("an open device"))
    };
    let gpus: Vec<(String, GpuBackend)> = per_invocation.into_iter().map(open).collect();
    let cpu = CpuBackend::lane_arithmetic();
    eprintln!("{}\n{}", gpus[0].1.describe(), cpu.describe());
    println!("backend,category,model,wanted,repetition,lanes,lane_steps,seconds,device_seconds");
    let scenarios = paper_size_scenarios();
    for category in Category::ALL {
        for model in ModelId::ALL {
            let many = plan(&scenarios, category, model, headways);
            let ten = plan(&scenarios, category, model, 10);
            operations(&ten, category, model);
            let (many_steps, ten_steps) = (lane_steps(&many, &gpus[0].1), lane_steps(&ten, &cpu));
            for repetition in 0..repetitions {
                for (name, gpu) in &gpus {
                    time(gpu, name, &many, category, model, many_steps, Wanted::Verdicts, repetition);
                }
                time(&cpu, "cpu", &ten, category, model, ten_steps, Wanted::Verdicts, repetition);
            }
        }
    }
}

fn plan(scenarios: &[Scenario], category: Category, model: ModelId, headways: u32) -> LanePlan {
    let last = f64::from(headways.max(2) - 1);
    let options = StudyOptions {
        categories: vec![category],
        models: vec![model],
        headways: (0..headways).map(|k| Headway::ThwS(2.0 - 1.8 * f64::from(k) / last)).collect(),
        ..StudyOptions::default()
    };
    plan_study(scenarios, &Profile::load("paper").unwrap(), &options).unwrap()
}

#[allow(clippy::too_many_arguments)] // one row's columns
fn time(
    backend: &dyn Backend,
    name: &str,
    plan: &LanePlan,
    category: Category,
    model: ModelId,
    steps: u64,
    wanted: Wanted,
    repetition: usize,
) {
    let start = Instant::now();
    let summary = Executor::new(backend).sweep(plan, 0..plan.unit_count(), wanted, |_| Ok(())).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let (category, model, lanes) = (category.key(), model.name(), plan.lane_count());
    let device = summary.device_s.map_or(String::new(), |s| s.to_string());
    println!("{name},{category},{model},{wanted:?},{repetition},{lanes},{steps},{seconds},{device}");
    let rate = |s: f64| steps as f64 / s / 1e6;
    let own = summary.device_s.map_or(String::new(), |s| format!(", {:10.1} by its own clock", rate(s)));
    eprintln!("{name:>7} {category:>7} {model:>6} {wanted:?}: {:10.1} M lane-steps/s{own}", rate(seconds));
}

/// Operations of a lane-step, over lanes spread through the plan.
fn operations(plan: &LanePlan, category: Category, model: ModelId) {
    let runner = LaneRunner::<Counting>::new(plan);
    let stride = (plan.lane_count() / 400).max(1);
    let (steps, count) = Counting::measure(|| {
        let lanes = (0..plan.lane_count()).step_by(stride as usize);
        lanes.map(|lane| u64::from(runner.run(&plan.key(lane).unwrap()).end_step) + 1).sum::<u64>()
    });
    let OperationCount { additions, multiplications, divisions, comparisons, unbounded: _ } = count;
    let per = |n: u64| n as f64 / steps as f64;
    for (kind, n) in [
        ("additions", additions),
        ("multiplications", multiplications),
        ("divisions", divisions),
        ("comparisons", comparisons),
    ] {
        println!("operations,{},{},{kind},0,,{steps},,{}", category.key(), model.name(), per(n));
    }
    eprintln!(
        "{:>7} {:>6}: {:.1} operations per lane-step ({:.1} add, {:.1} multiply, {:.2} divide, {:.1} compare)",
        category.key(),
        model.name(),
        per(count.total()),
        per(additions),
        per(multiplications),
        per(divisions),
        per(comparisons)
    );
}
