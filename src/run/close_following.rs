//! Failures from close following: headways below [`CLOSE_HEADWAY_S`]. Drivers rarely follow so closely, so a failure
//! count dominated by such headways says little about how often a driver fails on the road.

use serde::Serialize;

use crate::engine::{CLOSE_HEADWAY_S, Headway, LanePlan, Partial};
use crate::model::criterion::Criterion;
use crate::scenario::Scenario;
use crate::{Error, Result};

/// Lanes and failures, in total and from headways below [`CLOSE_HEADWAY_S`].
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct CloseFollowing {
    /// Lanes per driver model that start below it.
    pub close_lanes: u64,
    /// Lanes per driver model.
    pub lanes: u64,
    /// Failures that start below it, and all failures: model × criterion, the last innermost.
    pub failures: Vec<[u64; 2]>,
}

/// Units of a block with a recorded headway below [`CLOSE_HEADWAY_S`]; `kept` are its scenarios in order.
pub fn close_units<'a>(kept: impl Iterator<Item = &'a Scenario>) -> Vec<u64> {
    let is_close = |scenario: &Scenario| scenario.start_headway_s().is_some_and(|thw_s| thw_s < CLOSE_HEADWAY_S);
    kept.zip(0..).filter(|(scenario, _)| is_close(scenario)).map(|(_, unit)| unit).collect()
}

impl CloseFollowing {
    /// Counts of the recorded scenarios (S) of a block. `close_units` are those of [`close_units`], for a plan that
    /// starts from the recorded gaps. `None` for a plan of gaps in metres.
    ///
    /// # Errors
    /// [`Error::Internal`] if the counts are not those of the whole plan.
    pub fn of_recorded(
        plan: &LanePlan,
        partial: &Partial,
        block: usize,
        close_units: &[u64],
    ) -> Result<Option<CloseFollowing>> {
        let (of, cells) = (&plan.blocks[block], plan.models.len() * Criterion::ALL.len());
        let by_headway = partial.headway_failures(plan, block)?;
        let mut failures = vec![[0; 2]; cells];
        let mut close_lanes = 0;
        for (headway, by_cell) in plan.headways.iter().zip(by_headway.chunks(cells)) {
            let is_close = match headway {
                Headway::ThwS(thw_s) => *thw_s < CLOSE_HEADWAY_S,
                // At least 0.74 s at any speed.
                Headway::MinFollowing => false,
                Headway::Observed => false,
                Headway::GapM(_) => return Ok(None),
            };
            close_lanes += if is_close { of.units.len() } else { 0 };
            for ([close, all], failed) in failures.iter_mut().zip(by_cell) {
                *close += if is_close { *failed } else { 0 };
                *all += failed;
            }
        }
        if Headway::is_observed(&plan.headways) {
            close_lanes = close_units.len() as u64;
            for unit in close_units {
                let unit = usize::try_from(of.first_unit + unit).ok().and_then(|unit| partial.units().get(unit));
                let unit =
                    unit.ok_or_else(|| Error::Internal("a close scenario is not among the counts".to_owned()))?;
                // Variant 0 is S against itself.
                failures.iter_mut().zip(&unit.cells).for_each(|([close, _], cell)| *close += u64::from(cell.tp));
            }
        }
        let lanes = of.units.len() * plan.headways.len() as u64;
        Ok(Some(CloseFollowing { close_lanes, lanes, failures }))
    }
}
