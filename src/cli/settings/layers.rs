//! The layers of a configuration (defaults, files, flags), combined key by key.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use super::keys::{Key, KeyKind, from_word, keys_in_order};
use super::{Settings, file};
use lanesweep_support::{Error, Place, Result, option};

/// Source of a value; a later one overrides an earlier one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Origin {
    /// Built-in default.
    Default,
    /// A line of a file.
    File {
        /// The file, as named by the user.
        path: PathBuf,
        /// Line, from 1.
        row: u64,
    },
    /// `--config KEY=VALUE`.
    Assignment(String),
    /// The key's own flag, as the user writes it.
    Flag(String),
}

impl Origin {
    /// The place in errors.
    pub(crate) fn place(&self, key: &str) -> Place {
        match self {
            Origin::File { path, row } => Place::file(path).row(*row).of(format!("`{key}`")),
            Origin::Default => Place::item(format!("`{key}`")),
            Origin::Assignment(text) => Place::item(option(&format!("config = {text}"))),
            Origin::Flag(flag) => Place::item(flag),
        }
    }

    /// Position among the layers, from 0.
    pub(crate) fn layer(&self) -> usize {
        match self {
            Origin::Default => 0,
            Origin::File { .. } => 1,
            Origin::Assignment(_) => 2,
            Origin::Flag(_) => 3,
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::Default => f.write_str("default"),
            Origin::File { path, row } => write!(f, "file {}, line {row}", path.display()),
            Origin::Assignment(_) => f.write_str("flag --config"),
            Origin::Flag(flag) => write!(f, "flag {flag}"),
        }
    }
}

/// Value of `--config`: a file or an assignment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Assignment {
    /// A file to read.
    File(PathBuf),
    /// `KEY=VALUE`.
    Value(String),
}

impl Assignment {
    /// A text with `=` that is not the name of a file is an assignment.
    pub(crate) fn of(text: &str) -> Assignment {
        match text.contains('=') && !Path::new(text).exists() {
            true => Assignment::Value(text.to_owned()),
            false => Assignment::File(PathBuf::from(text)),
        }
    }
}

/// A key with its value and source.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Setting<'a> {
    /// The key.
    pub key: &'a Key,
    /// Its value; `None` where it is not set.
    pub value: Option<&'a Value>,
    /// Source of the value.
    pub origin: &'a Origin,
}

/// The combined layers of a configuration.
#[derive(Debug, Clone)]
pub(crate) struct Layers {
    keys: Vec<Key>,
    values: BTreeMap<String, (Option<Value>, Origin)>,
}

impl Default for Layers {
    fn default() -> Self {
        Layers::defaults()
    }
}

impl Layers {
    /// The defaults alone.
    pub(crate) fn defaults() -> Layers {
        let keys = keys_in_order();
        let values = keys.iter().map(|key| (key.name.clone(), (key.default.clone(), Origin::Default))).collect();
        Layers { keys, values }
    }

    /// Reads the files and assignments of `--config`, in this order. Without a file among them, it reads the one named by
    /// `variable`, the value of [`FILE_VARIABLE`](super::FILE_VARIABLE); an empty one names none.
    ///
    /// # Errors
    /// [`Error::Usage`] naming file and line, or flag: unknown keys, with the most similar known one, and invalid values.
    /// [`Error::Io`] and [`Error::Input`] of the files.
    pub(crate) fn read(typed: &[Assignment], variable: Option<&OsStr>) -> Result<Layers> {
        let mut layers = Layers::defaults();
        let named = typed.iter().filter_map(|one| match one {
            Assignment::File(path) => Some(path.clone()),
            Assignment::Value(_) => None,
        });
        let mut files: Vec<PathBuf> = named.collect();
        if files.is_empty() {
            files.extend(variable.filter(|path| !path.is_empty()).map(PathBuf::from));
        }
        for path in files {
            for line in file::read(&path, &layers.keys)? {
                layers.set(&line.key, line.value, Origin::File { path: path.clone(), row: line.row });
            }
        }
        for one in typed {
            if let Assignment::Value(text) = one {
                layers.assign(text)?;
            }
        }
        Ok(layers)
    }

    /// Applies `KEY=VALUE`; an empty value restores the default.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown key or an invalid value.
    pub(super) fn assign(&mut self, text: &str) -> Result<()> {
        let (name, word) = text.split_once('=').unwrap_or((text, ""));
        let name = name.trim();
        let Some(key) = Key::find(&self.keys, name).cloned() else {
            let place = Place::item(option(&format!("config = {text}")));
            return Err(file::unknown(place, name, false, &self.keys));
        };
        let origin = Origin::Assignment(text.to_owned());
        if word.trim().is_empty() {
            self.values.insert(key.name, (key.default, origin));
            return Ok(());
        }
        self.set_word(&key, word, origin)
    }

    /// Applies the value of a key's own flag, ignoring case.
    ///
    /// # Errors
    /// [`Error::Usage`] for an invalid value.
    pub(crate) fn flag(&mut self, name: &str, flag: &str, word: &str) -> Result<()> {
        let Some(key) = Key::find(&self.keys, name).cloned() else { return Ok(()) };
        let is_choice = matches!(key.kind, KeyKind::Choice(_));
        let word = if is_choice { &*word.to_ascii_lowercase() } else { word };
        self.set_word(&key, word, Origin::Flag(flag.to_owned()))
    }

    fn set_word(&mut self, key: &Key, word: &str, origin: Origin) -> Result<()> {
        let value = from_word(key, word, origin.place(&key.name))?;
        self.set(&key.name, value, origin);
        Ok(())
    }

    fn set(&mut self, key: &str, value: Value, origin: Origin) {
        self.values.insert(key.to_owned(), (Some(value), origin));
    }

    /// All keys with their values, in the order of the default file.
    pub(crate) fn list(&self) -> impl Iterator<Item = Setting<'_>> {
        self.keys.iter().filter_map(|key| {
            let (value, origin) = self.values.get(&key.name)?;
            Some(Setting { key, value: value.as_ref(), origin })
        })
    }

    /// The values that were set, including those equal to the default.
    pub(crate) fn given(&self) -> impl Iterator<Item = Setting<'_>> {
        self.list().filter(|setting| *setting.origin != Origin::Default)
    }

    /// One key.
    pub(crate) fn get(&self, name: &str) -> Option<Setting<'_>> {
        self.list().find(|setting| setting.key.name == name)
    }

    /// The values as a tree of tables.
    fn tree(&self) -> Value {
        let mut root = Map::new();
        for Setting { key, value, .. } in self.list() {
            if let Some(value) = value {
                insert(&mut root, &key.name, value.clone());
            }
        }
        Value::Object(root)
    }

    /// The values as typed settings.
    ///
    /// # Errors
    /// As `MiningOptions::validate`, for values that contradict one another; [`Error::Internal`] if the types refuse what the
    /// checks accepted.
    pub(crate) fn settings(&self) -> Result<Settings> {
        let refused = |e: serde_json::Error| Error::Internal(format!("a checked configuration is refused: {e}"));
        let settings: Settings = serde_json::from_value(self.tree()).map_err(refused)?;
        settings.mining.validate()?;
        Ok(settings)
    }
}

fn insert(table: &mut Map<String, Value>, name: &str, value: Value) {
    match name.split_once('.') {
        Some((first, rest)) => {
            let inner = table.entry(first).or_insert_with(|| Value::Object(Map::new()));
            if let Value::Object(inner) = inner {
                insert(inner, rest, value);
            }
        }
        None => {
            table.insert(name.to_owned(), value);
        }
    }
}
