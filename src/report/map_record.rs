//! `map.json`: a `map` run with everything needed to reproduce it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::map::MapReport;
use super::records::{PROGRAM, document, record};
use lanesweep_engine::ENGINE_VERSION;
use lanesweep_run::grid::{CellOutcome, GridAxis, MappedGrid};
use lanesweep_support::Result;
use lanesweep_support::run_folder::ResultFiles;

impl MapReport {
    /// `map.json`: fractions and everything needed to reproduce them; `files` are in the same folder.
    ///
    /// # Errors
    /// None for a record of this program.
    pub fn json(&self, files: &ResultFiles) -> Result<String> {
        let (shown, host) = (self.shown_outcomes(), &self.host);
        document(&record! {
            program: PROGRAM,
            engine: ENGINE_VERSION,
            commit: host.commit(),
            preset: &self.preset,
            criterion: self.criterion.key(),
            simulations: self.simulations(),
            grids: self.grids.iter().map(|mapped| self.grid_record(mapped, &shown)).collect::<Vec<_>>(),
            profile: &self.profile,
            settings: &host.settings,
            #[serde(flatten)]
            files: files,
            host: record! {
                backend: &host.backend,
                device: &host.device,
                sweep: &self.sweep,
                threads: host.threads,
                plan_s: self.plan_s,
                sweep_s: host.seconds,
            },
        })
    }

    pub(super) fn grid_record<'a>(&self, mapped: &'a MappedGrid, shown: &[CellOutcome]) -> impl Serialize + use<'a> {
        let (grid, map) = (&mapped.plan.grid, &mapped.map);
        let axis = |axis: &'a GridAxis| record! { parameter: axis.parameter.key, values: &axis.values };
        let shares = map.models.iter().enumerate().map(|(at, model)| {
            let counts = map.outcomes(at, self.criterion);
            let outcomes = shown.iter().map(|outcome| (outcome.label(), counts[*outcome as usize]));
            record! {
                model: model.name(),
                failures: map.failures(at, self.criterion),
                // Of the cells with possible traffic.
                share: map.share(at, self.criterion),
                // Cells by outcome (no conflict, pass, fail, …), for the outcomes that tables and legends count.
                outcomes: outcomes.collect::<BTreeMap<_, _>>(),
                known_percent: mapped.known_percent[at],
            }
        });
        // The same hash means the same lanes.
        let plans = mapped.plan.parts.iter().map(|part| {
            record! {
                models: part.plan.models.iter().map(|m| m.name()).collect::<Vec<_>>(),
                profile: &part.plan.profile.name,
                lanes: part.plan.lane_count(),
                plan_sha256: part.plan.hash(),
            }
        });
        record! {
            name: &grid.name,
            category: grid.category.key(),
            x: axis(&grid.x),
            y: axis(&grid.y),
            panel_parameters: grid.panel_axes.iter().map(|a| a.parameter.key).collect::<Vec<_>>(),
            panels: grid.panels(),
            fixed: grid.fixed.iter().map(|(p, value)| (p.key, *value)).collect::<Vec<_>>(),
            cases: grid.style,
            native_gap: grid.native_gap,
            cells: map.cell_count(),
            // Cut-outs: cells in which the vehicle that cuts out drives through the one ahead of it.
            drives_through: map.cell_count() - map.possible_cells(),
            // Whether the grid was chosen to match a known fraction.
            chosen_to_match: mapped.is_chosen_to_match,
            shares: shares.collect::<Vec<_>>(),
            plans: plans.collect::<Vec<_>>(),
        }
    }
}
