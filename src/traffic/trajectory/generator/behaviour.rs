//! The numbers of the generator on which the failures of recorded scenarios depend most.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    pub accelerating_fraction: f64,
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
    pub change_headway_fraction: f64,
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
            accelerating_fraction: 0.0464,
            accelerating_follower_braking_mps2: 9.0,
            change_acceleration_mps2: 2.35,
            change_duration_s: 6.45,
            truck_change_factor: 1.2,
            change_headway_fraction: 0.203,
            brakings_per_s: 0.00009,
            braking_hold_s: 9.0,
            braking_excess_mps2: 0.543,
            overreaction: 0.226,
        }
    }
}
