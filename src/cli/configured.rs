//! From the command line to a configuration: which flag sets which key. Verbs read the values of these flags from the
//! settings. `--backend` and `--device` determine the opened backend.

use std::time::Instant;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command, CommandFactory, FromArgMatches};
use indicatif::ProgressBar;
use tracing::Level;

use super::console;
use super::help::RUN;
use super::signals::CANCEL;
use super::{Cli, Verb};
use crate::settings::{FILE_VARIABLE, Key, KeyFlag, KeyKind, Layers, Origin, Setting, Settings, keys_in_order};
use lanesweep_engine::{BackendChoice, Executor, OpenBackend};
use lanesweep_model::profile::Profile;
use lanesweep_report::host::SettingRecord;
use lanesweep_support::{Error, Place, Result, option};

/// The configuration of a run, and what every verb needs besides.
#[derive(Debug, Clone)]
pub(super) struct Configured {
    /// Values.
    pub settings: Settings,
    /// Values with their sources.
    pub layers: Layers,
    /// The command line or call, for repeating the run.
    pub command: String,
    /// What stderr shows.
    pub level: Level,
    /// Start of the verb.
    pub started: Instant,
}

/// Tables and keys that determine a plan's lanes; a plan file already contains them.
const OF_THE_PLAN: [&str; 9] = [
    "generator.",
    "mining.",
    "parameterization.",
    "score.",
    "sample.",
    "study.folds",
    "study.reference",
    "run.profile",
    "run.dt_s",
];

/// The command line, with `--config` for every verb and the flags that set keys.
pub(super) fn command() -> Command {
    super::help::laid_out(with_flags(with_config(Cli::command()), &keys_in_order()))
}

/// The flags of a verb that set keys.
fn flags_of<'a>(keys: &'a [Key], verb: &'a str) -> impl Iterator<Item = (&'a Key, &'a KeyFlag)> {
    let flags = keys.iter().filter_map(|key| Some((key, key.flag.as_ref()?)));
    flags.filter(move |(_, flag)| flag.verbs.iter().any(|of| of == verb))
}

/// Adds the flags that set keys.
fn with_flags(mut command: Command, keys: &[Key]) -> Command {
    command = command.mut_subcommands(|verb| with_flags(verb, keys));
    let has = |id: &str| command.get_arguments().any(|arg| arg.get_id() == id);
    let has_plan = has("plan");
    let data: Vec<&str> = ["recordings", "scenarios", "paths"].into_iter().filter(|id| has(id)).collect();
    let verb = command.get_name().to_owned();
    for (key, KeyFlag { name, heading, value, .. }) in flags_of(keys, &verb) {
        let mut arg = flag(key, name, value).help_heading(heading.clone());
        // What is global is told with the verbs.
        arg = arg.global(verb == "lanesweep").hide_short_help(verb == "lanesweep");
        if has_plan && is_of_plan(&key.name) {
            arg = arg.conflicts_with("plan");
        }
        if key.name == "generator.recordings" {
            arg = arg.conflicts_with_all(&data);
        }
        command = command.arg(arg);
    }
    command
}

/// Builds the flag of a key. The first sentence of the description is the short help; `Without it: X.` is the default
/// if there is no default value.
fn flag(key: &Key, id: &str, value_name: &str) -> Arg {
    let (text, unset) = match key.description.split_once(" Without it: ") {
        Some((text, unset)) => (text, format!(" [default: {}]", unset.trim_end_matches('.'))),
        None => (&*key.description, String::new()),
    };
    let (short, more) = text.split_once(". ").unwrap_or((text, ""));
    // The unit is the name of the value.
    let short = format!("{}{unset}", short.trim_end_matches('.').trim_end_matches(", s"));
    let mut arg = Arg::new(id.to_owned()).long(id.replace('_', "-")).help(short.clone());
    if !more.is_empty() {
        arg = arg.long_help(format!("{short}\n\n{more}"));
    }
    if let Some(default) = &key.default {
        arg = arg.default_value(word(default));
    }
    match &key.kind {
        KeyKind::Choice(choices) => {
            let words: Vec<&str> = choices.iter().map(|choice| &*choice.word).collect();
            let values = choices.iter().map(|choice| {
                let value = PossibleValue::new(choice.word.clone());
                if choice.description.is_empty() { value } else { value.help(choice.description.clone()) }
            });
            arg.value_name(words.join("|"))
                .value_parser(PossibleValuesParser::new(values))
                .hide_possible_values(true)
                .ignore_case(true)
        }
        KeyKind::Number(range) => {
            let unit = if key.name.ends_with("_s") { "s" } else { "FRACTION" };
            arg.value_name(if range.is_whole { "N" } else { unit }).allow_negative_numbers(true)
        }
        KeyKind::Boolean | KeyKind::Text => arg.value_name(value_name.to_owned()),
    }
}

