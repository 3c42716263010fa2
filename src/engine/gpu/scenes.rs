//! Properties of the cases of a dispatch, found on the host: constants of its pipeline.

use crate::scene::{is_centred, is_there, may_cross};
use crate::{DeviceScene, LaneCase, LaneOther, MotionKind};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::{LATERAL_SAMPLED, Motion, SPEED_SAMPLED};

impl DeviceScene {
    /// The scene of one case; `fastest` is the highest speed of the tables, m/s.
    pub(super) fn of<R: Real>(case: &LaneCase<R>, fastest: R, dt: R) -> DeviceScene {
        let is_paired = case.pair != 0;
        let [first, second] = &case.others;
        let second = if is_paired { second } else { first };
        let both = [first, second];
        let attends = |model: usize| both.iter().all(|other| other.attend_from[model] == 0);
        DeviceScene {
            is_paired,
            is_all_paired: is_paired,
            always_there: both.iter().all(|other| is_there(other)),
            attends: std::array::from_fn(attends),
            may_cross: may_cross(case, |_| fastest, dt),
            speeds: both.map(|other| MotionKind::of_speed(&other.motion)),
            laterals: both.map(|other| MotionKind::of_lateral(other, case.ego_width)),
        }
    }

    /// What both have in common.
    pub(super) fn join(self, other: DeviceScene) -> DeviceScene {
        let joined = |a: [MotionKind; 2], b: [MotionKind; 2]| {
            let second = match (self.is_paired, other.is_paired) {
                (true, false) => a[1],
                (false, true) => b[1],
                _ => a[1].join(b[1]),
            };
            [a[0].join(b[0]), second]
        };
        DeviceScene {
            is_paired: self.is_paired | other.is_paired,
            is_all_paired: self.is_all_paired & other.is_all_paired,
            always_there: self.always_there & other.always_there,
            attends: std::array::from_fn(|model| self.attends[model] & other.attends[model]),
            may_cross: self.may_cross | other.may_cross,
            speeds: joined(self.speeds, other.speeds),
            laterals: joined(self.laterals, other.laterals),
        }
    }
}

impl MotionKind {
    fn of_speed<R: Real>(motion: &Motion<R>) -> MotionKind {
        if motion.kind & SPEED_SAMPLED == 0 { MotionKind::Analytic } else { MotionKind::Sampled }
    }

    fn of_lateral<R: Real>(other: &LaneOther<R>, ego_width: R) -> MotionKind {
        match is_centred(other, ego_width) {
            true => MotionKind::Centred,
            false if other.motion.kind & LATERAL_SAMPLED == 0 => MotionKind::Analytic,
            false => MotionKind::Sampled,
        }
    }

    fn join(self, other: MotionKind) -> MotionKind {
        use MotionKind::{Analytic, Centred, Mixed};
        match (self, other) {
            (a, b) if a == b => a,
            // A centred motion is analytic.
            (Analytic, Centred) | (Centred, Analytic) => Analytic,
            _ => Mixed,
        }
    }
}
