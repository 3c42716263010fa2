//! Collision: the boxes overlap along and across the road. Side contacts count.

use crate::flag::Flag;
use crate::scalar::Real;

/// How two vehicles touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// They do not.
    None,
    /// Type 1: the other vehicle hits the ego from the side or behind (x_e > x_o, centres).
    BySide,
    /// Type 2: the ego's front hits the other vehicle.
    Frontal,
}

impl Contact {
    /// 0, 1 or 2, as the tables have it.
    pub fn code(self) -> u32 {
        self as u32
    }

    /// In words: the ego drives into the other one's rear end, or the other one comes from the side or behind.
    pub fn label(self) -> &'static str {
        match self {
            Contact::None => "no contact",
            Contact::BySide => "side contact",
            Contact::Frontal => "rear-end contact",
        }
    }
}

/// Do the boxes overlap at one step? Strict: h < 0 and |x_o − x_e| < (L_e + L_o)/2, with the signed gap `gap`.
#[inline(always)]
pub fn overlaps<R: Real>(gap: R, half_lengths: R, lateral_gap: R) -> Flag {
    lateral_gap.is_negative() & overlaps_along(gap, half_lengths)
}

/// The part of [`overlaps`] along the road.
#[inline(always)]
pub fn overlaps_along<R: Real>(gap: R, half_lengths: R) -> Flag {
    gap.is_negative() & (gap + half_lengths + half_lengths).is_positive()
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
