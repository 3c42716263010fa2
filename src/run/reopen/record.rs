//! Records of a finished run: `run.json` of a study, `estimate.json` of a sampling run.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::engine::{ENGINE_VERSION, Headway, LanePlan};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::parts::{PLAN_FILE, RUN_PLAN_FILE, kind_of};
use crate::run::sampling::{Estimator, SampleHeadways, SampleOptions, SampleSource, mixture_of, plan_samples};
use crate::run::study::Study;
use crate::stats::density::{DensityModel, read_density};
use crate::support::input_file::{MAX_TABLE_BYTES, read_json};
use crate::support::run_folder::{ESTIMATE_RECORD, STUDY_RECORD};
use crate::{Error, Place, Result};

/// Fields read from `estimate.json` of a sampling run.
#[derive(Debug, Clone, Deserialize)]
pub struct SampleRecord {
    lanesweep_estimate: u64,
    /// Files of earlier versions have no engine number.
    engine: Option<u64>,
    estimator: String,
    points: String,
    #[serde(default)]
    given: Vec<(String, f64)>,
    /// Requested number of samples.
    pub samples: u64,
    /// Seed of the draws.
    pub seed: u64,
    /// Driver models.
    pub models: Vec<ModelId>,
    /// Headways of the plan.
    pub plan_headways: Vec<Headway>,
    /// Profile, with its time step.
    pub profile: Profile,
    /// Hash of the plan of crude Monte Carlo.
    pub plan_sha256: Option<String>,
}

impl SampleRecord {
    /// Reads the record of a folder.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if the folder does not hold a run of this version and engine.
    pub(crate) fn read(dir: &Path) -> Result<SampleRecord> {
        let path = dir.join(ESTIMATE_RECORD);
        let wrong = |problem: String| {
            let help = "give the folder (option `out`) of a `lanesweep sample` run by this version";
            Error::input(Place::file(&path), problem, help)
        };
        let text =
            read_json(&path, MAX_TABLE_BYTES, "the record of a run", "run `lanesweep sample` into this folder again")?;
        let run: SampleRecord =
            serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a run: {e}")))?;
        if run.lanesweep_estimate != 1 {
            return Err(wrong(format!("its version is {}, this program reads 1", run.lanesweep_estimate)));
        }
        check_engine(run.engine).map_err(wrong)?;
        if !["mc", "is"].contains(&&*run.estimator) {
            return Err(wrong(format!("estimator `{}` is not known", run.estimator)));
        }
        Ok(run)
    }

    /// The plan of crude Monte Carlo, remade from the density in the same folder.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if the folder does not hold a complete and unchanged run of crude Monte Carlo.
    pub(super) fn plan(&self, dir: &Path) -> Result<(LanePlan, DensityModel)> {
        let path = dir.join("density.json");
        let again = "run `lanesweep sample` into this folder again: it writes the density that it samples";
        let density = read_density(&path).map_err(|error| match error {
            Error::Input { place, problem, .. } => Error::input(*place, problem, again),
            Error::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
                Error::input(Place::file(&path), "the density of the run is missing", again)
            }
            other => other,
        })?;
        let wrong = |problem: String| {
            let help =
                "give the folder (option `out`) of a `lanesweep sample` run of crude Monte Carlo by this version";
            Error::input(Place::file(dir.join(ESTIMATE_RECORD)), problem, help)
        };
        if self.estimator != "mc" {
            return Err(wrong(format!("a run of estimator `{}` has no numbered lanes", self.estimator)));
        }
        let headways = match density.space.has_thw() {
            true => SampleHeadways::Sampled,
            false => SampleHeadways::Each(self.plan_headways.clone()),
        };
        let options = SampleOptions {
            seed: self.seed,
            source: if self.points == "sobol" { SampleSource::Sobol } else { SampleSource::Random },
            models: self.models.clone(),
            ..SampleOptions::new(Estimator::CRUDE, self.samples, headways)
        };
        let plan = plan_samples(&density, &mixture_of(&density, &self.given)?, &self.profile, &options)?;
        if self.plan_sha256.as_deref() != Some(plan.hash()) {
            return Err(wrong("its plan does not match the density and the profile beside it".to_owned()));
        }
        Ok((plan, density))
    }
}

/// Checks whether a record was made with this program's engine version.
fn check_engine(recorded: Option<u64>) -> std::result::Result<(), String> {
    match recorded {
        Some(ENGINE_VERSION) => Ok(()),
        Some(engine) => {
            Err(format!("it is of engine {engine}, this program has engine {ENGINE_VERSION}: its lanes differ"))
        }
        None => Err("it has no engine number: an earlier version of lanesweep made it".to_owned()),
    }
}

/// The study of a folder: the plan in the same folder that has the record's hash.
pub(super) fn study_of(dir: &Path) -> Result<Study> {
    #[derive(Deserialize)]
    struct Recorded {
        plan_sha256: String,
        engine: Option<u64>,
    }
    let run = &dir.join(STUDY_RECORD);
    let wrong = |problem: String| {
        let help = "make the plan again with the study's own command and option `plan_only`, into this folder; a study \
                    keeps it up to 256 MiB, and always with `study.keep_plan=always`";
        Error::input(Place::file(run), problem, help)
    };
    let text = read_json(run, MAX_TABLE_BYTES, "the record of a study", "run the study into this folder again")?;
    let recorded: Recorded =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a study: {e}")))?;
    check_engine(recorded.engine).map_err(wrong)?;
    let plans: Vec<PathBuf> =
        [RUN_PLAN_FILE, PLAN_FILE].iter().map(|name| dir.join(name)).filter(|path| path.exists()).collect();
    for path in &plans {
        // The folder may also contain the plan of another command.
        if kind_of(path)? == Study::KIND {
            let study = Study::read(path, None)?;
            if study.plan().hash() == recorded.plan_sha256 {
                return Ok(study);
            }
        }
    }
    Err(wrong(match plans.first() {
        None => "there is no plan of its lanes beside it".to_owned(),
        Some(path) => format!("{} is not the plan that it records", path.display()),
    }))
}
