//! Concrete cases from flags, a TOML file or a table.

use std::collections::HashMap;
use std::path::Path;

use clap::Args;

use super::arguments::from_arguments;
use crate::engine::Headway;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::reopen::TracedCase;
use crate::scenario::{CaseFile, CaseParameters, CaseRow, ParameterRows, PlainCase, RowPlace, Written, si};
use crate::support::input_file;
use crate::support::plausibility::{Doubts, Implausible};
use crate::support::table::{NameUnit, TableFormat, TableReader};
use crate::{Error, Place, Result};

/// A case in flags. Speeds in m/s, lengths in m, accelerations in m/s², times in s.
#[derive(Debug, Clone, Args)]
pub(super) struct CaseFlags {
    /// Kind of scenario: cut-in, cut-out, lvd
    #[arg(long, value_name = "NAME", help_heading = "Scenario")]
    category: Option<String>,
    #[arg(long, value_name = "LIST", help = super::lists::models_help(), help_heading = "Models and criteria")]
    models: Option<String>,
    /// Initial speed of the ego, with its unit: 60km/h
    #[arg(long, value_name = "km/h|m/s", value_parser = speed_mps, allow_hyphen_values = true, help_heading = "Scenario")]
    ego_speed: Option<f64>,
    /// Initial speed of the other vehicle, with its unit [default: the ego's]
    #[arg(long, value_name = "km/h|m/s", value_parser = speed_mps, allow_hyphen_values = true, help_heading = "Scenario")]
    speed: Option<f64>,
    /// Initial gap, bumper to bumper
    #[arg(long, value_name = "m", value_parser = length_m, conflicts_with = "thw", help_heading = "Scenario")]
    gap: Option<f64>,
    /// Initial time headway instead of the gap
    #[arg(long, value_name = "s", value_parser = time_s, help_heading = "Scenario")]
    thw: Option<f64>,
    /// Cut-in, cut-out: lateral speed
    #[arg(long, value_name = "m/s", value_parser = lateral_speed_mps, allow_hyphen_values = true, help_heading = "Scenario")]
    lateral_speed: Option<f64>,
    /// Cut-in: lateral distance at the start; cut-out: at the end [default: the lane's width]
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario", hide_short_help = true)]
    lateral_distance: Option<f64>,
    /// Acceleration of the other vehicle; an LVD needs one [default: 0]
    #[arg(long, value_name = "m/s²", value_parser = acceleration_mps2, allow_hyphen_values = true, help_heading = "Scenario")]
    acceleration: Option<f64>,
    /// Speed at which the acceleration ends, with its unit [default: standstill, or never]
    #[arg(long, value_name = "km/h|m/s", value_parser = speed_mps, allow_hyphen_values = true, help_heading = "Scenario", hide_short_help = true)]
    end_speed: Option<f64>,
    /// Cut-out: speed of the vehicle ahead of the cutting-out one, with its unit [default: 0]
    #[arg(long, value_name = "km/h|m/s", value_parser = speed_mps, allow_hyphen_values = true, help_heading = "Scenario", hide_short_help = true)]
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
    /// Length of the ego [default: that of every vehicle]
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario", hide_short_help = true)]
    ego_length: Option<f64>,
    /// Width of the ego [default: that of every vehicle]
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario", hide_short_help = true)]
    ego_width: Option<f64>,
    /// Width of the lanes [default: the scenario's, else 3.5]
    #[arg(long, value_name = "m", value_parser = length_m, help_heading = "Scenario", hide_short_help = true)]
    pub(super) lane_width: Option<f64>,
}

from_arguments!(
    CaseFlags { category, models }
    parsed {
        ego_speed: speed_mps,
        speed: speed_mps,
        gap: length_m,
        thw: time_s,
        lateral_speed: lateral_speed_mps,
        lateral_distance: length_m,
        acceleration: acceleration_mps2,
        end_speed: speed_mps,
        ahead_speed: speed_mps,
        ahead_gap: length_m,
        length: length_m,
        width: length_m,
        ego_length: length_m,
        ego_width: length_m,
        lane_width: length_m,
    }
);

