//! Presets: what the columns of a track format mean. A preset is a TOML file; the shipped ones are in `configs/presets`.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::roles::{ColumnName, OneOrMany, Role, units};
use crate::support::input_file;
use crate::support::plain_text::{nearest, sha256};
use crate::{Error, Place, Result};

/// Meaning of a track format.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// Its name.
    pub name: String,
    /// Name of the format in messages.
    pub title: String,
    /// File format.
    pub format: FileFormat,
    /// Names of the track files; the text that `*` stands for names the recording.
    #[serde(default = "any_file")]
    pub files: String,
    /// Delimiter of a CSV file, one character; without it, the one that the header has most of.
    #[serde(default)]
    pub delimiter: Option<char>,
    /// Element (XML) or list (JSON) that is a row.
    #[serde(default)]
    pub rows: Option<String>,
    /// Texts that stand for no value, beside the empty one.
    #[serde(default)]
    pub none: Vec<String>,
    /// Frames per second, if no column or meta file tells.
    #[serde(default)]
    pub frame_rate_hz: Option<f64>,
    /// Frames per second of the result, by linear interpolation; without it, as recorded.
    #[serde(default)]
    pub resample_hz: Option<f64>,
    /// Point of the vehicle that x and y describe.
    #[serde(default)]
    pub reference: Reference,
    /// Orientation of the axes.
    #[serde(default)]
    pub axes: Axes,
    /// Where s and d come from.
    #[serde(default)]
    pub road: RoadSource,
    /// Side of the road that traffic drives on.
    #[serde(default)]
    pub traffic: Side,
    /// Lanes that no column names.
    #[serde(default)]
    pub lanes: LaneBands,
    /// Classes of vehicles.
    #[serde(default)]
    pub classes: Classes,
    /// Length and width in metres by class, where the file has none; `default` is for all others. SUMO's types without a size
    /// have these.
    #[serde(default)]
    pub sizes: BTreeMap<String, [f64; 2]>,
    /// Longest gap in a track that is filled, s; beyond it, the vehicle gets another id.
    #[serde(default = "default_gap_s")]
    pub max_gap_s: f64,
    /// Window of a cubic Savitzky–Golay filter of the positions, s; speeds and accelerations are then its derivatives.
    #[serde(default)]
    pub smoothing_s: Option<f64>,
    /// Leaves out vehicles that overlap, jump or change size.
    #[serde(default)]
    pub exclude_doubtful: bool,
    /// The columns of the track file.
    pub columns: BTreeMap<Role, ColumnName>,
    /// A second file with a row per vehicle.
    #[serde(default)]
    pub vehicles: Option<MetaFile>,
    /// A file with one row about the recording.
    #[serde(default)]
    pub recording: Option<MetaFile>,
    /// Files with `vType` elements (SUMO) beside the tracks; `*` as in `files`, or any name.
    #[serde(default)]
    pub types_file: Option<OneOrMany>,
    /// It is from a user's file: every column that it names must be there.
    #[serde(skip)]
    pub is_own: bool,
    /// SHA-256 of its text.
    #[serde(skip)]
    pub sha256: String,
}

fn any_file() -> String {
    "*".to_owned()
}

fn default_gap_s() -> f64 {
    0.3
}

/// File format of tracks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FileFormat {
    /// Delimited text with a header.
    #[default]
    Csv,
    /// Apache Parquet: a row per sample, or a row per vehicle with lists.
    Parquet,
    /// XML: the attributes of an element and of those around it.
    Xml,
    /// JSON: a list of vehicles whose values are lists.
    Json,
    /// CommonRoad 2020a: dynamic obstacles and lanelets.
    Commonroad,
}

/// Point of the vehicle's box.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reference {
    /// Middle of the box.
    #[default]
    Centre,
    /// Middle of the front bumper.
    Front,
    /// Middle of the rear bumper.
    Rear,
    /// Smallest x and smallest y of a box along the axes.
    Corner,
}

/// Orientation of the axes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Axes {
    /// Side of +x on which +y lies.
    pub y: Side,
    /// Zero and sense of rotation of headings.
    pub heading: HeadingOrigin,
}

/// A side.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The left; for `traffic`: not the usual side, as in the United Kingdom.
    Left,
    /// The right.
    Right,
    /// The usual one: y to the left of x, traffic on the right.
    #[default]
    Usual,
}

/// Zero and sense of headings.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingOrigin {
    /// From +x towards +y.
    #[default]
    FromX,
    /// Clockwise from +y (north).
    FromNorth,
}

/// Where the coordinates along the road come from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RoadSource {
    /// A line fitted to the tracks, straight where that serves.
    #[default]
    Tracks,
    /// x is along the road and y across it.
    X,
    /// y is along the road and x across it.
    Y,
}

/// Lanes by lateral position.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LaneBands {
    /// Width of every lane, m.
    pub width_m: Option<f64>,
}

/// Classes of vehicles, by their texts in the file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Classes {
    /// Lorries and buses; a text that begins so counts too.
    pub truck: Vec<String>,
    /// What is left out: pedestrians, bicycles.
    pub ignored: Vec<String>,
    /// Vehicles of at least this length are lorries, m.
    pub truck_from_m: Option<f64>,
}

/// A file with more about the recording or its vehicles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MetaFile {
    /// Its name; `*` stands for the same text as in `files`.
    pub file: String,
    /// Its columns.
    pub columns: BTreeMap<Role, ColumnName>,
}

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        /// Names and texts of the presets that are part of the program, `generic` last.
        const SHIPPED: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../../configs/presets/", $name, ".toml")))),*];
    };
}

