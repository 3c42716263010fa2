//! The simulation of one carriageway: a straight road, longer than the camera's view, with vehicles that
//! arrive upstream, follow, change lanes, brake and leave downstream. All decisions and accelerations of
//! a step read the state at its start; then every vehicle moves.

use super::idm::{HARDEST_BRAKING_MPS2, LeaderView, following_acceleration, free_acceleration};
use super::inflow::{Inflow, LaneDemand};
use super::lane_change::{LaneView, Neighbour};
use super::options::GeneratorOptions;
use super::random::{Purpose, TrafficRandom};
use super::vehicle::{Vehicle, centre_of};
use crate::trajectory::VehicleClass;

/// Time between two decisions of one driver, s.
pub(super) const DECISION_S: f64 = 0.2;
/// Minimum time from the end of a lane change to the next decision, s.
const SETTLE_S: f64 = 4.0;
/// Lane changes obstruct each other: to raise their rate by a factor f, their hazard is multiplied by f to this
/// power.
const CROWDING: f64 = 1.56;

/// Road before the camera's view, m. Followers need this distance to settle behind their leaders. On a longer road,
/// vehicles would be sorted by speed before they enter the view.
const UPSTREAM_M: f64 = 350.0;
/// Road behind it, m, so that the last vehicles in view still have leaders.
const DOWNSTREAM_M: f64 = 250.0;
/// Standard deviation of the commanded acceleration noise, m/s². After the lag below it is 0.22, the middle of the
/// published 0.20 to 0.24.
const NOISE_SD_MPS2: f64 = 0.24;
/// Published correlation time of the noise, s.
const NOISE_CORRELATION_S: f64 = 1.2;
/// Lag from the command to the vehicle's acceleration, s (pedal, drivetrain, brakes).
const ACTUATION_LAG_S: f64 = 0.25;
/// Time constant with which drivers perceive the leader's acceleration, s.
const PERCEPTION_S: f64 = 0.6;
/// Time constant with which a headway opens after a cut-in, s.
const RELAXATION_S: f64 = 15.0;
/// Shortest headway tolerated right after a cut-in, s.
const TOLERATED_HEADWAY_S: f64 = 0.25;
/// Fraction of the headway that a driver keeps before leaving the leader's lane.
const LEAVING_HEADWAY: f64 = 0.5;
/// Speed at which the road fills before the recording, m/s: slower than most trucks.
const FILLING_MPS: f64 = 21.0;
/// Speed up to which drivers of cars accelerate during a lane change, as a factor on their desired speed. Trucks have
/// limiters.
const EXCEEDING: f64 = 1.5;
/// Free space ahead that they need: length, time headway and time to collision.
const ROOM_M: f64 = 3.0;
const ROOM_HEADWAY_S: f64 = 0.3;
const ROOM_TTC_S: f64 = 4.0;

/// One carriageway.
pub(super) struct Traffic<'a> {
    pub(super) options: &'a GeneratorOptions,
    pub(super) lane_width_m: f64,
    /// Time step, s.
    step_s: f64,
    pub(super) lanes: usize,
    pub(super) vehicles: Vec<Vehicle>,
    /// Vehicles on the road, front first.
    pub(super) order: Vec<usize>,
    inflows: Vec<Inflow>,
    arrivals: TrafficRandom,
    noise: TrafficRandom,
    pub(super) decisions: TrafficRandom,
    pub(super) step: usize,
    pub(super) decision_steps: usize,
    /// Factors on the hazards of brakings and of lane changes in view.
    pub(super) hazards_in_view: [f64; 2],
    /// Factors of one step of the noise, the lag, the perception and the relaxation.
    noise_keep: f64,
    noise_kick: f64,
    lag: f64,
    perception: f64,
    relaxation: f64,
}

