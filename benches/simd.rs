//! One core on every instruction set: lane-steps per second of every category and model and of a whole study, the
//! operations of a lane-step, the roof of the machine, one and two threads, and memory at 10^5, 10^6 and 10^7 lanes.
//!
//! `cargo bench --bench simd` prints one CSV row per part and repetition to stdout (kept under `benches/runs` with
//! the machine's facts) and a summary to stderr. Synthetic data of the paper's size, ten headways, the verdicts of
//! all lanes, one thread. `cargo bench --bench simd -- cut_in FSM AVX-512`, `-- study`, or `-- threads`, does no more
//! than what is named. Batches leave out calm steps; they are timed with every step made as well, and that is what shares
//! of the roof are worked out from: steps that are not made have no operations. The operations are those that batches do
//! for verdicts: what only smallest and largest values need, or what is known of a case beforehand, is not counted. The
//! roof is what independent additions, multiplications, or both in turn reach on values in registers; the best counts.

#![allow(unsafe_code)] // the roof's loops are compiled for instructions that the machine is asked for

mod common;
#[path = "../tests/common/counting.rs"]
mod counting;

use std::time::Instant;

use common::worker::{WORKER, Worker, cpu_seconds, serve};
use common::{lane_steps, paper_size_scenarios, peak_memory_bytes};
use counting::Counting;
use lanesweep::engine::{CpuBackend, Executor, Headway, Instructions, LanePlan, LaneRunner, Wanted};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::scenario::{Category, Scenario};
use rayon::prelude::*;

const REPETITIONS: usize = 15;
const THREADS_REPETITIONS: usize = 31;
/// Loops of the roof that threads share.
const ROOF_TASKS: usize = 32;
/// All categories in one sweep.
const STUDY: &str = "study";

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    let scenarios = paper_size_scenarios();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let named: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect();
    if named == [WORKER] {
        let plan = plan(&scenarios, Category::ALL.to_vec(), ModelId::ALL.to_vec(), Headway::paper());
        return serve(|| one.install(|| run(&plan, &CpuBackend::lane_arithmetic())));
    }
    println!("part,category,model,instructions,repetition,amount,unit,seconds");
    if named != ["threads"] {
        one.install(|| speeds(&scenarios));
    }
    if named.is_empty() || named == ["threads"] {
        threads(&scenarios);
    }
    if !named.is_empty() {
        return;
    }
    memory(&scenarios);
}

/// Every model on every instruction set: each category, and all of them in one sweep.
fn speeds(scenarios: &[Scenario]) {
    let sets: Vec<_> =
        Instructions::available().into_iter().filter(|set| is_wanted(set.name(), &instructions())).collect();
    let roofs: Vec<f64> = sets.iter().map(|&set| measured_roof(set)).collect();
    let wanted = Category::ALL.map(|c| c.key()).into_iter().chain([STUDY]).collect::<Vec<_>>();
    let models: Vec<_> = ModelId::ALL.iter().map(|m| m.name()).collect();
    for model in ModelId::ALL.into_iter().filter(|m| is_wanted(m.name(), &models)) {
        let mut of_study = Work::default();
        for category in Category::ALL.into_iter().filter(|c| is_wanted(c.key(), &wanted) || is_wanted(STUDY, &wanted)) {
            let plan = plan(scenarios, vec![category], vec![model], Headway::paper());
            let steps = lane_steps(&plan, &CpuBackend::lane_arithmetic());
            let work = Work { steps, operations: steps as f64 * operations(&plan, category, model) };
            of_study = Work { steps: of_study.steps + work.steps, operations: of_study.operations + work.operations };
            if is_wanted(category.key(), &wanted) {
                speed(category.key(), model, &plan, work, &sets, &roofs);
            }
        }
        if is_wanted(STUDY, &wanted) {
            let plan = plan(scenarios, Category::ALL.to_vec(), vec![model], Headway::paper());
            speed(STUDY, model, &plan, of_study, &sets, &roofs);
        }
    }
}

