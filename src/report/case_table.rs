//! A table of concrete cases against the regulation: a row per case with its answer, as text, as JSON and as a table file.

use std::collections::BTreeMap;
use std::iter::once;
use std::path::Path;

use super::case_sentences::{drives_through, past_the_cap, touching};
use super::case_sheet::{CaseSheet, verdict_of};
use super::lanes::{outcome_cells, outcome_columns};
use super::records::{self, PROGRAM, record};
use super::tables::wrap;
use lanesweep_engine::Trace;
use lanesweep_model::driver::ModelId;
use lanesweep_run::check::{Answer, CaseVerdicts, Demand, Judged, Judgement, RunEnd, Verdict};
use lanesweep_support::readable::counted;
use lanesweep_support::table::{Cell, Column, ColumnKind, Table, TableMetadata, TableOf};
use lanesweep_support::{Result, option};

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

/// What the columns show, of judged and of nominal answers.
const LEGENDS: [&str; 2] = [
    "Verdict: as on the sheet of one case. Demanded: whether the profile's clause of cut-ins demands that the system avoids the \
     collision. None: there is nothing to avoid.",
    "Nominal answers: the lanes of every case as given, in lane arithmetic. No measurement error, no shorter time step and no \
     clause was examined: no answer is robust by this table, and that of a sheet can be undecided. None: there is nothing to avoid.",
];

/// One case of a table.
pub struct CaseAnswer {
    /// Row, from 1 after the header.
    pub row: usize,
    /// Its key, if the table has keys.
    pub id: Option<String>,
    case: String,
    verdict: Verdict,
    answer: String,
    demand: Vec<String>,
    demanded: &'static str,
    /// Each model with its collision verdict.
    collisions: Vec<(&'static str, &'static str)>,
    /// The only reference driver that avoids the collision.
    rests_on: &'static str,
    /// No vehicle drives through another one.
    is_traffic: bool,
    note: String,
    /// How the lane of each model ended; empty for nominal answers.
    numbers: Vec<(Column, Cell<'static>)>,
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
            rests_on: rests_on(judgement.verdict(), &judgement.verdicts),
            is_traffic: judgement.drives_through_s.is_none(),
            note: once(note(judgement))
                .chain(sheet.silent())
                .chain(drives_through(judgement.drives_through_s))
                .filter(|text| !text.is_empty())
                .collect::<Vec<_>>()
                .join(". "),
            numbers: judgement.models.iter().flat_map(numbers).collect(),
        }
    }

    /// The computed answer of a row, without perturbations and clauses.
    pub fn nominal(
        (row, id): (usize, Option<String>),
        verdicts: &CaseVerdicts,
        models: &[ModelId],
        drives_through_s: Option<f64>,
    ) -> CaseAnswer {
        let collision = |model: ModelId| match (verdicts.collides(model), verdicts.unreacting) {
            (true, _) => "COLLIDES",
            (false, RunEnd::Contact) => "avoids",
            (false, RunEnd::Open) => "open",
            (false, RunEnd::Clear) => "none",
        };
        CaseAnswer {
            row,
            id,
            case: String::new(),
            verdict: verdicts.verdict(),
            answer: String::new(),
            demand: Vec::new(),
            demanded: "",
            collisions: models.iter().map(|model| (model.name(), collision(*model))).collect(),
            rests_on: rests_on(verdicts.verdict(), verdicts),
            is_traffic: drives_through_s.is_none(),
            note: drives_through(drives_through_s).unwrap_or_default(),
            numbers: Vec::new(),
        }
    }
}

/// The columns of `simulate`, with the model's name before, and the time of braking.
fn numbers(judged: &Judged) -> Vec<(Column, Cell<'static>)> {
    let Trace { outcome, dt_s, model, .. } = &judged.trace;
    let braking = Column::new("braking_s", ColumnKind::Binary64, "s", "When the driver first braked; null if never.");
    let cells = outcome_cells(outcome, *dt_s).into_iter().chain([Cell::number(judged.braking_s())]);
    let named = |column: Column| Column { name: format!("{}_{}", model.name(), column.name).into(), ..column };
    outcome_columns(ColumnKind::Binary64).chain([braking]).map(named).zip(cells).collect()
}

fn rests_on(verdict: Verdict, verdicts: &CaseVerdicts) -> &'static str {
    match (verdict, &verdicts.avoided_by()[..]) {
        (Verdict::Answer(Answer::Preventable), [one]) if verdicts.reference_drivers.len() > 1 => one.name(),
        _ => "",
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
            let text = |of: &Judged| format!("{} changes with {}", of.trace.model.name(), of.flips.join(", "));
            of_drivers.map(text).collect::<Vec<_>>().join("; ")
        }
    }
}

/// The answers of a whole table, under one profile.
pub struct CaseAnswers {
    /// The file, as the user named it.
    pub origin: String,
    /// Name of the profile.
    pub profile: String,
    /// At least one case, in the order of the file.
    pub cases: Vec<CaseAnswer>,
    /// Why the other rows could not be judged, with file, line and column.
    pub broken: Vec<String>,
    /// The answers are those of lanes: no perturbation, clause or boundary was examined.
    pub is_nominal: bool,
}

/// Maximum number of rows in the text; the table file has all.
const MAX_ROWS: usize = 200;

impl CaseAnswers {
    /// The worst verdict.
    pub fn worst(&self) -> Verdict {
        let has = |verdict: &Verdict| self.cases.iter().any(|case| case.verdict == *verdict);
        WORST_FIRST.into_iter().find(has).unwrap_or(Verdict::Answer(Answer::NoConflict))
    }

