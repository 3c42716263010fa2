//! `--format`: what a verb prints, for people or for programs.

use clap::{Args, ValueEnum};

use super::console;
use crate::Result;
use crate::support::readable::count;

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
    pub fn is_json(self) -> bool {
        self.format == Format::Json
    }

    /// Prints one or the other; what is not asked for is not made.
    pub fn print(self, text: impl FnOnce() -> String, json: impl FnOnce() -> Result<String>) -> Result<()> {
        match self.format {
            Format::Text => console::print(&text()),
            Format::Json => console::print_json(&json()?),
        }
    }

    /// Says what `--plan-only` left.
    pub fn print_plan(self, lanes: u64, path: &std::path::Path) -> Result<()> {
        let text = || format!("{} lanes planned in {}\n", count(lanes), path.display());
        self.print(text, || {
            crate::report::records::document(&serde_json::json!({"lanes": lanes, "plan": path.display().to_string()}))
        })
    }
}
