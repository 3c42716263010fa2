//! Conformance: tables of other people's simulators, replayed lane by lane.
//!
//! Here live the readers of golden tables (the JRC's cases and functions, the lanes of the `paper`
//! profile) and the comparison. Here lives no physics: every row becomes an ordinary case and an ordinary
//! lane. Tables come from files; the comparison goes to the command line.

mod jrc;
mod lanes;
mod table;
mod tally;

pub use jrc::{check_shipped_tables, compare_functions, compare_jrc};
pub use lanes::{LaneComparison, compare_lanes};
pub use table::{Row, Table, TableKind};
pub use tally::{Deviation, Tally};
