//! Tables for the terminal, as plain text.

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table, Width, presets};

use crate::model::criterion::Criterion;
use crate::run::score::{
    CategoryScores, ClaimResult, ClaimRow, ClaimVerdict, Misfit, PublishedFailures, ScoreInterval, ScoreTable, f1,
    published_failures, published_lvd_f1,
};
use crate::support::readable;

/// Columns that every table fits in where no terminal says how wide it is.
pub(crate) const WIDTH: usize = 120;

/// A blank at which no line is broken.
const NO_BREAK: char = '\u{a0}';

/// An empty table that breaks its cells rather than the terminal's lines.
pub(super) fn table(header: Vec<String>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH as u16).set_header(header);
    table
}

/// Numbers to the right, the first `texts` columns to the left. No word and no number is broken: the table is rather wider
/// than it was set.
pub(super) fn aligned(mut table: Table, texts: usize) -> String {
    let widths = column_widths(&table);
    for (column, width) in table.column_iter_mut().zip(widths) {
        // With a space on either side.
        column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(width as u16 + 2)));
    }
    for (at, column) in table.column_iter_mut().enumerate() {
        column.set_cell_alignment(if at < texts { CellAlignment::Left } else { CellAlignment::Right });
    }
    format!("{table}\n")
}

/// Widths of the columns' texts: each holds its longest word, and columns with longer lines share what is left of the
/// table's width.
fn column_widths(table: &Table) -> Vec<usize> {
    let mut sizes: Vec<[usize; 2]> = Vec::new();
    for row in table.header().into_iter().chain(table.row_iter()) {
        for (at, cell) in row.cell_iter().enumerate() {
            sizes.resize(sizes.len().max(at + 1), [0; 2]);
            let text = cell.content();
            let longest =
                |parts: &mut dyn Iterator<Item = &str>| parts.map(|part| part.chars().count()).max().unwrap_or(0);
            let [word, line] = &mut sizes[at];
            *word = longest(&mut text.split_ascii_whitespace()).max(*word);
            *line = longest(&mut text.lines()).max(*line);
        }
    }
    let words: usize = sizes.iter().map(|[word, _]| word).sum();
    let wanted: usize = sizes.iter().map(|[word, line]| line - word).sum();
    let width = table.width().map_or(WIDTH, usize::from);
    let left = wanted.min(width.saturating_sub(3 * sizes.len() + 1 + words));
    sizes.iter().map(|[word, line]| word + (line - word) * left / wanted.max(1)).collect()
}

/// A table within so many columns of the terminal, its first `texts` columns to the left. Where it is too wide it becomes
/// several, each with the first `keys` columns, so that no number and no interval is broken.
pub(super) fn fitted(header: &[String], rows: &[Vec<String>], (keys, texts): (usize, usize), width: usize) -> String {
    let lines = |at: usize| {
        let cells = std::iter::once(header).chain(rows.iter().map(Vec::as_slice)).filter_map(move |row| row.get(at));
        cells.flat_map(|cell| cell.lines()).map(|line| line.chars().count())
    };
    // With the bars and spaces of the style.
    let column = |at: usize| lines(at).max().unwrap_or(0) + 3;
    let fixed: usize = 1 + (0..keys).map(column).sum::<usize>();
    let (mut parts, mut used) = (vec![(0..keys).collect::<Vec<usize>>()], fixed);
    for at in keys..header.len() {
        let last = parts.len() - 1;
        if used + column(at) > width && parts[last].len() > keys {
            (used, _) = (fixed, parts.push((0..keys).collect()));
        }
        used += column(at);
        let last = parts.len() - 1;
        parts[last].push(at);
    }
    // Nothing is broken within brackets, and no table is narrower than its words.
    let held = |cell: &String| {
        let mut depth = 0;
        let hold = |c: char| {
            depth += i32::from(c == '[') - i32::from(c == ']');
            if c == ' ' && depth > 0 { NO_BREAK } else { c }
        };
        cell.chars().map(hold).collect::<String>()
    };
    let longest = |at: usize| {
        let cells = std::iter::once(header).chain(rows.iter().map(Vec::as_slice)).filter_map(|row| row.get(at));
        let words = |cell: &String| held(cell).split([' ', '\n']).map(|word| word.chars().count()).max();
        cells.filter_map(words).max().unwrap_or(0) + 3
    };
    let text = |columns: &Vec<usize>| {
        let of =
            |row: &[String]| columns.iter().map(|&at| row.get(at).map(held).unwrap_or_default()).collect::<Vec<_>>();
        let mut table = table(of(header));
        let least = fixed + columns.iter().skip(keys).map(|at| longest(*at)).sum::<usize>();
        table.set_width(width.max(least) as u16);
        for row in rows {
            table.add_row(of(row));
        }
        aligned(table, columns.iter().filter(|at| **at < texts).count()).replace(NO_BREAK, " ")
    };
    parts.iter().map(text).collect::<Vec<_>>().join("\n")
}

