//! The upstream end of the road: the arrivals per lane.

use super::options::GeneratorOptions;
use super::random::TrafficRandom;
use super::vehicle::{Vehicle, centre_of, draw_line};
use crate::trajectory::VehicleClass;

/// Fraction of arrivals that follow the previous vehicle at their desired headway, at the published flow or more; the
/// others arrive freely.
const FOLLOWERS: f64 = 0.8;
/// The published flow per direction, vehicles per hour.
const PUBLISHED_FLOW_VEHPH: f64 = 3350.0;
/// Maximum braking with which an arrival approaches the vehicle ahead, m/s². Vehicles have followed each other before
/// they arrive, so their speeds are similar.
const APPROACH_MPS2: f64 = 0.025;
/// Mean number of lanes per direction in the default mix of roads: the published flow refers to it; other roads scale
/// with their lanes.
const MEAN_LANES: f64 = 8.0 / 3.0;
/// Some arrivals wait for space; this factor on the demand compensates for them.
const QUEUED: f64 = 1.035;

/// Arrivals of one lane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LaneDemand {
    /// Mean time between vehicles, s.
    mean_headway_s: f64,
    /// Fraction of followers.
    followers: f64,
    truck_fraction: f64,
    /// Mean desired speed of cars in this lane, m/s.
    car_speed_mps: f64,
    /// Overreaction of its drivers.
    overreaction: f64,
    /// Index and width of the lane.
    lane: usize,
    lane_width_m: f64,
}

/// The demand of every lane of a carriageway, leftmost first. `flow_level`, `truck_level` and `speed_level` (about 1)
/// vary between recordings.
pub(super) fn demand(
    options: &GeneratorOptions,
    (lanes, lane_width_m): (usize, f64),
    [flow_level, truck_level, speed_level]: [f64; 3],
) -> Vec<LaneDemand> {
    // Fractions of the flow and of the trucks, and desired car speeds, from the leftmost lane. The speeds are above the
    // published peak of 33 m/s, because most cars drive behind others.
    let (flow, trucks, speeds): (&[f64], &[f64], &[f64]) = match lanes {
        2 => (&[0.57, 0.43], &[0.02, 0.98], &[40.0, 34.0]),
        _ => (&[0.37, 0.38, 0.25], &[0.0, 0.06, 0.94], &[41.0, 38.0, 34.0]),
    };
    let total_vehph = QUEUED * options.flow_vehph * flow_level * lanes as f64 / MEAN_LANES;
    let truck_fraction = (options.truck_fraction * truck_level).min(0.6);
    (0..lanes)
        .map(|lane| {
            let lane_vehph = total_vehph * flow[lane];
            LaneDemand {
                mean_headway_s: 3600.0 / lane_vehph,
                followers: FOLLOWERS * (options.flow_vehph / PUBLISHED_FLOW_VEHPH).min(1.0),
                truck_fraction: (truck_fraction * trucks[lane] / flow[lane]).min(0.95),
                car_speed_mps: speeds[lane] * speed_level * options.behaviour.car_speed_factor,
                overreaction: options.behaviour.overreaction,
                lane,
                lane_width_m,
            }
        })
        .collect()
}

/// The queue before one lane: the next vehicle and its arrival time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Inflow {
    demand: LaneDemand,
    due_s: f64,
    next: Vehicle,
}

impl Inflow {
    /// The queue of an empty lane.
    pub(super) fn new(demand: LaneDemand, stream: &mut TrafficRandom) -> Inflow {
        let next = draw(&demand, stream);
        let due_s = stream.between(0.0, 2.0 * demand.mean_headway_s);
        Inflow { demand, due_s, next }
    }

    /// The next vehicle, if it is due and has space behind the last one of its lane (`last`: rear bumper and speed),
    /// at `entrance_m`.
    pub(super) fn arrive(
        &mut self,
        now_s: f64,
        entrance_m: f64,
        last: Option<(f64, f64)>,
        stream: &mut TrafficRandom,
    ) -> Option<Vehicle> {
        if now_s < self.due_s {
            return None;
        }
        let driver = self.next.driver;
        let mut speed_mps = driver.desired_speed_mps;
        if let Some((rear_m, last_mps)) = last {
            let gap_m = rear_m - entrance_m - 0.5 * self.next.length_m;
            let spare_m = gap_m - driver.standstill_gap_m - 0.8 * driver.time_headway_s * last_mps;
            if spare_m < 0.0 {
                return None;
            }
            speed_mps = speed_mps.min(last_mps + (2.0 * APPROACH_MPS2 * spare_m).sqrt());
        }
        let mut vehicle = std::mem::replace(&mut self.next, draw(&self.demand, stream));
        vehicle.s_m = entrance_m;
        vehicle.speed_mps = speed_mps;
        self.due_s = self.due_s.max(now_s - 5.0) + self.headway_s(speed_mps, stream);
        Some(vehicle)
    }

    /// Time from one arrival to the next: the following headway, plus an exponential part for free arrivals that
    /// restores the mean.
    fn headway_s(&self, speed_mps: f64, stream: &mut TrafficRandom) -> f64 {
        let own_s = |driver_s: f64, length_m: f64| driver_s + (length_m + 3.4) / speed_mps.max(10.0);
        let following_s = own_s(self.next.driver.time_headway_s, self.next.length_m);
        let share = self.demand.truck_fraction;
        let mean_following_s = (1.0 - share) * own_s(1.5, 4.6) + share * own_s(1.85, 12.0);
        let free_s = (self.demand.mean_headway_s - mean_following_s) / (1.0 - self.demand.followers);
        if free_s <= 0.0 || stream.chance(self.demand.followers) {
            following_s
        } else {
            following_s + stream.exponential(free_s)
        }
    }
}

fn draw(demand: &LaneDemand, stream: &mut TrafficRandom) -> Vehicle {
    let class = if stream.chance(demand.truck_fraction) { VehicleClass::Truck } else { VehicleClass::Car };
    let mut vehicle = Vehicle::draw(class, demand.car_speed_mps, demand.overreaction, stream);
    vehicle.lane = demand.lane;
    vehicle.occupied = 1 << demand.lane;
    let (lane_m, width_m) = (demand.lane_width_m, vehicle.width_m);
    vehicle.line_m = draw_line(centre_of(demand.lane, lane_m), lane_m, width_m, stream);
    vehicle
}
