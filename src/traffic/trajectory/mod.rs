//! Trajectories: recordings as they come in, and the internal model that everything else reads.
//!
//! Here live the recording model, the reader and writer of highD's format, the reader of all other formats (presets), the
//! ego-centric view and the generator of synthetic recordings. Here lives nothing about
//! scenarios. Data comes from files or from the generator and goes to [`crate::mining`].

mod csv_table;
mod frame_index;
pub mod generator;
pub mod highd;
mod inputs;
mod motion;
mod noise;
mod number;
mod recording;
pub mod tracks;

pub use csv_table::FileChecksum;
pub(crate) use frame_index::{FrameIndex, VehicleAtFrame};
pub use inputs::{InputFile, Inputs};
pub(crate) use noise::Noise;
pub(crate) use recording::LIMIT_TOLERANCE_M;
pub use recording::{Carriageway, EgoViewOptions, Lane, Loaded, NO_LANE, Recording, Track, VehicleClass};
