//! Runs in parts: shards of a plan, journals of finished chunks, part files, and what merging checks.
//!
//! A part is an interval of units. While it runs, a [`Ledger`] keeps what is counted and appends it to a journal; when
//! it is done, it becomes a part file. Both say which run they belong to, by its hash. Counts themselves live
//! in the [`engine`](crate::engine) and [`sampling`](crate::run::sampling).

mod folder;
mod journal;
mod ledger;
mod run_dir;
mod sealed;
mod shard;

pub use folder::{Found, Part, collect, read_part, read_parts, write_part};
pub use journal::{Journal, Records};
pub use ledger::{Counted, CountsJournal, Fits, Ledger, MergeableCounts};
pub use run_dir::{PLAN_FILE, RUN_PLAN_FILE, RunDir, RunState, leave_plan, units_of};
pub use sealed::{kind_of, read_sealed, read_sealed_line, seal, unseal};
pub use shard::Shard;
