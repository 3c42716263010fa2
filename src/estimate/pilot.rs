//! The author's form of importance sampling with the proposal that it found, so that others can sample it again.

use super::draws::judged;
use super::importance::{FitProposal, Importance, PilotCheck, defended, importance, no_valid_point, worst_share};
use super::problem::{Density, LimitState, purpose};
use super::summary::Estimate;
use crate::Result;
use crate::density::Mixture;
use crate::random::Stream;

/// A pilot of `pilot_runs` draws of the density itself, its worst share (2 %) fitted, a defensive share (0.1; 0 gives
/// the author's own), then importance sampling. The estimate is checked against the pilot; the proposal comes back
/// without its defensive share.
///
/// # Errors
/// The limit state's and the fit's; [`crate::Error::Usage`] where the pilot has no valid point.
pub fn from_pilot_with_proposal(
    nominal: &dyn Density,
    limit_state: &dyn LimitState,
    fit: &dyn FitProposal,
    pilot_runs: u64,
    worst: f64,
    defence: f64,
    options: &Importance,
) -> Result<(Estimate, Mixture)> {
    let stream = Stream { seed: options.seed, purpose: purpose::NOMINAL };
    let pilot = judged(nominal, limit_state, stream, 0..pilot_runs)?;
    if pilot.points.is_empty() {
        return Err(no_valid_point("pilot"));
    }
    let proposal = defended(fit.fit(&worst_share(&pilot.points, &pilot.values, worst))?, nominal, defence)?;
    let mut estimate = importance(nominal, &proposal, limit_state, options)?;
    let runs = pilot.points.len() as u64;
    let failures = pilot.values.iter().filter(|v| **v <= 0.0).count() as u64;
    estimate.set_runs(estimate.runs + runs);
    PilotCheck { runs, failures }.check(&mut estimate);
    Ok((estimate, proposal.proposal().clone()))
}
