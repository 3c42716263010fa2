//! The tables of a study: for people in the paper's layout, for files with one row per number.

use super::study_figures::short_name;
use lanesweep_engine::Headway;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::scenario::Category;
use lanesweep_model::scenario::parameterization::Parameterization;
use lanesweep_run::score::{
    CROSS_VALIDATED, CategoryScores, ClaimResult, ClaimVerdict, PublishedFailures, ScoreCell, ScoreInterval,
    ScoreTable, f1, precision, published_failures, published_lvd_f1, recall,
};
use lanesweep_run::study::{ReferenceComparison, StudyEvaluation};
use lanesweep_support::readable;
pub use lanesweep_support::table::WIDTH;
use lanesweep_support::table::{Column, Digits, NumberText, Table};
use lanesweep_support::{Error, Result};

/// Failures of S per category, model and criterion, as in the paper's table. With `published`, the fractions of
/// collision, TTC and BTN and the published ones.
pub(super) fn failure_table(scores: &ScoreTable, published: bool) -> Table {
    let rows = scores.categories.iter().flat_map(|c| (0..c.models.len()).map(move |at| (c, at, c.models[at])));
    let failures =
        |c: &CategoryScores, model, criterion| c.index(0, model, criterion).map_or(0, |cell| c.cells[cell].counts.tp);
    let table = Table::of(rows)
        .column("scenario", |(c, ..)| c.category.label())
        .column("model", |(.., model)| model.name())
        .columns(
            Criterion::ALL.into_iter().zip(["collision", "TTC", "BTN"]),
            |(_, name)| name,
            |(c, _, model), (criterion, _)| failures(c, model, criterion),
        )
        .column("simulations", |(c, ..)| c.simulations)
        .column("at the time cap", |(c, at, _)| c.capped[at]);
    if !published {
        return table.build();
    }
    let shares = |percent: &dyn Fn(Criterion) -> Option<f64>| {
        let text = |c| percent(c).map_or_else(|| "-".to_owned(), |percent| format!("{percent:.1}"));
        NumberText(Criterion::ALL.map(text).join("  "))
    };
    table
        .column("share, %", |(c, _, model)| {
            shares(&|of| Some(100.0 * failures(c, model, of) as f64 / c.simulations as f64))
        })
        .column("published, %", |(c, _, model)| {
            shares(&|of| published_failures(c.category, model, of).map(PublishedFailures::percent))
        })
        .build()
}

/// F1 per parameterization, model and criterion, with its interval.
pub(super) fn f1_scores(scores: &CategoryScores) -> Table {
    per_variant(scores, scores.judged(), Some("S fails"), |cell| f1_text(f1(&cell.counts), cell.f1_interval))
}

/// F1 in sample beside the paper's, which is in sample; without rows where the paper has none.
pub(super) fn f1_beside_published(scores: &CategoryScores) -> Option<Table> {
    let variants: Vec<usize> =
        (1..scores.variants.len()).filter(|at| !scores.variants[*at].ends_with(CROSS_VALIDATED)).collect();
    let table = per_variant(scores, variants, None, |cell| {
        let theirs = published_lvd_f1(&scores.variants[cell.variant], cell.model, cell.criterion);
        share(f1(&cell.counts)) + &theirs.map_or(String::new(), |theirs| format!("\npaper {theirs:.3}"))
    });
    (scores.category == Category::Lvd).then_some(table)
}

/// Recall and precision per parameterization, model and criterion.
pub(super) fn share_table(scores: &CategoryScores) -> Table {
    per_variant(scores, scores.judged(), None, |cell| {
        format!("{} / {}", share(recall(&cell.counts)), share(precision(&cell.counts)))
    })
}

fn share(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.3}"))
}

/// A row per model and criterion of the cells of S, a column per parameterization with the texts of its cells.
fn per_variant(
    scores: &CategoryScores,
    variants: Vec<usize>,
    fails: Option<&'static str>,
    text: impl Fn(&ScoreCell) -> String,
) -> Table {
    let same = |s: &ScoreCell, variant| scores.index(variant, s.model, s.criterion).map(|at| text(&scores.cells[at]));
    Table::of(scores.cells.iter().filter(|cell| cell.variant == 0))
        .column("model", |s| s.model.name())
        .column("criterion", |s| s.criterion.label())
        .columns(fails, |name| name, |s, _| s.counts.tp)
        .columns(
            variants,
            |variant| short_name(&scores.variants[variant]).to_owned(),
            |s, variant| NumberText(same(s, variant).unwrap_or("-".to_owned())),
        )
        .build()
}

