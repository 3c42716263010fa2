//! The highD format: a recording is three comma-separated files, `NN_tracks.csv`, `NN_tracksMeta.csv`
//! and `NN_recordingMeta.csv`.
//!
//! This module has the inventory of a folder, the reader, the writer, and their common coordinate transformation. It
//! converts between paths and [`Recording`](super::Recording)s. No other module uses a column name of the format.

mod format;
mod frame;
mod inventory;
mod meta;
mod neighbours;
mod read;
mod writable;
mod write;

pub(super) use inventory::SUFFIXES;
pub(crate) use inventory::made_up;
pub use inventory::{HighdFiles, Inventory, SYNTHETIC_MARKER, inventory};
pub use read::{read, read_checked};
pub use writable::quantize;
pub use write::{stage, write};