shipped! {
    "automatum", "citysim", "commonroad", "dlr-ht", "exid", "i24", "mitra", "ngsim", "omega-prime", "sumo-fcd",
    "sumo-fcd-parquet", "sumo-fcd-xml", "swiftraj", "tgsim", "generic",
}

/// Name of the preset of the format that has its own reader.
pub const HIGHD: &str = "highd";

impl Preset {
    /// Names of all presets.
    pub fn names() -> impl Iterator<Item = &'static str> {
        [HIGHD].into_iter().chain(SHIPPED.iter().map(|(name, _)| *name))
    }

    /// All shipped presets but `highd`, `generic` last.
    ///
    /// # Errors
    /// [`Error::Internal`] for a defect of this build.
    pub(super) fn shipped() -> Result<Vec<Preset>> {
        SHIPPED.iter().map(|(name, text)| Preset::parse(text, Place::item(format!("preset {name}")))).collect()
    }

    /// A shipped preset by name, or one from a file whose name ends in `.toml`.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown name; [`Error::Io`]; [`Error::Input`] for a file that is no preset.
    pub fn load(name: &str) -> Result<Preset> {
        if let Some((_, text)) = SHIPPED.iter().find(|(shipped, _)| *shipped == name) {
            return Preset::parse(text, Place::item(format!("preset {name}")));
        }
        if !name.ends_with(".toml") {
            let file = format!("{name}.toml");
            let near = if Path::new(&file).exists() {
                Some(file)
            } else {
                nearest(name, Preset::names(), 0.6).map(str::to_owned)
            };
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            let all = Preset::names().collect::<Vec<_>>().join(", ");
            return Err(Error::usage(
                Place::option("preset"),
                format!("there is no preset `{name}`{near}"),
                format!("use {all}, or a file whose name ends in .toml"),
            ));
        }
        let path = Path::new(name);
        let text = input_file::read_text(path, input_file::MAX_SETTINGS_BYTES)?;
        Ok(Preset { is_own: true, ..Preset::parse(&text, Place::file(path))? })
    }

    fn parse(text: &str, place: Place) -> Result<Preset> {
        let preset: Preset = input_file::parse_toml(text, &place, "the chapter on tracks has the keys of a preset")?;
        preset.check(&place)?;
        Ok(Preset { sha256: sha256(text), ..preset })
    }

    fn check(&self, place: &Place) -> Result<()> {
        let bad = |key: &str, problem: &str, help: &str| Err(Error::input(place.clone().of(key), problem, help));
        let files = self.vehicles.iter().chain(&self.recording).map(|meta| &meta.columns);
        for (role, column) in files.chain([&self.columns]).flatten() {
            if column.factor(*role).is_none_or(|factor| !factor.is_finite() || factor == 0.0) {
                let known: Vec<&str> = units(role.dimension()).iter().map(|(name, _)| *name).collect();
                let unit = column.unit().unwrap_or_default();
                let problem = format!("the unit `{unit}` or the factor is not usable");
                return bad(role.key(), &problem, &format!("units are {}; a factor is not 0", known.join(", ")));
            }
            if column.names().is_empty() {
                return bad(role.key(), "no column is named", "name one");
            }
        }
        let has = |role: Role| self.columns.contains_key(&role);
        let is_table = self.format != FileFormat::Commonroad;
        let needed = [Role::Vehicle, Role::X, Role::Y];
        if let Some(role) = needed.into_iter().find(|role| is_table && !has(*role)) {
            return bad("columns", &format!("`{}` is missing", role.key()), "name its column");
        }
        if is_table && !has(Role::Frame) && !has(Role::Time) {
            return bad("columns", "neither `frame` nor `time` is there", "name one of them");
        }
        if self.files.matches('*').count() != 1 {
            let problem = format!("`{}` has not one `*`", self.files);
            return bad("files", &problem, "write *_tracks.csv, for instance");
        }
        let ranges = [
            ("frame_rate_hz", self.frame_rate_hz, 0.1, 1e4),
            ("resample_hz", self.resample_hz, 0.1, 1e4),
            ("max_gap_s", Some(self.max_gap_s), 0.0, 60.0),
            ("smoothing_s", self.smoothing_s, 0.0, 60.0),
            ("lanes.width_m", self.lanes.width_m, 0.5, 50.0),
        ];
        for (key, value, min, max) in ranges {
            if let Some(value) = value.filter(|value| !(min..=max).contains(value)) {
                return bad(key, &format!("{value} is out of range"), &format!("give {min} to {max}"));
            }
        }
        if let Some((class, _)) = self.sizes.iter().find(|(_, size)| size.iter().any(|v| !(0.1..=100.0).contains(v))) {
            let problem = format!("the size of `{class}` is out of range");
            return bad("sizes", &problem, "give length and width in metres");
        }
        Ok(())
    }

    /// The name of the recording of a track file; `None` if the file name does not fit.
    pub(super) fn recording_of<'a>(&self, file: &'a str) -> Option<&'a str> {
        let (before, after) = self.files.split_once('*')?;
        let id = file.strip_prefix(before)?.strip_suffix(after)?;
        // A bare `*` takes the name without its ending.
        let id = if after.is_empty() { id.rsplit_once('.').map_or(id, |(stem, _)| stem) } else { id };
        (!id.is_empty()).then_some(id)
    }

    /// Whether it is the preset for tables that no other preset knows.
    pub(crate) fn is_generic(&self) -> bool {
        self.name == "generic"
    }
}
