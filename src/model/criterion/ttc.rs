//! Time to collision: gap over closing speed, 0 at contact.

use crate::scalar::{Flag, Real};

/// The threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeToCollision<R> {
    /// A TTC below this fails, s.
    pub threshold: R,
}

/// Minimum TTC so far, kept as a quotient so that a step never divides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TtcMinimum<R> {
    /// Gap of the quotient, m, ≥ 0.
    pub gap: R,
    /// Closing speed of the quotient, m/s; 0 before the first value.
    pub closing: R,
    /// The predicate was true at some step.
    pub failed: Flag,
}

impl<R: Real> TtcMinimum<R> {
    /// Initial value: infinite.
    #[inline(always)]
    pub fn start() -> Self {
        TtcMinimum { gap: R::ONE, closing: R::ZERO, failed: Flag::FALSE }
    }

    /// The value, s, ≥ 0; infinite where the ego never closed in.
    #[inline(always)]
    pub fn value(&self) -> R {
        if self.closing > R::ZERO { self.gap.exact_div(self.closing) } else { R::INFINITY }
    }
}

impl<R: Real> TimeToCollision<R> {
    /// Gap, m, above which the criterion never fails at this closing speed (m/s, > 0), except for rounding.
    pub fn safe_gap(&self, closing: R) -> R {
        self.threshold * closing
    }

    /// Updates the minimum with one step of a vehicle that is `seen`: fails iff max(g, 0) < threshold·dv, dv > 0.
    /// Without `keeps_value` only the verdict is updated.
    #[inline(always)]
    pub fn update(&self, minimum: TtcMinimum<R>, seen: Flag, gap: R, closing: R, keeps_value: bool) -> TtcMinimum<R> {
        let gap = gap.larger(R::ZERO);
        let counts = seen & closing.is_positive();
        let failed = minimum.failed | (counts & gap.is_below(self.threshold * closing));
        if !keeps_value {
            return TtcMinimum { failed, ..minimum };
        }
        let smaller = counts & (gap * minimum.closing).is_below(minimum.gap * closing);
        TtcMinimum { gap: smaller.choose(gap, minimum.gap), closing: smaller.choose(closing, minimum.closing), failed }
    }
}
