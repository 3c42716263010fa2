//! RSS: Responsibility-Sensitive Safety. Unsafe when both the longitudinal and the lateral distance are
//! below their safe values.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    Bound, DriverModel, DriverProfile, DriverState, Hazard, View, delay_bound_s, delay_steps, latched_braking,
};
use crate::category::Category;
use crate::scalar::{Flag, Real};

/// Constants of the model as a profile gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RssProfile {
    /// ρ: response time, s (0.75).
    pub response_time_s: f64,
    /// a_acc: maximum acceleration of the ego during the response time, m/s² (3).
    pub max_acceleration_mps2: f64,
    /// b_ego: deceleration that the ego will reach, m/s² (6).
    pub ego_deceleration_mps2: f64,
    /// b_other: deceleration that the other vehicle may reach, m/s² (6).
    pub other_deceleration_mps2: f64,
    /// a_lat: lateral acceleration and deceleration, m/s² (1).
    pub lateral_acceleration_mps2: f64,
    /// μ: lateral margin, m (0.3).
    pub lateral_margin_m: f64,
    /// Jerk of the ramp, m/s³ (12.65).
    pub jerk_mps3: f64,
    /// Maximum deceleration, m/s² (0.774 g).
    pub max_deceleration_mps2: f64,
}

/// The model at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rss<R> {
    response_time: R,
    /// a_acc·ρ²/2, m.
    response_distance: R,
    /// ρ·a_acc, m/s.
    response_speed: R,
    /// 1/(2·b_ego), s²/m.
    half_inverse_ego: R,
    /// 1/(2·b_other), s²/m.
    half_inverse_other: R,
    /// a_lat·ρ, m/s.
    lateral_response_speed: R,
    /// 1/(2·a_lat), s²/m.
    half_inverse_lateral: R,
    /// ρ/2, s.
    half_response_time: R,
    lateral_margin: R,
    jerk_per_step: R,
    max_deceleration: R,
    delay_steps: u32,
    dt: R,
}

impl DriverProfile for RssProfile {
    type Model<R: Real> = Rss<R>;

    fn resolve<R: Real>(&self, dt_s: f64, _category: Category) -> Rss<R> {
        let rho = self.response_time_s;
        Rss {
            response_time: R::from_f64(rho),
            response_distance: R::from_f64(self.max_acceleration_mps2 * rho * rho / 2.0),
            response_speed: R::from_f64(rho * self.max_acceleration_mps2),
            half_inverse_ego: R::from_f64(1.0 / (2.0 * self.ego_deceleration_mps2)),
            half_inverse_other: R::from_f64(1.0 / (2.0 * self.other_deceleration_mps2)),
            lateral_response_speed: R::from_f64(self.lateral_acceleration_mps2 * rho),
            half_inverse_lateral: R::from_f64(1.0 / (2.0 * self.lateral_acceleration_mps2)),
            half_response_time: R::from_f64(rho / 2.0),
            lateral_margin: R::from_f64(self.lateral_margin_m),
            jerk_per_step: R::from_f64(self.jerk_mps3 * dt_s),
            max_deceleration: R::from_f64(self.max_deceleration_mps2),
            delay_steps: delay_steps(rho, dt_s),
            dt: R::from_f64(dt_s),
        }
    }

    fn bounds(&self) -> Vec<(&'static str, f64, Bound)> {
        vec![
            ("ego_deceleration_mps2", self.ego_deceleration_mps2, Bound::DECELERATION),
            ("other_deceleration_mps2", self.other_deceleration_mps2, Bound::DECELERATION),
            ("lateral_acceleration_mps2", self.lateral_acceleration_mps2, Bound::LATERAL_ACCELERATION),
            ("jerk_mps3", self.jerk_mps3, Bound::JERK),
            ("max_deceleration_mps2", self.max_deceleration_mps2, Bound::DECELERATION),
            ("response_time_s", self.response_time_s, Bound::DELAY),
            ("max_acceleration_mps2", self.max_acceleration_mps2, Bound::ACCELERATION),
            ("lateral_margin_m", self.lateral_margin_m, Bound::DISTANCE),
        ]
    }

