//! The fields of a scenario as flat table columns (`ego_v0`, `target_v`, `lead_y`), and the mapping of a user's columns
//! to them.

use serde_json::{Map, Value};

use super::Category;
use super::schema::{Content, FIELDS, Field, Presence};
use super::units::{Unusable, Written, si};
use lanesweep_support::error::{Error, Result};
use lanesweep_support::table::{Column, ColumnKind, NameUnit, Named, Resolved, TableReader, nearest, resolve};

/// A field that is not a record.
pub(super) struct Leaf {
    /// Name of the column.
    pub flat: String,
    /// Record that contains it.
    pub record: Option<&'static str>,
    pub field: &'static Field,
    /// Whether every scenario needs it.
    pub is_required: bool,
}

/// Alternative column names, the field of each, and whether the value may change between instants although the field
/// describes the start.
const OTHER_NAMES: [(&str, &str, bool); 8] = [
    ("ego_speed", "ego_v0", true),
    ("target_speed", "target_v", false),
    ("target_lateral", "target_y", false),
    ("lead_speed", "lead_v", false),
    ("lead_lateral", "lead_y", false),
    ("thw", "thw0", true),
    ("gap", "gap0", true),
    ("lead_gap", "D", true),
];

/// All leaves, in the order of the scenario's fields.
pub(super) fn leaves() -> Vec<Leaf> {
    let mut leaves = Vec::new();
    for field in FIELDS {
        let is_required = field.presence == Presence::Required;
        match field.content {
            Content::Object(inner) => leaves.extend(inner.iter().map(|of| Leaf {
                flat: format!("{}_{}", field.name, of.name),
                record: Some(field.name),
                field: of,
                is_required: is_required && of.presence == Presence::Required,
            })),
            _ => leaves.push(Leaf { flat: field.name.to_owned(), record: None, field, is_required }),
        }
    }
    leaves
}

/// All column names: the leaves, then alternative names; each with its leaf and whether the value may change.
pub(super) fn names(leaves: &[Leaf]) -> Vec<(Named, usize, bool)> {
    let named =
        |name: &str, at: usize, needs_unit| Named { name: name.to_owned(), unit: leaves[at].field.unit, needs_unit };
    let own = leaves.iter().enumerate().map(|(at, leaf)| (named(&leaf.flat, at, false), at, false));
    // The program's own names are in m/s; other names do not say so.
    let other = OTHER_NAMES.iter().filter_map(|(name, of, may_change)| {
        let at = leaves.iter().position(|leaf| leaf.flat == *of)?;
        Some((named(name, at, leaves[at].field.unit == "m/s"), at, *may_change))
    });
    own.chain(other).collect()
}

impl Leaf {
    /// The column as it is written.
    pub(super) fn column(&self) -> Column {
        let kind = match self.field.content {
            Content::Text if self.flat == "id" => ColumnKind::Text,
            Content::Text | Content::OneOf(_) => ColumnKind::Name,
            Content::Number => ColumnKind::Binary64,
            Content::VehicleId | Content::Frame => ColumnKind::Whole,
            Content::TwoFrames => ColumnKind::Wholes,
            Content::YesNo => ColumnKind::Flag,
            Content::Series | Content::Object(_) => ColumnKind::Series,
        };
        let about = self.field.about;
        let description = match self.record {
            Some("target") => format!("Target: {}", uncapitalized(about)),
            Some("lead") => format!("Cut-out, vehicle ahead of the target: {}", uncapitalized(about)),
            _ => about.to_owned(),
        };
        Column::new(self.flat.clone(), kind, self.field.unit.to_owned(), description)
    }

    /// The leaf's value in the JSON of a scenario.
    pub(super) fn of<'a>(&self, scenario: &'a Value) -> &'a Value {
        let object = self.record.map_or(Some(scenario), |record| scenario.get(record));
        object.and_then(|object| object.get(self.field.name)).unwrap_or(&Value::Null)
    }

    /// Sets the leaf's value in the JSON of a scenario; null is skipped.
    pub(super) fn put(&self, scenario: &mut Map<String, Value>, value: Value) {
        if value.is_null() {
            return;
        }
        let Some(record) = self.record else {
            scenario.insert(self.field.name.to_owned(), value);
            return;
        };
        let record = scenario.entry(record).or_insert_with(|| Value::Object(Map::new()));
        if let Value::Object(record) = record {
            record.insert(self.field.name.to_owned(), value);
        }
    }

    /// Whether there is one value per sample.
    pub(super) fn is_series(&self) -> bool {
        matches!(self.field.content, Content::Series)
    }

    /// Converts a table value to the JSON of a scenario. Texts of CSV are converted to the field's type; a value that
    /// cannot be converted is kept, so that the field's check can show it.
    ///
    /// # Errors
    /// A number that lacks a unit.
    pub(super) fn typed(&self, value: Value, unit: NameUnit) -> std::result::Result<Value, Unusable> {
        let number = |value| number(value, self.field.unit, unit);
        Ok(match self.field.content {
            Content::Number => number(value)?,
            // The value of the series at one instant.
            Content::Series => match value {
                Value::Array(values) => values.into_iter().map(number).collect::<std::result::Result<_, _>>()?,
                one => number(one)?,
            },
            Content::VehicleId | Content::Frame => whole(value),
            Content::TwoFrames => match value {
                Value::String(text) => text.split_whitespace().map(|word| whole(Value::from(word))).collect(),
                Value::Array(values) => values.into_iter().map(whole).collect(),
                other => other,
            },
            Content::YesNo => yes_or_no(value),
            Content::OneOf(names) => match value {
                Value::String(text) => {
                    let lower = text.to_ascii_lowercase();
                    let category = Category::parse(&text).map(Category::key).filter(|key| names.contains(key));
                    Value::from(category.or(names.iter().copied().find(|name| *name == lower)).unwrap_or(&text))
                }
                other => other,
            },
            Content::Text => match value {
                // Some programs write ids as numbers.
                Value::Number(number) => Value::from(number.to_string()),
                other => other,
            },
            Content::Object(_) => value,
        })
    }
}

