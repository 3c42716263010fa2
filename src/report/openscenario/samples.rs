//! Sampled lanes from random parameters: sample `i` is a pure function of (seed, i), computed on the host in f64.
//!
//! Every parameter uses one uniform number of the sample, in the file's order; its distribution is truncated to its own
//! range and to the parameter's physical range. A point without a valid case (such as a deceleration that ends above
//! the initial speed) is redrawn from the sample's next numbers. A run keeps its input, so that its lanes can be
//! reproduced.

use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::distribution::{Draw, Range};
use super::distribution_file::{DistributionFile, Distributions, Stochastic, parse_distribution};
use super::parameters::{Names, Rename};
use crate::engine::{Block, CaseTable, Headway, LaneCase, LanePlan, Units};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::random::Stream;
use crate::run::grid::{CaseQuantity, MapParameter, Point, check_complete};
use crate::run::reopen::{DISTRIBUTION_FILE, Reopened, SampleRecord};
use crate::scenario::{Case, Category};
use crate::stats::density::Draws;
use crate::support::input_file;
use crate::support::run_folder::ESTIMATE_RECORD;
use crate::{Error, Place, Result};

/// Purpose of this random stream.
const DISTRIBUTION_PURPOSE: u32 = 0x4f53_4344;

/// Maximum number of samples: their cases are a table in memory, about 400 bytes each.
const MAX_SAMPLES: u64 = 1_000_000;

/// Maximum number of points drawn for one sample.
pub(crate) const ATTEMPTS: u32 = 64;

/// Name of the only variant.
const VARIANT: &str = "distribution";

/// One random parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledParameter {
    /// The parameter.
    pub parameter: &'static MapParameter,
    /// Its distribution, in the file's unit.
    pub draw: Draw,
    /// Factor to the parameter's unit.
    pub factor: f64,
    /// Fraction of the distribution within the parameter's physical range.
    pub kept_fraction: f64,
    /// Fraction of the distribution before truncation that its own range keeps.
    pub range_fraction: f64,
}

/// Random parameters of a category, and constant values.
#[derive(Debug, Clone, PartialEq)]
pub struct DistributionSamples {
    /// Kind of scenario.
    pub category: Category,
    /// The random parameters, in the file's order.
    pub parameters: Vec<SampledParameter>,
    /// Parameters with a constant value.
    pub fixed: Vec<(&'static MapParameter, f64)>,
    /// `numberOfTestRuns` of the file.
    pub runs: u64,
    /// `randomSeed` of the file.
    pub seed: Option<u64>,
    /// What [`Names::ignored_texts`] says of the file.
    pub ignored_texts: Option<String>,
}

/// A sample's point: values in the units of the parameters, and the number of draws.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    /// One per parameter.
    pub values: Vec<f64>,
    /// Number of draws, from 1.
    pub tries: u32,
}

