//! Collision: the boxes overlap along and across the road. Side contacts count.

use crate::scalar::{Flag, Real};

/// How two vehicles touch.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// They do not.
    #[default]
    None,
    /// Type 1: the other vehicle hits the ego from the side or behind (x_e > x_o, centres).
    BySide,
    /// Type 2: the ego's front hits the other vehicle.
    Frontal,
}

impl Contact {
    /// Code in the tables: 0, 1 or 2.
    pub fn code(self) -> u32 {
        self as u32
    }

    /// Description: the ego drives into the rear of the other vehicle, or the other vehicle comes from the side or
    /// behind.
    pub fn label(self) -> &'static str {
        match self {
            Contact::None => "no contact",
            Contact::BySide => "side contact",
            Contact::Frontal => "rear-end contact",
        }
    }
}

/// Whether the boxes overlap at one step. Strict: h < 0 and |x_o − x_e| < (L_e + L_o)/2, with the signed gap `gap`.
#[inline(always)]
fn overlaps<R: Real>(gap: R, half_lengths: R, lateral_gap: R) -> Flag {
    lateral_gap.is_negative() & overlaps_along(gap, half_lengths)
}

/// The longitudinal part of `overlaps`.
#[inline(always)]
pub fn overlaps_along<R: Real>(gap: R, half_lengths: R) -> Flag {
    gap.is_negative() & (gap + half_lengths + half_lengths).is_positive()
}

/// Gap after a step, m, for vehicles that overlap laterally at its end, from the gaps before and after the step.
///
/// Where the step moves one centre past the other, the contact is kept. If the other vehicle was wholly ahead before,
/// the result has the centres side by side. If it was wholly behind, the result has its centre `half_lengths/2` behind
/// the ego's. Otherwise it is `after`.
#[inline(always)]
pub fn held_in_contact<R: Real>(before: R, after: R, half_lengths: R) -> R {
    let was_behind = !(before + half_lengths + half_lengths).is_positive();
    let passes = !(after + half_lengths).is_negative();
    let from_behind = (was_behind & passes).choose(-(half_lengths * R::from_f64(1.5)), after);
    before.is_negative().choose(from_behind, after.larger(-half_lengths))
}

/// Contact at one step.
#[inline(always)]
pub fn contact<R: Real>(gap: R, half_lengths: R, lateral_gap: R) -> Contact {
    if !overlaps(gap, half_lengths, lateral_gap).holds() {
        Contact::None
    } else if (gap + half_lengths).is_negative().holds() {
        Contact::BySide
    } else {
        Contact::Frontal
    }
}
