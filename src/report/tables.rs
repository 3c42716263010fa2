//! Tables for the terminal, as plain text.

use std::fmt::Write;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

use crate::model::criterion::Criterion;
use crate::run::score::{
    BootstrapInterval, CategoryScores, ClaimResult, ClaimRow, Misfit, PublishedFailures, ScoreTable, f1,
    published_failures, published_lvd_f1,
};
use crate::support::readable;

/// Columns of a terminal that every table fits in.
pub(crate) const WIDTH: usize = 120;

/// An empty table that breaks its cells rather than the terminal's lines.
pub(super) fn table(header: Vec<String>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH as u16).set_header(header);
    table
}

/// Numbers to the right, the first `texts` columns to the left.
pub(super) fn aligned(mut table: Table, texts: usize) -> String {
    for (at, column) in table.column_iter_mut().enumerate() {
        column.set_cell_alignment(if at < texts { CellAlignment::Left } else { CellAlignment::Right });
    }
    format!("{table}\n")
}

/// Failures of S per category, model and criterion, as in the paper's table; where asked, the shares beside the
/// published ones, with the misfit.
pub fn failures(scores: &ScoreTable, published: bool) -> String {
    let mut header: Vec<String> = ["scenario", "model"].map(str::to_owned).to_vec();
    header.extend(["collision", "TTC", "BTN", "simulations", "capped"].map(str::to_owned));
    if published {
        header.extend(PUBLISHED_COLUMNS.map(str::to_owned));
    }
    let mut table = table(header);
    for row in failure_rows(scores, published) {
        table.add_row(row);
    }
    let misfit = Misfit::of(scores).filter(|_| published).map(|misfit| wrap(&misfit.sentence(), WIDTH) + "\n");
    let misfit = misfit.unwrap_or_default();
    format!("Failures of the recorded scenarios (S)\n{}{misfit}", aligned(table, 2))
}

/// Columns of [`failures`] with the published numbers: collision, TTC and BTN.
pub(super) const PUBLISHED_COLUMNS: [&str; 2] = ["share, %", "published, %"];

/// The rows of [`failures`].
pub(super) fn failure_rows(scores: &ScoreTable, published: bool) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for category in &scores.categories {
        for (at, &model) in category.models.iter().enumerate() {
            let count = |c: Criterion| category.index(0, model, c).map_or(0, |i| category.cells[i].counts.tp);
            let mut row = vec![category.category.label().to_owned(), model.name().to_owned()];
            row.extend(Criterion::ALL.map(|c| readable::count(count(c))));
            row.extend([category.simulations, category.capped[at]].map(readable::count));
            if published {
                let ours = |c| 100.0 * count(c) as f64 / category.simulations as f64;
                let theirs = |c| published_failures(category.category, model, c).map(PublishedFailures::percent);
                let shares = |percent: &dyn Fn(Criterion) -> Option<f64>| {
                    let text = |c| percent(c).map_or_else(|| "-".to_owned(), |percent| format!("{percent:.1}"));
                    Criterion::ALL.map(text).join("  ")
                };
                row.extend([shares(&|c| Some(ours(c))), shares(&theirs)]);
            }
            rows.push(row);
        }
    }
    rows
}

/// F1 per parameterization, model and criterion, with its interval.
pub fn f1_table(scores: &CategoryScores, published: bool) -> String {
    let mut header = vec!["model".to_owned(), "criterion".to_owned(), "fails".to_owned()];
    header.extend(scores.variants.iter().skip(1).cloned());
    let mut table = table(header);
    for row in f1_rows(scores, published) {
        table.add_row(row);
    }
    format!(
        "{}: F1 of S' against S over {} scenarios, [interval]; - is undefined (0/0), [few]: S fails in too few scenarios\n{}",
        scores.category.label(),
        readable::count(scores.scenarios),
        aligned(table, 2)
    )
}

