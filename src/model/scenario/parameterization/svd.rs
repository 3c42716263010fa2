//! Reduction of vectors by singular value decomposition: weights, fit, reconstruction. It works on columns and knows
//! nothing about scenarios.
//!
//! Rows of X are weight ∘ z − mean; an economy SVD X = U Σ Vᵀ; the first d coefficients are kept. faer computes it
//! without parallelism, so that its bits do not depend on the number of threads.

use faer::Mat;

use super::options::{SeriesScale, SvdLateral};
use lanesweep_support::vector_state::clear_upper_halves;
use lanesweep_support::{Error, Place, Result};

/// A fitted decomposition, as density files hold it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SvdBasis {
    /// Number of rows in the fit.
    pub rows: usize,
    /// Singular values, in descending order.
    pub singular_values: Vec<f64>,
    /// Weight of each column of z; > 0.
    pub weights: Vec<f64>,
    /// Mean of the weighted vectors.
    pub mean: Vec<f64>,
    /// Right singular vectors, each as long as z: of all singular values, or of the first ones.
    pub directions: Vec<Vec<f64>>,
}

/// Fits on `rows`, each a vector of `series` × `instants` values followed by extras. `lateral` is the sign of the first
/// series if it is lateral. `name` says in errors what the rows are.
pub fn fit_svd(
    rows: &[Vec<f64>],
    (series, lateral): (usize, Option<SvdLateral>),
    instants: usize,
    needed: usize,
    scale: SeriesScale,
    name: &str,
) -> Result<SvdBasis> {
    let n = rows.len();
    let place = || Place::item(name);
    if n <= needed {
        let problem = format!("{n} scenarios are too few for a decomposition with {needed} parameters");
        let help =
            format!("at least {} are needed: use more data; the kinematic parameterizations still run", needed + 1);
        return Err(Error::input(place(), problem, help));
    }
    let weights = column_weights(rows, (series, lateral), instants, scale, name)?;
    decompose(rows, weights, name)
}

/// The weight of each column; series share one. Arguments as in [`fit_svd`].
///
/// # Errors
/// [`Error::Input`] for a series or extra that is equal in all rows.
fn column_weights(
    rows: &[Vec<f64>],
    (series, lateral): (usize, Option<SvdLateral>),
    instants: usize,
    scale: SeriesScale,
    name: &str,
) -> Result<Vec<f64>> {
    let (n, p) = (rows.len(), rows[0].len());
    let deviation = |column: usize| {
        let mean = rows.iter().map(|r| r[column]).sum::<f64>() / n as f64;
        (rows.iter().map(|r| (r[column] - mean) * (r[column] - mean)).sum::<f64>() / n as f64).sqrt()
    };
    let mut weights = Vec::with_capacity(p);
    // Positions on one side vary little. With their own spread as unit, the lateral series would have ten times the
    // variance, and its directions would displace those of the speeds: docs/src/methods/parameterizations.md.
    let distance = |column: usize| (rows.iter().map(|r| r[column] * r[column]).sum::<f64>() / n as f64).sqrt();
    for j in 0..series {
        let is_mirrored = j == 0 && lateral == Some(SvdLateral::Mirrored);
        let of = |column: usize| if is_mirrored { distance(column) } else { deviation(column) };
        let spread = (0..instants).map(|k| of(j * instants + k)).sum::<f64>() / instants as f64;
        let root = match scale {
            SeriesScale::PerInstant => instants as f64,
            SeriesScale::PerSeries => (instants as f64).sqrt(),
        };
        weights.extend(std::iter::repeat_n(1.0 / (root * spread), instants));
    }
    weights.extend((series * instants..p).map(|column| 1.0 / deviation(column)));
    if weights.iter().any(|w| !w.is_finite()) {
        let problem = "a series, a duration, a speed or a gap is equal in all scenarios and cannot be scaled";
        let help = "use scenarios that differ in speed, lateral motion, duration and gap";
        return Err(Error::input(Place::item(name), problem, help));
    }
    Ok(weights)
}

/// The decomposition of rows with given weights of their columns.
///
/// # Errors
/// [`Error::Input`] if it does not converge.
fn decompose(rows: &[Vec<f64>], weights: Vec<f64>, name: &str) -> Result<SvdBasis> {
    let (n, p) = (rows.len(), weights.len());
    let mean: Vec<f64> = (0..p).map(|c| rows.iter().map(|r| r[c] * weights[c]).sum::<f64>() / n as f64).collect();
    let x = Mat::from_fn(n, p, |r, c| rows[r][c] * weights[c] - mean[c]);
    let svd = x.thin_svd();
    clear_upper_halves();
    let svd = svd.map_err(|e| {
        Error::input(Place::item(name), format!("the decomposition did not converge: {e:?}"), "report this")
    })?;
    let rank = n.min(p);
    let singular_values = (0..rank).map(|j| svd.S()[j]).collect();
    let directions = (0..rank).map(|j| (0..p).map(|c| svd.V()[(c, j)]).collect()).collect();
    Ok(SvdBasis { weights, mean, singular_values, directions, rows: n })
}

impl SvdBasis {
    /// The first `d` coefficients of a vector: σ_j u_j for the rows of the fit.
    pub fn coefficients(&self, z: &[f64], d: usize) -> Vec<f64> {
        let centred: Vec<f64> = z.iter().zip(&self.weights).zip(&self.mean).map(|((z, w), m)| z * w - m).collect();
        self.directions[..d].iter().map(|v| v.iter().zip(&centred).map(|(v, x)| v * x).sum()).collect()
    }

    /// Reconstructs the vector of coefficients: (μ + Σ c_j V_j) / weights.
    pub fn reconstruct(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut weighted = self.mean.clone();
        for (c, direction) in coefficients.iter().zip(&self.directions) {
            for (z, v) in weighted.iter_mut().zip(direction) {
                *z += c * v;
            }
        }
        weighted.iter().zip(&self.weights).map(|(z, w)| z / w).collect()
    }

    /// Σ_{j ≤ d} σ_j² / Σ σ_j² for d = 1, 2, …
    pub fn explained(&self) -> Vec<f64> {
        let total: f64 = self.singular_values.iter().map(|s| s * s).sum();
        let mut sum = 0.0;
        self.singular_values
            .iter()
            .map(|s| {
                sum += s * s;
                sum / total
            })
            .collect()
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use lanesweep_support::vector_state::upper_halves_in_use;

    /// A fit does not slow down the code that runs after it.
    #[test]
    fn a_fit_leaves_the_registers_as_scalar_code_wants_them() {
        let rows: Vec<Vec<f64>> =
            (0..60).map(|r| (0..41).map(|c| (f64::from(r) * 0.7 + f64::from(c * c)).sin()).collect()).collect();
        fit_svd(&rows, (1, None), 40, 4, SeriesScale::PerInstant, "rows").unwrap();
        match upper_halves_in_use() {
            Some(in_use) => assert!(!in_use),
            None => eprintln!("SKIPPED: this machine does not say which registers are in use"),
        }
    }
}
