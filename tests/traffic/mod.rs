//! Recordings and mining: what is read, what is refused, which scenarios are found.

mod bad_geometry;
mod field_reports;
mod foreign_encodings;
mod foreign_tables;
mod generator_calibration;
mod generator_physics;
mod highd_round_trip;
mod highd_turned;
mod mining_activities;
mod mining_claims;
mod mining_recordings;
mod noise;
mod silent_faults;
mod sumo_and_ngsim;
mod tracks;
