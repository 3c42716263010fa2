//! The files, sheets, page and record of a `map` run. Tables are in `map_tables.rs`. A part of the page, the explorer, computes
//! further maps where it is read, with the program's own shaders, and shows those of the run where it cannot.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use super::host::{Host, SweepRecord};
use super::html::{App, Page};
use super::map_sheet::{BOUNDARY, MapSheet, colour};
use super::plot::Look;
use super::records::{PROGRAM, document, publish, record, sorted};
use lanesweep_engine::{ENGINE_VERSION, LaneCase};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_run::explorer::explorer;
use lanesweep_run::grid::{CaseStyle, CellOutcome, GridAxis, MappedGrid};
use lanesweep_support::Result;
use lanesweep_support::readable;
use lanesweep_support::run_folder::{FIGURES, ResultFiles, Results};

/// Maps with more text than this stay in cells.csv, so that the page stays below half a megabyte.
const MAX_MAPS_BYTES: usize = 170_000;

const SCRIPT: [&str; 6] = [
    include_str!("templates/explorer/state.js"),
    include_str!("templates/explorer/gpu.js"),
    include_str!("templates/explorer/maps.js"),
    include_str!("templates/explorer/picture.js"),
    include_str!("templates/explorer/case.js"),
    include_str!("templates/explorer/main.js"),
];

/// A complete run.
pub struct MapReport {
    /// The grids.
    pub grids: Vec<MappedGrid>,
    /// Criterion of fractions and sheets.
    pub criterion: Criterion,
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

impl MapReport {
    /// Number of simulations of driver models, including those of perturbed cases.
    pub fn simulations(&self) -> u64 {
        let times = |mapped: &MappedGrid| {
            1 + if mapped.map.has_undecided() { mapped.plan.grid.perturbations().len() as u64 } else { 0 }
        };
        self.grids.iter().map(|mapped| mapped.plan.lane_count() * times(mapped)).sum()
    }

    /// Writes every file to the folder; returns their names without the record's.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Io`] if the folder cannot be written to.
    pub fn write(&self, mut results: Results) -> Result<ResultFiles> {
        let outcomes = self.shown_outcomes();
        for mapped in &self.grids {
            let not_preventable = self.not_preventable(mapped);
            for (at, model) in mapped.map.models.iter().enumerate() {
                let svg = self.sheet(mapped, at, &outcomes, not_preventable.clone());
                let name = format!("{FIGURES}{}_{}.svg", mapped.plan.grid.name, slug(model.name()));
                results.add(&name, svg.as_bytes())?;
            }
        }
        results.add("report.html", self.html()?.as_bytes())?;
        results.add_table("cells.csv", self.cells())?;
        publish(results, |files| self.json(files))
    }

    /// Renders the run as one page, which computes further maps.
    fn html(&self) -> Result<String> {
        let page = Page {
            title: "Outcomes over a grid".to_owned(),
            lead: self.lead(),
            app: Some(self.explorer()?),
            sections: vec![self.host.section(&self.profile).folded()],
            ..Page::default()
        };
        Ok(page.html())
    }

    /// What the page shows.
    fn lead(&self) -> String {
        let simulations = readable::count(self.simulations());
        let (criterion, profile) = (self.criterion.label(), &self.profile.name);
        format!(
            "Cells that fail {criterion} under {profile}: {simulations} simulations of the program, and maps that this page computes."
        )
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
            CellOutcome::Undecided | CellOutcome::FailByReaction | CellOutcome::NoTraffic => {
                self.grids.iter().any(|MappedGrid { map, .. }| {
                    (0..map.models.len()).any(|at| map.outcomes(at, self.criterion)[*outcome as usize] > 0)
                })
            }
        };
        CellOutcome::ALL.into_iter().filter(is_shown).collect()
    }

    /// Cells with possible traffic in which all reference drivers and an ego that never reacts collide. `None` unless these drivers were swept
    /// and collisions are mapped.
    fn not_preventable(&self, mapped: &MappedGrid) -> Option<Vec<bool>> {
        let MappedGrid { map, .. } = mapped;
        let references = &self.profile.reference_drivers;
        let at = references.iter().map(|driver| map.models.iter().position(|model| model == driver));
        let at: Vec<usize> = at.collect::<Option<Vec<_>>>().filter(|at| !at.is_empty())?;
        let fails =
            |model, cell| map.verdicts(model, cell).failed(Criterion::Collision) && map.is_conflict(model, cell);
        let all_fail = |cell| !map.drives_through(cell) && at.iter().all(|model| fails(*model, cell));
        (self.criterion == Criterion::Collision).then(|| (0..map.cell_count()).map(all_fail).collect())
    }

