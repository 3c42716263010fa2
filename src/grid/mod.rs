//! Grids of concrete cases: what a map sweeps.

pub mod jrc_case;
