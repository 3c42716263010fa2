//! Calls of verbs as functions: named values become the words of a command line, which clap parses. Its errors name
//! arguments.

use std::error::Error as _;
use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, ArgMatches, Command};

use super::configured;
use lanesweep_support::plain_text::nearest;
use lanesweep_support::{Error, Place, Result};

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

/// Names of a function's arguments.
///
/// # Errors
/// [`Error::Usage`] for an unknown function.
pub fn arguments(function: &str) -> Result<Vec<String>> {
    Ok(arguments_of(&verb_of(function)?).map(|arg| arg.get_id().to_string()).collect())
}

/// Parses a call.
///
/// # Errors
/// [`Error::Usage`] with the argument.
pub(super) fn parse(function: &str, given: Vec<(String, Given)>) -> Result<ArgMatches> {
    let verb = verb_of(function)?;
    let mut flags: Vec<OsString> = vec!["lanesweep".into(), verb.get_name().into()];
    let mut positions: Vec<OsString> = vec!["--".into()];
    for (name, value) in given {
        let refused = |problem: String, help: &str| Err(Error::usage(Place::item(format!("`{name}`")), problem, help));
        let Some(arg) = arguments_of(&verb).find(|arg| arg.get_id() == name.as_str()) else {
            let names: Vec<&str> = arguments_of(&verb).map(|arg| arg.get_id().as_str()).collect();
            let near = nearest(&name, names.iter().copied(), 0.7);
            let help = near.map_or(format!("there are {}", names.join(", ")), |near| format!("did you mean `{near}`?"));
            return refused(format!("{function} has no such argument"), &help);
        };
        let flag = arg.get_long().map(|long| format!("--{long}"));
        match (value, flag, arg.get_action().takes_values()) {
            (Given::Flag(is_present), Some(flag), false) => flags.extend(is_present.then(|| flag.into())),
            (Given::Flag(is_present), ..) => {
                let shown = if is_present { "True" } else { "False" };
                return refused(format!("{shown} is not a value of it"), "give a value, or leave it out");
            }
            (Given::Words(_), _, false) => return refused("it is True or False".to_owned(), "give one of the two"),
            (Given::Words(words), None, true) => positions.extend(words),
            (Given::Words(words), Some(flag), true) => flags.extend(words.into_iter().map(|word| {
                let mut text = OsString::from(format!("{flag}="));
                text.push(word);
                text
            })),
        }
    }
    flags.extend(positions);
    configured::command().try_get_matches_from(flags).map_err(|error| refusal(&verb, &error))
}

/// An error of the command line in the words of a call.
fn refusal(verb: &Command, error: &clap::Error) -> Error {
    // Clap names an argument as its usage shows it.
    let name = |shown: &String| {
        let arg = verb.get_arguments().find(|arg| arg.to_string() == *shown);
        format!("`{}`", arg.map_or(shown.as_str(), |arg| arg.get_id().as_str()))
    };
    let texts = |kind| match error.get(kind) {
        Some(ContextValue::String(one)) => vec![one.clone()],
        Some(ContextValue::Strings(many)) => many.clone(),
        _ => Vec::new(),
    };
    let names = |kind| texts(kind).iter().map(name).collect::<Vec<_>>().join(", ");
    let value = texts(ContextKind::InvalidValue).concat();
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
    Error::usage(Place::item(names(ContextKind::InvalidArg)), problem, help)
}