/// Failures of S per category, model and criterion, as in the paper's table; where asked, the shares beside the
/// published ones, with the misfit.
pub fn failures(scores: &ScoreTable, published: bool, width: usize) -> String {
    let mut header: Vec<String> = ["scenario", "model"].map(str::to_owned).to_vec();
    header.extend(["collision", "TTC", "BTN", "simulations", "capped"].map(str::to_owned));
    if published {
        header.extend(PUBLISHED_COLUMNS.map(str::to_owned));
    }
    let misfit = Misfit::of(scores).filter(|_| published).map(|misfit| wrap(&misfit.sentence(), width) + "\n");
    let table = fitted(&header, &failure_rows(scores, published), (2, 2), width);
    format!("Failures of the recorded scenarios (S)\n{table}{}", misfit.unwrap_or_default())
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
pub fn f1_table(scores: &CategoryScores, published: bool, width: usize) -> String {
    let mut header = vec!["model".to_owned(), "criterion".to_owned(), "fails".to_owned()];
    header.extend(scores.variants.iter().skip(1).cloned());
    let heading = format!(
        "{}: F1 of S' against S over {} scenarios, [interval]; - is undefined (0/0), [few]: S fails \
         in too few scenarios",
        scores.category.label(),
        readable::count(scores.scenarios)
    );
    format!("{}\n{}", wrap(&heading, width), fitted(&header, &f1_rows(scores, published), (3, 2), width))
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
                    text += &format!("\npaper {theirs:.3}");
                }
                row.push(text);
            }
            rows.push(row);
        }
    }
    rows
}

fn value(value: Option<f64>, interval: Option<ScoreInterval>) -> String {
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

/// The paper's claims with their numbers and verdicts, in a text; nothing where none could be computed.
pub fn claims(results: &[ClaimResult], width: usize) -> String {
    let mut rows = claim_rows(results);
    if rows.is_empty() {
        return String::new();
    }
    rows.iter_mut().for_each(|row| row[1] = wrap(&row[1], 34));
    format!(
        "The paper's claims on this data\n{}{}\n",
        fitted(&CLAIM_COLUMNS.map(str::to_owned), &rows, (1, 2), width),
        wrap(ClaimVerdict::RULE, width)
    )
}

/// Columns of [`claims`].
pub(super) const CLAIM_COLUMNS: [&str; 6] =
    ["claim", "the paper says", "failing\nscenarios", "mean\ndifference", "verdict", "cells"];

/// The rows of [`claims`], without those that could not be computed.
pub(super) fn claim_rows(results: &[ClaimResult]) -> Vec<Vec<String>> {
    let row = |result: &ClaimResult| {
        let count = |verdict| result.rows.iter().filter(|r: &&ClaimRow| r.verdict == verdict).count();
        let cells = ClaimVerdict::ALL.into_iter().filter(|verdict| count(*verdict) > 0);
        vec![
            result.claim.id.to_owned(),
            result.claim.statement.to_owned(),
            readable::count(result.failing_scenarios),
            result.mean.map_or("-".to_owned(), |mean| format!("{mean:+.3}")),
            result.verdict.text().to_owned(),
            cells.map(|verdict| format!("{} {}", count(verdict), verdict.text())).collect::<Vec<_>>().join("\n"),
        ]
    };
    results.iter().filter(|result| result.verdict != ClaimVerdict::NotRun).map(row).collect()
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
    fn a_table_that_is_too_wide_becomes_several_and_breaks_no_interval() {
        let header: Vec<String> = ["model", "1", "2", "3", "4"].map(str::to_owned).to_vec();
        let rows =
            vec![["FSM", "0.5\n[.40 .60]", "0.6\n[.50 .70]", "0.7\n[.60 .80]", "0.8"].map(str::to_owned).to_vec()];
        let one = fitted(&header, &rows, (1, 1), 60);
        let two = fitted(&header, &rows, (1, 1), 35);
        assert_eq!((one.matches("FSM").count(), two.matches("FSM").count()), (1, 2), "{two}");
        for text in [one, two, fitted(&header, &rows, (1, 1), 20)] {
            assert!(["[.40 .60]", "[.50 .70]", "[.60 .80]"].iter().all(|interval| text.contains(interval)), "{text}");
        }
    }

    #[test]
    fn text_breaks_between_words() {
        assert_eq!(wrap("b and d are nearly the same", 11), "b and d are\nnearly the\nsame");
        assert_eq!(wrap("/a/path/longer/than/the/line 2", 5), "/a/path/longer/than/the/line\n2");
    }
}
