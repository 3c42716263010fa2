//! A run of crude Monte Carlo as a plan file: the density and everything that was asked for, so that every shard and
//! the merge know the same run.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::conditional::mixture_of;
use super::crude::CrudeOptions;
use super::generator::SampleSource;
use super::map::MapAxes;
use super::plan::{SampleHeadways, SamplePlanOptions, plan_samples};
use super::tally::{SampleTally, TallyOptions};
use crate::engine::{Headway, LanePlan};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::parts::{read_sealed, seal};
use crate::stats::density::DensityModel;
use crate::stats::estimate::{BinomialInterval, StopRule};
use crate::{Error, Place, Result};

/// Kind of the sealed file.
pub(crate) const KIND: &str = "sampling plan";
/// Largest plan that is read: a density, mostly.
const MAX_PLAN_BYTES: u64 = 1 << 30;
const AGAIN: &str = "make it by `sample` of this version, with option `plan_only`";

/// A run of crude Monte Carlo.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CrudeFacts {
    /// The density file's text.
    pub density: String,
    pub profile: Profile,
    pub models: Vec<ModelId>,
    /// None where the density draws them.
    pub headways: Option<Vec<Headway>>,
    pub sobol: bool,
    pub samples: u64,
    pub seed: u64,
    pub given: Vec<(String, f64)>,
    pub criterion: Criterion,
    pub worst: usize,
    pub map: Option<MapAxes>,
    pub clopper_pearson: bool,
    pub level: f64,
    pub plan_sha256: String,
}

/// A run ready to be sampled.
pub(crate) struct CrudePlan {
    pub facts: CrudeFacts,
    pub density: DensityModel,
    pub plan: LanePlan,
}

impl CrudePlan {
    /// Plans; the hash and the density's text in `facts` are set here.
    ///
    /// # Errors
    /// As [`plan_samples`].
    pub fn new(density: DensityModel, mut facts: CrudeFacts) -> Result<CrudePlan> {
        let unreadable = |e: std::string::FromUtf8Error| Error::Internal(format!("a density is no text: {e}"));
        facts.density = String::from_utf8(density.to_json()?).map_err(unreadable)?;
        let plan = facts.plan(&density)?;
        facts.plan_sha256 = plan.hash().to_owned();
        Ok(CrudePlan { facts, density, plan })
    }

    /// As the text of a plan file, with the hash of the run.
    ///
    /// # Errors
    /// None for what this program makes.
    pub fn seal(&self) -> Result<(Vec<u8>, String)> {
        seal(KIND, &self.facts)
    }

    /// From a plan file, with the hash of the run.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for anything but a whole plan of this version.
    pub fn read(path: &Path) -> Result<(CrudePlan, String)> {
        let (facts, run_sha256): (CrudeFacts, _) = read_sealed(KIND, path, MAX_PLAN_BYTES, AGAIN)?;
        let place = Place::file(path);
        let wrong = |problem: &str| Error::input(place.clone(), problem, AGAIN);
        facts.profile.check(&place)?;
        if !(facts.level > 0.0 && facts.level < 1.0) {
            return Err(wrong("its confidence level must lie between 0 and 1"));
        }
        let density = DensityModel::from_json(facts.density.as_bytes(), &place)?;
        let parameters = density.space.parameters().len();
        if facts.map.as_ref().is_some_and(|map| map.x.parameter >= parameters || map.y.parameter >= parameters) {
            return Err(wrong("its map is over parameters that the density does not have"));
        }
        let plan = facts.plan(&density).map_err(|error| match error {
            Error::Usage { problem, .. } => wrong(&problem),
            other => other,
        })?;
        if plan.hash() != facts.plan_sha256 {
            return Err(wrong("its content is not that of its hash: another version of lanesweep made it"));
        }
        Ok((CrudePlan { facts, density, plan }, run_sha256))
    }

    /// What is counted.
    pub fn counting(&self) -> TallyOptions {
        TallyOptions { worst: self.facts.worst, criterion: self.facts.criterion, map: self.facts.map.clone() }
    }

    /// Whether counts that were read from a file can be those of this run.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, tally: &SampleTally) -> std::result::Result<(), String> {
        let joined = SampleTally::empty(&self.plan, &self.counting()).merge(tally.clone());
        joined.map(drop).map_err(|error| error.to_string())
    }

    /// How estimates are made of counts.
    pub fn options(&self, stop: StopRule) -> CrudeOptions<'_> {
        CrudeOptions {
            stop,
            interval: if self.facts.clopper_pearson {
                BinomialInterval::ClopperPearson
            } else {
                BinomialInterval::Wilson
            },
            level: self.facts.level,
            // How often scenarios with given values occur is not known.
            exposure: self.density.exposure.as_ref().filter(|_| self.facts.given.is_empty()),
            is_sampled_headway: self.density.space.has_thw(),
        }
    }
}

impl CrudeFacts {
    /// What a plan is made of; the rest is set by [`CrudePlan::new`].
    pub fn new(options: &SamplePlanOptions, profile: &Profile, given: &[(String, f64)]) -> CrudeFacts {
        CrudeFacts {
            density: String::new(),
            profile: profile.clone(),
            models: options.models.clone(),
            headways: match &options.headways {
                SampleHeadways::Each(list) => Some(list.clone()),
                SampleHeadways::Sampled => None,
            },
            sobol: options.source == SampleSource::Sobol,
            samples: options.samples,
            seed: options.seed,
            given: given.to_vec(),
            criterion: Criterion::Collision,
            worst: 0,
            map: None,
            clopper_pearson: false,
            level: 0.95,
            plan_sha256: String::new(),
        }
    }

    fn plan_options(&self) -> SamplePlanOptions {
        SamplePlanOptions {
            samples: self.samples,
            seed: self.seed,
            source: if self.sobol { SampleSource::Sobol } else { SampleSource::Random },
            models: self.models.clone(),
            headways: self.headways.clone().map_or(SampleHeadways::Sampled, SampleHeadways::Each),
        }
    }

    fn plan(&self, density: &DensityModel) -> Result<LanePlan> {
        plan_samples(density, &mixture_of(density, &self.given)?, &self.profile, &self.plan_options())
    }
}