    /// The sheet of a model.
    fn sheet(
        &self,
        mapped: &MappedGrid,
        model: usize,
        outcomes: &[CellOutcome],
        not_preventable: Option<Vec<bool>>,
    ) -> String {
        let (plan, grid) = (&mapped.plan, &mapped.plan.grid);
        let cells: Vec<CellOutcome> =
            (0..mapped.map.cell_count()).map(|cell| mapped.map.outcome(model, cell, self.criterion)).collect();
        let has_dashes = not_preventable.as_ref().is_some_and(|cells| cells.contains(&true));
        let notes = [
            (
                self.criterion == Criterion::Collision,
                "Pass: the driver avoids the collision by braking. No conflict: no collision even if the ego never reacts.",
            ),
            (
                cells.contains(&CellOutcome::FailByReaction),
                "Fail by reaction: the driver reacts and collides; without a reaction nothing collides.",
            ),
            (self.is_robust() && has_dashes, "Red dashes count every cell as computed, an undecided one too."),
            (
                grid.native_gap,
                "Initial gap: each model's own distance at the ego's speed, a headway of 2 s where it has none (column initial_gap_m).",
            ),
            (grid.style == CaseStyle::JrcComparison, "Cases with the lateral run-up of the JRC's comparison sweep."),
        ];
        let notes = notes.into_iter().filter(|(is_said, _)| *is_said).map(|(_, note)| note.to_owned()).collect();
        let profile = plan.parts.first().map_or(&self.profile, |part| &part.plan.profile);
        let held = grid.held(profile).join("; ");
        let model = mapped.map.models[model].name();
        let title = format!("{}: {model}, {}", grid.category.label(), self.criterion.label());
        let subtitle = format!("Profile {}, map {}. In every cell: {held}.", self.profile.name, grid.name);
        MapSheet { grid, outcomes, cells, not_preventable }.figure(title, subtitle, notes).svg()
    }

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

    /// The explorer of a run: its profile first, then the others that the program has.
    fn explorer(&self) -> Result<App> {
        let mut profiles = vec![self.profile.clone()];
        for name in Profile::names().filter(|name| *name != self.profile.name) {
            profiles.push(Profile::load(name)?);
        }
        let fixed = self.grids.first().map(|mapped| mapped.plan.grid.fixed.clone()).unwrap_or_default();
        let mut data = explorer(&profiles, &fixed)?;
        let colour_of = |at| Look::of(at, ModelId::ALL.len()).colour;
        for (at, driver) in data["drivers"].as_array_mut().into_iter().flatten().enumerate() {
            driver["colour"] = json!(colour_of(at));
        }
        let outcome =
            |of: &CellOutcome| json!({ "key": format!("{of:?}"), "label": of.label(), "colour": colour(*of) });
        let criterion = |of: &Criterion| json!({ "key": of.key(), "label": of.label(), "bit": of.index() });
        data["outcomes"] = CellOutcome::ALL.iter().map(outcome).collect();
        data["criteria"] = Criterion::ALL.iter().map(criterion).collect();
        data["criterion"] = json!(self.criterion.key());
        let category = |mapped: &MappedGrid| mapped.plan.grid.category.label().to_ascii_lowercase();
        data["category"] = json!(self.grids.first().map(category));
        data["boundary"] = json!(BOUNDARY);
        data["caseWords"] = json!(size_of::<LaneCase<f32>>() / 4);
        // The constants in which a lane that keeps its steps differs.
        data["traced"] = json!({ "frame_values": 1, "frame_skip": 0 });
        let shown = self.shown_outcomes();
        let grid = |mapped: &MappedGrid| {
            let mut grid = sorted(&self.grid_record(mapped, &shown));
            grid["models"] = mapped.map.models.iter().map(|model| model.name()).collect();
            grid["outcomes"] = outcomes(mapped);
            grid
        };
        let grids: Vec<Value> = self.grids.iter().map(grid).collect();
        let is_short = grids.iter().map(|grid| grid.to_string().len()).sum::<usize>() <= MAX_MAPS_BYTES;
        data["grids"] = json!(if is_short { grids } else { Vec::new() });
        Ok(App {
            markup: include_str!("templates/explorer/page.html"),
            style: include_str!("templates/explorer/style.css"),
            script: format!("{{\n{}}}", SCRIPT.concat()),
            // No text of the data ends its element.
            data: data.to_string().replace("</", "<\\/").replace("<!", "<\\u0021"),
        })
    }

    fn grid_record<'a>(&self, mapped: &'a MappedGrid, shown: &[CellOutcome]) -> impl Serialize + use<'a> {
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

/// The outcomes of every cell: by criterion and model, in run lengths.
fn outcomes(MappedGrid { map, .. }: &MappedGrid) -> Value {
    let of = |criterion: Criterion| -> Vec<String> {
        let of = |model| run_lengths((0..map.cell_count()).map(|cell| map.outcome(model, cell, criterion) as u8));
        (0..map.models.len()).map(of).collect()
    };
    Value::from_iter(Criterion::ALL.map(|criterion| (criterion.key(), of(criterion))))
}

/// Letters from `a` on, each after its count if that is not 1.
fn run_lengths(codes: impl Iterator<Item = u8>) -> String {
    let codes: Vec<u8> = codes.collect();
    let run = |run: &[u8]| {
        let letter = char::from(b'a' + run[0]);
        if run.len() == 1 { letter.to_string() } else { format!("{}{letter}", run.len()) }
    };
    codes.chunk_by(|a, b| a == b).map(run).collect()
}

/// A name as part of a file name.
fn slug(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c.to_ascii_lowercase() } else { '_' };
    name.chars().map(plain).collect()
}
