//! A swept grid: the verdicts of every cell and model, shares, and the difference of two maps.

use crate::engine::{Executor, LanePlan, LaneRunner, SweepSummary, Verdicts, Wanted};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::{Error, Place, Result};

use super::grid::Grid;
use super::plan::GridPlan;

/// The verdicts of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct GridMap {
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Per model, per cell.
    verdicts: Vec<Vec<Verdicts>>,
    /// Per model and criterion, the cells whose verdict a perturbation changes; empty where none was swept.
    undecided: Vec<[Vec<bool>; Criterion::ALL.len()]>,
}

/// Two verdicts on one cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Agreement {
    /// Neither fails.
    BothPass,
    /// Both fail.
    BothFail,
    /// The first fails alone.
    OnlyFirst,
    /// The second fails alone.
    OnlySecond,
    /// They differ, but one of them is undecided.
    Undecided,
}

impl Agreement {
    /// All, in the order of tables.
    pub const ALL: [Agreement; 5] =
        [Agreement::BothPass, Agreement::BothFail, Agreement::OnlyFirst, Agreement::OnlySecond, Agreement::Undecided];

    /// From the two.
    pub fn of(first_fails: bool, second_fails: bool) -> Agreement {
        match (first_fails, second_fails) {
            (false, false) => Agreement::BothPass,
            (true, true) => Agreement::BothFail,
            (true, false) => Agreement::OnlyFirst,
            (false, true) => Agreement::OnlySecond,
        }
    }

    /// Name in files: `both_pass`, `both_fail`, `only_first`, `only_second`, `undecided`.
    pub fn key(self) -> &'static str {
        match self {
            Agreement::BothPass => "both_pass",
            Agreement::BothFail => "both_fail",
            Agreement::OnlyFirst => "only_first",
            Agreement::OnlySecond => "only_second",
            Agreement::Undecided => "undecided",
        }
    }
}

impl GridMap {
    /// Sweeps a planned grid.
    ///
    /// # Errors
    /// Of the backend; [`Error::Verification`] where a checked lane differs; [`Error::Usage`] where every lane ends at
    /// the time cap, so that the map says nothing.
    pub fn sweep(plan: &GridPlan, executor: &Executor) -> Result<(GridMap, SweepSummary)> {
        let cells = plan.grid.cell_count();
        let mut verdicts = vec![vec![Verdicts::default(); cells]; plan.models.len()];
        let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
        for part in &plan.parts {
            let lanes = &part.plan;
            // Where the part's models stand among all.
            let of_part: Vec<Option<usize>> =
                lanes.models.iter().map(|model| plan.models.iter().position(|m| m == model)).collect();
            let per_unit = lanes.headways.len() * lanes.models.len();
            let swept = executor.sweep(lanes, 0..lanes.unit_count(), Wanted::Verdicts, |chunk| {
                for (units, of_unit) in (chunk.units.start..).zip(chunk.verdicts.chunks(per_unit.max(1))) {
                    for (at, verdict) in of_unit.iter().enumerate() {
                        let cell = part.cell(&plan.grid, units, at / lanes.models.len());
                        if let Some(model) = of_part[at % lanes.models.len()] {
                            verdicts[model][cell] = *verdict;
                        }
                    }
                }
                Ok(())
            })?;
            summary.add(&swept);
        }
        let map = GridMap { models: plan.models.clone(), verdicts, undecided: Vec::new() };
        map.check_ends(plan)?;
        Ok((map, summary))
    }

    /// Marks the cells whose verdict is another one in a perturbed sweep of the same grid.
    pub fn mark_undecided(&mut self, perturbed: &GridMap) {
        let cells = self.cell_count();
        self.undecided.resize_with(self.models.len(), || std::array::from_fn(|_| vec![false; cells]));
        for (model, of_model) in self.undecided.iter_mut().enumerate() {
            for (criterion, marks) in Criterion::ALL.into_iter().zip(of_model) {
                for (cell, mark) in marks.iter_mut().enumerate() {
                    let [ours, theirs] = [&*self.verdicts, &*perturbed.verdicts].map(|of| of[model][cell]);
                    *mark |= ours.failed(criterion) != theirs.failed(criterion);
                }
            }
        }
    }

    /// Were perturbed grids swept too?
    pub fn has_undecided(&self) -> bool {
        !self.undecided.is_empty()
    }

    /// Does a perturbation change the verdict of a model's cell? `false` where none was swept.
    pub fn is_undecided(&self, model: usize, cell: usize, criterion: Criterion) -> bool {
        self.undecided.get(model).is_some_and(|of_model| of_model[criterion as usize][cell])
    }

