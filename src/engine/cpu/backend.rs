//! The CPU backend: intervals of units are tasks of the rayon pool. f32 is the lane arithmetic that all backends share,
//! in batches on the widest vector instructions of the machine; f64 is the reference, lane by lane.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::backend::{Backend, Chunk, RecheckBy, Session, Wanted};
use crate::cpu::foreign::BATCH_LANES;
use crate::cpu::runner::LaneRunner;
use crate::cpu::series::max_entries;
use crate::cpu::simd::Instructions;
use crate::outcome::{Outcome, Verdicts};
use crate::plan::LanePlan;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::Category;
use lanesweep_support::Result;

/// Lanes per model above which a task keeps its batches nearly full.
const FULL_TASK: u64 = 8192;
/// Minimum lanes per model of a task; smaller tasks are not split further.
const SMALL_TASK: u64 = 2048;
/// Tasks per thread, so that threads do not idle at the end.
const TASKS_PER_THREAD: u64 = 4;
/// Maximum number of entries in a task's unrolled motions, 64 MiB, if every motion lasts as long as its lane.
const TASK_ENTRIES: u64 = 1 << 24;

/// Maximum steps per thread in a chunk, if each lane makes every step: about two seconds in batches, one or two seconds
/// as single lanes, up to five seconds if the criterion iterates.
const CHUNK_STEPS: u64 = 1 << 29;
const CHUNK_STEPS_OF_SINGLE_LANES: u64 = 1 << 25;
/// Maximum number of lanes in a chunk.
const CHUNK_LANES: u64 = 1 << 17;

/// Number of lanes with this many steps that all threads together compute in batches within seconds; at least one.
pub fn lanes_within_seconds(step_cap: u32) -> u64 {
    lanes_of_steps(CHUNK_STEPS, step_cap)
}

fn lanes_of_steps(steps_per_thread: u64, step_cap: u32) -> u64 {
    // More threads than cores do not speed up a chunk, and a run can be cancelled only between chunks.
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = rayon::current_num_threads().min(cores) as u64;
    (steps_per_thread.saturating_mul(threads) / u64::from(step_cap.max(1))).clamp(1, CHUNK_LANES)
}

/// Runs units on the rayon pool. Results depend neither on the threads nor on the instructions.
#[derive(Debug)]
pub struct CpuBackend {
    instructions: Instructions,
    every_step: bool,
    /// In binary64.
    is_reference: bool,
}

impl CpuBackend {
    /// The lane arithmetic: binary32 with the fastest instructions of the machine.
    pub fn lane_arithmetic() -> Self {
        CpuBackend { instructions: Instructions::best(), every_step: false, is_reference: false }
    }

    /// The lane arithmetic lane by lane: the reference for every other backend.
    pub fn scalar() -> Self {
        CpuBackend { instructions: Instructions::Scalar, every_step: true, is_reference: false }
    }

    /// The lane arithmetic on the given instructions.
    ///
    /// # Errors
    /// [`Error::Usage`](lanesweep_support::Error::Usage) if this machine does not support them.
    pub fn with_instructions(instructions: Instructions) -> Result<Self> {
        Ok(CpuBackend { instructions: instructions.checked()?, every_step: false, is_reference: false })
    }

    /// Makes every step of every lane with all its vehicles, for benchmarks and tests. By default verdict-only batches
    /// skip steps that change no verdict. The verdicts are equal.
    pub fn every_step(self) -> Self {
        CpuBackend { every_step: true, ..self }
    }

    /// The reference: binary64, the same source code, lane by lane.
    pub fn reference() -> Self {
        CpuBackend { is_reference: true, ..CpuBackend::scalar() }
    }
}

impl Backend for CpuBackend {
    /// Verdict-only batches skip steps.
    fn rechecked_by(&self, wanted: Wanted) -> RecheckBy {
        let makes_every_step = self.every_step || self.instructions == Instructions::Scalar;
        match wanted {
            Wanted::Verdicts | Wanted::Counts if !makes_every_step => RecheckBy::Batches,
            _ => RecheckBy::Nothing,
        }
    }

    fn describe(&self) -> String {
        let bits = if self.is_reference { 64 } else { 32 };
        let threads = rayon::current_num_threads();
        let s = if threads == 1 { "" } else { "s" };
        format!("CPU, {threads} thread{s}, {} binary{bits}", self.instructions)
    }

    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
        if self.is_reference {
            ModelId::refuse_foreign(
                &plan.models,
                "the reference in binary64",
                "leave out `reference` or `compare_reference`",
            )?;
            return Ok(lane_by_lane(plan, LaneRunner::<f64>::new(plan)));
        }
        let (runner, instructions) = (LaneRunner::<f32>::new(plan).every_step(self.every_step), self.instructions);
        if !runner.runs_in_batches(instructions) {
            return Ok(lane_by_lane(plan, runner));
        }
        let runner = Arc::new(runner);
        let same = runner.clone();
        let verdicts: Run<'p, Verdicts> =
            Box::new(move |block, units, each| same.run_units::<Verdicts>(instructions, block, units, each));
        let outcomes: Run<'p, Outcome<f64>> = Box::new(move |block, units, each| {
            runner.run_units(instructions, block, units, |at, outcome: Outcome<f32>| each(at, outcome.widen()));
        });
        Ok(Box::new(CpuSession { plan, in_batches: true, verdicts, outcomes }))
    }
}

