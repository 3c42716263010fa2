//! `--format` and `--tables`: output for people or for programs.

use clap::{Args, ValueEnum};

use super::{Exit, console};
use crate::report::study::StudyReport;
use crate::report::tables;
use crate::support::readable::count;
use crate::support::run_dir::Results;
use crate::{Error, Place, Result};

/// How tables are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Tables for people.
    Text,
    /// One JSON document.
    Json,
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

    /// Prints one of the two; only that one is built.
    pub(super) fn print(self, text: impl FnOnce() -> String, json: impl FnOnce() -> Result<String>) -> Result<()> {
        if console::captured().is_none() {
            return match self.format {
                Format::Text => console::print(&text()),
                Format::Json => console::print_json(&json()?),
            };
        }
        // The owner of what is captured gets both.
        let document = json()?;
        if self.is_json() {
            console::print_json(&document)?
        } else {
            console::print(&text())?
        }
        console::captured().iter_mut().for_each(|captured| captured.document.clone_from(&document));
        Ok(())
    }

    /// Like [`FormatFlag::print`], for results in a folder.
    pub(super) fn print_results(
        self,
        text: impl FnOnce() -> String,
        json: impl FnOnce() -> Result<String>,
        out: &std::path::Path,
    ) -> Result<()> {
        self.print(text, json)?;
        tracing::info!("results written to {}", out.display());
        Ok(())
    }

    /// Reports the plan that `--plan-only` wrote.
    pub(super) fn print_plan(self, lanes: u64, path: &std::path::Path) -> Result<()> {
        let text = || format!("{} lanes planned in {}\n", count(lanes), path.display());
        self.print(text, || {
            crate::report::records::document(&serde_json::json!({"lanes": lanes, "plan": path.display().to_string()}))
        })
    }
}

/// The flag of every verb that ends in a study's report.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct TablesFlag {
    /// Print all tables instead of the answer; they are in report.txt too
    #[arg(long, help_heading = "Output")]
    pub tables: bool,
}

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
        mut report: StudyReport,
        results: Results,
        is_incomplete: bool,
        format: FormatFlag,
    ) -> Result<Exit> {
        let out = results.dir().to_path_buf();
        report.write(results)?;
        let width = console::width();
        let claims = if report.evaluation.claims.is_empty() { "" } else { ", claims" };
        let rest = format!("TTC, BTN, every interval{claims}: --tables, or report.html and report.txt.");
        let answer = || format!("{}{}\n", report.answer(width), tables::wrap(&rest, width));
        format.print(|| if self.tables { report.text(width) } else { answer() }, || report.json())?;
        let page = out.join("report.html");
        tracing::info!("{} files written; start with {}", report.run.files.len() + 1, page.display());
        Ok(if is_incomplete { Exit::Incomplete } else { Exit::Ok })
    }
}
