//! The runs of a check with a tenth of the time step: what the step itself changes.

use super::{Check, Judgement, StepBudget};
use crate::grid::Perturbation;
use lanesweep_engine::Outcome;
use lanesweep_model::profile::Profile;
use lanesweep_support::Result;

/// The runs of the unperturbed case with a tenth of the time step.
#[derive(Debug, Clone)]
pub struct FinerStep {
    /// The time step, s.
    pub dt_s: f64,
    /// One outcome per model, in the order of the judgement.
    pub outcomes: Vec<Outcome<f64>>,
}

impl FinerStep {
    pub(super) fn run(check: &Check, profile: &Profile, budget: &StepBudget) -> Result<FinerStep> {
        budget.check()?;
        let subject = &check.subject;
        let profile = Perturbation::FINER_STEP.profile(profile)?;
        let lane = subject.lane(&profile, subject.point())?;
        let outcomes: Vec<_> =
            check.models.iter().map(|model| lane.run(&profile, subject.category(), *model).outcome).collect();
        outcomes.iter().for_each(|outcome| budget.take(outcome));
        Ok(FinerStep { dt_s: profile.frame.dt_s, outcomes })
    }
}

impl Judgement {
    /// Whether a tenth of the time step changes the answer.
    pub fn turns_with_a_finer_step(&self) -> bool {
        self.flips.contains(&Perturbation::FINER_STEP.label())
    }
}
