//! A run of `map` in tables and files: shares in the terminal, cells as CSV, sheets as SVG, `map.json`.

use std::io::{self, Write};

use serde::Serialize;

use super::html::PageFigure;
use super::map_sheet::{MapSheet, UNDECIDED, agreements, outcomes};
use super::plot::Fill;
use super::run_record::{DeviceRecord, SweepRecord};
use super::tables::{aligned, table};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::check::REFERENCE_DRIVERS;
use crate::run::grid::{Against, Agreement, CaseStyle, Grid, GridAxis, MapParameter, MappedGrid, Perturbation, count};
use crate::support::readable;
use crate::support::run_dir::Results;
use crate::support::table::csv_field;
use crate::{Error, Result};

/// A whole run.
pub struct MapReport {
    /// The grids.
    pub grids: Vec<MappedGrid>,
    /// Criterion of shares, sheets and differences.
    pub criterion: Criterion,
    /// What they are compared with.
    pub against: Option<Against>,
    /// Profile.
    pub profile: Profile,
    /// Preset, where it is one.
    pub preset: Option<String>,
    /// What computed.
    pub host: MapHost,
}

/// What belongs to the machine and not to the result.
#[derive(Debug, Clone, Serialize)]
pub struct MapHost {
    /// What computed the lanes.
    pub backend: String,
    /// The device, where one did.
    pub device: Option<DeviceRecord>,
    /// How the sweep went.
    pub sweep: SweepRecord,
    /// Threads.
    pub threads: usize,
    /// Planning, s.
    pub plan_s: f64,
    /// Lanes, s.
    pub sweep_s: f64,
}

/// A difference between two verdicts on every cell of a grid.
struct Difference<'a> {
    grid: &'a Grid,
    first: String,
    second: String,
    model: ModelId,
    cells: Vec<Agreement>,
}

impl MapReport {
    /// Number of simulations, those of the other profile and of perturbed cases included.
    pub fn simulations(&self) -> u64 {
        let of = |mapped: &MappedGrid| {
            mapped.plan.lane_count() + mapped.other.as_ref().map_or(0, |(_, plan, _)| plan.lane_count())
        };
        let times =
            |mapped: &MappedGrid| if mapped.map.has_undecided() { 1 + Perturbation::ALL.len() as u64 } else { 1 };
        self.grids.iter().map(|mapped| of(mapped) * times(mapped)).sum()
    }

    /// Shares and differences as tables.
    pub fn text(&self) -> String {
        let criterion = self.criterion.label();
        let any_known = self.grids.iter().any(|mapped| mapped.known_percent.iter().any(Option::is_some));
        let mut header = ["map", "model", "cells", "fail", "share %"].map(str::to_owned).to_vec();
        if any_known {
            header.extend(["known %", "difference"].map(str::to_owned));
        }
        let is_robust = self.is_robust();
        if is_robust {
            header.push("undecided %".to_owned());
        }
        let mut shares = table(header);
        for mapped in &self.grids {
            for (at, model) in mapped.map.models.iter().enumerate() {
                let (failures, cells) = (mapped.map.failures(at, self.criterion), mapped.map.cell_count());
                let percent = 100.0 * failures as f64 / cells as f64;
                let mut row =
                    vec![mapped.plan.grid.name().to_owned(), model.name().to_owned(), readable::count_of(cells)];
                row.extend([readable::count(failures), format!("{percent:.2}")]);
                if any_known {
                    let known = mapped.known_percent[at];
                    row.push(known.map_or("-".to_owned(), |k| format!("{k:.1}")));
                    let mark = if mapped.is_chosen_to_match { "*" } else { "" };
                    row.push(known.map_or("-".to_owned(), |k| format!("{:+.2}{mark}", percent - k)));
                }
                if is_robust {
                    let undecided = mapped.map.undecided(at, self.criterion);
                    row.push(format!("{:.2}", 100.0 * undecided as f64 / cells as f64));
                }
                shares.add_row(row);
            }
        }
        let mut text = format!(
            "Share of cells that fail {criterion} under {}, of {} simulations\n{}",
            self.profile.name,
            readable::count(self.simulations()),
            aligned(shares, 2)
        );
        if self.grids.iter().any(|mapped| mapped.is_chosen_to_match) {
            text.push_str(
                "* The known grid is not published. Ours was chosen so that the share of RSS comes out: that it agrees \
                 confirms nothing.\n",
            );
        }
        if is_robust {
            text.push_str(
                "Undecided: the verdict changes with a tenth of the time step (binary64), 1 cm of gap, or 0.1 km/h of a speed.\n",
            );
        }
        let differences = self.differences();
        if !differences.is_empty() {
            let header = ["map", "first", "second", "both pass", "both fail", "only first fails", "only second fails"];
            let mut header = header.map(str::to_owned).to_vec();
            header.extend(is_robust.then(|| "undecided".to_owned()));
            let mut table = table(header);
            for difference in &differences {
                let mut row = vec![difference.grid.name().to_owned(), difference.first.clone()];
                row.push(difference.second.clone());
                let kinds = if is_robust { Agreement::ALL.len() } else { Agreement::ALL.len() - 1 };
                row.extend(count(&difference.cells)[..kinds].iter().map(|cells| readable::count(*cells)));
                table.add_row(row);
            }
            text.push_str(&format!("\nDifferences in {criterion}\n{}", aligned(table, 3)));
        }
        text
    }

