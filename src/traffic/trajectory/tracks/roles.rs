//! Meanings of columns, and units.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

macro_rules! roles {
    ($($role:ident $key:literal $dimension:ident,)*) => {
        /// Meaning of a column.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        #[allow(missing_docs)] // docs/src/tracks.md has the table
        pub enum Role {
            $($role,)*
        }

        impl Role {
            /// All roles.
            pub(crate) const ALL: [Role; [$($key),*].len()] = [$(Role::$role),*];

            /// Its key in a preset.
            pub(crate) fn key(self) -> &'static str {
                [$($key),*][self as usize]
            }

            pub(super) fn dimension(self) -> Dimension {
                [$(Dimension::$dimension),*][self as usize]
            }
        }
    };
}

// Each with its key and what it measures.
roles! {
    Recording "recording" Text,
    Vehicle "vehicle" Text,
    Frame "frame" Number,
    Time "time" Time,
    X "x" Length,
    Y "y" Length,
    Heading "heading" Angle,
    Speed "speed" Speed,
    XSpeed "x_speed" Speed,
    YSpeed "y_speed" Speed,
    ForwardSpeed "forward_speed" Speed,
    LeftwardSpeed "leftward_speed" Speed,
    Acceleration "acceleration" Acceleration,
    XAcceleration "x_acceleration" Acceleration,
    YAcceleration "y_acceleration" Acceleration,
    Length "length" Length,
    Width "width" Length,
    Class "class" Text,
    Lane "lane" Text,
    LaneOffset "lane_offset" Length,
    Direction "direction" Number,
    FrameRate "frame_rate" Number,
}

/// What a role measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dimension {
    Text,
    Number,
    Time,
    Length,
    Speed,
    Acceleration,
    Angle,
}

/// Names of a column, and the unit of its values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ColumnName {
    /// One name; the unit is that of the SI, headings are in degrees.
    Name(String),
    /// Several names, of which the first in the header counts.
    Names(Vec<String>),
    /// Names with a unit.
    WithUnit {
        /// One name or several.
        name: OneOrMany,
        /// The unit.
        #[serde(default)]
        unit: Option<String>,
        /// Factor on the values after the unit; −1 turns a sign.
        #[serde(default)]
        factor: Option<f64>,
    },
}

/// One text or several.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum OneOrMany {
    /// One.
    One(String),
    /// Several.
    Many(Vec<String>),
}

impl OneOrMany {
    /// The texts, in the order of the file.
    pub(crate) fn names(&self) -> &[String] {
        match self {
            OneOrMany::One(name) => std::slice::from_ref(name),
            OneOrMany::Many(names) => names,
        }
    }
}

impl ColumnName {
    /// The names, in the order of preference.
    pub fn names(&self) -> &[String] {
        match self {
            ColumnName::Name(name) => std::slice::from_ref(name),
            ColumnName::Names(names) => names,
            ColumnName::WithUnit { name, .. } => name.names(),
        }
    }

    pub(super) fn unit(&self) -> Option<&str> {
        match self {
            ColumnName::WithUnit { unit, .. } => unit.as_deref(),
            _ => None,
        }
    }

    /// What the values are multiplied by to be in SI units (angles in rad); `None` for an unknown unit.
    pub fn factor(&self, role: Role) -> Option<f64> {
        let own = match self {
            ColumnName::WithUnit { factor, .. } => factor.unwrap_or(1.0),
            _ => 1.0,
        };
        Some(own * unit_factor(role.dimension(), self.unit())?)
    }
}

/// Metres of an international foot.
const FOOT_M: f64 = 0.3048;

/// Known units with their factors.
pub(super) fn units(dimension: Dimension) -> &'static [(&'static str, f64)] {
    match dimension {
        Dimension::Text | Dimension::Number => &[("", 1.0)],
        // Dates have the factor 1: they are parsed to seconds.
        Dimension::Time => &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("date", 1.0)],
        Dimension::Length => &[("m", 1.0), ("ft", FOOT_M), ("cm", 0.01), ("mm", 0.001), ("km", 1000.0)],
        Dimension::Speed => &[("m/s", 1.0), ("km/h", 1.0 / 3.6), ("mph", 0.44704), ("ft/s", FOOT_M)],
        Dimension::Acceleration => &[("m/s2", 1.0), ("m/s²", 1.0), ("ft/s2", FOOT_M), ("g", 9.80665)],
        Dimension::Angle => &[("deg", std::f64::consts::PI / 180.0), ("rad", 1.0)],
    }
}

fn unit_factor(dimension: Dimension, unit: Option<&str>) -> Option<f64> {
    let known = units(dimension);
    match unit {
        None => Some(known[0].1),
        Some(unit) => known.iter().find(|(name, _)| *name == unit).map(|(_, factor)| *factor),
    }
}
