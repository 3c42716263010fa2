//! `lanesweep config completions` and `lanesweep config man`: shell completions and manual pages from the command
//! definition.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

use super::configured::command;
use super::{Exit, Output, console};
use lanesweep_support::files::{make_folder, write_inside};
use lanesweep_support::{Error, Result};

/// Print the completions for a shell
///
/// Where a shell looks for them differs: bash reads files in ~/.local/share/bash-completion/completions, fish in
/// ~/.config/fish/completions, zsh in a folder of its $fpath (there the file is called _lanesweep).
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep config completions bash")]
pub(super) struct Completions {
    /// The shell
    #[arg(value_name = "SHELL", help_heading = "Data")]
    shell: Shell,
}

impl Completions {
    pub(super) fn run(&self) -> Result<Output> {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut command(), "lanesweep", &mut text);
        let text = String::from_utf8(text).map_err(|e| Error::Internal(format!("completions are no text: {e}")))?;
        console::answer(&text)
    }
}

/// Collects a command and its visible subcommands, by the names of their pages.
fn collect(name: String, command: &clap::Command, pages: &mut Vec<(String, clap::Command)>) {
    pages.push((name.clone(), command.clone()));
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set() && verb.get_name() != "help") {
        collect(format!("{name}-{}", verb.get_name()), verb, pages);
    }
}

/// Write the manual pages into a folder
///
/// One page for the program and one per verb: lanesweep.1, lanesweep-study.1, lanesweep-merge.1, …
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep config man man1")]
pub(super) struct Man {
    /// Folder of the pages
    #[arg(value_name = "DIR", help_heading = "Data")]
    dir: PathBuf,
}

impl Man {
    pub(super) fn run(&self) -> Result<Output> {
        make_folder(&self.dir)?;
        // A page has the values of every flag; help shows those of some as the value's name.
        let with_values = |verb: clap::Command| verb.mut_args(|arg| arg.hide_possible_values(false));
        let mut program = with_values(command()).mut_subcommands(|verb| with_values(verb).mut_subcommands(with_values));
        // Adds global flags and versions to the verbs.
        program.build();
        let mut pages = Vec::new();
        collect("lanesweep".to_owned(), &program, &mut pages);
        let written = pages.len();
        for (name, command) in pages {
            let mut page = Vec::new();
            let unwritten = |e: std::io::Error| Error::Internal(format!("a manual page cannot be made: {e}"));
            clap_mangen::Man::new(command).render(&mut page).map_err(unwritten)?;
            write_inside(&self.dir.join(format!("{name}.1")), |file| file.write_all(&page))?;
        }
        tracing::info!("{written} pages written to {}", self.dir.display());
        Ok(Exit::Ok.into())
    }
}
