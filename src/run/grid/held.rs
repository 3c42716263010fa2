//! The numbers that all cells of a grid have in common, given or not.

use crate::model::profile::Profile;
use crate::scenario::{Category, LATERAL_DISTANCE_M};

use super::grid::{CaseStyle, Grid};
use super::jrc_case;
use super::parameter::MapQuantity;

impl Grid {
    /// Phrases such as `initial time headway 2 s`: the fixed values, then what no parameter of the grid sets.
    pub fn held(&self, profile: &Profile) -> Vec<String> {
        let number = |value: f64| format!("{}", (value * 1e6).round() / 1e6);
        let mut held: Vec<String> = (self.fixed().iter())
            .map(|(parameter, value)| {
                let mut label = parameter.label.to_owned();
                label[..1].make_ascii_lowercase();
                format!("{label} {} {}", number(*value), parameter.unit)
            })
            .collect();
        let (category, is_jrc) = (self.category(), self.style() != CaseStyle::Plain);
        let point = self.point(0);
        let sets = |quantity| point.get(quantity).is_some();
        if !sets(MapQuantity::OtherSpeed) {
            held.push("the other vehicle starts as fast as the ego".to_owned());
        }
        if !sets(MapQuantity::Deceleration) {
            held.push("the other vehicle keeps its speed".to_owned());
        } else if !sets(MapQuantity::EndSpeed) {
            held.push("the other vehicle decelerates to a standstill".to_owned());
        }
        if category == Category::CutOut && !sets(MapQuantity::AheadSpeed) {
            held.push("the vehicle ahead stands".to_owned());
        }
        if category != Category::Lvd && !sets(MapQuantity::LateralDistance) {
            let distance_m = match (is_jrc, category) {
                (false, _) => LATERAL_DISTANCE_M,
                (true, Category::CutOut) => jrc_case::CUT_OUT_LATERAL_M,
                (true, _) => jrc_case::CUT_IN_LATERAL_M,
            };
            held.push(format!("lateral distance {} m", number(distance_m)));
        }
        let size = |quantity, of_jrc_m: f64, of_profile_m: f64| {
            point.get(quantity).unwrap_or(if is_jrc { of_jrc_m } else { of_profile_m })
        };
        let length_m = size(MapQuantity::Length, jrc_case::LENGTH_M, profile.frame.default_length_m);
        let width_m = size(MapQuantity::Width, jrc_case::WIDTH_M, profile.frame.default_width_m);
        held.push(format!("vehicles {} m × {} m", number(length_m), number(width_m)));
        if is_jrc && category == Category::CutOut {
            held.push(format!("a standing vehicle ahead {} m long", number(jrc_case::STANDING_LENGTH_M)));
        }
        held.push(format!("time step {} s", number(profile.frame.dt_s)));
        held
    }
}
