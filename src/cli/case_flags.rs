//! A concrete case in words: from flags, a TOML file or a row of a table.

use std::path::Path;

use clap::Args;
use serde::Deserialize;

use crate::driver::ModelId;
use crate::grid::{LATERAL_DISTANCE_M, PlainCase};
use crate::profile::Profile;
use crate::scenario::{Case, Category};
use crate::sweep::Headway;
use crate::{Error, Place, Result, input_file, toml_file};

/// A case in words. Speeds in m/s, lengths in m, accelerations in m/s², times in s.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Args)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CaseFlags {
    /// Kind of scenario: cut-in, cut-out, lvd
    #[arg(long, value_name = "NAME")]
    category: Option<String>,
    #[arg(long, value_name = "LIST", help = format!("Driver models, separated by commas: {}, or all", ModelId::names()))]
    model: Option<String>,
    /// Initial speed of the ego, m/s
    #[arg(long, value_name = "MPS")]
    ego_speed: Option<f64>,
    /// Initial speed of the other vehicle, m/s [default: the ego's]
    #[arg(long, value_name = "MPS")]
    speed: Option<f64>,
    /// Initial gap, m, bumper to bumper
    #[arg(long, value_name = "M", conflicts_with = "thw")]
    gap: Option<f64>,
    /// Initial time headway, s, instead of the gap
    #[arg(long, value_name = "SECONDS")]
    thw: Option<f64>,
    /// Cut-in, cut-out: lateral speed, m/s
    #[arg(long, value_name = "MPS")]
    lateral_speed: Option<f64>,
    /// Cut-in: lateral distance at the start; cut-out: at the end [default: 3.5]
    #[arg(long, value_name = "M")]
    lateral_distance: Option<f64>,
    /// Acceleration of the other vehicle, m/s² [default: 0]
    #[arg(long, value_name = "MPS2")]
    acceleration: Option<f64>,
    /// Speed at which the acceleration ends, m/s [default: standstill, or never]
    #[arg(long, value_name = "MPS")]
    end_speed: Option<f64>,
    /// Cut-out: speed of the vehicle ahead of the cutting-out one, m/s [default: 0]
    #[arg(long, value_name = "MPS")]
    ahead_speed: Option<f64>,
    /// Cut-out: gap between the two, m, bumper to bumper
    #[arg(long, value_name = "M")]
    ahead_gap: Option<f64>,
    /// Length of every vehicle, m [default: the profile's]
    #[arg(long, value_name = "M")]
    length: Option<f64>,
    /// Width of every vehicle, m [default: the profile's]
    #[arg(long, value_name = "M")]
    width: Option<f64>,
}

impl CaseFlags {
    /// `self` where it says something, else `other`.
    pub(super) fn over(&self, other: CaseFlags) -> CaseFlags {
        // A gap typed here replaces a headway of the file, and the other way round.
        let (gap, thw) = match (self.gap, self.thw) {
            (None, None) => (other.gap, other.thw),
            typed => typed,
        };
        CaseFlags {
            category: self.category.clone().or(other.category),
            model: self.model.clone().or(other.model),
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
        }
    }

    pub(super) fn category(&self) -> Result<Category> {
        let text = needed(self.category.as_ref(), "category", "cut-in, cut-out or lvd")?;
        Category::parse(text).ok_or_else(|| {
            Error::usage(
                Place::item("category"),
                format!("there is no category `{text}`"),
                "use cut-in, cut-out or lvd",
            )
        })
    }

    /// Does it say anything of the case itself?
    pub(super) fn says_a_case(&self) -> bool {
        CaseFlags { model: None, ..self.clone() } != CaseFlags::default()
    }

    /// The models that are named; `None` where none is.
    pub(super) fn named_models(&self) -> Result<Option<Vec<ModelId>>> {
        self.model.as_ref().map(|_| self.models()).transpose()
    }

    /// At least one model, each once, in the order given.
    pub(super) fn models(&self) -> Result<Vec<ModelId>> {
        let text = needed(self.model.as_ref(), "model", &format!("one of {}, or all", ModelId::names()))?;
        if text.trim() == "all" {
            return Ok(ModelId::ALL.to_vec());
        }
        let mut models = Vec::new();
        for name in text.split(',').map(str::trim) {
            let model = ModelId::parse(name).ok_or_else(|| {
                let problem = format!("there is no model `{name}`");
                Error::usage(Place::item("model"), problem, format!("use one of {}, or all", ModelId::names()))
            })?;
            if !models.contains(&model) {
                models.push(model);
            }
        }
        Ok(models)
    }

