//! Collision: the boxes overlap along and across the road. Side contacts count.

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
}

/// Contact at one step, strict: h < 0 and |x_o − x_e| < (L_e + L_o)/2, with the signed gap `gap`.
#[inline(always)]
pub fn contact<R: Real>(gap: R, half_lengths: R, lateral_gap: R) -> Contact {
    let overlap_along = gap < R::ZERO && gap + half_lengths + half_lengths > R::ZERO;
    if lateral_gap < R::ZERO && overlap_along {
        if gap + half_lengths < R::ZERO { Contact::BySide } else { Contact::Frontal }
    } else {
        Contact::None
    }
}
