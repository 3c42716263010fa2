//! All settings of a configuration: one tree of tables, from which the file format, its JSON Schema and the checks
//! follow.
//!
//! A value is the default, or comes from a file or a flag; the later source wins ([`Layers`]), and each value keeps its
//! [`Origin`]. Only named files are read, because a run must not depend on other files in a folder.

mod file;
mod keys;
mod layers;
mod schema;
mod tables;

pub use file::FILE_VARIABLE;
pub use keys::{Choice, DEFAULT_FILE, DEFAULT_FILE_NAME, Key, KeyKind, text_of};
pub use layers::{Assignment, Layers, Origin, Setting};
pub use schema::{profile_schema, settings_schema};
pub use tables::{
    BandwidthInterval, CompareSettings, EstimatorKind, FitSettings, IntervalKind, PointKind, RunSettings,
    SampleSettings, Settings,
};
