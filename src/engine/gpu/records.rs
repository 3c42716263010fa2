//! The records that host and device exchange, and their casts to bytes. `tests/device/shaders.rs` compares each with
//! its WGSL twin, size and offsets, through naga.

// These records may be cast to bytes, because they are `repr(C)` with 32-bit fields only and no padding (checked
// below at compile time). bytemuck's derive does not support generic types.
#![allow(unsafe_code)]

use bytemuck::{Pod, Zeroable};

use crate::{EndReason, LaneCase, LaneOther, NO_STEP, Outcome, Start, Verdicts};
use lanesweep_model::criterion::{BrakeThreatMaximum, Contact, Criteria};
use lanesweep_model::driver::MODELS;
use lanesweep_model::scalar::Flag;
use lanesweep_model::scenario::Motion;

const _: () = assert!(size_of::<Motion<f32>>() == 64);
const _: () = assert!(size_of::<LaneOther<f32>>() == 64 + 4 * (7 + MODELS));
const _: () = assert!(size_of::<LaneCase<f32>>() == 2 * size_of::<LaneOther<f32>>() + 20);

// SAFETY: `repr(C)`, fields of u32 and f32 only, no padding (asserted above), every bit pattern valid.
unsafe impl Zeroable for LaneOther<f32> {}
// SAFETY: as above.
unsafe impl Pod for LaneOther<f32> {}
// SAFETY: as above.
unsafe impl Zeroable for LaneCase<f32> {}
// SAFETY: as above.
unsafe impl Pod for LaneCase<f32> {}

/// The headway of a lane.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct StartRecord {
    /// 0: a time headway; 1: a gap; 2: the minimum following distance, which has no value.
    pub kind: u32,
    /// s or m.
    pub value: f32,
}

impl From<Start<f32>> for StartRecord {
    fn from(start: Start<f32>) -> Self {
        match start {
            Start::Headway(value) => StartRecord { kind: 0, value },
            Start::Gap(value) => StartRecord { kind: 1, value },
            Start::MinFollowing => StartRecord { kind: 2, value: 0.0 },
        }
    }
}

/// One dispatch: the lanes of one model over an interval of cases.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Launch {
    /// Lanes of this dispatch.
    pub lanes: u32,
    /// Headways per case, at least 1.
    pub headways: u32,
    /// First case in the buffer of cases.
    pub first_case: u32,
    /// From one case to the next.
    pub case_step: u32,
    /// Place of the first lane in the results of the model.
    pub first_lane: u32,
    /// Lanes of other dispatches between those of two cases.
    pub lanes_between: u32,
    /// First word of this dispatch in the verdicts.
    pub first_word: u32,
    /// First record of this dispatch in the outcomes.
    pub first_outcome: u32,
    /// Word that counts the finished lanes of this dispatch.
    pub finished_word: u32,
    /// Lanes of a workgroup, at least [`WORKGROUP`](super::shader::WORKGROUP).
    pub lanes_per_group: u32,
    /// A burst begins at this step of the longest one.
    pub burst_from: u32,
}

/// Result of a finished lane.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct OutcomeRecord {
    /// Bits 0–3 verdicts, 4–5 contact, 6 vehicle of the contact, 8–10 end.
    pub word: u32,
    /// First unsafe step.
    pub reaction_step: u32,
    /// Last evaluated step.
    pub end_step: u32,
    /// m/s; 0 without a contact.
    pub impact_speed: f32,
    /// m/s; 0 without a contact.
    pub impact_closing_speed: f32,
    /// Bits of the smallest TTC, s.
    pub min_ttc_bits: u32,
    /// Largest Brake Threat Number: numerator.
    pub btn_numerator: f32,
    /// Its denominator.
    pub btn_denominator: f32,
    /// Bits of the smallest gap, m.
    pub min_gap_bits: u32,
    /// Bits of the smallest time headway, s.
    pub min_thw_bits: u32,
    /// Bits of the largest deceleration rate to avoid the crash, m/s².
    pub max_drac_bits: u32,
    /// Time exposed TTC.
    pub tet_steps: u32,
    /// Time integrated TTC, s².
    pub tit: f32,
    /// Bits of the post-encroachment time, s; [`NO_STEP`] if there is none.
    pub pet_bits: u32,
}

impl OutcomeRecord {
    /// The outcome in lane arithmetic; `None` if no lane writes such a word.
    pub fn outcome(&self, criteria: &Criteria<f32>) -> Option<Outcome<f32>> {
        let verdicts = Verdicts((self.word & 0xf) as u8);
        let contact = match (self.word >> 4) & 3 {
            0 => Contact::None,
            1 => Contact::BySide,
            2 => Contact::Frontal,
            _ => return None,
        };
        let end = match self.word >> 8 {
            // A record that no lane wrote is 0.
            0 if contact != Contact::None => EndReason::Contact,
            1 => EndReason::Settled,
            2 => EndReason::Standstill,
            3 => EndReason::Cap,
            4 => EndReason::Aborted,
            _ => return None,
        };
        let btn = BrakeThreatMaximum::from_quotient(
            self.btn_numerator,
            self.btn_denominator,
            Flag::of(verdicts.failed(lanesweep_model::criterion::Criterion::Btn)),
        );
        Some(Outcome {
            verdicts,
            contact,
            contact_with: ((self.word >> 6) & 1) as u8,
            end,
            reaction_step: self.reaction_step,
            contact_step: if contact == Contact::None { NO_STEP } else { self.end_step },
            end_step: self.end_step,
            impact_speed: self.impact_speed,
            impact_closing_speed: self.impact_closing_speed,
            min_ttc: f32::from_bits(self.min_ttc_bits),
            max_btn: criteria.btn.value(&btn) as f32,
            min_gap: f32::from_bits(self.min_gap_bits),
            min_thw: f32::from_bits(self.min_thw_bits),
            max_drac: f32::from_bits(self.max_drac_bits),
            tet_steps: self.tet_steps,
            tit: self.tit,
            pet: (self.pet_bits != NO_STEP).then(|| f32::from_bits(self.pet_bits)),
        })
    }
}

/// One dispatch of the generator.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct Generation {
    /// First sample index, low word.
    pub index_low: u32,
    /// Its high word.
    pub index_high: u32,
    /// Samples.
    pub count: u32,
    /// Seed, low word.
    pub seed_low: u32,
    /// Its high word.
    pub seed_high: u32,
    /// Purpose of the stream.
    pub purpose: u32,
    /// Components of the mixture, or number of given points.
    pub components: u32,
    /// Offset of the first mean in the numbers.
    pub first_mean: u32,
    /// Offset of the deviations.
    pub first_deviation: u32,
    /// Entries of each sample in the table of instants.
    pub stride: u32,
}

/// What is counted of a sample besides its lanes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct DrawnRecord {
    /// Draws; more than [`ATTEMPTS`](crate::generated::ATTEMPTS) if all were invalid.
    pub tries: u32,
    /// Component of the mixture.
    pub component: u32,
}

/// One dispatch of the counting.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct Tally {
    /// Samples of the job.
    pub samples: u32,
    /// The first of them among the drawn ones.
    pub first_drawn: u32,
    /// Verdict words of each model.
    pub words: u32,
}