/// A value in the syntax of a flag.
fn word(value: &serde_json::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

fn is_of_plan(key: &str) -> bool {
    key != "sample.failures_limit" && OF_THE_PLAN.iter().any(|part| key.starts_with(part))
}

/// Adds `--config` at each level separately: clap drops a global flag's values before the verb if it also occurs after
/// the verb.
fn with_config(command: Command) -> Command {
    let help = "Configuration file, or one key of it; repeatable";
    let more = "`lanesweep config init` writes such a file. Without --config, LANESWEEP_CONFIG names it.";
    let arg =
        Arg::new("config").long("config").value_name("FILE|KEY=VALUE").action(ArgAction::Append).help_heading(RUN);
    command.mut_subcommands(with_config).arg(arg.help(help).long_help(format!("{help}\n\n{more}")))
}

/// Loads a profile and warns about constants that are not in use.
///
/// # Errors
/// As [`Profile::load`].
pub(super) fn load_profile(name: &str) -> Result<Profile> {
    let profile = Profile::load(name)?;
    profile.unusual().iter().for_each(|note| tracing::warn!("{note}"));
    Ok(profile)
}

/// The verb and its subverb, the values of `--config` before and after them, and the matches of the last one.
fn verb_of(matches: &ArgMatches) -> (Vec<&str>, Vec<&str>, &ArgMatches) {
    let (mut path, mut typed, mut last) = (Vec::new(), Vec::new(), matches);
    loop {
        typed.extend(last.get_many::<String>("config").into_iter().flatten().map(String::as_str));
        let Some((name, inner)) = last.subcommand() else { return (path, typed, last) };
        path.push(name);
        last = inner;
    }
}

impl Configured {
    /// Combines the layers, and parses the rest of the command line.
    ///
    /// # Errors
    /// As [`Layers::read`] and [`Layers::flag`].
    pub(super) fn of(matches: &ArgMatches, command: String) -> Result<(Cli, Configured)> {
        let unread = |e: clap::Error| Error::Internal(format!("the command line cannot be read: {e}"));
        let mut cli = Cli::from_arg_matches(matches).map_err(unread)?;
        let (path, typed, last) = verb_of(matches);
        let reads_none = matches!(path[..], ["config", "init" | "schema" | "check" | "completions" | "man"]);
        let mut layers = if reads_none { Layers::defaults() } else { Layers::read(&typed)? };
        let verb = path.last().unwrap_or(&"");
        let keys = Key::all();
        for (key, KeyFlag { name, .. }) in flags_of(&keys, "lanesweep").chain(flags_of(&keys, verb)) {
            if last.value_source(name) == Some(ValueSource::CommandLine)
                && let Some(word) = last.get_raw(name).and_then(|mut words| words.next())
            {
                layers.flag(&key.name, &option(name), &word.to_string_lossy())?;
            }
        }
        let (mut settings, level) = (layers.settings()?, cli.common.level());
        let layer = |key: &str| layers.get(key).map_or(0, |setting| setting.origin.layer());
        // A backend without devices overrides a device of an earlier source.
        if settings.run.backend == BackendChoice::Cpu && layer("run.backend") > layer("run.device") {
            settings.run.device = None;
        }
        if let Verb::Sample(sample) = &mut cli.verb {
            sample.settings = settings.sample.clone();
        }
        Ok((cli, Configured { settings, layers, command, level, started: Instant::now() }))
    }

    /// The profile with its time step.
    ///
    /// # Errors
    /// As [`Profile::load`] and [`Profile::with_dt`].
    pub(super) fn profile(&self) -> Result<Profile> {
        self.profile_of(&self.settings.run.profile).map_err(|error| self.at_origin("run.profile", "profile", error))
    }

    /// The same for a profile of another name.
    ///
    /// # Errors
    /// As [`Configured::profile`].
    pub(super) fn profile_of(&self, name: &str) -> Result<Profile> {
        let profile = load_profile(name)?;
        let Some(dt_s) = self.settings.run.dt_s else { return Ok(profile) };
        profile.with_dt(dt_s).map_err(|error| self.at_origin("run.dt_s", "dt", error))
    }

    /// Adds the file or assignment that sets the key to an error about an option.
    fn at_origin(&self, key: &str, option: &'static str, error: Error) -> Error {
        let origin = self.layers.get(key).map(|setting| &setting.origin);
        match (error, origin) {
            (error, None | Some(Origin::Default | Origin::Flag(_))) => error,
            (Error::Usage { place, problem, help }, Some(origin)) if place.option == Some(option) => {
                Error::usage(origin.place(key), problem, help)
            }
            (error, _) => error,
        }
    }

    /// Whether a key was set.
    pub(super) fn is_set(&self, key: &str) -> bool {
        self.layers.given().any(|setting| setting.key.name == key)
    }

    /// All settings, for the record of a run; without those that a plan file decides, if one was given.
    pub(super) fn record(&self, has_plan: bool) -> Vec<SettingRecord> {
        let record = |setting: &Setting| SettingRecord {
            key: setting.key.name.clone(),
            value: setting.value.clone().unwrap_or_default(),
            source: setting.origin.to_string(),
        };
        self.layers.0.iter().filter(|setting| !(has_plan && is_of_plan(&setting.key.name))).map(record).collect()
    }

    /// Does work with a bar.
    ///
    /// # Errors
    /// Those of the work.
    pub(super) fn with_bar<T>(
        &self,
        units: impl Into<Option<u64>>,
        what: &str,
        work: impl FnOnce(&ProgressBar) -> Result<T>,
    ) -> Result<T> {
        let bar = console::progress(self.level, units.into(), what);
        let done = work(&bar);
        bar.finish_and_clear();
        done
    }

    /// The same for work whose executor moves the bar.
    ///
    /// # Errors
    /// Those of the work.
    pub(super) fn with_progress<T>(
        &self,
        units: u64,
        what: &str,
        executor: &Executor,
        work: impl FnOnce(&Executor) -> Result<T>,
    ) -> Result<T> {
        self.with_bar(units, what, |bar| {
            let moved = bar.clone();
            work(&executor.clone().with_progress(move |units| moved.inc(units)))
        })
    }

    /// Refuses flags about lanes together with a plan file, which would ignore them. A file that the environment names is
    /// allowed, because the plan may have been made with it.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(super) fn refuse_with_plan(&self) -> Result<()> {
        let are_files_typed = std::env::var_os(FILE_VARIABLE).is_none();
        self.refuse_lane_keys(
            are_files_typed,
            &format!("is decided by the plan ({})", option("plan")),
            "leave it out, or make another plan",
        )
    }

    /// Refuses `--config KEY=VALUE` about lanes where `why` says that it has no effect. Files may be allowed, because
    /// other commands share them.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(super) fn refuse_lane_keys(&self, are_files_refused: bool, why: &str, help: &str) -> Result<()> {
        let is_refused = |origin: &Origin| {
            matches!(origin, Origin::Assignment(_)) || are_files_refused && matches!(origin, Origin::File { .. })
        };
        let mut refused = self.layers.given().filter(|of| is_refused(&of.origin) && is_of_plan(&of.key.name));
        refused.next().map_or(Ok(()), |Setting { key, origin, .. }| {
            Err(Error::usage(origin.place(&key.name), format!("`{}` {why}", key.name), help))
        })
    }

    /// The requested backend and device.
    ///
    /// # Errors
    /// [`Error::Usage`] for a device of the CPU, with the source of both.
    pub(super) fn backend(&self) -> Result<(BackendChoice, Option<&str>)> {
        let run = &self.settings.run;
        let device = run.device.as_deref();
        run.backend.check(device).map_err(|error| {
            let [backend, device] = ["run.backend", "run.device"]
                .map(|key| self.layers.get(key).map_or_else(Place::default, |setting| setting.origin.place(key)));
            let named = run.device.as_deref().unwrap_or_default();
            let problem = format!("`{named}` is named, but {backend} chooses the CPU, which uses no device");
            Error::usage(device, problem, error.help().unwrap_or_default())
        })?;
        Ok((run.backend, device))
    }

    /// Opens the backend that flags and files select.
    ///
    /// # Errors
    /// As [`Configured::backend`] and [`OpenBackend::open`].
    pub(super) fn open(&self) -> Result<OpenBackend> {
        let (backend, device) = self.backend()?;
        let opened =
            OpenBackend::open(backend, device).map_err(|error| self.at_origin("run.device", "device", error))?;
        Ok(opened.with_cancel(CANCEL.clone()))
    }

    /// The same, or the CPU in binary64, which allows no other backend.
    ///
    /// # Errors
    /// As [`Configured::open`]; [`Error::Usage`] if a device is requested for binary64.
    pub(super) fn open_in(&self, is_binary64: bool) -> Result<OpenBackend> {
        if !is_binary64 {
            return self.open();
        }
        let run = &self.settings.run;
        if run.backend == BackendChoice::Gpu || run.device.is_some() {
            let problem = "binary64 is computed on the CPU; a device computes in binary32";
            let help = format!("choose {}, or leave out the key `reference`", option("backend = cpu"));
            return Err(Error::usage(Place::item("reference"), problem, help));
        }
        Ok(OpenBackend::reference().with_cancel(CANCEL.clone()))
    }

    /// Opens the backend to be verified.
    ///
    /// # Errors
    /// As [`Configured::backend`] and [`OpenBackend::open_to_verify`].
    pub(super) fn open_to_verify(&self) -> Result<OpenBackend> {
        let (backend, device) = self.backend()?;
        OpenBackend::open_to_verify(backend, device).map_err(|error| self.at_origin("run.device", "device", error))
    }
}
