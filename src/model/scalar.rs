//! The number type of a lane: f64 (the reference) and f32 (the lane arithmetic of every backend).
//!
//! Lane arithmetic: IEEE binary, round to nearest even, in the written order; no fused multiply-add, no root, no
//! transcendental function. Its only division is [`Real::exact_div`], which every backend rounds correctly.
//!
//! Comparisons are sign bits ([`Flag`]) of numbers that are finite and not -0. Rounding an input turns -0 into 0, and
//! no sum, difference or magnitude of such numbers is -0. A product or a negated number may be -0, and is compared only
//! where another condition excludes it.
//!
//! [`Flag`] is the truth value of the lane arithmetic: the sign bit of a word. A step of a lane has no branches, so
//! that many lanes can run side by side. Flags are combined by the vector units' plain word operations. As `bool`s, a
//! compiler would keep them in AVX-512's mask registers, whose operations have a quarter to half of the throughput on
//! Zen 5.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

/// A scalar of the lane arithmetic. Models, criteria and the frame are written once over this trait.
pub trait Real:
    Copy
    + Default
    + PartialOrd
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// ½.
    const HALF: Self;
    /// +∞: "did not happen" for a minimum, "cannot be avoided" for a Brake Threat Number.
    const INFINITY: Self;

    /// Rounds an input once; -0 becomes 0.
    fn from_f64(value: f64) -> Self;
    /// Exact widening for reports.
    fn to_f64(self) -> f64;
    /// A step index as a number; exact below 2²⁴.
    fn from_step(step: u32) -> Self;
    /// Correctly rounded quotient: the only division of the lane arithmetic.
    fn exact_div(self, divisor: Self) -> Self;
    /// Number of whole steps below a number in [0, 2²⁴): exact.
    fn floor_to_step(self) -> u32;

    /// x < 0.
    fn is_negative(self) -> Flag;

    /// x > 0.
    fn is_positive(self) -> Flag;

    /// Less than another number.
    fn is_below(self, other: Self) -> Flag;

    /// Greater than another number.
    #[inline(always)]
    fn is_above(self, other: Self) -> Flag {
        other.is_below(self)
    }

    /// Not less than another number.
    #[inline(always)]
    fn is_at_least(self, other: Self) -> Flag {
        !self.is_below(other)
    }

    /// Not greater than another number.
    #[inline(always)]
    fn is_at_most(self, other: Self) -> Flag {
        !other.is_below(self)
    }

    /// Magnitude.
    #[inline(always)]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }

    /// The larger value; the second if they are equal.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// The smaller value; the second if they are equal.
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

macro_rules! real_float {
    ($float:ty, $negative:expr, $positive:expr, $below:expr) => {
        impl Real for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const HALF: Self = 0.5;
            const INFINITY: Self = <$float>::INFINITY;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                // -0 + 0 is 0.
                value as $float + 0.0
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self.into()
            }
            #[inline(always)]
            fn from_step(step: u32) -> Self {
                step as $float
            }
            #[inline(always)]
            fn exact_div(self, divisor: Self) -> Self {
                self / divisor
            }
            #[inline(always)]
            fn floor_to_step(self) -> u32 {
                self as u32
            }
            #[inline(always)]
            fn is_negative(self) -> Flag {
                $negative(self)
            }
            #[inline(always)]
            fn is_positive(self) -> Flag {
                $positive(self)
            }
            #[inline(always)]
            fn is_below(self, other: Self) -> Flag {
                $below(self, other)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$float>::abs(self)
            }
        }
    };
}
real_float!(
    f32,
    |x: f32| Flag::from_bits(x.to_bits()),
    // The bits of positive floats compare like integers: negating them as integers sets the sign bit where the value is
    // above 0.
    |x: f32| Flag::from_bits(0_u32.wrapping_sub(x.to_bits())),
    // The difference is negative exactly where the first is less.
    |a: f32, b: f32| Flag::from_bits((a - b).to_bits())
);
real_float!(f64, |x| Flag::of(x < 0.0), |x| Flag::of(x > 0.0), |a, b| Flag::of(a < b));

/// True or false. Unlike with `bool`, both sides of `&` and `|` are always evaluated.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub struct Flag(i32);

impl Flag {
    /// True.
    pub const TRUE: Flag = Flag(-1);
    /// False.
    pub const FALSE: Flag = Flag(0);
    /// Largest step that [`Flag::reached`] accepts; above every lane's cap.
    pub const LATEST_STEP: u32 = i32::MAX as u32;

    /// From a `bool`.
    #[inline(always)]
    pub fn of(holds: bool) -> Flag {
        Flag(-i32::from(holds))
    }

    /// From the sign bit of a word.
    #[inline(always)]
    pub fn from_bits(bits: u32) -> Flag {
        Flag(bits as i32)
    }

    /// A word whose sign bit is the flag.
    #[inline(always)]
    pub fn to_bits(self) -> u32 {
        self.0 as u32
    }

    /// `index >= step`; both at most [`Flag::LATEST_STEP`].
    #[inline(always)]
    pub fn reached(index: u32, step: u32) -> Flag {
        !Flag((index as i32).wrapping_sub(step as i32))
    }

    /// Converts to `bool`.
    #[inline(always)]
    pub fn holds(self) -> bool {
        self.0 < 0
    }

    /// Selects one of two values, both already computed.
    #[inline(always)]
    pub fn choose<T>(self, where_it_holds: T, otherwise: T) -> T {
        if self.holds() { where_it_holds } else { otherwise }
    }

    /// 1 if true, else 0.
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
    fn inputs_are_never_minus_zero() {
        for input in [-0.0, -1e-60, 0.0] {
            assert_eq!(f32::from_f64(input).to_bits(), 0, "{input}");
        }
        assert_eq!(f64::from_f64(-0.0).to_bits(), 0);
    }

    #[test]
    fn comparisons_that_end_in_a_flag_are_those_of_the_standard() {
        let tiny = f32::from_bits(1);
        let numbers = [-1e6, -2.5, -tiny, 0.0, tiny, 1e-20, 0.3, 2.5, f32::from_bits(0x4020_0001), 1e6, f32::INFINITY];
        for a in numbers {
            assert_eq!(a.is_negative().holds(), a < 0.0, "{a}");
            assert_eq!(a.is_positive().holds(), a > 0.0, "{a}");
            for b in numbers.into_iter().filter(|b| a.is_finite() || b.is_finite()) {
                assert_eq!(a.is_below(b).holds(), a < b, "{a} {b}");
                assert_eq!(a.is_above(b).holds(), a > b, "{a} {b}");
                assert_eq!(a.is_at_least(b).holds(), a >= b, "{a} {b}");
                assert_eq!(a.is_at_most(b).holds(), a <= b, "{a} {b}");
                assert_eq!(f64::from(a).is_below(f64::from(b)).holds(), a < b, "{a} {b}");
            }
        }
    }

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
