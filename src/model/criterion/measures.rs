//! Surrogate measures of safety: values of a lane without a verdict. Smallest time headway (THW), largest deceleration
//! rate to avoid the crash (DRAC), time exposed TTC (TET), time integrated TTC (TIT), post-encroachment time of a cut-in
//! (PET). Definitions and sources: docs/src/methods/criteria.md.

use super::ttc::TtcMinimum;
use crate::scalar::{Flag, Real};

/// Measures over the steps so far. Extreme quotients are kept as numerator and denominator, so that a step divides only
/// for the TIT.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measures<R> {
    /// Gap of the smallest THW, m, ≥ 0.
    pub thw_gap: R,
    /// Speed of the ego of the smallest THW, m/s; 0 before the first value.
    pub thw_speed: R,
    /// Numerator of the largest DRAC, m²/s²: the closing speed squared.
    pub drac_numerator: R,
    /// Its denominator, m: twice the gap; 0 at contact.
    pub drac_denominator: R,
    /// TET: steps whose TTC is below the threshold.
    pub tet_steps: u32,
    /// TIT over the time step, s: sum of threshold − TTC over these steps.
    pub tit_sum: R,
    /// The principal vehicle has overlapped the ego's path.
    pub pet_begun: Flag,
    /// PET: distance from the ego's front to the place of encroachment, m.
    pub pet_distance: R,
    /// Speed of the ego in the last step towards it, m/s; negative if there is no such place.
    pub pet_speed: R,
    /// Steps made towards it.
    pub pet_steps: u32,
}

impl<R: Real> Measures<R> {
    /// Initial values: infinite THW, no PET, 0 otherwise.
    #[inline(always)]
    pub fn start() -> Self {
        Measures {
            thw_gap: R::ONE,
            thw_speed: R::ZERO,
            drac_numerator: R::ZERO,
            drac_denominator: R::ONE,
            tet_steps: 0,
            tit_sum: R::ZERO,
            pet_begun: Flag::FALSE,
            pet_distance: R::ZERO,
            pet_speed: -R::ONE,
            pet_steps: 0,
        }
    }

    /// Takes one step of a vehicle that is `seen` into account: THW and DRAC.
    #[inline(always)]
    pub fn update(self, seen: Flag, v_ego: R, gap: R, closing: R) -> Self {
        let room = gap.larger(R::ZERO);
        let is_nearer = seen & v_ego.is_positive() & (room * self.thw_speed).is_below(self.thw_gap * v_ego);
        let (numerator, denominator) = (closing * closing, room + room);
        let higher = (numerator * self.drac_denominator).is_above(self.drac_numerator * denominator);
        let is_higher = seen & closing.is_positive() & higher;
        Measures {
            thw_gap: is_nearer.choose(room, self.thw_gap),
            thw_speed: is_nearer.choose(v_ego, self.thw_speed),
            drac_numerator: is_higher.choose(numerator, self.drac_numerator),
            drac_denominator: is_higher.choose(denominator, self.drac_denominator),
            ..self
        }
    }

    /// Takes the smallest TTC of one step into account, which is infinite if no vehicle was approached: TET and TIT.
    #[inline(always)]
    pub fn expose(self, nearest: &TtcMinimum<R>, threshold: R) -> Self {
        let approaches = nearest.closing.is_positive();
        let ttc = nearest.gap.exact_div(approaches.choose(nearest.closing, R::ONE));
        let is_exposed = approaches & ttc.is_below(threshold);
        Measures {
            tet_steps: self.tet_steps + is_exposed.one(),
            tit_sum: self.tit_sum + is_exposed.choose(threshold - ttc, R::ZERO),
            ..self
        }
    }

    /// Takes one step into account for the PET. `overlaps`: the principal vehicle overlaps the ego's path, and the lane
    /// is not over. `is_ahead`: if that begins now, its rear bumper is the place of encroachment. `way`: of the ego in
    /// this step, m.
    #[inline(always)]
    pub fn encroach(self, runs: Flag, overlaps: Flag, is_ahead: Flag, gap: R, v_ego: R, way: R) -> Self {
        let begins = overlaps & is_ahead & !self.pet_begun;
        let approaches = runs & self.pet_distance.is_positive();
        let left = approaches.choose(self.pet_distance - way, self.pet_distance);
        Measures {
            pet_begun: self.pet_begun | overlaps,
            pet_distance: begins.choose(gap, left),
            pet_speed: (begins | approaches).choose(v_ego, self.pet_speed),
            pet_steps: self.pet_steps + approaches.one(),
            ..self
        }
    }

    /// Smallest THW, s; infinite if the ego stood whenever a vehicle was seen.
    pub fn min_thw(&self) -> R {
        if self.thw_speed > R::ZERO { self.thw_gap.exact_div(self.thw_speed) } else { R::INFINITY }
    }

    /// Largest DRAC, m/s²; 0 if the ego never closed in, infinite at contact.
    pub fn max_drac(&self) -> R {
        let has_room = self.drac_denominator > R::ZERO;
        if has_room { self.drac_numerator.exact_div(self.drac_denominator) } else { R::INFINITY }
    }

    /// PET, s, ≥ 0; infinite if the ego stops before the place, `None` if there is none.
    pub fn pet(&self, dt: R) -> Option<R> {
        let driven = R::from_step(self.pet_steps) * dt;
        if self.pet_speed < R::ZERO {
            None
        } else if self.pet_speed > R::ZERO {
            // Negative past the place: less than one step, but for rounding.
            Some((driven + self.pet_distance.exact_div(self.pet_speed)).larger(R::ZERO))
        } else if self.pet_distance > R::ZERO {
            Some(R::INFINITY)
        } else {
            Some(driven)
        }
    }
}
