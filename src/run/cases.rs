//! Concrete cases in bulk: a row of numbers each, run with every headway and model. The columns are those of `simulate`
//! for a single case; the outcomes are those of its lanes.

use std::sync::Arc;

use rayon::prelude::*;

use lanesweep_engine::{
    Block, CaseTable, Chunk, EncodedBlock, Executor, Headway, LaneCase, LanePlan, LaneRunner, Outcome, Start, Units,
    Wanted,
};
use lanesweep_model::criterion::{Contact, Criterion};
use lanesweep_model::driver::ModelId;
use lanesweep_model::plausibility::{Doubts, Implausible};
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{CaseParameters, CaseQuantity, Category, Tables};
use lanesweep_support::{Error, Place, Result, option};

/// Name of the only variant.
const VARIANT: &str = "case";

/// Cases that are planned together.
pub struct Cases {
    plan: LanePlan,
    /// Row of every unit.
    rows: Vec<usize>,
    /// What was doubtful about the values, a sentence per kind.
    pub notes: Vec<String>,
}

impl Cases {
    /// Plans rows of parameters. Without headways every row has its own `gap` or `thw`; with headways none has.
    ///
    /// # Errors
    /// [`Error::Input`] that names row (from `first_row`) and column; [`Error::Usage`] without rows, and as
    /// [`LanePlan::new`].
    pub fn plan(
        rows: Vec<CaseParameters>,
        first_row: u64,
        profile: &Profile,
        models: &[ModelId],
        headways: &[Headway],
        implausible: Implausible,
    ) -> Result<Cases> {
        let mut doubts = Doubts::new(implausible);
        let mut cases = CaseRows::default();
        for (row, parameters) in (first_row..).zip(rows) {
            cases
                .push(|tables| encode(parameters, profile, headways, tables, &mut doubts, row))
                .map_err(|error| of_row(row, error))?;
        }
        if cases.count == 0 {
            return Err(Error::usage(Place::item("cases"), "there are no rows", "give at least one case"));
        }
        let headways = if headways.is_empty() { vec![Headway::Observed] } else { headways.to_vec() };
        let (blocks, source, rows) = cases.planned();
        let plan = LanePlan::new(profile.clone(), models.to_vec(), headways, blocks, source)?;
        Ok(Cases { plan, rows, notes: doubts.sentences() })
    }

    /// The lanes.
    pub fn lane_plan(&self) -> &LanePlan {
        &self.plan
    }

    /// Runs the lanes. Returns an outcome per row, headway and model, the last varying fastest.
    ///
    /// # Errors
    /// Those of the backend; [`Error::Interrupted`].
    pub fn run(&self, executor: &Executor) -> Result<Vec<Outcome<f64>>> {
        by_row(&self.plan, &self.rows, executor, Wanted::Outcomes, |chunk| &chunk.outcomes)
    }

    /// False where binary64 gives another verdict than these outcomes, which [`Cases::run`] returned. Only lanes near a limit
    /// run again; the others count as equal. `None` for drivers outside the registry.
    pub fn robust(&self, outcomes: &[Outcome<f64>]) -> Vec<Option<bool>> {
        let (plan, runner) = (&self.plan, LaneRunner::<f64>::new(&self.plan));
        let per_row = plan.headways.len() * plan.models.len();
        let mut unit_of = vec![0; self.rows.len()];
        self.rows.iter().zip(0..).for_each(|(row, unit)| unit_of[*row] = unit);
        let robust = |(at, outcome): (usize, &Outcome<f64>)| {
            if plan.models[at % plan.models.len()].foreign().is_some() {
                return None;
            }
            if !is_near_a_limit(outcome, &plan.profile) {
                return Some(true);
            }
            let key = plan.key(plan.first_lane_of(unit_of[at / per_row]) + (at % per_row) as u64)?;
            let failures = |outcome: &Outcome<f64>| Criterion::ALL.map(|criterion| outcome.verdicts.failed(criterion));
            Some(failures(&runner.run(&key)) == failures(outcome))
        };
        outcomes.par_iter().enumerate().map(robust).collect()
    }
}

/// Whether a verdict is within 2 cm or 1.5 m/s of a contact, or within 7 % of a threshold: nearly all verdicts
/// that differ between the arithmetics do so there (`benches/python/robust.py`).
fn is_near_a_limit(outcome: &Outcome<f64>, profile: &Profile) -> bool {
    let near = |value: f64, limit: f64| (value - limit).abs() <= 0.07 * limit;
    let of_contact =
        if outcome.contact == Contact::None { outcome.min_gap < 0.02 } else { outcome.impact_closing_speed < 1.5 };
    let criteria = &profile.criteria;
    of_contact || near(outcome.min_ttc, criteria.ttc_threshold_s) || near(outcome.max_btn, criteria.btn_threshold)
}

