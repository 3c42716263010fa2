//! The layers of a configuration (defaults, files, flags), combined key by key.

use std::fmt;
use std::path::{Path, PathBuf};

use serde_json::Value;
use toml::de::{DeTable, DeValue};

use super::Settings;
use super::keys::{Key, KeyKind, from_toml, from_word, keys_in_order};
use lanesweep_support::input_file::{self, row_at};
use lanesweep_support::plain_text::{cut, nearest};
use lanesweep_support::{Error, Place, Result, option};

/// Variable that names the configuration file if `--config` names none.
pub(crate) const FILE_VARIABLE: &str = "LANESWEEP_CONFIG";

/// Source of a value; a later one overrides an earlier one.
#[derive(Debug, Clone, PartialEq, Eq)]
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

/// A key with its value and source.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Setting {
    /// The key.
    pub key: Key,
    /// Its value; `None` where it is not set.
    pub value: Option<Value>,
    /// Source of the value.
    pub origin: Origin,
}

/// The combined layers of a configuration: all keys with their values, in the order of the default file.
#[derive(Debug, Clone)]
pub(crate) struct Layers(pub Vec<Setting>);

impl Layers {
    /// The defaults alone.
    pub(crate) fn defaults() -> Layers {
        let setting = |key: Key| Setting { value: key.default.clone(), key, origin: Origin::Default };
        Layers(keys_in_order().into_iter().map(setting).collect())
    }

    /// Reads the files and assignments of `--config`, in this order: a text with `=` that is not the name of a file is an
    /// assignment. Without a file among them, it reads the one named by [`FILE_VARIABLE`].
    ///
    /// # Errors
    /// [`Error::Usage`] naming file and line, or flag: unknown keys, with the most similar known one, invalid values, and a
    /// text that is neither a file nor an assignment. [`Error::Io`] and [`Error::Input`] of the files.
    pub(crate) fn read(typed: &[&str]) -> Result<Layers> {
        let mut layers = Layers::defaults();
        let is_value = |text: &&str| text.contains('=') && !Path::new(text).exists();
        let (values, files): (Vec<&str>, Vec<&str>) = typed.iter().copied().partition(is_value);
        // A missing file is named by the system's error if its name says that a file is meant.
        if let Some(text) = files.iter().find(|file| !file.ends_with(".toml") && !Path::new(file).exists()) {
            let problem = format!("`{text}` is neither KEY=VALUE nor an existing file");
            let help = "write a key with its value, such as run.dt_s=0.05, or the path of a TOML file";
            return Err(Error::usage(Place::option("config"), problem, help));
        }
        layers.check_variables()?;
        let mut files: Vec<PathBuf> = files.into_iter().map(PathBuf::from).collect();
        if files.is_empty()
            && let Some(file) = std::env::var_os(FILE_VARIABLE).filter(|file| !file.is_empty())
        {
            tracing::info!("configuration of {FILE_VARIABLE}: {}", file.display());
            files.push(file.into());
        }
        files.iter().try_for_each(|path| layers.read_file(path))?;
        values.iter().try_for_each(|text| layers.assign(text))?;
        Ok(layers)
    }

    /// Looks for variables that would be ignored silently: those of keys, and misspellings of [`FILE_VARIABLE`].
    fn check_variables(&self) -> Result<()> {
        for (name, _) in std::env::vars_os().filter(|(name, _)| name != FILE_VARIABLE) {
            let Some(rest) = name.to_str().and_then(|name| name.strip_prefix("LANESWEEP_")) else { continue };
            let name = name.display();
            let is_of = |key: &Key| key.name.replace('.', "_").eq_ignore_ascii_case(rest);
            if let Some(Setting { key, .. }) = self.0.iter().find(|setting| is_of(&setting.key)) {
                let config = option(&format!("config = {}=VALUE", key.name));
                tracing::warn!("the variable {name} is not read: write {config}, or a file");
            } else if nearest(rest, ["CONFIG"], 0.85).is_some() {
                let help = format!("did you mean `{FILE_VARIABLE}`, which names a configuration file?");
                return Err(Error::usage(Place::item(name.to_string()), "there is no such variable", help));
            }
        }
        Ok(())
    }

    /// Takes the values of a file.
    ///
    /// # Errors
    /// As [`Layers::read`]; also for invalid TOML.
    pub(crate) fn read_file(&mut self, path: &Path) -> Result<()> {
        let text = input_file::read_text(path, input_file::MAX_SETTINGS_BYTES)?;
        let table = DeTable::parse(&text).map_err(|e| {
            let place =
                e.span().map_or(Place::file(path), |span| Place::file(path).row(row_at(text.as_bytes(), span.start)));
            Error::usage(place, e.message().to_owned(), "`lanesweep config init -` prints a file that works")
        })?;
        self.take(table.get_ref(), "", (path, &text))
    }

