//! A concrete case from flags, a TOML file or a row of a table.

use std::path::Path;

use clap::Args;
use serde::Deserialize;

use crate::engine::Headway;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::reopen::TracedCase;
use crate::scenario::{CaseParameters, ParameterRows, PlainCase, RowPlace};
use crate::support::input_file;
use crate::support::plausibility::{Doubts, Implausible};
use crate::support::readable::value;
use crate::support::table::{TableFormat, TableReader};
use crate::{Error, Place, Result};

/// A case in words. Speeds in m/s, lengths in m, accelerations in m/s², times in s.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Args)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CaseFlags {
    /// Kind of scenario: cut-in, cut-out, lvd
    #[arg(long, value_name = "NAME", help_heading = "Scenario")]
    category: Option<String>,
    #[arg(long, value_name = "LIST", help = super::lists::models_help(), help_heading = "Models and criteria")]
    models: Option<String>,
    /// Initial speed of the ego
    #[arg(long, value_name = "m/s", value_parser = speed_mps, help_heading = "Scenario")]
    ego_speed: Option<f64>,
    /// Initial speed of the other vehicle [default: the ego's]
    #[arg(long, value_name = "m/s", value_parser = speed_mps, help_heading = "Scenario")]
    speed: Option<f64>,
    /// Initial gap, bumper to bumper
    #[arg(long, value_name = "m", value_parser = length_m, conflicts_with = "thw", help_heading = "Scenario")]
    gap: Option<f64>,
    /// Initial time headway instead of the gap
    #[arg(long, value_name = "s", value_parser = time_s, help_heading = "Scenario")]
    thw: Option<f64>,
    /// Cut-in, cut-out: lateral speed
    #[arg(long, value_name = "m/s", value_parser = speed_mps, help_heading = "Scenario")]
    lateral_speed: Option<f64>,
    /// Cut-in: lateral distance at the start; cut-out: at the end [default: 3.5]
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario", hide_short_help = true)]
    lateral_distance: Option<f64>,
    /// Acceleration of the other vehicle; an LVD needs one [default: 0]
    #[arg(long, value_name = "m/s²", value_parser = acceleration_mps2, allow_hyphen_values = true, help_heading = "Scenario")]
    acceleration: Option<f64>,
    /// Speed at which the acceleration ends [default: standstill, or never]
    #[arg(long, value_name = "m/s", value_parser = speed_mps, help_heading = "Scenario", hide_short_help = true)]
    end_speed: Option<f64>,
    /// Cut-out: speed of the vehicle ahead of the cutting-out one [default: 0]
    #[arg(long, value_name = "m/s", value_parser = speed_mps, help_heading = "Scenario", hide_short_help = true)]
    ahead_speed: Option<f64>,
    /// Cut-out: gap between the two, bumper to bumper
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario")]
    ahead_gap: Option<f64>,
    /// Length of every vehicle [default: the profile's]
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario", hide_short_help = true)]
    length: Option<f64>,
    /// Width of every vehicle [default: the profile's]
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario", hide_short_help = true)]
    width: Option<f64>,
    /// Only in files: time after which the other vehicles keep their speed and lateral position, s.
    #[arg(skip)]
    duration: Option<f64>,
    /// The place of a table's values.
    #[arg(skip)]
    #[serde(skip)]
    row: Option<RowPlace>,
}

impl CaseFlags {
    /// Values of `self` where given, otherwise those of `other`.
    pub(super) fn over(&self, other: CaseFlags) -> CaseFlags {
        // A gap on the command line replaces a headway of the file, and vice versa.
        let (gap, thw) = match (self.gap, self.thw) {
            (None, None) => (other.gap, other.thw),
            typed => typed,
        };
        CaseFlags {
            category: self.category.clone().or(other.category),
            models: self.models.clone().or(other.models),
            ego_speed: self.ego_speed.or(other.ego_speed),
            speed: self.speed.or(other.speed),
            gap,
            thw,
            lateral_speed: self.lateral_speed.or(other.lateral_speed),
            lateral_distance: self.lateral_distance.or(other.lateral_distance),
            acceleration: self.acceleration.or(other.acceleration),
            end_speed: self.end_speed.or(other.end_speed),
            ahead_speed: self.ahead_speed.or(other.ahead_speed),
            ahead_gap: self.ahead_gap.or(other.ahead_gap),
            length: self.length.or(other.length),
            width: self.width.or(other.width),
            duration: other.duration,
            row: other.row.map(|row| row.without(&self.parameters().given())),
        }
    }

