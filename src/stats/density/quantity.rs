//! What one dimension of a parameter space stands for: name, unit, validity bounds.

use serde::{Deserialize, Serialize};

use crate::scenario::parameterization::{MIN_DURATION_S, ParameterizationOptions};

/// Longest duration T of a valid point, s: five times the longest run, which ends after 120 s. It keeps sampled
/// series short where a deceleration comes out near 0.
pub const MAX_DURATION_S: f64 = 600.0;

/// Physical ranges of a density's numbers: unit, smallest scale of a parameter, largest size of a value or scale. Beyond,
/// nothing drives, and the lane arithmetic (binary32) has no normal number.
pub const PHYSICAL_RANGES: [(&str, f64, f64); 5] =
    [("m/s", 1e-9, 200.0), ("m/s²", 1e-9, 100.0), ("m", 1e-9, 10_000.0), ("s", 1e-9, 1000.0), ("1", 1e-9, 1e6)];

/// Meaning of one dimension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Speed of cutter or cutting-out vehicle at t = 0.
    TargetSpeed,
    /// Size of its lateral speed.
    LateralSpeed,
    /// Speed of the ego.
    EgoSpeed,
    /// Acceleration of cutter or cutting-out vehicle over [0, T].
    TargetAcceleration,
    /// Cut-out: speed of the vehicle ahead at t = 0.
    LeadSpeed,
    /// Cut-out: its acceleration over [0, T].
    LeadAcceleration,
    /// Cut-out: gap D from the cutting-out vehicle to the one ahead at t = 0.
    LeadGap,
    /// Duration T of accelerations.
    Duration,
    /// LVD: speed of leader and ego before the deceleration.
    InitialSpeed,
    /// LVD: speed of the leader after it.
    FinalSpeed,
    /// LVD: (v0 − v1)/T.
    MeanDeceleration,
    /// σ_j u_j of a decomposition, counted from 0.
    Coefficient(usize),
    /// Time headway of the ego at t = 0, bumper to bumper.
    TimeHeadway,
}

/// A dimension as files and tables show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Name with its unit, `v_target_mps`.
    pub name: String,
    /// Unit: `m/s`, `m/s²`, `m`, `s`; `1` for coefficients, which have none.
    pub unit: String,
    /// Least valid value; `None` is unbounded.
    pub lower: Option<f64>,
    /// The least value itself is not valid.
    pub lower_excluded: bool,
    /// Largest valid value; `None` is unbounded.
    pub upper: Option<f64>,
}

impl Parameter {
    /// Within the bounds; false for NaN.
    pub fn holds(&self, value: f64) -> bool {
        let above = match self.lower {
            Some(lower) if self.lower_excluded => value > lower,
            Some(lower) => value >= lower,
            None => true,
        };
        value.is_finite() && above && self.upper.is_none_or(|upper| value <= upper)
    }

    /// Smallest scale and largest size of a value or scale, in its unit.
    pub fn physical_range(&self) -> [f64; 2] {
        let of_unit = PHYSICAL_RANGES.iter().find(|(unit, ..)| *unit == self.unit);
        of_unit.map_or([f64::MIN_POSITIVE, f64::MAX], |&(_, smallest, largest)| [smallest, largest])
    }

    /// The bounds in words: `≥ 0`, `> 0`, `0.1 … 600`, `any`.
    pub fn bounds_text(&self) -> String {
        let sign = if self.lower_excluded { ">" } else { "≥" };
        match (self.lower, self.upper) {
            (Some(lower), Some(upper)) if !self.lower_excluded => format!("{lower} … {upper}"),
            (Some(lower), Some(upper)) => format!("{sign} {lower}, ≤ {upper}"),
            (Some(lower), None) => format!("{sign} {lower}"),
            (None, Some(upper)) => format!("≤ {upper}"),
            (None, None) => "any".to_owned(),
        }
    }
}

impl Quantity {
    /// Name, unit and bounds under options of the parameterization.
    pub fn parameter(self, options: &ParameterizationOptions) -> Parameter {
        let (name, unit, lower, lower_excluded, upper) = match self {
            Quantity::TargetSpeed => ("v_target_mps", "m/s", Some(0.0), false, None),
            Quantity::LateralSpeed => ("lateral_speed_mps", "m/s", Some(options.least_lateral_speed_mps), false, None),
            Quantity::EgoSpeed => ("v_ego_mps", "m/s", Some(0.0), false, None),
            Quantity::TargetAcceleration => ("acceleration_target_mps2", "m/s²", None, false, None),
            Quantity::LeadSpeed => ("v_lead_mps", "m/s", Some(0.0), false, None),
            Quantity::LeadAcceleration => ("acceleration_lead_mps2", "m/s²", None, false, None),
            Quantity::LeadGap => ("gap_lead_m", "m", Some(0.0), false, None),
            Quantity::Duration => ("duration_s", "s", Some(MIN_DURATION_S), false, Some(MAX_DURATION_S)),
            Quantity::InitialSpeed => ("v0_mps", "m/s", Some(0.0), false, None),
            Quantity::FinalSpeed => ("v1_mps", "m/s", Some(0.0), false, None),
            Quantity::MeanDeceleration => ("mean_deceleration_mps2", "m/s²", Some(0.0), true, None),
            Quantity::Coefficient(_) => ("c", "1", None, false, None),
            Quantity::TimeHeadway => ("thw_s", "s", Some(0.0), true, None),
        };
        let name = match self {
            Quantity::Coefficient(j) => format!("c{}", j + 1),
            _ => name.to_owned(),
        };
        Parameter { name, unit: unit.to_owned(), lower, lower_excluded, upper }
    }
}