fn uncapitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_lowercase().chain(letters).collect())
}

/// A number in the field's unit; another value stays as it is.
///
/// # Errors
/// A number that lacks a unit.
pub(super) fn number(value: Value, field_unit: &str, unit: NameUnit) -> std::result::Result<Value, Unusable> {
    let written = match &value {
        Value::String(text) => Some(Written::Text(text)),
        Value::Number(number) => number.as_f64().map(Written::Number),
        _ => None,
    };
    match written.map(|written| si(written, field_unit, unit)) {
        Some(Ok(number)) => Ok(Value::from(number)),
        Some(Err(unusable)) if unusable.lacks_unit => Err(unusable),
        _ => Ok(value),
    }
}

/// Converts to an integer; some programs store columns with gaps as floating-point numbers.
fn whole(value: Value) -> Value {
    let parsed = match &value {
        Value::String(text) => text.trim().parse::<i64>().ok().or_else(|| text.trim().parse().ok().and_then(exactly)),
        Value::Number(number) => number.as_i64().or_else(|| number.as_f64().and_then(exactly)),
        _ => None,
    };
    parsed.map_or(value, Value::from)
}

fn exactly(number: f64) -> Option<i64> {
    (number.fract() == 0.0 && number.abs() < 9e15).then_some(number as i64)
}

fn yes_or_no(value: Value) -> Value {
    match value.as_str().map_or_else(|| value.to_string(), str::to_ascii_lowercase).as_str() {
        "true" | "yes" | "1" | "1.0" => Value::from(true),
        "false" | "no" | "0" | "0.0" => Value::from(false),
        _ => value,
    }
}

/// What the columns of a table are.
pub const HELP: &str = "cases have the flags of `simulate --help` with `_`, scenarios the columns that `mine` writes; the book's chapter on tables lists both";

/// Maps the columns of a table to fields and selects the known ones.
///
/// # Errors
/// [`Error::Input`] for a column in an unusable unit, for two columns of one field, and for an unknown name close to
/// that of a missing field, and for a table of lanes or of series if it is refused.
pub(super) fn choose(
    table: &mut TableReader,
    known: &[Named],
    field_of: impl Fn(usize) -> usize,
    takes_series: bool,
) -> Result<Vec<Chosen>> {
    let mut chosen: Vec<Chosen> = Vec::new();
    let mut unknown = Vec::new();
    for (at, column) in table.columns().iter().enumerate() {
        let refused = |problem: String, help: String| Err(Error::input(table.header().column(column), problem, help));
        match resolve(column, known) {
            Resolved::Field(known, unit) => {
                let field = field_of(known);
                if let Some(other) = chosen.iter().find(|other| other.field == field) {
                    let problem = format!("holds the same as the column `{}`", other.column);
                    return refused(problem, "remove one of the two".to_owned());
                }
                chosen.push(Chosen { at, column: column.clone(), known, field, unit });
            }
            Resolved::WrongUnit(problem, help) => return refused(problem, help),
            // The index column that pandas writes.
            Resolved::Unknown if column.is_empty() || column.starts_with("__") || column.starts_with("Unnamed") => {}
            Resolved::Unknown => unknown.push(column),
        }
    }
    // A lane has a verdict per criterion, a scenario has series of a target; a case has neither.
    let has = |name: &&str| unknown.iter().any(|column| column.replace('.', "_").starts_with(name));
    let (lanes, series) = (["collision", "ttc"], ["target_v", "target_y", "target_speed", "target_lateral"]);
    let wrong = match (takes_series, lanes.iter().all(has), series.iter().any(has)) {
        (false, true, _) => Some(("lanes, not of scenarios", "give a scenario file, such as `lanesweep mine` writes")),
        (false, _, true) => Some((
            "scenarios with series, not of cases",
            "give it to `study --scenarios`, or name one of its scenarios (`check FILE --scenario ID`)",
        )),
        _ => None,
    };
    if let Some((kind, help)) = wrong {
        return Err(Error::input(table.header(), format!("this is a table of {kind}"), help));
    }
    let mut unused = Vec::new();
    for column in unknown {
        let missing = (0..known.len()).filter(|&at| !chosen.iter().any(|other| other.field == field_of(at)));
        let near = nearest(column, missing.map(|at| known[at].name.as_str()));
        let help = match near {
            Some(near) => format!("did you mean `{near}`? {HELP}"),
            None => {
                unused.push(column.as_str());
                continue;
            }
        };
        return Err(Error::input(table.header().column(column), "there is no such column", help));
    }
    table.tell_unused(&unused);
    let at: Vec<usize> = chosen.iter().map(|column| column.at).collect();
    table.rows.want(&at)?;
    Ok(chosen)
}

/// A column with a known field.
pub(super) struct Chosen {
    pub at: usize,
    /// Name in the file.
    pub column: String,
    /// Index of the name that it matched.
    pub known: usize,
    pub field: usize,
    /// Unit of its plain numbers.
    pub unit: NameUnit,
}
