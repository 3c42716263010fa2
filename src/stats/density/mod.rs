//! Densities over scenario parameters.
//!
//! This module contains the parameter spaces of scenarios, kernel density estimation, and Gaussian mixtures with their
//! fit, which represent every density and proposal. It also contains the physically valid fraction of a density,
//! exposure, and the density file. It contains nothing about lanes. Scenarios come from mining or a scenario file; points
//! become cases through [`lanesweep_model::scenario::parameterization`].

mod bandwidth;
mod json_rows;
mod kde;
mod mixture;
mod mixture_density;
mod mixture_fit;
mod model;
mod model_file;
pub(crate) mod moments;
pub(crate) mod normal;
mod parameters;
mod rosenblatt;
mod valid;

pub use bandwidth::{Bandwidth, BandwidthLikelihood, BandwidthRule, LeaveOneOut, SearchEnd};
pub use kde::Kde;
pub use mixture::Mixture;
pub use model::{DensityModel, Exposure, FitOptions, Fitted, Provenance, Rate};
pub use model_file::{MAX_FILE_BYTES, read_density, write_density};
pub use moments::standard_deviation;
pub use normal::Draws;
pub use normal::{normal_cdf, normal_quantile};
pub use parameters::{BoundedColumn, Invalid, ParameterSpace};
pub use valid::{Refused, ValidFraction};
