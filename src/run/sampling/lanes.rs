//! Lanes as the limit state that estimators follow: points in, one number per point out.

use super::limit_state::limit_state;
use super::plan::{SampleHeadways, plan_points};
use crate::engine::{Executor, Wanted};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::stats::density::{DensityModel, Mixture};
use crate::stats::estimate::{KernelShares, LimitState, Truncated, defended, kernel_shares};
use crate::{Error, Result};

/// One driver model under one criterion at one headway.
pub struct LaneLimitState<'a> {
    /// The density whose points are judged.
    pub density: &'a DensityModel,
    /// Profile.
    pub profile: &'a Profile,
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// A single headway, or the density's own.
    pub headway: SampleHeadways,
    /// What computes; no lane is computed again.
    pub executor: Executor<'a>,
}

impl LimitState for LaneLimitState<'_> {
    fn evaluate(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        let plan = plan_points(self.density, points, self.profile, &[self.model], &self.headway)?;
        if plan.headways.len() != 1 {
            return Err(Error::Internal("a limit state has one headway".to_owned()));
        }
        let executor = Executor { recheck: None, ..self.executor.clone() };
        let mut values = Vec::with_capacity(points.len());
        executor.sweep(&plan, 0..plan.unit_count(), Wanted::Outcomes, |chunk| {
            values.extend(chunk.outcomes.iter().map(|o| limit_state(self.profile, self.criterion, o)));
            Ok(())
        })?;
        Ok(values)
    }
}

/// A density file's density, cut off at its valid region.
///
/// # Errors
/// As [`Truncated::with_share`].
pub fn truncated(density: &DensityModel) -> Result<Truncated<impl Fn(&[f64]) -> bool + Sync + '_>> {
    Truncated::with_share(density.mixture()?, |point: &[f64]| density.space.is_valid(point), density.valid.estimate)
}

/// Which scenarios failures come from, by draws of a proposal that keeps a share `defence` of the density. `None` where
/// none of them fails.
///
/// # Errors
/// Of the lanes.
pub fn scenario_shares(
    lanes: &LaneLimitState,
    proposal: &Mixture,
    defence: f64,
    seed: u64,
) -> Result<Option<KernelShares>> {
    let nominal = truncated(lanes.density)?;
    let proposal = defended(proposal.clone(), &nominal, defence)?;
    kernel_shares(nominal.mixture(), &nominal, &proposal, lanes, seed)
}
