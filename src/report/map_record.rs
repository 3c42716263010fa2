//! `map.json`: a `map` run with everything needed to reproduce it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::map::{Difference, MapHost, MapReport};
use super::records::{PROGRAM, document};
use super::run_record::SettingRecord;
use crate::Result;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::grid::{Against, CaseStyle, CellOutcome, GridAxis, MappedGrid, count};

impl MapReport {
    /// `map.json`: fractions, differences and everything needed to reproduce them; `files` are in the same folder.
    ///
    /// # Errors
    /// None for a record of this program.
    pub fn json(&self, files: Vec<String>) -> Result<String> {
        let shown = self.shown_outcomes();
        let record = MapRecord {
            program: PROGRAM.to_owned(),
            preset: self.preset.as_deref(),
            criterion: self.criterion.key(),
            against: self.against.as_ref().map(|_| self.against_name()),
            simulations: self.simulations(),
            grids: self.grids.iter().map(|mapped| GridRecord::of(mapped, self.criterion, &shown)).collect(),
            differences: self.differences().iter().map(DifferenceRecord::of).collect(),
            profile: &self.profile,
            other_profile: match &self.against {
                Some(Against::Profile(profile)) => Some(profile),
                _ => None,
            },
            settings: &self.host.settings,
            files,
            host: &self.host,
        };
        document(&record)
    }
}

/// `map.json`.
#[derive(Serialize)]
struct MapRecord<'a> {
    program: String,
    preset: Option<&'a str>,
    criterion: &'static str,
    against: Option<String>,
    simulations: u64,
    grids: Vec<GridRecord<'a>>,
    differences: Vec<DifferenceRecord>,
    profile: &'a Profile,
    other_profile: Option<&'a Profile>,
    settings: &'a [SettingRecord],
    /// Names of the other files.
    files: Vec<String>,
    host: &'a MapHost,
}

#[derive(Serialize)]
struct GridRecord<'a> {
    name: &'a str,
    category: &'static str,
    x: AxisRecord<'a>,
    y: AxisRecord<'a>,
    panel_parameters: Vec<&'static str>,
    panels: &'a [Vec<f64>],
    fixed: Vec<(&'static str, f64)>,
    cases: CaseStyle,
    native_gap: bool,
    cells: usize,
    /// Cut-outs: cells in which the vehicle that cuts out drives through the one ahead of it.
    drives_through: usize,
    /// Whether the grid was chosen to match a known fraction.
    chosen_to_match: bool,
    shares: Vec<ShareRecord>,
    plans: Vec<PlanRecord<'a>>,
}

#[derive(Serialize)]
struct AxisRecord<'a> {
    parameter: &'static str,
    values: &'a [f64],
}

#[derive(Serialize)]
struct ShareRecord {
    model: &'static str,
    failures: u64,
    share: f64,
    /// Cells by outcome (no conflict, pass, fail, …), for the outcomes that tables and legends count.
    outcomes: BTreeMap<&'static str, u64>,
    /// Cells whose outcome a perturbation changes, if perturbed cases were swept.
    #[serde(skip_serializing_if = "Option::is_none")]
    undecided: Option<u64>,
    known_percent: Option<f64>,
}

/// Cells by agreement of two verdicts.
#[derive(Serialize)]
struct DifferenceRecord {
    map: String,
    model: &'static str,
    first: String,
    second: String,
    both_pass: u64,
    both_fail: u64,
    only_first_fails: u64,
    only_second_fails: u64,
    no_conflict: u64,
    undecided: u64,
}

impl DifferenceRecord {
    fn of(difference: &Difference) -> DifferenceRecord {
        let [both_pass, both_fail, only_first_fails, only_second_fails, no_conflict, undecided] =
            count(&difference.cells);
        DifferenceRecord {
            map: difference.grid.name().to_owned(),
            model: difference.model.name(),
            first: difference.first.clone(),
            second: difference.second.clone(),
            both_pass,
            both_fail,
            only_first_fails,
            only_second_fails,
            no_conflict,
            undecided,
        }
    }
}

/// A plan: the same hash means the same lanes.
#[derive(Serialize)]
struct PlanRecord<'a> {
    models: Vec<&'static str>,
    profile: &'a str,
    lanes: u64,
    plan_sha256: &'a str,
}

impl<'a> GridRecord<'a> {
    fn of(mapped: &'a MappedGrid, criterion: Criterion, shown: &[CellOutcome]) -> GridRecord<'a> {
        let (grid, map) = (&mapped.plan.grid, &mapped.map);
        fn axis(axis: &GridAxis) -> AxisRecord<'_> {
            AxisRecord { parameter: axis.parameter.key, values: &axis.values }
        }
        let share = |(at, model): (usize, &ModelId)| {
            let failures = map.failures(at, criterion);
            let share = failures as f64 / map.cell_count() as f64;
            let counts = map.outcomes(at, criterion);
            let undecided = map.has_undecided().then_some(counts[CellOutcome::Undecided as usize]);
            let outcomes = shown.iter().map(|outcome| (outcome.label(), counts[*outcome as usize])).collect();
            let known_percent = mapped.known_percent[at];
            ShareRecord { model: model.name(), failures, share, outcomes, undecided, known_percent }
        };
        let others = mapped.other.iter().flat_map(|(_, plan, _)| &plan.parts);
        GridRecord {
            name: grid.name(),
            category: grid.category().key(),
            x: axis(grid.x()),
            y: axis(grid.y()),
            panel_parameters: grid.panel_axes().iter().map(|a| a.parameter.key).collect(),
            panels: grid.panels(),
            fixed: grid.fixed().iter().map(|(p, value)| (p.key, *value)).collect(),
            cases: grid.style(),
            native_gap: grid.has_native_gap(),
            drives_through: mapped.drives_through.iter().filter(|drives| **drives).count(),
            cells: map.cell_count(),
            chosen_to_match: mapped.is_chosen_to_match,
            shares: map.models.iter().enumerate().map(share).collect(),
            plans: (mapped.plan.parts.iter().chain(others))
                .map(|part| PlanRecord {
                    models: part.plan.models.iter().map(|m| m.name()).collect(),
                    profile: &part.plan.profile.name,
                    lanes: part.plan.lane_count(),
                    plan_sha256: part.plan.hash(),
                })
                .collect(),
        }
    }
}
