//! Densities over scenario parameters.
//!
//! Here live the Gaussian mixture that every density and every proposal is, kernel density estimation and the
//! density file. Here lives nothing about lanes.

mod mixture;

pub use mixture::Mixture;
