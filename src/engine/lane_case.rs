//! From a [`Case`] to the record that lanes read. Motions are encoded and sizes are summed. Everything that depends on
//! the other vehicles alone (attention, exposure, freezing) is computed once on the host.
//!
//! Also checks that the time step is short enough for a case. Contacts along the road are found between two steps.
//! Laterally, a vehicle is evaluated once per step, so it must not pass from one side of the ego to the other within a
//! step. Derivation: docs/src/methods/lane.md, time step.

pub(crate) use lanesweep_model::driver::NEVER;
use lanesweep_model::driver::{AttentionRule, DriverProfile, LaneGeometry, MODELS};
use lanesweep_model::profile::{CutOutEvaluated, CutOutTarget, Profile};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::{
    Case, Category, LATERAL_SAMPLED, Lateral, Motion, Participant, SPEED_SAMPLED, Speed, Tables,
};
use lanesweep_support::{Error, Place, Result, option};

/// One other vehicle of a lane.
#[repr(C)]
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct LaneOther<R> {
    /// Its motion.
    pub motion: Motion<R>,
    /// (L_e + L_o)/2, m.
    pub half_lengths: R,
    /// (W_e + W_o)/2, m.
    pub half_widths: R,
    /// Added to the lane's initial gap, m: 0 for the principal vehicle, L_c + D for the one ahead of it.
    pub gap_offset: R,
    /// First step at which it is present for the ego.
    pub present_from: u32,
    /// First step at which it is no longer present.
    pub present_until: u32,
    /// First step at which each driver model may react to it, in the order of
    /// [`ModelId::ALL`](lanesweep_model::driver::ModelId::ALL).
    pub attend_from: [u32; MODELS],
    /// 1 if the slot is used.
    pub used: u32,
    /// 1 if the criteria evaluate it.
    pub judged: u32,
}

/// Data that all lanes of one case share.
#[repr(C)]
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct LaneCase<R> {
    /// Principal vehicle, then the one ahead of it.
    pub others: [LaneOther<R>; 2],
    /// Initial and planned speed of the ego, m/s.
    pub ego_speed: R,
    /// Width of the ego, m.
    pub ego_width: R,
    /// Width of its lane, m.
    pub lane_width: R,
    /// Steps to the later of T and the last parameter event: a lane runs at least this long.
    pub horizon: u32,
    /// 1 if a second vehicle is used.
    pub pair: u32,
}

impl LaneCase<f64> {
    /// Encodes a case under a profile; its series are appended to `tables`.
    pub fn encode(case: &Case, profile: &Profile, tables: &mut Tables<f64>) -> Self {
        let dt_s = profile.frame.dt_s;
        let exposed = case.category == Category::CutOut && profile.frame.cut_out_target == CutOutTarget::Exposed;
        let principal = encode_other(case, &case.principal, 0.0, dt_s, tables);
        let mut others = [principal, LaneOther { used: 0, present_until: 0, ..principal }];
        if let Some(ahead) = &case.ahead {
            let offset = case.principal.length_m + ahead.gap_m;
            others[1] = encode_other(case, &ahead.vehicle, offset, dt_s, tables);
        }
        if case.category == Category::CutOut && profile.frame.cut_out_evaluated == CutOutEvaluated::Ahead {
            others[0].judged = 0;
        }
        if exposed {
            expose(case, profile, &mut others, tables);
        } else {
            attend(case, profile, &mut others, tables);
        }
        LaneCase {
            others,
            ego_speed: case.ego_speed_mps,
            ego_width: case.ego_width_m,
            lane_width: case.lane_width_m,
            horizon: (case.horizon_s / dt_s - 1e-9).ceil().max(0.0) as u32,
            pair: u32::from(case.ahead.is_some()),
        }
    }

