//! The CPU backend: every unit is a task of the rayon pool, every lane a scalar loop. f32 computes the lane
//! arithmetic that all backends share; f64 is the reference.

use std::marker::PhantomData;
use std::ops::Range;

use rayon::prelude::*;

use super::backend::{Backend, CellCounts, Chunk, Session, Wanted};
use super::outcome::{Outcome, Verdicts};
use super::plan::LanePlan;
use super::runner::LaneRunner;
use crate::Result;
use crate::scalar::Real;

/// Rayon over units, scalar lanes, in the arithmetic `R`.
#[derive(Debug, Default)]
pub struct CpuBackend<R> {
    arithmetic: PhantomData<R>,
}

impl CpuBackend<f32> {
    /// The lane arithmetic: binary32.
    pub fn lane_arithmetic() -> Self {
        CpuBackend { arithmetic: PhantomData }
    }
}

impl CpuBackend<f64> {
    /// The reference: binary64, same source.
    pub fn reference() -> Self {
        CpuBackend { arithmetic: PhantomData }
    }
}

impl<R: Real> Backend for CpuBackend<R> {
    fn describe(&self) -> String {
        let bits = 8 * std::mem::size_of::<R>();
        let threads = rayon::current_num_threads();
        format!("CPU, {threads} thread{}, scalar binary{bits}", if threads == 1 { "" } else { "s" })
    }

    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
        Ok(Box::new(CpuSession::<R> { plan, runner: LaneRunner::new(plan) }))
    }
}

struct CpuSession<'p, R> {
    plan: &'p LanePlan,
    runner: LaneRunner<'p, R>,
}

impl<R: Real> Session for CpuSession<'_, R> {
    fn run(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk> {
        let plan = self.plan;
        let first_lane = plan.first_lane_of(units.start);
        let mut verdicts = Vec::new();
        let mut outcomes = Vec::new();
        let mut counts = Vec::new();
        for (block, inside) in plan.segments(units.clone()) {
            let per_unit = plan.lanes_per_unit(&plan.blocks[block]) as usize;
            let count = (inside.end - inside.start) as usize;
            match wanted {
                Wanted::Verdicts => {
                    let from = verdicts.len();
                    verdicts.resize(from + count * per_unit, Verdicts::default());
                    verdicts[from..].par_chunks_mut(per_unit).enumerate().for_each(|(k, lanes)| {
                        self.runner
                            .run_unit(block, inside.start + k as u64, |at, outcome| lanes[at] = outcome.verdicts);
                    });
                }
                Wanted::Outcomes => {
                    let per_units: Vec<Vec<Outcome<f64>>> = (0..count)
                        .into_par_iter()
                        .map(|k| {
                            let mut lanes = Vec::with_capacity(per_unit);
                            self.runner.run_unit(block, inside.start + k as u64, |_, o| lanes.push(o.widen()));
                            lanes
                        })
                        .collect();
                    for lanes in per_units {
                        verdicts.extend(lanes.iter().map(|o| o.verdicts));
                        outcomes.extend(lanes);
                    }
                }
                Wanted::Counts => {
                    counts.resize(plan.cell_count(), CellCounts::EMPTY);
                    let cells = plan.blocks[block].variants.len() * plan.models.len();
                    let empty = || vec![CellCounts::EMPTY; cells];
                    let lanes_per_variant = plan.headways.len() * plan.models.len();
                    let of_units = (0..count).into_par_iter().fold(empty, |mut cells, k| {
                        self.runner.run_unit(block, inside.start + k as u64, |at, outcome| {
                            let cell = at / lanes_per_variant * plan.models.len() + at % plan.models.len();
                            cells[cell].count(&outcome);
                        });
                        cells
                    });
                    // Whole numbers and smallest values: the order of the sum does not matter.
                    let sum = of_units.reduce(empty, |mut a, b| {
                        a.iter_mut().zip(&b).for_each(|(a, b)| a.add(b));
                        a
                    });
                    let first = plan.cell(block, 0, 0);
                    counts[first..first + cells].iter_mut().zip(&sum).for_each(|(a, b)| a.add(b));
                }
            }
        }
        if wanted == Wanted::Counts {
            counts.resize(plan.cell_count(), CellCounts::EMPTY);
        }
        Ok(Chunk { units, first_lane, verdicts, outcomes, counts })
    }
}
