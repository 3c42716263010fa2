//! Maps a column of a user's table to a field by its name, with or without the unit at the end.

use crate::plain_text;

/// A field that a table can have.
#[derive(Debug, Clone)]
pub struct Named {
    /// Name without a unit.
    pub name: String,
    /// Unit; empty for fields that are not numbers, `1` for a dimensionless number.
    pub unit: &'static str,
    /// Whether a plain number means nothing without a unit: speeds along the road are written in km/h and in m/s.
    pub needs_unit: bool,
}

/// The unit of the plain numbers under a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NameUnit {
    /// The name says it: divide by this to convert to the field's unit.
    Said(f64),
    /// The name does not say it; it is the field's unit.
    Customary,
    /// The name does not say it, and the field needs one: every number must have its own.
    Needed,
}

/// Unit suffixes of names.
const SUFFIXES: [(&str, &str); 17] = [
    ("mps", "m/s"),
    ("kmh", "km/h"),
    ("mps2", "m/s²"),
    ("m", "m"),
    ("s", "s"),
    ("hz", "Hz"),
    ("mph", "miles per hour"),
    ("kph", "km/h"),
    ("km", "km"),
    ("cm", "cm"),
    ("mm", "mm"),
    ("ft", "feet"),
    ("ms", "milliseconds"),
    ("min", "minutes"),
    ("g", "g"),
    ("deg", "degrees"),
    ("rad", "radians"),
];

/// The field of a column.
#[derive(Debug, PartialEq)]
pub enum Resolved {
    /// Index of the field, and the unit of its plain numbers.
    Field(usize, NameUnit),
    /// A field, but in an unusable unit: the problem and what to do.
    WrongUnit(String, String),
    /// No field.
    Unknown,
}

/// Finds the field of a column. Dots count as underscores, so that JSON names (`ego.v0`) are accepted.
pub fn resolve(column: &str, fields: &[Named]) -> Resolved {
    let folded = column.trim().replace('.', "_").to_ascii_lowercase();
    let is = |field: &Named| field.name.eq_ignore_ascii_case(&folded);
    if let Some(at) = fields.iter().position(is) {
        return Resolved::Field(at, if fields[at].needs_unit { NameUnit::Needed } else { NameUnit::Customary });
    }
    for (at, field) in fields.iter().enumerate() {
        let Some(rest) = folded.strip_prefix(&field.name.to_ascii_lowercase()).and_then(|rest| rest.strip_prefix('_'))
        else {
            continue;
        };
        let Some((_, unit)) = SUFFIXES.iter().find(|(suffix, _)| *suffix == rest) else { continue };
        if *unit == field.unit {
            return Resolved::Field(at, NameUnit::Said(1.0));
        }
        if *unit == "km/h" && field.unit == "m/s" {
            return Resolved::Field(at, NameUnit::Said(3.6));
        }
        let suffix = SUFFIXES.iter().find(|(_, unit)| *unit == field.unit).map_or("", |(suffix, _)| suffix);
        let wanted = match field.unit {
            "" => format!("`{}` is not a number and has no unit", field.name),
            "m/s" => format!("convert it and call it `{0}_mps` (m/s) or `{0}_kmh` (km/h)", field.name),
            unit => format!("convert it to {unit} and call it `{}_{suffix}`", field.name),
        };
        return Resolved::WrongUnit(format!("its name says {unit}, which cannot be used here"), wanted);
    }
    Resolved::Unknown
}

/// The known name most similar to an unknown one, if any.
pub fn nearest<'a>(column: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    plain_text::nearest(column, names, 0.8)
}
