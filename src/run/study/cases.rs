//! The cases of a study: scenarios and decompositions, from which the host makes every S and S', all at once or window
//! by window.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::study::plan_file::StudyHead;
use lanesweep_engine::lane_case::LaneCase;
use lanesweep_engine::plan::{Block, LanePlan, Units, check_cases};
use lanesweep_engine::{CaseTable, Chunk, Executor, SweepSummary, Wanted};
use lanesweep_model::scenario::parameterization::{
    Parameterization, Reduction, Sizes, TimeGrid, recorded_case, steps_of,
};
use lanesweep_model::scenario::{Case, Category, Scenario};
use lanesweep_support::{Error, Place, Result};

/// The input of a study's cases, or of an interval of its scenarios: about 2 kB per scenario. Cases are ten times as
/// large; they are made for one window of scenarios at a time.
pub struct StudyCases {
    pub(crate) head: StudyHead,
    pub(crate) outline: LanePlan,
    /// The decompositions, one per block that has one.
    pub(crate) reductions: Vec<Option<Reduction>>,
    /// Those of a cross-validation, one per fold.
    pub(super) folds: Vec<Vec<Reduction>>,
    /// Unit of the first scenario held.
    pub(crate) first_held: u64,
    pub(crate) held: Vec<Scenario>,
    pub(super) left_out: Vec<Error>,
}

/// Number of scenarios whose cases are held at once, about 25 kB each.
pub(crate) const WINDOW: u64 = 2048;
/// The same for a device, which needs many lanes at once.
const DEVICE_WINDOW: u64 = 16_384;

/// Number of scenarios whose cases are held before they are encoded.
const ENCODED_AT_ONCE: u64 = 256;

impl StudyCases {
    /// The plan without cases: counts, keys, hash.
    pub fn outline(&self) -> &LanePlan {
        &self.outline
    }

    /// Parts that could not be planned, with the reason; for example too few scenarios for a decomposition.
    pub fn left_out(&self) -> &[Error] {
        &self.left_out
    }

    /// The units whose scenarios are held.
    pub(super) fn held_units(&self) -> Range<u64> {
        self.first_held..self.first_held + self.held.len() as u64
    }

    /// The scenario of a unit, if it is held.
    pub(super) fn scenario(&self, unit: u64) -> Option<&Scenario> {
        self.held.get(usize::try_from(unit.checked_sub(self.first_held)?).ok()?)
    }

    /// The plan with the cases of these units, which must be held.
    ///
    /// # Errors
    /// [`Error::Internal`] for other units; [`Error::Usage`] for a time step that is too long for a case, or so short
    /// that the series are too large.
    pub fn window(&self, units: Range<u64>) -> Result<LanePlan> {
        let (plan, profile) = (&self.outline, &self.outline.profile);
        let entries = self.entries(units.clone());
        if entries > MAX_ENTRIES_AT_ONCE {
            let problem = format!("{} s: the series of these scenarios have {entries:.1e} values", profile.frame.dt_s);
            let help = "use a longer time step, or fewer or shorter scenarios at once (2.7e8 values, 2 GiB)";
            return Err(Error::usage(Place::item("`frame.dt_s`"), problem, help));
        }
        let none = |block: &Block| Units::Held(block.units.len(), 0, Arc::new([]));
        let mut held: Vec<Units> = plan.blocks.iter().map(none).collect();
        let mut table = CaseTable::new(plan.blocks.iter().map(|block| block.variants.len()));
        for (at, inside) in plan.segments(units.clone()) {
            let block = &plan.blocks[at];
            let names: Vec<String> = inside.clone().map(|unit| block.units.name(unit).into_owned()).collect();
            held[at] = Units::Held(block.units.len(), inside.start, names.into());
            let encoded = &mut table.blocks[at];
            encoded.first_unit = inside.start;
            encoded.cases.reserve_exact((inside.end - inside.start) as usize * block.variants.len());
            let mut from = inside.start;
            while from < inside.end {
                let to = inside.end.min(from + ENCODED_AT_ONCE);
                // Makes cases in parallel but encodes them in order, so that the tables do not depend on the number of
                // threads.
                let cases: Vec<(Vec<Case>, f64)> =
                    (from..to).into_par_iter().map(|unit| self.cases(at, unit)).collect::<Result<_>>()?;
                for (cases, gap_m) in &cases {
                    let encode = |case| LaneCase::encode(case, profile, &mut table.tables).ahead_by(*gap_m);
                    encoded.cases.extend(cases.iter().map(encode));
                }
                from = to;
            }
        }
        check_cases(profile, &plan.blocks, &table, plan.segments(units))?;
        Ok(plan.holding(held, Arc::new(table)))
    }

