//! The tables of a `map` run: cells by outcome for the terminal, every cell as CSV.

use std::io::{self, Write};

use super::case_sentences::CLAUSE_OF_LEADERS;
use super::map::MapReport;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;
use lanesweep_run::grid::{CaseQuantity, CellOutcome, MappedGrid, VARIED};
use lanesweep_support::readable;
use lanesweep_support::table::{Column, Digits, NumberText, Table};

impl MapReport {
    /// Fractions and what they count, as text.
    pub fn text(&self) -> String {
        format!("{}\n{}{}", self.caption(), self.shares().text(), self.words())
    }

    /// What the fractions are of.
    pub(super) fn caption(&self) -> String {
        format!(
            "Share of cells that fail {} under {}, of {} simulations",
            self.criterion.label(),
            self.profile.name,
            readable::count(self.simulations())
        )
    }

    /// Fractions as a table.
    pub(super) fn shares(&self) -> Table {
        let any_known = self.grids.iter().any(|mapped| mapped.known_percent.iter().any(Option::is_some));
        let outcomes = self.shown_outcomes();
        let known = Column::from("known %").digits(Digits::Fixed(1)).null("-");
        let rows = self.grids.iter().flat_map(|mapped| (0..mapped.map.models.len()).map(move |at| (mapped, at)));
        let percent = |(mapped, at): (&MappedGrid, usize)| 100.0 * mapped.map.share(at, self.criterion);
        let difference = |(mapped, at): (&MappedGrid, usize)| {
            let mark = if mapped.is_chosen_to_match { "*" } else { "" };
            Some(NumberText(format!("{:+.2}{mark}", percent((mapped, at)) - mapped.known_percent[at]?)))
        };
        let mut shares = Table::of(rows)
            .column("map", |(mapped, _)| mapped.plan.grid.name.as_str())
            .column("model", |(mapped, at)| mapped.map.models[at].name())
            .column("cells", |(mapped, _)| mapped.map.cell_count())
            .columns(
                outcomes.iter(),
                |of| of.label(),
                |(mapped, at), of| mapped.map.outcomes(at, self.criterion)[*of as usize],
            )
            .column(Column::from("share %").digits(Digits::Fixed(2)), percent);
        if any_known {
            shares = shares
                .column(known, |(mapped, at)| mapped.known_percent[at])
                .column(Column::from("difference").null("-"), difference);
        }
        shares.build()
    }

    /// What the columns count, and cautions.
    pub(super) fn words(&self) -> String {
        let mut text = String::new();
        if self.grids.iter().any(|mapped| mapped.is_chosen_to_match) {
            text.push_str(
                "* The known grid is not published. Ours was chosen so that the share of RSS comes out: that it agrees \
                 confirms nothing.\n",
            );
        }
        text.push_str(&self.words_of_outcomes(&self.shown_outcomes()));
        text
    }

    /// What the columns count.
    fn words_of_outcomes(&self, outcomes: &[CellOutcome]) -> String {
        let undecided = format!(
            "Undecided: {}an ego that never reacts is still closing in at the time cap of {} s; the share counts these cells as \
             computed.\n",
            if self.is_robust() {
                format!("the outcome changes with one of these (the step in binary64): {VARIED}; or ")
            } else {
                String::new()
            },
            self.profile.frame.time_cap_s,
        );
        let sentence = |outcome: &CellOutcome| match outcome {
            CellOutcome::NoConflict => {
                "No conflict: no collision, neither with this driver nor if the ego never reacts.\n"
            }
            CellOutcome::FailByReaction => {
                "Fail by reaction: the driver reacts and collides; without a reaction nothing collides.\n"
            }
            CellOutcome::Undecided => &undecided,
            CellOutcome::NoTraffic => {
                "No such traffic: the vehicle that cuts out drives through the one ahead of it. No share counts these cells.\n"
            }
            CellOutcome::Pass | CellOutcome::Fail => "",
        };
        let of_all = match self.criterion {
            Criterion::Collision => {
                "Share: cells with a collision (fail and fail by reaction), of all cells with possible traffic, those without a conflict \
                 included.\n"
            }
            Criterion::Ttc | Criterion::Btn => "",
        };
        let cautions = self.cautions();
        outcomes.iter().map(sentence).chain([of_all]).chain(cautions.iter().map(String::as_str)).collect()
    }

    /// Sentences on cells whose case is not what a reader would take it for.
    pub(super) fn cautions(&self) -> Vec<String> {
        let mut all = Vec::new();
        for MappedGrid { plan, map, .. } in &self.grids {
            let brakes = (0..plan.grid.cell_count())
                .any(|cell| plan.grid.point(cell).get(CaseQuantity::Deceleration).is_some_and(|a| a != 0.0));
            let of_leaders = format!("{CLAUSE_OF_LEADERS}.\n");
            let is_lvd = plan.grid.category == Category::Lvd && !self.profile.reg157.clause.is_empty();
            if brakes && is_lvd && !all.contains(&of_leaders) {
                all.push(of_leaders);
            }
            let is_clause = plan.grid.category == Category::CutIn && !self.profile.reg157.clause.is_empty();
            if brakes && is_clause && map.models.contains(&ModelId::Reg157) {
                all.push(format!(
                    "Reg157 in {}: a vehicle that brakes while it cuts in does not keep its speed, so {} demands nothing of these \
                     cells, whatever the model does.\n",
                    plan.grid.name,
                    self.profile.reg157.clause
                ));
            }
        }
        all
    }

    /// One row per cell and model.
    pub(super) fn write_cells(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut out = io::BufWriter::new(out);
        let is_robust = self.is_robust();
        let columns = "initial_gap_m,model,collision,ttc,btn,capped,failed,conflict,outcome,drives_through";
        // All grids of a run have the same parameters.
        let grid = self.grids.first().map(|mapped| mapped.plan.grid.values(0)).unwrap_or_default();
        let keys: Vec<&str> = grid.iter().map(|(parameter, _)| parameter.key).collect();
        writeln!(out, "map,{},{columns}{}", keys.join(","), if is_robust { ",undecided" } else { "" })?;
        for MappedGrid { plan, map, .. } in &self.grids {
            let profile = &plan.parts[0].plan.profile;
            for cell in 0..map.cell_count() {
                let drives_through = u8::from(map.drives_through(cell));
                let values: Vec<String> = plan.grid.values(cell).iter().map(|(_, value)| value.to_string()).collect();
                let place = format!("{},{}", plan.grid.name, values.join(","));
                for (at, &model) in map.models.iter().enumerate() {
                    let verdicts = map.verdicts(at, cell);
                    let [collision, ttc, btn] = Criterion::ALL.map(|c| u8::from(verdicts.failed(c)));
                    let (capped, failed) = (u8::from(verdicts.capped()), u8::from(verdicts.failed(self.criterion)));
                    let gap_m = plan.grid.gap_m(cell, model, profile);
                    let conflict = u8::from(map.is_conflict(at, cell));
                    let outcome = map.outcome(at, cell, self.criterion).label();
                    write!(out, "{place},{gap_m},{},{collision},{ttc},{btn},{capped},{failed}", model.name())?;
                    write!(out, ",{conflict},{outcome},{drives_through}")?;
                    if is_robust {
                        write!(out, ",{}", u8::from(map.is_undecided(at, cell, self.criterion)))?;
                    }
                    writeln!(out)?;
                }
            }
        }
        out.flush()
    }
}
