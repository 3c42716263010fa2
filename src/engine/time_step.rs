//! Time steps that are too long for a case. Contacts along the road are found between two steps; across the road a
//! vehicle is looked at once per step, and must not get from one side of the ego to the other unseen.
//! Derivation: docs/src/methods/lane.md, time step.

use crate::scenario::{LATERAL_SAMPLED, Motion, Tables};
use crate::{Error, Place, Result};

use super::lane_case::LaneCase;

/// Does the time step show every vehicle of a case that passes across the ego's lane? `place` is the case's.
///
/// # Errors
/// [`Error::Usage`] with the longest time step that does.
pub fn check_time_step(case: &LaneCase<f64>, tables: &Tables<f64>, dt_s: f64, place: impl Fn() -> Place) -> Result<()> {
    for (vehicle, other) in case.others.iter().enumerate().filter(|(_, other)| other.used != 0) {
        let Some(across_m) = passes(&other.motion, tables, other.half_widths) else { continue };
        let longest_s = dt_s * (2.0 * other.half_widths / across_m);
        let which = if vehicle == 0 { "the other vehicle" } else { "the vehicle ahead" };
        return Err(Error::usage(
            place(),
            format!("{which} passes from one side of the ego to the other ({across_m:.1} m) within a step of {dt_s} s"),
            format!("use a time step (option `dt`) below {longest_s:.2e} s, or check the lateral positions"),
        ));
    }
    Ok(())
}

/// How far a vehicle moves across the road, m, in a step that takes it past the ego: it overlaps with the ego neither
/// before nor after, and is on another side.
fn passes(motion: &Motion<f64>, tables: &Tables<f64>, half_widths: f64) -> Option<f64> {
    let of_step = |before: f64, after: f64| {
        let is_clear = before.abs() >= half_widths && after.abs() >= half_widths;
        (is_clear && (before < 0.0) != (after < 0.0)).then_some((after - before).abs())
    };
    if motion.kind & LATERAL_SAMPLED == 0 {
        // The lateral speed is constant; the last step is no longer than the others.
        if motion.lateral_per_step.abs() < 2.0 * half_widths {
            return None;
        }
        // The position is monotone, so one step at most changes the side: a search, because there may be 2³² steps.
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
    use crate::model::profile::Profile;
    use crate::scenario::{Case, Category, Lateral, Participant, Speed};

    fn check(lateral: Lateral, dt_s: f64) -> Result<()> {
        let profile = Profile::load("paper").unwrap().with_dt(dt_s).unwrap();
        let vehicle = Participant { length_m: 4.3, width_m: 1.9, speed: Speed::constant(20.0), lateral };
        let case = Case {
            category: Category::CutIn,
            ego_length_m: 4.3,
            ego_width_m: 1.9,
            ego_speed_mps: 30.0,
            principal: vehicle,
            ahead: None,
            horizon_s: 0.0,
        };
        let mut tables = Tables::default();
        let lane = LaneCase::encode(&case, &profile, &mut tables);
        check_time_step(&lane, &tables, dt_s, || Place::item("a case"))
    }

    /// Vehicles 1.9 m wide: 3.8 m at once lead from one side to the other.
    #[test]
    fn a_vehicle_that_passes_across_the_ego_within_a_step_is_refused_with_the_step_that_shows_it() {
        let change = |end_m: f64, rate_mps: f64| Lateral::Kinematic { start_m: 3.5, rate_mps: -rate_mps, end_m };
        assert!(check(change(0.0, 50.0), 0.1).is_ok(), "it stays in the ego's lane");
        assert!(check(change(-3.5, 37.0), 0.1).is_ok());
        let error = check(change(-3.5, 70.0), 0.1).unwrap_err();
        let help = error.help().unwrap();
        assert!(error.to_string().contains("7.0 m") && help.contains("below 5.43e-2 s"), "{error} {help}");
        assert!(check(change(-3.5, 70.0), 0.05).is_ok());
        // Billions of steps on the way: checked at once.
        assert!(check(change(-1e10, 30.0), 0.1).is_ok());
        assert!(check(Lateral::Kinematic { start_m: 1e10 + 5.0, rate_mps: -100.0, end_m: -1e10 }, 0.1).is_err());
        let recorded = |position_m: Vec<f64>| Lateral::Sampled { towards_mps: vec![0.0; position_m.len()], position_m };
        assert!(check(recorded(vec![3.5, 2.0, 0.5, -2.0]), 0.1).is_ok());
        assert!(check(recorded(vec![3.5, 2.0, -2.0]), 0.1).is_err());
    }
}
