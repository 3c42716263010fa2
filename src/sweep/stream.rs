//! A stream of lanes through the slots of the batches: where a lane is over, its slot takes the next one after the
//! burst, so no lane waits for another and nothing is allocated per lane.

use crate::driver::DriverModel;

use super::batch::{BATCHES, Batch, Fleet, Slots};
use super::batch_arrays::LANES;
use super::frame::{Simulation, Start};
use super::lane_case::LaneCase;
use super::lane_step::{LaneConstants, LaneState, conclude};
use super::outcome::Outcome;
use super::series::VehicleTracks;

/// A lane that waits for a slot.
#[derive(Clone, Copy)]
pub(super) struct Waiting<'c> {
    /// Its case.
    pub case: &'c LaneCase<f32>,
    /// The motions of its case, unrolled.
    pub tracks: &'c [VehicleTracks; 2],
    /// Its headway.
    pub start: Start<f32>,
    /// Where its outcome belongs.
    pub at: usize,
}

/// Runs a stream of lanes of one model; `next` gives the lanes, `entries` the series that they point into, `steps` is
/// a [`burst`](super::batch::burst), `each` takes the outcomes, in the order in which lanes end.
pub(super) fn run_stream<'c, M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    is_pair: bool,
    entries: &[f32],
    steps: impl Fn(&mut Fleet, &[f32]) -> Slots,
    mut next: impl FnMut() -> Option<Waiting<'c>>,
    mut each: impl FnMut(usize, Outcome<f32>),
) {
    let vehicles = if is_pair { 2 } else { 1 };
    // Gives a slot the next lane, where there is one.
    let mut admit = |batch: &mut Batch, k: usize| {
        let Waiting { case, tracks, start, at } = next()?;
        let state = LaneState::new(simulation, case, start);
        batch.admit(k, &LaneConstants::new(simulation, case), &state, tracks, entries, vehicles);
        Some(at)
    };
    let mut fleet: Fleet = [Batch::IDLE; BATCHES];
    let mut at = [[0; LANES]; BATCHES];
    let mut used: Slots = [0; BATCHES];
    for ((batch, at), used) in fleet.iter_mut().zip(&mut at).zip(&mut used) {
        for (k, at) in at.iter_mut().enumerate() {
            let Some(lane) = admit(batch, k) else { break };
            *at = lane;
            *used |= 1 << k;
        }
    }
    while used != [0; BATCHES] {
        let finished = steps(&mut fleet, entries);
        for (b, batch) in fleet.iter_mut().enumerate() {
            let mut finished = finished[b] & used[b];
            while finished != 0 {
                let k = finished.trailing_zeros() as usize;
                finished &= finished - 1;
                let (constants, state, places) = batch.last_step(k);
                each(at[b][k], conclude(simulation, is_pair, &constants, &state, &places));
                match admit(batch, k) {
                    Some(lane) => at[b][k] = lane,
                    None => {
                        batch.idle(k);
                        used[b] &= !(1 << k);
                    }
                }
            }
        }
    }
}
