//! Everything that may be set in a configuration: one tree of tables, from which the file's format, its JSON Schema,
//! the environment's variables and the checks follow.
//!
//! A value is the default, or comes from a file, the environment or a flag, the later winning ([`Layers`]); each keeps
//! its [`Origin`]. No file is read but one that is named: a run must not depend on what lies about in a folder.

mod default_file;
mod environment;
mod file;
mod keys;
mod layers;
mod profile_schema;
mod schema;
mod tables;
mod value;

pub use default_file::{DEFAULT_FILE, DEFAULT_FILE_NAME, keys_in_order};
pub use environment::{FILE_VARIABLE, TEST_VARIABLES, variable_of};
pub use keys::{Choice, Key, KeyKind};
pub use layers::{Assignment, Layers, Origin, Setting};
pub use profile_schema::profile_schema;
pub use schema::settings_schema;
pub use tables::{
    BandwidthInterval, CompareSettings, EstimatorKind, FitSettings, IntervalKind, PointKind, RunSettings,
    SampleSettings, Settings,
};
pub use value::text_of;
