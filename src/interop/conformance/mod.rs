//! Conformance: tables of other simulators, replayed lane by lane.
//!
//! This module reads golden tables (the JRC's cases and functions, the lanes of the `paper` profile) and compares them.
//! It has no physics: every row becomes an ordinary case and lane. Tables come from files; the comparison goes to the
//! command line.

mod jrc;
mod lanes;
mod table;
mod tally;

pub use jrc::{check_shipped_tables, compare_functions, compare_jrc};
pub use lanes::{LaneComparison, compare_lanes};
pub use table::{Row, Table, TableKind};
pub use tally::{Deviation, Tally};
