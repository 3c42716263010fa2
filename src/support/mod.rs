//! Support that is independent of traffic: errors, files, tables, locks, and texts and numbers for people.
//!
//! This module holds the error type, atomic files, run directories and their locks, tables in three formats, ranges of
//! settings, and plausibility of input. All other modules may use it; it uses none of them.

pub(crate) mod atomic_file;
pub mod cancel;
pub mod error;
mod file_list;
pub mod files;
pub(crate) mod input_file;
pub(crate) mod lock;
pub(crate) mod plain_text;
pub mod plausibility;
pub mod ranges;
pub(crate) mod readable;
pub mod run_dir;
pub mod table;
pub(crate) mod vector_state;
