//! From the command line to a configuration and back: which flag sets which key, and verbs that see what files and the
//! environment set as if it were their flags' default.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command, CommandFactory, FromArgMatches};

use super::Cli;
use crate::cli::settings::{Assignment, Key, Layers, Origin, Setting, Settings};
use crate::model::profile::Profile;
use crate::report::run_record::SettingRecord;
use crate::{Error, Place, Result};

/// What a run is configured with.
#[derive(Debug, Clone, Default)]
pub(super) struct Configured {
    /// As values.
    pub settings: Settings,
    /// With their sources.
    pub layers: Layers,
}

/// A flag that sets a key: the verb (every one that has the flag where it is empty), the flag's id, the key.
pub(super) const FLAGS: [(&str, &str, &str); 21] = [
    ("", "threads", "run.threads"),
    ("", "backend", "run.backend"),
    ("", "device", "run.device"),
    ("", "profile", "run.profile"),
    ("", "dt", "run.dt_s"),
    ("", "synth_recordings", "generator.recordings"),
    ("study", "seed", "score.seed"),
    ("fit", "bandwidth_rule", "fit.bandwidth_rule"),
    ("fit", "seed", "fit.seed"),
    ("sample", "estimator", "sample.estimator"),
    ("sample", "samples", "sample.samples"),
    ("sample", "criterion", "sample.criterion"),
    ("sample", "points", "sample.points"),
    ("sample", "interval", "sample.interval"),
    ("sample", "level", "sample.level"),
    ("sample", "half_width", "sample.half_width"),
    ("sample", "time_limit", "sample.time_limit_s"),
    ("sample", "worst", "sample.worst"),
    ("sample", "seed", "sample.seed"),
    ("compare", "samples", "compare.samples"),
    ("compare", "seed", "compare.seed"),
];

/// Tables and keys that decide what the lanes of a plan are: with a plan file they are decided.
const OF_THE_PLAN: [&str; 7] =
    ["generator.", "mining.", "parameterization.", "score.", "sample.", "run.profile", "run.dt_s"];

/// The command line, with `--config` for every verb.
pub(super) fn command() -> Command {
    let keys = Key::all();
    let flags = FLAGS.iter().filter_map(|(verb, id, name)| Some((*verb, *id, Key::find(&keys, name)?)));
    let command = flags.fold(Cli::command(), |command, (verb, id, key)| match verb {
        "" => with_key(command, id, key),
        verb => command.mut_subcommand(verb, |command| with_key(command, id, key)),
    });
    super::help::laid_out(with_config(command))
}

/// A flag that always has a value takes its default from the key that it sets, and its text where it has none.
fn with_key(mut command: Command, id: &str, key: &Key) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|verb| verb.get_name().to_owned()).collect();
    for name in names {
        command = command.mut_subcommand(name, |command| with_key(command, id, key));
    }
    if command.get_arguments().all(|arg| arg.get_id() != id) {
        return command;
    }
    command.mut_arg(id, |mut arg| {
        if let (true, Some(default)) = (arg.is_required_set(), &key.default) {
            arg = arg.required(false).default_value(word(default));
        }
        match arg.get_help() {
            Some(_) => arg,
            None => arg.help(key.description.trim_end_matches('.').to_owned()),
        }
    })
}

/// A value as a flag takes it.
fn word(value: &serde_json::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A flag of each level's own: of a global one, what stands before the verb is lost where it stands after it too.
fn with_config(mut command: Command) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|verb| verb.get_name().to_owned()).collect();
    for name in names {
        command = command.mut_subcommand(name, with_config);
    }
    let help = "Configuration file, or one key of it; repeatable";
    let more = "`lanesweep config init` writes such a file. Without --config, LANESWEEP_CONFIG names it.";
    let arg = Arg::new("config").long("config").value_name("FILE|KEY=VALUE").action(ArgAction::Append);
    command.arg(arg.help(help).long_help(format!("{help}\n\n{more}")))
}

