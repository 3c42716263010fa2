//! The density file: one JSON object, readable by people, lossless for every f64, with a version and a SHA-256
//! over its content.
//!
//! The SHA-256 is that of the same object as compact JSON in the order of [`File`], with an empty `content_sha256`. It
//! names the density in records; reading calculates it anew, so a file may be edited.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::bandwidth::{Bandwidth, BandwidthLikelihood};
use super::json_rows::to_readable_json;
use super::kde::Kde;
use super::model::{DensityModel, Exposure, Provenance};
use super::parameters::ParameterSpace;
use super::valid::ValidFraction;
use lanesweep_model::scenario::parameterization::{
    Parameter, Parameterization, ParameterizationOptions, Reduction, Sizes, SvdBasis,
};
use lanesweep_model::scenario::{Category, Scenario, problem_of};
use lanesweep_support::atomic_file::AtomicFile;
use lanesweep_support::plain_text::hex;
use lanesweep_support::{Error, Place, Result, input_file};

/// Version of the file format that this program writes and reads.
const VERSION: u64 = 2;

/// Maximum file size that is read, bytes: 10⁶ kernels of ten parameters fit.
pub const MAX_FILE_BYTES: u64 = 256 << 20;

/// Valid bandwidths, in units of the parameters' scales.
const BANDWIDTHS: RangeInclusive<f64> = 1e-9..=1e3;

/// Valid lengths and widths of vehicles, m.
const SIZES_M: RangeInclusive<f64> = 0.1..=100.0;

const REFIT: &str = "make the file again with `lanesweep fit`";

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    lanesweep_density: u64,
    content_sha256: String,
    category: Category,
    parameterization: String,
    with_thw: bool,
    provenance: Provenance,
    parameters: Vec<Parameter>,
    /// s_j, one per parameter, in its unit.
    scale: Vec<f64>,
    bandwidth: Bandwidth,
    p_valid: ValidFraction,
    exposure: Option<Exposure>,
    /// Always null; earlier versions had figures here.
    #[serde(default)]
    representativeness: (),
    /// Means over the scenarios, because sizes are not parameters.
    sizes: Sizes,
    options: ParameterizationOptions,
    /// The decomposition of a parameterization by SVD.
    basis: Option<SvdBasis>,
    /// One row per scenario, in the order of the parameters.
    kernels: Vec<Vec<f64>>,
    /// One scenario per kernel, with its recorded series; or an empty list.
    scenarios: Vec<Scenario>,
}

impl File {
    fn of(model: &DensityModel) -> Result<File> {
        let space = &model.space;
        let d = space.dimensions() - usize::from(space.has_thw());
        let basis =
            space.reduction().map(|r| SvdBasis { directions: r.basis.directions[..d].to_vec(), ..r.basis.clone() });
        let mut file = File {
            lanesweep_density: VERSION,
            content_sha256: String::new(),
            category: model.category(),
            parameterization: space.id().key.to_string(),
            with_thw: space.has_thw(),
            provenance: model.provenance.clone(),
            parameters: space.parameters().to_vec(),
            scale: model.kde.scale().to_vec(),
            bandwidth: *model.kde.bandwidth(),
            p_valid: model.valid.clone(),
            exposure: model.exposure,
            representativeness: (),
            sizes: model.sizes,
            options: space.options().clone(),
            basis,
            kernels: model.kde.points().to_vec(),
            scenarios: model.scenarios.clone(),
        };
        file.content_sha256 = file.hash()?;
        Ok(file)
    }

    fn hash(&self) -> Result<String> {
        let blank = File { content_sha256: String::new(), ..self.clone() };
        let text = serde_json::to_vec(&blank).map_err(|e| Error::Internal(format!("a density as JSON: {e}")))?;
        Ok(hex(&Sha256::digest(text)))
    }

