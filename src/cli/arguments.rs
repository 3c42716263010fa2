//! Arguments of a verb as values, from a program that calls the verb as a function. The definition of the command line gives
//! their names and defaults, and says which of them are required and which exclude one another.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt;
use std::path::PathBuf;

use clap::{Arg, Command, ValueEnum};

use lanesweep_support::plain_text::nearest;
use lanesweep_support::{Error, Place, Result};

/// A value. Its [`Display`](fmt::Display) is Python's notation.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// True or false.
    Boolean(bool),
    /// A whole number.
    Whole(i128),
    /// A number.
    Number(f64),
    /// A text.
    Text(OsString),
    /// A path, which is never several.
    Path(PathBuf),
    /// Several values.
    List(Vec<Value>),
    /// Names with their values.
    Table(Vec<(String, Value)>),
}

impl Value {
    /// The value in the notation of the option's texts: `2,3` for a list, `gap_m=15` for a name with its value.
    pub(super) fn text(&self) -> std::result::Result<String, String> {
        Ok(match self {
            Value::Boolean(is_so) => is_so.to_string(),
            Value::Whole(n) => n.to_string(),
            Value::Number(x) => x.to_string(),
            Value::Text(text) => text.to_str().ok_or("this is not Unicode")?.to_owned(),
            Value::Path(path) => path.to_str().ok_or("this is not Unicode")?.to_owned(),
            Value::List(values) => {
                values.iter().map(Value::text).collect::<std::result::Result<Vec<_>, _>>()?.join(",")
            }
            Value::Table(_) => self.texts()?.join(","),
        })
    }

    /// One text per value.
    fn texts(&self) -> std::result::Result<Vec<String>, String> {
        match self {
            Value::List(values) => values.iter().map(Value::text).collect(),
            Value::Table(rows) => rows.iter().map(|(name, value)| Ok(format!("{name}={}", value.text()?))).collect(),
            one => Ok(vec![one.text()?]),
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Boolean(is_so) => f.write_str(if *is_so { "True" } else { "False" }),
            Value::Whole(n) => write!(f, "{n}"),
            Value::Number(x) => write!(f, "{x:?}"),
            Value::Text(text) => write!(f, "{:?}", text.to_string_lossy()),
            Value::Path(path) => write!(f, "{:?}", path.to_string_lossy()),
            Value::List(values) => {
                let values: Vec<String> = values.iter().map(Value::to_string).collect();
                write!(f, "[{}]", values.join(", "))
            }
            Value::Table(rows) => {
                let rows: Vec<String> = rows.iter().map(|(name, value)| format!("{name:?}: {value}")).collect();
                write!(f, "{{{}}}", rows.join(", "))
            }
        }
    }
}

/// A type that an argument's value becomes.
pub(super) trait FromValue: Sized {
    /// Without the argument; `None` if the definition's default counts, or the argument is required.
    fn absent() -> Option<Self> {
        None
    }

    /// # Errors
    /// What is expected instead.
    fn of(value: Value) -> std::result::Result<Self, String>;
}

impl FromValue for bool {
    fn absent() -> Option<Self> {
        Some(false)
    }

    fn of(value: Value) -> std::result::Result<Self, String> {
        match value {
            Value::Boolean(is_so) => Ok(is_so),
            other => Err(format!("{other} is neither True nor False")),
        }
    }
}

/// Parses an integer as in the configuration: `10000`, `10_000` or `1e4`.
///
/// # Errors
/// What to write, if the text is not an integer or is out of range.
pub(super) fn whole<T: TryFrom<u64>>(text: &str) -> std::result::Result<T, String> {
    let plain = text.replace('_', "");
    let of_power = || {
        // Above 2^53 a floating-point number no longer identifies one integer.
        let value = plain.parse::<f64>().ok().filter(|value| value.fract() == 0.0 && (0.0..9e15).contains(value));
        value.map(|value| value as u64)
    };
    let value = plain.parse().ok().or_else(of_power).ok_or("write a whole number such as 10000, 10_000 or 1e4")?;
    T::try_from(value).map_err(|_| format!("{value} is too large"))
}

/// What a text of an option says, numbers as their texts.
fn parsed<T>(value: &Value, expected: &str, parse: impl Fn(&str) -> Option<T>) -> std::result::Result<T, String> {
    let parsed = value.text().ok().and_then(|text| parse(text.trim()));
    parsed.ok_or_else(|| format!("{value} is not {expected}"))
}

macro_rules! whole_values {
    ($($of:ty),*) => {$(
        impl FromValue for $of {
            fn of(value: Value) -> std::result::Result<Self, String> {
                parsed(&value, "a whole number from 0", |text| whole(text).ok())
            }
        }
    )*};
}
whole_values!(usize, u64);

impl FromValue for f64 {
    fn of(value: Value) -> std::result::Result<Self, String> {
        parsed(&value, "a number", |text| text.parse().ok())
    }
}

