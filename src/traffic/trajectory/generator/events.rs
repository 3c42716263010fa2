//! What begins in the traffic at random: lane changes and hard brakings, and how their rates are raised.
//!
//! Both are hazards: a probability per time that depends on the surroundings. The raised rates hold from
//! shortly before the camera's view to its end; elsewhere traffic runs at the published rates. A raised
//! hazard makes an event come sooner or more often; what the event is like is drawn as always.

use super::braking::Braking;
use super::hazards::{DECISION_S, Hazards};
use super::lane_change::{Way, acceptance, motive_per_s};
use super::lateral::LaneChange;
use super::traffic::{Traffic, centre_of};
use super::vehicle::draw_line;
use crate::traffic::trajectory::VehicleClass;

/// The raised event rates begin this far before the view, so that changes are under way at its edge.
const RAISED_BEFORE_M: f64 = 120.0;
/// Scheduled hard brakings of one vehicle with a follower, 1/s, at rate factor 1. Calibrates the
/// published 482 decelerations above 2 m/s² of 109,986 egos' leaders.
const BRAKING_PER_S: f64 = 0.0012;
/// A follower within this headway makes a vehicle a leader whose braking matters, s.
const FOLLOWER_WITHIN_S: f64 = 2.2;
/// Slowest speed at which a braking is scheduled, m/s.
const BRAKING_FROM_MPS: f64 = 17.0;
/// Who already slows down more than this is not made to brake on top of it, m/s².
const BRAKING_ALREADY_MPS2: f64 = -0.6;

impl Traffic {
    /// Lane changes and brakings that begin now.
    pub(super) fn decide(&mut self) {
        for place in 0..self.order.len() {
            let i = self.order[place];
            // Drivers decide in turn, not all in the same step.
            if !(self.step + i).is_multiple_of(self.decision_steps) {
                continue;
            }
            let s_m = self.vehicles[i].s_m;
            let in_view = s_m > -RAISED_BEFORE_M && s_m < self.setting.window_m;
            let hazards = if in_view { self.hazards_in_view } else { Hazards::UNRAISED };
            if self.vehicles[i].braking.is_none() && self.vehicles[i].change.is_none() {
                self.consider_braking(place, hazards.brakings);
                self.consider_lane_change(place, hazards.lane_changes);
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
            && self.decisions.chance(BRAKING_PER_S * factor * DECISION_S)
        {
            let braking = Braking::draw(&mut self.decisions);
            self.vehicles[self.order[place]].braking = Some(braking);
        }
    }

    fn consider_lane_change(&mut self, place: usize, factor: f64) {
        let i = self.order[place];
        let own = &self.vehicles[i];
        if own.settle_s > 0.0 || own.braking.is_some() {
            return;
        }
        let lane = own.lane;
        let here = self.view(place, lane).ahead;
        for way in [Way::Left, Way::Right] {
            let to = match way {
                Way::Left if lane > 0 => lane - 1,
                Way::Right if lane + 1 < self.lanes => lane + 1,
                _ => continue,
            };
            let own = &self.vehicles[i];
            // Lorries keep off the leftmost of three lanes.
            if own.class == VehicleClass::Truck && self.lanes > 2 && to == 0 {
                continue;
            }
            let there = self.view(place, to);
            let rate = motive_per_s(way, own.speed_mps, &own.driver, here, there.ahead);
            let accepted = acceptance(own.speed_mps, there);
            if self.decisions.chance(rate * factor * accepted * DECISION_S) {
                self.start_lane_change(i, to);
                return;
            }
        }
    }

    fn start_lane_change(&mut self, i: usize, to: usize) {
        let width = self.setting.lane_width_m;
        let own = &mut self.vehicles[i];
        let target_m = draw_line(centre_of(to, width), width, own.width_m, &mut self.decisions);
        let change = LaneChange::draw(own.lane, to, own.line_m, target_m, &mut self.decisions);
        own.line_m = target_m;
        own.occupied |= 1 << to;
        own.change = Some(change);
    }
}