    fn model(self, place: &Place) -> Result<DensityModel> {
        let wrong = |column: &str, problem: String| Err(Error::input(place.clone().column(column), problem, REFIT));
        let below = |error: Error| inside(place, error);
        // Checked first, because lengths follow from these numbers.
        self.options.validate().map_err(below)?;
        let reduction = self.basis.map(|basis| Reduction::from_parts(self.category, basis, &self.options));
        let reduction = reduction.transpose().map_err(below)?;
        let Some(id) = Parameterization::find(self.category, &self.parameterization) else {
            let problem = format!("there is no `{}` of category {}", self.parameterization, self.category.label());
            return wrong("parameterization", problem);
        };
        let space = ParameterSpace::new(id, &self.options, reduction.as_ref(), self.with_thw).map_err(below)?;
        if space.parameters() != self.parameters {
            let names: Vec<&str> = space.parameters().iter().map(|p| p.name.as_str()).collect();
            let problem = format!("expected {}, each with the unit and bounds of this version", names.join(", "));
            return wrong("parameters", problem);
        }
        if self.scale.len() != space.dimensions() {
            let problem = format!("{} numbers, expected one per parameter: {}", self.scale.len(), space.dimensions());
            return wrong("scale", problem);
        }
        let kde = Kde::from_parts(self.kernels, self.scale, self.bandwidth).map_err(below)?;
        for (j, parameter) in space.parameters().iter().enumerate() {
            let ([smallest, largest], unit) = (parameter.physical_range(), &parameter.unit);
            let of = |value: f64| format!("`{}` is {value:e} {unit}", parameter.name);
            let scale = kde.scale()[j];
            if !(smallest..=largest).contains(&scale) {
                return wrong("scale", format!("{}; expected {smallest:e} to {largest} {unit}", of(scale)));
            }
            let kernel = kde.points().iter().enumerate().find(|(_, point)| point[j].abs() > largest);
            if let Some((i, point)) = kernel {
                let expected = format!("expected −{largest} to {largest} {unit}");
                return wrong("kernels", format!("kernel {}: {}; {expected}", i + 1, of(point[j])));
            }
        }
        if !BANDWIDTHS.contains(&kde.bandwidth().value) {
            let problem =
                format!("{:e}; expected {:e} to {}", kde.bandwidth().value, BANDWIDTHS.start(), BANDWIDTHS.end());
            return wrong("bandwidth", problem);
        }
        let likelihood = kde.bandwidth().likelihood;
        let is_interval = |of: BandwidthLikelihood| {
            of.low <= of.best && of.best <= of.high && BANDWIDTHS.contains(&of.low) && BANDWIDTHS.contains(&of.high)
        };
        if likelihood.is_some_and(|of| !is_interval(of)) {
            let problem = "low, best and high of its likelihood are no interval of bandwidths".to_owned();
            return wrong("bandwidth", problem);
        }
        let outside = kde.points().iter().enumerate().find_map(|(i, p)| Some((i, space.check(p).err()?)));
        if let Some((i, invalid)) = outside {
            return wrong("kernels", format!("kernel {} is outside the valid region: {invalid}", i + 1));
        }
        if !self.scenarios.is_empty() && self.scenarios.len() != kde.points().len() {
            let problem = format!("{}, expected one per kernel: {}", self.scenarios.len(), kde.points().len());
            return wrong("scenarios", problem);
        }
        for scenario in &self.scenarios {
            let is_other = (scenario.category != self.category).then(|| format!("is no {}", self.category.label()));
            let is_left_out = (!scenario.kept).then(|| "did not pass the filters".to_owned());
            if let Some(problem) = is_other.or(is_left_out).or_else(|| problem_of(scenario)) {
                return wrong("scenarios", format!("scenario {}: {problem}", scenario.id));
            }
        }
        let share = self.p_valid;
        if !(share.estimate > 0.0 && share.estimate <= 1.0) || share.valid > share.draws {
            return wrong(
                "p_valid",
                format!(
                    "{} ({} of {}); expected a fraction above 0 and at most 1",
                    share.estimate, share.valid, share.draws
                ),
            );
        }
        let sizes = [Some(self.sizes.ego), Some(self.sizes.target), self.sizes.lead];
        let lengths = sizes.into_iter().flatten().flat_map(|s| [s.length_m, s.width_m]);
        if let Some(length) = lengths.into_iter().find(|v| !SIZES_M.contains(v)) {
            return wrong("sizes", format!("{length} m; expected {} to {} m", SIZES_M.start(), SIZES_M.end()));
        }
        if self.category == Category::CutOut && self.sizes.lead.is_none() {
            return wrong("sizes", "a cut-out needs the size of the vehicle ahead (`lead`)".to_owned());
        }
        Ok(DensityModel {
            space,
            kde,
            valid: share,
            sizes: self.sizes,
            exposure: self.exposure.map(|of| Exposure::new(of.events, of.driven)),
            provenance: self.provenance,
            scenarios: self.scenarios,
        })
    }
}