fn f1_text(value: Option<f64>, interval: Option<ScoreInterval>) -> String {
    match (value, interval) {
        (Some(value), Some(interval)) => format!("{value:.3}\n[{} {}]", short(interval.low), short(interval.high)),
        (Some(value), None) => format!("{value:.3}\n[few]"),
        (None, _) => "-".to_owned(),
    }
}

/// A number in 0…1 in three characters, so that seven variants fit side by side: `.87`, `1.0`.
fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    text.strip_prefix('0').map_or_else(|| format!("{value:.1}"), str::to_owned)
}

/// The paper's claims with their numbers and verdicts, without those that could not be computed.
pub(super) fn claim_table(results: &[ClaimResult]) -> Table {
    Table::of(results.iter().filter(|result| result.verdict != ClaimVerdict::NotRun))
        .column("claim", |result| result.claim.id)
        .column("the paper says", |result| result.claim.statement)
        .column("failing\nscenarios", |result| result.failing_scenarios)
        .column(Column::from("mean\ndifference").digits(Digits::Signed(3)).null("-"), |result| result.mean)
        .column("verdict", |result| result.verdict.text())
        .column("cells", |result| {
            let count = |verdict| result.rows.iter().filter(|r| r.verdict == verdict).count();
            let cells = ClaimVerdict::ALL.into_iter().filter(|verdict| count(*verdict) > 0);
            cells.map(|verdict| format!("{} {}", count(verdict), verdict.text())).collect::<Vec<_>>().join("\n")
        })
        .build()
}

/// A row of the table of results: a cell of the scores over all headways, or the failures at one.
#[derive(Clone, Copy)]
struct ResultRow<'a> {
    scores: &'a CategoryScores,
    cell: &'a ScoreCell,
    /// `None`: all.
    headway: Option<Headway>,
    failures: u64,
    simulations: u64,
    /// Runs at the time cap; only over all headways.
    capped: Option<u64>,
}

impl<'a> ResultRow<'a> {
    /// The scores, which compare S' with S over all headways.
    fn score(self) -> Option<&'a ScoreCell> {
        (self.cell.variant > 0 && self.headway.is_none()).then_some(self.cell)
    }

    /// `None` for S and S' of other programs.
    fn parameterization(self) -> Option<Parameterization> {
        Parameterization::find(self.scores.category, short_name(&self.scores.variants[self.cell.variant]))
    }
}

/// Everything that a study counts and scores: a row per category, variant, driver model, criterion and headway, and one over
/// all headways. `data` describes the data.
///
/// # Errors
/// [`Error::Internal`] if there are fewer counts of capped lanes than cells.
pub(super) fn result_records(evaluation: &StudyEvaluation, data: &str) -> Result<Table> {
    let mut rows = Vec::new();
    for (scores, numbers) in evaluation.scores.categories.iter().zip(&evaluation.categories) {
        let of = &numbers.headways;
        for (at, cell) in scores.cells.iter().enumerate() {
            // Cells are variant × model × criterion; these counts are variant × model.
            let capped = scores.capped.get(at / Criterion::ALL.len()).ok_or_else(|| {
                let what = format!("{} of {}", cell.model.name(), scores.variants[cell.variant]);
                Error::Internal(format!("no count of lanes at the time cap for {what}"))
            })?;
            let failures = cell.counts.tp + if cell.variant == 0 { 0 } else { cell.counts.fp };
            let (simulations, capped) = (scores.simulations, Some(*capped));
            rows.push(ResultRow { scores, cell, headway: None, failures, simulations, capped });
            let model = at / Criterion::ALL.len() % scores.models.len();
            rows.extend(of.headways.iter().enumerate().map(|(at, headway)| ResultRow {
                headway: Some(*headway),
                failures: of.count((cell.variant, at, model, cell.criterion)),
                simulations: scores.scenarios,
                capped: None,
                scores,
                cell,
            }));
        }
    }
    let counts = |row: ResultRow<'_>| row.score().map(|cell| cell.counts);
    let interval = |row: ResultRow<'_>| row.score().and_then(|cell| cell.f1_interval);
    Ok(Table::of(rows)
        .column("category", |row| row.scores.category.key())
        .column("variant", |row| row.scores.variants[row.cell.variant].as_str())
        .column("model", |row| row.cell.model.name())
        .column("criterion", |row| row.cell.criterion.key())
        .column("headway", |row| row.headway.map_or("all".to_owned(), |headway| headway.to_string()))
        .column("parameters", |row| row.parameterization().map(|found| found.parameter_count()))
        .column("fit", |row| match row.parameterization().and_then(|found| found.coefficients()) {
            Some(_) if row.scores.variants[row.cell.variant].ends_with(CROSS_VALIDATED) => "cross-validated",
            Some(_) => "in sample",
            None => "",
        })
        .column("simulations", |row| row.simulations)
        .column("failures", |row| row.failures)
        .column("capped", |row| row.capped)
        .column("tp", |row| counts(row).map(|of| of.tp))
        .column("fn", |row| counts(row).map(|of| of.fn_))
        .column("fp", |row| counts(row).map(|of| of.fp))
        .column("tn", |row| counts(row).map(|of| of.tn))
        .column("recall", |row| counts(row).and_then(|of| recall(&of)))
        .column("precision", |row| counts(row).and_then(|of| precision(&of)))
        .column("f1", |row| counts(row).and_then(|of| f1(&of)))
        .column("f1_low", |row| interval(row).map(|of| of.low))
        .column("f1_high", |row| interval(row).map(|of| of.high))
        .column("f1_no_interval", |row| row.score().map_or("", no_interval))
        .column("failing_scenarios", |row| row.headway.is_none().then_some(row.cell.failing_scenarios))
        .column("data", |_| data)
        .build())
}

