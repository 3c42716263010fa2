//! Single lanes on the CPU: what the CPU backend is made of, and what any other backend is checked with.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Mutex;

use super::drivers::Constants;
use super::frame::Start;
use super::instructions::Instructions;
use super::lane::Silent;
use super::lane_case::LaneCase;
use super::outcome::Outcome;
use super::plan::{LaneKey, LanePlan};
use super::rules::Stream;
use super::series::Series;
use super::stream::Waiting;
use crate::driver::ModelId;
use crate::scalar::Real;
use crate::scenario::Tables;

/// Runs lanes of a plan one by one, in the arithmetic `R`.
pub struct LaneRunner<'p, R> {
    plan: &'p LanePlan,
    tables: Tables<R>,
    /// One per block.
    constants: Vec<Constants<R>>,
    starts: Vec<Start<R>>,
    /// Memory of tasks that are done, for those to come: fresh pages cost more than what is written into them.
    spare: Mutex<Vec<Series>>,
}

impl<'p, R: Real> LaneRunner<'p, R> {
    /// Rounds what the plan holds, once.
    pub fn new(plan: &'p LanePlan) -> Self {
        LaneRunner {
            plan,
            tables: if plan.generator().is_some() { Tables::default() } else { plan.tables().cast() },
            constants: plan.blocks.iter().map(|b| Constants::resolve(&plan.profile, b.category)).collect(),
            starts: plan.headways.iter().map(|h| h.start()).collect(),
            spare: Mutex::default(),
        }
    }

    /// The same, but lanes gather no smallest and largest values: only verdicts and steps of their outcomes mean
    /// something.
    pub fn verdicts_only(mut self) -> Self {
        self.constants.iter_mut().for_each(|constants| constants.criteria.keeps_values = false);
        self
    }

    /// One lane.
    pub fn run(&self, key: &LaneKey) -> Outcome<R> {
        let (case, tables) = self.case(key.block, key.unit, key.variant);
        self.run_case(key.block, &case, &tables, self.starts[key.headway], self.plan.models[key.model])
    }

    /// The plan whose lanes it runs.
    pub(super) fn plan(&self) -> &'p LanePlan {
        self.plan
    }

    /// A case and the tables that it points into.
    pub(crate) fn case(&self, block: usize, unit: u64, variant: usize) -> (LaneCase<R>, Cow<'_, Tables<R>>) {
        match self.plan.generator() {
            Some(generator) => {
                let mut tables = Tables::default();
                let case = generator.case(unit, &mut tables);
                (case, Cow::Owned(tables))
            }
            None => (self.plan.case(block, unit, variant).cast(), Cow::Borrowed(&self.tables)),
        }
    }

    /// All lanes of one unit, in the plan's order: position within the unit, outcome.
    pub fn run_unit(&self, block: usize, unit: u64, mut each: impl FnMut(usize, Outcome<R>)) {
        let mut at = 0;
        for variant in 0..self.plan.blocks[block].variants.len() {
            let (case, tables) = self.case(block, unit, variant);
            for &start in &self.starts {
                for &model in &self.plan.models {
                    each(at, self.run_case(block, &case, &tables, start, model));
                    at += 1;
                }
            }
        }
    }

    fn run_case(
        &self,
        block: usize,
        case: &LaneCase<R>,
        tables: &Tables<R>,
        start: Start<R>,
        model: ModelId,
    ) -> Outcome<R> {
        self.constants[block].run(model, case, tables, start, &mut Silent)
    }
}

impl LaneRunner<'_, f32> {
    /// All lanes of some units of a block, in batches: position counted from the first unit on, outcome. In no
    /// particular order. Without `values` only the outcomes' verdicts mean something.
    pub fn run_units(
        &self,
        instructions: Instructions,
        block: usize,
        units: Range<u64>,
        values: bool,
        mut each: impl FnMut(usize, Outcome<f32>),
    ) {
        let (variants, models) = (self.plan.blocks[block].variants.len(), self.plan.models.len());
        let mut made = Tables::default();
        let (cases, tables): (Vec<LaneCase<f32>>, _) = match self.plan.generator() {
            Some(generator) => (units.map(|unit| generator.case(unit, &mut made)).collect(), &made),
            None => {
                let keys = units.flat_map(|unit| (0..variants).map(move |variant| (unit, variant)));
                let cases = keys.map(|(unit, variant)| self.plan.case(block, unit, variant).cast()).collect();
                (cases, &self.tables)
            }
        };
        let stream = Stream { instructions, is_pair: cases.iter().any(|case| case.pair != 0), values };
        let constants = &self.constants[block];
        let in_batches = constants.run_in_batches(stream);
        let step_cap = self.plan.profile.step_cap();
        let mut series = self.spare.lock().ok().and_then(|mut spare| spare.pop()).unwrap_or_default();
        series.clear();
        let unrolled = if in_batches { &cases[..] } else { &[] };
        let tracks: Vec<_> = unrolled.iter().map(|case| series.unroll(case, tables, step_cap)).collect();
        for (at_model, &model) in self.plan.models.iter().enumerate() {
            let lane = |lane: usize| {
                let (at_case, at_start) = (lane / self.starts.len(), lane % self.starts.len());
                Some((at_case, cases.get(at_case)?, self.starts[at_start], lane * models + at_model))
            };
            let mut lanes = (0..).map_while(lane);
            if !in_batches {
                lanes.for_each(|(_, case, start, at)| each(at, self.run_case(block, case, tables, start, model)));
                continue;
            }
            let next = || lanes.next().map(|(k, case, start, at)| Waiting { case, tracks: &tracks[k], start, at });
            constants.run_stream(model, stream, series.entries(), next, &mut each);
        }
        if let Ok(mut spare) = self.spare.lock() {
            spare.push(series);
        }
    }
}