    /// Adds the place of a table's value to its error.
    fn located<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|error| match &self.row {
            Some(row) => row.locate(error),
            None => error,
        })
    }

    /// Whether it gives any value of the case.
    pub(super) fn says_a_case(&self) -> bool {
        CaseFlags { models: None, row: None, ..self.clone() } != CaseFlags::default()
    }

    /// Whether it gives the ego's start.
    pub(super) fn says_a_start(&self) -> bool {
        self.gap.is_some() || self.thw.is_some()
    }

    /// Whether it gives a value of the case other than the ego's start.
    pub(super) fn says_more_than_a_start(&self) -> bool {
        CaseFlags { gap: None, thw: None, ..self.clone() }.says_a_case()
    }

    /// The named models; `None` if none is named.
    pub(super) fn named_models(&self) -> Result<Option<Vec<ModelId>>> {
        self.models.as_ref().map(|_| self.models()).transpose()
    }

    /// The named models in the given order; all if none is named.
    fn models(&self) -> Result<Vec<ModelId>> {
        let names = self.models.iter().flat_map(|list| list.split(','));
        self.located(super::lists::models(names, "models"))
    }

    pub(super) fn headway(&self) -> Result<Headway> {
        let parameters = self.parameters();
        self.located(parameters.check_start())?;
        parameters.gap.map(Headway::GapM).or(parameters.thw.map(Headway::thw)).ok_or_else(|| {
            Error::usage(
                Place::item("gap, thw"),
                "the initial distance is missing",
                "give --gap in metres or --thw in seconds",
            )
        })
    }

    /// Runs the case with each of its models; warns about doubtful values.
    pub(super) fn traced(&self, profile: &Profile, implausible: Implausible) -> Result<TracedCase> {
        let case = self.located(self.plain_case(profile, implausible)?.case(profile.frame.time_cap_s))?;
        TracedCase::run(&case, self.headway()?, profile, &self.models()?)
    }

    /// The numbers of the case; warns about doubtful values.
    pub(super) fn plain_case(&self, profile: &Profile, implausible: Implausible) -> Result<PlainCase> {
        self.located(self.checked(profile, implausible))
    }

    fn checked(&self, profile: &Profile, implausible: Implausible) -> Result<PlainCase> {
        let mut doubts = Doubts::new(implausible);
        let plain = self.parameters().checked_case(&profile.frame, &mut doubts)?;
        self.headway()?;
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        Ok(plain)
    }

    fn parameters(&self) -> CaseParameters {
        CaseParameters {
            category: self.category.clone(),
            ego_speed: self.ego_speed,
            speed: self.speed,
            gap: self.gap,
            thw: self.thw,
            lateral_speed: self.lateral_speed,
            lateral_distance: self.lateral_distance,
            acceleration: self.acceleration,
            end_speed: self.end_speed,
            ahead_speed: self.ahead_speed,
            ahead_gap: self.ahead_gap,
            length: self.length,
            width: self.width,
            duration: self.duration,
        }
    }
}

