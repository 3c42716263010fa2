//! Physical features of a scenario: numbers that a description may keep instead of whole series.

use serde::{Deserialize, Serialize};

use super::options::ParameterizationOptions;
use super::parameter::{Parameter, Variable};
use super::series::{at, lateral_speed, mean_acceleration};
use super::sizes::vehicle_ahead;
use crate::Result;
use crate::scenario::{Category, Scenario};

/// Time over which accelerations are differenced, s: recorded speeds have two decimals.
const DIFFERENCE_S: f64 = 0.4;
/// Deceleration from which on a vehicle brakes, m/s².
const BRAKING_MPS2: f64 = 0.5;
/// Lateral distance from the middle of the ego's lane at which a vehicle is between two lanes, m.
const LANE_LINE_M: f64 = 1.75;

/// A physical feature. `target` is the cutter, the cutting-out vehicle or the leader; `lead` the vehicle ahead of a
/// cutting-out one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Feature {
    /// Speed of the ego at t = 0, m/s.
    EgoSpeed,
    /// Duration T, s.
    Duration,
    /// Cut-out: gap D to the vehicle ahead at t = 0, m.
    LeadGap,
    /// Speed of the target at t = 0, m/s.
    TargetSpeed,
    /// Its speed at T/4, m/s.
    TargetSpeedQuarter,
    /// Its speed at T/2, m/s.
    TargetSpeedHalf,
    /// Its speed at 3T/4, m/s.
    TargetSpeedThreeQuarters,
    /// Its speed at T, m/s.
    TargetSpeedEnd,
    /// Its mean speed over [0, T], m/s.
    TargetSpeedMean,
    /// (v(T) − v(0))/T, m/s².
    TargetAcceleration,
    /// Its acceleration at t = 0, over 0.4 s, m/s².
    TargetAccelerationStart,
    /// Its acceleration at T, over 0.4 s, m/s².
    TargetAccelerationEnd,
    /// Its hardest deceleration over 0.4 s, m/s², ≥ 0.
    TargetPeakDeceleration,
    /// Time of the hardest deceleration, s.
    TargetPeakTime,
    /// Time at which it first brakes harder than 0.5 m/s², s; T without.
    TargetBrakingStart,
    /// Hardest change of its acceleration between two spans of 0.4 s, m/s³.
    TargetJerk,
    /// |y(0) − y(T)|/T, m/s.
    LateralSpeed,
    /// Lateral speed of the first 0.4 s, m/s.
    LateralSpeedStart,
    /// Largest lateral speed over 0.4 s, m/s.
    LateralSpeedPeak,
    /// Lateral position at t = 0, m.
    LateralStart,
    /// Lateral position at T/2, m.
    LateralHalf,
    /// Lateral position at T, m.
    LateralEnd,
    /// Time at which |y| first passes 1.75 m, s; T without.
    CrossingTime,
    /// Cut-out: speed of the vehicle ahead at t = 0, m/s.
    LeadSpeed,
    /// Cut-out: its speed at T, m/s.
    LeadSpeedEnd,
    /// Cut-out: (v(T) − v(0))/T of the vehicle ahead, m/s².
    LeadAcceleration,
}

impl Feature {
    const ALL: [Feature; 26] = [
        Feature::EgoSpeed,
        Feature::Duration,
        Feature::LeadGap,
        Feature::TargetSpeed,
        Feature::TargetSpeedQuarter,
        Feature::TargetSpeedHalf,
        Feature::TargetSpeedThreeQuarters,
        Feature::TargetSpeedEnd,
        Feature::TargetSpeedMean,
        Feature::TargetAcceleration,
        Feature::TargetAccelerationStart,
        Feature::TargetAccelerationEnd,
        Feature::TargetPeakDeceleration,
        Feature::TargetPeakTime,
        Feature::TargetBrakingStart,
        Feature::TargetJerk,
        Feature::LateralSpeed,
        Feature::LateralSpeedStart,
        Feature::LateralSpeedPeak,
        Feature::LateralStart,
        Feature::LateralHalf,
        Feature::LateralEnd,
        Feature::CrossingTime,
        Feature::LeadSpeed,
        Feature::LeadSpeedEnd,
        Feature::LeadAcceleration,
    ];

