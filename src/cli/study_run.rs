//! The end of a study: its report is written, and the answer printed.

use clap::Args;

use super::format::FormatFlag;
use super::{Exit, console};
use crate::Result;
use crate::report::study::StudyReport;
use crate::report::tables;
use crate::support::run_dir::Results;

/// The flag of every verb that ends in a study's report.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct TablesFlag {
    /// Print all tables instead of the answer; they are in report.txt too
    #[arg(long)]
    pub tables: bool,
}

impl TablesFlag {
    /// Writes the files and prints the answer, or all tables.
    pub fn finish(
        self,
        mut report: StudyReport,
        results: Results,
        is_incomplete: bool,
        format: FormatFlag,
    ) -> Result<Exit> {
        let out = results.dir().to_path_buf();
        report.write(results)?;
        let width = console::width();
        let claims = if report.claims.is_empty() { "" } else { ", claims" };
        let rest = format!("TTC, BTN, every interval{claims}: --tables, or report.html and report.txt.");
        let answer = || format!("{}{}\n", report.answer(width), tables::wrap(&rest, width));
        format.print(|| if self.tables { report.text(width) } else { answer() }, || report.json())?;
        let page = out.join("report.html");
        tracing::info!("{} files written; start with {}", report.run.files.len() + 1, page.display());
        Ok(if is_incomplete { Exit::Incomplete } else { Exit::Ok })
    }
}