/// What a sweep has to do.
#[derive(Default, Clone, Copy)]
struct Work {
    /// Lane-steps.
    steps: u64,
    /// Operations of all of them.
    operations: f64,
}

/// Times one sweep on every instruction set.
fn speed(name: &str, model: ModelId, plan: &LanePlan, work: Work, sets: &[Instructions], roofs: &[f64]) {
    let Work { steps, operations } = work;
    eprint!("{name:>7} {:>6} {:6.1} operations/step", model.name(), operations / steps as f64);
    for (&set, roof) in sets.iter().zip(roofs) {
        let parts = ["sweep", "sweep with every step"];
        let backends =
            [CpuBackend::with_instructions(set).unwrap(), CpuBackend::with_instructions(set).unwrap().every_step()];
        let mut best = [f64::INFINITY; 2];
        // In turn, so that both see the same machine; scalar lanes make every step anyway.
        let ways = if set == Instructions::Scalar { 1 } else { 2 };
        for (repetition, way) in (0..REPETITIONS).flat_map(|repetition| (0..ways).map(move |way| (repetition, way))) {
            let seconds = time(|| run(plan, &backends[way]));
            println!("{},{name},{},{set},{repetition},{steps},lane-steps,{seconds}", parts[way], model.name());
            best[way] = best[way].min(seconds);
        }
        let rate = |seconds: f64| steps as f64 / seconds / 1e6;
        eprint!(" | {set} {:6.1} M/s", rate(best[0]));
        if ways > 1 {
            eprint!(", every step {:6.1} M/s ({:4.1} %)", rate(best[1]), 100.0 * operations / best[1] / roof);
        }
    }
    eprintln!();
}

fn instructions() -> Vec<&'static str> {
    Instructions::ALL.iter().map(|set| set.name()).collect()
}

/// Is this one of the names on the command line, or is none of its kind named there?
fn is_wanted(name: &str, kind: &[&str]) -> bool {
    let mut named = std::env::args().skip(1).filter(|arg| kind.contains(&arg.as_str())).peekable();
    named.peek().is_none() || named.any(|arg| arg == name)
}

/// Work on one and on two threads, in turn, so that all of it sees the same machine: the whole study, as it is swept and
/// with every step made, and the roof's loop, which needs no memory; and the study in one process of one thread, and in
/// two of them at once. What that loop or two processes lose, threads lose as well.
fn threads(scenarios: &[Scenario]) {
    let plan = &plan(scenarios, Category::ALL.to_vec(), ModelId::ALL.to_vec(), Headway::paper());
    let (swept, every_step) = (CpuBackend::lane_arithmetic(), CpuBackend::lane_arithmetic().every_step());
    let (steps, set) = (lane_steps(plan, &swept), Instructions::best());
    let roof = || (0..ROOF_TASKS).into_par_iter().map(|_| roof::operations(set, 2)).sum::<u64>();
    let operations = roof();
    let works: [(&str, u64, &str, &(dyn Fn() + Sync)); 3] = [
        ("study", steps, "lane-steps", &|| run(plan, &swept)),
        ("study every step", steps, "lane-steps", &|| run(plan, &every_step)),
        ("roof both in turn", operations, "operations", &|| assert_eq!(roof(), operations)),
    ];
    let pools = [1, 2].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    let mut workers = [Worker::start(), Worker::start()];
    let mut of_processes = [Vec::new(), Vec::new()];
    // Per work and number of threads: wall time and CPU time of every repetition.
    let mut times = vec![[Vec::new(), Vec::new()]; works.len()];
    for repetition in 0..THREADS_REPETITIONS {
        // The roof has no loop where lanes run one by one.
        for (&(name, amount, unit, work), times) in works.iter().zip(&mut times).filter(|(work, _)| work.1 > 0) {
            for (pool, times) in pools.iter().zip(times) {
                let before = cpu_seconds().unwrap_or(f64::NAN);
                let seconds = pool.install(|| time(work));
                let cpu = cpu_seconds().unwrap_or(f64::NAN) - before;
                let threads = pool.current_num_threads();
                println!("{name} on {threads} threads,,,{set},{repetition},{amount},{unit},{seconds}");
                if cpu.is_finite() {
                    println!("{name} on {threads} threads: CPU time,,,{set},{repetition},{amount},{unit},{cpu}");
                }
                times.push((seconds, cpu));
            }
        }
        // Each of them in turn is the one that works alone.
        let alone = repetition % 2;
        let alone = alone..=alone;
        for (which, of_processes) in [alone, 0..=1].into_iter().zip(&mut of_processes) {
            let workers = &mut workers[which];
            let count = workers.len();
            workers.iter_mut().for_each(Worker::ask);
            let cpu: f64 = workers.iter_mut().map(|worker| worker.answer() / count as f64).sum();
            if cpu.is_finite() {
                println!("study in {count} processes: CPU time each,,,{set},{repetition},{steps},lane-steps,{cpu}");
            }
            of_processes.push(cpu);
        }
    }
    for ((name, amount, unit, _), [one, two]) in works.iter().zip(&times).filter(|(work, _)| work.1 > 0) {
        let best = |times: &[(f64, f64)]| times.iter().fold(f64::INFINITY, |best, time| best.min(time.0));
        let (of_one, of_two) = (best(one), best(two));
        let rate = |seconds: f64| *amount as f64 / seconds / 1e6;
        eprintln!(
            "{name}: one thread {of_one:.3} s, two {of_two:.3} s; {:.0} and {:.0} M {unit}/s",
            rate(of_one),
            rate(of_two)
        );
        let cpu = |times: &[(f64, f64)]| times.iter().map(|time| time.1).collect::<Vec<f64>>();
        print_ratios("two threads over that on one", &cpu(one), &cpu(two));
    }
    print_ratios("one of two processes over that of one alone", &of_processes[0], &of_processes[1]);
}