impl FromValue for String {
    fn of(value: Value) -> std::result::Result<Self, String> {
        value.text()
    }
}

impl FromValue for PathBuf {
    fn of(value: Value) -> std::result::Result<Self, String> {
        match value {
            Value::Text(text) if text.is_empty() => Err("a path is needed, and this is empty".to_owned()),
            Value::Text(path) => Ok(PathBuf::from(path)),
            Value::Path(path) => Ok(path),
            other => Err(format!("{other} is not a path")),
        }
    }
}

impl<T: FromValue> FromValue for Option<T> {
    fn absent() -> Option<Self> {
        Some(None)
    }

    fn of(value: Value) -> std::result::Result<Self, String> {
        T::of(value).map(Some)
    }
}

impl FromValue for Vec<String> {
    fn absent() -> Option<Self> {
        Some(Vec::new())
    }

    fn of(value: Value) -> std::result::Result<Self, String> {
        value.texts()
    }
}

impl FromValue for Vec<PathBuf> {
    fn absent() -> Option<Self> {
        Some(Vec::new())
    }

    fn of(value: Value) -> std::result::Result<Self, String> {
        match value {
            Value::List(values) => values.into_iter().map(PathBuf::of).collect(),
            one => Ok(vec![PathBuf::of(one)?]),
        }
    }
}

/// A word of an enumeration.
///
/// # Errors
/// The words.
pub(super) fn choice<T: ValueEnum>(value: &Value) -> std::result::Result<T, String> {
    let text = value.text()?;
    T::from_str(&text, true).map_err(|_| {
        let words =
            T::value_variants().iter().filter_map(|value| Some(value.to_possible_value()?.get_name().to_owned()));
        format!("there is no `{text}`; use one of {}", words.collect::<Vec<_>>().join(", "))
    })
}

/// An argument that means nothing without another one, by verb.
pub(super) const NEEDS: [(&[&str], &str, &str); 14] = [
    (&["study", "fit", "verify"], "filter", "scenarios"),
    (&["study", "fit", "verify", "mine"], "preset", "recordings"),
    (&["check"], "scenario", "file"),
    (&["check"], "row", "file"),
    (&["simulate"], "row", "table"),
    (&["simulate"], "scenarios", "lane"),
    (&["simulate"], "from", "lane"),
    (&["simulate"], "compare", "lane"),
    (&["simulate"], "plot_end", "plot"),
    (&["simulate"], "ego", "xosc"),
    (&["simulate"], "duration", "xosc"),
    (&["simulate"], "side", "xosc"),
    (&["tracks"], "preset", "paths"),
    (&["tracks"], "out", "paths"),
];

/// The arguments of one call.
pub(super) struct Arguments {
    /// Definition of the verb.
    command: Command,
    /// The call in Python's notation.
    call: String,
    values: BTreeMap<String, Value>,
}

impl Arguments {
    /// Checks the names, and what excludes or needs what.
    ///
    /// # Errors
    /// [`Error::Usage`] with the argument.
    pub(super) fn new(command: Command, function: &str, values: Vec<(String, Value)>) -> Result<Arguments> {
        let is_shown = |(name, value): &&(String, Value)| name != "out" && *value != Value::Boolean(false);
        let written: Vec<String> =
            values.iter().filter(is_shown).map(|(name, value)| format!("{name}={value}")).collect();
        let call = format!("lanesweep.{function}({})", written.join(", "));
        let arguments = Arguments { command, call, values: values.into_iter().collect() };
        arguments.check(function)?;
        Ok(arguments)
    }

    fn check(&self, function: &str) -> Result<()> {
        let command = &self.command;
        let refused =
            |name: &str, problem: String, help: &str| Error::usage(Place::item(format!("`{name}`")), problem, help);
        let names: Vec<&str> = names(command).collect();
        for (name, value) in &self.values {
            let Some(arg) = of_name(command, name).filter(|_| names.contains(&name.as_str())) else {
                let near = nearest(name, names.iter().copied(), 0.7);
                let help =
                    near.map_or(format!("there are {}", names.join(", ")), |near| format!("did you mean `{near}`?"));
                return Err(refused(name, format!("{function} has no such argument"), &help));
            };
            if matches!(value, Value::Boolean(_)) && arg.get_action().takes_values() {
                return Err(refused(name, format!("{value} is not a value of it"), "give a value, or leave it out"));
            }
            if !self.is_given(name) {
                continue;
            }
            let mut excluded = command.get_arg_conflicts_with(arg).into_iter().map(|other| other.get_id().as_str());
            if let Some(other) = excluded.find(|other| self.is_given(other)) {
                return Err(refused(name, format!("it cannot be used with `{other}`"), "leave out one of the two"));
            }
            let of_verb = |(verbs, one, _): &&(&[&str], &str, &str)| verbs.contains(&command.get_name()) && one == name;
            if let Some((.., needed)) = NEEDS.iter().find(of_verb).filter(|(.., needed)| !self.is_given(needed)) {
                return Err(refused(name, format!("it needs `{needed}`"), "add it, or leave this out"));
            }
        }
        let is_missing = |arg: &&Arg| arg.is_required_set() && !self.is_given(arg.get_id().as_str());
        match command.get_arguments().find(is_missing) {
            Some(arg) => Err(refused(arg.get_id().as_str(), "it is needed".to_owned(), &help_of(arg))),
            None => Ok(()),
        }
    }

