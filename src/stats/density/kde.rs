//! Kernel density estimate: isotropic Gaussian kernels on points divided by their scales, one bandwidth chosen by
//! leave-one-out likelihood. Densities are over the parameters in their own units.

use super::bandwidth::{Bandwidth, BandwidthRule, LeaveOneOut};
use super::mixture::Mixture;
use super::moments::scale_of;
use super::normal::Draws;
use lanesweep_random::Stream;
use lanesweep_support::{Error, Place, Result};

/// f̂(x) = 1/N Σ_i Π_j φ((x_j − x_ij)/(h s_j))/(h s_j).
#[derive(Debug, Clone, PartialEq)]
pub struct Kde {
    /// One per point, each of d numbers.
    points: Vec<Vec<f64>>,
    /// s_j, > 0.
    scale: Vec<f64>,
    bandwidth: Bandwidth,
}

impl Kde {
    /// Fits scale and bandwidth. `names` are the parameters' names, for messages.
    ///
    /// # Errors
    /// [`Error::Input`] for fewer than d + 1 points (or 2), and for a parameter that is equal in all of them or not
    /// finite.
    pub fn fit(points: Vec<Vec<f64>>, names: &[&str], rule: BandwidthRule) -> Result<Kde> {
        let (n, d) = (points.len(), names.len());
        let data = || Place::item("density");
        if n < (d + 1).max(2) {
            let what = match n {
                0 => "no scenario".to_owned(),
                1 => "1 scenario".to_owned(),
                n => format!("{n} scenarios"),
            };
            return Err(Error::input(
                data(),
                format!("{what} cannot tell a density of {d} parameters"),
                format!("at least {} are needed: use more data, or a parameterization with fewer", (d + 1).max(2)),
            ));
        }
        check_points(&points, names)?;
        let column = |j: usize| points.iter().map(|p| p[j]).collect::<Vec<_>>();
        let scale: Vec<f64> = (0..d).map(|j| scale_of(&column(j))).collect();
        if let Some(j) = scale.iter().position(|s| *s <= 0.0) {
            return Err(Error::input(
                data().column(names[j]),
                format!("is {} in all {n} scenarios, so it has no density", points[0][j]),
                "use scenarios that differ in it, or a parameterization without it",
            ));
        }
        let scaled: Vec<Vec<f64>> = points.iter().map(|p| p.iter().zip(&scale).map(|(v, s)| v / s).collect()).collect();
        let bandwidth = LeaveOneOut::new(&scaled).search(rule);
        Ok(Kde { points, scale, bandwidth })
    }

    /// An estimate with known scale and bandwidth.
    ///
    /// # Errors
    /// [`Error::Input`] if lengths differ, there is no point, or a number of a point is not finite. The caller
    /// ensures that scales and bandwidth are above 0.
    pub fn from_parts(points: Vec<Vec<f64>>, scale: Vec<f64>, bandwidth: Bandwidth) -> Result<Kde> {
        if points.is_empty() {
            return Err(Error::input(Place::item("density"), "has no kernel", "fit it again"));
        }
        let names: Vec<String> = (1..=scale.len()).map(|j| format!("parameter {j}")).collect();
        check_points(&points, &names.iter().map(String::as_str).collect::<Vec<_>>())?;
        Ok(Kde { points, scale, bandwidth })
    }

    /// The same kernels with another bandwidth, in units of the scales.
    pub(crate) fn at_bandwidth(&self, value: f64) -> Kde {
        Kde { bandwidth: Bandwidth { value, likelihood: None, ..self.bandwidth }, ..self.clone() }
    }

    /// Kernel centres.
    pub fn points(&self) -> &[Vec<f64>] {
        &self.points
    }

    /// s_j, one per parameter, in its unit.
    pub fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// h and how it was found.
    pub fn bandwidth(&self) -> &Bandwidth {
        &self.bandwidth
    }

    /// h s_j: standard deviation of a kernel, one per parameter, in its unit.
    pub fn spread(&self) -> Vec<f64> {
        self.scale.iter().map(|s| s * self.bandwidth.value).collect()
    }

    /// The same density as a mixture of Gaussians.
    ///
    /// # Errors
    /// None for an estimate that this type made.
    pub fn mixture(&self) -> Result<Mixture> {
        Mixture::of_kernels(self.points.clone(), &self.spread())
    }

    /// Draw of an index: a random kernel, then normal noise. Not checked for validity.
    pub fn draw(&self, stream: &Stream, index: u64) -> Vec<f64> {
        let mut draws = Draws::new(*stream, index);
        let point = &self.points[draws.below(self.points.len())];
        point.iter().zip(&self.scale).map(|(p, s)| p + s * self.bandwidth.value * draws.normal()).collect()
    }
}

fn check_points(points: &[Vec<f64>], names: &[&str]) -> Result<()> {
    for (i, point) in points.iter().enumerate() {
        let place = || Place::item(format!("kernel {}", i + 1));
        if point.len() != names.len() {
            let problem = format!("has {} numbers, expected {}", point.len(), names.len());
            return Err(Error::input(place(), problem, "give one number per parameter"));
        }
        if let Some(j) = point.iter().position(|v| !v.is_finite()) {
            let problem = format!("is {}, expected a finite number", point[j]);
            return Err(Error::input(place().column(names[j]), problem, "correct the scenario or leave it out"));
        }
    }
    Ok(())
}
