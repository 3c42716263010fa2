//! Failed lanes by headway, of S and of every S'.

use lanesweep_engine::{Headway, LanePlan, Partial};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_support::{Error, Result};

/// Failed lanes of one category by headway.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadwayFailures {
    /// Names of the variants.
    pub variants: Vec<String>,
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
    /// [`Error::Internal`] if the counts do not match the plan.
    pub(crate) fn of(plan: &LanePlan, partial: &Partial, block: usize) -> Result<HeadwayFailures> {
        let failures = partial.headway_failures(plan, block)?.to_vec();
        HeadwayFailures::new(&plan.blocks[block].variants, &plan.headways, &plan.models, failures)
    }

    fn new(
        variants: &[String],
        headways: &[Headway],
        models: &[ModelId],
        failures: Vec<u64>,
    ) -> Result<HeadwayFailures> {
        let expected = variants.len() * headways.len() * models.len() * Criterion::ALL.len();
        if failures.len() != expected {
            let problem = format!("{} counts of failures by headway, expected {expected}", failures.len());
            return Err(Error::Internal(problem));
        }
        let (variants, headways, models) = (variants.to_vec(), headways.to_vec(), models.to_vec());
        Ok(HeadwayFailures { variants, headways, models, failures })
    }

    /// Failed lanes of a variant at a headway; models and criteria by their indices in the plan.
    pub fn count(&self, (variant, headway, model, criterion): (usize, usize, usize, Criterion)) -> u64 {
        let lane = (variant * self.headways.len() + headway) * self.models.len() + model;
        self.failures[lane * Criterion::ALL.len() + criterion.index()]
    }
}