    /// Passes plans of consecutive windows of an interval to `each`, each with the cases of a limited number of units.
    ///
    /// # Errors
    /// Those of `each`, and as [`StudyCases::window`].
    pub(crate) fn in_windows(
        &self,
        units: Range<u64>,
        max_units: u64,
        mut each: impl FnMut(&LanePlan, Range<u64>) -> Result<()>,
    ) -> Result<()> {
        let mut from = units.start;
        while from < units.end {
            let mut to = units.end.min(from.saturating_add(max_units.max(1)));
            while to - from > 1 && self.entries(from..to) > MAX_ENTRIES_AT_ONCE {
                to = from + (to - from) / 2;
            }
            each(&self.window(from..to)?, from..to)?;
            from = to;
        }
        Ok(())
    }

    /// Sweeps an interval, window by window; passes chunks with the plan of their window.
    ///
    /// # Errors
    /// As [`StudyCases::window`] and [`Executor::sweep`].
    pub fn sweep(
        &self,
        units: Range<u64>,
        wanted: Wanted,
        executor: &Executor,
        mut each: impl FnMut(&LanePlan, Chunk) -> Result<()>,
    ) -> Result<SweepSummary> {
        let window = if executor.fallback.is_some() { DEVICE_WINDOW } else { WINDOW };
        let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
        let (from, to) = (units.start, units.end);
        self.in_windows(units, window, |plan, units| {
            let end = units.end;
            summary.add(&executor.sweep(plan, units, wanted, |chunk| each(plan, chunk))?);
            executor.check_cancelled(end - from, to - from)
        })?;
        Ok(summary)
    }

    /// Maximum total number of values in the series of these units' cases.
    fn entries(&self, units: Range<u64>) -> f64 {
        let grid = TimeGrid::of(&self.outline.profile);
        let of_segment = |(at, inside): (usize, Range<u64>)| {
            let block = &self.outline.blocks[at];
            let ids = parameterizations(block.category, self.reductions[at].is_some());
            let scenarios = inside.filter_map(|unit| self.scenario(block.first_unit + unit));
            let steps: f64 = scenarios.map(|scenario| steps_of(scenario.duration_s(), grid) as f64).sum();
            steps * entries_per_step(block.category, ids, self.head.blocks[at].others().count())
        };
        self.outline.segments(units).into_iter().map(of_segment).sum()
    }

    /// S, then every S', of a unit of a block. Also the common initial gap if no headway sets it, m.
    fn cases(&self, at: usize, unit: u64) -> Result<(Vec<Case>, f64)> {
        let block = &self.outline.blocks[at];
        let scenario = self.scenario(block.first_unit + unit);
        let scenario = scenario.ok_or_else(|| Error::Internal(format!("scenario {unit} of a study is not held")))?;
        let reduction = self.reductions[at].as_ref();
        let (grid, options) = (TimeGrid::of(&self.outline.profile), &self.head.parameterization);
        let mut cases = vec![recorded_case(scenario, grid)?];
        for id in parameterizations(block.category, reduction.is_some()) {
            cases.push(id.case(scenario, grid, options, reduction)?);
        }
        let fold = scenario.fold.and_then(|fold| self.folds[at].get(fold));
        for id in decompositions(block.category).filter(|_| !self.folds[at].is_empty()) {
            cases.push(id.case(scenario, grid, options, fold)?);
        }
        let sizes = Sizes::of(scenario);
        for replay in &scenario.replays {
            cases.push(replay.case(block.category, &sizes, grid)?);
        }
        Ok((cases, scenario.gap0.unwrap_or(0.0)))
    }
}

/// The parameterizations of a category, with or without those that need a decomposition.
pub(crate) fn parameterizations(category: Category, has_reduction: bool) -> impl Iterator<Item = Parameterization> {
    Parameterization::of(category).filter(move |id| id.features().is_some() || has_reduction)
}

/// Those of them that need one.
pub(super) fn decompositions(category: Category) -> impl Iterator<Item = Parameterization> {
    Parameterization::of(category).filter(|id| id.coefficients().is_some())
}

/// Maximum number of entries of the cases in memory at once, for any time step: 2 GiB.
const MAX_ENTRIES_AT_ONCE: f64 = (1 << 28) as f64;

/// Number of series values of a scenario per step, with its parameterizations: speed, lateral position and lateral
/// speed of each sampled one. A cut-out adds the speed of the vehicle ahead; an LVD has no lateral series.
pub(super) fn entries_per_step(category: Category, ids: impl Iterator<Item = Parameterization>, replays: usize) -> f64 {
    let sampled = ids.filter(Parameterization::has_series).count() + 1 + replays;
    let series = match category {
        Category::CutIn => 3,
        Category::CutOut => 4,
        Category::Lvd => 1,
    };
    (sampled * series) as f64
}
