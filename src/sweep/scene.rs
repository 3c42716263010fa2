//! What is known of the vehicles around the ego before a lane runs, so that its steps need not ask.

use crate::scalar::Real;
use crate::scenario::LATERAL_SAMPLED;

use super::lane_case::{LaneCase, NEVER};

/// What all lanes of a stream have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scene {
    /// Two other vehicles are looked at.
    pub is_pair: bool,
    /// The principal vehicle is there from the first step to the last, and judged.
    pub always_there: bool,
    /// It also stays in the middle of the ego's lane, and the driver attends to it from the first step on.
    pub in_lane: bool,
}

impl Scene {
    /// One or two other vehicles of which nothing is known.
    pub fn unknown(is_pair: bool) -> Scene {
        Scene { is_pair, always_there: false, in_lane: false }
    }

    /// What holds for all of these cases under a model. Where one vehicle comes or goes, there is a second one as
    /// well, if one that is never there.
    pub fn of<R: Real>(cases: &[LaneCase<R>], model_index: usize) -> Scene {
        let always_there = cases.iter().all(is_always_there);
        let in_lane = always_there && cases.iter().all(|case| is_in_lane(case, model_index));
        Scene { is_pair: !always_there, always_there, in_lane }
    }
}

/// One other vehicle, and it neither comes nor goes.
fn is_always_there<R: Real>(case: &LaneCase<R>) -> bool {
    let other = &case.others[0];
    case.pair == 0 && other.used != 0 && other.judged != 0 && other.present_from == 0 && other.present_until == NEVER
}

/// The same, in the middle of the ego's lane from the first step to the last.
fn is_in_lane<R: Real>(case: &LaneCase<R>, model_index: usize) -> bool {
    let (other, motion) = (&case.others[0], &case.others[0].motion);
    let positions = [motion.lateral_initial, motion.lateral_per_step, motion.lateral_end, motion.lateral_towards];
    let is_centred = motion.kind & LATERAL_SAMPLED == 0 && positions.iter().all(|&number| number == R::ZERO);
    let has_widths = other.half_widths > R::ZERO && case.ego_width > R::ZERO;
    is_centred && has_widths && other.attend_from[model_index] == 0
}