/// CPU times side by side: their ratios, repetition by repetition, and the ratio of the least of each.
fn print_ratios(what: &str, one: &[f64], two: &[f64]) {
    let mut ratios: Vec<f64> = one.iter().zip(two).map(|(one, two)| two / one).collect();
    if ratios.iter().any(|ratio| !ratio.is_finite()) {
        return;
    }
    ratios.sort_by(f64::total_cmp);
    let quartile = |k: usize| ratios[(k * (ratios.len() - 1) + 2) / 4];
    let (low, middle, high) = (quartile(1), quartile(2), quartile(3));
    let min_of = |times: &[f64]| times.iter().fold(f64::INFINITY, |min, &time| min.min(time));
    let min_ratio = min_of(two) / min_of(one);
    eprintln!(
        "    CPU time on {what}: median {middle:.3}, quartiles {low:.3} and {high:.3}; least over least {min_ratio:.3}"
    );
}

/// Memory while 10^5, 10^6 and 10^7 lanes run: more headways of the same cases.
fn memory(scenarios: &[Scenario]) {
    for headways in [25, 250, 2500_u32] {
        let starts = (1..=headways).map(|k| Headway::ThwS(2.0 * f64::from(k) / f64::from(headways))).collect();
        let cut_ins: Vec<Scenario> =
            scenarios.iter().filter(|s| s.category == Category::CutIn).take(100).cloned().collect();
        let plan = plan(&cut_ins, vec![Category::CutIn], ModelId::ALL.to_vec(), starts);
        let seconds = time(|| run(&plan, &CpuBackend::lane_arithmetic()));
        let (lanes, peak) = (plan.lane_count(), peak_memory_bytes().unwrap_or(0));
        println!("peak memory at {lanes} lanes,cut_in,,{},0,{peak},bytes,{seconds}", Instructions::best());
        eprintln!("{lanes} lanes: peak memory {:.1} MB so far, {seconds:.2} s", peak as f64 / 1e6);
    }
}

fn plan(scenarios: &[Scenario], categories: Vec<Category>, models: Vec<ModelId>, headways: Vec<Headway>) -> LanePlan {
    let options = StudyOptions { categories, models, headways, ..StudyOptions::default() };
    plan_study(scenarios, &Profile::load("paper").unwrap(), &options).unwrap()
}

