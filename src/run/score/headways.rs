//! Failed lanes by headway, of S and of every S'.

use lanesweep_engine::{Headway, LanePlan, Partial};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_support::Result;

/// Failed lanes of one category by headway.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadwayFailures {
    /// Headways.
    pub headways: Vec<Headway>,
    /// Models.
    pub models: Vec<ModelId>,
    /// Counts by variant × headway × model × criterion.
    failures: Vec<u64>,
}

impl HeadwayFailures {
    /// From a block of a plan.
    ///
    /// # Errors
    /// As [`Partial::headway_failures`].
    pub(crate) fn of(plan: &LanePlan, partial: &Partial, block: usize) -> Result<HeadwayFailures> {
        let failures = partial.headway_failures(plan, block)?.to_vec();
        Ok(HeadwayFailures { headways: plan.headways.clone(), models: plan.models.clone(), failures })
    }

    /// Failed lanes of a variant at a headway; models and criteria by their indices in the plan.
    pub fn count(&self, (variant, headway, model, criterion): (usize, usize, usize, Criterion)) -> u64 {
        let lane = (variant * self.headways.len() + headway) * self.models.len() + model;
        self.failures[lane * Criterion::ALL.len() + criterion.index()]
    }
}
