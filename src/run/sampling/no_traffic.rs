//! Draws of cut-outs that no traffic has, because the vehicle that cuts out drives through the one ahead of it. Maps and tables
//! of cases leave them out by the same rule; here a fixed number of further draws tells what they are of P.

use rayon::prelude::*;
use serde::Serialize;

use super::Sample;
use super::against_recorded::cells_of;
use super::estimate_rows::EstimateRow;
use super::plan::{plan_draws, plan_points};
use crate::Result;
use crate::engine::{CpuBackend, Executor, Headway, KernelCounts, Wanted};
use crate::random::Stream;
use crate::scenario::Category;

/// Number of draws.
pub const TRAFFIC_DRAWS: u64 = 20_000;
const PURPOSE: u32 = 0x7261_6666;

/// What draws without possible traffic are of an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoTraffic {
    /// Their fraction of the draws.
    pub fraction: f64,
    /// The probability that a draw is one of them and fails.
    pub failing: f64,
    /// The probability that a draw with possible traffic fails.
    pub possible_probability: f64,
}

impl Sample {
    /// Adds to rows of cut-outs what draws without possible traffic are of them.
    ///
    /// # Errors
    /// Those of the lanes.
    pub(super) fn count_no_traffic(&self, rows: &mut [EstimateRow], headways: &[Headway]) -> Result<()> {
        let (density, profile, options) = (&self.density, &self.profile, &self.options);
        if density.category() != Category::CutOut {
            return Ok(());
        }
        let stream = Stream { seed: options.seed, purpose: PURPOSE };
        let plan = plan_draws(density, stream, profile, TRAFFIC_DRAWS, &options.models, &options.headways)?;
        let Some(generator) = plan.generator() else { return Ok(()) };
        let drawn: Vec<(Vec<f64>, bool)> = (0..TRAFFIC_DRAWS)
            .into_par_iter()
            .map(|index| generator.draw(index))
            .filter(|drawn| !drawn.is_void())
            .filter_map(|drawn| {
                let point: Vec<f64> =
                    drawn.values[..generator.points.dimensions].iter().map(|v| f64::from(*v)).collect();
                let case = density.space.case(&point, &density.sizes, profile.frame.dt_s).ok()?;
                Some((point, case.drives_through_s(profile).is_some()))
            })
            .collect();
        let count = drawn.len() as f64;
        let impossible: Vec<Vec<f64>> =
            drawn.into_iter().filter_map(|(point, is_not)| is_not.then_some(point)).collect();
        let lanes = plan.headways.len() * options.models.len();
        let mut counts = KernelCounts::zero(1, lanes);
        if !impossible.is_empty() {
            let plan = plan_points(density, &impossible, profile, &options.models, &options.headways)?;
            let cpu = CpuBackend::lane_arithmetic();
            Executor::new(&cpu).sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
                chunk.verdicts.chunks(lanes).for_each(|of_sample| counts.count_sample(0, of_sample));
                Ok(())
            })?;
        }
        let fraction = impossible.len() as f64 / count.max(1.0);
        for row in rows {
            let cells = cells_of(row, &options.models, headways);
            let failing = counts.over(&cells).1[0] as f64 / (count * cells.len() as f64).max(1.0);
            let possible_probability = ((row.estimate.probability - failing) / (1.0 - fraction)).max(0.0);
            row.no_traffic = (fraction > 0.0).then_some(NoTraffic { fraction, failing, possible_probability });
        }
        Ok(())
    }
}
