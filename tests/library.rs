//! Claims about what is computed, in this process: lanes, scenarios, densities, recordings.

mod common;
mod lanes;
mod memory;
mod scenarios;
mod statistics;
mod traffic;
