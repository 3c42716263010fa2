//! Properties of the other vehicles that are known before a lane runs, so that its steps need not test them.

use lanesweep_model::driver::MODELS;
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::{LATERAL_SAMPLED, Motion, SPEED_SAMPLED, Tables};

use super::lane_case::{LaneCase, LaneOther, NEVER};

/// Properties that all lanes of a stream share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Scene {
    /// Two other vehicles are evaluated.
    pub is_pair: bool,
    /// The principal vehicle is present from the first step to the last, and evaluated by the criteria.
    pub always_there: bool,
    /// It also stays in the middle of the ego's lane, and the driver attends to it from the first step on.
    pub in_lane: bool,
    /// No contact and no criterion is possible, and the driver follows in steady state.
    pub is_steady: bool,
    /// A step may move a vehicle's centre past the ego's, so contacts between two steps are tested.
    pub may_cross: bool,
}

impl Scene {
    /// One or two other vehicles without common properties.
    pub(super) fn unknown(is_pair: bool) -> Scene {
        Scene { is_pair, always_there: false, in_lane: false, is_steady: false, may_cross: true }
    }

    /// One other vehicle, in the ego's lane from the first step to the last.
    pub(super) const fn in_lane() -> Scene {
        Scene { is_pair: false, always_there: true, in_lane: true, is_steady: false, may_cross: false }
    }

    /// Common properties of these cases under a model. If a vehicle appears or leaves, the scene counts as a pair, even
    /// if the second vehicle is never present. Lanes that may cross have no further properties, because such time steps
    /// are rare.
    pub(super) fn of<R: Real>(cases: &[LaneCase<R>], model_index: usize, may_cross: bool) -> Scene {
        if may_cross {
            return Scene::unknown(true);
        }
        let always_there = cases.iter().all(is_always_there);
        let in_lane = always_there && cases.iter().all(|case| is_in_lane(case, model_index));
        Scene { is_pair: !always_there, always_there, in_lane, is_steady: false, may_cross: false }
    }

    /// Properties of lanes of these cases once only their second vehicles matter (`cpu/lead_only.rs`).
    /// These are present, evaluated and attended to.
    pub(super) fn of_lead_only<R: Real>(cases: &[LaneCase<R>]) -> Scene {
        let in_lane = cases.iter().all(|case| case.pair == 0 || is_centred(&case.others[1], case.ego_width));
        Scene { is_pair: false, always_there: true, in_lane, is_steady: false, may_cross: false }
    }
}

/// What is known of the motions of a vehicle. The numbers are those of `shaders/shared/motion.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum MotionKind {
    /// Given by a few numbers.
    Analytic,
    /// Entries of a table.
    Sampled,
    /// Some of each.
    Mixed,
    /// Lateral motion: in the middle of the ego's lane, always.
    Centred,
    /// A sample's speed: half a cosine between two speeds. A device evaluates it; the CPU has a table.
    Sinusoid,
    /// A sample's series: linear between instants. A device has a table of the instants, the CPU one of the steps.
    Instants,
}

/// Properties that all cases of a device's pipeline share: its constants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceScene {
    /// Some cases have a second vehicle.
    pub is_paired: bool,
    /// All cases have one.
    pub is_all_paired: bool,
    /// Every vehicle is present from the first step to the last, and evaluated by the criteria.
    pub always_there: bool,
    /// Drivers may react to every vehicle from the first step on: by model, in the order of the registry.
    pub attends: [bool; MODELS],
    /// A step may move a vehicle's centre past the ego's.
    pub may_cross: bool,
    /// Speeds of the principal vehicle, and of the one ahead if there is one.
    pub speeds: [MotionKind; 2],
    /// Lateral motions of both.
    pub laterals: [MotionKind; 2],
}

impl DeviceScene {
    /// Nothing is known.
    pub const fn unknown(is_paired: bool) -> DeviceScene {
        DeviceScene {
            is_paired,
            is_all_paired: false,
            always_there: false,
            attends: [false; MODELS],
            may_cross: true,
            speeds: [MotionKind::Mixed; 2],
            laterals: [MotionKind::Mixed; 2],
        }
    }

