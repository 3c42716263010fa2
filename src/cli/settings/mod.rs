//! All settings of a configuration: one tree of tables, from which the file format, its JSON Schema and the checks
//! follow.
//!
//! A value is the default, or comes from a file or a flag; the later source wins (`Layers`), and each value keeps its
//! `Origin`. Only named files are read, because a run must not depend on other files in a folder.

mod keys;
mod layers;
mod schema;
mod tables;

pub(crate) use keys::{DEFAULT_FILE, DEFAULT_FILE_NAME, KeyFlag, keys_in_order, text_of};
pub use keys::{Key, KeyKind};
pub(crate) use layers::{FILE_VARIABLE, Layers, Origin, Setting};
pub(crate) use schema::{profile_schema, settings_schema};
pub(crate) use tables::{Assurance, EstimatorKind, KeepPlan, MapSettings, SampleSettings, Settings};
