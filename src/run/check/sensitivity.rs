//! The verdict by other rules and readings: which reference drivers have to avoid the collision, and what the profile
//! says where Annex 3 is silent.

use super::annex;
use super::verdict::settled;
use super::{CaseVerdicts, Changed, Check, StepBudget, Verdict, flips};
use crate::Result;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;

/// Which reference drivers have to avoid a collision, so that it is preventable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriverRule {
    /// This one.
    Alone(ModelId),
    /// Any of them: the rule in force.
    Any,
    /// All of them.
    All,
}

impl DriverRule {
    /// Where the rule in force comes from. Annex 3 has two drivers and does not say which of them decides.
    pub const SOURCE: &'static str = "This is a reading of ours (profile key `reference_drivers`): no paragraph of UN R157 \
                                      prescribes that one driver suffices";

    /// The rules for some reference drivers, in the order of tables.
    pub fn of(references: &[ModelId]) -> Vec<DriverRule> {
        let alone = references.iter().map(|model| DriverRule::Alone(*model));
        alone.chain([DriverRule::Any, DriverRule::All]).collect()
    }

    /// Heading of a column.
    pub fn label(self) -> String {
        match self {
            DriverRule::Alone(model) => format!("{} alone", model.name()),
            DriverRule::Any => "any (in force)".to_owned(),
            DriverRule::All => "all".to_owned(),
        }
    }

    /// Whether a collision that threatens is preventable.
    pub fn holds(self, references: &[ModelId], avoids: impl Fn(ModelId) -> bool) -> bool {
        match self {
            DriverRule::Alone(model) => avoids(model),
            DriverRule::Any => references.iter().any(|model| avoids(*model)),
            DriverRule::All => references.iter().all(|model| avoids(*model)),
        }
    }
}

/// The verdicts of a reading, one per rule.
#[derive(Debug, Clone, PartialEq)]
pub struct RuleVerdicts {
    /// The changed key of the profile with its value; `None`: the profile as it is.
    pub reading: Option<&'static str>,
    /// In the order of [`DriverRule::of`].
    pub verdicts: Vec<(DriverRule, Verdict)>,
}

impl Check {
    /// The verdicts by rule under a profile, whose runs are given, and under each other reading if these are wanted; empty
    /// without reference drivers. Each is decided as the sheet's own: no perturbation alters it, and it does not rest on a
    /// driver that touches.
    pub(super) fn by_rule(
        &self,
        profile: &Profile,
        (is, touching): (&[Changed], &[ModelId]),
        with_readings: bool,
        budget: &StepBudget,
    ) -> Result<Vec<RuleVerdicts>> {
        let references = &profile.reference_drivers;
        if references.is_empty() {
            return Ok(Vec::new());
        }
        let rules = |reading, changed: &[Changed], touching: &[ModelId]| {
            let is = &changed[0].verdicts;
            let verdict = |rule| {
                let is_robust = flips(changed, |changed| changed.verdicts.answer_within_the_cap(rule)).is_empty();
                settled(is.verdict_by(rule), is_robust && !is.rests_on(touching, rule))
            };
            let verdicts = DriverRule::of(references).into_iter().map(|rule| (rule, verdict(rule))).collect();
            RuleVerdicts { reading, verdicts }
        };
        let mut all = vec![rules(None, is, touching)];
        if with_readings {
            for other in annex::readings_where_silent(profile, &self.subject)? {
                let changed = self.perturbed(&other.profile, budget)?;
                all.push(rules(Some(other.instead), &changed, &self.touching(&changed, &other.profile)?));
            }
        }
        Ok(all)
    }
}

impl CaseVerdicts {
    /// The computed verdicts by rule; empty without reference drivers.
    pub fn by_rule(&self) -> Vec<RuleVerdicts> {
        let verdict = |rule| (rule, self.verdict_by(rule));
        let verdicts = DriverRule::of(&self.reference_drivers).into_iter().map(verdict).collect();
        let is_judged = !self.reference_drivers.is_empty();
        is_judged.then_some(RuleVerdicts { reading: None, verdicts }).into_iter().collect()
    }
}
