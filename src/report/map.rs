//! The files, sheets and page of a `map` run. Tables are in `map_tables.rs`, `map.json` in `map_record.rs`.

use super::credibility::{RunKind, annex};
use super::host::{Host, SweepRecord};
use super::html::{Page, PageFigure, Section};
use super::map_sheet::{MapSheet, agreement, outcome};
use super::records::publish;
use crate::Result;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::grid::{Against, Agreement, CaseStyle, CellOutcome, Grid, GridPlan, MappedGrid};
use crate::support::readable::count;
use crate::support::run_folder::{ResultFiles, Results};

/// A complete run.
pub struct MapReport {
    /// The grids.
    pub grids: Vec<MappedGrid>,
    /// Criterion of fractions, sheets and differences.
    pub criterion: Criterion,
    /// Reference of the comparison, if any.
    pub against: Option<Against>,
    /// Profile.
    pub profile: Profile,
    /// Preset, if used.
    pub preset: Option<String>,
    /// Facts about the machine; its time is that of the lanes.
    pub host: Host,
    /// Statistics of the sweep.
    pub sweep: SweepRecord,
    /// Duration of planning, s.
    pub plan_s: f64,
}

/// A difference between two verdicts, for every cell of a grid.
pub(super) struct Difference<'a> {
    plan: &'a GridPlan,
    pub(super) grid: &'a Grid,
    pub(super) first: String,
    pub(super) second: String,
    pub(super) model: ModelId,
    pub(super) cells: Vec<Agreement>,
}

impl MapReport {
    /// Number of simulations of driver models, including those of the other profile and of perturbed cases.
    pub fn simulations(&self) -> u64 {
        let of = |mapped: &MappedGrid| {
            mapped.plan.lane_count() + mapped.other.as_ref().map_or(0, |(_, plan, _)| plan.lane_count())
        };
        let times = |mapped: &MappedGrid| {
            1 + if mapped.map.has_undecided() { mapped.plan.grid.perturbations().len() as u64 } else { 0 }
        };
        self.grids.iter().map(|mapped| of(mapped) * times(mapped)).sum()
    }

    /// Writes every file to the folder; returns their names without the record's.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if the folder cannot be written to.
    pub fn write(&self, mut results: Results) -> Result<ResultFiles> {
        let mut figures = Vec::new();
        let (outcomes, agreements) = (self.shown_outcomes(), self.shown_agreements());
        for mapped in &self.grids {
            let not_preventable = self.not_preventable(mapped);
            for (at, model) in mapped.map.models.iter().enumerate() {
                let of = |cell| mapped.map.outcome(at, cell, self.criterion);
                let cells = (0..mapped.map.cell_count()).map(|cell| place(&outcomes, of(cell)));
                let what = format!("{}, {}", model.name(), self.criterion.label());
                let kinds = outcomes.iter().map(|kind| outcome(*kind)).collect();
                let svg = self.sheet(&mapped.plan, what, kinds, cells.collect(), not_preventable.clone());
                let name = format!("{}_{}", mapped.plan.grid.name(), slug(model.name()));
                figures.push(PageFigure::add_svg(&mut results, &name, &svg, "cells.csv")?);
            }
        }
        let differences = self.differences();
        for difference in &differences {
            let cells = difference.cells.iter().map(|kind| place(&agreements, *kind)).collect();
            let what = format!("{} against {}, {}", difference.first, difference.second, self.criterion.label());
            let kinds = agreements.iter().map(|kind| agreement(*kind, &difference.first, &difference.second)).collect();
            let svg = self.sheet(difference.plan, what, kinds, cells, None);
            let name = format!(
                "{}_{}_against_{}",
                difference.grid.name(),
                slug(difference.model.name()),
                slug(&self.against_name())
            );
            figures.push(PageFigure::add_svg(&mut results, &name, &svg, "differences.csv")?);
        }
        results.add("report.html", self.html(figures)?.as_bytes())?;
        results.add_with("cells.csv", |out| self.write_cells(out))?;
        if !differences.is_empty() {
            results.add_with("differences.csv", |out| self.write_differences(&differences, out))?;
        }
        publish(results, |files| self.json(files))
    }

    /// Renders the run as one page.
    fn html(&self, figures: Vec<PageFigure>) -> Result<String> {
        let is_known = self.grids.iter().any(|mapped| mapped.known_percent.iter().any(Option::is_some));
        let shares = Section::new("shares", "Shares")
            .intro(if is_known { "Known shares are those of the JRC's evidence." } else { "" })
            .text(self.text());
        let record = self.json(&ResultFiles::default())?;
        let annex = annex(RunKind::Map, &record)?.host(self.host.facts()).folded();
        let page = Page {
            title: "Outcomes over a grid".to_owned(),
            lead: format!(
                "{} simulations: {} over a grid of parameters, profile {}.",
                count(self.simulations()),
                self.criterion.label(),
                self.profile.name
            ),
            sections: vec![shares, Section::new("maps", "Maps").figures(figures), annex],
            ..Page::default()
        };
        Ok(page.html())
    }

    pub(super) fn is_robust(&self) -> bool {
        self.grids.iter().any(|mapped| mapped.map.has_undecided())
    }

