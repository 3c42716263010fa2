//! Ranges of settings. A range is declared at its field (`#[schemars(range(…))]`); the schema, the configuration, the
//! flags and the types' own checks read it there.
//!
//! Lists of settings hold every value once: a repeated headway or model would count its failures twice and give two
//! lanes the same key.

use std::collections::HashMap;
use std::fmt::{self, Display};
use std::hash::Hash;

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde_json::Value;

use crate::{Error, Place, Result};

/// Valid numbers of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Only integers.
    pub is_whole: bool,
    /// Minimum, and whether it is excluded.
    pub min: Option<(f64, bool)>,
    /// Maximum, and whether it is excluded.
    pub max: Option<(f64, bool)>,
}

impl Range {
    /// The range in the schema of a number.
    pub fn of(property: &Value) -> Range {
        let bound = |closed: &str, open: &str| {
            let closed = property[closed].as_f64().map(|x| (x, false));
            property[open].as_f64().map(|x| (x, true)).or(closed)
        };
        Range {
            is_whole: property["type"] == "integer",
            min: bound("minimum", "exclusiveMinimum"),
            max: bound("maximum", "exclusiveMaximum"),
        }
    }

    /// Whether the value is in the range; false for NaN.
    pub fn contains(&self, x: f64) -> bool {
        x.is_finite()
            && self.min.is_none_or(|(limit, open)| if open { x > limit } else { x >= limit })
            && self.max.is_none_or(|(limit, open)| if open { x < limit } else { x <= limit })
    }
}

/// In words: `a number above 0 and at most 1000000`.
impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_whole { "a whole number" } else { "a number" })?;
        if let (Some((low, false)), Some((high, false))) = (self.min, self.max) {
            return write!(f, " from {low} to {high}");
        }
        if let Some((low, open)) = self.min {
            write!(f, " {} {low}", if open { "above" } else { "of at least" })?;
        }
        if let Some((high, open)) = self.max {
            let and = if self.min.is_some() { " and" } else { "" };
            write!(f, "{and} {} {high}", if open { "below" } else { "at most" })?;
        }
        Ok(())
    }
}

/// The JSON Schema (draft 2020-12) of settings, without references.
pub fn schema_of<T: JsonSchema>() -> Value {
    let settings = SchemaSettings::draft2020_12().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>().to_value()
}

/// Checks every number of a table of settings.
///
/// # Errors
/// [`Error::Usage`] naming the first key whose value is not finite or outside the range of its field.
pub fn check<T: Serialize + JsonSchema>(table: &str, settings: &T) -> Result<()> {
    let value =
        serde_json::to_value(settings).map_err(|e| Error::Internal(format!("settings cannot be written: {e}")))?;
    check_value(table, &value, &schema_of::<T>())
}

fn check_value(name: &str, value: &Value, schema: &Value) -> Result<()> {
    if let Value::Object(table) = value {
        return table
            .iter()
            .try_for_each(|(key, value)| check_value(&format!("{name}.{key}"), value, &schema["properties"][key]));
    }
    let is_number = matches!(schema["type"].as_str(), Some("number" | "integer"));
    let range = Range::of(schema);
    // JSON writes NaN and infinity as null.
    if !is_number || value.as_f64().is_some_and(|x| range.contains(x)) {
        return Ok(());
    }
    let found = if value.is_null() { "a value that is not finite".to_owned() } else { value.to_string() };
    Err(Error::usage(Place::item(name), format!("{found} cannot be used"), format!("give {range}")))
}

/// Checks that no value of a list, of pairs of a value and its text, repeats an earlier one: `0.60` repeats `0.6`.
///
/// # Errors
/// [`Error::Usage`] at `place`.
pub fn refuse_repeats<K: Eq + Hash, S: Display>(
    place: impl FnOnce() -> Place,
    list: impl IntoIterator<Item = (K, S)>,
) -> Result<()> {
    let mut known: HashMap<K, S> = HashMap::new();
    for (meaning, written) in list {
        if let Some(before) = known.get(&meaning) {
            let (before, written) = (before.to_string(), written.to_string());
            let problem = match before == written {
                true => format!("`{written}` is given twice"),
                false => format!("`{written}` repeats `{before}`"),
            };
            return Err(Error::usage(place(), problem, "give every value once"));
        }
        known.insert(meaning, written);
    }
    Ok(())
}

/// Declares tables of the configuration, as [`settings!`](crate::settings) does, with what reads them, writes them and makes
/// their schema.
#[macro_export]
macro_rules! config_tables {
    ($($(#[$about:meta])* $vis:vis struct $table:ident { $($fields:tt)* })*) => {
        $crate::settings! {$(
            #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
            #[serde(deny_unknown_fields, default)]
            $(#[$about])*
            $vis struct $table { $($fields)* }
        )*}
    };
}

/// Declares tables of settings, with the default of each field: `pub window_s: f64 = 1.0,`.
#[macro_export]
macro_rules! settings {
    ($($(#[$about:meta])* $vis:vis struct $table:ident {
        $($(#[$about_field:meta])* $vis_field:vis $field:ident: $of:ty = $default:expr,)*
    })*) => {$(
        $(#[$about])*
        $vis struct $table {
            $($(#[$about_field])* $vis_field $field: $of,)*
        }

        impl Default for $table {
            fn default() -> Self {
                $table { $($field: $default,)* }
            }
        }
    )*};
}
