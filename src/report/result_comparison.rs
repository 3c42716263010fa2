//! Results of another simulator beside a driver's lanes: agreement, and what differs first.

use serde_json::json;

use super::case_identity::CaseIdentity;
use super::html::{Page, Section};
use super::records::{self, PROGRAM};
use super::tables::wrap;
use crate::Result;
use crate::model::profile::Profile;
use crate::run::check::{COMPARED, ComparedCase, ResultComparison};
use crate::support::readable::{counted, significant, value};
use crate::support::table::{Column, Digits, Table, json_number};

/// A comparison with what its readers need to know.
pub struct ResultReport<'a> {
    /// The comparison.
    pub comparison: &'a ResultComparison,
    /// Profile.
    pub profile: &'a Profile,
    /// The file of the cases, as the user named it.
    pub origin: String,
    /// The file of the results, as the user named it.
    pub theirs: String,
    /// Its SHA-256.
    pub theirs_sha256: String,
    /// Cases without a result.
    pub missing: usize,
    /// Command that reproduces the comparison.
    pub command: &'a str,
    /// What identifies it.
    pub identity: &'a CaseIdentity,
}

/// Maximum number of cases listed; the table of option `rows` has all.
const MAX_ROWS: usize = 200;
const LEGEND: &str = "Differences are theirs minus ours. Up to the tolerance they count as none. Decides: the first quantity, \
                      in the order of cause and effect, that differs by more, or that only they have. Only ours: cases in which their field is \
                      empty, which is taken as unknown.";