impl Configured {
    /// Puts the layers together, and gives the command line with what they set. `words` are those that `matches` are of.
    ///
    /// # Errors
    /// As [`Layers::read`]; [`Error::Usage`] for a value that the verb's flag does not take.
    pub fn of(matches: &ArgMatches, words: &[OsString]) -> Result<(Cli, Configured)> {
        let (path, typed, last) = verb_of(matches);
        if path.last() == Some(&"slurm") && !typed.is_empty() {
            let help = "give it to the run: lanesweep cluster slurm … -- study --config FILE";
            return Err(Error::usage(Place::item("--config"), "the scripts do not carry it", help));
        }
        if !reads_configuration(&path) {
            let cli = Cli::from_arg_matches(matches).map_err(broken)?;
            return Ok((cli, Configured::default()));
        }
        let mut layers = Layers::read(&typed, &std::env::vars_os().collect::<Vec<_>>())?;
        let command = command();
        let flags: Vec<(&str, &str)> = flags_of(&command, &path);
        for (id, key) in &flags {
            if last.value_source(id) == Some(ValueSource::CommandLine)
                && let Some(word) = last.get_raw(id).and_then(|mut words| words.next()).and_then(|word| word.to_str())
            {
                layers.flag(key, &format!("--{}", id.replace('_', "-")), word);
            }
        }
        let configured = Configured { settings: layers.settings()?, layers };
        configured.settings.validate().map_err(|error| configured.at_origin(error))?;
        configured.check_profile()?;
        let given: Vec<(&str, Setting)> = flags
            .iter()
            .filter_map(|(id, key)| Some((*id, configured.layers.get(key)?)))
            .filter(|(id, setting)| configured.reaches(id, setting, last))
            .collect();
        if given.is_empty() {
            let cli = Cli::from_arg_matches(matches).map_err(broken)?;
            return Ok((cli, configured));
        }
        let with = |given: &[(&str, Setting)]| {
            let command = with_defaults(command.clone(), &path, given);
            command.try_get_matches_from(words).and_then(|matches| Cli::from_arg_matches(&matches))
        };
        match with(&given) {
            Ok(cli) => Ok((cli, configured)),
            // Which of them the flag does not take.
            Err(all) => {
                let (at, error) = given
                    .iter()
                    .find_map(|one| Some((one, with(std::slice::from_ref(one)).err()?)))
                    .ok_or_else(|| broken(all))?;
                let problem =
                    error.to_string().lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
                let key = &at.1.key;
                Err(Error::usage(at.1.origin.place(&key.name), problem, format!("expected {}", key.expected())))
            }
        }
    }

    /// An error about a key, at the flag, line or variable that sets it.
    fn at_origin(&self, error: Error) -> Error {
        let Error::Usage { place, problem, help } = error else { return error };
        let setting = place.item.as_ref().and_then(|key| self.layers.get(key));
        let origin = setting.map(|setting| setting.origin.place(&setting.key.name));
        Error::Usage { place: origin.map_or(place, Box::new), problem, help }
    }

    /// Does a value of another source than the flag count for the verb?
    fn reaches(&self, id: &str, setting: &Setting, typed: &ArgMatches) -> bool {
        let layer = setting.origin.layer();
        if setting.value.is_none() || [Origin::Default.layer(), Origin::Flag(String::new()).layer()].contains(&layer) {
            return false;
        }
        // A flag that leaves one backend only wins over what a file says of it, as every flag does.
        let is_there = |id: &str| typed.try_contains_id(id).is_ok_and(|known| known) && typed.get_flag(id);
        let is_of_backend = ["backend", "device"].contains(&id);
        if is_of_backend && is_there("reference") {
            return false;
        }
        // So does a backend without devices over a device of an earlier source.
        let cpu = self.layers.get("run.backend").filter(|backend| backend.value.is_some_and(|value| value == "cpu"));
        !(id == "device" && cpu.is_some_and(|backend| backend.origin.layer() > layer))
    }

    /// A profile that a file or the environment names: an error names that place.
    fn check_profile(&self) -> Result<()> {
        let Some(setting) = self.layers.get("run.profile") else { return Ok(()) };
        if matches!(setting.origin, Origin::Default | Origin::Flag(_)) {
            return Ok(());
        }
        match Profile::load(&self.settings.run.profile) {
            Err(Error::Usage { place, problem, help }) if *place == Place::option("profile") => {
                Err(Error::usage(setting.origin.place(&setting.key.name), problem, help))
            }
            other => other.map(drop),
        }
    }

    /// The configuration files, which no result may overwrite.
    pub fn files(&self) -> &[PathBuf] {
        self.layers.files()
    }

    /// What somebody set, for the record of a run.
    pub fn record(&self) -> Vec<SettingRecord> {
        let record = |setting: Setting| SettingRecord {
            key: setting.key.name.clone(),
            value: setting.value.cloned().unwrap_or_default(),
            source: setting.origin.to_string(),
        };
        self.layers.given().map(record).collect()
    }

