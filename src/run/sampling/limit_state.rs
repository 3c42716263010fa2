//! The limit state of a lane: one number that is ≤ 0 exactly if a criterion failed, and decreases towards failure. Also
//! evaluates points as lanes for the estimators.

use super::plan::{SampleHeadways, plan_points};
use crate::engine::{Executor, Marks, Outcome, Wanted};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::stats::density::{DensityModel, Mixture};
use crate::stats::estimate::{KernelShares, LimitState, Truncated, defended, kernel_shares};
use crate::{Error, Result};

/// Value far from any failure: the ego never closed in.
const FAR: f64 = 1e3;
/// Larger Brake Threat Numbers count as this one: an infinite value says only that no braking helps.
const MAX_BTN: f64 = 10.0;
/// Minimum value of a lane that did not fail, against rounding to the wrong side.
const MIN_UNFAILED: f64 = 1e-12;

/// Limit state of a lane. The verdict decides the sign.
///
/// | criterion | before failure | after |
/// |---|---|---|
/// | collision | smallest TTC, s | −(closing speed at the contact), m/s |
/// | TTC | smallest TTC − threshold, s | the same |
/// | BTN | threshold − largest BTN | the same, −(10 − threshold) at least |
///
/// The minimum TTC of a near miss goes to 0 with the remaining gap (braking ends √(2·gap/deceleration) before it). The
/// closing speed of a contact goes to 0 towards the near miss. So the value is continuous at the collision limit,
/// except for a side contact with a vehicle that is being passed.
pub fn limit_state(profile: &Profile, criterion: Criterion, outcome: &Outcome<f64>) -> f64 {
    let failed = outcome.verdicts.failed(criterion);
    let ttc = outcome.min_ttc.min(FAR);
    let value = match criterion {
        Criterion::Collision if failed => -outcome.impact_closing_speed.abs(),
        Criterion::Collision => ttc,
        Criterion::Ttc => ttc - profile.criteria.ttc_threshold_s,
        Criterion::Btn => profile.criteria.btn_threshold - outcome.max_btn.min(MAX_BTN),
    };
    if failed { value.min(0.0) } else { value.max(MIN_UNFAILED) }
}

/// One driver model under one criterion at one headway.
pub struct LaneLimitState<'a> {
    /// The density of the points.
    pub density: &'a DensityModel,
    /// Profile.
    pub profile: &'a Profile,
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// A single headway, or the density's own.
    pub headway: SampleHeadways,
    /// Computes the lanes, without rechecks.
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

/// The density of a density file, truncated to its valid region.
///
/// # Errors
/// As [`Truncated::with_validity`].
pub fn truncated(density: &DensityModel) -> Result<Truncated<impl Fn(&[f64]) -> bool + Sync + '_>> {
    Truncated::with_validity(density.mixture()?, |point: &[f64]| density.space.is_valid(point), density.valid.estimate)
}

/// Determines which scenarios failures come from, by draws of a proposal with the defensive mixture weight `defence`.
/// `None` if no draw fails.
///
/// # Errors
/// Those of the lanes.
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

/// The marks of lanes with a smaller [limit state](limit_state()) than the last one of a list. Also the criterion whose
/// failures all have these marks, if there is one; the few failures that enter the list always have them. `None` if
/// values of all lanes are needed.
pub(crate) fn marks_of(profile: &Profile, criterion: Criterion, last: f64) -> Option<(Marks, Option<Criterion>)> {
    let criteria = &profile.criteria;
    let below = |ttc_s: f64| {
        let is_rare = ttc_s > criteria.ttc_threshold_s;
        (Marks::TtcBelow(ttc_s.max(criteria.ttc_threshold_s)), (!is_rare).then_some(Criterion::Ttc))
    };
    match criterion {
        Criterion::Collision if last <= 0.0 => Some((Marks::Contacts(-last), None)),
        Criterion::Collision => Some(below(last)),
        // No value is smaller, and among equal values the first lane comes first.
        Criterion::Ttc if last <= -criteria.ttc_threshold_s => Some((Marks::Nothing, None)),
        Criterion::Btn if last <= criteria.btn_threshold - MAX_BTN => Some((Marks::Nothing, None)),
        Criterion::Ttc => Some(below(last + criteria.ttc_threshold_s)),
        Criterion::Btn if last <= 0.0 => Some((Marks::BtnFailures, Some(Criterion::Btn))),
        Criterion::Btn => None,
    }
}
