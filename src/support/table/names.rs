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

#[cfg(test)]
mod tests {
    use super::*;

    fn fields() -> Vec<Named> {
        [("id", ""), ("ego_v0", "m/s"), ("target_y", "m"), ("D", "m"), ("fps", "Hz"), ("ego_speed", "m/s")]
            .map(|(name, unit)| Named { name: name.to_owned(), unit, needs_unit: name == "ego_speed" })
            .into()
    }

    #[test]
    fn a_name_may_have_its_unit_and_kilometres_per_hour_are_converted() {
        let of = |name: &str| resolve(name, &fields());
        assert_eq!(of("ego.v0"), Resolved::Field(1, NameUnit::Customary));
        assert_eq!(of("ego_v0_mps"), Resolved::Field(1, NameUnit::Said(1.0)));
        assert_eq!(of(" ego_v0_kmh"), Resolved::Field(1, NameUnit::Said(3.6)));
        assert_eq!(of("d_m"), Resolved::Field(3, NameUnit::Said(1.0)));
        assert_eq!(of("ego_speed"), Resolved::Field(5, NameUnit::Needed));
        assert_eq!(of("weather"), Resolved::Unknown);
    }

    #[test]
    fn another_unit_is_named_with_what_to_write_instead() {
        let Resolved::WrongUnit(problem, help) = resolve("ego_v0_mph", &fields()) else { panic!("accepted") };
        assert!(problem.contains("miles per hour") && help.contains("`ego_v0_kmh`"), "{problem}; {help}");
        let Resolved::WrongUnit(problem, help) = resolve("target_y_kmh", &fields()) else { panic!("accepted") };
        assert!(problem.contains("km/h") && help.contains("`target_y_m`"), "{problem}; {help}");
    }

    #[test]
    fn a_misspelt_name_finds_its_neighbour_and_a_foreign_one_none() {
        let names = || ["ego_v0", "target_y", "lane_width"].into_iter();
        assert_eq!(nearest("lane_widht", names()), Some("lane_width"));
        assert_eq!(nearest("weather", names()), None);
    }
}