    /// With a plan file, what was typed about its lanes would not be heeded. (The environment may hold what the plan was
    /// made with.)
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn refuse_with_plan(&self) -> Result<()> {
        let is_typed = |origin: &Origin| match origin {
            Origin::Assignment(_) => true,
            Origin::File { .. } => std::env::var_os(crate::cli::settings::FILE_VARIABLE).is_none(),
            _ => false,
        };
        let of_plan = |key: &str| OF_THE_PLAN.iter().any(|part| key.starts_with(part));
        match self.layers.given().find(|setting| is_typed(setting.origin) && of_plan(&setting.key.name)) {
            None => Ok(()),
            Some(setting) => {
                let problem = format!("`{}` is decided by the plan (--plan)", setting.key.name);
                Err(Error::usage(
                    setting.origin.place(&setting.key.name),
                    problem,
                    "leave it out, or make another plan",
                ))
            }
        }
    }
}

/// Verbs that neither take settings nor need the environment to be in order.
fn reads_configuration(path: &[&str]) -> bool {
    !matches!(path, ["cluster", "slurm"] | ["config", "init" | "schema" | "check" | "completions" | "man"])
}

/// The verb, and the verb below it, with what `--config` was given before and after them, and the last one's matches.
fn verb_of(matches: &ArgMatches) -> (Vec<&str>, Vec<Assignment>, &ArgMatches) {
    let (mut path, mut typed, mut last) = (Vec::new(), Vec::new(), matches);
    loop {
        typed.extend(last.get_many::<String>("config").into_iter().flatten().map(|text| Assignment::of(text)));
        let Some((name, inner)) = last.subcommand() else { return (path, typed, last) };
        path.push(name);
        last = inner;
    }
}

/// The flags of a verb that set a key.
fn flags_of(command: &Command, path: &[&str]) -> Vec<(&'static str, &'static str)> {
    let mut verb = command;
    for name in path {
        verb = verb.find_subcommand(name).unwrap_or(verb);
    }
    let has = |id: &str| verb.get_arguments().chain(command.get_arguments()).any(|arg| arg.get_id() == id);
    let belongs = |(of, id, _): &&(&str, &str, &str)| (of.is_empty() || path.first() == Some(of)) && has(id);
    FLAGS.iter().filter(belongs).map(|(_, id, key)| (*id, *key)).collect()
}

/// The command with other defaults.
fn with_defaults(command: Command, path: &[&str], given: &[(&str, Setting)]) -> Command {
    let set = |mut command: Command| {
        for (id, setting) in given {
            if command.get_arguments().any(|arg| arg.get_id() == *id) {
                command = command.mut_arg(id, |arg| arg.default_value(setting.value.map_or(String::new(), word)));
            }
        }
        command
    };
    fn below(command: Command, path: &[&str], set: &dyn Fn(Command) -> Command) -> Command {
        let command = set(command);
        match path {
            [first, rest @ ..] => command.mut_subcommand(*first, |inner| below(inner, rest, set)),
            [] => command,
        }
    }
    below(command, path, &set)
}

fn broken(error: clap::Error) -> Error {
    Error::Internal(format!("the second parsing of the command line failed: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::settings::KeyKind;

    #[test]
    fn every_flag_that_sets_a_key_exists_with_the_keys_default_and_words() {
        let command = command();
        let keys = Key::all();
        for (of, id, name) in FLAGS {
            let key = Key::find(&keys, name).unwrap_or_else(|| panic!("{name}"));
            let verbs: Vec<&Command> = match of {
                "" => std::iter::once(&command).chain(command.get_subcommands()).collect(),
                verb => vec![command.find_subcommand(verb).unwrap()],
            };
            let args: Vec<_> = verbs.iter().flat_map(|v| v.get_arguments()).filter(|arg| arg.get_id() == id).collect();
            assert!(!args.is_empty(), "no flag {id} of `{of}`");
            for arg in args {
                if let [default] = arg.get_default_values() {
                    let mut layers = Layers::defaults();
                    layers.flag(name, id, default.to_str().unwrap());
                    assert_eq!(layers.get(name).unwrap().value, key.default.as_ref(), "{name}");
                }
                let words: Vec<String> = arg.get_possible_values().iter().map(|v| v.get_name().to_owned()).collect();
                if let (KeyKind::Choice(choices), false) = (&key.kind, words.is_empty()) {
                    let known: Vec<String> = choices.iter().map(|choice| choice.word.clone()).collect();
                    assert_eq!(words, known, "{name}");
                }
            }
        }
    }
}
