//! A whole table of `lanesweep check`: every row judged, or only its lanes run.

use std::path::Path;

use rayon::prelude::*;

use super::case_flags::{GivenCase, GivenCases};
use super::check::Check;
use super::configured::Configured;
use super::console;
use super::signals::CANCEL;
use super::source::complain_of;
use super::{Exit, Output};
use lanesweep_engine::Executor;
use lanesweep_model::driver::ModelId;
use lanesweep_model::plausibility::Doubts;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::COLUMNS_HELP;
use lanesweep_report::case_evidence::CaseIdentity;
use lanesweep_report::case_sheet::CaseSheet;
use lanesweep_report::case_table::{CaseAnswer, CaseAnswers};
use lanesweep_run::check::{self, Subject, nominal_verdicts};
use lanesweep_support::files::make_folder_of;
use lanesweep_support::input_file::unchanged;
use lanesweep_support::{Error, Place, Result};

/// Rows that are judged together, and rows whose lanes are planned together.
const ROWS: [usize; 2] = [256, 1 << 16];

/// A table, and what is to be made of it.
pub(super) struct CheckedTable<'a> {
    /// The verb's flags; those of the case override values of the table.
    pub check: &'a Check,
    pub path: &'a Path,
    pub profile: &'a Profile,
    pub models: &'a [ModelId],
}

/// A row with its case, or why it has none.
type Row = (usize, Result<(Subject, GivenCase)>);

impl CheckedTable<'_> {
    /// Judges every row.
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let mut table = GivenCases::open(self.path)?;
        let (mut doubts, is_nominal) = (Doubts::new(self.check.plausibility.policy()), self.check.nominal);
        let opened = is_nominal.then(|| configured.open()).transpose()?;
        let (mut cases, mut broken, mut is_end) = (Vec::new(), Vec::new(), false);
        configured.with_bar(None, "judging", |bar| {
            while !is_end {
                let mut rows: Vec<Row> = Vec::new();
                while rows.len() < ROWS[usize::from(is_nominal)] && !is_end {
                    let Some(given) = table.next()? else {
                        is_end = true;
                        continue;
                    };
                    let subject = given.and_then(|given| {
                        let given = self.check.case.over(given);
                        Ok((given.subject(self.profile, &mut doubts)?, given))
                    });
                    rows.push((table.row(), subject));
                }
                bar.inc(rows.len() as u64);
                let answers = match &opened {
                    Some(opened) => self.nominal(rows, &opened.executor())?,
                    None => self.judged(rows),
                };
                // In the order of the rows.
                for answer in answers {
                    answer.map_or_else(|error| broken.push(error), |answer| cases.push(answer));
                }
                CANCEL.check()?;
            }
            Ok(())
        })?;
        unchanged(self.path)?;
        cases.retain(|case: &CaseAnswer| {
            let before = broken.len();
            broken.extend(case.id.as_deref().and_then(|id| table.refused_later(id)));
            broken.len() == before
        });
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        complain_of(&broken, &table.notes());
        if cases.is_empty() {
            let problem = if table.row() == 0 { "it has no rows" } else { "no row of it can be judged" };
            return Err(Error::input(Place::file(self.path), problem, COLUMNS_HELP));
        }
        let broken: Vec<String> = broken.iter().map(ToString::to_string).collect();
        let is_complete = broken.is_empty();
        let answers = CaseAnswers {
            origin: self.path.display().to_string(),
            profile: self.profile.name.clone(),
            cases,
            broken,
            is_nominal,
        };
        if let Some(path) = &self.check.rows {
            make_folder_of(path)?;
            answers.save(path)?;
        }
        let exit = if is_complete { Exit::from(answers.worst()) } else { Exit::Incomplete };
        let output = self.check.format.output(exit, || answers.text(console::width()), || answers.json())?;
        Ok(output.with_tables(|| vec![("cases".to_owned(), answers.all())]))
    }

    /// Runs the lanes of some rows.
    fn nominal(&self, rows: Vec<Row>, executor: &Executor) -> Result<Vec<Result<CaseAnswer>>> {
        let subjects = rows.iter().filter_map(|(_, row)| row.as_ref().ok().map(|(subject, _)| subject.clone()));
        let subjects: Vec<Subject> = subjects.collect();
        let mut verdicts = nominal_verdicts(&subjects, self.profile, executor)?.into_iter();
        let answers = rows.into_iter().map(|(row, of)| {
            let (subject, given) = of?;
            let missing = || Err(Error::Internal("a case has no verdict".to_owned()));
            let verdicts = given.located(verdicts.next().unwrap_or_else(missing))?;
            let drives_through_s = subject.drives_through_s(self.profile)?;
            Ok(CaseAnswer::nominal((row, given.id), &verdicts, self.models, drives_through_s))
        });
        Ok(answers.collect())
    }

    /// Judges some rows.
    fn judged(&self, rows: Vec<Row>) -> Vec<Result<CaseAnswer>> {
        let answers = rows.into_par_iter().map(|(row, of)| {
            let (subject, given) = of?;
            given.located(self.judge(row, given.id.clone(), subject))
        });
        answers.collect()
    }

    fn judge(&self, row: usize, id: Option<String>, subject: Subject) -> Result<CaseAnswer> {
        let check = check::Check { subject, profiles: vec![self.profile.clone()], models: self.models.to_vec() };
        let judgements = check.run_without_boundaries()?;
        let sheet = CaseSheet {
            subject: &check.subject,
            origin: format!("{}, row {row}", self.path.display()),
            is_synthetic: false,
            doubts: &[],
            profiles: &check.profiles,
            judgements: &judgements,
            command: String::new(),
            identity: CaseIdentity::default(),
        };
        Ok(CaseAnswer::new(row, id, &sheet))
    }
}