    fn time_step_bounds(&self, _dt_s: f64) -> Vec<(&'static str, f64)> {
        vec![("response_time_s", delay_bound_s(self.response_time_s))]
    }
}

impl<R: Real> Rss<R> {
    /// d_lon = v_e ρ + a_acc ρ²/2 + (v_e + ρ a_acc)²/(2 b_ego) − v_o²/(2 b_other), m; may be negative.
    #[inline(always)]
    pub fn longitudinal_distance(&self, v_ego: R, v_other: R) -> R {
        let v_response = v_ego + self.response_speed;
        v_ego * self.response_time + self.response_distance + v_response * v_response * self.half_inverse_ego
            - v_other * v_other * self.half_inverse_other
    }

    /// d_lat = μ + (2|v_y| + a_lat ρ) ρ/2 + (|v_y| + a_lat ρ)²/(2 a_lat), m; the direction of v_y is ignored.
    #[inline(always)]
    pub fn lateral_distance(&self, lateral_speed: R) -> R {
        let v_y = lateral_speed.abs();
        let v_response = v_y + self.lateral_response_speed;
        self.lateral_margin
            + (v_y + v_response) * self.half_response_time
            + v_response * v_response * self.half_inverse_lateral
    }
}

impl<R: Real> DriverModel<R> for Rss<R> {
    const SEES_OWN_ACCELERATION: bool = false;

    #[inline(always)]
    fn safe_gap(&self, v_ego: R, v_other: R) -> R {
        self.longitudinal_distance(v_ego, v_other).larger(R::ZERO)
    }

    #[inline(always)]
    fn ignores(&self, lateral_gap: R, lateral_towards: R, _marking_gap: R) -> Flag {
        !lateral_gap.is_below(self.lateral_distance(lateral_towards))
    }

    #[inline(always)]
    fn initial(&self) -> DriverState<R> {
        DriverState { deceleration: R::ZERO, delay_steps: self.delay_steps }
    }

    /// Unsafe iff g < d_lon and h < d_lat.
    #[inline(always)]
    fn check(&self, view: &View<R>) -> Hazard<R> {
        let close = view.gap.is_below(self.longitudinal_distance(view.v_ego, view.v_other));
        let beside = view.lateral_gap.is_below(self.lateral_distance(view.lateral_towards));
        Hazard { is_unsafe: !view.is_behind() & close & beside, demand: self.max_deceleration }
    }

    fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("driver_response_time", self.response_time.to_f64()),
            ("driver_response_distance", self.response_distance.to_f64()),
            ("driver_response_speed", self.response_speed.to_f64()),
            ("driver_half_inverse_ego", self.half_inverse_ego.to_f64()),
            ("driver_half_inverse_other", self.half_inverse_other.to_f64()),
            ("driver_lateral_response_speed", self.lateral_response_speed.to_f64()),
            ("driver_half_inverse_lateral", self.half_inverse_lateral.to_f64()),
            ("driver_half_response_time", self.half_response_time.to_f64()),
            ("driver_lateral_margin", self.lateral_margin.to_f64()),
            ("driver_jerk_per_step", self.jerk_per_step.to_f64()),
            ("driver_max_deceleration", self.max_deceleration.to_f64()),
            ("driver_delay_steps", f64::from(self.delay_steps)),
        ]
    }

    /// Holds the speed for ρ, then ramps from 0 at 12.65 m/s³ up to 0.774 g.
    #[inline(always)]
    fn react(&self, state: DriverState<R>, hazard: &Hazard<R>, v_ego: R) -> (DriverState<R>, R) {
        let braking = (state.deceleration + self.jerk_per_step).smaller(hazard.demand);
        latched_braking(state, R::ZERO, braking, v_ego, self.dt)
    }
}
