#[path = "../benches/common/mod.rs"]
#[allow(dead_code)]
mod common;
use common::{lane_steps, paper_size_scenarios};
use lanesweep::driver::ModelId;
use lanesweep::profile::Profile;
use lanesweep::scenario::Category;
use lanesweep::sweep::*;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let reps: usize = args[0].parse().unwrap();
    let scenarios = paper_size_scenarios();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    one.install(|| {
        for category in Category::ALL {
            for model in ModelId::ALL {
                if args.len() > 1 && !args[1..].iter().any(|a| *a == format!("{}-{}", category.key(), model.name())) {
                    continue;
                }
                let options = StudyOptions { categories: vec![category], models: vec![model], ..StudyOptions::default() };
                let plan = plan_study(&scenarios, &Profile::load("paper").unwrap(), &options).unwrap().plan;
                let backend = CpuBackend::lane_arithmetic();
                let steps = lane_steps(&plan, &backend);
                let mut times: Vec<f64> = (0..reps).map(|_| {
                    let t = Instant::now();
                    sweep(&plan, 0..plan.unit_count(), &backend, &SweepOptions::plain(Wanted::Verdicts), |c| { std::hint::black_box(c); Ok(()) }).unwrap();
                    t.elapsed().as_secs_f64()
                }).collect();
                times.sort_by(f64::total_cmp);
                let lanes = plan.lane_count();
                let best = times[0];
                println!("{:>8} {:>7} lanes {lanes} steps/lane {:6.1} best {:7.1} M/s median {:7.1} ns/lane {:6.1} ns/16-step {:6.2}", category.key(), model.name(), steps as f64 / lanes as f64, steps as f64 / best / 1e6, steps as f64 / times[reps/2] / 1e6, best*1e9/lanes as f64, best * 16e9 / steps as f64);
            }
        }
    });
}
