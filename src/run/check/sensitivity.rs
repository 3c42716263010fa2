//! The verdict by other rules and readings: which reference drivers have to avoid the collision, and what the profile
//! says where Annex 3 is silent.

use super::verdict::{DriverRule, settled};
use super::{Changed, Check, StepBudget, Verdict, annex, flips};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_support::Result;

/// The verdicts of a reading, one per rule.
#[derive(Debug, Clone, PartialEq)]
pub struct RuleVerdicts {
    /// The changed key of the profile with its value; `None`: the profile as it is.
    pub reading: Option<&'static str>,
    /// In the order of `DriverRule::of`.
    pub verdicts: Vec<(DriverRule, Verdict)>,
}

impl Check {
    /// The verdicts by rule under a profile, whose runs are given, and under each other reading; empty without reference
    /// drivers. Each is decided as the sheet's own: no perturbation alters it, and it does not rest on a driver that touches.
    pub(super) fn by_rule(
        &self,
        profile: &Profile,
        (is, touching): (&[Changed], &[ModelId]),
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
        let readings = annex::readings_where_silent(profile, &self.subject)?;
        // Another lane intrusion turns what the clause demands, and no reference driver.
        for other in readings.into_iter().filter(|other| other.profile.reg157 == profile.reg157) {
            let changed = self.perturbed(&other.profile, other.tests_once, budget)?;
            all.push(rules(Some(other.instead), &changed, &self.touching(&changed, &other.profile)?));
        }
        Ok(all)
    }
}