/// A case as it is given: flags over a file or a row of a table.
#[derive(Debug, Default)]
pub(super) struct GivenCase {
    parameters: CaseParameters,
    models: Option<String>,
    /// Its key in a table.
    pub id: Option<String>,
    /// The place of a row's values.
    row: Option<RowPlace>,
}

impl CaseFlags {
    /// Values of `self` where given, otherwise those of a file.
    pub(super) fn over(&self, file: GivenCase) -> GivenCase {
        let flags = self.parameters();
        GivenCase {
            row: file.row.map(|row| row.without(&flags.given())),
            models: self.models.clone().or(file.models),
            id: file.id,
            parameters: flags.over(&file.parameters),
        }
    }

    /// Whether it gives any value of the case.
    pub(super) fn says_a_case(&self) -> bool {
        self.parameters() != CaseParameters::default()
    }

    /// The initial distance, if given.
    pub(super) fn start(&self) -> Result<Option<Headway>> {
        let is_given = self.gap.is_some() || self.thw.is_some();
        if is_given { self.over(GivenCase::default()).headway().map(Some) } else { Ok(None) }
    }

    /// Whether it gives a value of the case other than the width of the lanes.
    pub(super) fn says_more_than_lanes(&self) -> bool {
        CaseParameters { lane_width: None, ..self.parameters() } != CaseParameters::default()
    }

    /// Whether it gives a value of the case other than the ego's start.
    pub(super) fn says_more_than_a_start(&self) -> bool {
        CaseParameters { gap: None, thw: None, ..self.parameters() } != CaseParameters::default()
    }

    /// The named models; `None` if none is named.
    pub(super) fn named_models(&self) -> Result<Option<Vec<ModelId>>> {
        self.models.as_ref().map(|list| super::lists::models(list.split(','), "models")).transpose()
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
            ego_length: self.ego_length,
            ego_width: self.ego_width,
            lane_width: self.lane_width,
            // Only files have it.
            duration: None,
        }
    }
}

impl GivenCase {
    /// Whether it gives any value of the case.
    pub(super) fn says_a_case(&self) -> bool {
        self.parameters != CaseParameters::default()
    }

    /// The named models in the given order; all if none is named.
    fn models(&self) -> Result<Vec<ModelId>> {
        let names = self.models.iter().flat_map(|list| list.split(','));
        self.located(super::lists::models(names, "models"))
    }

    /// Adds the place of a table's value to its error.
    pub(super) fn located<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|error| match &self.row {
            Some(row) => row.locate(error),
            None => error,
        })
    }

    pub(super) fn headway(&self) -> Result<Headway> {
        let CaseParameters { gap, thw, .. } = self.parameters;
        self.located(self.parameters.check_start())?;
        let start = gap.map(Headway::GapM).or(thw.map(Headway::thw));
        self.located(start.ok_or_else(|| {
            let help = "give option `gap` in metres or option `thw` in seconds";
            Error::usage(Place::item("gap, thw"), "the initial distance is missing", help)
        }))
    }

    /// Runs the case with each of its models; warns about doubtful values.
    pub(super) fn traced(&self, profile: &Profile, implausible: Implausible) -> Result<TracedCase> {
        let mut doubts = Doubts::new(implausible);
        let plain = self.plain_case(profile, &mut doubts)?;
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        let case = self.located(plain.case(profile.frame.time_cap_s))?;
        TracedCase::run(&case, self.headway()?, profile, &self.models()?)
    }

    /// The numbers of the case.
    pub(super) fn plain_case(&self, profile: &Profile, doubts: &mut Doubts) -> Result<PlainCase> {
        let plain = self.located(self.parameters.clone().checked_case(&profile.frame, doubts))?;
        self.headway()?;
        Ok(plain)
    }
}

type Parsed = std::result::Result<f64, String>;

fn parse(text: &str, unit: &str, name: NameUnit) -> Parsed {
    si(Written::Text(text), unit, name).map_err(|unusable| match unusable.lacks_unit {
        true => format!("{}; write {}", unusable.problem, unusable.write),
        false => format!("write {}", unusable.write),
    })
}

