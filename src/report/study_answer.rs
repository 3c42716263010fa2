//! The answer of a study on one terminal screen: the best parameterization, what it hides, and what the data do not
//! show.

use super::html::Section;
use super::study::StudyReport;
use super::study_figures::variant_name;
use super::tables::{reference_text, wrap};
use lanesweep_run::score::Best;
use lanesweep_support::readable::{count, count_of, counted};
use lanesweep_support::table::{NumberText, Table};

/// Width of the screen in columns, and minimum width of a narrower one.
const WIDTH: usize = 80;
const MIN_WIDTH: usize = 40;
/// Maximum number of rows of the table: with the lines around it and those on stderr, the screen has 24 lines.
const MAX_ROWS: usize = 12;
/// Maximum characters of a list of parameterizations.
const LIST: usize = 14;

const HEADER: [&str; 7] = ["scenario", "driver", "best", "F1", "hides", "not told apart", "needs"];
/// Index of the column with F1, or with the reason why it is missing.
const SCORE: usize = 3;
/// Columns of numbers.
const NUMBERS: [usize; 2] = [4, 6];

/// What the last columns say.
const LEGEND: &str = "hides: colliding runs of S that the best lacks. not told apart: F1 within chance of the best's. \
                      needs: times as many scenarios to tell, if F1 stays.";

fn table(rows: &[[String; 7]]) -> Table {
    let words = Table::of(rows).columns(0..4, |at| HEADER[at], |row, at| row[at].as_str());
    words.columns(4..7, |at| HEADER[at], |row, at| NumberText(row[at].clone())).build()
}

impl StudyReport<'_> {
    /// The answer in at most 20 lines of 80 columns, or fewer columns on a narrower terminal.
    pub fn answer(&self, width: usize) -> String {
        let width = width.clamp(MIN_WIDTH, WIDTH);
        let made_up = if self.facts().synthetic { ". No number here is a statement about real traffic." } else { "" };
        let mut lines = vec![
            wrap(&format!("{}{made_up}", self.facts().data), width),
            wrap(&self.size(), width),
            String::new(),
            wrap(&self.question(), width),
        ];
        lines.extend(self.rows(width));
        lines.extend(
            self.comparison
                .iter()
                .filter_map(|comparison| Some(wrap(reference_text(comparison).lines().next()?, width))),
        );
        lines.push(wrap(LEGEND, width));
        lines.join("\n") + "\n"
    }

    /// The same as a section of the page, above the others.
    pub(super) fn answer_section(&self) -> Section {
        let named = |best: &Best| {
            let mut row = self.row(best);
            best.score.iter().for_each(|score| row[2] = variant_name(best.category, &score.variant));
            row
        };
        let rows: Vec<[String; 7]> = self.evaluation.best.iter().map(named).collect();
        let intro = format!("{}. {LEGEND}", self.size());
        Section::new("answer", "").intro(intro).tables([table(&rows).captioned(self.question())])
    }

    fn size(&self) -> String {
        let kinds =
            self.evaluation.scores.categories.iter().map(|c| format!("{} {}s", count(c.scenarios), c.category.label()));
        format!(
            "{}; {}, {}: {} lanes",
            kinds.collect::<Vec<_>>().join(", "),
            self.headways_in_words(),
            counted(self.evaluation.scores.categories.first().map_or(0, |c| c.models.len()), "driver"),
            count(self.lanes())
        )
    }

    fn question(&self) -> String {
        let level = 100.0 * self.evaluation.scores.options.confidence;
        format!("Which S' collides where S, as recorded, collides? F1 with its {level} % interval:")
    }

    fn rows(&self, screen: usize) -> Vec<String> {
        let known: Vec<[String; 7]> = self.evaluation.best.iter().take(MAX_ROWS).map(|best| self.row(best)).collect();
        let header = HEADER.map(str::to_owned);
        let is_sentence = |row: &[String; 7], at: usize| at == SCORE && row[SCORE + 1].is_empty();
        let width = |at: usize| {
            let cells = std::iter::once(&header).chain(&known).filter(|row| !is_sentence(row, at));
            cells.map(|row| row[at].chars().count()).max().unwrap_or(0)
        };
        let widths: [usize; 7] = std::array::from_fn(width);
        let line = |row: &[String; 7]| {
            let (mut line, mut end) = (String::new(), 0);
            for (at, cell) in row.iter().enumerate() {
                end += widths[at] + if at > 0 { 2 } else { 0 };
                let start = end - if NUMBERS.contains(&at) { cell.chars().count() } else { widths[at] };
                // A sentence in place of an answer extends over the empty columns after it.
                let gap = start.saturating_sub(line.chars().count()).max(if at > 0 { 2 } else { 0 });
                if !cell.is_empty() {
                    line += &" ".repeat(gap);
                    line += cell;
                }
            }
            line
        };
        let mut lines: Vec<String> = std::iter::once(&header).chain(&known).map(line).collect();
        if lines.iter().any(|line| line.chars().count() > screen) {
            lines = table(&known).fitted(2, screen).lines().map(str::to_owned).collect();
        }
        let more = self.evaluation.best.len().saturating_sub(MAX_ROWS);
        if more > 0 {
            lines.push(format!("… and {} more: f1.csv", count_of(more)));
        }
        lines
    }

    fn row(&self, best: &Best) -> [String; 7] {
        let min_scenarios = u64::from(self.evaluation.scores.options.min_failures.max(1));
        let name = [best.category.label(), best.model.name()].map(str::to_owned);
        let Some(score) = &best.score else {
            let scenarios = best.failing_scenarios;
            let times = min_scenarios as f64 / scenarios as f64;
            let text = match scenarios {
                0 => "S never collides: nothing to compare".to_owned(),
                1 => format!("too few: 1 colliding scenario, {min_scenarios} needed"),
                _ => format!("too few: {} colliding scenarios, {min_scenarios} needed", count(scenarios)),
            };
            let needs = if scenarios == 0 { "-".to_owned() } else { factor(times) };
            let [category, model] = name;
            return [category, model, "-".to_owned(), text, String::new(), String::new(), needs];
        };
        let interval = format!("{:.2} [{:.2} {:.2}]", score.f1, score.interval.low, score.interval.high);
        let hidden = format!("{} of {}", count(score.hidden), count(best.failures));
        let (rivals, needs) = match score.rivals.is_empty() {
            true => ("-".to_owned(), "-".to_owned()),
            false => (list(&score.rivals), factor(score.more_data)),
        };
        let [category, model] = name;
        [category, model, score.variant.clone(), interval, hidden, rivals, needs]
    }
}

/// The names, as many as fit.
fn list(names: &[String]) -> String {
    let text = names.join(", ");
    if text.chars().count() <= LIST { text } else { format!("{} others", names.len()) }
}

/// `1.3x`, rounded up: how much more data is needed, or a text if the factor is unrealistic.
fn factor(times: f64) -> String {
    match times {
        t if t >= 100.0 || t.is_nan() => ">100x".to_owned(),
        t if t >= 9.95 => format!("{:.0}x", t.ceil()),
        t => format!("{:.1}x", (10.0 * t).ceil() / 10.0),
    }
}
