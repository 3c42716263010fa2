//! A parameterization as a file: what a search has found, for every verb that takes a parameterization. One JSON object
//! with a SHA-256 over its content, lossless for every number.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::linear::LinearSpec;
use super::options::ParameterizationOptions;
use super::parameter::Parameter;
use super::reduction::{Encoder, Reduction};
use super::svd::SvdBasis;
use super::{Family, Linear, Parameterization};
use crate::scenario::Category;
use crate::support::input_file;
use crate::support::plain_text::hex;
use crate::{Error, Place, Result};

const VERSION: u64 = 1;
/// Maximum size of a file that is read, bytes.
const MAX_BYTES: u64 = 64 << 20;
/// Maximum length of a name; it is a part of the names of lanes and files.
const MAX_KEY: usize = 40;

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    lanesweep_parameterization: u64,
    content_sha256: String,
    category: Category,
    key: String,
    description: String,
    /// The data that it was fitted on, in one line.
    fitted_on: String,
    fitted: Option<Fitted>,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fitted {
    spec: LinearSpec,
    parameters: Vec<Parameter>,
    encoder: Encoder,
    basis: SvdBasis,
    options: ParameterizationOptions,
}

impl File {
    fn hash(&self) -> Result<String> {
        let blank = File { content_sha256: String::new(), ..self.clone() };
        let text = serde_json::to_vec(&blank).map_err(|e| Error::Internal(format!("a description as JSON: {e}")))?;
        Ok(hex(&Sha256::digest(text)))
    }
}

impl Parameterization {
    /// The parameterization as the text of a file. One of the paper without a fit is named only.
    ///
    /// # Errors
    /// [`Error::Internal`] for the paper's decomposition, whose basis it does not hold.
    pub fn to_json(&self, fitted_on: &str) -> Result<Vec<u8>> {
        let fitted = match &self.family {
            Family::Kinematic(_) => None,
            Family::Linear(Linear(reduction)) => {
                let (spec, encoder, parameters) =
                    reduction.linear_parts().cloned().ok_or_else(|| Error::Internal("a basis without spec".into()))?;
                let (basis, options) = (reduction.basis.clone(), reduction.options().clone());
                Some(Fitted { spec, parameters, encoder, basis, options })
            }
            Family::Svd(_) => return Err(Error::Internal(format!("{} has no basis of its own", self.name()))),
        };
        let mut file = File {
            lanesweep_parameterization: VERSION,
            content_sha256: String::new(),
            category: self.category,
            key: self.key.to_string(),
            description: self.description(),
            fitted_on: fitted_on.to_owned(),
            fitted,
        };
        file.content_sha256 = file.hash()?;
        let text = serde_json::to_string_pretty(&file);
        text.map(|text| (text + "\n").into_bytes()).map_err(|e| Error::Internal(format!("a description as JSON: {e}")))
    }

    /// Reads a parameterization that [`Parameterization::to_json`] made.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for a file that is none, was changed, or contradicts itself.
    pub fn read(path: &Path) -> Result<Parameterization> {
        let wrong = |problem: String| Error::input(Place::file(path), problem, "make it again with `lanesweep search`");
        let bytes = input_file::read(path, MAX_BYTES)?;
        let file: File =
            serde_json::from_slice(&bytes).map_err(|e| wrong(format!("it is no parameterization: {e}")))?;
        if file.lanesweep_parameterization != VERSION {
            return Err(wrong(format!("version {}; this program reads {VERSION}", file.lanesweep_parameterization)));
        }
        let hash = file.hash()?;
        if hash != file.content_sha256 {
            let problem = format!("is {}, but the content has {hash}: checksum mismatch", file.content_sha256);
            let place = Place::file(path).column("content_sha256");
            return Err(Error::input(place, problem, "make the file again with `lanesweep search`"));
        }
        let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
        if file.key.is_empty() || file.key.len() > MAX_KEY || !file.key.chars().all(is_plain) {
            return Err(wrong(format!("`{}` is no name of letters, digits and dashes", file.key)));
        }
        // Two winners of one category differ by the names of their files.
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let is_name = !stem.is_empty() && stem.len() <= MAX_KEY && stem.chars().all(is_plain);
        let key = if is_name && file.fitted.is_some() { stem.to_owned() } else { file.key };
        let known = Parameterization::find(file.category, &key);
        match (file.fitted, known) {
            (None, Some(known)) if known.coefficients().is_none() => Ok(known),
            (None, _) => Err(wrong(format!("it has no basis, and there is no kinematic `{}`", key))),
            (Some(_), Some(_)) => Err(wrong(format!("`{}` is the name of a parameterization of the paper", key))),
            (Some(fitted), None) => {
                fitted.options.validate()?;
                let Fitted { spec, parameters, encoder, basis, options } = fitted;
                let linear = Some((spec, encoder, parameters));
                let reduction = Reduction::from_parts(file.category, basis, &options, linear);
                reduction.map(|reduction| Parameterization::linear(key, reduction)).map_err(|e| wrong(e.to_string()))
            }
        }
    }
}
