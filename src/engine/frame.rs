//! The frame around a lane's steps: time and end rules, the initial headway, and the constants common to all lanes of
//! one model.

use lanesweep_model::criterion::Criteria;
use lanesweep_model::profile::{CutOutTarget, FrameProfile};
use lanesweep_model::scalar::Real;

use super::scene::Scene;

/// Constants of the frame at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<R> {
    /// Time step, s.
    pub dt: R,
    /// 1/dt, 1/s.
    pub inverse_dt: R,
    /// Maximum number of evaluated steps.
    pub step_cap: u32,
    /// Index 0 is one step after the nominal start.
    pub start_shift: bool,
    /// Ends the lane when no further event is possible.
    pub end_when_settled: bool,
    /// Abort at lateral overlap with |TTC| above this, s (the JRC's rule for CCHDM); off unless positive.
    pub abort_above_ttc: R,
    /// Of two unsafe vehicles the one with the larger demand counts, not the nearer one.
    pub largest_demand: bool,
}

impl<R: Real> Frame<R> {
    /// Resolves the constants; `abort_above_ttc_s` is that of the driver model.
    pub(crate) fn resolve(profile: &FrameProfile, abort_above_ttc_s: f64) -> Self {
        Frame {
            dt: R::from_f64(profile.dt_s),
            inverse_dt: R::from_f64(1.0 / profile.dt_s),
            step_cap: profile.step_cap(),
            start_shift: profile.start_shift,
            end_when_settled: profile.end_when_settled,
            abort_above_ttc: R::from_f64(abort_above_ttc_s),
            largest_demand: profile.cut_out_target == CutOutTarget::LargestDemand,
        }
    }

    /// The constants by their names in the shaders; flags are 0 or 1.
    pub fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("frame_dt", self.dt.to_f64()),
            ("frame_inverse_dt", self.inverse_dt.to_f64()),
            ("frame_step_cap", f64::from(self.step_cap.max(1))),
            ("frame_start_shift", f64::from(u8::from(self.start_shift))),
            ("frame_end_when_settled", f64::from(u8::from(self.end_when_settled))),
            ("frame_abort_above_ttc", self.abort_above_ttc.to_f64()),
            ("frame_largest_demand", f64::from(u8::from(self.largest_demand))),
        ]
    }
}

/// The headway of a lane: it sets the initial gap, bumper to bumper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<R> {
    /// Time headway, s: the gap is this times the ego's speed.
    Headway(R),
    /// Gap, m.
    Gap(R),
    /// Minimum following distance of UN R157, 5.2.3.3, at the ego's speed.
    MinFollowing,
}

impl<R: Real> Start<R> {
    /// The initial gap, m, at the ego's initial speed, m/s. Twin: `shaders/shared/frame.wgsl`.
    #[inline(always)]
    pub fn gap(self, ego_speed: R) -> R {
        match self {
            Start::Headway(thw) => thw * ego_speed,
            Start::Gap(gap) => gap,
            Start::MinFollowing => min_following_gap(ego_speed),
        }
    }
}

/// The table of 5.2.3.3 with linear interpolation: 1.0 s at 7.2 km/h, 1.1 s at 10 km/h, 0.1 s more per 10 km/h, 1.6 s
/// at 60 km/h, at least 2 m. Above 60 km/h the regulation refers to national rules. Here the line continues to 2.0 s at
/// 100 km/h and is constant above.
#[inline(always)]
fn min_following_gap<R: Real>(v: R) -> R {
    // From 7.2 to 10 km/h the table is steeper: 0.1 s in 2.8 km/h.
    let slow = R::from_f64(0.74285714286) + R::from_f64(0.12857142857) * v;
    let line = R::from_f64(1.0) + R::from_f64(0.036) * v;
    let thw = slow.smaller(line).smaller(R::from_f64(2.0));
    (thw * v).larger(R::from_f64(2.0))
}

/// The constants that all lanes of one model have in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct Simulation<'a, R, M> {
    /// Time and end rules.
    pub frame: &'a Frame<R>,
    /// Criteria.
    pub criteria: &'a Criteria<R>,
    /// The ego's driver.
    pub model: &'a M,
    /// Index of the model in the registry; selects the attention windows.
    pub model_index: usize,
    /// Known properties of the other vehicles.
    pub scene: Scene,
}

#[cfg(test)]
mod tests {
    use super::Start;

    /// Speeds in km/h, distances in m, as in 5.2.3.3, to its one decimal.
    #[test]
    fn the_minimum_following_distance_is_that_of_the_table() {
        for (kmh, metres) in
            [(7.2, 2.0), (10.0, 3.1), (20.0, 6.7), (30.0, 10.8), (40.0, 15.6), (50.0, 20.8), (60.0, 26.7)]
        {
            let gap_m = Start::<f64>::MinFollowing.gap(kmh / 3.6);
            assert!((gap_m - metres).abs() <= 0.051, "{kmh} km/h: {gap_m} m");
            assert!((f64::from(Start::<f32>::MinFollowing.gap(kmh as f32 / 3.6)) - gap_m).abs() < 1e-5);
        }
        assert_eq!(Start::<f64>::MinFollowing.gap(1.0), 2.0, "never below 2 m");
        assert_eq!(Start::<f64>::MinFollowing.gap(36.0), 72.0, "2 s from 100 km/h on: ours");
    }
}
