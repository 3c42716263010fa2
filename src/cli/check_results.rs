//! `check --results`: another simulator's results for a table of cases.

use std::collections::HashMap;
use std::path::Path;

use super::case_flags::all_cases;
use super::check::write;
use super::check_table::CheckedTable;
use super::configured::Configured;
use super::console;
use super::format::FormatFlag;
use super::{Exit, Output};
use crate::report::result_comparison::{ResultReport, columns};
use crate::run::check::{COMPARED, ResultComparison, Subject, TheirResult};
use crate::support::files::make_folder_of;
use crate::support::input_file;
use crate::support::plausibility::Doubts;
use crate::support::table::{Row, TableFormat, TableMetadata, TableReader};
use crate::{Error, Place, Result};

impl CheckedTable<'_> {
    /// Compares every case that has a result of another simulator in the table `theirs`.
    pub(super) fn compare(&self, theirs: &Path, configured: &Configured, format: FormatFlag) -> Result<Output> {
        let [model] = self.models else {
            let problem = "results are those of one driver";
            return Err(Error::usage(Place::item("--results"), problem, "name it: --models CCHDM"));
        };
        let mut doubts = Doubts::new(self.implausible);
        let mut subjects: Vec<(String, Subject)> = Vec::new();
        for given in all_cases(self.path)? {
            let given = self.case.over(given);
            let subject = given.located(given.subject(self.profile, &mut doubts))?;
            let id = given.id.ok_or_else(|| {
                let help = "add a column `id`, which the results repeat";
                Error::input(Place::file(self.path), "a case has no id", help)
            })?;
            subjects.push((id, subject));
        }
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        let (given, results) = results(theirs)?;
        let mut by_id: HashMap<&str, &Subject> = subjects.iter().map(|(id, of)| (id.as_str(), of)).collect();
        let pairs = results.iter().map(|(place, their)| {
            let unknown = || {
                let problem =
                    format!("`{}` is the id of no case of {}, or of two results", their.id, self.path.display());
                Error::input(place.clone().column("id"), problem, "give one result per case, with the case's id")
            };
            Ok((by_id.remove(their.id.as_str()).ok_or_else(unknown)?, their))
        });
        let pairs: Vec<(&Subject, &TheirResult)> = pairs.collect::<Result<_>>()?;
        let comparison = ResultComparison::new(&pairs, given, self.profile, *model)?;
        let report = ResultReport {
            comparison: &comparison,
            profile: self.profile,
            origin: self.path.display().to_string(),
            theirs: theirs.display().to_string(),
            theirs_sha256: input_file::sha256(theirs)?,
            missing: by_id.len(),
            command: &configured.command,
            identity: &self.identity,
        };
        if let Some(path) = self.page {
            write(path, report.html().as_bytes())?;
        }
        if let Some(path) = self.rows {
            make_folder_of(path)?;
            report.rows().save(path, &TableMetadata { table: "results", ..TableMetadata::default() })?;
        }
        let exit = match (comparison.is_equal(), by_id.is_empty()) {
            (false, _) => Exit::VerificationFailed,
            (true, false) => Exit::Incomplete,
            (true, true) => Exit::Ok,
        };
        format.output(exit, || report.text(console::width()), || report.json())
    }
}

/// Which quantities a table of results has, and its rows with their places.
type Results = ([bool; COMPARED.len()], Vec<(Place, TheirResult)>);

/// Reads another simulator's results.
fn results(path: &Path) -> Result<Results> {
    let format = TableFormat::of(path, &[TableFormat::Csv, TableFormat::Parquet], "--results")?;
    let mut table = TableReader::open(path, format)?;
    let help = || format!("the columns are id, collision (true or false) and, where known, {}", columns());
    let known: Vec<&str> = ["id", "collision"].into_iter().chain(COMPARED.iter().map(|of| of.column)).collect();
    let at = |name: &&str| table.columns().iter().position(|column| column == name);
    let found: Vec<Option<usize>> = known.iter().map(at).collect();
    if let Some(missing) = known.iter().zip(&found).take(2).find(|(_, at)| at.is_none()) {
        return Err(Error::input(table.header().column(*missing.0), "it is missing", help()));
    }
    if let Some(unknown) = table.columns().iter().find(|column| !known.contains(&column.as_str())) {
        return Err(Error::input(table.header().column(unknown), "there is no such column", help()));
    }
    let wanted: Vec<usize> = found.iter().copied().flatten().collect();
    table.rows.want(&wanted)?;
    let mut all = Vec::new();
    while let Some(Row { number, values }) = table.rows.next_row()? {
        let mut values = values.into_iter();
        let mut fields = found.iter().map(|at| at.and_then(|_| values.next()).unwrap_or_default());
        let mut field = || fields.next().unwrap_or_default();
        let wrong = |column: &str, problem: String, help: &str| {
            Error::input(table.place(number, None).column(column), problem, help)
        };
        let id = match field() {
            serde_json::Value::String(text) => text,
            serde_json::Value::Null => return Err(wrong("id", "it is empty".to_owned(), "give the id of a case")),
            number => number.to_string(),
        };
        let collides = match field() {
            serde_json::Value::Bool(is_so) => is_so,
            other => {
                match other.as_str().map(str::to_ascii_lowercase).or_else(|| other.as_i64().map(|n| n.to_string())) {
                    Some(text) if ["true", "1", "yes"].contains(&text.as_str()) => true,
                    Some(text) if ["false", "0", "no"].contains(&text.as_str()) => false,
                    _ => {
                        return Err(wrong(
                            "collision",
                            format!("{other} is neither true nor false"),
                            "write true or false",
                        ));
                    }
                }
            }
        };
        let mut theirs = TheirResult { id, collides, ..TheirResult::default() };
        for (value, of) in theirs.values.iter_mut().zip(&COMPARED) {
            *value = match field() {
                serde_json::Value::Null => None,
                serde_json::Value::String(text) if text.trim().is_empty() => None,
                other => {
                    let number = other.as_f64().or_else(|| other.as_str()?.trim().parse().ok());
                    let number = number.ok_or_else(|| {
                        wrong(of.column, format!("{other} is not a number"), "give a number, or leave it empty")
                    })?;
                    let infinite =
                        || wrong(of.column, format!("{number} is not finite"), "leave it empty if it is unknown");
                    Some(number.is_finite().then_some(number).ok_or_else(infinite)?)
                }
            };
        }
        all.push((table.place(number, None), theirs));
    }
    if all.is_empty() {
        return Err(Error::input(Place::file(path), "it has no rows", help()));
    }
    Ok((std::array::from_fn(|quantity| found[quantity + 2].is_some()), all))
}
