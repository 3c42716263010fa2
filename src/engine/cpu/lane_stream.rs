//! Runs a stream of lanes through the slots of the batches. After each burst the slot of a finished lane takes the next
//! lane, so no lane blocks another and no memory is allocated per lane. A lane that needs fewer checks moves to another
//! stage: one for lanes with the second vehicle only, and one for steady following. A stage runs its own batches when
//! many lanes are pending there, or no other lanes are left.

use crate::cpu::LANES;
use crate::cpu::batch::{BATCHES, Fleet};
use crate::cpu::lane_result::Ending;
use crate::cpu::pending_lanes::{Lanes, Pending};
use crate::cpu::shared_rules::Rules;
use crate::cpu::simd::{Burst, Instructions, burst_for};
use crate::frame::Simulation;
use crate::scene::Scene;
use lanesweep_model::driver::DriverModel;

/// Lanes of a fleet.
const FLEET: usize = BATCHES * LANES;

/// Runs a stream of lanes of one model on an instruction set; all must run in batches. `each` receives every finished
/// lane, in the order in which they end: its index within the stream and its result. `entries` are the series that the
/// stream's tracks index.
pub(crate) fn run_stream<M: DriverModel<f32>, E: Ending>(
    simulation: &Simulation<'_, f32, M>,
    instructions: Instructions,
    stream: &Lanes<'_>,
    entries: &[f32],
    mut each: impl FnMut(usize, E),
) {
    let mut lanes = Stage::new::<E>(*simulation, instructions, stream, entries);
    let sets_apart = (simulation.scene.is_pair && lanes.apart.is_some()).then_some(entries);
    loop {
        lanes.pending.have(FLEET, simulation, stream, sets_apart);
        if lanes.is_idle() {
            return;
        }
        lanes.advance(&mut each);
    }
}

/// Batches of one kind, and the lanes pending for them.
struct Stage<'s, M> {
    simulation: Simulation<'s, f32, M>,
    burst: Burst<M>,
    fleet: Fleet<'s>,
    pending: Pending,
    /// The stage skips quiescent steps.
    skips_steps: bool,
    /// The stage for lanes that need fewer checks.
    apart: Option<Box<Stage<'s, M>>>,
}

impl<'s, M: DriverModel<f32>> Stage<'s, M> {
    /// A stage without lanes, with the stages that its lanes may need later.
    fn new<E: Ending>(
        simulation: Simulation<'s, f32, M>,
        instructions: Instructions,
        stream: &Lanes<'_>,
        entries: &'s [f32],
    ) -> Self {
        const RUNS: &str = "these lanes do not run in batches";
        let rules_of = |scene| Rules::of(simulation.frame, simulation.criteria, scene, E::HAS_VALUES).expect(RUNS);
        // Some rules have no verdict-only loop.
        let values = !rules_of(simulation.scene).is_verdict_only;
        let skips_steps = !values && !stream.every_step;
        let knows_steady = skips_steps && M::KNOWS_STEADY_FOLLOWING;
        // Makes a stage whose lanes evaluate these vehicles.
        let stage = |scene: Scene, rules, vehicles: [usize; 2], apart: Option<Stage<'s, M>>| Stage {
            simulation: Simulation { scene, ..simulation },
            burst: burst_for(instructions, rules).expect(RUNS),
            fleet: Fleet::new(stream, entries, vehicles),
            pending: Pending::new(values, apart.is_some() && !scene.is_pair),
            skips_steps,
            apart: apart.map(Box::new),
        };
        let single = |scene, vehicles| {
            let is_steady = knows_steady.then(|| stage(Scene::in_lane(), Rules::is_steady(), vehicles, None));
            stage(scene, rules_of(scene), vehicles, is_steady)
        };
        let scene = simulation.scene;
        if !scene.is_pair {
            return single(scene, [0, 0]);
        }
        // The ego may still pass the second vehicle, which batches of single vehicles do not test.
        let alone = (skips_steps && !scene.may_cross).then(|| single(Scene::of_lead_only(stream.cases), [1, 1]));
        stage(scene, rules_of(scene), [0, 1], alone)
    }

    /// No lane is pending or in flight here.
    fn is_idle(&self) -> bool {
        has_no_lane(&self.fleet, &self.pending) && self.apart.as_ref().is_none_or(|apart| apart.is_idle())
    }

    /// Makes a burst, then runs some of the lanes that moved to the next stage.
    fn advance<E: Ending>(&mut self, each: &mut impl FnMut(usize, E)) {
        self.run_burst(each);
        let Stage { simulation, fleet, pending, apart: Some(apart), .. } = self else { return };
        let is_pair = simulation.scene.is_pair;
        for batch in &mut fleet.batches {
            if is_pair {
                batch.set_apart_lead_only(&mut apart.pending);
            } else {
                batch.set_apart_steady_following(simulation, &mut apart.pending);
            }
        }
        // Rare before the stream's end: this stage has no lanes, but gets more when lanes return from the next stage.
        let no_others = has_no_lane(fleet, pending);
        if !no_others && apart.pending.has_room(FLEET) {
            return;
        }
        // Many bursts of one stage in a row keep their data in the caches.
        while apart.pending.count() >= FLEET || no_others && !apart.is_idle() {
            if is_pair {
                apart.advance(each);
            } else if pending.has_room(FLEET) {
                apart.run_burst(each);
                for batch in &mut apart.fleet.batches {
                    batch.set_back(&apart.simulation, pending);
                }
            } else {
                return;
            }
        }
    }

    /// Makes a burst and updates the lanes that stay here.
    fn run_burst<E: Ending>(&mut self, each: &mut impl FnMut(usize, E)) {
        let Stage { simulation, fleet, .. } = self;
        self.burst.run(simulation, fleet, &mut self.pending);
        for batch in &mut fleet.batches {
            let mut finished = batch.finished;
            while finished != 0 {
                let k = finished.trailing_zeros() as usize;
                finished &= finished - 1;
                let (constants, state, places) = batch.last_step(k);
                each(batch.lane(k) as usize, E::of(simulation, &constants, &state, &places));
            }
            batch.free_finished();
            let mut quiescent = if self.skips_steps { batch.quiescent } else { 0 };
            while quiescent != 0 {
                batch.jump_ahead(simulation, quiescent.trailing_zeros() as usize);
                quiescent &= quiescent - 1;
            }
        }
    }
}

/// No lane is pending or in flight here.
fn has_no_lane(fleet: &Fleet<'_>, pending: &Pending) -> bool {
    pending.count() == 0 && fleet.batches.iter().all(|batch| batch.free == !0)
}