impl DistributionSamples {
    /// The random parameters of a file.
    ///
    /// # Errors
    /// [`Error::Usage`] for a deterministic file, and for missing or repeated parameters; as `Names::find`;
    /// [`Error::Input`] if a parameter's range contains nothing of its distribution.
    pub fn of(
        file: &DistributionFile,
        names: &Names,
        fixed: Vec<(&'static MapParameter, f64)>,
    ) -> Result<DistributionSamples> {
        names.check_renames(&file.names())?;
        let Distributions::Stochastic(Stochastic { runs, seed, parameters: of_file }) = &file.distributions else {
            let problem = format!("{} lists values, and has no probabilities", file.path.display());
            let help = "map them by `map`, with option `distribution`";
            return Err(Error::usage(Place::option("distribution"), problem, help));
        };
        let mut parameters: Vec<SampledParameter> = Vec::new();
        for (name, line, distribution) in of_file {
            let Some((parameter, factor)) = names.find(name, *line)? else { continue };
            let ends = (parameter.min / factor, parameter.max / factor);
            let within = Range { low: ends.0.min(ends.1), high: ends.0.max(ends.1) };
            let (draw, kept_fraction) = distribution.within(within).ok_or_else(|| {
                let place = Place::file(names.path).row(*line).of(format!("parameter `{name}`"));
                let problem =
                    format!("none of its values lies in {} … {} {}", parameter.min, parameter.max, parameter.unit);
                Error::input(place, problem, "correct the distribution, or its unit with option `rename`")
            })?;
            let range_fraction = distribution.range_fraction();
            parameters.push(SampledParameter { parameter, draw, factor, kept_fraction, range_fraction });
        }
        let given: Vec<&MapParameter> =
            parameters.iter().map(|p| p.parameter).chain(fixed.iter().map(|(p, _)| *p)).collect();
        MapParameter::refuse_repeats(&given)?;
        // If the headway is not a parameter, a flag gives it.
        let has = |quantity| {
            let is_given = given.iter().any(|p| p.quantity == quantity);
            is_given || (quantity == CaseQuantity::Thw && !given.iter().any(|p| p.quantity == CaseQuantity::Gap))
        };
        check_complete(
            names.category,
            false,
            &has,
            ("a sample", "give it a distribution, or a value by option `set`"),
        )?;
        let ignored_texts = names.ignored_texts(file)?;
        Ok(DistributionSamples { category: names.category, parameters, fixed, runs: *runs, seed: *seed, ignored_texts })
    }

    /// Whether the initial distance is one of the parameters.
    pub fn has_distance(&self) -> bool {
        let given = self.parameters.iter().map(|p| p.parameter).chain(self.fixed.iter().map(|(p, _)| *p));
        given.into_iter().any(|p| matches!(p.quantity, CaseQuantity::Gap | CaseQuantity::Thw))
    }

    /// The point of a sample: the first draw that is a valid case.
    ///
    /// # Errors
    /// [`Error::Usage`] if none of `ATTEMPTS` draws is valid.
    pub fn draw(&self, seed: u64, index: u64, profile: &Profile) -> Result<Sampled> {
        self.drawn(seed, index, profile).map(|(sampled, _, _)| sampled)
    }

    fn drawn(&self, seed: u64, index: u64, profile: &Profile) -> Result<(Sampled, Point, Case)> {
        let mut draws = Draws::new(Stream { seed, purpose: DISTRIBUTION_PURPOSE }, index);
        let mut reason = None;
        for attempt in 1..=ATTEMPTS {
            let values: Vec<f64> = self.parameters.iter().map(|p| p.value(draws.uniform())).collect();
            let mut point = Point::default();
            let random = self.parameters.iter().map(|p| p.parameter).zip(values.iter().copied());
            for (parameter, value) in self.fixed.iter().copied().chain(random) {
                point.set(parameter, value);
            }
            match point.plain_case(self.category, profile).and_then(|case| case.case(profile.frame.time_cap_s)) {
                Ok(case) => return Ok((Sampled { values, tries: attempt }, point, case)),
                Err(error) => reason = Some(error),
            }
        }
        let why = reason.map_or(String::new(), |error| format!(", the last because {error}"));
        let problem = format!("sample {index}: none of {ATTEMPTS} draws is a case{why}");
        Err(Error::usage(
            Place::option("distribution"),
            problem,
            "change the distributions so that most draws are cases",
        ))
    }

    /// The plan whose unit `i` is sample `i`, and the total number of draws. Headways are the given ones, or the
    /// parameter.
    ///
    /// # Errors
    /// As [`DistributionSamples::draw`]; [`Error::Usage`] for no samples or more than `MAX_SAMPLES`, and for headways
    /// together with a distance parameter.
    pub fn plan(
        &self,
        (samples, seed): (u64, u64),
        profile: &Profile,
        models: &[ModelId],
        headways: &[Headway],
    ) -> Result<(LanePlan, u64)> {
        if !(1..=MAX_SAMPLES).contains(&samples) {
            let problem = format!("{samples} samples of a distribution file cannot be run");
            let help = format!("give option `samples` from 1 to {MAX_SAMPLES}: their cases are kept in memory");
            return Err(Error::usage(Place::option("samples"), problem, help));
        }
        let own = [Headway::GapM(0.0)];
        let headways = if self.has_distance() { &own[..] } else { headways };
        let mut source = CaseTable::new([1]);
        let mut tries = 0;
        for index in 0..samples {
            let (sampled, point, case) = self.drawn(seed, index, profile)?;
            tries += u64::from(sampled.tries);
            let of_headway = point.get(CaseQuantity::Thw).map(|thw_s| thw_s * case.ego_speed_mps);
            let gap_m = point.get(CaseQuantity::Gap).or(of_headway).unwrap_or(0.0);
            source.blocks[0].cases.push(LaneCase::encode(&case, profile, &mut source.tables).ahead_by(gap_m));
        }
        let block = Block::new(self.category, Units::Numbered(samples), vec![VARIANT.to_owned()]);
        let plan = LanePlan::new(profile.clone(), models.to_vec(), headways.to_vec(), vec![block], Arc::new(source))?;
        Ok((plan, tries))
    }
}

impl SampledParameter {
    /// The value of a uniform number, in the parameter's unit.
    fn value(&self, uniform: f64) -> f64 {
        (self.draw.value(uniform) * self.factor).clamp(self.parameter.min, self.parameter.max)
    }
}

const VERSION: u64 = 1;

/// A distribution file with the mapping of its parameters.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampledFile {
    lanesweep_distribution: u64,
    /// The file's path.
    pub file: String,
    /// Its text.
    pub text: String,
    /// Kind of scenario.
    pub category: Category,
    /// Their name, our name, factor.
    renames: Vec<(String, String, f64)>,
    set: Vec<(String, f64)>,
}

