//! Presets: what the columns of a track format mean. A preset is a TOML file; the shipped ones are in `configs/presets`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::roles::{ColumnName, Role};
use lanesweep_support::plain_text::sha256;
use lanesweep_support::{Error, Place, Result, input_file, settings};

/// Columns by their meaning.
pub(super) type NamedColumns = BTreeMap<Role, ColumnName>;

settings! {
    /// Meaning of a track format.
    #[derive(Debug, Clone, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Preset {
        /// Its name.
        pub name: String = String::new(),
        /// Name of the format, for those who read the file.
        pub title: String = String::new(),
        /// Formats of the files, for the same readers: their endings decide.
        pub format: String = String::new(),
        /// Names of the track files; the text that `*` stands for names the recording.
        pub files: String = "*".to_owned(),
        /// Texts that stand for no value, beside the empty one.
        pub none: Vec<String> = Vec::new(),
        /// Frames per second, if no column or meta file tells.
        pub frame_rate_hz: Option<f64> = None,
        /// Frames per second of the result, by linear interpolation; without it, as recorded.
        pub resample_hz: Option<f64> = None,
        /// Point of the vehicle that x and y describe.
        pub reference: Reference = Reference::Centre,
        /// Orientation of the axes.
        pub axes: Axes = Axes::default(),
        /// Where s and d come from.
        pub road: RoadSource = RoadSource::Tracks,
        /// Side of the road that traffic drives on.
        pub traffic: Side = Side::Usual,
        /// Lanes that no column names.
        pub lanes: LaneBands = LaneBands::default(),
        /// Classes of vehicles.
        pub classes: Classes = Classes::default(),
        /// What makes a table with sizes: one without them is refused.
        pub sizes_from: Option<String> = None,
        /// Longest gap in a track that is filled, s; beyond it, the vehicle gets another id.
        pub max_gap_s: f64 = 0.3,
        /// Window of a cubic Savitzky–Golay filter of the positions, s; speeds and accelerations are then its derivatives.
        pub smoothing_s: Option<f64> = None,
        /// The columns of the track file.
        pub columns: NamedColumns = NamedColumns::new(),
        /// A second file with a row per vehicle.
        pub vehicles: Option<MetaFile> = None,
        /// A file with one row about the recording.
        pub recording: Option<MetaFile> = None,
        /// It is from a user's file: every column that it names must be there.
        #[serde(skip)]
        pub is_own: bool = false,
        /// SHA-256 of its text.
        #[serde(skip)]
        pub sha256: String = String::new(),
    }
}

/// Point of the vehicle's box.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Axes {
    /// Side of +x on which +y lies.
    pub y: Side,
    /// Zero and sense of rotation of headings.
    pub heading: HeadingOrigin,
}

impl Axes {
    /// What turns y of the file to the left of x.
    pub(super) fn y_sign(self) -> f64 {
        if self.y == Side::Right { -1.0 } else { 1.0 }
    }
}

/// A side.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingOrigin {
    /// From +x towards +y.
    #[default]
    FromX,
    /// Clockwise from +y (north).
    FromNorth,
}

/// Where the coordinates along the road come from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
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
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LaneBands {
    /// Width of every lane, m.
    pub width_m: Option<f64>,
}

/// Classes of vehicles, by their texts in the file.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
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
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetaFile {
    /// Its name; `*` stands for the same text as in `files`.
    pub file: String,
    /// Its columns.
    pub columns: NamedColumns,
}

macro_rules! shipped {
    ($($name:literal),*) => {
        /// Names and texts of the presets that are part of the program.
        const SHIPPED: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../../configs/presets/", $name, ".toml")))),*];
    };
}

shipped!("citysim", "dlr-ht", "exid", "frenet", "i24", "mitra", "ngsim", "omega-prime", "sumo-fcd", "tgsim", "generic");

/// Name of the preset of the format that has its own reader.
pub const HIGHD: &str = "highd";

impl Preset {
    /// Names of all presets.
    pub fn names() -> impl Iterator<Item = &'static str> {
        [HIGHD].into_iter().chain(SHIPPED.iter().map(|(name, _)| *name))
    }

    /// All shipped presets but `highd`.
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
            return Err(Error::unknown(Place::option("preset"), "preset", name, Preset::names(), ", or a .toml file"));
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
                let known: Vec<&str> = role.units().iter().map(|(name, _)| *name).collect();
                let problem =
                    format!("the unit `{}` or the factor is not usable", column.unit.as_deref().unwrap_or_default());
                return bad(role.key(), &problem, &format!("units are {}; a factor is not 0", known.join(", ")));
            }
        }
        let has = |role: &Role| self.columns.contains_key(role);
        if let Some(role) = [Role::Vehicle, Role::X, Role::Y].iter().find(|role| !has(role)) {
            return bad("columns", &format!("`{}` is missing", role.key()), "name its column");
        }
        if !has(&Role::Frame) && !has(&Role::Time) {
            return bad("columns", "neither `frame` nor `time` is there", "name one of them");
        }
        let numbers = [
            ("frame_rate_hz", self.frame_rate_hz, [0.1, 1e4]),
            ("resample_hz", self.resample_hz, [0.1, 1e4]),
            ("max_gap_s", Some(self.max_gap_s), [0.0, 60.0]),
            ("smoothing_s", self.smoothing_s, [0.0, 5.0]),
            ("lanes.width_m", self.lanes.width_m, [0.5, 50.0]),
        ];
        for (key, value, [min, max]) in numbers {
            if let Some(value) = value.filter(|value| !(min..=max).contains(value)) {
                return bad(key, &format!("{value} is out of range"), &format!("give {min} to {max}"));
            }
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
