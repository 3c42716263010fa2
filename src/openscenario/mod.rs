//! OpenSCENARIO: concrete scenarios out, distributions of parameters in.
//!
//! Here live what a played scenario holds ([`Concrete`]), its two files (ASAM OpenSCENARIO XML 1.2 and ASAM OpenDRIVE
//! 1.7), and the reader of `ParameterValueDistribution` files. Here lives nothing about how lanes are chosen or run.
//! Traces come from [`crate::sweep`]; what is read goes to [`crate::grid`] and [`crate::sweep`].

mod concrete;
mod elements;
mod folder;
mod path;
mod road;
mod scenario_file;
mod sizes;

pub use concrete::{Concrete, EgoMotion, PlayedVehicle};
pub use folder::{IndexRow, export_folder};
pub use path::{Vertex, paths};
pub use road::{Road, road_file};
pub use scenario_file::scenario_file;
pub use sizes::{KnownSizes, sizes_of_case};

/// Author of every file.
pub(crate) const AUTHOR: &str = concat!("lanesweep ", env!("CARGO_PKG_VERSION"));

/// Date of every file: the same input gives the same bytes.
pub(crate) const DATE: &str = "1970-01-01T00:00:00";
