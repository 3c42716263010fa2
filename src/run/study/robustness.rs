//! Lanes whose verdict does not depend on rounding.

use rayon::prelude::*;

use lanesweep_engine::{Chunk, Constants, LaneKey, LanePlan, Outcome, Start, silent};

/// Whether moving the initial gap by 1e-9 m changes neither verdicts nor crash type of the f64 reference, for every lane of a
/// chunk with outcomes. `None` for drivers outside the registry, which are slow lane by lane.
pub fn robust_lanes(plan: &LanePlan, chunk: &Chunk) -> Vec<Option<bool>> {
    let constants: Vec<Constants<f64>> =
        plan.blocks.iter().map(|b| Constants::resolve(&plan.profile, b.category)).collect();
    (0..chunk.outcomes.len())
        .into_par_iter()
        .map(|at| {
            let key = plan.key(chunk.first_lane + at as u64)?;
            let is_built_in = plan.models[key.model].foreign().is_none();
            is_built_in.then(|| is_robust(&constants[key.block], plan, &key))
        })
        .collect()
}

fn is_robust(constants: &Constants<f64>, plan: &LanePlan, key: &LaneKey) -> bool {
    let case = plan.case(key.block, key.unit, key.variant);
    let gap = plan.headways[key.headway].start::<f64>().gap(case.ego_speed);
    let run = |gap: f64| -> Outcome<f64> {
        constants.run(plan.models[key.model], &case, plan.tables(), Start::Gap(gap), silent)
    };
    let seen = |o: Outcome<f64>| (o.verdicts.0 & 0b111, o.contact);
    let middle = seen(run(gap));
    seen(run(gap - 1e-9)) == middle && seen(run(gap + 1e-9)) == middle
}