    /// Puts every file into its folder; gives their names, without the record's.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder cannot be written.
    pub fn write(&self, mut results: Results) -> Result<Vec<String>> {
        let mut figures = Vec::new();
        for mapped in &self.grids {
            for (at, model) in mapped.map.models.iter().enumerate() {
                let cells = (0..mapped.map.cell_count()).map(|cell| {
                    let is_undecided = mapped.map.is_undecided(at, cell, self.criterion);
                    if is_undecided {
                        UNDECIDED
                    } else {
                        u8::from(mapped.map.verdicts(at, cell).failed(self.criterion))
                    }
                });
                let what = format!("{}, {}", model.name(), self.criterion.label());
                let kinds = outcomes(mapped.map.has_undecided());
                let svg = self.sheet(&mapped.plan.grid, what, kinds, cells.collect(), self.preventable(mapped));
                let name = format!("{}_{}.svg", mapped.plan.grid.name(), slug(model.name()));
                results.add(&name, svg.as_bytes())?;
                figures.push(PageFigure::new(&svg, &[&name, "cells.csv"]));
            }
        }
        let differences = self.differences();
        for difference in &differences {
            let cells = difference.cells.iter().map(|kind| *kind as u8).collect();
            let what = format!("{} against {}, {}", difference.first, difference.second, self.criterion.label());
            let kinds = agreements(&difference.first, &difference.second, self.is_robust());
            let svg = self.sheet(difference.grid, what, kinds, cells, None);
            let name = format!(
                "{}_{}_against_{}.svg",
                difference.grid.name(),
                slug(difference.model.name()),
                slug(&self.against_name())
            );
            results.add(&name, svg.as_bytes())?;
            figures.push(PageFigure::new(&svg, &[&name, "differences.csv"]));
        }
        results.add("report.html", self.html(figures)?.as_bytes())?;
        results.add_with("cells.csv", |out| self.write_cells(out))?;
        if !differences.is_empty() {
            results.add_with("differences.csv", |out| self.write_differences(&differences, out))?;
        }
        let names = results.names();
        results.publish(self.json(names.clone())?.as_bytes())?;
        Ok(names)
    }

    fn is_robust(&self) -> bool {
        self.grids.iter().any(|mapped| mapped.map.has_undecided())
    }

    /// Cells in which a driver of Annex 3 avoids the collision; where both were swept, and collisions are mapped.
    fn preventable(&self, mapped: &MappedGrid) -> Option<Vec<bool>> {
        let models = &mapped.map.models;
        let at: Vec<usize> =
            REFERENCE_DRIVERS.iter().filter_map(|driver| models.iter().position(|model| model == driver)).collect();
        let collides = |model: &usize, cell| mapped.map.verdicts(*model, cell).failed(Criterion::Collision);
        let is_known = at.len() == REFERENCE_DRIVERS.len() && self.criterion == Criterion::Collision;
        is_known
            .then(|| (0..mapped.map.cell_count()).map(|cell| at.iter().any(|model| !collides(model, cell))).collect())
    }

    fn sheet(
        &self,
        grid: &Grid,
        what: String,
        kinds: Vec<(String, Fill)>,
        cells: Vec<u8>,
        preventable: Option<Vec<bool>>,
    ) -> String {
        let fixed: Vec<String> =
            grid.fixed().iter().map(|(p, v)| format!("{}: {} {}.", p.label, readable::value(*v), p.unit)).collect();
        let mut notes = fixed;
        if grid.has_native_gap() {
            notes.push("Initial gap: each model's own distance at the ego's speed, a headway of 2 s where it has none (column initial_gap_m).".to_owned());
        }
        if grid.style() == CaseStyle::JrcComparison {
            notes.push("Cases with the lateral run-up of the JRC's comparison sweep.".to_owned());
        }
        let sheet = MapSheet {
            title: format!("{}: {what}", grid.category().label()),
            subtitle: format!("Profile {}, map {}", self.profile.name, grid.name()),
            grid,
            kinds,
            cells,
            preventable,
            notes,
        };
        sheet.figure().svg()
    }

    fn against_name(&self) -> String {
        match &self.against {
            Some(Against::Model(model)) => model.name().to_owned(),
            Some(Against::Profile(profile)) => profile.name.clone(),
            None => String::new(),
        }
    }

