//! The truth value of the lane arithmetic: the sign bit of a word.
//!
//! A step of a lane has no branches, so that it can run for many lanes side by side. Its comparisons end in sign
//! bits and are combined by the vector units' plain word operations; as `bool`s, a compiler would keep them in
//! AVX-512's mask registers, whose operations are a quarter to a half as fast on Zen 5. Comparisons:
//! [`Real`](crate::model::scalar::Real).

use std::ops::{BitAnd, BitOr, Not};

/// True or false. Unlike `bool`, both sides of `&` and `|` are always worked out.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub struct Flag(i32);

impl Flag {
    /// Holds.
    pub const TRUE: Flag = Flag(-1);
    /// Does not hold.
    pub const FALSE: Flag = Flag(0);
    /// Largest step that [`Flag::reached`] knows; beyond every lane's cap.
    pub const LATEST_STEP: u32 = i32::MAX as u32;

    /// From a `bool`.
    #[inline(always)]
    pub fn of(holds: bool) -> Flag {
        Flag(-i32::from(holds))
    }

    /// The sign bit of these bits.
    #[inline(always)]
    pub(crate) fn from_bits(bits: u32) -> Flag {
        Flag(bits as i32)
    }

    /// A word whose sign bit it is.
    #[inline(always)]
    pub(crate) fn to_bits(self) -> u32 {
        self.0 as u32
    }

    /// `index >= step`; both at most [`Flag::LATEST_STEP`].
    #[inline(always)]
    pub fn reached(index: u32, step: u32) -> Flag {
        !Flag((index as i32).wrapping_sub(step as i32))
    }

    /// As a `bool`.
    #[inline(always)]
    pub fn holds(self) -> bool {
        self.0 < 0
    }

    /// Selects one of two values, both already computed.
    #[inline(always)]
    pub fn choose<T>(self, where_it_holds: T, otherwise: T) -> T {
        if self.holds() { where_it_holds } else { otherwise }
    }

    /// 1 where it holds, else 0.
    #[inline(always)]
    pub fn one(self) -> u32 {
        self.0 as u32 >> 31
    }
}

impl PartialEq for Flag {
    fn eq(&self, other: &Flag) -> bool {
        self.holds() == other.holds()
    }
}

impl BitAnd for Flag {
    type Output = Flag;
    #[inline(always)]
    fn bitand(self, other: Flag) -> Flag {
        Flag(self.0 & other.0)
    }
}

impl BitOr for Flag {
    type Output = Flag;
    #[inline(always)]
    fn bitor(self, other: Flag) -> Flag {
        Flag(self.0 | other.0)
    }
}

impl Not for Flag {
    type Output = Flag;
    #[inline(always)]
    fn not(self) -> Flag {
        Flag(!self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_combine_as_truth_values_do() {
        for a in [false, true] {
            assert_eq!((!Flag::of(a)).holds(), !a);
            assert_eq!(Flag::of(a).choose(1, 2), if a { 1 } else { 2 });
            assert_eq!(Flag::of(a).one(), u32::from(a));
            for b in [false, true] {
                assert_eq!((Flag::of(a) & Flag::of(b)).holds(), a && b);
                assert_eq!((Flag::of(a) | Flag::of(b)).holds(), a || b);
            }
        }
    }

    #[test]
    fn a_step_is_reached_from_itself_on() {
        for step in [0, 1, 7, Flag::LATEST_STEP] {
            for index in [0, 1, 6, 7, 8, 1 << 24] {
                assert_eq!(Flag::reached(index, step).holds(), index >= step, "{index} {step}");
            }
        }
    }
}
