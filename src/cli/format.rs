//! `--format`: output for people or for programs.

use clap::{Args, ValueEnum};

use super::{Exit, Output, console};
use lanesweep_report::host::Host;
use lanesweep_report::records::document;
use lanesweep_report::sampling::SampleReport;
use lanesweep_report::study::StudyReport;
use lanesweep_run::sampling::{Sample, SampleResult};
use lanesweep_support::Result;
use lanesweep_support::readable::count;
use lanesweep_support::run_folder::Results;

/// What is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Text for people.
    Text,
    /// One JSON document.
    Json,
}

/// `--format`.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct FormatFlag {
    /// Output on stdout
    ///
    /// text: for people; json: the record of the run, or one document with the same numbers.
    #[arg(long, value_name = "text|json", value_enum, hide_possible_values = true, default_value_t = Format::Text, help_heading = "Output")]
    pub format: Format,
}

impl FormatFlag {
    pub(super) fn is_json(self) -> bool {
        self.format == Format::Json
    }

    /// Prints text or document, whichever is asked for and alone is built; returns both to a program that calls the verb
    /// as a function.
    pub(super) fn output(
        self,
        exit: Exit,
        text: impl FnOnce() -> String,
        json: impl FnOnce() -> Result<String>,
    ) -> Result<Output> {
        if console::is_captured() {
            return Ok(Output { text: text(), document: json()?, ..exit.into() });
        }
        match self.format {
            Format::Text => console::print(&text())?,
            Format::Json => console::print_json(&json()?)?,
        }
        Ok(exit.into())
    }

    /// Writes the files of a study and prints its answer.
    pub(super) fn study(
        self,
        report: &StudyReport,
        results: Results,
        (is_incomplete, is_plain): (bool, bool),
    ) -> Result<Output> {
        let page = results.dir().join("report.html");
        let files = report.write(results, is_plain)?;
        let width = console::width();
        let answer = || report.answer(width);
        let exit = if is_incomplete { Exit::Incomplete } else { Exit::Ok };
        let printed = self.output(exit, answer, || report.json(&files))?;
        tracing::info!("{} files written; start with {}", files.files.len() + 1, page.display());
        Ok(printed.with_tables(|| files.tables))
    }

    /// Writes the files of a sampling run and prints its answer.
    pub(super) fn sample(self, sample: &Sample, result: &SampleResult, host: Host, results: Results) -> Result<Output> {
        let out = results.dir().to_path_buf();
        let report = SampleReport { sample, result, host };
        let files = report.write(results)?;
        let output = self.output(Exit::Ok, || report.text(), || report.json(&files))?;
        tracing::info!("results written to {}", out.display());
        Ok(output.with_tables(|| files.tables))
    }

    /// The answer about a plan that `--plan-only` wrote.
    pub(super) fn planned(self, exit: Exit, lanes: u64, path: &std::path::Path) -> Result<Output> {
        let text = || format!("{} runs planned in {}\n", count(lanes), path.display());
        let record = serde_json::json!({"lanes": lanes, "plan": path.display().to_string()});
        self.output(exit, text, || document(&record))
    }
}
