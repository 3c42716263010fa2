//! One vehicle of the simulation: driver, size, state and recorded samples.

use super::braking::Braking;
use super::idm::DriverParameters;
use super::lateral::{LaneChangeMotion, Wander};
use super::random::TrafficRandom;
use crate::trajectory::{Track, VehicleClass};

/// Standard deviation of the drivers' lateral positions in their lane, m.
const LINE_SD_M: f64 = 0.18;

/// Lateral position of a lane's centre: the leftmost line is 0, left is positive.
pub(super) fn centre_of(lane: usize, lane_width_m: f64) -> f64 {
    -(lane as f64 + 0.5) * lane_width_m
}

/// A vehicle with its driver.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Vehicle {
    /// Car or truck.
    pub class: VehicleClass,
    /// Length, m.
    pub length_m: f64,
    /// Width, m.
    pub width_m: f64,
    /// The driver's car-following.
    pub driver: DriverParameters,
    /// Centre along the road, m; 0 where the camera's view begins.
    pub s_m: f64,
    /// Speed, m/s, ≥ 0.
    pub speed_mps: f64,
    /// Actual acceleration, m/s².
    pub acceleration_mps2: f64,
    /// Commanded acceleration, m/s²; the actual one follows with a short lag.
    pub command_mps2: f64,
    /// Correlated noise in the command, m/s².
    pub noise_mps2: f64,
    /// Present headway, s: the desired one, or a shorter one that is tolerated after a cut-in.
    pub headway_s: f64,
    /// Leader of the last step.
    pub leader: Option<usize>,
    /// The leader's acceleration as perceived (smoothed), m/s².
    pub perceived_mps2: f64,
    /// Lane that holds the centre, 0 the leftmost.
    pub lane: usize,
    /// Lanes it occupies or has claimed, one bit each.
    pub occupied: u8,
    /// Intended lateral position of its centre outside lane changes, m.
    pub line_m: f64,
    /// Deviation from it.
    pub wander: Wander,
    /// Lane change in progress.
    pub change: Option<LaneChangeMotion>,
    /// Scheduled braking in progress.
    pub braking: Option<Braking>,
    /// Time until the next lane change is possible, s.
    pub settle_s: f64,
    /// The camera's samples, by number: along the road from the start of its view, and to the left of the leftmost line.
    /// Size, class and lanes are not set.
    pub samples: Track,
}

impl Vehicle {
    /// Draws size and driver. `lane_speed_mps` is the mean desired speed of cars in this lane.
    pub(super) fn draw(
        class: VehicleClass,
        lane_speed_mps: f64,
        overreaction: f64,
        stream: &mut TrafficRandom,
    ) -> Vehicle {
        let (length_m, width_m) = match class {
            VehicleClass::Car => (stream.normal_within(4.6, 0.5, 3.4, 6.4), stream.normal_within(1.9, 0.09, 1.6, 2.2)),
            // Articulated and other trucks: two peaks that give the published 12 ± 4.7 m.
            VehicleClass::Truck if stream.chance(0.42) => {
                (stream.normal_within(16.3, 1.0, 13.5, 18.8), stream.normal_within(2.52, 0.05, 2.4, 2.6))
            }
            VehicleClass::Truck => {
                (stream.normal_within(8.9, 2.0, 5.5, 13.0), stream.normal_within(2.42, 0.12, 2.1, 2.6))
            }
        };
        let [desired_speed_mps, time_headway_s, acceleration_mps2, comfortable_mps2] = match class {
            VehicleClass::Car => [
                stream.normal_within(lane_speed_mps, 3.2, 24.0, 52.0),
                stream.lognormal_within(CAR_HEADWAY_S, HEADWAY_SIGMA, 0.45, 4.5),
                stream.lognormal_within(0.55, 0.25, 0.3, 1.2),
                stream.lognormal_within(1.5, 0.2, 0.9, 2.5),
            ],
            VehicleClass::Truck => [
                stream.normal_within(23.9, 0.9, 21.2, 26.5),
                stream.lognormal_within(TRUCK_HEADWAY_S, HEADWAY_SIGMA, 0.8, 4.5),
                stream.lognormal_within(0.45, 0.25, 0.2, 0.9),
                stream.lognormal_within(1.2, 0.2, 0.8, 2.0),
            ],
        };
        let driver = DriverParameters {
            desired_speed_mps,
            time_headway_s,
            standstill_gap_m: 3.4,
            acceleration_mps2,
            comfortable_mps2,
            overreaction,
        };
        Vehicle {
            class,
            length_m,
            width_m,
            driver,
            speed_mps: driver.desired_speed_mps,
            headway_s: driver.time_headway_s,
            ..Vehicle::default()
        }
    }

    /// Front bumper, m.
    pub(super) fn front_m(&self) -> f64 {
        self.s_m + 0.5 * self.length_m
    }

    /// Rear bumper, m.
    pub(super) fn rear_m(&self) -> f64 {
        self.s_m - 0.5 * self.length_m
    }

    /// Occupies or has claimed this lane.
    pub(super) fn is_in(&self, lane: usize) -> bool {
        self.occupied & (1 << lane) != 0
    }

    /// Lateral position and speed of the centre, m and m/s.
    pub(super) fn lateral(&self) -> (f64, f64) {
        let (line_m, rate_mps) = self.change.map_or((self.line_m, 0.0), |change| change.position_and_speed());
        (line_m + self.wander.offset_m, rate_mps + self.wander.rate_mps)
    }
}

/// Median time headway of car drivers, s. With the deviation below, the mean is the 1.5 s of the hierarchical IDM fit
/// on highD.
const CAR_HEADWAY_S: f64 = 1.30;
/// Median time headway of truck drivers, s.
const TRUCK_HEADWAY_S: f64 = 1.7;
/// Standard deviation of the headway's logarithm.
const HEADWAY_SIGMA: f64 = 0.5;

/// The intended lateral position in a lane: near the middle, with the whole body inside the lane.
pub(super) fn draw_line(centre_m: f64, lane_width_m: f64, width_m: f64, stream: &mut TrafficRandom) -> f64 {
    let room_m = (0.5 * (lane_width_m - width_m) - 0.3).max(0.05);
    centre_m + stream.normal_within(0.0, LINE_SD_M, -room_m, room_m)
}