    /// Outcomes that tables and legends count, including every one that occurs.
    pub(super) fn shown_outcomes(&self) -> Vec<CellOutcome> {
        let is_shown = |outcome: &CellOutcome| match outcome {
            CellOutcome::Pass | CellOutcome::Fail => true,
            CellOutcome::NoConflict => self.criterion == Criterion::Collision,
            CellOutcome::Undecided if self.is_robust() => true,
            CellOutcome::Undecided | CellOutcome::FailByReaction => {
                self.grids.iter().any(|MappedGrid { map, .. }| {
                    (0..map.models.len()).any(|at| map.outcomes(at, self.criterion)[*outcome as usize] > 0)
                })
            }
        };
        CellOutcome::ALL.into_iter().filter(is_shown).collect()
    }

    /// The same for differences.
    pub(super) fn shown_agreements(&self) -> Vec<Agreement> {
        let is_shown = |kind: &Agreement| match kind {
            Agreement::NoConflict => self.criterion == Criterion::Collision,
            Agreement::Undecided => self.shown_outcomes().contains(&CellOutcome::Undecided),
            _ => true,
        };
        Agreement::ALL.into_iter().filter(is_shown).collect()
    }

    /// Cells in which all reference drivers and an ego that never reacts collide. `None` unless these drivers were swept
    /// and collisions are mapped.
    fn not_preventable(&self, mapped: &MappedGrid) -> Option<Vec<bool>> {
        let MappedGrid { map, .. } = mapped;
        let references = &self.profile.reference_drivers;
        let at = references.iter().map(|driver| map.models.iter().position(|model| model == driver));
        let at: Vec<usize> = at.collect::<Option<Vec<_>>>().filter(|at| !at.is_empty())?;
        let fails =
            |model, cell| map.verdicts(model, cell).failed(Criterion::Collision) && map.is_conflict(model, cell);
        let all_fail = |cell| at.iter().all(|model| fails(*model, cell));
        (self.criterion == Criterion::Collision).then(|| (0..map.cell_count()).map(all_fail).collect())
    }

    fn sheet(
        &self,
        plan: &GridPlan,
        what: String,
        kinds: Vec<(String, &'static str)>,
        cells: Vec<u8>,
        not_preventable: Option<Vec<bool>>,
    ) -> String {
        let grid = &plan.grid;
        let mut notes = Vec::new();
        if self.criterion == Criterion::Collision {
            notes.push(
                "Pass: the driver avoids the collision by braking. No conflict: no collision even if the ego never reacts."
                    .to_owned(),
            );
        }
        let by_reaction = kinds.iter().position(|kind| kind.0 == CellOutcome::FailByReaction.label());
        if by_reaction.is_some_and(|at| cells.contains(&(at as u8))) {
            notes.push(
                "Fail by reaction: the driver reacts and collides; without a reaction nothing collides.".to_owned(),
            );
        }
        if self.is_robust() && not_preventable.as_ref().is_some_and(|cells| cells.contains(&true)) {
            notes.push("Red dashes count every cell as computed, an undecided one too.".to_owned());
        }
        if grid.has_native_gap() {
            notes.push("Initial gap: each model's own distance at the ego's speed, a headway of 2 s where it has none (column initial_gap_m).".to_owned());
        }
        if grid.style() == CaseStyle::JrcComparison {
            notes.push("Cases with the lateral run-up of the JRC's comparison sweep.".to_owned());
        }
        let profile = plan.parts.first().map_or(&self.profile, |part| &part.plan.profile);
        let held = grid.held(profile).join("; ");
        let sheet = MapSheet {
            title: format!("{}: {what}", grid.category().label()),
            subtitle: format!("Profile {}, map {}. In every cell: {held}.", self.profile.name, grid.name()),
            grid,
            kinds,
            cells,
            not_preventable,
            notes,
        };
        sheet.figure().svg()
    }

    pub(super) fn against_name(&self) -> String {
        match &self.against {
            Some(Against::Model(model)) => model.name().to_owned(),
            Some(Against::Profile(profile)) => profile.name.clone(),
            None => String::new(),
        }
    }

    pub(super) fn differences(&self) -> Vec<Difference<'_>> {
        let mut all = Vec::new();
        for MappedGrid { plan, map, other, .. } in &self.grids {
            for (at, &model) in map.models.iter().enumerate() {
                let name = model.name();
                let (first, second, cells) = match (&self.against, other) {
                    (Some(Against::Model(against)), _) if *against != model => {
                        let Some(second) = map.models.iter().position(|m| m == against) else { continue };
                        let cells = map.difference(at, (map, second), self.criterion);
                        (name.to_owned(), against.name().to_owned(), cells)
                    }
                    (Some(Against::Profile(_)), Some((profile, _, under_other))) => {
                        let cells = map.difference(at, (under_other, at), self.criterion);
                        (format!("{name} under {}", self.profile.name), format!("{name} under {profile}"), cells)
                    }
                    _ => continue,
                };
                all.push(Difference { plan, grid: &plan.grid, first, second, model, cells });
            }
        }
        all
    }
}

/// Index of a kind among those shown, and in the legend.
fn place<T: PartialEq>(shown: &[T], kind: T) -> u8 {
    shown.iter().position(|other| *other == kind).unwrap_or(0) as u8
}

/// A name as part of a file name.
fn slug(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c.to_ascii_lowercase() } else { '_' };
    name.chars().map(plain).collect()
}
