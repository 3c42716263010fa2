//! Meanings of columns, and units.

use serde::Deserialize;

macro_rules! roles {
    ($($role:ident $key:literal $units:ident,)*) => {
        /// Meaning of a column.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
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

            /// The units that its values may have, with their factors; the first one is meant without a unit.
            pub(super) fn units(self) -> &'static [(&'static str, f64)] {
                [$($units),*][self as usize]
            }
        }
    };
}

/// Metres of an international foot.
const FOOT_M: f64 = 0.3048;

type Units = &'static [(&'static str, f64)];
const NONE: Units = &[("", 1.0)];
// Dates have the factor 1: they are parsed to seconds.
const TIME: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("date", 1.0)];
const LENGTH: Units = &[("m", 1.0), ("ft", FOOT_M), ("cm", 0.01), ("mm", 0.001), ("km", 1000.0)];
const SPEED: Units = &[("m/s", 1.0), ("km/h", 1.0 / 3.6), ("mph", 0.44704), ("ft/s", FOOT_M)];
const ACCELERATION: Units = &[("m/s2", 1.0), ("m/s²", 1.0), ("ft/s2", FOOT_M), ("g", 9.80665)];
const ANGLE: Units = &[("deg", std::f64::consts::PI / 180.0), ("rad", 1.0)];

// Each with its key and its units.
roles! {
    Recording "recording" NONE,
    Vehicle "vehicle" NONE,
    Frame "frame" NONE,
    Time "time" TIME,
    X "x" LENGTH,
    Y "y" LENGTH,
    Heading "heading" ANGLE,
    Speed "speed" SPEED,
    XSpeed "x_speed" SPEED,
    YSpeed "y_speed" SPEED,
    ForwardSpeed "forward_speed" SPEED,
    LeftwardSpeed "leftward_speed" SPEED,
    Acceleration "acceleration" ACCELERATION,
    XAcceleration "x_acceleration" ACCELERATION,
    YAcceleration "y_acceleration" ACCELERATION,
    Length "length" LENGTH,
    Width "width" LENGTH,
    Class "class" NONE,
    Lane "lane" NONE,
    LaneOffset "lane_offset" LENGTH,
    Direction "direction" NONE,
    FrameRate "frame_rate" NONE,
}

/// Names of a column, of which the first in the header counts, and the unit of its values.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(from = "Written")]
pub struct ColumnName {
    /// The names, in the order of preference.
    pub names: Vec<String>,
    pub(super) unit: Option<String>,
    factor: f64,
}

/// A column as presets write it.
#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    Names(OneOrMany),
    WithUnit { name: OneOrMany, unit: Option<String>, factor: Option<f64> },
}

#[derive(Deserialize)]
#[serde(untagged)]
enum OneOrMany {
    One(String),
    Many(Vec<String>),
}

impl From<Written> for ColumnName {
    fn from(written: Written) -> ColumnName {
        let (name, unit, factor) = match written {
            Written::Names(name) => (name, None, None),
            Written::WithUnit { name, unit, factor } => (name, unit, factor),
        };
        let names = match name {
            OneOrMany::One(name) => vec![name],
            OneOrMany::Many(names) => names,
        };
        ColumnName { names, unit, factor: factor.unwrap_or(1.0) }
    }
}

impl ColumnName {
    /// What the values are multiplied by to be in SI units (angles in rad); `None` for an unknown unit.
    pub fn factor(&self, role: Role) -> Option<f64> {
        let units = role.units();
        let unit = self.unit.as_deref().map_or(Some(&units[0]), |unit| units.iter().find(|(name, _)| *name == unit));
        Some(self.factor * unit?.1)
    }
}
