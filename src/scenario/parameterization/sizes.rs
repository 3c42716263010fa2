//! Lengths and widths of the vehicles of a case. Sizes are no parameters: S and S' share them, and points drawn
//! from a density take the means of its scenarios.

use serde::{Deserialize, Serialize};

use crate::scenario::Scenario;

/// Length and width of one vehicle, m, > 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleSize {
    /// Length, m.
    pub length_m: f64,
    /// Width, m.
    pub width_m: f64,
}

/// Sizes of all vehicles of a case.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sizes {
    /// The ego.
    pub ego: VehicleSize,
    /// Cutter, cutting-out vehicle or leader.
    pub target: VehicleSize,
    /// Cut-out: the vehicle ahead of the cutting-out one.
    pub lead: Option<VehicleSize>,
}

impl Sizes {
    /// Those of a mined scenario.
    pub fn of(scenario: &Scenario) -> Sizes {
        let size = |length_m: f64, width_m: f64| VehicleSize { length_m, width_m };
        Sizes {
            ego: size(scenario.ego.length, scenario.ego.width),
            target: size(scenario.target.length, scenario.target.width),
            lead: scenario.lead.as_ref().map(|lead| size(lead.length, lead.width)),
        }
    }

    /// Means over scenarios, in their order; of the vehicle ahead over those that have one. `None` without
    /// scenarios.
    pub fn mean<'a>(scenarios: impl IntoIterator<Item = &'a Scenario>) -> Option<Sizes> {
        let all: Vec<Sizes> = scenarios.into_iter().map(Sizes::of).collect();
        let mean = |sizes: Vec<VehicleSize>| {
            let n = sizes.len() as f64;
            (!sizes.is_empty()).then(|| VehicleSize {
                length_m: sizes.iter().map(|s| s.length_m).sum::<f64>() / n,
                width_m: sizes.iter().map(|s| s.width_m).sum::<f64>() / n,
            })
        };
        Some(Sizes {
            ego: mean(all.iter().map(|s| s.ego).collect())?,
            target: mean(all.iter().map(|s| s.target).collect())?,
            lead: mean(all.iter().filter_map(|s| s.lead).collect()),
        })
    }
}
