//! Single lanes on the CPU. They make up the scalar CPU backend, and other backends are checked against them.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Mutex;

use rayon::prelude::*;

use crate::cpu::foreign::{Setting, run_lanes};
use crate::cpu::lane_result::Ending;
use crate::cpu::pending_lanes::Lanes;
use crate::cpu::series::{Series, max_entries};
use crate::cpu::simd::Instructions;
use crate::drivers::Constants;
use crate::frame::Start;
use crate::lane::silent;
use crate::lane_case::LaneCase;
use crate::outcome::{Outcome, Verdicts};
use crate::plan::{LaneKey, LanePlan};
use crate::scene::{Scene, fastest_in, may_cross};
use lanesweep_model::criterion::Criteria;
use lanesweep_model::driver::{ModelId, VectorDriver};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::Tables;
use lanesweep_support::Result;

/// Maximum number of entries of the unrolled motions of a batch side by side, 512 MiB, if every motion lasts as long as
/// its lane.
const SIDE_BY_SIDE_ENTRIES: u64 = 1 << 27;

/// Runs lanes of a plan one by one, in the arithmetic `R`.
pub struct LaneRunner<'p, R> {
    plan: &'p LanePlan,
    /// All series, rounded; empty if each case brings its own.
    tables: Tables<R>,
    /// One per block.
    constants: Vec<Constants<R>>,
    starts: Vec<Start<R>>,
    has_tables: bool,
    /// Batches make every step.
    every_step: bool,
    /// Memory of finished tasks, reused by later tasks because writing to fresh pages is slower.
    spare: Mutex<Vec<Series>>,
}

impl<'p, R: Real> LaneRunner<'p, R> {
    /// Rounds the plan's numbers once.
    pub fn new(plan: &'p LanePlan) -> Self {
        let tables = if plan.generator().is_some() { Tables::default() } else { plan.tables().cast() };
        LaneRunner { tables, has_tables: true, ..LaneRunner::of_few(plan) }
    }

    /// Rounds the numbers of each lane when it runs. For a few lanes, so that the plan's series are not held twice.
    pub(crate) fn of_few(plan: &'p LanePlan) -> Self {
        LaneRunner {
            plan,
            tables: Tables::default(),
            has_tables: false,
            constants: plan.blocks.iter().map(|b| Constants::resolve(&plan.profile, b.category)).collect(),
            starts: plan.headways.iter().map(|h| h.start()).collect(),
            every_step: false,
            spare: Mutex::default(),
        }
    }

    /// Each lane accumulates only what batches do for verdicts: no minima and maxima. Only verdicts and steps of its
    /// outcome are valid.
    pub fn verdicts_as_in_batches(mut self) -> Self {
        self.constants.iter_mut().for_each(|constants| constants.criteria.keeps_values = false);
        self
    }

    /// Batches make every step with all vehicles. By default verdict-only batches skip steps that change no verdict.
    /// The verdicts are equal.
    pub(crate) fn every_step(mut self, every_step: bool) -> Self {
        self.every_step = every_step;
        self
    }

    /// Runs one lane without stream rules.
    pub fn run(&self, key: &LaneKey) -> Outcome<R> {
        let (case, tables) = self.case(key.block, key.unit, key.variant);
        let (model, start) = (self.plan.models[key.model], self.starts[key.headway]);
        self.constants[key.block].run(model, &case, &tables, start, silent)
    }

    fn dt(&self) -> R {
        R::from_f64(self.plan.profile.frame.dt_s)
    }

