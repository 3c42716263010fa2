//! Which driver decides on a map: cells that are preventable by each rule, and those that the rule turns.

use serde_json::Value;

use super::map::MapReport;
use crate::model::criterion::Criterion;
use crate::run::check::DriverRule;
use crate::run::grid::MappedGrid;
use crate::support::table::{Column, Digits, Table, TableOf};

/// The cells of a map by a rule.
#[derive(Clone, Copy)]
struct RuleCells<'a> {
    map: &'a str,
    rule: DriverRule,
    /// Cells in which an ego that never reacts collides.
    conflicts: u64,
    preventable: u64,
    /// Cells whose answer is not that of the rule in force.
    turned: u64,
}

impl MapReport {
    /// Every grid by every rule, then all grids together. Empty unless collisions are mapped with every reference driver.
    /// A grid in which each model starts at its own distance has no common cases.
    fn rule_cells(&self) -> Vec<RuleCells<'_>> {
        let references = &self.profile.reference_drivers;
        let mut all: Vec<RuleCells> = Vec::new();
        for MappedGrid { plan, map, .. } in &self.grids {
            let place = |model| map.models.iter().position(|of| *of == model);
            let Some(first) = references.first().and_then(|model| place(*model)) else { continue };
            let lacks_one = references.iter().any(|model| place(*model).is_none());
            if self.criterion != Criterion::Collision || lacks_one || plan.grid.has_native_gap() {
                continue;
            }
            let avoids =
                |cell, model| place(model).is_some_and(|at| !map.verdicts(at, cell).failed(Criterion::Collision));
            let prevents = |rule: DriverRule, cell: usize| rule.holds(references, |model| avoids(cell, model));
            let conflicts: Vec<usize> = (0..map.cell_count()).filter(|cell| map.is_conflict(first, *cell)).collect();
            let count = |holds: &dyn Fn(usize) -> bool| conflicts.iter().filter(|cell| holds(**cell)).count() as u64;
            all.extend(DriverRule::of(references).into_iter().map(|rule| RuleCells {
                map: plan.grid.name(),
                rule,
                conflicts: conflicts.len() as u64,
                preventable: count(&|cell| prevents(rule, cell)),
                turned: count(&|cell| prevents(rule, cell) != prevents(DriverRule::Any, cell)),
            }));
        }
        let rules = DriverRule::of(references).len();
        if all.len() > rules {
            let sum = |rule: usize| {
                let of_rule = all.iter().skip(rule).step_by(rules).copied();
                of_rule.reduce(|sum, of| RuleCells {
                    map: "all maps",
                    conflicts: sum.conflicts + of.conflicts,
                    preventable: sum.preventable + of.preventable,
                    turned: sum.turned + of.turned,
                    ..of
                })
            };
            let sums: Vec<RuleCells> = (0..rules).filter_map(sum).collect();
            all.extend(sums);
        }
        all
    }

    fn rule_table(&self) -> Table {
        let percent = |of: RuleCells| (of.conflicts > 0).then(|| 100.0 * of.turned as f64 / of.conflicts as f64);
        self.preventable_cells()
            .column("not preventable", |of| of.conflicts - of.preventable)
            .column("turned", |of| of.turned)
            .column(Column::from("turned %").digits(Digits::Fixed(2)).null("-"), percent)
            .build()
    }

    fn preventable_cells(&self) -> TableOf<RuleCells<'_>> {
        Table::of(self.rule_cells())
            .column("map", |of| of.map)
            .column("rule", |of| of.rule.label())
            .column("conflict", |of| of.conflicts)
            .column("preventable", |of| of.preventable)
    }

    /// The cells by rule as records.
    pub(super) fn rule_records(&self) -> Value {
        self.preventable_cells().column("turned", |of| of.turned).build().records()
    }

    /// The cells by rule as text; empty where there are none.
    pub(super) fn rule_text(&self) -> String {
        if self.rule_cells().is_empty() {
            return String::new();
        }
        format!(
            "\nPreventable cells by the driver that decides, of the cells with a conflict (an ego that never reacts collides)\n{}\
             Any: a collision is preventable where any reference driver avoids it. {}.\nTurned: conflict cells whose answer is \
             not that of the rule in force. Every cell counts as computed, an undecided one too.\n",
            self.rule_table().text(),
            DriverRule::SOURCE
        )
    }
}