/// Why F1 has no interval; empty if it has one.
fn no_interval(cell: &ScoreCell) -> &'static str {
    match (f1(&cell.counts), cell.f1_interval) {
        (_, Some(_)) => "",
        (None, None) => "undefined",
        (Some(_), None) => "S fails in too few scenarios",
    }
}

/// Claims: per claim one row over all cells (`model` and `criterion` empty), then one per cell.
pub(super) fn claim_records(results: &[ClaimResult], data: &str) -> Table {
    let rows = results.iter().flat_map(|of| {
        let all = (&of.claim, None, of.failing_scenarios, of.mean, None, of.verdict);
        let cells = of
            .rows
            .iter()
            .map(|row| (&of.claim, Some(row.cell), row.failing_scenarios, row.value, row.interval, row.verdict));
        std::iter::once(all).chain(cells)
    });
    Table::of(rows)
        .column("claim", |(claim, ..)| claim.id)
        .column("category", |(claim, ..)| claim.category.key())
        .column("statement", |(claim, ..)| claim.statement)
        .column("model", |(_, cell, ..)| cell.map(|(model, _)| model.name()))
        .column("criterion", |(_, cell, ..)| cell.map(|(_, criterion)| criterion.key()))
        .column("failing_scenarios", |(_, _, failing, ..)| failing)
        .column("difference", |(_, _, _, value, ..)| value)
        .column("low", |(.., interval, _)| interval.map(|interval| interval.low))
        .column("high", |(.., interval, _)| interval.map(|interval| interval.high))
        .column("verdict", |(.., verdict)| verdict.text())
        .column("data", |_| data)
        .build()
}

/// One line for the terminal, and the first differences.
pub(super) fn reference_text(comparison: &ReferenceComparison) -> String {
    let (lanes, differences) = (comparison.lanes, readable::count(comparison.differences.len()));
    let [all, lanes, caps] = [lanes * Criterion::ALL.len() as u64, lanes, comparison.cap_differs].map(readable::count);
    let mut text = format!(
        "f32 against the f64 reference: {differences} of {all} verdicts differ ({lanes} lanes; the cap differs in {caps})\n"
    );
    for d in comparison.differences.iter().take(20) {
        let side = if d.failed_in_f32 { "fails in f32 only" } else { "fails in f64 only" };
        text += &format!("  {} {}: {side}, {:.3e} from the threshold\n", d.lane, d.criterion.label(), d.distance);
    }
    text
}

/// All differences, one per row.
pub(super) fn reference_table(comparison: &ReferenceComparison) -> Table {
    Table::of(&comparison.differences)
        .column("lane", |of| of.lane.as_str())
        .column("criterion", |of| of.criterion.key())
        .column("failed_in_f32", |of| u8::from(of.failed_in_f32))
        .column("distance_to_threshold", |of| of.distance)
        .build()
}

/// A paragraph of a text, as wide as a file's lines may be.
pub(super) fn paragraph(words: &str) -> String {
    wrap(words, WIDTH) + "\n"
}

/// A paragraph, indented.
pub(super) fn indented(words: &str) -> String {
    format!("  {}\n", wrap(words, WIDTH - 2).replace('\n', "\n  "))
}

/// The text wrapped between words; a longer word stays whole.
pub(crate) fn wrap(text: &str, width: usize) -> String {
    let (mut wrapped, mut column) = (String::new(), 0);
    for word in text.split(' ') {
        let length = word.chars().count();
        let (space, begin) = match column {
            0 => ("", 0),
            _ if column + 1 + length > width => ("\n", 0),
            _ => (" ", column + 1),
        };
        wrapped.extend([space, word]);
        column = begin + length;
    }
    wrapped
}