    /// The plan whose lanes it runs.
    pub(crate) fn plan(&self) -> &'p LanePlan {
        self.plan
    }

    /// A case and the tables that it references.
    pub fn case(&self, block: usize, unit: u64, variant: usize) -> (LaneCase<R>, Cow<'_, Tables<R>>) {
        if self.has_tables && self.plan.generator().is_none() {
            return (self.plan.case(block, unit, variant).cast(), Cow::Borrowed(&self.tables));
        }
        let mut tables = Tables::default();
        let case = self.case_with_series(block, unit, variant, &mut tables);
        (case, Cow::Owned(tables))
    }

    /// A case whose series are appended to `tables`.
    fn case_with_series(&self, block: usize, unit: u64, variant: usize, tables: &mut Tables<R>) -> LaneCase<R> {
        match self.plan.generator() {
            Some(generator) => generator.case(unit, tables),
            None => self.plan.case(block, unit, variant).cast_with_series(self.plan.tables(), tables),
        }
    }

    /// Runs all lanes of one unit in the plan's order, except those of drivers outside the registry; passes position
    /// within the unit and outcome, for verdicts without [`Measures`](lanesweep_model::criterion::Measures).
    pub(super) fn run_unit(
        &self,
        block: usize,
        unit: u64,
        keeps_measures: bool,
        mut each: impl FnMut(usize, Outcome<R>),
    ) {
        let constants = &self.constants[block];
        let criteria = &Criteria { keeps_measures, ..constants.criteria };
        let mut at = 0;
        for variant in 0..self.plan.blocks[block].variants.len() {
            let (case, tables) = self.case(block, unit, variant);
            let may_cross = may_cross(&case, fastest_in(&tables), self.dt());
            for &start in &self.starts {
                for &model in &self.plan.models {
                    let scene = Scene { may_cross, ..Scene::unknown(case.pair != 0) };
                    if model.foreign().is_none() {
                        each(at, constants.run_in(model, criteria, scene, &case, &tables, start, silent));
                    }
                    at += 1;
                }
            }
        }
    }
}

impl LaneRunner<'_, f32> {
    /// Outcomes of the lanes of some units of a block under a driver outside the registry, by unit, variant and headway.
    ///
    /// # Errors
    /// As [`run_lanes`].
    pub(super) fn run_foreign(
        &self,
        block: usize,
        units: Range<u64>,
        model: ModelId,
        driver: &dyn VectorDriver,
        keeps_measures: bool,
    ) -> Result<Vec<Outcome<f64>>> {
        let (plan, first_unit) = (self.plan, units.start);
        let Constants { dt_s, criteria, frames, .. } = &self.constants[block];
        let criteria = Criteria { keeps_measures, ..*criteria };
        let setting = Setting::new((model, driver), frames[model.index()], criteria, *dt_s);
        let of_block = &plan.blocks[block];
        let variants = of_block.variants.len();
        let keys: Vec<_> = units.flat_map(|unit| (0..variants).map(move |variant| (unit, variant))).collect();
        let step_cap = plan.profile.step_cap();
        let memory = SIDE_BY_SIDE_ENTRIES / (2 * max_entries(step_cap));
        let batch_cases = (driver.batch_lanes() / self.starts.len().max(1)).min(memory as usize).max(1);
        let batch = |(at, keys): (usize, &[(u64, usize)])| {
            let mut tables = Tables::default();
            let case = |&(unit, variant): &_| self.case_with_series(block, unit, variant, &mut tables);
            let cases: Vec<LaneCase<f32>> = keys.iter().map(case).collect();
            let mut series = Series::default();
            let tracks: Vec<_> = cases.iter().map(|case| series.unroll(case, &tables, step_cap)).collect();
            drop(tables);
            run_lanes(&setting, &cases, (&tracks, series.entries()), &self.starts, |lane| {
                let (case, headway) = (at * batch_cases + lane / self.starts.len(), lane % self.starts.len());
                let unit = of_block.units.name(first_unit + (case / variants) as u64);
                format!("{unit}/{}/{}/{}", of_block.variants[case % variants], plan.headways[headway], model.name())
            })
        };
        let outcomes: Result<Vec<_>> = if driver.batch_lanes() == usize::MAX {
            keys.chunks(batch_cases).enumerate().map(batch).collect()
        } else {
            keys.par_chunks(batch_cases).enumerate().map(batch).collect()
        };
        Ok(outcomes?.concat())
    }
}