    /// Takes the values of a table of a file; `prefix` is its name with a dot.
    fn take(&mut self, table: &DeTable, prefix: &str, (path, text): (&Path, &str)) -> Result<()> {
        for (name, value) in table {
            let row = row_at(text.as_bytes(), name.span().start);
            let (name, value) = (format!("{prefix}{}", name.get_ref()), value.get_ref());
            let place = || Place::file(path).row(row).of(format!("`{}`", cut(&name)));
            let below = format!("{name}.");
            if self.0.iter().any(|setting| setting.key.name.starts_with(&below)) {
                let DeValue::Table(inner) = value else {
                    let help = format!("write [{name}], and its keys below");
                    return Err(Error::usage(place(), "this is a table, not a key", help));
                };
                self.take(inner, &below, (path, text))?;
                continue;
            }
            let is_table = matches!(value, DeValue::Table(_));
            let setting = self.find(&name, is_table, &place)?;
            setting.value = Some(from_toml(&setting.key, value, place())?);
            setting.origin = Origin::File { path: path.to_path_buf(), row };
        }
        Ok(())
    }

    /// Applies `KEY=VALUE`; an empty value restores the default.
    fn assign(&mut self, text: &str) -> Result<()> {
        let (name, word) = text.split_once('=').unwrap_or((text, ""));
        let origin = Origin::Assignment(text.to_owned());
        let setting = self.find(name.trim(), false, &|| origin.place(name))?;
        setting.value = match word.trim() {
            "" => setting.key.default.clone(),
            word => Some(from_word(&setting.key, word, origin.place(name))?),
        };
        setting.origin = origin;
        Ok(())
    }

    /// Applies the value of a key's own flag, ignoring case.
    ///
    /// # Errors
    /// [`Error::Usage`] for an invalid value.
    pub(crate) fn flag(&mut self, name: &str, flag: &str, word: &str) -> Result<()> {
        let origin = Origin::Flag(flag.to_owned());
        let setting = self.find(name, false, &|| origin.place(name))?;
        let is_choice = matches!(setting.key.kind, KeyKind::Choice(_));
        let word = if is_choice { &*word.to_ascii_lowercase() } else { word };
        setting.value = Some(from_word(&setting.key, word, origin.place(name))?);
        setting.origin = origin;
        Ok(())
    }

    /// The setting of a key; the error for an unknown key or table is at `place`.
    fn find(&mut self, name: &str, is_table: bool, place: &dyn Fn() -> Place) -> Result<&mut Setting> {
        let known = self.0.iter().position(|setting| setting.key.name == name);
        known.map(|at| &mut self.0[at]).ok_or_else(|| unknown(place(), name, is_table))
    }

    /// The values that were set, including those equal to the default.
    pub(crate) fn given(&self) -> impl Iterator<Item = &Setting> {
        self.0.iter().filter(|setting| setting.origin != Origin::Default)
    }

    /// One key.
    pub(crate) fn get(&self, name: &str) -> Option<&Setting> {
        self.0.iter().find(|setting| setting.key.name == name)
    }

    /// The values as typed settings.
    ///
    /// # Errors
    /// As `MiningOptions::validate`, for values that contradict one another; [`Error::Internal`] if the types refuse what the
    /// checks accepted.
    pub(crate) fn settings(&self) -> Result<Settings> {
        let mut tree = Value::Object(serde_json::Map::new());
        for Setting { key, value, .. } in self.0.iter().filter(|setting| setting.value.is_some()) {
            *key.name.split('.').fold(&mut tree, |table, name| &mut table[name]) = value.clone().unwrap_or_default();
        }
        let refused = |e: serde_json::Error| Error::Internal(format!("a checked configuration is refused: {e}"));
        let settings: Settings = serde_json::from_value(tree).map_err(refused)?;
        settings.mining.validate()?;
        Ok(settings)
    }
}

/// Table and last word of a name.
fn split(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

/// The error for an unknown key or table.
fn unknown(place: Place, name: &str, is_table: bool) -> Error {
    let what = if is_table { "table" } else { "key" };
    let keys = Key::all();
    let mut names: Vec<&str> = keys.iter().map(|key| if is_table { split(&key.name).0 } else { &*key.name }).collect();
    names.sort_unstable();
    // Prefer the same table: a similar name in another table is rarely meant.
    let (table, wrong) = split(name);
    let siblings = names.iter().filter(|known| split(known).0 == table).map(|known| split(known).1);
    let near = nearest(wrong, siblings, 0.7)
        .and_then(|last| names.iter().find(|known| split(known) == (table, last)))
        .or_else(|| names.iter().find(|known| split(known).1 == wrong))
        .copied()
        .or_else(|| nearest(name, names.iter().copied(), 0.7));
    let help = match near {
        Some(known) => format!("did you mean `{known}`? `lanesweep config show` lists all keys"),
        None => "`lanesweep config show` lists all keys, `lanesweep config init -` explains them".to_owned(),
    };
    Error::usage(place, format!("there is no such {what}"), help)
}