    /// The constants of a model's pipeline by their names in the shaders.
    pub fn shader_constants(&self, model_index: usize) -> Vec<(&'static str, f64)> {
        let flag = |is_set: bool| f64::from(u8::from(is_set));
        let kind = |kind: MotionKind| f64::from(kind as u32);
        vec![
            ("scene_paired", flag(self.is_paired)),
            ("scene_all_paired", flag(self.is_all_paired)),
            ("scene_always_there", flag(self.always_there)),
            ("scene_attends", flag(self.attends[model_index])),
            ("scene_may_cross", flag(self.may_cross)),
            ("scene_speed_0", kind(self.speeds[0])),
            ("scene_speed_1", kind(self.speeds[1])),
            ("scene_lateral_0", kind(self.laterals[0])),
            ("scene_lateral_1", kind(self.laterals[1])),
        ]
    }
}

/// Whether one step of a lane of this case can move a vehicle's centre past the ego's from wholly ahead or behind. No
/// driver accelerates and no speed is negative, so the faster of the two vehicles bounds the change of the gap.
/// `fastest_of` gives the highest speed of a sampled motion, m/s, or more.
pub(super) fn may_cross<R: Real>(case: &LaneCase<R>, fastest_of: impl Fn(&Motion<R>) -> R, dt: R) -> bool {
    case.others.iter().filter(|other| other.used != 0).any(|other| {
        let motion = &other.motion;
        let is_sampled = motion.kind & SPEED_SAMPLED != 0;
        let at_last = motion.speed_initial + R::from_step(motion.speed_until) * motion.speed_per_step;
        let analytic = motion.speed_initial.larger(motion.speed_end).larger(at_last);
        let fastest = if is_sampled { fastest_of(motion) } else { analytic };
        !stays_behind(fastest.larger(case.ego_speed), other.half_lengths, dt)
    })
}

/// Whether a step at this relative speed, m/s, is shorter than the half lengths: one thousandth less, for rounding.
pub(super) fn stays_behind<R: Real>(fastest: R, half_lengths: R, dt: R) -> bool {
    fastest * dt <= R::from_f64(0.999) * half_lengths
}

/// The highest speed of a sampled motion.
pub(super) fn fastest_in<R: Real>(tables: &Tables<R>) -> impl Fn(&Motion<R>) -> R {
    |motion| {
        let from = motion.speed_offset as usize;
        let series = &tables.speed[from..from + motion.speed_len as usize];
        series.iter().fold(R::ZERO, |max, &speed| speed.larger(max))
    }
}

/// Whether the vehicle is evaluated, and neither appears nor leaves.
pub(super) fn is_there<R: Real>(other: &LaneOther<R>) -> bool {
    other.used != 0 && other.judged != 0 && other.present_from == 0 && other.present_until == NEVER
}

/// Whether there is one other vehicle, which neither appears nor leaves.
fn is_always_there<R: Real>(case: &LaneCase<R>) -> bool {
    case.pair == 0 && is_there(&case.others[0])
}

/// The same, and it stays in the middle of the ego's lane.
fn is_in_lane<R: Real>(case: &LaneCase<R>, model_index: usize) -> bool {
    is_centred(&case.others[0], case.ego_width) && case.others[0].attend_from[model_index] == 0
}

