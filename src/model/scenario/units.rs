//! Numbers as users write them: with a unit in the value, in the name (`ego_speed_kmh`), or without one. One rule for
//! flags, files of a case, tables and Python.

use lanesweep_support::readable::value;
use lanesweep_support::table::NameUnit;

/// A unit in lower case, and its number per SI unit.
type Unit = (&'static str, f64);

const SPEEDS: &[Unit] =
    &[("km/h", 3.6), ("kmh", 3.6), ("kph", 3.6), ("mph", 1.0 / 0.44704), ("m/s", 1.0), ("mps", 1.0)];
const ACCELERATIONS: &[Unit] = &[("m/s2", 1.0), ("m/s²", 1.0), ("m/s^2", 1.0), ("mps2", 1.0)];

/// Standard gravity, m/s².
const G_MPS2: f64 = 9.80665;

/// A number as it is written.
#[derive(Debug, Clone, Copy)]
pub enum Written<'a> {
    /// Without a unit of its own.
    Number(f64),
    /// As a text, with or without a unit.
    Text(&'a str),
}

/// Why a written number cannot be used.
#[derive(Debug, Clone, PartialEq)]
pub struct Unusable {
    /// What is wrong.
    pub problem: String,
    /// What to write as the value.
    pub write: String,
    /// Whether a name with a unit would do too.
    pub lacks_unit: bool,
}

impl Unusable {
    /// What to do where the value has a name.
    pub(super) fn help(&self, name: &str) -> String {
        let Unusable { write, .. } = self;
        match self.lacks_unit {
            true => format!("call it `{name}_kmh` or `{name}_mps`, or write {write}"),
            false => format!("write {write}"),
        }
    }
}

/// Converts a written number to SI units. `unit` is the SI unit, as [`NameUnit`] says how plain numbers are read.
///
/// # Errors
/// A text that does not give such a quantity; a unit that contradicts the name's; a number without a unit that needs one,
/// except 0.
pub fn si(written: Written<'_>, unit: &str, name: NameUnit) -> Result<f64, Unusable> {
    let (number, own) = match written {
        Written::Number(number) => (number, None),
        Written::Text(text) => parse(text, units_of(unit)).ok_or_else(|| not_such(text, unit))?,
    };
    match (own, name) {
        (Some(own), NameUnit::Said(said)) if own != said => Err(Unusable {
            problem: format!("is {}, but its name says another unit", quoted(written)),
            write: "the unit in one of the two".to_owned(),
            lacks_unit: false,
        }),
        (Some(per_si), _) | (None, NameUnit::Said(per_si)) => Ok(number / per_si),
        (None, NameUnit::Customary) => Ok(number),
        (None, NameUnit::Needed) if number == 0.0 => Ok(number),
        (None, NameUnit::Needed) => Err(Unusable {
            problem: format!(
                "{number} has no unit: as m/s it is {} km/h, as km/h {} m/s",
                value(number * 3.6),
                value(number / 3.6)
            ),
            write: format!("{number}km/h or {number}m/s"),
            lacks_unit: true,
        }),
    }
}

fn quoted(written: Written<'_>) -> String {
    match written {
        Written::Number(number) => number.to_string(),
        Written::Text(text) => format!("{text:?}"),
    }
}

/// The ways to write an SI unit.
fn units_of(unit: &str) -> &'static [Unit] {
    match unit {
        "m/s" => SPEEDS,
        "m/s²" => ACCELERATIONS,
        "m" => &[("m", 1.0)],
        "s" => &[("s", 1.0)],
        "Hz" => &[("hz", 1.0)],
        _ => &[],
    }
}

/// A finite number, and its unit's number per SI unit if it has one.
fn parse(text: &str, units: &[Unit]) -> Option<(f64, Option<f64>)> {
    let text = text.trim().to_lowercase();
    let with_unit = units.iter().find_map(|(unit, per_si)| Some((text.strip_suffix(unit)?, *per_si)));
    let number = with_unit.map_or(text.as_str(), |(number, _)| number);
    let number = number.trim_end().parse::<f64>().ok().filter(|number| number.is_finite())?;
    Some((number, with_unit.map(|(_, per_si)| per_si)))
}

