//! Proposal files, so that a proposal can be reused in parts or with other seeds.

use std::path::Path;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use lanesweep_stats::density::{DensityModel, MAX_FILE_BYTES, Mixture};
use lanesweep_support::{Error, Place, Result, input_file};

const VERSION: u64 = 2;

const HOW_TO_REMAKE: &str = "write it again by `sample --estimator is`";

/// The mixture of a proposal over the parameters of a density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    lanesweep_proposal: u64,
    /// Names of the parameters, in order.
    parameters: Vec<String>,
    /// SHA-256 of the density that it was made for.
    density_sha256: String,
    weights: Vec<f64>,
    means: Vec<Vec<f64>>,
    /// Lower-triangular factors of the covariances, row by row, one per component.
    factors: Vec<Vec<f64>>,
}

fn names(density: &DensityModel) -> Vec<String> {
    density.space.parameters().iter().map(|p| p.name.clone()).collect()
}

/// A proposal for a density as the text of a file.
///
/// # Errors
/// None for types of this program.
pub fn proposal_text(density: &DensityModel, proposal: &Mixture) -> Result<String> {
    let components = 0..proposal.weights().len();
    let file = File {
        lanesweep_proposal: VERSION,
        parameters: names(density),
        density_sha256: density.content_sha256()?,
        weights: proposal.weights().to_vec(),
        means: components.clone().map(|k| proposal.mean(k).to_vec()).collect(),
        factors: components.map(|k| proposal.factor(k).transpose().as_slice().to_vec()).collect(),
    };
    serde_json::to_string_pretty(&file).map_err(|e| Error::Internal(format!("a proposal cannot be written: {e}")))
}

/// Reads a proposal for a density.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if it is not a proposal of this version over the density's parameters.
pub fn read_proposal(path: &Path, density: &DensityModel) -> Result<Mixture> {
    proposal_from_text(
        &input_file::read_json(path, MAX_FILE_BYTES, "a proposal", HOW_TO_REMAKE)?,
        density,
        &Place::file(path),
    )
}

/// A proposal for a density from the text of a file.
///
/// # Errors
/// [`Error::Input`] at `place`, as [`read_proposal`].
pub fn proposal_from_text(text: &[u8], density: &DensityModel, place: &Place) -> Result<Mixture> {
    let wrong = |problem: String| Error::input(place.clone(), problem, HOW_TO_REMAKE);
    let value: serde_json::Value = serde_json::from_slice(text).map_err(|e| wrong(format!("it is no JSON: {e}")))?;
    match value.get("lanesweep_proposal").map(serde_json::Value::as_u64) {
        None => return Err(wrong("it is no proposal: `lanesweep_proposal` is missing".to_owned())),
        Some(Some(VERSION)) => (),
        Some(other) => {
            let found = other.map_or("unreadable".to_owned(), |v| v.to_string());
            return Err(wrong(format!("its version is {found}, this program reads {VERSION}")));
        }
    }
    let file: File = serde_json::from_value(value).map_err(|e| wrong(format!("it is no proposal: {e}")))?;
    if file.parameters != names(density) {
        let problem =
            format!("it is over {}, the density over {}", file.parameters.join(", "), names(density).join(", "));
        return Err(wrong(problem));
    }
    let (n, d) = (file.means.len(), file.parameters.len());
    if file.factors.iter().any(|factor| factor.len() != d * d) {
        return Err(wrong(format!("a factor does not have {d} × {d} numbers")));
    }
    let factors = file.factors.iter().map(|factor| DMatrix::from_row_slice(d, d, factor)).collect();
    Mixture::new(file.weights, file.means, factors, (0..n).collect()).map_err(|e| wrong(e.to_string()))
}