    /// The features of a category, in order.
    pub fn of_category(category: Category) -> impl Iterator<Item = Feature> {
        Self::ALL.into_iter().filter(move |feature| feature.exists_in(category))
    }

    fn exists_in(self, category: Category) -> bool {
        match self {
            Feature::LeadGap | Feature::LeadSpeed | Feature::LeadSpeedEnd | Feature::LeadAcceleration => {
                category == Category::CutOut
            }
            // In LVD the ego starts at the leader's speed, and the leader stays in its lane.
            Feature::EgoSpeed
            | Feature::LateralSpeed
            | Feature::LateralSpeedStart
            | Feature::LateralSpeedPeak
            | Feature::LateralStart
            | Feature::LateralHalf
            | Feature::LateralEnd
            | Feature::CrossingTime => category != Category::Lvd,
            _ => true,
        }
    }

    /// Name with its unit, unit and bounds.
    pub(crate) fn parameter(self, category: Category, options: &ParameterizationOptions) -> Parameter {
        let (name, unit, lower) = match self {
            Feature::EgoSpeed => return Variable::EgoSpeed.parameter(category, options),
            Feature::Duration => return Variable::Duration.parameter(category, options),
            Feature::LeadGap => return Variable::LeadGap.parameter(category, options),
            Feature::TargetSpeed => return Variable::TargetSpeed.parameter(category, options),
            Feature::LateralSpeed => return Variable::LateralSpeed.parameter(category, options),
            Feature::TargetAcceleration => return Variable::TargetAcceleration.parameter(category, options),
            Feature::LeadSpeed => return Variable::LeadSpeed.parameter(category, options),
            Feature::LeadAcceleration => return Variable::LeadAcceleration.parameter(category, options),
            Feature::TargetSpeedQuarter => ("v_target_quarter_mps", "m/s", Some(0.0)),
            Feature::TargetSpeedHalf => ("v_target_half_mps", "m/s", Some(0.0)),
            Feature::TargetSpeedThreeQuarters => ("v_target_three_quarters_mps", "m/s", Some(0.0)),
            Feature::TargetSpeedEnd => ("v_target_end_mps", "m/s", Some(0.0)),
            Feature::TargetSpeedMean => ("v_target_mean_mps", "m/s", Some(0.0)),
            Feature::TargetAccelerationStart => ("acceleration_target_start_mps2", "m/s²", None),
            Feature::TargetAccelerationEnd => ("acceleration_target_end_mps2", "m/s²", None),
            Feature::TargetPeakDeceleration => ("peak_deceleration_target_mps2", "m/s²", Some(0.0)),
            Feature::TargetPeakTime => ("peak_time_target_s", "s", Some(0.0)),
            Feature::TargetBrakingStart => ("braking_start_target_s", "s", Some(0.0)),
            Feature::TargetJerk => ("jerk_target_mps3", "m/s³", Some(0.0)),
            Feature::LateralSpeedStart => ("lateral_speed_start_mps", "m/s", None),
            Feature::LateralSpeedPeak => ("lateral_speed_peak_mps", "m/s", Some(0.0)),
            Feature::LateralStart => ("lateral_start_m", "m", None),
            Feature::LateralHalf => ("lateral_half_m", "m", None),
            Feature::LateralEnd => ("lateral_end_m", "m", None),
            Feature::CrossingTime => ("crossing_time_s", "s", Some(0.0)),
            Feature::LeadSpeedEnd => ("v_lead_end_mps", "m/s", Some(0.0)),
        };
        Parameter::from(name, unit, lower)
    }

