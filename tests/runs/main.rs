//! Whole runs: parts, interruptions, kills, faults of the machine, repeats.

#[path = "../common/mod.rs"]
mod common;

mod against_recorded;
mod external_replays;
mod faults;
mod interrupted;
mod kills;
mod map;
mod mutations;
mod nothing_is_lost;
mod observed;
mod parts;
mod reruns;
mod sampling;
mod strange_files;
