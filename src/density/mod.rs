//! Densities over scenario parameters.
//!
//! Here live the Gaussian mixture that every density and every proposal is, its maximum-likelihood fit, kernel
//! density estimation and the density file. Here lives nothing about lanes.

pub(crate) mod covariance;
mod mixture;
mod mixture_fit;
pub(crate) mod standard_normal;

pub use mixture::{MAX_DIMENSIONS, Mixture};
pub use mixture_fit::FitOptions;
