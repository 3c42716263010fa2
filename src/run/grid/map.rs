//! A swept grid: the verdicts of every cell and model, outcomes per cell and counts.

use crate::check::Answer;
use lanesweep_engine::{Executor, LanePlan, LaneRunner, SweepSummary, Verdicts, Wanted};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_support::{Error, Place, Result, option};

use super::Grid;
use super::plan::{GridPart, GridPlan};

/// The verdicts of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct GridMap {
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Per model, per cell.
    verdicts: Vec<Vec<Verdicts>>,
    /// Per model and cell: an ego that never reacts. Models differ if each starts at
    /// its own distance.
    unreacting: Vec<Vec<Verdicts>>,
    /// Lanes end once they are settled, so that one at the time cap still closes in.
    settles: bool,
    /// Cut-outs: per cell, whether the vehicle that cuts out drives through the one ahead of it. Else empty.
    pub(super) drives_through: Vec<bool>,
    /// Per model and criterion: the cells whose outcome a perturbation changes; empty if none was swept.
    undecided: Vec<[Vec<bool>; Criterion::ALL.len()]>,
}

impl GridMap {
    /// Sweeps a planned grid.
    ///
    /// # Errors
    /// Those of the backend; [`Error::Verification`] if a rechecked lane differs; [`Error::Usage`] if every lane ends
    /// at the time cap, because the map would have no information.
    pub fn sweep(plan: &GridPlan, executor: &Executor) -> Result<(GridMap, SweepSummary)> {
        let cells = plan.grid.cell_count();
        let mut verdicts = vec![vec![Verdicts::default(); cells]; plan.models.len()];
        let mut unreacting = vec![vec![Verdicts::default(); cells]; plan.models.len()];
        let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
        for part in &plan.parts {
            // Index of the part's model in the whole plan.
            let position = |model: &ModelId| plan.models.iter().position(|m| m == model);
            let of_part: Vec<Option<usize>> = part.plan.models.iter().map(position).collect();
            let swept = sweep_cells(plan, part, &part.plan, executor, |at, cell, verdict| {
                if let Some(model) = of_part[at] {
                    verdicts[model][cell] = verdict;
                }
            })?;
            summary.add(&swept);
            let swept = sweep_cells(plan, part, &part.unreacting, executor, |_, cell, verdict| {
                for model in of_part.iter().flatten() {
                    unreacting[*model][cell] = verdict;
                }
            })?;
            summary.add(&swept);
        }
        let settles = plan.parts.iter().all(|part| part.plan.profile.frame.end_when_settled);
        let (models, drives_through, undecided) = (plan.models.clone(), Vec::new(), Vec::new());
        let map = GridMap { models, verdicts, unreacting, settles, drives_through, undecided };
        map.check_ends(plan)?;
        Ok((map, summary))
    }

    /// Marks the cells whose outcome changes in a perturbed sweep of the same grid.
    pub(super) fn mark_undecided(&mut self, perturbed: &GridMap) {
        let cells = self.cell_count();
        let mut undecided = std::mem::take(&mut self.undecided);
        undecided.resize_with(self.models.len(), || std::array::from_fn(|_| vec![false; cells]));
        for (model, of_model) in undecided.iter_mut().enumerate() {
            for (criterion, marks) in Criterion::ALL.into_iter().zip(of_model) {
                for (cell, mark) in marks.iter_mut().enumerate() {
                    let [ours, theirs] = [&*self.verdicts, &*perturbed.verdicts].map(|of| of[model][cell]);
                    let conflict_differs = self.is_conflict(model, cell) != perturbed.is_conflict(model, cell);
                    *mark |= ours.failed(criterion) != theirs.failed(criterion)
                        || criterion == Criterion::Collision && conflict_differs;
                }
            }
        }
        self.undecided = undecided;
    }

    /// Whether perturbed grids were swept.
    pub fn has_undecided(&self) -> bool {
        !self.undecided.is_empty()
    }

    /// Whether a perturbation changes the outcome of a model's cell; `false` if none was swept.
    pub fn is_undecided(&self, model: usize, cell: usize, criterion: Criterion) -> bool {
        self.undecided.get(model).is_some_and(|of_model| of_model[criterion as usize][cell])
    }

    /// Whether an ego that never reacts collides when it starts where the model starts.
    pub fn is_conflict(&self, model: usize, cell: usize) -> bool {
        self.unreacting[model][cell].failed(Criterion::Collision)
    }

    /// Whether the lane of an ego that never reacts ends at the time cap while the gap still closes, so that it does not
    /// show whether there is a conflict.
    fn is_open(&self, model: usize, cell: usize, criterion: Criterion) -> bool {
        let unreacting = self.unreacting[model][cell];
        let is_open = self.settles && unreacting.capped() && !unreacting.failed(Criterion::Collision);
        criterion == Criterion::Collision && is_open && !self.verdicts[model][cell].failed(criterion)
    }

    /// Whether no traffic is as in the cell: the vehicle that cuts out drives through the one ahead of it. Shares and
    /// boundaries are those of the other cells.
    pub fn drives_through(&self, cell: usize) -> bool {
        self.drives_through.get(cell).is_some_and(|drives| *drives)
    }

    /// Number of cells with possible traffic.
    pub fn possible_cells(&self) -> usize {
        (0..self.cell_count()).filter(|cell| !self.drives_through(*cell)).count()
    }