    /// The value in a scenario.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) for a cut-out without the vehicle ahead.
    pub(crate) fn of(self, scenario: &Scenario, options: &ParameterizationOptions) -> Result<f64> {
        let duration_s = scenario.duration_s();
        let value = |series: &[f64], t_s: f64| at(series, scenario.fps, t_s.clamp(0.0, duration_s));
        let v = |t_s: f64| value(&scenario.target.v, t_s);
        let y = |t_s: f64| value(&scenario.target.y, t_s);
        let span_s = DIFFERENCE_S.min(duration_s).max(1e-9);
        let slope = |of: &dyn Fn(f64) -> f64, t_s: f64| (of(t_s + span_s) - of(t_s)) / span_s;
        // The beginnings of all spans.
        let starts = || {
            let count = ((duration_s - span_s) * scenario.fps + 1e-9).floor().max(0.0) as usize;
            (0..=count).map(|k| k as f64 / scenario.fps)
        };
        let hardest = || {
            let of = starts().map(|t_s| (-slope(&v, t_s), t_s));
            of.fold((f64::NEG_INFINITY, 0.0), |best, here| if here.0 > best.0 { here } else { best })
        };
        Ok(match self {
            Feature::EgoSpeed => Variable::EgoSpeed.of(scenario, options)?,
            Feature::Duration => duration_s,
            Feature::LeadGap => Variable::LeadGap.of(scenario, options)?,
            Feature::TargetSpeed => v(0.0),
            Feature::TargetSpeedQuarter => v(0.25 * duration_s),
            Feature::TargetSpeedHalf => v(0.5 * duration_s),
            Feature::TargetSpeedThreeQuarters => v(0.75 * duration_s),
            Feature::TargetSpeedEnd => v(duration_s),
            Feature::TargetSpeedMean => scenario.target.v.iter().sum::<f64>() / scenario.target.v.len() as f64,
            Feature::TargetAcceleration => mean_acceleration(&scenario.target, duration_s),
            Feature::TargetAccelerationStart => slope(&v, 0.0),
            Feature::TargetAccelerationEnd => slope(&v, duration_s - span_s),
            Feature::TargetPeakDeceleration => hardest().0.max(0.0),
            Feature::TargetPeakTime => hardest().1 + 0.5 * span_s,
            Feature::TargetBrakingStart => starts().find(|t_s| slope(&v, *t_s) < -BRAKING_MPS2).unwrap_or(duration_s),
            Feature::TargetJerk => {
                let jerk = |t_s: f64| (slope(&v, t_s + span_s) - slope(&v, t_s)) / span_s;
                starts().filter(|t_s| t_s + 2.0 * span_s <= duration_s).map(|t_s| jerk(t_s).abs()).fold(0.0, f64::max)
            }
            Feature::LateralSpeed => lateral_speed(scenario, options),
            Feature::LateralSpeedStart => slope(&y, 0.0),
            Feature::LateralSpeedPeak => starts().map(|t_s| slope(&y, t_s).abs()).fold(0.0, f64::max),
            Feature::LateralStart => y(0.0),
            Feature::LateralHalf => y(0.5 * duration_s),
            Feature::LateralEnd => y(duration_s),
            Feature::CrossingTime => duration_s * crossing(&scenario.target.y, LANE_LINE_M),
            Feature::LeadSpeed => value(&vehicle_ahead(scenario)?.0.v, 0.0),
            Feature::LeadSpeedEnd => value(&vehicle_ahead(scenario)?.0.v, duration_s),
            Feature::LeadAcceleration => mean_acceleration(vehicle_ahead(scenario)?.0, duration_s),
        })
    }
}

/// The fraction of the duration at which the magnitude of a series first passes a limit; 1 if it does not.
pub(super) fn crossing(series: &[f64], limit: f64) -> f64 {
    let is_inside = series[0].abs() < limit;
    let Some(k) = series.iter().position(|y| (y.abs() < limit) != is_inside) else { return 1.0 };
    let (before, after) = (series[k - 1].abs(), series[k].abs());
    (k as f64 - 1.0 + (limit - before) / (after - before)) / (series.len() - 1) as f64
}