/// The error for a text that does not give such a quantity.
fn not_such(text: &str, unit: &str) -> Unusable {
    let write = match (unit, parse(text, &[("g", 1.0)])) {
        // -6g often means -6 m/s².
        ("m/s²", Some((g, Some(_)))) => {
            format!("m/s²: {}m/s2 if {g} g is meant, {g}m/s2 otherwise", value(g * G_MPS2))
        }
        ("m/s²", _) => "an acceleration in m/s², such as -5 or -5m/s2".to_owned(),
        ("m/s", _) => "a speed such as 60km/h, 37mph or 16.7m/s".to_owned(),
        ("m", _) => "a length in metres, such as 12 or 12m".to_owned(),
        ("s", _) => "a time in seconds, such as 1.2 or 1.2s".to_owned(),
        _ => "a number".to_owned(),
    };
    Unusable { problem: format!("is {text:?}"), write, lacks_unit: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str, unit: &str, name: NameUnit) -> Result<f64, Unusable> {
        si(Written::Text(text), unit, name)
    }

    #[test]
    fn a_speed_has_the_same_value_wherever_its_unit_stands() {
        let (said, needed) = (NameUnit::Said(3.6), NameUnit::Needed);
        for (written, name) in [
            (Written::Text("90km/h"), needed),
            (Written::Text(" 90 KM/H "), needed),
            (Written::Text("90kph"), said),
            (Written::Text("90"), said),
            (Written::Number(90.0), said),
            (Written::Text("25m/s"), needed),
            (Written::Number(25.0), NameUnit::Said(1.0)),
        ] {
            assert_eq!(si(written, "m/s", name), Ok(25.0), "{written:?}");
        }
        assert!((text("37mph", "m/s", needed).unwrap() - 16.540_48).abs() < 1e-12);
        assert_eq!(si(Written::Number(0.0), "m/s", needed), Ok(0.0), "0 is 0 in every unit");
        assert_eq!(text("-0", "m/s", needed), Ok(-0.0));
    }

    #[test]
    fn a_speed_without_a_unit_is_refused_with_both_readings() {
        for written in [Written::Number(60.0), Written::Text("60")] {
            let refused = si(written, "m/s", NameUnit::Needed).unwrap_err();
            assert_eq!(refused.problem, "60 has no unit: as m/s it is 216 km/h, as km/h 16.67 m/s");
            let help = "call it `ego_speed_kmh` or `ego_speed_mps`, or write 60km/h or 60m/s";
            assert_eq!(refused.help("ego_speed"), help);
        }
        let contradicts = text("60km/h", "m/s", NameUnit::Said(1.0)).unwrap_err();
        assert!(contradicts.problem.contains("its name says another unit"), "{contradicts:?}");
    }

    #[test]
    fn a_quantity_with_one_customary_unit_needs_none_and_takes_no_other() {
        for (number, unit, si_value) in [
            ("12", "m", 12.0),
            ("12m", "m", 12.0),
            ("1.2 s", "s", 1.2),
            ("-5m/s2", "m/s²", -5.0),
            ("25 Hz", "Hz", 25.0),
        ] {
            assert_eq!(text(number, unit, NameUnit::Customary), Ok(si_value), "{number}");
        }
        for (number, unit) in [
            ("12km", "m"),
            ("1200ms", "s"),
            ("12s", "m"),
            ("-5km/h", "m/s²"),
            ("60m", "m/s"),
            ("inf", "m"),
            ("1,2", "s"),
        ] {
            assert!(text(number, unit, NameUnit::Customary).is_err(), "{number}");
        }
        let gravity = text("-0.6g", "m/s²", NameUnit::Customary).unwrap_err();
        assert!(gravity.write.contains("-5.884m/s2 if -0.6 g is meant"), "{gravity:?}");
    }
}
