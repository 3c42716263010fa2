//! Support that is independent of traffic: errors, files, tables, locks, and texts and numbers for people.
//!
//! This module holds the error type, atomic files, run directories and their locks, tables in three formats, and ranges of
//! settings. All other modules may use it; it uses none of them.

pub mod atomic_file;
pub mod cancel;
pub mod error;
pub mod files;
pub mod input_file;
pub mod lock;
pub mod plain_text;
pub mod ranges;
pub mod readable;
pub mod run_folder;
pub mod table;
pub mod vector_state;

pub use error::{Error, Place, Result, option};