impl SampledFile {
    /// Reads a file; parameters missing in it are `set`.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Input`].
    pub fn read(path: &Path, category: Category, renames: &[Rename], set: &[(String, f64)]) -> Result<SampledFile> {
        Ok(SampledFile {
            lanesweep_distribution: VERSION,
            file: path.display().to_string(),
            text: input_file::read_text(path, input_file::MAX_XML_BYTES)?,
            category,
            renames: renames.iter().map(|r| (r.theirs.clone(), r.ours.clone(), r.factor)).collect(),
            set: set.to_vec(),
        })
    }

    /// The random parameters of the file.
    ///
    /// # Errors
    /// As [`DistributionSamples::of`].
    pub fn samples(&self) -> Result<DistributionSamples> {
        let path = Path::new(&self.file);
        let file = parse_distribution(&self.text, path)?;
        let rename = |(theirs, ours, factor): &(String, String, f64)| Rename {
            theirs: theirs.clone(),
            ours: ours.clone(),
            factor: *factor,
        };
        let renames: Vec<Rename> = self.renames.iter().map(rename).collect();
        let fixed = |(name, value): &(String, f64)| {
            let parameter = MapParameter::find(self.category, name, "option `set`")?;
            Ok((parameter, parameter.check(*value, "option `set`")?))
        };
        let fixed = self.set.iter().map(fixed).collect::<Result<Vec<_>>>()?;
        DistributionSamples::of(&file, &Names { category: self.category, renames: &renames, path }, fixed)
    }

    /// Description of the data.
    pub fn data(&self) -> String {
        format!("distributions of {}", Path::new(&self.file).file_name().unwrap_or_default().to_string_lossy())
    }

    /// The content of [`DISTRIBUTION_FILE`].
    ///
    /// # Errors
    /// None for a file that this program has read.
    pub fn to_json(&self) -> Result<Vec<u8>> {
        let unwritten = |e: serde_json::Error| Error::Internal(format!("a distribution cannot be kept: {e}"));
        serde_json::to_vec_pretty(self).map_err(unwritten)
    }
}

/// Opens the finished run of a folder, including runs of distributions; see [`Reopened::run`].
///
/// # Errors
/// As [`Reopened::run`].
pub fn reopen(dir: &Path, key: &str) -> Result<Reopened> {
    Reopened::run(dir, key, plan_of)
}

/// The plan of a run of distributions, and a description of its data.
fn plan_of(dir: &Path, record: &SampleRecord) -> Result<(LanePlan, String)> {
    let path = dir.join(DISTRIBUTION_FILE);
    let wrong = |problem: String| {
        let help = "give the folder (option `out`) of a `lanesweep sample` run of a distribution by this version";
        Error::input(Place::file(&path), problem, help)
    };
    let again = "run `lanesweep sample` with option `distribution` into this folder again";
    let text = input_file::read_json(&path, input_file::MAX_TABLE_BYTES, "the record of a distribution", again)?;
    let sampled: SampledFile =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a distribution: {e}")))?;
    if sampled.lanesweep_distribution != VERSION {
        return Err(wrong(format!("its version is {}, this program reads {VERSION}", sampled.lanesweep_distribution)));
    }
    let profile = &record.profile;
    profile.check(&Place::file(dir.join(ESTIMATE_RECORD)))?;
    let requested = (record.samples, record.seed);
    let (plan, _) = sampled.samples()?.plan(requested, profile, &record.models, &record.plan_headways)?;
    if record.plan_sha256.as_deref() != Some(plan.hash()) {
        return Err(wrong("its plan does not match the distributions and the profile beside it".to_owned()));
    }
    Ok((plan, sampled.data()))
}