/// The rows of [`f1_table`].
pub(super) fn f1_rows(scores: &CategoryScores, published: bool) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for &model in &scores.models {
        for criterion in Criterion::ALL {
            let Some(s) = scores.index(0, model, criterion) else { continue };
            let mut row = vec![model.name().to_owned(), criterion.label().to_owned()];
            row.push(readable::count(scores.cells[s].counts.tp));
            for variant in 1..scores.variants.len() {
                let cell = scores.index(variant, model, criterion).map(|i| &scores.cells[i]);
                let mut text = cell.map_or("-".to_owned(), |c| value(f1(&c.counts), c.f1_interval));
                let theirs = published_lvd_f1(&scores.variants[variant], model, criterion);
                if let Some(theirs) = theirs.filter(|_| published) {
                    let _ = write!(text, "\npaper {theirs:.3}");
                }
                row.push(text);
            }
            rows.push(row);
        }
    }
    rows
}

fn value(value: Option<f64>, interval: Option<BootstrapInterval>) -> String {
    match (value, interval) {
        (Some(value), Some(interval)) => format!("{value:.3}\n[{} {}]", short(interval.low), short(interval.high)),
        (Some(value), None) => format!("{value:.3}\n[few]"),
        (None, _) => "-".to_owned(),
    }
}

/// A number in 0…1 in three characters, so that seven variants fit beside each other: `.87`, `1.0`.
fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    text.strip_prefix('0').map_or_else(|| format!("{value:.1}"), str::to_owned)
}

/// The paper's claims with their numbers and verdicts.
pub fn claims(results: &[ClaimResult]) -> String {
    let header = ["claim", "the paper says", "S fails", "difference\n[interval]", "verdict", "cells"];
    let mut table = table(header.map(str::to_owned).to_vec());
    for result in results {
        let row = &result.overall;
        let count = |verdict| result.rows.iter().filter(|r: &&ClaimRow| r.verdict == verdict).count();
        let mut verdicts = Vec::new();
        for verdict in [
            crate::run::score::ClaimVerdict::Holds,
            crate::run::score::ClaimVerdict::Contradicted,
            crate::run::score::ClaimVerdict::Undecided,
            crate::run::score::ClaimVerdict::TooFew,
            crate::run::score::ClaimVerdict::NotRun,
        ] {
            let n = count(verdict);
            if n > 0 {
                verdicts.push(format!("{n} {}", verdict.text()));
            }
        }
        table.add_row([
            result.claim.id.to_owned(),
            wrap(result.claim.statement, 34),
            readable::count(row.failures),
            difference(row),
            row.verdict.text().to_owned(),
            verdicts.join("\n"),
        ]);
    }
    format!(
        "The paper's claims on this data (mean over the cells with enough failures; cells: each model and \
         criterion)\n{}",
        aligned(table, 2)
    )
}

fn difference(row: &ClaimRow) -> String {
    let mut text = row.value.map_or("-".to_owned(), |v| format!("{v:+.3}"));
    if let Some(BootstrapInterval { low, high }) = row.interval {
        let _ = write!(text, "\n[{low:+.2} {high:+.2}]");
    }
    if row.undefined_draws > 0 {
        let _ = write!(text, "\n{} draws 0/0", row.undefined_draws);
    }
    text
}

/// The text broken between words; a longer word stays whole.
pub(crate) fn wrap(text: &str, width: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        if !lines[last].is_empty() && lines[last].chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_owned());
        } else {
            if !lines[last].is_empty() {
                lines[last].push(' ');
            }
            lines[last].push_str(word);
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_numbers_have_three_characters() {
        assert_eq!([0.0, 0.8687, 0.9949, 0.9951, 1.0].map(short), [".00", ".87", ".99", "1.0", "1.0"]);
    }

    #[test]
    fn text_breaks_between_words() {
        assert_eq!(wrap("b and d are nearly the same", 11), "b and d are\nnearly the\nsame");
        assert_eq!(wrap("/a/path/longer/than/the/line 2", 5), "/a/path/longer/than/the/line\n2");
    }
}
