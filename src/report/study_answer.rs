//! The answer of a study on one terminal screen: the best parameterization, what it misses, and what the data do not show.

use super::html::Section;
use super::study::{CappedRecord, StudyReport};
use super::study_figures::{short_name, variant_name};
use super::tables::{reference_text, wrap};
use lanesweep_engine::Headway;
use lanesweep_model::scenario::Category;
use lanesweep_run::score::{Best, BestScore, CategoryScores};
use lanesweep_support::readable::{count, counted, significant};
use lanesweep_support::table::{NumberText, Table};

/// Width of the screen in columns, and minimum width of a narrower one.
const WIDTH: usize = 80;
const MIN_WIDTH: usize = 40;
const NO_BREAK: &str = "\u{a0}";
/// Maximum number of rows of the table.
const MAX_ROWS: usize = 12;
/// Maximum characters of a list of parameterizations.
const LIST: usize = 9;

const HEADER: [&str; 7] = ["scenario", "driver", "best", "F1", "missed, invented", "ties with", "data for decision"];
/// Index of the column with F1, or with the reason why it is missing.
const SCORE: usize = 3;
/// Columns of numbers.
const NUMBERS: [usize; 2] = [4, 6];

/// What the last columns say.
const LEGEND: &str = "Missed: S alone collides; invented: S' alone. Ties: F1 within chance of the best's; 2.0x: twice the \
                      scenarios would tell, if F1 stays.";

/// A row for a narrow screen, on which an interval stays on one line.
fn list_of(row: &[String; 7], screen: usize) -> String {
    let cells = HEADER.iter().zip(row).skip(2).filter(|(_, cell)| !cell.is_empty());
    let held = |cell: &String| if cell.contains('[') { cell.replace(' ', NO_BREAK) } else { cell.clone() };
    let cells = cells.map(|(name, cell)| format!("{name}: {}", held(cell)));
    wrap(&format!("{} {}; {}", row[0], row[1], cells.collect::<Vec<_>>().join("; ")), screen).replace(NO_BREAK, " ")
}