    /// The same case with the other vehicles this much farther ahead, m, for a headway or gap that is part of the case.
    #[must_use]
    pub fn ahead_by(mut self, gap_m: f64) -> Self {
        self.others.iter_mut().for_each(|other| other.gap_offset += gap_m);
        self
    }

    /// Rounds every number once to the lane arithmetic.
    pub fn cast<R: Real>(&self) -> LaneCase<R> {
        LaneCase {
            others: self.others.map(|o| LaneOther {
                motion: o.motion.cast(),
                half_lengths: R::from_f64(o.half_lengths),
                half_widths: R::from_f64(o.half_widths),
                gap_offset: R::from_f64(o.gap_offset),
                present_from: o.present_from,
                present_until: o.present_until,
                attend_from: o.attend_from,
                used: o.used,
                judged: o.judged,
            }),
            ego_speed: R::from_f64(self.ego_speed),
            ego_width: R::from_f64(self.ego_width),
            lane_width: R::from_f64(self.lane_width),
            horizon: self.horizon,
            pair: self.pair,
        }
    }

    /// The same; the series that it reads from `all` are appended to `tables`.
    pub(super) fn cast_with_series<R: Real>(&self, all: &Tables<f64>, tables: &mut Tables<R>) -> LaneCase<R> {
        let mut case: LaneCase<R> = self.cast();
        for LaneOther { motion, .. } in &mut case.others {
            if motion.kind & SPEED_SAMPLED != 0 {
                let series = &all.speed[motion.speed_offset as usize..][..motion.speed_len as usize];
                motion.speed_offset = tables.speed.len() as u32;
                tables.speed.extend(series.iter().map(|&v| R::from_f64(v)));
            }
            if motion.kind & LATERAL_SAMPLED != 0 {
                let series = &all.lateral[motion.lateral_offset as usize..][..motion.lateral_len as usize];
                motion.lateral_offset = tables.lateral.len() as u32;
                tables.lateral.extend(series.iter().map(|state| state.map(R::from_f64)));
            }
        }
        case
    }
}

fn encode_other(
    case: &Case,
    other: &Participant,
    gap_offset: f64,
    dt_s: f64,
    tables: &mut Tables<f64>,
) -> LaneOther<f64> {
    LaneOther {
        motion: Motion::encode(&other.speed, &other.lateral, dt_s, tables),
        half_lengths: (case.ego_length_m + other.length_m) / 2.0,
        half_widths: (case.ego_width_m + other.width_m) / 2.0,
        gap_offset,
        present_until: NEVER,
        used: 1,
        judged: 1,
        ..LaneOther::default()
    }
}

/// Number of steps that cover every event of a motion, because motions are constant after their last event.
fn steps_seen(motion: &Motion<f64>, step_cap: u32) -> u32 {
    let events = [motion.speed_len, motion.lateral_len, motion.speed_until, motion.lateral_until];
    step_cap.min(events.into_iter().max().unwrap_or(0).saturating_add(2))
}

/// Sets when each model may react.
fn attend(case: &Case, profile: &Profile, others: &mut [LaneOther<f64>; 2], tables: &Tables<f64>) {
    let geometry = LaneGeometry {
        half_widths: others[0].half_widths,
        lane_width: case.lane_width_m,
        marking_gap: (case.lane_width_m - case.ego_width_m) * 0.5,
    };
    let motion = others[0].motion;
    let lateral = |step: u32| motion.lateral(tables, step).position;
    let speed = |step: u32| motion.speed(tables, step);
    let steps = steps_seen(&motion, profile.step_cap());
    for (model, rule) in attention_rules(profile, case.category).into_iter().enumerate() {
        let [principal, ahead] = rule.attend_from(steps, geometry, lateral, speed);
        others[0].attend_from[model] = principal;
        others[1].attend_from[model] = ahead;
    }
}