    /// Whether an argument is there, and not False.
    pub(super) fn is_given(&self, name: &str) -> bool {
        self.values.get(name).is_some_and(|value| *value != Value::Boolean(false))
    }

    /// The call, for repeating it.
    pub(super) fn call(&self) -> &str {
        &self.call
    }

    /// Takes an argument.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is required, or its value is none of its type.
    pub(super) fn take<T: FromValue>(&mut self, name: &'static str) -> Result<T> {
        let arg = of_name(&self.command, name);
        let refused = |problem: String| {
            let help = arg.map(help_of).unwrap_or_default();
            Error::usage(Place::option(name), problem, help)
        };
        let default = || arg.and_then(|arg| arg.get_default_values().first()).map(|word| Value::Text(word.into()));
        let value = match (self.values.remove(name), T::absent()) {
            // A list may be one text with commas.
            (Some(Value::Text(text)), _) if arg.is_some_and(|arg| arg.get_value_delimiter().is_some()) => {
                Value::List(text.to_string_lossy().split(',').map(|part| Value::Text(part.trim().into())).collect())
            }
            (Some(value), _) => value,
            (None, Some(absent)) => return Ok(absent),
            (None, None) => default().ok_or_else(|| refused("it is needed".to_owned()))?,
        };
        T::of(value).map_err(refused)
    }

    /// Takes an argument that a function parses.
    ///
    /// # Errors
    /// As [`Arguments::take`].
    pub(super) fn parse<T>(
        &mut self,
        name: &'static str,
        parser: impl Fn(&str) -> std::result::Result<T, String>,
    ) -> Result<Option<T>> {
        let text: Option<String> = self.take(name)?;
        let parsed = text.as_deref().map(parser).transpose();
        parsed.map_err(|problem| Error::usage(Place::option(name), problem, ""))
    }

    /// Takes the value of an argument as it is.
    pub(super) fn value(&mut self, name: &str) -> Option<Value> {
        self.values.remove(name)
    }
}

/// Names of a verb's arguments.
pub(super) fn names(command: &Command) -> impl Iterator<Item = &str> {
    // Of the command line alone: a function prints nothing.
    let printing = ["help", "version", "quiet", "verbose", "format"];
    command.get_arguments().map(|arg| arg.get_id().as_str()).filter(move |name| !printing.contains(name))
}

fn help_of(arg: &Arg) -> String {
    arg.get_help().map(ToString::to_string).unwrap_or_default()
}

fn of_name<'a>(command: &'a Command, name: &str) -> Option<&'a Arg> {
    command.get_arguments().find(|arg| arg.get_id() == name)
}

/// Options of a verb, or a group of them, from arguments.
pub(super) trait FromArguments: Sized {
    /// Takes the fields' values.
    ///
    /// # Errors
    /// As [`Arguments::take`].
    fn from_arguments(arguments: &mut Arguments) -> Result<Self>;
}

impl<T: FromArguments> FromArguments for Box<T> {
    fn from_arguments(arguments: &mut Arguments) -> Result<Self> {
        T::from_arguments(arguments).map(Box::new)
    }
}

/// Implements [`FromArguments`]: fields that take their values, fields that a function parses, and groups.
macro_rules! from_arguments {
    (
        $type:ident { $($field:ident),* $(,)? }
        $(parsed { $($parsed:ident: $parser:expr),* $(,)? })?
        $(groups { $($group:ident),* $(,)? })?
        $(others { $($other:ident: $value:expr),* $(,)? })?
    ) => {
        impl $crate::arguments::FromArguments for $type {
            fn from_arguments(arguments: &mut $crate::arguments::Arguments) -> lanesweep_support::Result<Self> {
                Ok($type {
                    $($field: arguments.take(stringify!($field))?,)*
                    $($($parsed: arguments.parse(stringify!($parsed), $parser)?,)*)?
                    $($($group: $crate::arguments::FromArguments::from_arguments(arguments)?,)*)?
                    $($($other: $value,)*)?
                })
            }
        }
    };
}

/// Implements [`FromValue`] for enumerations.
macro_rules! choices {
    ($($type:ident),*) => {
        $(impl $crate::arguments::FromValue for $type {
            fn of(value: $crate::arguments::Value) -> std::result::Result<Self, String> {
                $crate::arguments::choice(&value)
            }
        })*
    };
}

pub(super) use {choices, from_arguments};
