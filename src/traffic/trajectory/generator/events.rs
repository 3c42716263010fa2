//! Random events of the traffic: lane changes and hard braking, and the factor on their rates.
//!
//! Both are hazards: a probability per time that depends on the surroundings. The raised rates apply from shortly
//! before the camera's view to its end; elsewhere the published rates apply. A raised hazard changes how often events
//! occur, not their shape.

use super::braking::Braking;
use super::lane_change::{Way, acceptance, motive};
use super::lateral::LaneChangeMotion;
use super::traffic::{DECISION_S, Traffic};
use super::vehicle::{centre_of, draw_line};
use crate::trajectory::VehicleClass;

/// Distance before the view at which the raised rates begin, so that changes are in progress at its edge.
const RAISED_BEFORE_M: f64 = 120.0;
/// Rate of lane changes with full motive and accepted gaps, 1/s. Set for the published 0.24 line crossings per vehicle
/// and kilometre at rate factor 1; with the fitted behaviour there are 0.18.
const LANE_CHANGES_PER_S: f64 = 0.175;
/// Maximum headway of a follower for which a vehicle counts as leader, s.
const FOLLOWER_WITHIN_S: f64 = 2.2;
/// Minimum speed at which a lane change begins, m/s.
const CHANGE_FROM_MPS: f64 = 5.0;
/// Minimum speed at which braking is scheduled, m/s.
const BRAKING_FROM_MPS: f64 = 22.0;
/// A vehicle that already decelerates more than this does not start a scheduled braking, m/s².
const BRAKING_ALREADY_MPS2: f64 = -0.6;

impl Traffic<'_> {
    /// Starts the lane changes and brakings of this step.
    pub(super) fn decide(&mut self) {
        for place in 0..self.order.len() {
            let i = self.order[place];
            // Decisions of drivers are spread over the steps.
            if !(self.step + i).is_multiple_of(self.decision_steps) {
                continue;
            }
            let s_m = self.vehicles[i].s_m;
            let in_view = s_m > -RAISED_BEFORE_M && s_m < self.options.window_m;
            let [brakings, lane_changes] = if in_view { self.hazards_in_view } else { [1.0; 2] };
            if self.vehicles[i].braking.is_none() && self.vehicles[i].change.is_none() {
                self.consider_braking(place, brakings);
                self.consider_lane_change(place, lane_changes);
            }
        }
    }

    fn consider_braking(&mut self, place: usize, factor: f64) {
        let own = &self.vehicles[self.order[place]];
        if own.speed_mps < BRAKING_FROM_MPS || own.acceleration_mps2 < BRAKING_ALREADY_MPS2 {
            return;
        }
        let follower = self.view(place, own.lane).behind;
        if follower.is_some_and(|f| f.gap_m < FOLLOWER_WITHIN_S * f.speed_mps)
            && self.decisions.chance(self.options.behaviour.brakings_per_s * factor * DECISION_S)
        {
            let braking = Braking::draw(&self.options.behaviour, &mut self.decisions);
            self.vehicles[self.order[place]].braking = Some(braking);
        }
    }

    fn consider_lane_change(&mut self, place: usize, factor: f64) {
        let i = self.order[place];
        let own = &self.vehicles[i];
        if own.settle_s > 0.0 || own.braking.is_some() || own.speed_mps < CHANGE_FROM_MPS {
            return;
        }
        let lane = own.lane;
        let here = self.view(place, lane);
        for way in [Way::Left, Way::Right] {
            let to = match way {
                Way::Left if lane > 0 => lane - 1,
                Way::Right if lane + 1 < self.lanes => lane + 1,
                _ => continue,
            };
            let own = &self.vehicles[i];
            // Trucks do not use the leftmost of three lanes.
            if own.class == VehicleClass::Truck && self.lanes > 2 && to == 0 {
                continue;
            }
            let there = self.view(place, to);
            let behaviour = &self.options.behaviour;
            let of_class = if own.class == VehicleClass::Truck { behaviour.truck_change_factor } else { 1.0 };
            let motive = motive(way, own.speed_mps, &own.driver, here, there.ahead);
            let rate = LANE_CHANGES_PER_S * of_class * motive;
            let accelerates = self.decisions.chance(behaviour.accelerating_fraction);
            let accepted = acceptance(own.speed_mps, there, accelerates, behaviour);
            if self.decisions.chance(rate * factor * accepted * DECISION_S) {
                self.start_lane_change(i, to, accelerates);
                return;
            }
        }
    }

    fn start_lane_change(&mut self, i: usize, to: usize, accelerates: bool) {
        let width = self.lane_width_m;
        let own = &mut self.vehicles[i];
        let target_m = draw_line(centre_of(to, width), width, own.width_m, &mut self.decisions);
        let (lanes, way_m) = ((own.lane, to), (own.line_m, target_m));
        let behaviour = &self.options.behaviour;
        let change = LaneChangeMotion::draw(lanes, way_m, own.class, accelerates, behaviour, &mut self.decisions);
        own.line_m = target_m;
        own.occupied |= 1 << to;
        own.change = Some(change);
    }
}