/// A unit, and its number per SI unit.
type Unit = (&'static str, f64);

/// Units of a speed.
const SPEEDS: [Unit; 6] =
    [("km/h", 3.6), ("kmh", 3.6), ("kph", 3.6), ("mph", 1.0 / 0.44704), ("m/s", 1.0), ("mps", 1.0)];
/// Units of an acceleration.
const ACCELERATIONS: [Unit; 4] = [("m/s2", 1.0), ("m/s²", 1.0), ("m/s^2", 1.0), ("mps2", 1.0)];

/// A speed above this needs a unit, m/s: it is 162 km/h, or 45 km/h without its unit.
const UNITLESS_MPS: f64 = 45.0;

/// A number in SI units, and whether it has a unit.
fn si(text: &str, units: &[Unit]) -> Option<(f64, bool)> {
    let text = text.trim();
    let with_unit = units.iter().find_map(|(unit, per_si)| Some((text.strip_suffix(unit)?, *per_si)));
    let (number, per_si) = with_unit.unwrap_or((text, 1.0));
    let value = number.trim_end().parse::<f64>().ok().filter(|value| value.is_finite())?;
    Some((value / per_si, with_unit.is_some()))
}

/// A speed in m/s, from a number (m/s) or a number with its unit: `16.7`, `60km/h`, `37 mph`.
///
/// # Errors
/// What to write, if the text is not a speed, or if a number without a unit is too high for a car in m/s.
fn speed_mps(text: &str) -> std::result::Result<f64, String> {
    match si(text, &SPEEDS) {
        Some((speed, false)) if speed > UNITLESS_MPS => Err(format!(
            "{speed} has no unit: as m/s it is {} km/h; write {speed}km/h or {speed}m/s",
            value(speed * 3.6)
        )),
        Some((speed, _)) => Ok(speed),
        None => Err("write a speed such as 16.7, 60km/h or 37mph".to_owned()),
    }
}

/// A length in m: `12`, `12m`.
fn length_m(text: &str) -> std::result::Result<f64, String> {
    let found = si(text, &[("m", 1.0)]).map(|(length, _)| length);
    found.ok_or_else(|| "write a length in metres, such as 12 or 12m".to_owned())
}

/// A time in s: `1.2`, `1.2s`.
fn time_s(text: &str) -> std::result::Result<f64, String> {
    let found = si(text, &[("s", 1.0)]).map(|(time, _)| time);
    found.ok_or_else(|| "write a time in seconds, such as 1.2 or 1.2s".to_owned())
}

/// An acceleration in m/s²: `-5`, `-5m/s2`. Multiples of g are refused with their value: -6g often means -6 m/s².
fn acceleration_mps2(text: &str) -> std::result::Result<f64, String> {
    const G_MPS2: f64 = 9.80665;
    if let Some((g, true)) = si(text, &[("g", 1.0)]) {
        return Err(format!("write m/s²: {}m/s2 if {g} g is meant, {g}m/s2 otherwise", value(g * G_MPS2)));
    }
    let found = si(text, &ACCELERATIONS).map(|(acceleration, _)| acceleration);
    found.ok_or_else(|| "write an acceleration in m/s², such as -5 or -5m/s2".to_owned())
}

/// Reads the flags from a TOML file.
pub(super) fn from_toml(path: &Path) -> Result<CaseFlags> {
    input_file::read_toml(path, "the keys are the flags of `simulate --help` with `_`")
}

/// Reads the flags from a row of a CSV or Parquet table; rows count from 1 after the header.
pub(super) fn from_table(path: &Path, row: usize) -> Result<CaseFlags> {
    let format = TableFormat::of(path, &[TableFormat::Csv, TableFormat::Parquet], "--table")?;
    let mut rows = ParameterRows::new(TableReader::open(path, format)?)?;
    let missing =
        || Error::usage(Place::file(path), format!("there is no row {row}"), "rows count from 1 after the header");
    for _ in 1..row {
        drop(rows.next_row()?.ok_or_else(missing)?);
    }
    let (line, found) = if row == 0 { None } else { rows.next_row()? }.ok_or_else(missing)?;
    let mut found = found?;
    // Only tables of scenarios use these: a single run has no key and no samples.
    ["id", "rate"].iter().for_each(|key| drop(found.remove(*key)));
    let flags: CaseFlags = serde_json::from_value(serde_json::Value::Object(found))
        .map_err(|e| Error::Internal(format!("{}, row {row}: {e}", path.display())))?;
    Ok(CaseFlags { row: Some(rows.row_place(line)), ..flags })
}