/// A speed along the road with its unit: `60km/h`, `37 mph`, `16.7m/s`.
fn speed_mps(text: &str) -> Parsed {
    parse(text, "m/s", NameUnit::Needed)
}

/// A speed across the road: `1.2`, `1.2m/s`.
fn lateral_speed_mps(text: &str) -> Parsed {
    parse(text, "m/s", NameUnit::Customary)
}

/// A length: `12`, `12m`.
pub(super) fn length_m(text: &str) -> Parsed {
    parse(text, "m", NameUnit::Customary)
}

/// A time: `1.2`, `1.2s`.
pub(super) fn time_s(text: &str) -> Parsed {
    parse(text, "s", NameUnit::Customary)
}

/// An acceleration: `-5`, `-5m/s2`.
fn acceleration_mps2(text: &str) -> Parsed {
    parse(text, "m/s²", NameUnit::Customary)
}

/// Reads a case from a TOML file.
pub(super) fn from_toml(path: &Path) -> Result<GivenCase> {
    let help = "the keys are the flags of `simulate --help` with `_`";
    let CaseFile { models, parameters } = input_file::read_toml(path, help)?;
    Ok(GivenCase { parameters, models, ..GivenCase::default() })
}

/// A CSV or Parquet table of cases.
pub(super) struct CaseTable {
    rows: ParameterRows,
    row: usize,
    /// Where each id was first.
    lines: HashMap<String, u64>,
    /// Where each id of several rows was last.
    doubled: HashMap<String, u64>,
}

impl CaseTable {
    pub(super) fn open(path: &Path) -> Result<CaseTable> {
        let format = TableFormat::of(path, &[TableFormat::Csv, TableFormat::Parquet], "--table")?;
        let rows = ParameterRows::new(TableReader::open(path, format)?)?;
        Ok(CaseTable { rows, row: 0, lines: HashMap::new(), doubled: HashMap::new() })
    }

    /// Number of the last row, from 1 after the header.
    pub(super) fn row(&self) -> usize {
        self.row
    }

    /// The error for the first row of an id that several rows have: it is unknown which one is meant.
    pub(super) fn refused_later(&self, id: &str) -> Option<Error> {
        let (first, next) = (self.lines.get(id)?, self.doubled.get(id)?);
        Some(self.rows.row_place(*first).locate(self.doubled_with(*next)))
    }

    fn doubled_with(&self, line: u64) -> Error {
        let problem = format!("this id belongs to {} {line} too, but every case needs its own id", self.rows.word());
        Error::usage(Place::item("id"), problem, "rename one of the two: neither is used")
    }

    /// The next row, or its error, which names file, line and column.
    pub(super) fn next(&mut self) -> Result<Option<Result<GivenCase>>> {
        let Some((line, row)) = self.rows.next_row()? else { return Ok(None) };
        self.row += 1;
        let row = row.and_then(|CaseRow { id, models, parameters, .. }| {
            let given = GivenCase { parameters, models, id, row: Some(self.rows.row_place(line)) };
            if let Some((id, first)) = given.id.as_ref().and_then(|id| Some((id, *self.lines.get(id)?))) {
                self.doubled.insert(id.clone(), line);
                given.located::<()>(Err(self.doubled_with(first)))?;
            }
            self.lines.extend(given.id.clone().map(|id| (id, line)));
            Ok(given)
        });
        Ok(Some(row))
    }
}

/// Reads a case from a row of a table; rows count from 1 after the header. Without a number the table has one row.
pub(super) fn from_table(path: &Path, row: Option<usize>) -> Result<GivenCase> {
    let mut table = CaseTable::open(path)?;
    let (wanted, help) = (row.unwrap_or(1), "rows count from 1 after the header");
    let missing = || Error::usage(Place::file(path), format!("there is no row {wanted}"), help);
    for _ in 1..wanted {
        drop(table.next()?.ok_or_else(missing)?);
    }
    let found = if wanted == 0 { None } else { table.next()? }.ok_or_else(missing)??;
    if row.is_none() && table.next()?.is_some() {
        let help = "name one: --row N, from 1 after the header";
        return Err(Error::usage(Place::file(path), "the table has several cases", help));
    }
    Ok(found)
}
