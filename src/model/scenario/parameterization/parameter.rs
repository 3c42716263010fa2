//! The numbers of a point: variables of a case with name, unit and valid range, and how each is read from a mined
//! scenario.

use serde::{Deserialize, Serialize};

use super::options::ParameterizationOptions;
use super::series::{lateral_speed, mean_acceleration};
use super::sizes::vehicle_ahead;
use crate::plausibility::Quantity;
use crate::scenario::{Category, Scenario};
use lanesweep_support::{Error, Place, Result, option};

/// Minimum duration T of a valid point and of a reconstruction, s.
pub const MIN_DURATION_S: f64 = 0.1;

/// Maximum duration T of a valid point, s: five times the longest run, which ends after 120 s. It limits sampled series
/// where a deceleration is near 0.
pub const MAX_DURATION_S: f64 = 600.0;

/// Physical ranges of a density's numbers: unit, minimum scale of a parameter, maximum magnitude of a value or scale.
/// Beyond them no vehicle exists, and values are not normal numbers of the lane arithmetic (binary32).
const PHYSICAL_RANGES: [(&str, f64, f64); 5] =
    [("m/s", 1e-9, 200.0), ("m/s²", 1e-9, 100.0), ("m", 1e-9, 10_000.0), ("s", 1e-9, 1000.0), ("1", 1e-9, 1e6)];

/// A number that defines a kinematic case. Its code is its slot in the recipe of a
/// case generator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Deserialize)]
#[repr(u32)]
pub enum Variable {
    /// Speed of cutter or cutting-out vehicle at t = 0, m/s; LVD: of leader and ego before the deceleration.
    TargetSpeed,
    /// Magnitude of the target's lateral speed, m/s.
    LateralSpeed,
    /// Speed of the ego, m/s; LVD: that of the leader.
    EgoSpeed,
    /// Acceleration of the target over [0, T], m/s².
    TargetAcceleration,
    /// Cut-out: speed of the vehicle ahead at t = 0, m/s.
    LeadSpeed,
    /// Cut-out: its acceleration over [0, T], m/s².
    LeadAcceleration,
    /// Cut-out: gap D from the cutting-out vehicle to the one ahead at t = 0, m.
    LeadGap,
    /// Duration T of accelerations, s.
    Duration,
    /// LVD: speed of the leader after the deceleration, m/s.
    FinalSpeed,
    /// LVD: (v0 − v1)/T, m/s².
    MeanDeceleration,
    /// Time headway of the ego at t = 0, bumper to bumper, s.
    TimeHeadway,
}

/// A dimension of a point as files and tables show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Name with its unit, `v_target_mps`.
    pub name: String,
    /// Unit: `m/s`, `m/s²`, `m`, `s`; `1` for dimensionless coefficients.
    pub unit: String,
    /// Minimum valid value; `None` is unbounded.
    pub lower: Option<f64>,
    /// Whether the minimum itself is excluded.
    pub lower_excluded: bool,
    /// Maximum valid value; `None` is unbounded.
    pub upper: Option<f64>,
}

impl Variable {
    /// All variables, in the order of their codes.
    pub const ALL: [Variable; 11] = [
        Variable::TargetSpeed,
        Variable::LateralSpeed,
        Variable::EgoSpeed,
        Variable::TargetAcceleration,
        Variable::LeadSpeed,
        Variable::LeadAcceleration,
        Variable::LeadGap,
        Variable::Duration,
        Variable::FinalSpeed,
        Variable::MeanDeceleration,
        Variable::TimeHeadway,
    ];

    /// Name, unit and bounds in a category, under options of the parameterization.
    pub fn parameter(self, category: Category, options: &ParameterizationOptions) -> Parameter {
        let (name, unit, lower, lower_excluded, upper) = match self {
            Variable::TargetSpeed if category == Category::Lvd => ("v0_mps", "m/s", Some(0.0), false, None),
            Variable::TargetSpeed => ("v_target_mps", "m/s", Some(0.0), false, None),
            Variable::LateralSpeed => ("lateral_speed_mps", "m/s", Some(options.min_lateral_speed_mps), false, None),
            Variable::EgoSpeed => ("v_ego_mps", "m/s", Some(0.0), false, None),
            Variable::TargetAcceleration => ("acceleration_target_mps2", "m/s²", None, false, None),
            Variable::LeadSpeed => ("v_lead_mps", "m/s", Some(0.0), false, None),
            Variable::LeadAcceleration => ("acceleration_lead_mps2", "m/s²", None, false, None),
            Variable::LeadGap => ("gap_lead_m", "m", Some(0.0), false, None),
            Variable::Duration => ("duration_s", "s", Some(MIN_DURATION_S), false, Some(MAX_DURATION_S)),
            Variable::FinalSpeed => ("v1_mps", "m/s", Some(0.0), false, None),
            Variable::MeanDeceleration => ("mean_deceleration_mps2", "m/s²", Some(0.0), true, None),
            Variable::TimeHeadway => ("thw_s", "s", Some(0.0), true, None),
        };
        Parameter { lower_excluded, upper, ..Parameter::from(name, unit, lower) }
    }