impl ResultReport<'_> {
    /// How many cases agree, with an interval.
    fn agreement(&self) -> String {
        let (of, interval) = (self.comparison, self.comparison.agreement());
        let missing = if self.missing > 0 {
            format!("; {} have no result", counted(self.missing, "case"))
        } else {
            String::new()
        };
        format!(
            "{} and {} under {} agree in {} of {} on the collision ({} to {} % at 95 %, if the cases are a random \
             sample){missing}.",
            self.theirs,
            of.model.name(),
            self.profile.name,
            of.agreeing(),
            counted(of.cases.len(), "case"),
            significant(100.0 * interval.low, 3),
            significant(100.0 * interval.high, 3)
        )
    }

    /// The cause that most differences have in common.
    fn cause(&self) -> String {
        if self.comparison.differences.is_empty() {
            return "The results have no other quantity: a driver that reacts late would not be found by the collisions of most \
                    cases. Give times and gaps."
                .to_owned();
        }
        let Some(cause) = self.comparison.cause() else {
            let some = self.comparison.differences.iter().filter(|of| of.beyond > 0);
            let some = some.map(|of| format!("{} in {} of {}", COMPARED[of.quantity].column, of.beyond, of.cases));
            let some: Vec<String> = some.collect();
            return match some.is_empty() {
                true => "No quantity differs beyond its tolerance in any case.".to_owned(),
                false => format!(
                    "No quantity differs beyond its tolerance in most cases, but in some: {} cases. See which these are.",
                    some.join(", ")
                ),
            };
        };
        let compared = &COMPARED[cause.quantity];
        let range = cause.range.unwrap_or_default();
        let [min, median, max] = range.map(|by| significant(by.abs(), 3));
        let direction = match (compared.unit, range[1] > 0.0) {
            ("s", true) => "later",
            ("s", false) => "earlier",
            (_, true) => "larger",
            (_, false) => "smaller",
        };
        let range = if min == max { String::new() } else { format!("; from {min} to {max} {}", compared.unit) };
        format!(
            "The first cause: {} is {median} {} {direction} there (median of {}{range}).",
            compared.words,
            compared.unit,
            counted(cause.cases, "case"),
        )
    }

    fn differences(&self) -> Table {
        Table::of(&self.comparison.differences)
            .column("quantity", |of| COMPARED[of.quantity].column)
            .column("cases", |of| of.cases)
            .column("beyond", |of| of.beyond)
            .column("only ours", |of| of.only[0])
            .column("only theirs", |of| of.only[1])
            .column("tolerance", |of| COMPARED[of.quantity].tolerance)
            .column(Column::from("min").digits(Digits::Signed(3)).null("–"), |of| of.range.map(|range| range[0]))
            .column(Column::from("median").digits(Digits::Signed(3)).null("–"), |of| of.range.map(|range| range[1]))
            .column(Column::from("max").digits(Digits::Signed(3)).null("–"), |of| of.range.map(|range| range[2]))
            .build()
    }

    /// All cases as a table.
    pub fn rows(&self) -> Table {
        rows(self.comparison.cases.iter())
    }

    /// The cases that differ, those with another answer first; `None` if there are none.
    fn differing(&self) -> Option<Table> {
        let is_other = |case: &&ComparedCase| case.collides[0] != case.collides[1];
        let cases = &self.comparison.cases;
        let beyond = cases.iter().filter(|case| !is_other(case) && case.decides.is_some());
        let mut differing = cases.iter().filter(is_other).chain(beyond).take(MAX_ROWS).peekable();
        differing.peek()?;
        Some(rows(differing))
    }

    /// The comparison as text.
    pub fn text(&self, width: usize) -> String {
        let differing = self
            .differing()
            .map_or(String::new(), |rows| format!("\nCases that differ, at most {MAX_ROWS}\n{}", rows.text()));
        format!(
            "{}\n{}{differing}{}\n",
            wrap(&format!("{} {}", self.agreement(), self.cause()), width),
            self.differences().text(),
            wrap(LEGEND, width)
        )
    }

    /// The comparison as a page.
    pub fn html(&self) -> String {
        let model = self.comparison.model.name();
        let others = self.differing().map(|rows| {
            rows.captioned(format!("Cases that differ, those with another answer first, at most {MAX_ROWS}"))
        });
        Page {
            title: format!("{} beside {model} under {}", self.theirs, self.profile.name),
            lead: format!("{} {}", self.agreement(), self.cause()),
            sections: vec![
                Section::new("differences", "Differences")
                    .intro(LEGEND)
                    .tables([self.differences().captioned("Theirs minus ours")])
                    .tables(others),
                self.identity
                    .section(&self.origin, self.profile, self.command)
                    .fact("results", format!("{}\nSHA-256 {}", self.theirs, self.theirs_sha256)),
                self.identity.signatures(),
            ],
            ..Page::default()
        }
        .html()
    }

    /// The comparison as one document.
    ///
    /// # Errors
    /// None for a comparison of this program.
    pub fn json(&self) -> Result<String> {
        let (of, interval) = (self.comparison, self.comparison.agreement());
        records::document(&json!({
            "program": PROGRAM,
            "profile": self.profile.name,
            "model": of.model.name(),
            "results": self.theirs,
            "cases": of.cases.len(),
            "without_result": self.missing,
            "agreeing": of.agreeing(),
            "agreement": {"low": json_number(interval.low), "high": json_number(interval.high), "level": interval.level},
            "agreement_sentence": self.agreement(),
            "cause": self.comparison.cause().map(|cause| COMPARED[cause.quantity].column),
            "cause_sentence": self.cause(),
            "differences": self.differences().records(),
            "rows": self.rows().records(),
        }))
    }
}

fn rows<'c>(cases: impl Iterator<Item = &'c ComparedCase>) -> Table {
    let word = |collides: bool| if collides { "COLLIDES" } else { "none" };
    Table::of(cases)
        .column("id", |case| case.id.as_str())
        .column("here", |case| word(case.collides[0]))
        .column("there", |case| word(case.collides[1]))
        .column(Column::from("decides").null("–"), |case| case.decides.map(|at| COMPARED[at].column))
        .columns(
            COMPARED.iter().enumerate(),
            |(_, of)| Column::from(of.column).null("–"),
            |case, (at, _)| case.differences[at].map(|by| (by * 1e6).round() / 1e6),
        )
        .build()
}

/// The columns that a table of results may have, in words.
pub fn columns() -> String {
    let all: Vec<String> =
        COMPARED.iter().map(|of| format!("{} (tolerance {} {})", of.column, value(of.tolerance), of.unit)).collect();
    all.join(", ")
}
