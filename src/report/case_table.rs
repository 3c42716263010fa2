//! A table of concrete cases against the regulation: a row per case with its answer, as text and as JSON.

use std::iter::once;

use serde_json::json;

use super::case_sentences::{drives_through, past_the_cap, touching};
use super::case_sheet::{CaseSheet, verdict_of};
use super::records::{self, PROGRAM};
use super::tables::wrap;
use crate::Result;
use crate::run::check::{Answer, Demand, Judgement, Verdict};
use crate::support::readable::counted;
use crate::support::table::{Column, Table, TableOf};

/// All verdicts, the worst first: those without a driver of Annex 3 that avoids the collision, then those with one, then
/// those without a collision.
const WORST_FIRST: [Verdict; 6] = [
    Verdict::Answer(Answer::NotPreventable),
    Verdict::Undecided,
    Verdict::OutsideAnnex,
    Verdict::NotJudged,
    Verdict::Answer(Answer::Preventable),
    Verdict::Answer(Answer::NoConflict),
];

/// One case of a table.
pub struct CaseAnswer {
    /// Row, from 1 after the header.
    row: usize,
    /// Its key, if the table has keys.
    id: Option<String>,
    case: String,
    verdict: Verdict,
    answer: String,
    demand: Vec<String>,
    demanded: &'static str,
    /// Each model with its collision verdict.
    collisions: Vec<(&'static str, &'static str)>,
    note: String,
}

impl CaseAnswer {
    /// The answer of a row from its sheet.
    pub fn new(row: usize, id: Option<String>, sheet: &CaseSheet<'_>) -> CaseAnswer {
        let judgement = sheet.first();
        let models = judgement.models.iter();
        CaseAnswer {
            row,
            id,
            case: sheet.case(),
            verdict: judgement.verdict(),
            answer: sheet.answer(),
            demand: sheet.demand(),
            demanded: match (judgement.demand(), &judgement.demand_flips[..]) {
                (None, _) => "",
                (Some(Demand::Avoid), []) => "yes",
                (Some(Demand::Nothing), []) => "no",
                (Some(Demand::Unknown), []) => "unknown",
                (Some(_), _) => "undecided",
            },
            collisions: models.map(|judged| (judged.trace.model.name(), verdict_of(judgement, judged))).collect(),
            note: once(note(judgement))
                .chain(sheet.silent())
                .chain(drives_through(judgement))
                .filter(|text| !text.is_empty())
                .collect::<Vec<_>>()
                .join(". "),
        }
    }

    /// Its key.
    pub fn id(&self) -> Option<&str> {
        self.id.as_deref()
    }
}

/// What the answer rests on, if a small change or the annex decides.
fn note(judgement: &Judgement) -> String {
    match (judgement.verdict(), &judgement.outside_annex) {
        (Verdict::Undecided, _) if judgement.verdicts.answer() == Answer::Open => past_the_cap(judgement),
        (Verdict::Undecided, _) if !judgement.flips.is_empty() => {
            format!("changes with {}", judgement.flips.join(", "))
        }
        (Verdict::Undecided, _) => touching(judgement).unwrap_or_default(),
        (Verdict::OutsideAnnex, Some(reason)) => reason.clone(),
        _ => {
            let of_drivers = judgement.models.iter().filter(|judged| !judged.flips.is_empty());
            let text = of_drivers
                .map(|judged| format!("{} changes with {}", judged.trace.model.name(), judged.flips.join(", ")));
            text.collect::<Vec<_>>().join("; ")
        }
    }
}

/// The answers of a whole table, under one profile.
pub struct CaseTable {
    /// The file, as the user named it.
    pub origin: String,
    /// Name of the profile.
    pub profile: String,
    /// At least one case, in the order of the file.
    pub cases: Vec<CaseAnswer>,
    /// Why the other rows could not be judged, with file, line and column.
    pub broken: Vec<String>,
}

impl CaseTable {
    /// The worst verdict.
    pub fn worst(&self) -> Verdict {
        let has = |verdict: &Verdict| self.cases.iter().any(|case| case.verdict == *verdict);
        WORST_FIRST.into_iter().find(has).unwrap_or(Verdict::Answer(Answer::NoConflict))
    }

    fn count(&self, verdict: Verdict) -> usize {
        self.cases.iter().filter(|case| case.verdict == verdict).count()
    }

    /// How many cases have which answer.
    fn summary(&self) -> String {
        let counts = WORST_FIRST.iter().map(|verdict| (verdict, self.count(*verdict))).filter(|(_, count)| *count > 0);
        let counts: Vec<String> = counts.map(|(verdict, count)| format!("{count} {}", verdict.label())).collect();
        let broken = match self.broken.len() {
            0 => String::new(),
            count => format!("; {} cannot be judged", counted(count, "row")),
        };
        format!("{} under {}: {}{broken}", counted(self.cases.len(), "case"), self.profile, counts.join(", "))
    }

    fn columns(&self) -> TableOf<&CaseAnswer> {
        let models = self.cases.first().map_or(0, |case| case.collisions.len());
        let mut table = Table::of(&self.cases).column("row", |case| case.row);
        if self.cases.iter().any(|case| case.id.is_some()) {
            table = table.column("id", |case| case.id.clone());
        }
        table = table.column("verdict", |case| case.verdict.label());
        if self.cases.iter().any(|case| !case.demanded.is_empty()) {
            table = table.column(Column::from("demanded").null("–"), |case| case.demanded);
        }
        let name = |at: usize| self.cases[0].collisions[at].0;
        let collision = |case: &CaseAnswer, at: usize| case.collisions[at].1;
        table.columns(0..models, name, collision).column("note", |case| case.note.as_str())
    }

    /// The table as text.
    pub fn text(&self, width: usize) -> String {
        let legend = "Verdict: as on the sheet of one case. Demanded: whether the profile's clause of cut-ins demands that \
                      the system avoids the collision. None: there is nothing to avoid.";
        format!("{}\n{}{}\n", self.summary(), self.columns().build().text(), wrap(legend, width))
    }

    /// The table as one document.
    ///
    /// # Errors
    /// None for a table of this program.
    pub fn json(&self) -> Result<String> {
        let cases = self
            .columns()
            .column("case", |case| case.case.as_str())
            .column("answer", |case| case.answer.as_str())
            .column("demand", |case| case.demand.join(". "));
        let counts = WORST_FIRST.map(|verdict| (verdict.label().to_owned(), json!(self.count(verdict))));
        records::document(&json!({
            "program": PROGRAM,
            "data": self.origin,
            "profile": self.profile,
            "verdict": self.worst().label(),
            "counts": serde_json::Map::from_iter(counts),
            "cases": cases.build().records(),
            "cannot_be_judged": self.broken,
        }))
    }
}
