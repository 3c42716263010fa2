//! The tables of a `map` run: cells by outcome for the terminal, every cell as CSV.

use super::case_sentences::CLAUSE_OF_LEADERS;
use super::map::MapReport;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;
use lanesweep_run::grid::{CaseQuantity, CellOutcome, MappedGrid, VARIED};
use lanesweep_support::readable::count;
use lanesweep_support::table::{Column, Digits, NumberText, Table};

impl MapReport {
    /// Fractions and what they count, as text.
    pub fn text(&self) -> String {
        format!("{}\n{}{}", self.caption(), self.shares().text(), self.words())
    }

    /// What the fractions are of.
    pub(super) fn caption(&self) -> String {
        let (criterion, profile, all) = (self.criterion.label(), &self.profile.name, count(self.simulations()));
        format!("Share of cells that fail {criterion} under {profile}, of {all} simulations")
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
        let of_grid = self.grids.iter().any(|mapped| mapped.is_chosen_to_match).then_some(
            "* The known grid is not published. Ours was chosen so that the share of RSS comes out: that it agrees \
             confirms nothing.\n",
        );
        let turns = match self.is_robust() {
            true => format!("the outcome changes with one of these (the step in binary64): {VARIED}; or "),
            false => String::new(),
        };
        let undecided = format!(
            "Undecided: {turns}an ego that never reacts is still closing in at the time cap of {} s; the share counts these cells as \
             computed.\n",
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
        let (outcomes, cautions) = (self.shown_outcomes(), self.cautions());
        let of_outcomes = outcomes.iter().map(sentence).chain([of_all]);
        of_grid.into_iter().chain(of_outcomes).chain(cautions.iter().map(String::as_str)).collect()
    }

    /// Sentences on cells whose case is not what a reader would take it for.
    pub(super) fn cautions(&self) -> Vec<String> {
        let mut all = Vec::new();
        for MappedGrid { plan, map, .. } in &self.grids {
            let brakes = (0..plan.grid.cell_count())
                .any(|cell| plan.grid.point(cell).get(CaseQuantity::Deceleration).is_some_and(|a| a != 0.0));
            let of_leaders = format!("{CLAUSE_OF_LEADERS}.\n");
            let (name, clause) = (&plan.grid.name, &self.profile.reg157.clause);
            match plan.grid.category {
                _ if !brakes || clause.is_empty() => {}
                Category::Lvd if !all.contains(&of_leaders) => all.push(of_leaders),
                Category::CutIn if map.models.contains(&ModelId::Reg157) => all.push(format!(
                    "Reg157 in {name}: a vehicle that brakes while it cuts in does not keep its speed, so {clause} demands nothing of \
                     these cells, whatever the model does.\n"
                )),
                _ => {}
            }
        }
        all
    }

    /// One row per cell and model.
    pub(super) fn cells(&self) -> Table {
        // All grids of a run have the same parameters.
        let grid = self.grids.first().map(|mapped| mapped.plan.grid.values(0)).unwrap_or_default();
        let keys: Vec<&str> = grid.iter().map(|(parameter, _)| parameter.key).collect();
        let rows = self.grids.iter().flat_map(|of| {
            let models = 0..of.map.models.len();
            (0..of.map.cell_count()).flat_map(move |cell| models.clone().map(move |at| (of, cell, at)))
        });
        type Row<'a> = (&'a MappedGrid, usize, usize);
        let failed = |(of, cell, at): Row<'_>, criterion| of.map.verdicts(at, cell).failed(criterion);
        let gap_m = |(MappedGrid { plan, map, .. }, cell, at): Row<'_>| {
            plan.grid.gap_m(cell, map.models[at], &plan.parts[0].plan.profile)
        };
        Table::of(rows)
            .column("map", |(of, ..)| of.plan.grid.name.as_str())
            .columns(0..keys.len(), |key| keys[key].to_owned(), |(of, cell, _), key| of.plan.grid.values(cell)[key].1)
            .column("initial_gap_m", gap_m)
            .column("model", |(of, _, at)| of.map.models[at].name())
            .columns(
                [("collision", Criterion::Collision), ("ttc", Criterion::Ttc), ("btn", Criterion::Btn)],
                |(name, _)| name,
                |row, (_, of)| failed(row, of),
            )
            .column("capped", |(of, cell, at)| of.map.verdicts(at, cell).capped())
            .column("failed", |row| failed(row, self.criterion))
            .column("conflict", |(of, cell, at)| of.map.is_conflict(at, cell))
            .column("outcome", |(of, cell, at)| of.map.outcome(at, cell, self.criterion).label())
            .column("drives_through", |(of, cell, _)| of.map.drives_through(cell))
            .columns(
                self.is_robust().then_some("undecided"),
                |name| name,
                |(of, cell, at), _| of.map.is_undecided(at, cell, self.criterion),
            )
            .build()
    }
}
