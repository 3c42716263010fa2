//! The answer of a check, derived from the collisions of the drivers and of an ego that never reacts.

use super::REFERENCE_DRIVERS;
use crate::model::driver::{MODELS, ModelId};

/// The answer to one case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// A collision threatens, and a driver of Annex 3 avoids it.
    Preventable,
    /// A collision threatens, and both drivers of Annex 3 collide.
    NotPreventable,
    /// No collision occurs even if the ego never reacts.
    NoConflict,
}

impl Answer {
    /// The words of sheets and maps.
    pub fn label(self) -> &'static str {
        match self {
            Answer::Preventable => "preventable",
            Answer::NotPreventable => "not preventable",
            Answer::NoConflict => "no conflict",
        }
    }
}

/// The answer together with its robustness.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No perturbation changes the answer.
    Answer(Answer),
    /// A perturbation changes it.
    Undecided,
    /// Annex 3 does not describe the case, so its drivers do not determine what is preventable.
    OutsideAnnex,
}

impl Verdict {
    /// The word that leads a sheet, and the value in files.
    pub fn label(self) -> &'static str {
        match self {
            Verdict::Answer(answer) => answer.label(),
            Verdict::Undecided => "undecided",
            Verdict::OutsideAnnex => "outside Annex 3",
        }
    }
}

/// Collisions of one case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CaseVerdicts {
    /// Each driver, in the order of [`ModelId::ALL`].
    pub collide: [bool; MODELS],
    /// The ego that never reacts.
    pub conflict: bool,
    /// Annex 3 does not describe the case.
    pub is_outside_annex: bool,
}

impl CaseVerdicts {
    /// Whether a driver collides.
    pub fn collides(&self, model: ModelId) -> bool {
        ModelId::ALL.into_iter().zip(self.collide).any(|(m, collides)| m == model && collides)
    }

    /// Drivers of Annex 3 that do not collide.
    pub fn avoided_by(&self) -> Vec<ModelId> {
        REFERENCE_DRIVERS.into_iter().filter(|model| !self.collides(*model)).collect()
    }

    /// The answer if Annex 3 describes the case. An answer of no conflict does not need Annex 3.
    pub fn verdict(&self) -> Verdict {
        match self.answer() {
            Answer::NoConflict => Verdict::Answer(Answer::NoConflict),
            _ if self.is_outside_annex => Verdict::OutsideAnnex,
            answer => Verdict::Answer(answer),
        }
    }

    /// The answer that follows from the collisions.
    pub fn answer(&self) -> Answer {
        match (self.conflict, self.avoided_by().is_empty()) {
            (false, _) => Answer::NoConflict,
            (true, false) => Answer::Preventable,
            (true, true) => Answer::NotPreventable,
        }
    }
}
