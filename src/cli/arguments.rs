//! Calls of verbs as functions: named values become the words of a command line, which clap parses. Its errors name
//! arguments.

use std::error::Error as _;
use std::ffi::OsString;

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, ArgAction, ArgMatches, Command};
use serde::Serialize;

use super::configured;
use lanesweep_support::{Error, Place, Result, option};

/// The value of an argument.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Given {
    /// Whether the flag is present.
    Flag(bool),
    /// The values, as a command line has them.
    Words(Vec<OsString>),
}

/// The verb of a function.
fn verb_of(function: &str) -> Result<Command> {
    let mut program = configured::command();
    program.build();
    let verb = program.find_subcommand(if function == "trace" { "simulate" } else { function });
    verb.cloned().ok_or_else(|| Error::usage(Place::item(function), "there is no such function", ""))
}

/// The arguments of a verb.
fn arguments_of(verb: &Command) -> impl Iterator<Item = &Arg> {
    // Of the command line alone: a function prints nothing.
    let printing = ["help", "version", "quiet", "verbose", "format"];
    verb.get_arguments().filter(move |arg| !printing.contains(&arg.get_id().as_str()))
}

/// What a verb says of itself, from which `python/tools/verbs.py` writes its function.
#[derive(Debug, Serialize)]
pub struct Described {
    about: String,
    arguments: Vec<Argument>,
}

/// What a flag or position says of itself.
#[derive(Debug, Serialize)]
struct Argument {
    name: String,
    help: String,
    /// Name of its value; none if it is present or not.
    value: Option<String>,
    /// The only possible values.
    words: Vec<String>,
    is_position: bool,
    is_required: bool,
    is_repeated: bool,
}

/// Describes a function.
///
/// # Errors
/// [`Error::Usage`] for an unknown function.
pub fn described(function: &str) -> Result<Described> {
    let verb = verb_of(function)?;
    let text = |long: Option<&StyledStr>, short: Option<&StyledStr>| long.or(short).map(ToString::to_string);
    let describe = |arg: &Arg| Argument {
        name: arg.get_id().to_string(),
        help: text(arg.get_long_help(), arg.get_help()).unwrap_or_default(),
        value: arg.get_action().takes_values().then(|| arg.get_value_names().unwrap_or_default().concat()),
        words: arg.get_possible_values().iter().map(|word| word.get_name().to_owned()).collect(),
        is_position: arg.is_positional(),
        is_required: arg.is_required_set(),
        is_repeated: matches!(arg.get_action(), ArgAction::Append),
    };
    let about = text(verb.get_long_about(), verb.get_about()).unwrap_or_default();
    Ok(Described { about, arguments: arguments_of(&verb).map(describe).collect() })
}

/// Parses a call.
///
/// # Errors
/// [`Error::Usage`] with the argument.
pub(super) fn parse(function: &str, given: &[(String, Given)]) -> Result<ArgMatches> {
    let verb = verb_of(function)?;
    let error = match parsed(function, &verb, given.iter())? {
        Ok(matches) => return Ok(matches),
        Err(error) => error,
    };
    let refused = |without: &str| parsed(function, &verb, given.iter().filter(|(name, _)| name != without));
    // Clap does not say which argument needs the one that is missing: the one without which none is.
    let is_missing = error.kind() == ErrorKind::MissingRequiredArgument;
    let needs = |(name, _): &&(String, Given)| is_missing && matches!(refused(name), Ok(Ok(_)));
    Err(refusal(&verb, &error, given.iter().find(needs).map(|(name, _)| name.as_str())))
}

/// What clap says of a call.
fn parsed<'a>(
    function: &str,
    verb: &Command,
    given: impl Iterator<Item = &'a (String, Given)>,
) -> Result<clap::error::Result<ArgMatches>> {
    let mut flags: Vec<OsString> = vec!["lanesweep".into(), verb.get_name().into()];
    let mut positions: Vec<OsString> = vec!["--".into()];
    for (name, value) in given {
        let refused = |problem: String, help: &str| Err(Error::usage(Place::item(option(name)), problem, help));
        let Some(arg) = arguments_of(verb).find(|arg| arg.get_id() == name.as_str()) else {
            return refused(format!("{function} has no such argument"), "leave it out");
        };
        let flag = arg.get_long().map(|long| format!("--{long}"));
        let needs_no_value = arg.get_num_args().is_some_and(|number| number.min_values() == 0);
        match (value, flag, arg.get_action().takes_values()) {
            (Given::Flag(is_present), Some(flag), takes_values) if !takes_values || needs_no_value => {
                flags.extend(is_present.then(|| flag.into()));
            }
            (Given::Flag(is_present), ..) => {
                let shown = if *is_present { "True" } else { "False" };
                return refused(format!("{shown} is not a value of it"), "give a value, or leave it out");
            }
            (Given::Words(_), _, false) => return refused("it is True or False".to_owned(), "give one of the two"),
            (Given::Words(words), None, true) => positions.extend(words.iter().cloned()),
            (Given::Words(words), Some(flag), true) => flags.extend(words.iter().map(|word| {
                let mut text = OsString::from(format!("{flag}="));
                text.push(word);
                text
            })),
        }
    }
    flags.extend(positions);
    Ok(configured::command().try_get_matches_from(flags))
}

/// An error of the command line in the words of a call; `needing` is the argument that needs the missing one.
fn refusal(verb: &Command, error: &clap::Error, needing: Option<&str>) -> Error {
    // Clap names an argument as its usage shows it: a position in brackets.
    let bare = |shown: &str| shown.trim_matches(['[', ']', '<', '>']).to_owned();
    let name = |shown: &String| {
        let arg = verb.get_arguments().find(|arg| bare(&arg.to_string()) == bare(shown));
        option(arg.map_or(shown.as_str(), |arg| arg.get_id().as_str()))
    };
    let texts = |kind| match error.get(kind) {
        Some(ContextValue::String(one)) => vec![one.clone()],
        Some(ContextValue::Strings(many)) => many.clone(),
        _ => Vec::new(),
    };
    let names = |kind| texts(kind).iter().map(name).collect::<Vec<_>>().join(", ");
    let value = texts(ContextKind::InvalidValue).concat();
    let invalid = names(ContextKind::InvalidArg);
    if let Some(needing) = needing {
        let help = format!("add {invalid}, or leave it out");
        return Error::usage(Place::item(option(needing)), format!("it needs {invalid}"), help);
    }
    let (problem, help) = match (error.kind(), error.source()) {
        (ErrorKind::ArgumentConflict, _) => {
            let problem = format!("it cannot be used with {}", names(ContextKind::PriorArg));
            (problem, "leave out one of the two".to_owned())
        }
        (ErrorKind::MissingRequiredArgument, _) => {
            ("it is needed".to_owned(), "add it, or leave out what needs it".to_owned())
        }
        (_, Some(cause)) => (format!("`{value}`: {cause}"), String::new()),
        (_, None) if value.is_empty() => ("it is empty".to_owned(), "give a value, or leave it out".to_owned()),
        (_, None) => {
            let known = texts(ContextKind::ValidValue).join(", ");
            (format!("there is no `{value}`"), format!("use one of {known}"))
        }
    };
    Error::usage(Place::item(invalid), problem, help)
}
