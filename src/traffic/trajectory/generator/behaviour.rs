//! The numbers of the generator on which the failures of recorded scenarios depend most.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::support::error::{Error, Place, Result};

/// How drivers change lanes and brake. Rates and shares are those at rate factor 1.
///
/// The defaults are fitted to the paper's 36 shares of failures of S and to published traffic figures
/// (`examples/calibrate_generator.rs`, which also prints what other numbers give); four were then moved by hand. The fit
/// never saw an F1, a claim of the paper or the seed of the default recordings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Behaviour {
    /// Factor on the desired speeds of cars.
    #[schemars(range(min = 0.5, max = 1.5))]
    pub car_speed_factor: f64,
    /// Braking of the new follower that reduces the acceptance of a gap by a factor e, m/s².
    #[schemars(range(min = 0.001, max = 10.0))]
    pub follower_braking_mps2: f64,
    /// Share of decisions by a driver who accelerates during the change and lets a faster follower brake, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub accelerating_share: f64,
    /// The same braking of the new follower, for such a driver, m/s².
    #[schemars(range(min = 0.001, max = 10.0))]
    pub accelerating_follower_braking_mps2: f64,
    /// Mean acceleration of such a driver during the change where there is room, before values outside of 0 to 2.8 m/s² are
    /// drawn again, m/s².
    #[schemars(range(min = 0.0, max = 2.8))]
    pub change_acceleration_mps2: f64,
    /// Median duration of lane changes, before those outside of the published 2.9 to 7.3 s are left out, s.
    #[schemars(range(min = 2.9, max = 7.3))]
    pub change_duration_s: f64,
    /// Factor on the rate at which trucks change lanes.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub truck_change_factor: f64,
    /// Fraction of the time headway that a driver keeps to the new leader during a lane change.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub change_headway_share: f64,
    /// Rate of hard brakings of a vehicle with a follower, 1/s.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub brakings_per_s: f64,
    /// Median time for which a hard braking is held, s.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub braking_hold_s: f64,
    /// Mean excess of its peak over 2 m/s², m/s².
    #[schemars(range(min = 0.0, max = 5.0))]
    pub braking_excess_mps2: f64,
    /// How much harder than needed a driver brakes where the gap is too short, as a fraction of the comfortable
    /// deceleration.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub overreaction: f64,
}

impl Default for Behaviour {
    fn default() -> Self {
        Behaviour {
            car_speed_factor: 0.896,
            follower_braking_mps2: 0.00556,
            accelerating_share: 0.0464,
            accelerating_follower_braking_mps2: 9.0,
            change_acceleration_mps2: 2.35,
            change_duration_s: 6.45,
            truck_change_factor: 1.2,
            change_headway_share: 0.203,
            brakings_per_s: 0.00009,
            braking_hold_s: 9.0,
            braking_excess_mps2: 0.543,
            overreaction: 0.226,
        }
    }
}

impl Behaviour {
    /// Checks every number; the error names the first one outside its range.
    pub fn validate(&self) -> Result<()> {
        let ranges = [
            ("car_speed_factor", self.car_speed_factor, 0.5, 1.5),
            ("follower_braking_mps2", self.follower_braking_mps2, 0.001, 10.0),
            ("accelerating_share", self.accelerating_share, 0.0, 1.0),
            ("accelerating_follower_braking_mps2", self.accelerating_follower_braking_mps2, 0.001, 10.0),
            ("change_acceleration_mps2", self.change_acceleration_mps2, 0.0, 2.8),
            ("change_duration_s", self.change_duration_s, 2.9, 7.3),
            ("truck_change_factor", self.truck_change_factor, 0.0, 20.0),
            ("change_headway_share", self.change_headway_share, 0.0, 1.0),
            ("brakings_per_s", self.brakings_per_s, 0.0, 1.0),
            ("braking_hold_s", self.braking_hold_s, 0.1, 60.0),
            ("braking_excess_mps2", self.braking_excess_mps2, 0.0, 5.0),
            ("overreaction", self.overreaction, 0.0, 2.0),
        ];
        check_ranges("generator.behaviour", &ranges)
    }
}

/// The error names the first (name, value, minimum, maximum) of a table that is outside its range.
pub(super) fn check_ranges(table: &str, ranges: &[(&str, f64, f64, f64)]) -> Result<()> {
    for (name, value, low, high) in ranges {
        // NaN is in no range.
        if !(low..=high).contains(&value) {
            return Err(Error::usage(
                Place::item(format!("{table}.{name}")),
                format!("{value} is outside {low} to {high}"),
                format!("choose a value from {low} to {high}"),
            ));
        }
    }
    Ok(())
}
