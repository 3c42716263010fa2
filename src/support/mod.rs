//! Support that knows nothing of traffic: errors, files, tables, locks, words and numbers for people.
//!
//! Here live the error type, files that are never half-written, run directories and their locks, tables in three formats,
//! ranges of settings, and those of plausible input. Every room uses it; it uses none.

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
