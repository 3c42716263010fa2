//! A stream of lanes through the slots of the batches: where a lane is over, its slot takes the next one after the
//! burst, so no lane waits for another and nothing is allocated per lane.

use crate::driver::DriverModel;

use super::batch::{BATCHES, Batch, Fleet};
use super::batch_arrays::LANES;
use super::frame::Simulation;
use super::waiting::{Lanes, Waiting};

/// Runs a stream of lanes of one model; `values`: continuous ones are wanted, not verdicts alone. `steps` is a
/// [`burst`](super::batch::burst), `each` takes the lanes after their last steps, in the order in which they end: the
/// lane, counted within the stream, its batch and its slot.
pub(super) fn run_stream<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    stream: &Lanes<'_>,
    values: bool,
    entries: &[f32],
    steps: impl Fn(&mut Fleet<'_>, &mut Waiting),
    mut each: impl FnMut(usize, &Batch, usize),
) {
    let mut fleet = Fleet::new(stream, entries);
    let leaves_out = !values && !stream.every_step;
    let mut waiting = Waiting::new(values);
    loop {
        waiting.have(BATCHES * LANES, simulation, stream);
        if waiting.count() == 0 && fleet.batches.iter().all(|batch| batch.free == !0) {
            return;
        }
        steps(&mut fleet, &mut waiting);
        for batch in &mut fleet.batches {
            let mut finished = batch.finished;
            while finished != 0 {
                let k = finished.trailing_zeros() as usize;
                finished &= finished - 1;
                each(batch.lane(k) as usize, batch, k);
            }
            batch.free_finished();
            let mut calm = if leaves_out { batch.calm } else { 0 };
            while calm != 0 {
                batch.leave_out_calm(simulation, calm.trailing_zeros() as usize);
                calm &= calm - 1;
            }
        }
    }
}