    fn differences(&self) -> Vec<Difference<'_>> {
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
                all.push(Difference { grid: &plan.grid, first, second, model, cells });
            }
        }
        all
    }

    /// One row per cell and model.
    fn write_cells(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut out = io::BufWriter::new(out);
        let is_robust = self.is_robust();
        let columns = "initial_gap_m,model,collision,ttc,btn,capped,failed";
        write_header(&mut out, &self.grids, &format!("{columns}{}", if is_robust { ",undecided" } else { "" }))?;
        for MappedGrid { plan, map, .. } in &self.grids {
            let profile = &plan.parts[0].plan.profile;
            for cell in 0..map.cell_count() {
                let place = place_of(&plan.grid, cell);
                for (at, &model) in map.models.iter().enumerate() {
                    let verdicts = map.verdicts(at, cell);
                    let [collision, ttc, btn] = Criterion::ALL.map(|c| u8::from(verdicts.failed(c)));
                    let (capped, failed) = (u8::from(verdicts.capped()), u8::from(verdicts.failed(self.criterion)));
                    let gap_m = plan.grid.gap_m(cell, model, profile);
                    write!(out, "{place},{gap_m},{},{collision},{ttc},{btn},{capped},{failed}", model.name())?;
                    if is_robust {
                        write!(out, ",{}", u8::from(map.is_undecided(at, cell, self.criterion)))?;
                    }
                    writeln!(out)?;
                }
            }
        }
        out.flush()
    }

    fn write_differences(&self, differences: &[Difference], out: &mut dyn Write) -> io::Result<()> {
        let mut out = io::BufWriter::new(out);
        write_header(&mut out, &self.grids, "first,second,difference")?;
        for Difference { grid, first, second, cells, .. } in differences {
            let (first, second) = (csv_field(first), csv_field(second));
            for (cell, kind) in cells.iter().enumerate() {
                writeln!(out, "{},{first},{second},{}", place_of(grid, cell), kind.key())?;
            }
        }
        out.flush()
    }

    /// `map.json`: shares, differences and what makes them again; `files` stand beside it.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn json(&self, files: Vec<String>) -> Result<String> {
        let record = MapRecord {
            program: format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
            preset: self.preset.as_deref(),
            criterion: self.criterion.key(),
            against: self.against.as_ref().map(|_| self.against_name()),
            simulations: self.simulations(),
            grids: self.grids.iter().map(|mapped| GridRecord::of(mapped, self.criterion)).collect(),
            differences: self.differences().iter().map(DifferenceRecord::of).collect(),
            profile: &self.profile,
            other_profile: match &self.against {
                Some(Against::Profile(profile)) => Some(profile),
                _ => None,
            },
            files,
            host: &self.host,
        };
        let text = serde_json::to_string_pretty(&record);
        text.map(|text| text + "\n").map_err(|e| Error::Internal(format!("map.json cannot be written: {e}")))
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
    /// Beside this one.
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
    /// The grid was chosen so that a known share comes out.
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
    /// Cells whose verdict a perturbation changes, where perturbed cases were swept.
    #[serde(skip_serializing_if = "Option::is_none")]
    undecided: Option<u64>,
    known_percent: Option<f64>,
}

/// Cells by how two agree.
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
    undecided: u64,
}

impl DifferenceRecord {
    fn of(difference: &Difference) -> DifferenceRecord {
        let [both_pass, both_fail, only_first_fails, only_second_fails, undecided] = count(&difference.cells);
        DifferenceRecord {
            map: difference.grid.name().to_owned(),
            model: difference.model.name(),
            first: difference.first.clone(),
            second: difference.second.clone(),
            both_pass,
            both_fail,
            only_first_fails,
            only_second_fails,
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
    fn of(mapped: &'a MappedGrid, criterion: Criterion) -> GridRecord<'a> {
        let (grid, map) = (&mapped.plan.grid, &mapped.map);
        fn axis(axis: &GridAxis) -> AxisRecord<'_> {
            AxisRecord { parameter: axis.parameter.key, values: &axis.values }
        }
        let share = |(at, model): (usize, &ModelId)| {
            let failures = map.failures(at, criterion);
            let share = failures as f64 / map.cell_count() as f64;
            let undecided = map.has_undecided().then(|| map.undecided(at, criterion));
            ShareRecord { model: model.name(), failures, share, undecided, known_percent: mapped.known_percent[at] }
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

/// Columns of a cell's place; all grids of a run have the same parameters.
fn write_header(out: &mut dyn Write, grids: &[MappedGrid], columns: &str) -> io::Result<()> {
    let keys: Vec<&str> = match grids.first() {
        Some(mapped) => mapped.plan.grid.values(0).iter().map(|(p, _): &(&MapParameter, f64)| p.key).collect(),
        None => Vec::new(),
    };
    writeln!(out, "map,{},{columns}", keys.join(","))
}

fn place_of(grid: &Grid, cell: usize) -> String {
    let values: Vec<String> = grid.values(cell).iter().map(|(_, value)| value.to_string()).collect();
    format!("{},{}", grid.name(), values.join(","))
}

/// A name as a part of a file's name.
fn slug(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c.to_ascii_lowercase() } else { '_' };
    name.chars().map(plain).collect()
}
