//! S and every S' of one category under one profile, verdict by verdict.

use super::JustifyOptions;
use super::scores::Labels;
use crate::engine::{Executor, LanePlan, Partial, SweepSummary, Verdicts, Wanted};
use crate::model::profile::Profile;
use crate::run::compare::Compare;
use crate::scenario::Scenario;
use crate::scenario::parameterization::Parameterization;
use crate::traffic::DataProvenance;
use crate::{Error, Place, Result};

/// The lanes of one model, with every verdict kept: which failures are hidden is a question of single lanes.
pub(super) struct Replay<'a> {
    pub compare: Compare<'a>,
    pub counts: Partial,
    verdicts: Vec<Verdicts>,
    data: &'a str,
}

impl<'a> Replay<'a> {
    /// Runs them.
    ///
    /// # Errors
    /// As [`Compare::plan`] and [`Executor::sweep`].
    pub fn run(
        scenarios: &'a [Scenario],
        facts: &'a DataProvenance,
        profile: &Profile,
        options: &JustifyOptions,
        executor: &Executor,
        summary: &mut SweepSummary,
    ) -> Result<Replay<'a>> {
        let compare = Compare::plan(scenarios, facts, profile.clone(), options.compare.clone())?;
        let (mut verdicts, mut parts) = (Vec::new(), Vec::new());
        let plan = compare.lane_plan();
        let swept = executor.sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
            verdicts.extend(chunk.verdicts.iter().copied());
            parts.push(Partial::from_chunk(plan, &chunk)?);
            Ok(())
        })?;
        let counts = parts.into_iter().try_fold(Partial::empty(plan), Partial::merge)?;
        summary.add(&swept);
        Ok(Replay { compare, counts, verdicts, data: &facts.data })
    }

    pub fn plan(&self) -> &LanePlan {
        self.compare.lane_plan()
    }

    /// Position of a parameterization among the variants.
    ///
    /// # Errors
    /// [`Error::Input`] for one that the data cannot have.
    pub fn variant(&self, id: &Parameterization) -> Result<usize> {
        let found = self.plan().blocks[0].variants.iter().position(|name| *name == id.key);
        found.ok_or_else(|| {
            let problem = format!("the data has no {}", id.name());
            let help = "its decomposition needs more scenarios: use more recordings, or another parameterization";
            Error::input(Place::item(self.data), problem, help)
        })
    }

    /// The verdicts of a lane.
    pub fn verdicts(&self, unit: usize, variant: usize, headway: usize) -> Verdicts {
        let plan = self.plan();
        self.verdicts[(unit * plan.blocks[0].variants.len() + variant) * plan.headways.len() + headway]
    }

    /// Labels by what says whether a lane failed.
    pub fn labels<'f>(&self, failed: &'f dyn Fn(usize, usize, usize) -> bool) -> Labels<'f> {
        let plan = self.plan();
        Labels { units: plan.blocks[0].units.len() as usize, headways: plan.headways.len(), failed }
    }
}
