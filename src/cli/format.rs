//! `--format` and `--tables`: output for people or for programs.

use clap::{Args, ValueEnum};

use super::arguments::{Arguments, FromArguments, from_arguments};
use super::{Exit, Output, console};
use crate::report::study::StudyReport;
use crate::report::tables;
use crate::support::readable::count;
use crate::support::run_folder::Results;
use crate::{Error, Place, Result};

/// How tables are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Tables for people.
    Text,
    /// One JSON document.
    Json,
    /// Both, for a program that calls a verb as a function.
    #[value(skip)]
    Both,
}

/// The flag of every verb that prints tables.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct FormatFlag {
    /// Output on stdout
    ///
    /// text: tables; json: one document with the same numbers.
    #[arg(long, value_name = "text|json", value_enum, hide_possible_values = true, default_value_t = Format::Text, help_heading = "Output")]
    pub format: Format,
}

impl FormatFlag {
    pub(super) fn is_json(self) -> bool {
        self.format == Format::Json
    }

    /// Prints text or document, whichever is asked for and alone is built; returns both to a program that asks for both.
    pub(super) fn output(
        self,
        exit: Exit,
        text: impl FnOnce() -> String,
        json: impl FnOnce() -> Result<String>,
    ) -> Result<Output> {
        match self.format {
            Format::Text => console::print(&text())?,
            Format::Json => console::print_json(&json()?)?,
            Format::Both => return Ok(Output { exit, text: text(), document: json()? }),
        }
        Ok(exit.into())
    }

    /// Like [`FormatFlag::output`], for results in a folder, which it names.
    pub(super) fn output_in(
        self,
        out: &std::path::Path,
        exit: Exit,
        text: impl FnOnce() -> String,
        json: impl FnOnce() -> Result<String>,
    ) -> Result<Output> {
        let output = self.output(exit, text, json)?;
        tracing::info!("results written to {}", out.display());
        Ok(output)
    }

    /// The answer about a plan that `--plan-only` wrote.
    pub(super) fn planned(self, exit: Exit, lanes: u64, path: &std::path::Path) -> Result<Output> {
        let text = || format!("{} lanes planned in {}\n", count(lanes), path.display());
        self.output(exit, text, || {
            crate::report::records::document(&serde_json::json!({"lanes": lanes, "plan": path.display().to_string()}))
        })
    }
}

impl FromArguments for FormatFlag {
    fn from_arguments(_: &mut Arguments) -> Result<FormatFlag> {
        Ok(FormatFlag { format: Format::Both })
    }
}

/// The flag of every verb that ends in a study's report.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct TablesFlag {
    /// Print all tables instead of the answer; they are in report.txt too
    #[arg(long, help_heading = "Output")]
    pub tables: bool,
}

from_arguments!(TablesFlag { tables });

impl TablesFlag {
    /// Refuses the flag where it would have no effect.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(super) fn check(self, format: FormatFlag) -> Result<()> {
        match self.tables && format.is_json() {
            true => {
                let problem = "--format json prints one document, which has the numbers of all tables";
                Err(Error::usage(Place::item("--tables"), problem, "leave out one of the two"))
            }
            false => Ok(()),
        }
    }

    /// Writes the files and prints the answer, or all tables.
    pub(super) fn finish(
        self,
        report: StudyReport,
        results: Results,
        is_incomplete: bool,
        format: FormatFlag,
    ) -> Result<Output> {
        let out = results.dir().to_path_buf();
        let files = report.write(results)?;
        let width = console::width();
        let claims = if report.evaluation.claims.is_empty() { "" } else { ", claims" };
        let all = if format.format == Format::Both { "" } else { "--tables, or " };
        let rest = format!("TTC, BTN, every interval{claims}: {all}report.html and report.txt.");
        let answer = || format!("{}{}\n", report.answer(width), tables::wrap(&rest, width));
        let exit = if is_incomplete { Exit::Incomplete } else { Exit::Ok };
        let shown = || if self.tables { report.text(width) } else { answer() };
        let printed = format.output(exit, shown, || report.json())?;
        let page = out.join("report.html");
        tracing::info!("{} files written; start with {}", files.files.len() + 1, page.display());
        Ok(printed)
    }
}
