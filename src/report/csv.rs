//! The tables as CSV: numbers in full precision, an empty field where a value is undefined.

use super::records::{Table, whole, words};
use crate::model::criterion::Criterion;
use crate::run::score::{ClaimResult, ClaimVerdict, ScoreCell, ScoreInterval, ScoreTable, f1, precision, recall};
use crate::scenario::parameterization::Parameterization;
use crate::support::table::{Cell, cell_text};
use crate::{Error, Result};

pub(crate) fn text(rows: Vec<Vec<String>>) -> Result<Vec<u8>> {
    let broken = |e: &dyn std::fmt::Display| Error::Internal(format!("a CSV table cannot be written: {e}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.write_record(row.iter().map(|cell| cell_text(cell).into_owned())).map_err(|e| broken(&e))?;
    }
    writer.into_inner().map_err(|e| broken(&e))
}

/// Failures of S and S': one row per category, variant, model and criterion. `data` says what was swept.
pub fn failures(scores: &ScoreTable, data: &str) -> Result<Table> {
    let columns = ["category", "variant", "model", "criterion", "failures", "simulations", "capped", "data"];
    let mut table = Table::new(&columns);
    for category in &scores.categories {
        for (at, cell) in category.cells.iter().enumerate() {
            let failures = if cell.variant == 0 { cell.counts.tp } else { cell.counts.tp + cell.counts.fp };
            // Cells are variant × model × criterion, these counts variant × model.
            let capped = category.capped.get(at / Criterion::ALL.len()).ok_or_else(|| {
                let what = format!("{} of {}", cell.model.name(), category.variants[cell.variant]);
                Error::Internal(format!("no count of lanes at the time cap for {what}"))
            })?;
            table.push(vec![
                words(category.category.key()),
                words(category.variants[cell.variant].as_str()),
                words(cell.model.name()),
                words(cell.criterion.key()),
                whole(failures),
                whole(category.simulations),
                whole(*capped),
                words(data),
            ]);
        }
    }
    Ok(table)
}

/// Scores: one row per category, parameterization, model and criterion.
pub fn f1_scores(scores: &ScoreTable, data: &str) -> Table {
    let mut table = Table::new(&[
        "category",
        "parameterization",
        "parameters",
        "model",
        "criterion",
        "tp",
        "fn",
        "fp",
        "tn",
        "recall",
        "precision",
        "f1",
        "f1_low",
        "f1_high",
        "f1_no_interval",
        "failing_scenarios",
        "data",
    ]);
    for category in &scores.categories {
        for cell in category.cells.iter().filter(|c| c.variant > 0) {
            let name = &category.variants[cell.variant];
            let parameters =
                Parameterization::find(category.category, name).map_or(Cell::Null, |p| whole(p.parameter_count()));
            let c = &cell.counts;
            let end = |pick: fn(ScoreInterval) -> f64| Cell::number(cell.f1_interval.map(pick));
            table.push(vec![
                words(category.category.key()),
                words(name.as_str()),
                parameters,
                words(cell.model.name()),
                words(cell.criterion.key()),
                whole(c.tp),
                whole(c.fn_),
                whole(c.fp),
                whole(c.tn),
                Cell::number(recall(c)),
                Cell::number(precision(c)),
                Cell::number(f1(c)),
                end(|i| i.low),
                end(|i| i.high),
                words(no_interval(cell)),
                whole(cell.failing_scenarios),
                words(data),
            ]);
        }
    }
    table
}

/// Why F1 has no interval; empty where it has one.
fn no_interval(cell: &ScoreCell) -> &'static str {
    match (f1(&cell.counts), cell.f1_interval) {
        (_, Some(_)) => "",
        (None, None) => "undefined",
        (Some(_), None) => "S fails in too few scenarios",
    }
}

/// Claims: per claim one row over all cells (`model` and `criterion` empty), then one per cell.
pub fn claims(results: &[ClaimResult], data: &str) -> Table {
    let mut table = Table::new(&[
        "claim",
        "category",
        "statement",
        "model",
        "criterion",
        "failing_scenarios",
        "difference",
        "low",
        "high",
        "verdict",
        "data",
    ]);
    for result in results {
        let claim = [result.claim.id, result.claim.category.key(), result.claim.statement];
        let mut add = |cell: [&str; 2], failing: u64, numbers: [Option<f64>; 3], verdict: ClaimVerdict| {
            let texts = claim.into_iter().chain(cell).map(words).chain([whole(failing)]);
            let numbers = numbers.into_iter().map(Cell::number);
            table.push(texts.chain(numbers).chain([words(verdict.text()), words(data)]).collect());
        };
        add(["", ""], result.failing_scenarios, [result.mean, None, None], result.verdict);
        for cell in &result.rows {
            let numbers = [cell.value, cell.interval.map(|i| i.low), cell.interval.map(|i| i.high)];
            add([cell.cell.0.name(), cell.cell.1.key()], cell.failing_scenarios, numbers, cell.verdict);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Confusion, Headway};
    use crate::model::driver::ModelId;
    use crate::run::score::{CategoryScores, ScoreCell, ScoreOptions};
    use crate::scenario::Category;

    fn scores(capped: Vec<u64>) -> ScoreTable {
        let cell = |model, criterion| {
            let counts = Confusion::default();
            ScoreCell { variant: 0, model, criterion, counts, f1_interval: None, failing_scenarios: 0 }
        };
        let models = [ModelId::Rss, ModelId::Fsm];
        let scores = CategoryScores {
            category: Category::Lvd,
            scenarios: 1,
            simulations: 10,
            variants: vec!["S".to_owned()],
            // One model that the cells have is not in the list.
            models: vec![ModelId::Rss],
            cells: models.into_iter().flat_map(|m| Criterion::ALL.map(|c| cell(m, c))).collect(),
            capped,
        };
        ScoreTable { categories: vec![scores], headways: Headway::paper(), options: ScoreOptions::default() }
    }

    #[test]
    fn no_model_gets_the_capped_lanes_of_another_one() {
        let text = failures(&scores(vec![3, 8]), "synthetic").unwrap().csv();
        assert!(text.contains("lvd,S,RSS,collision,0,10,3,") && text.contains("lvd,S,FSM,btn,0,10,8,"), "{text}");
        let Err(error) = failures(&scores(vec![3]), "synthetic") else { panic!("a table") };
        assert!(error.to_string().contains("FSM of S"), "{error}");
    }
}