    pub(super) fn headway(&self) -> Result<Headway> {
        match (self.gap, self.thw) {
            (Some(gap), None) => Ok(Headway::GapM(at_least(gap, 0.0, "gap")?)),
            (None, Some(thw)) => Ok(Headway::ThwS(at_least(thw, 0.0, "thw")?)),
            (Some(_), Some(_)) => {
                Err(Error::usage(Place::item("gap, thw"), "both are given", "give the gap or the time headway"))
            }
            (None, None) => Err(Error::usage(
                Place::item("gap, thw"),
                "the initial distance is missing",
                "give --gap in metres or --thw in seconds",
            )),
        }
    }

    pub(super) fn case(&self, profile: &Profile) -> Result<Case> {
        let category = self.category()?;
        let ego_speed_mps =
            at_least(*needed(self.ego_speed.as_ref(), "ego_speed", "a speed in m/s")?, 0.0, "ego_speed")?;
        let length_m = above_zero(self.length.unwrap_or(profile.frame.default_length_m), "length")?;
        let width_m = above_zero(self.width.unwrap_or(profile.frame.default_width_m), "width")?;
        let initial_mps = at_least(self.speed.unwrap_or(ego_speed_mps), 0.0, "speed")?;
        let acceleration_mps2 = at_least(self.acceleration.unwrap_or(0.0), f64::NEG_INFINITY, "acceleration")?;
        let end_speed_mps = self.end_speed.map(|v| at_least(v, 0.0, "end_speed")).transpose()?;
        let lateral_distance_m =
            at_least(self.lateral_distance.unwrap_or(LATERAL_DISTANCE_M), 0.0, "lateral_distance")?;
        let lateral_speed_mps = match category {
            Category::Lvd => 0.0,
            Category::CutIn | Category::CutOut => {
                let rate = *needed(self.lateral_speed.as_ref(), "lateral_speed", "a speed in m/s")?;
                above_zero(rate, "lateral_speed")?
            }
        };
        let (ahead_gap_m, ahead_speed_mps) = if category == Category::CutOut {
            let gap_m = at_least(*needed(self.ahead_gap.as_ref(), "ahead_gap", "a gap in m")?, 0.0, "ahead_gap")?;
            (gap_m, at_least(self.ahead_speed.unwrap_or(0.0), 0.0, "ahead_speed")?)
        } else {
            (0.0, 0.0)
        };
        let plain = PlainCase {
            category,
            ego_speed_mps,
            speed_mps: initial_mps,
            acceleration_mps2,
            end_speed_mps,
            lateral_speed_mps,
            lateral_distance_m,
            ahead_speed_mps,
            ahead_gap_m,
            length_m,
            width_m,
        };
        plain.case(profile.frame.time_cap_s)
    }
}

fn needed<'a, T>(value: Option<&'a T>, key: &str, what: &str) -> Result<&'a T> {
    value.ok_or_else(|| {
        let flag = key.replace('_', "-");
        Error::usage(Place::item(key), "it is missing", format!("give {what} with --{flag} or as `{key}` in the file"))
    })
}

/// Beyond this no speed, length or acceleration is physical.
const LARGEST: f64 = 1e6;

fn at_least(value: f64, least: f64, key: &str) -> Result<f64> {
    if value.abs() <= LARGEST && value >= least {
        return Ok(value);
    }
    let expected = if least.is_finite() {
        format!("a number of at least {least} and at most 1e6")
    } else {
        "a number between -1e6 and 1e6".into()
    };
    Err(Error::usage(Place::item(key), format!("{value} cannot be used"), format!("give {expected}")))
}

fn above_zero(value: f64, key: &str) -> Result<f64> {
    if value > 0.0 && value <= LARGEST {
        return Ok(value);
    }
    Err(Error::usage(Place::item(key), format!("{value} cannot be used"), "give a number above 0 and at most 1e6"))
}

/// The flags that a TOML file holds.
pub(super) fn from_toml(path: &Path) -> Result<CaseFlags> {
    toml_file::read(path, "the keys are the flags of `simulate --help` with `_`")
}

/// The flags that a row of a CSV table holds; rows count from 1 after the header.
pub(super) fn from_csv(path: &Path, row: usize) -> Result<CaseFlags> {
    let text = input_file::read_text(path, input_file::LARGEST_TABLE_BYTES)?;
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let records = reader.deserialize::<CaseFlags>();
    let line = row as u64 + 1;
    let found = row.checked_sub(1).and_then(|skip| records.into_iter().nth(skip)).ok_or_else(|| {
        Error::usage(Place::file(path), format!("there is no row {row}"), "rows count from 1 after the header")
    })?;
    found.map_err(|e| {
        Error::input(
            Place::file(path).row(line),
            e.to_string(),
            "the columns are the flags of `simulate --help` with `_`",
        )
    })
}