impl StudyReport<'_> {
    /// The answer in at most 26 lines of 80 columns, or fewer columns on a narrower terminal.
    pub fn answer(&self, width: usize) -> String {
        let width = width.clamp(MIN_WIDTH, WIDTH);
        let made_up = if self.facts().synthetic { ". No number here is a statement about real traffic." } else { "" };
        let mut lines = vec![
            wrap(&format!("{}{made_up}", self.facts().data), width),
            wrap(&self.size(), width),
            wrap(&self.question(), width),
        ];
        lines.extend(self.rows(width));
        lines.extend(
            self.comparison
                .iter()
                .filter_map(|comparison| Some(wrap(reference_text(comparison).lines().next()?, width))),
        );
        let has_best = self.evaluation.best.iter().any(|best| best.score.is_some());
        let legend = if has_best { format!("{LEGEND} ") } else { String::new() };
        lines.push(wrap(&format!("{legend}{}", self.conditions()), width));
        lines.push(wrap(self.next(), width));
        lines.join("\n") + "\n"
    }

    /// The same as a section of the page, above the others.
    pub(super) fn answer_section(&self) -> Section {
        let named = |best: &Best| {
            let mut row = self.row(best);
            // An interval stays on one line.
            if best.score.is_some() {
                row[SCORE] = row[SCORE].replace(' ', NO_BREAK);
            }
            best.score.iter().for_each(|score| row[2] = variant_name(best.category, &score.variant));
            row
        };
        // On a narrow screen a name would push the number out.
        let rows: Vec<[String; 7]> = self.evaluation.best.iter().map(named).collect();
        let words = Table::of(&rows).columns([0, 1, SCORE, 2], |at| HEADER[at], |row, at| row[at].as_str());
        let table = words.columns(4..7, |at| HEADER[at], |row, at| NumberText(row[at].clone())).build();
        let intro = format!("{}. {LEGEND} {}", self.size(), self.conditions());
        Section::new("answer", "").intro(intro).tables([table.captioned(self.question())])
    }

    /// The answer in a sentence: by category the parameterization that is best for most drivers.
    pub(super) fn sentence(&self) -> String {
        let best = &self.evaluation.best;
        let of_category = |of: &[Best]| {
            let scores: Vec<&BestScore> = of.iter().filter_map(|best| best.score.as_ref()).collect();
            let own = |best: &BestScore| scores.iter().filter(|score| score.variant == best.variant).count();
            // The first of equals.
            let most = scores.iter().rev().max_by_key(|score| own(score));
            let answer = most.map_or("too few collisions to tell".to_owned(), |best| {
                let tied =
                    scores.iter().filter(|score| score.variant == best.variant && !score.rivals.is_empty()).count();
                let (times, drivers) = (own(best), counted(of.len(), "driver"));
                let name = variant_name(of[0].category, &best.variant);
                format!("{name} (best for {times} of {drivers}, tied with others for {tied})")
            });
            format!("{}: {answer}", of[0].category.label())
        };
        let answers: Vec<String> = best.chunk_by(|a, b| a.category == b.category).map(of_category).collect();
        format!("S' that keeps the collisions of S best, {}.", answers.join("; "))
    }

    fn size(&self) -> String {
        let kinds =
            self.evaluation.scores.categories.iter().map(|c| format!("{} {}s", count(c.scenarios), c.category.label()));
        let (kinds, headways) = (kinds.collect::<Vec<_>>().join(", "), self.headways_in_words());
        let (drivers, runs) = (counted(self.drivers(), "driver"), count(self.lanes()));
        let profile = match self.study.plan().profile.name.as_str() {
            "paper" => String::new(),
            name => format!(", profile {name}"),
        };
        format!("{kinds}; {headways}, {drivers}{profile}: {runs} runs")
    }

    /// The number of driver models.
    pub(super) fn drivers(&self) -> usize {
        self.evaluation.scores.categories.first().map_or(0, |of| of.models.len())
    }

    fn question(&self) -> String {
        let scores = &self.evaluation.scores;
        let level = 100.0 * scores.options.confidence;
        let has = |is: fn(&CategoryScores) -> bool| scores.categories.iter().any(is);
        let judged = match (has(CategoryScores::is_in_sample), has(CategoryScores::is_cross_validated)) {
            (true, _) => " (SVD in sample)",
            (_, true) => " on scenarios that no fit has seen",
            _ => "",
        };
        format!("Which S' collides where S does? F1 [{level} %]{judged}:")
    }

    /// How far S is as recorded, and what its undecided runs may hide.
    fn conditions(&self) -> String {
        let scores = &self.evaluation.scores;
        let has_lvd = scores.categories.iter().any(|of| of.category == Category::Lvd);
        let mut text = match Headway::is_observed(&scores.headways) {
            true => "S is as recorded.".to_owned(),
            false => {
                "S is as recorded, but for the imposed gap".to_owned()
                    + if has_lvd { " and, in LVDs, the ego's speed." } else { "." }
            }
        };
        let categories = self.categories();
        let capped: Vec<&CappedRecord> = categories.iter().flat_map(|of| &of.capped_s).collect();
        let runs: u64 = capped.iter().map(|of| of.runs).sum();
        if runs > 0 {
            let least = match capped.iter().filter_map(|of| of.min_ttc_s).reduce(f64::min) {
                Some(s) => format!("their smallest TTC is {} s", significant(s, 2)),
                None => "none approaches".to_owned(),
            };
            let cap_s = self.study.plan().profile.frame.time_cap_s;
            let all: u64 = scores.categories.iter().map(|of| of.simulations * of.models.len() as u64).sum();
            let [runs, all] = [runs, all].map(count);
            text += &format!(" {runs} of {all} runs of S were undecided after {cap_s} s and count as passed; {least}.");
        }
        text
    }

    /// What to do next.
    fn next(&self) -> &'static str {
        match self.facts().synthetic {
            true => "Next, on your own recordings: lanesweep tracks DIR; lanesweep study DIR",
            false => "Next, how likely a failure is: lanesweep fit on the same data, then lanesweep sample",
        }
    }

    /// A head and the drivers' lines for each category.
    fn rows(&self, screen: usize) -> Vec<String> {
        let shown = &self.evaluation.best[..self.evaluation.best.len().min(MAX_ROWS)];
        let known: Vec<[String; 7]> = shown.iter().map(|best| self.row(best)).collect();
        let header = HEADER.map(str::to_owned);
        let is_sentence = |row: &[String; 7], at: usize| at == SCORE && row[SCORE + 1].is_empty();
        let width = |at: usize| {
            let cells = std::iter::once(&header).chain(&known).filter(|row| !is_sentence(row, at));
            cells.map(|row| row[at].chars().count()).max().unwrap_or(0)
        };
        let widths: [usize; 7] = std::array::from_fn(width);
        // The category has a line of its own.
        let line = |row: &[String; 7]| {
            let cell = |at: usize, width: usize| match NUMBERS.contains(&at) {
                true => format!("{:>width$}", row[at]),
                false => format!("{:<width$}", row[at]),
            };
            let cells = match is_sentence(row, SCORE) {
                // A sentence in place of an answer extends over the empty columns after it.
                true => vec![cell(1, widths[1]), cell(2, widths[2]), cell(3, widths[3..6].iter().sum::<usize>() + 4)],
                false => (1..6).map(|at| cell(at, widths[at])).collect(),
            };
            format!("{}  {}", cells.join("  "), cell(6, widths[6])).trim_end().to_owned()
        };
        let mut lines = vec![line(&header)];
        for of in shown.chunk_by(|a, b| a.category == b.category) {
            let mut names: Vec<String> = Vec::new();
            for score in of.iter().filter_map(|best| best.score.as_ref()) {
                let name = variant_name(of[0].category, &score.variant);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            names.sort();
            let dash = if names.is_empty() { "" } else { " - " };
            lines.push(wrap(&format!("{}{dash}{}", of[0].category.label(), names.join("; ")), screen));
            lines.extend(of.iter().map(|best| line(&self.row(best))));
        }
        if lines.iter().flat_map(|text| text.lines()).any(|line| line.chars().count() > screen) {
            lines = known.iter().map(|row| list_of(row, screen)).collect();
        }
        let more = self.evaluation.best.len().saturating_sub(MAX_ROWS);
        if more > 0 {
            lines.push(format!("… and {} more: results.csv", count(more)));
        }
        lines
    }

    fn row(&self, best: &Best) -> [String; 7] {
        let min_scenarios = u64::from(self.evaluation.scores.options.min_failures.max(1));
        let needed = match best.data_for_decision {
            None => "not with this data".to_owned(),
            Some(1.0) => "-".to_owned(),
            // Rounded up.
            Some(times) if times >= 9.95 => format!("{:.0}x", times.ceil()),
            Some(times) => format!("{:.1}x", (10.0 * times).ceil() / 10.0),
        };
        let [category, model] = [best.category.label(), best.model.name()].map(str::to_owned);
        let Some(score) = &best.score else {
            let scenarios = best.failing_scenarios;
            let text = match scenarios {
                0 => "S never collides: nothing to compare".to_owned(),
                1 => format!("too few: 1 colliding scenario, {min_scenarios} needed"),
                _ => format!("too few: {} colliding scenarios, {min_scenarios} needed", count(scenarios)),
            };
            return [category, model, "-".to_owned(), text, String::new(), String::new(), needed];
        };
        let interval = format!("{:.2} [{:.2} {:.2}]", score.f1, score.interval.low, score.interval.high);
        let missed = format!("{}, {} of {}", count(score.missed), count(score.invented), count(best.failures));
        let ties = if score.rivals.is_empty() { "-".to_owned() } else { list(&score.rivals) };
        [category, model, short_name(&score.variant).to_owned(), interval, missed, ties, needed]
    }
}

/// The names, as many as fit.
fn list(names: &[String]) -> String {
    let text = names.iter().map(|name| short_name(name)).collect::<Vec<_>>().join(", ");
    if text.chars().count() <= LIST { text } else { format!("{} others", names.len()) }
}
