//! Everything that may be set in a configuration: one tree of tables, from which the file's format, its JSON Schema,
//! the environment's variables and the checks follow.
//!
//! A value is the default, or comes from a file, the environment or a flag, the later winning ([`Layers`]); each keeps
//! its [`Origin`]. No file is read but one that is named: a run must not depend on what lies about in a folder.

mod file;
mod keys;
mod layers;
mod schema;
mod tables;

pub use file::{FILE_VARIABLE, TEST_VARIABLES, variable_of};
pub use keys::{Choice, DEFAULT_FILE, DEFAULT_FILE_NAME, Key, KeyKind, text_of};
pub use layers::{Assignment, Layers, Origin, Setting};
pub use schema::{profile_schema, settings_schema};
pub use tables::{
    BandwidthInterval, CompareSettings, EstimatorKind, FitSettings, IntervalKind, PointKind, RunSettings,
    SampleSettings, Settings,
};