    /// Cases with an answer, of those with possible traffic or of the others.
    fn count(&self, verdict: Verdict, is_traffic: bool) -> usize {
        self.cases.iter().filter(|case| case.verdict == verdict && case.is_traffic == is_traffic).count()
    }

    /// How many cases have which answer.
    fn counts(&self, is_traffic: bool) -> String {
        let counts = WORST_FIRST.map(|verdict| (verdict, self.count(verdict, is_traffic)));
        let some = counts.iter().filter(|(_, count)| *count > 0);
        some.map(|(verdict, count)| format!("{count} {}", verdict.label())).collect::<Vec<_>>().join(", ")
    }

    fn not_traffic(&self) -> usize {
        self.cases.iter().filter(|case| !case.is_traffic).count()
    }

    /// The cases without possible traffic; empty if there are none.
    fn no_traffic(&self) -> String {
        match self.not_traffic() {
            0 => String::new(),
            count => format!(
                "No such traffic in {count} of {}: the vehicle that cuts out drives through the one ahead of it. Above they \
                 are not counted ({}).",
                counted(self.cases.len(), "case"),
                self.counts(false)
            ),
        }
    }

    fn summary(&self) -> String {
        let counts = self.counts(true);
        let broken = match self.broken.len() {
            0 => String::new(),
            count => format!("; {} cannot be judged", counted(count, "row")),
        };
        let cases = counted(self.cases.len() - self.not_traffic(), "case");
        let possible = if self.not_traffic() > 0 { " of possible traffic" } else { "" };
        format!("{cases}{possible} under {}: {counts}{broken}", self.profile)
    }

    /// How many preventable cases only one reference driver avoids; empty if none.
    fn rests_on(&self) -> String {
        let count = |name: &str| self.cases.iter().filter(|case| case.rests_on == name && case.is_traffic).count();
        let counts = ModelId::ALL.map(|model| (model.name(), count(model.name())));
        let alone: Vec<String> =
            counts.iter().filter(|(_, count)| *count > 0).map(|(name, count)| format!("{count} ({name})")).collect();
        if alone.is_empty() {
            return String::new();
        }
        let all = self.count(Verdict::Answer(Answer::Preventable), true);
        format!("Of {} called preventable, one driver alone decides in {}.", counted(all, "case"), alone.join(", "))
    }

    /// The rows to be shown: all in the order of the file, or the worst of many.
    fn shown(&self) -> Vec<&CaseAnswer> {
        if self.cases.len() <= MAX_ROWS {
            return self.cases.iter().collect();
        }
        let of = |verdict: Verdict| self.cases.iter().filter(move |case| case.verdict == verdict);
        WORST_FIRST.into_iter().flat_map(of).take(MAX_ROWS).collect()
    }

    fn left_out(&self) -> String {
        match self.cases.len().saturating_sub(MAX_ROWS) {
            0 => String::new(),
            left => format!("The worst {MAX_ROWS} rows; {left} more are in the table of {}.", option("rows")),
        }
    }

    fn columns<'c>(&'c self, cases: Vec<&'c CaseAnswer>) -> TableOf<&'c CaseAnswer> {
        let models = self.cases.first().map_or(0, |case| case.collisions.len());
        let mut table = Table::of(cases).column("row", |case| case.row);
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

    /// All columns of all rows.
    pub fn all(&self) -> Table {
        let mut table = self.columns(self.cases.iter().collect());
        if !self.is_nominal {
            table = table
                .column("case", |case| case.case.as_str())
                .column("answer", |case| case.answer.as_str())
                .column("demand", |case| case.demand.join(". "));
        }
        let mut table = table.column("rests_on", |case| case.rests_on).build();
        table.columns.extend(self.cases[0].numbers.iter().map(|(column, _)| column.clone()));
        for (row, case) in table.rows.iter_mut().zip(&self.cases) {
            row.extend(case.numbers.iter().map(|(_, cell)| cell.clone()));
        }
        table
    }

    /// Writes the rows as a table: CSV, JSON Lines or Parquet, by the ending of the name.
    ///
    /// # Errors
    /// [`Error::Io`](lanesweep_support::Error::Io), and for an unknown ending.
    pub fn save(&self, path: &Path) -> Result<()> {
        let metadata =
            TableMetadata { table: "cases", profile: Some(self.profile.clone()), ..TableMetadata::default() };
        self.all().save(path, &metadata)
    }

    /// The table as text.
    pub fn text(&self, width: usize) -> String {
        let legend = LEGENDS[usize::from(self.is_nominal)].to_owned();
        let notes = [self.no_traffic(), legend, self.left_out(), self.rests_on()];
        let notes: Vec<String> = notes.into_iter().filter(|note| !note.is_empty()).collect();
        let rows = self.columns(self.shown()).build().text();
        format!("{}\n{rows}{}\n", self.summary(), wrap(&notes.join(" "), width))
    }

    /// The table as one document.
    ///
    /// # Errors
    /// None for a table of this program.
    pub fn json(&self) -> Result<String> {
        let counts = |is_traffic| BTreeMap::from(WORST_FIRST.map(|of| (of.label(), self.count(of, is_traffic))));
        records::document(&record! {
            cannot_be_judged: &self.broken,
            cases: self.all().records(),
            counts: counts(true),
            data: &self.origin,
            no_such_traffic: counts(false),
            nominal: self.is_nominal,
            profile: &self.profile,
            program: PROGRAM,
            verdict: self.worst().label(),
        })
    }
}