impl LaneRunner<'_, f32> {
    /// Runs all lanes of some units of a block in batches, except those of drivers outside the registry. The lanes must
    /// [run in batches](LaneRunner::runs_in_batches). Passes the position, counted from the first unit, and the result, in
    /// any order.
    pub(super) fn run_units<E: Ending>(
        &self,
        instructions: Instructions,
        block: usize,
        units: Range<u64>,
        mut each: impl FnMut(usize, E),
    ) {
        let variants = self.plan.blocks[block].variants.len();
        let mut made = Tables::default();
        let (cases, tables): (Vec<LaneCase<f32>>, _) = match self.plan.generator() {
            Some(generator) => (units.map(|unit| generator.case(unit, &mut made)).collect(), &made),
            None => {
                let keys = units.flat_map(|unit| (0..variants).map(move |variant| (unit, variant)));
                let cases = keys.map(|(unit, variant)| self.plan.case(block, unit, variant).cast()).collect();
                (cases, &self.tables)
            }
        };
        let constants = &self.constants[block];
        let step_cap = self.plan.profile.step_cap();
        let mut series = self.spare.lock().ok().and_then(|mut spare| spare.pop()).unwrap_or_default();
        series.clear();
        let tracks: Vec<_> = cases.iter().map(|case| series.unroll(case, tables, step_cap)).collect();
        let may_cross = cases.iter().any(|case| may_cross(case, fastest_in(tables), self.dt()));
        let (starts, every_step) = (&self.starts[..], self.every_step);
        let stream = Lanes { cases: &cases, tracks: &tracks, starts, one_start_each: false, every_step, may_cross };
        let models = self.plan.models.len();
        for (at_model, &model) in self.plan.models.iter().enumerate().filter(|(_, model)| model.foreign().is_none()) {
            let each = |lane: usize, end: E| each(lane * models + at_model, end);
            constants.run_stream(model, instructions, &stream, series.entries(), each);
        }
        if let Ok(mut spare) = self.spare.lock() {
            spare.push(series);
        }
    }

    /// Whether all lanes run in batches on these instructions. Lanes with a criterion that iterates run one by one.
    pub(crate) fn runs_in_batches(&self, instructions: Instructions) -> bool {
        self.constants.iter().all(|constants| constants.run_in_batches(instructions))
    }

    /// Runs selected lanes of one block and model in a batch that makes every step; one by one if they do not run in
    /// batches. Passes the position in `keys` and the verdicts.
    pub(crate) fn run_keys(&self, instructions: Instructions, keys: &[LaneKey], mut each: impl FnMut(usize, Verdicts)) {
        let Some(&LaneKey { block, model, .. }) = keys.first() else { return };
        let constants = &self.constants[block];
        if !constants.run_in_batches(instructions) {
            return keys.iter().enumerate().for_each(|(at, key)| each(at, self.run(key).verdicts));
        }
        let mut tables = Tables::default();
        let case = |key: &LaneKey| self.case_with_series(key.block, key.unit, key.variant, &mut tables);
        let cases: Vec<LaneCase<f32>> = keys.iter().map(case).collect();
        let starts: Vec<Start<f32>> = keys.iter().map(|key| self.starts[key.headway]).collect();
        let (mut series, step_cap) = (Series::default(), self.plan.profile.step_cap());
        let tracks: Vec<_> = cases.iter().map(|case| series.unroll(case, &tables, step_cap)).collect();
        let may_cross = cases.iter().any(|case| may_cross(case, fastest_in(&tables), self.dt()));
        let (cases, tracks, starts) = (&cases[..], &tracks[..], &starts[..]);
        let stream = Lanes { cases, tracks, starts, one_start_each: true, every_step: true, may_cross };
        constants.run_stream(self.plan.models[model], instructions, &stream, series.entries(), each);
    }
}
