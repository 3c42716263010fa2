//! The answer of a check, derived from the ends of the runs of the drivers and of an ego that never reacts.

use super::subject::LaneRun;
use lanesweep_engine::EndReason;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::{MODELS, ModelId};

/// The answer to one case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// A collision threatens, and a reference driver avoids it.
    Preventable,
    /// A collision threatens, and all reference drivers collide.
    NotPreventable,
    /// No collision occurs even if the ego never reacts.
    NoConflict,
    /// The run of an ego that never reacts ends at the time cap while the gap still closes.
    Open,
}

impl Answer {
    /// The words of sheets and maps.
    pub fn label(self) -> &'static str {
        match self {
            Answer::Preventable => "preventable",
            Answer::NotPreventable => "not preventable",
            Answer::NoConflict => "no conflict",
            Answer::Open => "undecided",
        }
    }
}

/// The answer together with its robustness.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No perturbation changes the answer.
    Answer(Answer),
    /// A perturbation changes it, it rests on a gap that the time step does not resolve, or the runs end before it.
    Undecided,
    /// Annex 3 does not describe the case, so its drivers do not determine what is preventable.
    OutsideAnnex,
    /// The profile has no reference drivers.
    NotJudged,
}

impl Verdict {
    /// The word that leads a sheet, and the value in files.
    pub fn label(self) -> &'static str {
        match self {
            Verdict::Answer(answer) => answer.label(),
            Verdict::Undecided => Answer::Open.label(),
            Verdict::OutsideAnnex => "outside Annex 3",
            Verdict::NotJudged => "not judged",
        }
    }
}

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
    pub(super) fn of(references: &[ModelId]) -> Vec<DriverRule> {
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
    fn holds(self, references: &[ModelId], avoids: impl Fn(ModelId) -> bool) -> bool {
        match self {
            DriverRule::Alone(model) => avoids(model),
            DriverRule::Any => references.iter().any(|model| avoids(*model)),
            DriverRule::All => references.iter().all(|model| avoids(*model)),
        }
    }
}

/// How a run ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunEnd {
    /// The vehicles touch.
    Contact,
    /// No contact is possible any more.
    Clear,
    /// The time cap, while the gap still closes.
    Open,
}

impl RunEnd {
    pub(super) fn of(run: &LaneRun) -> RunEnd {
        match run.outcome.end {
            _ if run.outcome.verdicts.failed(Criterion::Collision) => RunEnd::Contact,
            EndReason::Cap if run.still_closes => RunEnd::Open,
            _ => RunEnd::Clear,
        }
    }
}

/// The ends of the runs of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseVerdicts {
    /// Whether each driver collides, in the order of [`ModelId::ALL`].
    pub collide: [bool; MODELS],
    /// Minimum gap of each to a vehicle in its path, m; infinite without one.
    pub min_gap_m: [f64; MODELS],
    /// The ego that never reacts. A driver that reacts brakes again where a gap closes for long, so that only this run
    /// can be open.
    pub unreacting: RunEnd,
    /// Annex 3 does not describe the case.
    pub is_outside_annex: bool,
    /// The drivers that determine what is preventable.
    pub reference_drivers: Vec<ModelId>,
}

impl CaseVerdicts {
    /// Whether a driver collides.
    pub fn collides(&self, model: ModelId) -> bool {
        self.collide[model.index()]
    }

    fn references(&self, collide: bool) -> Vec<ModelId> {
        self.reference_drivers.iter().copied().filter(|model| self.collides(*model) == collide).collect()
    }

    /// Reference drivers that avoid the collision.
    pub fn avoided_by(&self) -> Vec<ModelId> {
        self.references(false)
    }

    /// Reference drivers that collide.
    pub fn collided_by(&self) -> Vec<ModelId> {
        self.references(true)
    }

    /// The answer if Annex 3 describes the case. An answer of no conflict does not need Annex 3.
    pub fn verdict(&self) -> Verdict {
        self.verdict_by(DriverRule::Any)
    }

    /// The same by another rule.
    pub(super) fn verdict_by(&self, rule: DriverRule) -> Verdict {
        match self.answer_by(rule) {
            _ if self.reference_drivers.is_empty() => Verdict::NotJudged,
            Answer::NoConflict => Verdict::Answer(Answer::NoConflict),
            _ if self.is_outside_annex => Verdict::OutsideAnnex,
            Answer::Open => Verdict::Undecided,
            answer => Verdict::Answer(answer),
        }
    }

    /// The answer for comparisons with a perturbed case: a gap that closes for longer than a run is no other answer than
    /// one that does not close.
    pub(super) fn answer_within_the_cap(&self, rule: DriverRule) -> Answer {
        match self.answer_by(rule) {
            Answer::Open => Answer::NoConflict,
            answer => answer,
        }
    }

    /// The answer that follows from the ends.
    pub fn answer(&self) -> Answer {
        self.answer_by(DriverRule::Any)
    }

    fn answer_by(&self, rule: DriverRule) -> Answer {
        match self.unreacting {
            RunEnd::Clear => Answer::NoConflict,
            RunEnd::Open => Answer::Open,
            RunEnd::Contact if rule.holds(&self.reference_drivers, |model| !self.collides(model)) => {
                Answer::Preventable
            }
            RunEnd::Contact => Answer::NotPreventable,
        }
    }

    /// Whether the answer is preventable only if drivers that touch avoid the collision.
    pub(super) fn rests_on(&self, touching: &[ModelId], rule: DriverRule) -> bool {
        let avoids_clearly = |model: ModelId| !self.collides(model) && !touching.contains(&model);
        self.answer_by(rule) == Answer::Preventable && !rule.holds(&self.reference_drivers, avoids_clearly)
    }
}

/// The verdict of a case whose answer is robust or not. What Annex 3 does not describe has no answer to be robust.
pub(super) fn settled(verdict: Verdict, is_robust: bool) -> Verdict {
    match verdict {
        Verdict::Answer(_) if !is_robust => Verdict::Undecided,
        verdict => verdict,
    }
}