/// Runs the lanes of some units of a block; passes each result with its position, counted from the first unit.
type Run<'p, E> = Box<dyn Fn(usize, Range<u64>, &mut dyn FnMut(usize, E)) + Send + Sync + 'p>;

/// A session that runs single lanes.
fn lane_by_lane<'p, R: Real>(plan: &'p LanePlan, runner: LaneRunner<'p, R>) -> Box<dyn Session + 'p> {
    let runner = Arc::new(runner);
    let run =
        |runner: &LaneRunner<'p, R>, block, units: Range<u64>, measures, each: &mut dyn FnMut(usize, Outcome<R>)| {
            let per_unit = plan.lanes_per_unit(&plan.blocks[block]) as usize;
            for (k, unit) in units.enumerate() {
                runner.run_unit(block, unit, measures, |at, outcome| each(k * per_unit + at, outcome));
            }
        };
    let same = runner.clone();
    let verdicts: Run<'p, Verdicts> = Box::new(move |block, units, each| {
        run(&same, block, units, false, &mut |at, outcome| each(at, outcome.verdicts));
    });
    let outcomes: Run<'p, Outcome<f64>> = Box::new(move |block, units, each| {
        run(&runner, block, units, true, &mut |at, outcome| each(at, outcome.widen()));
    });
    Box::new(CpuSession { plan, in_batches: false, verdicts, outcomes })
}

struct CpuSession<'p> {
    plan: &'p LanePlan,
    /// Batches need tasks with many lanes.
    in_batches: bool,
    verdicts: Run<'p, Verdicts>,
    outcomes: Run<'p, Outcome<f64>>,
}

impl CpuSession<'_> {
    /// Units per task: enough lanes to fill batches, and if possible several tasks per thread.
    fn task_units(&self, block: usize, units: u64) -> u64 {
        if !self.in_batches {
            return 1;
        }
        let block = &self.plan.blocks[block];
        let variants = block.variants.len().max(1) as u64;
        let per_unit_and_model = variants * self.plan.headways.len().max(1) as u64;
        let threads = rayon::current_num_threads() as u64;
        let vehicles = if block.category == Category::CutOut { 2 } else { 1 };
        let entries = variants * vehicles * max_entries(self.plan.profile.step_cap());
        let max_units = FULL_TASK.div_ceil(per_unit_and_model).min(TASK_ENTRIES / entries).max(1);
        let min_units = SMALL_TASK.div_ceil(per_unit_and_model).min(max_units);
        units.div_ceil(TASKS_PER_THREAD * threads).clamp(min_units, max_units).min(units.div_ceil(threads)).max(1)
    }
}

impl Session for CpuSession<'_> {
    fn chunk_lanes(&self, _wanted: Wanted) -> u64 {
        let steps = if self.in_batches { CHUNK_STEPS } else { CHUNK_STEPS_OF_SINGLE_LANES };
        let lanes = lanes_of_steps(steps, self.plan.profile.step_cap());
        let has_foreign = self.plan.models.iter().any(|model| model.foreign().is_some());
        if has_foreign { lanes.min(BATCH_LANES * self.plan.models.len() as u64) } else { lanes }
    }

    fn run(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk> {
        let plan = self.plan;
        let first_lane = plan.first_lane_of(units.start);
        let mut verdicts = Vec::new();
        let mut outcomes = Vec::new();
        for (block, inside) in plan.segments(units.clone()) {
            let per_unit = plan.lanes_per_unit(&plan.blocks[block]) as usize;
            let count = (inside.end - inside.start) as usize;
            let task_units = self.task_units(block, count as u64);
            let task = |k: usize| {
                let from = inside.start + k as u64 * task_units;
                from..inside.end.min(from + task_units)
            };
            let task_lanes = task_units as usize * per_unit;
            let from = verdicts.len();
            verdicts.resize(from + count * per_unit, Verdicts::default());
            match wanted {
                Wanted::Verdicts | Wanted::Counts => {
                    let tasks = verdicts[from..].par_chunks_mut(task_lanes).enumerate();
                    tasks.for_each(|(k, lanes)| {
                        (self.verdicts)(block, task(k), &mut |at, verdicts| lanes[at] = verdicts)
                    });
                }
                Wanted::Outcomes => {
                    outcomes.resize(from + count * per_unit, Outcome::default());
                    let tasks =
                        outcomes[from..].par_chunks_mut(task_lanes).zip(verdicts[from..].par_chunks_mut(task_lanes));
                    tasks.enumerate().for_each(|(k, (lanes, verdicts))| {
                        (self.outcomes)(block, task(k), &mut |at, outcome| {
                            (lanes[at], verdicts[at]) = (outcome, outcome.verdicts);
                        });
                    });
                }
            }
            for (at_model, &model) in plan.models.iter().enumerate() {
                let Some(driver) = model.foreign() else { continue };
                let runner = LaneRunner::<f32>::of_few(plan);
                let found = runner.run_foreign(block, inside.clone(), model, &*driver, wanted == Wanted::Outcomes)?;
                for (at, outcome) in found.into_iter().enumerate() {
                    let lane = from + at * plan.models.len() + at_model;
                    verdicts[lane] = outcome.verdicts;
                    if let Some(to) = outcomes.get_mut(lane) {
                        *to = outcome;
                    }
                }
            }
        }
        let redone_and_rechecked = [0; 2];
        Ok(Chunk { units, first_lane, verdicts, outcomes, counted: None, redone_and_rechecked })
    }
}
