//! Whole runs: parts, interruptions, kills, faults of the machine, repeats.

mod against_recorded;
mod external_replays;
mod faults;
mod interrupted;
mod kills;
mod map;
mod mechanisms;
mod observed;
pub mod parts;
mod reruns;
mod sampling;
