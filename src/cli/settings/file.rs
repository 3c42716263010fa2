//! Reads a configuration file, each value with its line.

use std::path::Path;

use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::keys::{Key, from_toml, nearest};
use lanesweep_support::input_file;
use lanesweep_support::plain_text::cut;
use lanesweep_support::{Error, Place, Result};

/// Maximum length of a key with its tables, bytes.
const MAX_KEY_BYTES: usize = 200;

/// A value of a file.
#[derive(Debug)]
pub(super) struct Line {
    pub key: String,
    pub value: Value,
    pub row: u64,
}

/// Reads the values of a file.
///
/// # Errors
/// [`Error::Usage`] with the line: invalid TOML, an unknown table or key, or an invalid value. [`Error::Io`];
/// [`Error::Input`] if it is not a text file or is too large.
pub(super) fn read(path: &Path, keys: &[Key]) -> Result<Vec<Line>> {
    parse(&input_file::read_text(path, input_file::MAX_SETTINGS_BYTES)?, &Place::file(path), keys)
}

/// Parses the values in a text; errors name `place`.
pub(super) fn parse(text: &str, place: &Place, keys: &[Key]) -> Result<Vec<Line>> {
    let reader = Reader { text, place, keys };
    let table = DeTable::parse(text).map_err(|e| {
        let place = e.span().map_or(place.clone(), |span| place.clone().row(reader.row(span.start)));
        Error::usage(place, e.message().to_owned(), "`lanesweep config init -` prints a file that works")
    })?;
    let mut lines = Vec::new();
    reader.table(table.get_ref(), "", &mut lines)?;
    lines.sort_by_key(|line| line.row);
    Ok(lines)
}

struct Reader<'a> {
    text: &'a str,
    place: &'a Place,
    keys: &'a [Key],
}

impl Reader<'_> {
    fn row(&self, at: usize) -> u64 {
        1 + self.text.bytes().take(at).filter(|&byte| byte == b'\n').count() as u64
    }

    fn table(&self, table: &DeTable, prefix: &str, lines: &mut Vec<Line>) -> Result<()> {
        for (name, value) in table {
            let row = self.row(name.span().start);
            let key = if prefix.is_empty() {
                name.get_ref().to_string()
            } else {
                format!("{prefix}.{name}", name = name.get_ref())
            };
            self.entry(&key, value, row, lines)?;
        }
        Ok(())
    }

    fn entry(&self, name: &str, value: &Spanned<DeValue>, row: u64, lines: &mut Vec<Line>) -> Result<()> {
        let place = || self.place.clone().row(row).of(format!("`{}`", cut(name)));
        if name.len() > MAX_KEY_BYTES {
            let problem = format!("this key has {} bytes; the longest one has {MAX_KEY_BYTES}", name.len());
            return Err(Error::usage(place(), problem, "`lanesweep config show` lists all keys"));
        }
        let below = format!("{name}.");
        if self.keys.iter().any(|key| key.name.starts_with(&below)) {
            let DeValue::Table(inner) = value.get_ref() else {
                return Err(Error::usage(
                    place(),
                    "this is a table, not a key",
                    format!("write [{name}], and its keys below"),
                ));
            };
            return self.table(inner, name, lines);
        }
        let Some(key) = Key::find(self.keys, name) else {
            return Err(unknown(place(), name, matches!(value.get_ref(), DeValue::Table(_)), self.keys));
        };
        let value = from_toml(key, value.get_ref(), place())?;
        lines.push(Line { key: key.name.clone(), value, row });
        Ok(())
    }
}

/// The error for an unknown key or table.
pub(super) fn unknown(place: Place, name: &str, is_table: bool, keys: &[Key]) -> Error {
    let table_of = |name: &str| name.rsplit_once('.').map_or(String::new(), |(table, _)| table.to_owned());
    let what = if is_table { "table" } else { "key" };
    let mut names: Vec<String> = match is_table {
        true => keys.iter().map(|key| table_of(&key.name)).collect(),
        false => keys.iter().map(|key| key.name.clone()).collect(),
    };
    names.sort();
    names.dedup();
    // Prefer the same table: a similar name in another table is rarely meant.
    let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
    let siblings: Vec<&String> = names.iter().filter(|known| table_of(known) == table_of(name)).collect();
    let near_last: Vec<(String, &String)> = siblings.into_iter().map(|known| (last(known), known)).collect();
    let wrong = last(name);
    let near = nearest(&wrong, near_last.iter().map(|(last, _)| last.as_str()))
        .and_then(|word| near_last.iter().find(|(last, _)| last == word).map(|(_, known)| known.as_str()))
        .or_else(|| names.iter().map(String::as_str).find(|known| last(known) == wrong))
        .or_else(|| nearest(name, names.iter().map(String::as_str)));
    let help = match near {
        Some(known) => format!("did you mean `{known}`? `lanesweep config show` lists all keys"),
        None => "`lanesweep config show` lists all keys, `lanesweep config init -` explains them".to_owned(),
    };
    Error::usage(place, format!("there is no such {what}"), help)
}

/// Variable that names the configuration file if `--config` names none.
pub(crate) const FILE_VARIABLE: &str = "LANESWEEP_CONFIG";
