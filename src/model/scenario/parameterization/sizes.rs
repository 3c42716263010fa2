//! Sizes of the vehicles of a case, and the case built from sizes and motions. Sizes are not parameters: S and S' use
//! the same ones, and points drawn from a density use the means of its scenarios.

use serde::{Deserialize, Serialize};

use crate::scenario::{Ahead, Case, Category, LANE_WIDTH_M, Lateral, Other, Participant, Scenario, Speed};
use lanesweep_support::{Error, Place, Result};

/// Length and width of one vehicle, m, > 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleSize {
    /// Length, m.
    pub length_m: f64,
    /// Width, m.
    pub width_m: f64,
}

/// Sizes of all vehicles of a case, and of the lanes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sizes {
    /// The ego.
    pub ego: VehicleSize,
    /// Cutter, cutting-out vehicle or leader.
    pub target: VehicleSize,
    /// Cut-out: the vehicle ahead of the cutting-out one.
    pub lead: Option<VehicleSize>,
    /// Width of the lanes, m.
    #[serde(default = "default_lane_width_m")]
    pub lane_width_m: f64,
}

pub(crate) fn default_lane_width_m() -> f64 {
    LANE_WIDTH_M
}

impl Sizes {
    /// The sizes in a mined scenario.
    pub fn of(scenario: &Scenario) -> Sizes {
        let size = |length_m: f64, width_m: f64| VehicleSize { length_m, width_m };
        Sizes {
            ego: size(scenario.ego.length, scenario.ego.width),
            target: size(scenario.target.length, scenario.target.width),
            lead: scenario.lead.as_ref().map(|lead| size(lead.length, lead.width)),
            lane_width_m: scenario.lane_width,
        }
    }

    /// Means over scenarios, in their order; for the vehicle ahead over those that have one. `None` without scenarios.
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
            lane_width_m: all.iter().map(|s| s.lane_width_m).sum::<f64>() / all.len() as f64,
        })
    }

    /// The case of vehicles with these sizes; `lead` is the speed of the vehicle ahead and the gap to it, m.
    ///
    /// # Errors
    /// [`Error::Input`] for a vehicle ahead without a size.
    pub(super) fn case(
        &self,
        category: Category,
        ego_speed_mps: f64,
        (speed, lateral): (Speed, Lateral),
        lead: Option<(Speed, f64)>,
        horizon_s: f64,
    ) -> Result<Case> {
        let participant = |size: VehicleSize, speed, lateral| Participant {
            length_m: size.length_m,
            width_m: size.width_m,
            speed,
            lateral,
        };
        let no_size = || {
            Error::input(
                Place::item("sizes"),
                "a cut-out needs the size of the vehicle ahead of the cutting-out one",
                "give the length and width of `lead`",
            )
        };
        let ahead = |(speed, gap_m)| -> Result<Ahead> {
            let vehicle = participant(self.lead.ok_or_else(no_size)?, speed, Lateral::Centred);
            Ok(Ahead { vehicle, gap_m })
        };
        Ok(Case {
            category,
            ego_length_m: self.ego.length_m,
            ego_width_m: self.ego.width_m,
            lane_width_m: self.lane_width_m,
            ego_speed_mps,
            principal: participant(self.target, speed, lateral),
            ahead: lead.map(ahead).transpose()?,
            horizon_s,
        })
    }
}

/// The vehicle ahead of a cut-out and its gap, m; fails for a scenario without them.
pub fn vehicle_ahead(scenario: &Scenario) -> Result<(&Other, f64)> {
    match (&scenario.lead, scenario.lead_gap) {
        (Some(lead), Some(gap)) => Ok((lead, gap)),
        _ => Err(Error::input(
            Place::item(format!("scenario {}", scenario.id)),
            "a cut-out needs the vehicle ahead of the cutting-out one",
            "give `lead` with its series and `D`, or leave this scenario out (`kept: false`)",
        )),
    }
}
