//! The results of a finished lane.

use lanesweep_model::criterion::{Contact, Criterion};
use lanesweep_model::scalar::Real;

/// "Did not happen" as a step index.
pub const NO_STEP: u32 = u32::MAX;

/// Verdict bits of a lane: bit [`Criterion::index`] is set if the criterion failed, [`Verdicts::CAPPED`] if the lane
/// reached the time cap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[repr(transparent)]
pub struct Verdicts(pub u8);

impl Verdicts {
    /// The lane ended at the time cap.
    pub const CAPPED: u8 = 1 << 3;

    /// Whether this criterion failed.
    pub fn failed(self, criterion: Criterion) -> bool {
        self.0 & (1 << criterion.index()) != 0
    }

    /// Whether the lane ended at the time cap.
    pub fn capped(self) -> bool {
        self.0 & Verdicts::CAPPED != 0
    }
}

/// Why a lane ended.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// The vehicles touched.
    Contact,
    /// The ego is not faster than any vehicle ahead in its lane, or all vehicles are behind.
    Settled,
    /// The ego stands.
    Standstill,
    /// The time cap.
    #[default]
    Cap,
    /// The JRC's rule for CCHDM: lateral overlap at a large TTC.
    Aborted,
}

/// Outcome of one lane in its own arithmetic; times are step indices.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Outcome<R> {
    /// Verdicts.
    pub verdicts: Verdicts,
    /// Kind of contact.
    pub contact: Contact,
    /// Vehicle of the contact: 0 principal, 1 the one ahead.
    pub contact_with: u8,
    /// Why it ended.
    pub end: EndReason,
    /// First unsafe step, or [`NO_STEP`].
    pub reaction_step: u32,
    /// Step of the contact, or [`NO_STEP`].
    pub contact_step: u32,
    /// Last evaluated step.
    pub end_step: u32,
    /// Speed of the ego at the contact, m/s; 0 without a contact.
    pub impact_speed: R,
    /// Closing speed at the contact, m/s; 0 without a contact.
    pub impact_closing_speed: R,
    /// Minimum TTC, s, ≥ 0; infinite if the ego never closed in.
    pub min_ttc: R,
    /// Maximum BTN, ≥ 0; infinite if no braking helped.
    pub max_btn: R,
    /// Minimum gap to a vehicle that TTC and BTN evaluate, m; infinite if there was none.
    pub min_gap: R,
    /// Minimum time headway, s, ≥ 0; infinite if no vehicle was evaluated while the ego moved.
    pub min_thw: R,
    /// Maximum deceleration rate to avoid the crash, m/s², ≥ 0; infinite at contact.
    pub max_drac: R,
    /// Time exposed TTC, in steps.
    pub tet_steps: u32,
    /// Time integrated TTC, s², ≥ 0.
    pub tit: R,
    /// Post-encroachment time of a cut-in, s, ≥ 0; infinite if the ego stops before the place of encroachment, `None` if
    /// there is none.
    pub pet: Option<R>,
}

impl<R: Real> Outcome<R> {
    /// Minimum TTC for reports: `None` for a contact without an approach along one path, such as a side contact. There
    /// infinity would read as "never near".
    pub fn approach_ttc(&self) -> Option<R> {
        let is_beside = self.contact != Contact::None && !self.min_ttc.to_f64().is_finite();
        (!is_beside).then_some(self.min_ttc)
    }

    /// The same in f64; exact.
    pub fn widen(&self) -> Outcome<f64> {
        Outcome {
            verdicts: self.verdicts,
            contact: self.contact,
            contact_with: self.contact_with,
            end: self.end,
            reaction_step: self.reaction_step,
            contact_step: self.contact_step,
            end_step: self.end_step,
            impact_speed: self.impact_speed.to_f64(),
            impact_closing_speed: self.impact_closing_speed.to_f64(),
            min_ttc: self.min_ttc.to_f64(),
            max_btn: self.max_btn.to_f64(),
            min_gap: self.min_gap.to_f64(),
            min_thw: self.min_thw.to_f64(),
            max_drac: self.max_drac.to_f64(),
            tet_steps: self.tet_steps,
            tit: self.tit.to_f64(),
            pet: self.pet.map(R::to_f64),
        }
    }
}