    /// The outcome of a model's cell.
    pub fn outcome(&self, model: usize, cell: usize, criterion: Criterion) -> CellOutcome {
        let fails = self.verdicts[model][cell].failed(criterion);
        // A conflict is an imminent collision; it has no meaning for the other criteria.
        let is_conflict = criterion != Criterion::Collision || self.is_conflict(model, cell);
        let is_undecided = self.is_undecided(model, cell, criterion) || self.is_open(model, cell, criterion);
        match (is_undecided, is_conflict, fails) {
            _ if self.drives_through(cell) => CellOutcome::NoTraffic,
            (true, ..) => CellOutcome::Undecided,
            (false, true, false) => CellOutcome::Pass,
            (false, true, true) => CellOutcome::Fail,
            (false, false, false) => CellOutcome::NoConflict,
            (false, false, true) => CellOutcome::FailByReaction,
        }
    }

    /// Cells of a model by outcome, in the order of [`CellOutcome::ALL`].
    pub fn outcomes(&self, model: usize, criterion: Criterion) -> [u64; CellOutcome::ALL.len()] {
        let mut counts = [0; CellOutcome::ALL.len()];
        for cell in 0..self.cell_count() {
            counts[self.outcome(model, cell, criterion) as usize] += 1;
        }
        counts
    }

    /// Checks that some lane ends before the time cap. Under a profile whose runs all last until the cap, it checks
    /// instead that another vehicle enters the ego's lane.
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
            "check the time step ({} s, {}), `frame.time_cap_s` of the profile, and the grid's speeds, lateral speeds \
             and gaps",
            frame.dt_s,
            option("dt")
        );
        Err(Error::usage(Place::item(format!("map {}", plan.grid.name)), problem, help))
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.verdicts.first().map_or(0, Vec::len)
    }

    /// The verdicts of a model's cell.
    pub fn verdicts(&self, model: usize, cell: usize) -> Verdicts {
        self.verdicts[model][cell]
    }

    /// Cells with possible traffic in which a model fails.
    pub fn failures(&self, model: usize, criterion: Criterion) -> u64 {
        let fails = |cell: &usize| self.verdicts[model][*cell].failed(criterion) && !self.drives_through(*cell);
        (0..self.cell_count()).filter(fails).count() as u64
    }

    /// Fraction of the cells with possible traffic in which a model fails; NaN without such a cell.
    pub fn share(&self, model: usize, criterion: Criterion) -> f64 {
        self.failures(model, criterion) as f64 / self.possible_cells() as f64
    }
}

/// Sweeps the lanes of a part; `take` receives the model's index in the plan, the cell and the verdict.
fn sweep_cells(
    plan: &GridPlan,
    part: &GridPart,
    lanes: &LanePlan,
    executor: &Executor,
    mut take: impl FnMut(usize, usize, Verdicts),
) -> Result<SweepSummary> {
    let models = lanes.models.len().max(1);
    let per_unit = (lanes.headways.len() * models).max(1);
    executor.sweep(lanes, 0..lanes.unit_count(), Wanted::Verdicts, |chunk| {
        for (unit, of_unit) in (chunk.units.start..).zip(chunk.verdicts.chunks(per_unit)) {
            for (at, verdict) in of_unit.iter().enumerate() {
                take(at % models, part.cell(&plan.grid, unit, at / models), *verdict);
            }
        }
        Ok(())
    })
}

/// Whether TTC and BTN evaluate another vehicle in some lane.
fn meets(plan: &LanePlan) -> bool {
    let runner = LaneRunner::<f32>::new(plan);
    let keys = (0..plan.lane_count()).filter_map(|lane| plan.key(lane));
    keys.map(|key| runner.run(&key)).any(|outcome| outcome.min_gap < f32::INFINITY)
}

/// Boundary lines between neighbouring cells of a panel that differ in kind. Each line follows cell edges from `(x, y)`
/// to `(x, y)`, in cells from the panel's lower left corner. Straight runs are one line.
pub fn boundary(grid: &Grid, kind: &dyn Fn(usize, usize) -> usize) -> Vec<((usize, usize), (usize, usize))> {
    let (nx, ny) = (grid.x.len(), grid.y.len());
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

/// Maximal intervals of indices for which a condition holds.
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

/// Outcome of a model's cell. No conflict means that no collision occurs even if the ego never reacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellOutcome {
    /// There is no conflict, and the driver does not collide. Only maps of collisions have it.
    NoConflict,
    /// The driver passes; in a map of collisions, there is a conflict.
    Pass,
    /// The driver fails; in a map of collisions, there is a conflict.
    Fail,
    /// There is no conflict, but the driver reacts and collides.
    FailByReaction,
    /// A perturbation changes the verdict, or whether there is a conflict; or the lane of an ego that never
    /// reacts ends at the time cap while the gap still closes.
    Undecided,
    /// No traffic is as in this cell: [`GridMap::drives_through`].
    NoTraffic,
}

impl CellOutcome {
    /// All, in the order of tables and legends.
    pub const ALL: [CellOutcome; 6] = [
        CellOutcome::NoConflict,
        CellOutcome::Pass,
        CellOutcome::Fail,
        CellOutcome::FailByReaction,
        CellOutcome::Undecided,
        CellOutcome::NoTraffic,
    ];

    /// Text for tables, legends and files; the outcome without a conflict has the same word as on a sheet.
    pub fn label(self) -> &'static str {
        match self {
            CellOutcome::NoConflict => Answer::NoConflict.label(),
            CellOutcome::Pass => "pass",
            CellOutcome::Fail => "fail",
            CellOutcome::FailByReaction => "fail by reaction",
            CellOutcome::Undecided => "undecided",
            CellOutcome::NoTraffic => "no such traffic",
        }
    }
}