/// Defines [`attention_rules`] from the registry of driver models.
macro_rules! declare_attention {
    ($($(#[$attribute:meta])* $file:ident, $model:ident, $profile:ident, $name:literal;)+) => {
        /// Attention rule of each driver model, in the order of [`ModelId::ALL`](lanesweep_model::driver::ModelId::ALL).
        pub fn attention_rules(profile: &Profile, category: Category) -> [AttentionRule<f64>; MODELS] {
            [$(profile.$file.attention(profile.frame.dt_s, category)),+]
        }
    };
}
lanesweep_model::for_every_driver_model!(declare_attention);

/// The JRC's cut-out: no vehicle is present before the exposure, then the vehicle ahead. A cutting-out vehicle that
/// hits it freezes there and takes its place.
fn expose(case: &Case, profile: &Profile, others: &mut [LaneOther<f64>; 2], tables: &mut Tables<f64>) {
    let Some(ahead) = &case.ahead else { return };
    let dt = profile.frame.dt_s;
    let cap = profile.step_cap();
    let overlap_lengths = (case.principal.length_m + ahead.vehicle.length_m) / 2.0;
    let overlap_widths = (case.principal.width_m + ahead.vehicle.width_m) / 2.0;
    let (cutter, front) = (others[0].motion, others[1].motion);
    let is_exposed = |&i: &u32| cutter.lateral(tables, i).position.abs() > profile.frame.exposure_m;
    let exposure = (0..steps_seen(&cutter, cap)).find(is_exposed).unwrap_or(NEVER);
    let shift = if profile.frame.start_shift { front.speed(tables, 0) - cutter.speed(tables, 0) } else { 0.0 };
    let mut distance = ahead.gap_m + overlap_lengths + shift * dt;
    let mut freeze = NEVER;
    // Distance that it drives beyond the middle of the other vehicle within the step, m.
    let mut beyond = 0.0;
    for i in 0..cap {
        let before = distance;
        if i > 0 {
            distance += (front.speed(tables, i) - cutter.speed(tables, i)) * dt;
        }
        let passes = before >= overlap_lengths && distance < 0.0;
        let along = distance.abs() < overlap_lengths || passes;
        if along && cutter.lateral(tables, i).position.abs() < overlap_widths {
            freeze = i;
            beyond = if passes { -distance } else { 0.0 };
            break;
        }
    }
    others[1].present_from = exposure.min(freeze);
    others[1].present_until = freeze;
    others[0].present_from = freeze;
    if freeze != NEVER {
        // The position at the freeze includes the step made; the speed is 0 from there on.
        let speed: Vec<f64> = (0..freeze).map(|i| cutter.speed(tables, i)).chain([0.0]).collect();
        let lateral = cutter.lateral(tables, freeze).position;
        let moved = cutter.speed(tables, freeze) * dt - beyond;
        let frozen = Lateral::Sampled { position_m: vec![lateral], towards_mps: vec![0.0] };
        others[0].motion = Motion::encode(&Speed::Sampled(speed), &frozen, dt, tables);
        others[0].gap_offset += moved;
    }
}

/// Checks that the time step shows every vehicle of a case that passes across the ego's lane. `place` names the case in
/// errors.
///
/// # Errors
/// [`Error::Usage`] with the longest valid time step.
pub fn check_time_step(case: &LaneCase<f64>, tables: &Tables<f64>, dt_s: f64, place: impl Fn() -> Place) -> Result<()> {
    for (vehicle, other) in case.others.iter().enumerate().filter(|(_, other)| other.used != 0) {
        let Some(across_m) = passes(&other.motion, tables, other.half_widths) else { continue };
        let longest_s = dt_s * (2.0 * other.half_widths / across_m);
        let which = if vehicle == 0 { "the other vehicle" } else { "the vehicle ahead" };
        return Err(Error::usage(
            place(),
            format!("{which} passes from one side of the ego to the other ({across_m:.1} m) within a step of {dt_s} s"),
            format!("use a time step ({}) below {longest_s:.2e} s, or check the lateral positions", option("dt")),
        ));
    }
    Ok(())
}

/// Lateral distance, m, of a step in which a vehicle passes the ego: it overlaps with the ego neither before nor after
/// the step, and changes sides.
fn passes(motion: &Motion<f64>, tables: &Tables<f64>, half_widths: f64) -> Option<f64> {
    let of_step = |before: f64, after: f64| {
        let is_clear = before.abs() >= half_widths && after.abs() >= half_widths;
        (is_clear && (before < 0.0) != (after < 0.0)).then_some((after - before).abs())
    };
    if motion.kind & LATERAL_SAMPLED == 0 {
        // The lateral speed is constant; the last step is not longer than the others.
        if motion.lateral_per_step.abs() < 2.0 * half_widths {
            return None;
        }
        // The position is monotone, so at most one step changes the side. A binary search, because there may be 2³²
        // steps.
        let position = |step| motion.lateral(tables, step).position;
        let side = position(0) < 0.0;
        let (mut before, mut after) = (0, motion.lateral_until.saturating_add(1));
        if (position(after) < 0.0) == side {
            return None;
        }
        while after - before > 1 {
            let middle = before + (after - before) / 2;
            if (position(middle) < 0.0) == side {
                before = middle;
            } else {
                after = middle;
            }
        }
        return of_step(position(before), position(after));
    }
    let from = motion.lateral_offset as usize;
    let series = &tables.lateral[from..from + motion.lateral_len as usize];
    series.windows(2).find_map(|pair| of_step(pair[0][0], pair[1][0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scenario::{Case, Category, Lateral, Participant, Speed};

    fn check(lateral: Lateral, dt_s: f64) -> Result<()> {
        let profile = Profile::load("paper").unwrap().with_dt(dt_s).unwrap();
        let vehicle = Participant { length_m: 4.3, width_m: 1.9, speed: Speed::constant(20.0), lateral };
        let case = Case {
            category: Category::CutIn,
            ego_length_m: 4.3,
            ego_width_m: 1.9,
            lane_width_m: 3.5,
            ego_speed_mps: 30.0,
            principal: vehicle,
            ahead: None,
            horizon_s: 0.0,
        };
        let mut tables = Tables::default();
        let lane = LaneCase::encode(&case, &profile, &mut tables);
        check_time_step(&lane, &tables, dt_s, || Place::item("a case"))
    }

    /// Vehicles 1.9 m wide: a step of 3.8 m leads from one side to the other.
    #[test]
    fn a_vehicle_that_passes_across_the_ego_within_a_step_is_refused_with_the_step_that_shows_it() {
        let change = |end_m: f64, rate_mps: f64| Lateral::Kinematic { start_m: 3.5, rate_mps: -rate_mps, end_m };
        assert!(check(change(0.0, 50.0), 0.1).is_ok(), "it stays in the ego's lane");
        assert!(check(change(-3.5, 37.0), 0.1).is_ok());
        let error = check(change(-3.5, 70.0), 0.1).unwrap_err();
        let help = error.help().unwrap();
        assert!(error.to_string().contains("7.0 m") && help.contains("below 5.43e-2 s"), "{error} {help}");
        assert!(check(change(-3.5, 70.0), 0.05).is_ok());
        // Billions of steps; the check must not iterate over them.
        assert!(check(change(-1e10, 30.0), 0.1).is_ok());
        assert!(check(Lateral::Kinematic { start_m: 1e10 + 5.0, rate_mps: -100.0, end_m: -1e10 }, 0.1).is_err());
        let recorded = |position_m: Vec<f64>| Lateral::Sampled { towards_mps: vec![0.0; position_m.len()], position_m };
        assert!(check(recorded(vec![3.5, 2.0, 0.5, -2.0]), 0.1).is_ok());
        assert!(check(recorded(vec![3.5, 2.0, -2.0]), 0.1).is_err());
    }
}
