//! What benchmarks share: a study of the paper's size on synthetic data.

#![allow(dead_code)] // every benchmark uses its own part

pub mod worker;

use lanesweep::engine::{Backend, Executor, LanePlan, Partial, Wanted};
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, DataProvenance, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::traffic::mining::{MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

/// The paper's kept scenarios.
pub const PAPER: [(Category, usize); 3] = [(Category::CutIn, 362), (Category::CutOut, 819), (Category::Lvd, 482)];

/// Synthetic scenarios, repeated under new keys up to the paper's numbers.
pub fn paper_size_scenarios() -> Vec<Scenario> {
    let generator = GeneratorOptions { recordings: 24, ..GeneratorOptions::default() };
    let mined = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap();
    let mut scenarios = Vec::new();
    for (category, count) in PAPER {
        let kept: Vec<&Scenario> = mined.scenarios.iter().filter(|s| s.category == category && s.kept).collect();
        for k in 0..count {
            let mut scenario = kept[k % kept.len()].clone();
            scenario.id = format!("{}#{}", scenario.id, k / kept.len());
            scenarios.push(scenario);
        }
    }
    scenarios
}

/// A density of synthetic scenarios.
pub fn density(category: Category, key: &str, scenarios: &[Scenario]) -> DensityModel {
    let facts =
        DataProvenance { data: "synthetic".to_owned(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let options = FitOptions { valid_draws: 1000, ..FitOptions::default() };
    DensityModel::fit(Parameterization::find(category, key).unwrap(), scenarios, &facts, &options).unwrap().model
}

/// Evaluated steps of all lanes.
pub fn lane_steps(plan: &LanePlan, backend: &dyn Backend) -> u64 {
    let mut steps = 0;
    Executor::new(backend)
        .sweep(plan, 0..plan.unit_count(), Wanted::Outcomes, |chunk| {
            steps += chunk.outcomes.iter().map(|o| u64::from(o.end_step) + 1).sum::<u64>();
            Ok(())
        })
        .unwrap();
    steps
}

/// The partial of a whole plan, from verdicts alone.
pub fn swept(plan: &LanePlan, backend: &dyn Backend) -> Partial {
    let mut parts = Vec::new();
    Executor::new(backend)
        .sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
            parts.push(Partial::from_chunk(plan, &chunk)?);
            Ok(())
        })
        .unwrap();
    parts.into_iter().try_fold(Partial::empty(plan), Partial::merge).unwrap()
}

/// Linux: the process's highest resident memory.
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}