impl<'a> Traffic<'a> {
    /// An empty road. `key` is (recording, carriageway).
    pub(super) fn new(
        options: &'a GeneratorOptions,
        lane_width_m: f64,
        demand: Vec<LaneDemand>,
        key: (usize, usize),
    ) -> Traffic<'a> {
        let stream = |purpose| TrafficRandom::new(options.seed, key.0, key.1, purpose);
        let mut arrivals = stream(Purpose::Inflow);
        let lanes = demand.len();
        let inflows = demand.into_iter().map(|demand| Inflow::new(demand, &mut arrivals)).collect();
        let dt = 1.0 / (options.frame_rate_hz * options.steps_per_sample() as f64);
        let keep = libm::exp(-dt / NOISE_CORRELATION_S);
        let raised = options.event_rate_factor;
        Traffic {
            lanes,
            vehicles: Vec::new(),
            order: Vec::new(),
            inflows,
            arrivals,
            noise: stream(Purpose::Noise),
            decisions: stream(Purpose::Decision),
            step: 0,
            decision_steps: ((DECISION_S / dt).round() as usize).max(1),
            noise_keep: keep,
            noise_kick: NOISE_SD_MPS2 * (1.0 - keep * keep).sqrt(),
            lag: 1.0 - libm::exp(-dt / ACTUATION_LAG_S),
            perception: 1.0 - libm::exp(-dt / PERCEPTION_S),
            relaxation: 1.0 - libm::exp(-dt / RELAXATION_S),
            // There is no crowding below the published rates.
            hazards_in_view: [raised, if raised > 1.0 { libm::pow(raised, CROWDING) } else { raised }],
            options,
            lane_width_m,
            step_s: dt,
        }
    }

    /// Runs until the road is full, then for the samples of a recording. Returns the camera's samples of each vehicle, in
    /// the order of arrival.
    pub(super) fn run(mut self) -> Vec<Vehicle> {
        // Warm-up: the slowest trucks pass the whole road once.
        let warm_up_s = (UPSTREAM_M + self.options.window_m + DOWNSTREAM_M) / FILLING_MPS;
        let warm_up = (warm_up_s / self.step_s).ceil() as usize;
        let steps_per_sample = self.options.steps_per_sample();
        let steps = warm_up + (self.options.samples().max(1) - 1) * steps_per_sample + 1;
        for step in 0..steps {
            self.inject();
            self.sort();
            self.decide();
            self.accelerate();
            let since = step.checked_sub(warm_up);
            let sample = since.filter(|s| s.is_multiple_of(steps_per_sample));
            self.advance(sample.map(|s| s / steps_per_sample));
        }
        self.vehicles.retain(|vehicle| !vehicle.samples.is_empty());
        self.vehicles
    }

    fn inject(&mut self) {
        let now_s = self.step as f64 * self.step_s;
        for lane in 0..self.lanes {
            let last = self.order.iter().rev().find(|&&i| self.vehicles[i].is_in(lane));
            let last = last.map(|&i| (self.vehicles[i].rear_m(), self.vehicles[i].speed_mps));
            if let Some(vehicle) = self.inflows[lane].arrive(now_s, -UPSTREAM_M, last, &mut self.arrivals) {
                self.order.push(self.vehicles.len());
                self.vehicles.push(vehicle);
            }
        }
    }

    /// Sorts vehicles front first. The order hardly changes between steps, so insertion sort is linear; ties keep the
    /// order of arrival.
    fn sort(&mut self) {
        for k in 1..self.order.len() {
            let moving = self.order[k];
            let mut place = k;
            while place > 0 && self.vehicles[self.order[place - 1]].s_m < self.vehicles[moving].s_m {
                self.order[place] = self.order[place - 1];
                place -= 1;
            }
            self.order[place] = moving;
        }
    }

    /// Next vehicles ahead of and behind the vehicle at this position of the order, in a lane.
    pub(super) fn view(&self, place: usize, lane: usize) -> LaneView {
        let own = &self.vehicles[self.order[place]];
        let vehicle = |k: &usize| &self.vehicles[*k];
        let ahead = self.order[..place].iter().rev().map(vehicle).find(|v| v.is_in(lane));
        let behind = self.order[place + 1..].iter().map(vehicle).find(|v| v.is_in(lane));
        LaneView {
            ahead: ahead.map(|v| Neighbour { gap_m: v.rear_m() - own.front_m(), speed_mps: v.speed_mps }),
            behind: behind.map(|v| Neighbour { gap_m: own.rear_m() - v.front_m(), speed_mps: v.speed_mps }),
        }
    }

    /// Computes the commands of all drivers, front first.
    fn accelerate(&mut self) {
        let mut last_in: [Option<usize>; 8] = [None; 8];
        for place in 0..self.order.len() {
            let i = self.order[place];
            let own = &self.vehicles[i];
            let target_lane = own.change.map_or(own.lane, |change| change.to_lane);
            let leader = last_in[target_lane];
            let driver = own.driver;
            let view_of = |k: usize, perceived_mps2: f64| {
                let v = &self.vehicles[k];
                let gap_m = v.rear_m() - own.front_m();
                LeaderView { gap_m, speed_mps: v.speed_mps, acceleration_mps2: perceived_mps2 }
            };

            // The driver tolerates a short distance to a new leader (after a cut-in or a lane change).
            let mut headway_s = own.headway_s + (own.driver.time_headway_s - own.headway_s) * self.relaxation;
            let mut perceived = own.perceived_mps2;
            if let Some(k) = leader {
                let leader_now = self.vehicles[k].acceleration_mps2;
                if own.leader != leader {
                    let gap_m = view_of(k, 0.0).gap_m - own.driver.standstill_gap_m;
                    let found_s = (gap_m / own.speed_mps.max(1.0)).max(TOLERATED_HEADWAY_S);
                    headway_s = headway_s.min(found_s);
                    perceived = leader_now.min(0.0);
                }
                perceived += (leader_now - perceived) * self.perception;
            }

            // During a lane change the driver keeps a smaller headway.
            let kept = own.change.map_or(1.0, |_| self.options.behaviour.change_headway_fraction);
            let kept_s = kept * headway_s;
            let mut command = leader.map_or_else(
                || free_acceleration(own.speed_mps, &driver),
                |k| following_acceleration(own.speed_mps, kept_s, view_of(k, perceived), &driver),
            );
            if let Some(change) = own.change
                && own.is_in(change.from_lane)
                && let Some(k) = last_in[change.from_lane]
                && leader != Some(k)
            {
                let view = view_of(k, self.vehicles[k].acceleration_mps2);
                let kept_s = LEAVING_HEADWAY * headway_s;
                command = command.min(following_acceleration(own.speed_mps, kept_s, view, &driver));
            }
            if let Some(change) = own.change
                && let Some(acceleration_mps2) = change.acceleration_mps2
            {
                let room = |k: usize| {
                    let LeaderView { gap_m, speed_mps, .. } = view_of(k, 0.0);
                    let closing_mps = own.speed_mps - speed_mps;
                    gap_m > ROOM_M + ROOM_HEADWAY_S * own.speed_mps && gap_m > ROOM_TTC_S * closing_mps
                };
                let old = if own.is_in(change.from_lane) { last_in[change.from_lane] } else { None };
                let max_fraction = if own.class == VehicleClass::Truck { 1.0 } else { EXCEEDING };
                let slow = own.speed_mps < max_fraction * own.driver.desired_speed_mps;
                if leader.is_none_or(room) && old.is_none_or(room) && slow {
                    command = command.max(acceleration_mps2);
                }
            }
            if let Some(braking) = own.braking {
                command = command.min(braking.acceleration());
            }
            let occupied = own.occupied;
            let own = &mut self.vehicles[i];
            own.headway_s = headway_s;
            own.perceived_mps2 = perceived;
            own.leader = leader;
            own.command_mps2 = (command + own.noise_mps2).max(-HARDEST_BRAKING_MPS2);
            for (lane, slot) in last_in.iter_mut().enumerate().take(self.lanes) {
                if occupied & (1 << lane) != 0 {
                    *slot = Some(i);
                }
            }
        }
    }

    /// Writes the sample, if this step is one, and moves every vehicle by one step.
    fn advance(&mut self, sample: Option<usize>) {
        let dt = self.step_s;
        let width = self.lane_width_m;
        for &i in &self.order {
            let own = &mut self.vehicles[i];
            let mut a = own.acceleration_mps2 + (own.command_mps2 - own.acceleration_mps2) * self.lag;
            if own.speed_mps + a * dt < 0.0 {
                a = -own.speed_mps / dt;
            }
            own.acceleration_mps2 = a;
            let (d_m, v_d_mps) = own.lateral();
            if let Some(sample) = sample
                && (0.0..=self.options.window_m).contains(&own.s_m)
            {
                let samples = &mut own.samples;
                if samples.is_empty() {
                    samples.first_frame = sample as i64;
                }
                samples.s_m.push(own.s_m);
                samples.d_m.push(d_m);
                samples.v_s_mps.push(own.speed_mps);
                samples.v_d_mps.push(v_d_mps);
                samples.a_s_mps2.push(a);
            }

            own.s_m += own.speed_mps * dt + 0.5 * a * dt * dt;
            own.speed_mps = (own.speed_mps + a * dt).max(0.0);
            own.noise_mps2 = own.noise_mps2 * self.noise_keep + self.noise_kick * self.noise.normal();
            own.wander.step(dt, self.noise.normal());
            own.settle_s = (own.settle_s - dt).max(0.0);
            if let Some(braking) = &mut own.braking {
                braking.elapsed_s += dt;
                if braking.is_over() {
                    own.braking = None;
                }
            }
            if let Some(change) = &mut own.change {
                change.elapsed_s += dt;
                let (d_m, _) = change.position_and_speed();
                own.lane = lane_of(d_m, width, self.lanes);
                // The old lane is free when the whole body has left it.
                let from_m = centre_of(change.from_lane, width);
                if (d_m - from_m).abs() > 0.5 * (width + own.width_m) + 0.1 {
                    own.occupied = 1 << change.to_lane;
                }
                if change.phase() >= 1.0 {
                    own.occupied = 1 << change.to_lane;
                    own.lane = change.to_lane;
                    own.change = None;
                    own.settle_s = SETTLE_S;
                }
            }
        }
        let end_m = self.options.window_m + DOWNSTREAM_M;
        let vehicles = &self.vehicles;
        self.order.retain(|&i| vehicles[i].s_m < end_m);
        self.step += 1;
    }
}

fn lane_of(d_m: f64, lane_width_m: f64, lanes: usize) -> usize {
    ((-d_m / lane_width_m).floor().max(0.0) as usize).min(lanes - 1)
}