/// Converts an error about a part of the file to one about the file.
fn inside(place: &Place, error: Error) -> Error {
    match error {
        Error::Input { place: part, problem, .. } | Error::Usage { place: part, problem, .. } => {
            let mut place = place.clone();
            place.item = part.item;
            place.column = part.column;
            Error::input(place, problem, REFIT)
        }
        other => other,
    }
}

impl DensityModel {
    /// SHA-256 over everything in the density file, in hexadecimal; identifies a density in its results.
    ///
    /// # Errors
    /// None for a model that this crate made or read.
    pub fn content_sha256(&self) -> Result<String> {
        Ok(File::of(self)?.content_sha256)
    }

    /// The density file.
    ///
    /// # Errors
    /// [`Error::Internal`] for a number that is not finite.
    pub fn to_json(&self) -> Result<Vec<u8>> {
        to_readable_json(&File::of(self)?)
    }

    /// Reads a density file's content; `place` names it in errors.
    ///
    /// # Errors
    /// [`Error::Input`] unless it is a complete density file of this version: see [`read_density`].
    pub fn from_json(text: &[u8], place: &Place) -> Result<DensityModel> {
        check_version(text, place)?;
        let mut file: File = serde_json::from_slice(text).map_err(|e| broken(place, &e))?;
        if file.content_sha256 != file.hash()? {
            file.provenance.data.push_str("; changed since `fit`");
        }
        file.model(place)
    }
}

/// Checks version and kind first, so that another file than those of [`File`] is not reported as broken.
fn check_version(text: &[u8], place: &Place) -> Result<()> {
    #[derive(Deserialize)]
    struct Version {
        lanesweep_density: Option<serde_json::Value>,
        // What only files of earlier versions hold.
        mixture: Option<IgnoredAny>,
        representativeness: Option<IgnoredAny>,
    }
    let version: Version = serde_json::from_slice(text).map_err(|e| broken(place, &e))?;
    if version.mixture.is_some() || version.representativeness.is_some() {
        return Err(Error::input(place.clone(), "a density of an earlier version of lanesweep", REFIT));
    }
    match version.lanesweep_density {
        Some(value) if value.as_u64() == Some(VERSION) => Ok(()),
        Some(value) => Err(Error::input(
            place.clone().column("lanesweep_density"),
            format!("version {value}, but this program reads version {VERSION}"),
            "read it with the version of lanesweep that wrote it, or fit again",
        )),
        None => Err(Error::input(
            place.clone(),
            "no density file: `lanesweep_density` is missing",
            "expected a file that `lanesweep fit` wrote",
        )),
    }
}

fn broken(place: &Place, error: &serde_json::Error) -> Error {
    let text = error.to_string();
    let reason = text.split(" at line ").next().unwrap_or(&text);
    Error::input(place.clone().row(error.line() as u64), format!("not a density file: {reason}"), REFIT)
}

/// Reads a density file.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Input`] naming file, line or field: not JSON, another version, a
/// missing or unknown field, a number that is not finite, lengths that do not fit, or more than [`MAX_FILE_BYTES`].
pub fn read_density(path: &Path) -> Result<DensityModel> {
    let bytes = std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?.len();
    if bytes > MAX_FILE_BYTES {
        return Err(Error::input(
            Place::file(path),
            format!("{} MiB, but a density file has at most {}", bytes >> 20, MAX_FILE_BYTES >> 20),
            "fit on fewer scenarios, or check that this is the right file",
        ));
    }
    let text = input_file::read_json(path, MAX_FILE_BYTES, "a density file", REFIT)?;
    DensityModel::from_json(&text, &Place::file(path))
}

/// Writes a density file atomically.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be written to.
pub fn write_density(path: &Path, model: &DensityModel) -> Result<()> {
    let text = model.to_json()?;
    let mut file = AtomicFile::create(path)?;
    file.append(&text)?;
    file.stage()?.publish()
}
