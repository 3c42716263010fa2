//! A run of `map` as tables: cells by outcome for the terminal, every cell and difference as CSV.

use std::io::{self, Write};

use super::map::{Difference, MapReport};
use super::tables::{aligned, table};
use crate::model::criterion::Criterion;
use crate::run::grid::{CellOutcome, Grid, MapParameter, MappedGrid, count};
use crate::support::readable;
use crate::support::table::csv_field;

impl MapReport {
    /// Shares and differences as tables.
    pub fn text(&self) -> String {
        let criterion = self.criterion.label();
        let any_known = self.grids.iter().any(|mapped| mapped.known_percent.iter().any(Option::is_some));
        let outcomes = self.shown_outcomes();
        let words = ["map", "model", "cells"].into_iter().chain(outcomes.iter().map(|outcome| outcome.label()));
        let mut header: Vec<String> = words.chain(["share %"]).map(str::to_owned).collect();
        if any_known {
            header.extend(["known %", "difference"].map(str::to_owned));
        }
        let mut shares = table(header);
        for mapped in &self.grids {
            for (at, model) in mapped.map.models.iter().enumerate() {
                let (failures, cells) = (mapped.map.failures(at, self.criterion), mapped.map.cell_count());
                let percent = 100.0 * failures as f64 / cells as f64;
                let mut row =
                    vec![mapped.plan.grid.name().to_owned(), model.name().to_owned(), readable::count_of(cells)];
                let counts = mapped.map.outcomes(at, self.criterion);
                row.extend(outcomes.iter().map(|outcome| readable::count(counts[*outcome as usize])));
                row.push(format!("{percent:.2}"));
                if any_known {
                    let known = mapped.known_percent[at];
                    row.push(known.map_or("-".to_owned(), |k| format!("{k:.1}")));
                    let mark = if mapped.is_chosen_to_match { "*" } else { "" };
                    row.push(known.map_or("-".to_owned(), |k| format!("{:+.2}{mark}", percent - k)));
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
        text.push_str(&self.words_of_outcomes(&outcomes));
        let differences = self.differences();
        if !differences.is_empty() {
            let shown = self.shown_agreements();
            let header = ["map", "first", "second"].into_iter().chain(shown.iter().map(|kind| kind.label()));
            let header = header.map(str::to_owned).collect();
            let mut table = table(header);
            for difference in &differences {
                let mut row = vec![difference.grid.name().to_owned(), difference.first.clone()];
                row.push(difference.second.clone());
                let counts = count(&difference.cells);
                row.extend(shown.iter().map(|kind| readable::count(counts[*kind as usize])));
                table.add_row(row);
            }
            text.push_str(&format!("\nDifferences in {criterion}\n{}", aligned(table, 3)));
        }
        text
    }

    /// What the columns count.
    fn words_of_outcomes(&self, outcomes: &[CellOutcome]) -> String {
        let sentence = |outcome: &CellOutcome| match outcome {
            CellOutcome::NoConflict => {
                "No conflict: no collision, neither with this driver nor if the ego never reacts.\n"
            }
            CellOutcome::FailByReaction => {
                "Fail by reaction: the driver reacts and collides; without a reaction nothing collides.\n"
            }
            CellOutcome::Undecided => {
                "Undecided: the outcome changes with a tenth of the time step (binary64), 1 cm of gap, or 0.1 km/h of a speed; the share \
                 counts these cells as computed.\n"
            }
            CellOutcome::Pass | CellOutcome::Fail => "",
        };
        let of_all = match self.criterion {
            Criterion::Collision => {
                "Share: cells with a collision (fail and fail by reaction), of all cells, those without a conflict included.\n"
            }
            Criterion::Ttc | Criterion::Btn => "",
        };
        outcomes.iter().map(sentence).chain([of_all]).collect()
    }

    /// One row per cell and model.
    pub(super) fn write_cells(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut out = io::BufWriter::new(out);
        let is_robust = self.is_robust();
        let columns = "initial_gap_m,model,collision,ttc,btn,capped,failed,conflict,outcome";
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
                    let conflict = u8::from(map.is_conflict(at, cell));
                    let outcome = map.outcome(at, cell, self.criterion).label();
                    write!(out, "{place},{gap_m},{},{collision},{ttc},{btn},{capped},{failed}", model.name())?;
                    write!(out, ",{conflict},{outcome}")?;
                    if is_robust {
                        write!(out, ",{}", u8::from(map.is_undecided(at, cell, self.criterion)))?;
                    }
                    writeln!(out)?;
                }
            }
        }
        out.flush()
    }

    pub(super) fn write_differences(&self, differences: &[Difference], out: &mut dyn Write) -> io::Result<()> {
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
