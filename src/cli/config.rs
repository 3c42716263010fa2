//! `lanesweep config`: the configuration file, its schema, its check, and the effective values; shell completions and manual
//! pages from the command definition.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use clap_complete::Shell;
use serde_json::json;

use super::configured::{Configured, command};
use super::{Exit, Output, console};
use crate::settings::{DEFAULT_FILE, DEFAULT_FILE_NAME, Layers, Setting, profile_schema, settings_schema, text_of};
use lanesweep_model::profile::Profile;
use lanesweep_report::records::document;
use lanesweep_support::files::{make_folder, write_atomically, write_inside};
use lanesweep_support::plain_text::{nearest, quoted_word};
use lanesweep_support::{Error, Place, Result};

/// Configurations, completions for your shell, manual pages
///
/// Every option has a default. A file (--config FILE), --config KEY=VALUE and the option's own flag (--backend) override
/// it; the last of these that sets an option wins. Only a named file is read.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  lanesweep config init\n  lanesweep config show --config lanesweep.toml\n  lanesweep \
                        study --config lanesweep.toml --config mining.leader_max_thw_s=2.5"
)]
pub(super) struct Config {
    #[command(subcommand)]
    verb: ConfigVerb,
}

#[derive(Debug, Subcommand)]
enum ConfigVerb {
    /// Write the commented default configuration: every key with its default, unit, range and source; or a shipped profile
    #[command(after_help = "Examples:\n  lanesweep config init\n  lanesweep config init un-r157.toml")]
    Init {
        /// File to write; `-` prints it; under the name of a shipped profile it is that profile
        #[arg(value_name = "FILE", default_value = DEFAULT_FILE_NAME, help_heading = "Data")]
        file: PathBuf,
    },
    /// Show every effective value and its source
    ///
    /// After all layers: defaults, file, flags. With --format toml it prints a file that sets the same, for another machine
    /// or an appendix.
    #[command(after_help = "Example:\n  lanesweep config show --config mining.leader_max_thw_s=2.5 --backend cpu")]
    Show {
        /// How to print
        #[arg(long, value_enum, default_value_t, help_heading = "Output")]
        format: ShowFormat,
        /// Only values that differ from the default
        #[arg(long, help_heading = "Output")]
        changed: bool,
    },
    /// Check a configuration file: every key known, every value of its type and in its range
    #[command(after_help = "Example:\n  lanesweep config check lanesweep.toml")]
    Check {
        /// The file
        #[arg(value_name = "FILE", help_heading = "Data")]
        file: PathBuf,
    },
    /// Print the JSON Schema of a configuration file or a profile, for editors
    #[command(after_help = "Example:\n  lanesweep config schema > lanesweep.schema.json")]
    Schema {
        /// Kind of file
        #[arg(value_enum, default_value_t, help_heading = "Data")]
        of: SchemaOf,
    },
    /// Print the completions for a shell
    ///
    /// Where a shell looks for them differs: bash reads files in ~/.local/share/bash-completion/completions, fish in
    /// ~/.config/fish/completions, zsh in a folder of its $fpath (there the file is called _lanesweep).
    #[command(after_help = "Example:\n  lanesweep config completions bash")]
    Completions {
        /// The shell
        #[arg(value_name = "SHELL", help_heading = "Data")]
        shell: Shell,
    },
    /// Write the manual pages into a folder
    ///
    /// One page for the program and one per verb: lanesweep.1, lanesweep-study.1, lanesweep-merge.1, …
    #[command(after_help = "Example:\n  lanesweep config man man1")]
    Man {
        /// Folder of the pages
        #[arg(value_name = "DIR", help_heading = "Data")]
        dir: PathBuf,
    },
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum ShowFormat {
    /// A table
    #[default]
    Text,
    /// An array of objects: key, value, source, default
    Json,
    /// A configuration file
    Toml,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum SchemaOf {
    /// A configuration file (--config)
    #[default]
    Config,
    /// A profile (--profile)
    Profile,
}

impl Config {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        match &self.verb {
            ConfigVerb::Init { file } => init(file),
            ConfigVerb::Show { format, changed } => show(*format, *changed, configured),
            ConfigVerb::Check { file } => check(file),
            ConfigVerb::Schema { of: SchemaOf::Config } => console::answer(&format!("{:#}\n", settings_schema())),
            ConfigVerb::Schema { of: SchemaOf::Profile } => console::answer(&format!("{:#}\n", profile_schema()?)),
            ConfigVerb::Completions { shell } => completions(*shell),
            ConfigVerb::Man { dir } => man(dir),
        }
    }
}

fn init(path: &Path) -> Result<Output> {
    if path == Path::new("-") {
        return console::answer(DEFAULT_FILE);
    }
    if path.exists() {
        let help = "choose another name, or move it away; `lanesweep config init -` prints the file";
        return Err(Error::usage(Place::file(path), "it exists already and is not overwritten", help));
    }
    let is_profile = |name: &str| path.file_stem().is_some_and(|stem| stem == name);
    let profile = Profile::names().zip(Profile::files()).find(|(name, _)| is_profile(name));
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    if let Some(near) = nearest(&stem, Profile::names(), 0.85).filter(|_| profile.is_none()) {
        let help =
            format!("did you mean `{near}.toml`, a copy of that profile? Else choose a name that is not like it");
        return Err(Error::usage(Place::file(path), "this is not the name of a profile", help));
    }
    let (flag, text) = profile.map_or(("config", DEFAULT_FILE), |(_, text)| ("profile", text));
    write_atomically(path, text.as_bytes())?;
    let file = path.display().to_string();
    console::answer(&format!("{file} written; use it with --{flag} {}\n", quoted_word(&file)))
}

fn show(format: ShowFormat, is_changed: bool, configured: &Configured) -> Result<Output> {
    // Only the profile can check its own time step.
    configured.profile()?;
    configured.backend()?;
    let shown: Vec<&Setting> = match is_changed {
        true => configured.layers.given().collect(),
        false => configured.layers.0.iter().collect(),
    };
    console::answer(&match format {
        ShowFormat::Text => table(&shown),
        ShowFormat::Json => json_list(&shown)?,
        ShowFormat::Toml => toml_file(&shown),
    })
}

fn check(path: &Path) -> Result<Output> {
    let mut layers = Layers::defaults();
    layers.read_file(path)?;
    layers.settings()?;
    let count = layers.given().count();
    console::answer(&format!("{}: {count} keys set, all of them known and in range\n", path.display()))
}

fn value(setting: &Setting) -> String {
    setting.value.as_ref().map_or("-".to_owned(), text_of)
}

fn table(shown: &[&Setting]) -> String {
    let width = |of: &dyn Fn(&&Setting) -> usize| shown.iter().map(of).max().unwrap_or(0);
    let keys = width(&|setting| setting.key.name.len());
    let values = width(&|setting| value(setting).len());
    let line =
        |setting: &&Setting| format!("{:keys$}  {:values$}  {}\n", setting.key.name, value(setting), setting.origin);
    shown.iter().map(line).collect()
}

fn json_list(shown: &[&Setting]) -> Result<String> {
    let object = |setting: &&Setting| {
        json!({
            "key": setting.key.name,
            "value": setting.value,
            "source": setting.origin.to_string(),
            "default": setting.key.default,
        })
    };
    document(&shown.iter().map(object).collect::<Vec<_>>())
}

fn toml_file(shown: &[&Setting]) -> String {
    let (mut text, mut table) = (String::new(), "");
    for setting in shown {
        let (of, name) = setting.key.name.rsplit_once('.').unwrap_or(("", &setting.key.name));
        let Some(value) = &setting.value else { continue };
        if of != table {
            let gap = if text.is_empty() { "" } else { "\n" };
            text += &format!("{gap}[{of}]\n");
            table = of;
        }
        text += &format!("{name} = {}\n", text_of(value));
    }
    text
}

fn completions(shell: Shell) -> Result<Output> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut command(), "lanesweep", &mut text);
    let text = String::from_utf8(text).map_err(|e| Error::Internal(format!("completions are no text: {e}")))?;
    console::answer(&text)
}

/// Collects a command and its visible subcommands, by the names of their pages.
fn collect(name: String, command: &clap::Command, pages: &mut Vec<(String, clap::Command)>) {
    pages.push((name.clone(), command.clone()));
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set() && verb.get_name() != "help") {
        collect(format!("{name}-{}", verb.get_name()), verb, pages);
    }
}

fn man(dir: &Path) -> Result<Output> {
    make_folder(dir)?;
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
        write_inside(&dir.join(format!("{name}.1")), |file| file.write_all(&page))?;
    }
    tracing::info!("{written} pages written to {}", dir.display());
    Ok(Exit::Ok.into())
}
