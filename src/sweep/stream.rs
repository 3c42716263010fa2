//! A stream of lanes through the slots of the batches: where a lane is over, its slot takes the next one after the
//! burst, so no lane waits for another and nothing is allocated per lane. A lane that goes on with the second vehicle
//! alone is set apart; when many of them wait, or no others are left, they run in batches of such lanes.

use crate::driver::DriverModel;

use super::batch::{BATCHES, Fleet};
use super::batch_arrays::LANES;
use super::ending::Ending;
use super::frame::Simulation;
use super::instructions::Instructions;
use super::rules::Rules;
use super::scene::Scene;
use super::simd::{Burst, burst_for};
use super::waiting::{Lanes, MOST, Waiting};

/// Lanes of a fleet.
const FLEET: usize = BATCHES * LANES;

/// Runs a stream of lanes of one model on an instruction set, where they run in batches; `each` takes the lanes after
/// their last steps, in the order in which they end: the lane, counted within the stream, and what is wanted of its end.
/// `entries` are the series that the stream's tracks point into.
pub(super) fn run_stream<M: DriverModel<f32>, E: Ending>(
    simulation: &Simulation<'_, f32, M>,
    instructions: Instructions,
    stream: &Lanes<'_>,
    entries: &[f32],
    mut each: impl FnMut(usize, E),
) {
    let mut first = Stage::new::<E>(*simulation, [0, 1], instructions, stream, entries);
    let sets_apart = simulation.scene.is_pair && first.leaves_out;
    let mut alone = sets_apart.then(|| {
        let simulation = Simulation { scene: Scene::of_second_alone(stream.cases), ..*simulation };
        Stage::new::<E>(simulation, [1, 1], instructions, stream, entries)
    });
    loop {
        first.waiting.have(FLEET, simulation, stream, sets_apart.then_some(entries));
        let is_over = first.is_idle();
        if !is_over {
            first.advance(&mut each);
        }
        let Some(alone) = &mut alone else {
            if is_over {
                return;
            }
            continue;
        };
        for batch in &mut first.fleet.batches {
            batch.set_apart(&mut alone.waiting);
        }
        // Many bursts of one kind in a row: what they work with then lies near.
        if is_over || alone.waiting.count() > MOST - FLEET {
            while alone.waiting.count() >= FLEET || is_over && !alone.is_idle() {
                alone.advance(&mut each);
            }
        }
        if is_over {
            return;
        }
    }
}

/// Batches of one kind, and the lanes that wait for them.
struct Stage<'s, M> {
    simulation: Simulation<'s, f32, M>,
    burst: Burst<M>,
    fleet: Fleet<'s>,
    waiting: Waiting,
    /// Steps in which nothing can happen are not made.
    leaves_out: bool,
    /// Where its lanes are while they are at ease.
    at_ease: Option<Box<Stage<'s, M>>>,
}

impl<'s, M: DriverModel<f32>> Stage<'s, M> {
    /// Without a lane yet. `vehicles` are those that its lanes look at.
    fn new<E: Ending>(
        simulation: Simulation<'s, f32, M>,
        vehicles: [usize; 2],
        instructions: Instructions,
        stream: &Lanes<'_>,
        entries: &'s [f32],
    ) -> Self {
        const RUNS: &str = "these lanes do not run in batches";
        let rules = Rules::of(simulation.frame, simulation.criteria, simulation.scene, E::HAS_VALUES).expect(RUNS);
        // Some rules have no loop for verdicts alone.
        let values = !rules.is_verdict_only;
        let leaves_out = !values && !stream.every_step;
        let asks_ease = leaves_out && M::KNOWS_EASE && !simulation.scene.is_pair;
        let stage = |simulation, rules, asks_ease| Stage {
            simulation,
            burst: burst_for(instructions, rules).expect(RUNS),
            fleet: Fleet::new(stream, entries, vehicles),
            waiting: Waiting::new(values, asks_ease),
            leaves_out,
            at_ease: None,
        };
        let in_lane = Simulation { scene: Scene::in_lane(), ..simulation };
        let at_ease = asks_ease.then(|| Box::new(stage(in_lane, Rules::at_ease(), false)));
        Stage { at_ease, ..stage(simulation, rules, asks_ease) }
    }

    /// No lane waits or runs here.
    fn is_idle(&self) -> bool {
        has_no_lane(&self.fleet, &self.waiting) && self.at_ease.as_ref().is_none_or(|at_ease| at_ease.is_idle())
    }

    /// A burst, or some of lanes at ease, and what comes of it.
    fn advance<E: Ending>(&mut self, each: &mut impl FnMut(usize, E)) {
        self.burst(each);
        let Stage { simulation, fleet, waiting, at_ease: Some(at_ease), .. } = self else { return };
        for batch in &mut fleet.batches {
            batch.set_at_ease(simulation, &mut at_ease.waiting);
        }
        let are_alone = has_no_lane(fleet, waiting);
        if are_alone || !at_ease.waiting.has_room(FLEET) {
            while (at_ease.waiting.count() >= FLEET || are_alone && !at_ease.is_idle()) && waiting.has_room(FLEET) {
                at_ease.burst(each);
                for batch in &mut at_ease.fleet.batches {
                    batch.set_back(&at_ease.simulation, waiting);
                }
            }
        }
    }

    /// A burst, and what comes of it for lanes that stay here.
    fn burst<E: Ending>(&mut self, each: &mut impl FnMut(usize, E)) {
        let Stage { simulation, fleet, .. } = self;
        self.burst.run(simulation, fleet, &mut self.waiting);
        for batch in &mut fleet.batches {
            let mut finished = batch.finished;
            while finished != 0 {
                let k = finished.trailing_zeros() as usize;
                finished &= finished - 1;
                let (constants, state, places) = batch.last_step(k);
                each(batch.lane(k) as usize, E::of(simulation, &constants, &state, &places));
            }
            batch.free_finished();
            let mut calm = if self.leaves_out { batch.calm } else { 0 };
            while calm != 0 {
                batch.leave_out_calm(simulation, calm.trailing_zeros() as usize);
                calm &= calm - 1;
            }
        }
    }
}

/// No lane waits or runs here.
fn has_no_lane(fleet: &Fleet<'_>, waiting: &Waiting) -> bool {
    waiting.count() == 0 && fleet.batches.iter().all(|batch| batch.free == !0)
}
