//! Grids of concrete cases: what a map sweeps.

mod axis;
pub mod jrc_case;
mod parameter;
mod plain_case;

pub use axis::{GridAxis, MOST_VALUES};
pub use parameter::{PARAMETERS, Parameter, Point, Quantity};
pub use plain_case::{LATERAL_DISTANCE_M, PlainCase};