    /// Cells whose verdict a perturbation changes.
    pub fn undecided(&self, model: usize, criterion: Criterion) -> u64 {
        (0..self.cell_count()).filter(|&cell| self.is_undecided(model, cell, criterion)).count() as u64
    }

    /// Some lane must end before the time cap; under a profile whose runs all go on to it, another vehicle must come
    /// into the ego's lane.
    fn check_ends(&self, plan: &GridPlan) -> Result<()> {
        let lanes = plan.lane_count();
        let Some(frame) = plan.parts.first().map(|part| &part.plan.profile.frame) else { return Ok(()) };
        let all_capped = self.verdicts.iter().flatten().all(|verdict| verdict.capped());
        if lanes == 0 || !all_capped || !frame.end_when_settled && plan.parts.iter().any(|part| meets(&part.plan)) {
            return Ok(());
        }
        let alone = if frame.end_when_settled { "" } else { ", and no vehicle comes into the ego's lane" };
        let problem =
            format!("all {lanes} lanes end at the time cap of {} s{alone}: the map is empty", frame.time_cap_s);
        let help = format!(
            "check the time step ({} s, option `dt`), `frame.time_cap_s` of the profile, and the grid's speeds, lateral speeds \
             and gaps",
            frame.dt_s
        );
        Err(Error::usage(Place::item(format!("map {}", plan.grid.name())), problem, help))
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.verdicts.first().map_or(0, Vec::len)
    }

    /// The verdicts of a model's cell.
    pub fn verdicts(&self, model: usize, cell: usize) -> Verdicts {
        self.verdicts[model][cell]
    }

    /// Does a model fail, cell by cell?
    pub fn failed(&self, model: usize, criterion: Criterion) -> Vec<bool> {
        self.verdicts[model].iter().map(|v| v.failed(criterion)).collect()
    }

    /// Cells in which a model fails.
    pub fn failures(&self, model: usize, criterion: Criterion) -> u64 {
        self.verdicts[model].iter().filter(|v| v.failed(criterion)).count() as u64
    }

    /// Where two models' verdicts agree and differ, cell by cell; the second may be of another map of the same grid.
    pub fn difference(&self, first: usize, (other, second): (&GridMap, usize), criterion: Criterion) -> Vec<Agreement> {
        let agreement = |cell: usize| {
            let found = Agreement::of(
                self.verdicts[first][cell].failed(criterion),
                other.verdicts[second][cell].failed(criterion),
            );
            let is_undecided = self.is_undecided(first, cell, criterion) || other.is_undecided(second, cell, criterion);
            match found {
                Agreement::OnlyFirst | Agreement::OnlySecond if is_undecided => Agreement::Undecided,
                found => found,
            }
        };
        (0..self.cell_count()).map(agreement).collect()
    }
}

/// Is there a lane in which TTC and BTN look at another vehicle?
fn meets(plan: &LanePlan) -> bool {
    let runner = LaneRunner::<f32>::new(plan);
    let keys = (0..plan.lane_count()).filter_map(|lane| plan.key(lane));
    keys.map(|key| runner.run(&key)).any(|outcome| outcome.min_gap < f32::INFINITY)
}

/// Counts of the agreements, in the order of [`Agreement::ALL`].
pub fn count(cells: &[Agreement]) -> [u64; 5] {
    Agreement::ALL.map(|kind| cells.iter().filter(|c| **c == kind).count() as u64)
}

/// Ends of the lines between neighbouring cells of a panel that differ in kind: a line along a row's edge from place
/// to place, in cells from the panel's lower left corner, `((x, y), (x, y))`. Straight runs are one line.
pub fn boundary(grid: &Grid, kind: &dyn Fn(usize, usize) -> usize) -> Vec<((usize, usize), (usize, usize))> {
    let (nx, ny) = (grid.x().len(), grid.y().len());
    let mut lines = Vec::new();
    for j in 1..ny {
        for (from, to) in runs(nx, &|i| kind(i, j - 1) != kind(i, j)) {
            lines.push(((from, j), (to, j)));
        }
    }
    for i in 1..nx {
        for (from, to) in runs(ny, &|j| kind(i - 1, j) != kind(i, j)) {
            lines.push(((i, from), (i, to)));
        }
    }
    lines
}

/// Longest intervals of places at which something holds.
pub fn runs(count: usize, holds: &dyn Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut from = None;
    for k in 0..=count {
        match (from, k < count && holds(k)) {
            (None, true) => from = Some(k),
            (Some(start), false) => {
                found.push((start, k));
                from = None;
            }
            _ => {}
        }
    }
    found
}