/// Whether the vehicle stays in the middle of the ego's lane.
pub(super) fn is_centred<R: Real>(other: &LaneOther<R>, ego_width: R) -> bool {
    let motion = &other.motion;
    let positions = [motion.lateral_initial, motion.lateral_per_step, motion.lateral_end, motion.lateral_towards];
    let stays = motion.kind & LATERAL_SAMPLED == 0 && positions.iter().all(|&number| number == R::ZERO);
    stays && other.half_widths > R::ZERO && ego_width > R::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scenario::{Ahead, Case, Category, Lateral, Participant, Speed};

    fn case(category: Category, lateral: Lateral, has_second: bool) -> LaneCase<f64> {
        let vehicle = |lateral| Participant { length_m: 4.5, width_m: 1.8, speed: Speed::constant(20.0), lateral };
        let case = Case {
            category,
            ego_speed_mps: 30.0,
            ego_length_m: 4.5,
            ego_width_m: 1.8,
            lane_width_m: 3.5,
            principal: vehicle(lateral),
            ahead: has_second.then(|| Ahead { gap_m: 30.0, vehicle: vehicle(Lateral::Centred) }),
            horizon_s: 5.0,
        };
        LaneCase::encode(&case, &Profile::load("paper").unwrap(), &mut Tables::default())
    }

    /// A leader is in the lane, a cutting-in vehicle is present, and a cutting-out vehicle has another one ahead. A
    /// property holds only if every case has it.
    #[test]
    fn only_what_holds_for_all_cases_is_known() {
        let leader = case(Category::Lvd, Lateral::Centred, false);
        let change = Lateral::Kinematic { start_m: 3.5, rate_mps: -1.0, end_m: 0.0 };
        let cut_in = case(Category::CutIn, change, false);
        let cut_out = case(Category::CutOut, Lateral::Centred, true);
        let known =
            |always_there: bool, in_lane| Scene { is_pair: !always_there, always_there, in_lane, ..Scene::in_lane() };
        assert_eq!(Scene::of(&[leader, leader], 0, false), known(true, true));
        assert_eq!(Scene::of(&[leader, cut_in], 0, false), known(true, false));
        assert_eq!(Scene::of(&[cut_in], 0, false), known(true, false));
        assert_eq!(Scene::of(&[leader, cut_out], 0, false), known(false, false));
    }

    /// A vehicle that appears, leaves, is not evaluated, or is not attended to from the start must be tested at every
    /// step.
    #[test]
    fn what_changes_within_a_lane_is_not_known() {
        let leader = case(Category::Lvd, Lateral::Centred, false);
        let with = |change: fn(&mut LaneCase<f64>)| {
            let mut case = leader;
            change(&mut case);
            Scene::of(&[case], 1, false)
        };
        assert!(!with(|case| case.others[0].present_from = 3).always_there);
        assert!(!with(|case| case.others[0].present_until = 3).always_there);
        assert!(!with(|case| case.others[0].judged = 0).always_there);
        let attends_late = with(|case| case.others[0].attend_from[1] = 1);
        assert!(attends_late.always_there && !attends_late.in_lane);
        assert!(with(|case| case.others[0].attend_from[0] = 1).in_lane);
        assert!(!with(|case| case.others[0].motion.lateral_end = 0.5).in_lane);
    }

    /// If a step is shorter than the vehicles' half lengths, no centre passes another from wholly ahead or behind.
    #[test]
    fn a_vehicle_crosses_only_where_a_step_is_as_long_as_the_half_lengths() {
        let case = |speed: Speed, tables: &mut Tables<f64>| {
            let vehicle = Participant { length_m: 4.5, width_m: 1.8, speed, lateral: Lateral::Centred };
            let case = Case {
                category: Category::Lvd,
                ego_speed_mps: 30.0,
                ego_length_m: 4.5,
                ego_width_m: 1.8,
                lane_width_m: 3.5,
                principal: vehicle,
                ahead: None,
                horizon_s: 0.0,
            };
            LaneCase::encode(&case, &Profile::load("paper").unwrap(), tables)
        };
        let gains = Speed::Kinematic { initial_mps: 10.0, acceleration_mps2: 2.0, until_s: 20.0 };
        let series = [Speed::constant(20.0), gains, Speed::Sampled(vec![20.0, 45.0, 20.0])];
        for (speed, fastest) in series.into_iter().zip([30.0, 50.0, 45.0]) {
            let tables = &mut Tables::default();
            let case = case(speed, tables);
            let limit_s = 4.5 / fastest;
            assert!(!may_cross(&case, fastest_in(tables), 0.99 * limit_s), "{fastest}");
            assert!(may_cross(&case, fastest_in(tables), limit_s), "{fastest}");
            assert_eq!(Scene::of(&[case], 0, true), Scene::unknown(true));
        }
    }
}