fn run(plan: &LanePlan, backend: &CpuBackend) {
    Executor::new(backend).sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |_| Ok(())).unwrap();
}

fn time<T>(work: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    std::hint::black_box(work());
    start.elapsed().as_secs_f64()
}

/// Operations of a lane-step, over lanes spread through the plan.
fn operations(plan: &LanePlan, category: Category, model: ModelId) -> f64 {
    let runner = LaneRunner::<Counting>::new(plan).verdicts_as_in_batches();
    let stride = (plan.lane_count() / 400).max(1);
    let (steps, count) = Counting::measure(|| {
        let lanes = (0..plan.lane_count()).step_by(stride as usize);
        lanes.map(|lane| u64::from(runner.run(&plan.key(lane).unwrap()).end_step) + 1).sum::<u64>()
    });
    let per_step = count.total() as f64 / steps as f64;
    println!("operations,{},{},,0,{per_step},per lane-step,", category.key(), model.name());
    per_step
}

/// Operations per second that the machine reaches at best; 0 for scalar lanes, which have no loop of their own.
fn measured_roof(set: Instructions) -> f64 {
    if set == Instructions::Scalar {
        return 0.0;
    }
    let mut best: f64 = 0.0;
    for (kind, name) in ["additions", "multiplications", "both in turn"].into_iter().enumerate() {
        let rates = (0..REPETITIONS).map(|repetition| {
            let start = Instant::now();
            let count = roof::operations(set, kind);
            let seconds = start.elapsed().as_secs_f64();
            println!("roof {name},,,{set},{repetition},{count},operations,{seconds}");
            count as f64 / seconds
        });
        let rate = rates.fold(0.0, f64::max);
        eprintln!("roof of {set}, {name}: {:.1} G operations/s", rate / 1e9);
        best = best.max(rate);
    }
    best
}

/// Independent chains of operations in registers.
mod roof {
    use lanesweep::engine::Instructions;

    const ROUNDS: u64 = 4_000_000;

    /// Runs 0 additions, 1 multiplications, 2 both in turn; gives their number, 0 where there is no loop for it.
    pub fn operations(set: Instructions, kind: usize) -> u64 {
        if !set.is_available() {
            return 0;
        }
        match set {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the machine was asked for the instructions.
            Instructions::Avx512 => unsafe { avx512(kind) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the machine was asked for the instructions.
            Instructions::Avx2 => unsafe { avx2(kind) },
            #[cfg(target_arch = "aarch64")]
            // SAFETY: every AArch64 machine has them.
            Instructions::Neon => unsafe { neon(kind) },
            _ => 0,
        }
    }

    macro_rules! chains {
        ($name:ident, $features:literal, $arch:ident, $set:ident, $add:ident, $multiply:ident, $lanes:literal, $chains:literal) => {
            #[target_feature(enable = $features)]
            fn $name(kind: usize) -> u64 {
                use std::arch::$arch::{$add, $multiply, $set};
                let (term, factor) = ($set(1.5), $set(0.999_999_9));
                let mut values = [$set(1.0); $chains];
                for _ in 0..ROUNDS {
                    for (at, value) in values.iter_mut().enumerate() {
                        let adds = kind == 0 || (kind == 2 && at % 2 == 0);
                        *value = if adds { $add(*value, term) } else { $multiply(*value, factor) };
                    }
                }
                std::hint::black_box(values);
                ROUNDS * $lanes * $chains
            }
        };
    }

    #[cfg(target_arch = "x86_64")]
    chains!(avx512, "avx512f", x86_64, _mm512_set1_ps, _mm512_add_ps, _mm512_mul_ps, 16, 16);
    #[cfg(target_arch = "x86_64")]
    chains!(avx2, "avx2", x86_64, _mm256_set1_ps, _mm256_add_ps, _mm256_mul_ps, 8, 12);
    #[cfg(target_arch = "aarch64")]
    chains!(neon, "neon", aarch64, vdupq_n_f32, vaddq_f32, vmulq_f32, 4, 16);
}
