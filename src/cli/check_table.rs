//! A whole table of `lanesweep check`: every row judged, or only its lanes run.

use std::path::Path;

use rayon::prelude::*;

use super::case_flags::{CaseFlags, CaseTable, GivenCase};
use super::check::{status, write};
use super::configured::Configured;
use super::console::{self, Total};
use super::format::FormatFlag;
use super::signals::CANCEL;
use super::source::complain_of;
use super::{Exit, Output};
use crate::engine::Executor;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::case_identity::CaseIdentity;
use crate::report::case_sheet::CaseSheet;
use crate::report::case_table::{CaseAnswer, CaseTable as Answers};
use crate::run::check::{Check, Subject, nominal_verdicts};
use crate::support::files::make_folder_of;
use crate::support::plausibility::{Doubts, Implausible};
use crate::support::run_folder::RunFolder;
use crate::{Error, Place, Result};

/// Rows that are judged together, and rows whose lanes are planned together.
const ROWS: [usize; 2] = [256, 1 << 16];

/// A table, and what is to be made of it.
pub(super) struct CheckedTable<'a> {
    pub path: &'a Path,
    pub profile: &'a Profile,
    pub models: &'a [ModelId],
    /// Values that override those of the table.
    pub case: &'a CaseFlags,
    pub implausible: Implausible,
    /// Only the answers of lanes.
    pub is_nominal: bool,
    pub page: Option<&'a Path>,
    pub rows: Option<&'a Path>,
    /// Folder of a sheet per row.
    pub sheets: Option<&'a Path>,
    /// What identifies page and sheets besides their cases.
    pub identity: CaseIdentity,
}

/// A row with its case, or why it has none.
type Row = (usize, Result<(Subject, GivenCase)>);

impl CheckedTable<'_> {
    /// Judges every row.
    pub(super) fn run(&self, configured: &Configured, format: FormatFlag) -> Result<Output> {
        let mut table = CaseTable::open(self.path)?;
        let mut doubts = Doubts::new(self.implausible);
        let opened = self.is_nominal.then(|| configured.open()).transpose()?;
        let folder = self.sheets.map(RunFolder::open_without_record).transpose()?;
        let mut sheets = folder.as_ref().map(RunFolder::results).transpose()?;
        let (mut cases, mut broken, mut is_end) = (Vec::new(), Vec::new(), false);
        configured.with_bar(Total::AtMost(u64::MAX), "judging", |bar| {
            while !is_end {
                let mut rows: Vec<Row> = Vec::new();
                while rows.len() < ROWS[usize::from(self.is_nominal)] && !is_end {
                    let Some(given) = table.next()? else {
                        is_end = true;
                        continue;
                    };
                    let subject = given.and_then(|given| {
                        let given = self.case.over(given);
                        Ok((given.subject(self.profile, &mut doubts)?, given))
                    });
                    rows.push((table.row(), subject));
                }
                bar.inc(rows.len() as u64);
                let answers = match &opened {
                    Some(opened) => self.nominal(rows, &opened.executor())?,
                    None => self.judged(rows, configured),
                };
                // In the order of the rows.
                for answer in answers {
                    match answer {
                        Ok((answer, sheet)) => {
                            if let (Some(sheet), Some(sheets)) = (sheet, &mut sheets) {
                                sheets.add(&format!("row-{}.html", answer.row), sheet.as_bytes())?;
                            }
                            cases.push(answer);
                        }
                        Err(error) => broken.push(error),
                    }
                }
                CANCEL.check()?;
            }
            Ok(())
        })?;
        cases.retain(|case: &CaseAnswer| {
            let refused = case.id().and_then(|id| table.refused_later(id));
            let is_used = refused.is_none();
            broken.extend(refused);
            is_used
        });
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        complain_of(&broken, &[]);
        if cases.is_empty() {
            let help = "the chapter on tables lists the columns (docs/src/tables.md)";
            let problem = if table.row() == 0 { "it has no rows" } else { "no row of it can be judged" };
            return Err(Error::input(Place::file(self.path), problem, help));
        }
        let broken: Vec<String> = broken.iter().map(ToString::to_string).collect();
        let is_complete = broken.is_empty();
        let answers = Answers {
            origin: self.path.display().to_string(),
            profile: self.profile.clone(),
            cases,
            broken,
            is_nominal: self.is_nominal,
            command: configured.command.clone(),
            identity: self.identity.clone(),
        };
        if let Some(path) = self.rows {
            make_folder_of(path)?;
            answers.save(path)?;
        }
        if let Some(path) = self.page {
            write(path, answers.html().as_bytes())?;
        }
        sheets.map_or(Ok(()), |sheets| sheets.publish_each())?;
        let exit = if is_complete { status(answers.worst()) } else { Exit::Incomplete };
        format.output(exit, || answers.text(console::width()), || answers.json())
    }

    /// Runs the lanes of some rows.
    fn nominal(&self, rows: Vec<Row>, executor: &Executor) -> Result<Vec<Result<Answered>>> {
        let subjects = rows.iter().filter_map(|(_, row)| row.as_ref().ok().map(|(subject, _)| subject.clone()));
        let subjects: Vec<Subject> = subjects.collect();
        let mut verdicts = nominal_verdicts(&subjects, self.profile, executor)?.into_iter();
        let answers = rows.into_iter().map(|(row, of)| {
            let (_, given) = of?;
            let missing = || Err(Error::Internal("a case has no verdict".to_owned()));
            let verdicts = given.located(verdicts.next().unwrap_or_else(missing))?;
            Ok((CaseAnswer::nominal(row, given.id, &verdicts, self.models), None))
        });
        Ok(answers.collect())
    }

    /// Judges some rows, with a sheet of each if sheets are wanted.
    fn judged(&self, rows: Vec<Row>, configured: &Configured) -> Vec<Result<Answered>> {
        let answers = rows.into_par_iter().map(|(row, of)| {
            let (subject, given) = of?;
            given.located(self.judge(row, given.id.clone(), subject, &configured.command))
        });
        answers.collect()
    }

    fn judge(&self, row: usize, id: Option<String>, subject: Subject, command: &str) -> Result<Answered> {
        let check = Check { subject, profiles: vec![self.profile.clone()], models: self.models.to_vec() };
        let has_sheet = self.sheets.is_some();
        let judgements = if has_sheet { check.run()? } else { check.run_without_boundaries()? };
        let sheet = CaseSheet {
            subject: &check.subject,
            origin: format!("{}, row {row}", self.path.display()),
            is_synthetic: false,
            doubts: &[],
            profiles: &check.profiles,
            judgements: &judgements,
            uncertainty: None,
            injury: &[],
            command: command.to_owned(),
            identity: self.identity.clone(),
        };
        Ok((CaseAnswer::new(row, id, &sheet), has_sheet.then(|| sheet.html())))
    }
}

/// The answer of a row, and its sheet.
type Answered = (CaseAnswer, Option<String>);