/// Lane cases of several categories, with the rows that they come from.
#[derive(Default)]
pub(super) struct CaseRows {
    source: CaseTable,
    by_category: Vec<(Category, Vec<usize>)>,
    count: usize,
}

impl CaseRows {
    /// Adds the case of the next row.
    ///
    /// # Errors
    /// That of `encode`: the case is left out, and its row has no number.
    pub(super) fn push(
        &mut self,
        encode: impl FnOnce(&mut Tables<f64>) -> Result<(Category, LaneCase<f64>)>,
    ) -> Result<()> {
        let (category, case) = encode(&mut self.source.tables)?;
        let block = self.by_category.iter().position(|(known, _)| *known == category).unwrap_or_else(|| {
            self.by_category.push((category, Vec::new()));
            self.source.blocks.push(EncodedBlock { first_unit: 0, variants: 1, cases: Vec::new() });
            self.by_category.len() - 1
        });
        self.by_category[block].1.push(self.count);
        self.source.blocks[block].cases.push(case);
        self.count += 1;
        Ok(())
    }

    /// The blocks of a plan with these cases, their source, and the row of every unit.
    pub(super) fn planned(self) -> (Vec<Block>, Arc<CaseTable>, Vec<usize>) {
        let block = |(category, rows): &(Category, Vec<usize>)| {
            Block::new(*category, Units::Numbered(rows.len() as u64), vec![VARIANT.to_owned()])
        };
        let blocks = self.by_category.iter().map(block).collect();
        (blocks, Arc::new(self.source), self.by_category.into_iter().flat_map(|(_, rows)| rows).collect())
    }
}

/// Runs a plan of [`CaseRows`]. Returns what `lanes` takes of a chunk per row, headway and model, the last varying fastest.
///
/// # Errors
/// Those of the backend; [`Error::Interrupted`].
pub(super) fn by_row<T: Copy>(
    plan: &LanePlan,
    rows: &[usize],
    executor: &Executor,
    wanted: Wanted,
    lanes: impl Fn(&Chunk) -> &[T],
) -> Result<Vec<T>> {
    let per_row = plan.headways.len() * plan.models.len();
    let mut all: Vec<Option<T>> = vec![None; rows.len() * per_row];
    executor.sweep(plan, 0..plan.unit_count(), wanted, |chunk| {
        let rows = &rows[chunk.units.start as usize..chunk.units.end as usize];
        for (row, lanes) in rows.iter().zip(lanes(&chunk).chunks(per_row)) {
            all[row * per_row..].iter_mut().zip(lanes).for_each(|(to, lane)| *to = Some(*lane));
        }
        Ok(())
    })?;
    let all: Option<Vec<_>> = all.into_iter().collect();
    all.ok_or_else(|| Error::Internal("a case has no lane".to_owned()))
}

/// The lane case of a row.
fn encode(
    mut parameters: CaseParameters,
    profile: &Profile,
    headways: &[Headway],
    tables: &mut Tables<f64>,
    doubts: &mut Doubts,
    row: u64,
) -> Result<(Category, LaneCase<f64>)> {
    let place = |key: &str| place_of(row, key).to_string();
    let (frame, size_m) = (&profile.frame, [profile.frame.default_length_m, profile.frame.default_width_m]);
    let plain = parameters.checked_case(size_m, frame.time_cap_s, doubts, &place)?;
    let (gap_m, thw_s) = (parameters[CaseQuantity::Gap], parameters[CaseQuantity::Thw]);
    let start = match (gap_m, thw_s) {
        (Some(gap_m), _) => Some(Start::Gap(gap_m)),
        (None, thw_s) => thw_s.map(Start::Headway),
    };
    let mut case = LaneCase::encode(&plain.case(frame.time_cap_s)?, profile, tables);
    match (start, headways.is_empty()) {
        (Some(start), true) => case = case.ahead_by(start.gap(plain.ego_speed_mps)),
        (None, false) => {}
        (Some(_), false) => {
            let key = if gap_m.is_some() { "gap" } else { "thw" };
            let problem = "the case has its own start, and headways are given for all cases";
            return Err(Error::usage(Place::item(key), problem, format!("leave out the column or {}", option("thw"))));
        }
        (None, true) => {
            let help = format!("give a column `gap` (m) or `thw` (s), or {} for all cases", option("thw"));
            return Err(Error::usage(Place::item("gap"), "the initial distance is missing", help));
        }
    }
    Ok((plain.category, case))
}

/// The place of a value of a row.
fn place_of(row: u64, key: &str) -> Place {
    Place::item(format!("row {row}")).column(key)
}

/// Adds the row to an error about a value.
fn of_row(row: u64, error: Error) -> Error {
    match error {
        Error::Usage { place, problem, help } => {
            Error::input(place_of(row, &place.item.unwrap_or_default()), problem, help)
        }
        other => other,
    }
}