    /// Returns the value in a mined scenario.
    ///
    /// # Errors
    /// [`Error::Input`] for a scenario without the value: no vehicle ahead, or no observed headway.
    pub fn of(self, scenario: &Scenario, options: &ParameterizationOptions) -> Result<f64> {
        let (target, duration_s) = (&scenario.target, scenario.duration_s());
        let before = if scenario.category == Category::Lvd { target.v[0].max(0.0) } else { target.v[0] };
        let after = || target.v[target.v.len() - 1].max(0.0);
        Ok(match self {
            Variable::TargetSpeed => before,
            Variable::LateralSpeed => lateral_speed(scenario, options),
            Variable::EgoSpeed if scenario.category == Category::Lvd => before,
            Variable::EgoSpeed => scenario.ego.v0,
            Variable::TargetAcceleration => mean_acceleration(target, duration_s),
            Variable::LeadSpeed => vehicle_ahead(scenario)?.0.v[0],
            Variable::LeadAcceleration => mean_acceleration(vehicle_ahead(scenario)?.0, duration_s),
            Variable::LeadGap => vehicle_ahead(scenario)?.1,
            Variable::Duration => duration_s,
            Variable::FinalSpeed => after(),
            Variable::MeanDeceleration => (before - after()) / duration_s,
            // In LVD the ego starts at the leader's speed, with the recorded gap, like the ego of S.
            Variable::TimeHeadway if scenario.category == Category::Lvd && scenario.thw0.is_some() && before > 0.0 => {
                scenario.start_headway_s().unwrap_or_default()
            }
            Variable::TimeHeadway => scenario.thw0.ok_or_else(|| {
                Error::input(
                    Place::item(format!("scenario {}", scenario.id)).column("thw0"),
                    "no observed headway, which the dimension `thw_s` needs (the ego may have stood)",
                    format!("leave the scenario out or fit without {}", option("with_thw")),
                )
            })?,
        })
    }
}

impl Parameter {
    /// The quantity that defines its plausible and physical range; `None` if there is none.
    pub(crate) fn quantity(&self) -> Option<Quantity> {
        match (&*self.name, &*self.unit) {
            ("lateral_speed_mps", _) => Some(Quantity::LateralSpeed),
            ("acceleration_target_mps2" | "acceleration_lead_mps2", _) => Some(Quantity::Acceleration),
            ("gap_lead_m", _) => Some(Quantity::Gap),
            ("thw_s", _) => Some(Quantity::Headway),
            (_, "m/s") => Some(Quantity::Speed),
            _ => None,
        }
    }

    /// A number from `lower` on.
    pub(super) fn from(name: impl Into<String>, unit: &str, lower: Option<f64>) -> Parameter {
        Parameter { name: name.into(), unit: unit.to_owned(), lower, lower_excluded: false, upper: None }
    }

    /// Coefficient `j` of a decomposition, counted from 0: unbounded, dimensionless.
    pub(super) fn coefficient(j: usize) -> Parameter {
        Parameter::from(format!("c{}", j + 1), "1", None)
    }

    /// Whether a value is within the bounds; false for NaN.
    pub fn holds(&self, value: f64) -> bool {
        let above = match self.lower {
            Some(lower) if self.lower_excluded => value > lower,
            Some(lower) => value >= lower,
            None => true,
        };
        value.is_finite() && above && self.upper.is_none_or(|upper| value <= upper)
    }

    /// Minimum scale and maximum magnitude of a value or scale, in its unit.
    pub fn physical_range(&self) -> [f64; 2] {
        let of_unit = PHYSICAL_RANGES.iter().find(|(unit, ..)| *unit == self.unit);
        of_unit.map_or([f64::MIN_POSITIVE, f64::MAX], |&(_, smallest, largest)| [smallest, largest])
    }

    /// The same parameter with its bounds limited to the physical range of its quantity.
    pub fn within_physics(&self) -> Parameter {
        let Some(quantity) = self.quantity() else { return self.clone() };
        let (min, max) = quantity.limits().physical;
        Parameter {
            lower: Some(self.lower.map_or(min, |lower| lower.max(min))),
            upper: Some(self.upper.map_or(max, |upper| upper.min(max))),
            ..self.clone()
        }
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
