//! One lane of a finished run again: from the run's folder and the lane's key, in the run's own arithmetic.

use std::path::Path;

use serde::Deserialize;

use crate::engine::{ENGINE_VERSION, Headway, LanePlan};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::sampling::{Estimator, SampleHeadways, SampleOptions, SampleSource, mixture_of, plan_samples};
use crate::stats::density::{DensityModel, read_density};
use crate::support::input_file;
use crate::{Error, Place, Result};

/// What `estimate.json` must say of a run.
#[derive(Deserialize)]
pub(super) struct Recorded {
    lanesweep_estimate: u64,
    /// None before engines were told.
    engine: Option<u64>,
    estimator: String,
    pub samples: u64,
    pub seed: u64,
    points: String,
    pub models: Vec<ModelId>,
    pub plan_headways: Vec<Headway>,
    pub profile: Profile,
    #[serde(default)]
    given: Vec<(String, f64)>,
    pub plan_sha256: Option<String>,
    pub worst_sha256: Option<String>,
}

/// Whether a record is of this program's engine.
///
/// # Errors
/// What it is of instead.
pub(super) fn same_engine(recorded: Option<u64>) -> std::result::Result<(), String> {
    match recorded {
        Some(ENGINE_VERSION) => Ok(()),
        Some(engine) => {
            Err(format!("it is of engine {engine}, this program has engine {ENGINE_VERSION}: its lanes differ"))
        }
        None => Err("it has no engine number: an earlier version of lanesweep made it".to_owned()),
    }
}

/// The record of the sampling run that wrote this folder.
///
/// # Errors
/// [`Error::Io`], [`Error::Input`] where the folder does not hold a run.
pub(super) fn record_of(dir: &Path) -> Result<Recorded> {
    let path = dir.join("estimate.json");
    let wrong = |problem: String| {
        let help = "give the folder (--out) of a `lanesweep sample` run by this version";
        Error::input(Place::file(&path), problem, help)
    };
    let again = "run `lanesweep sample` into this folder again";
    let text = input_file::read_json(&path, input_file::MAX_TABLE_BYTES, "the record of a run", again)?;
    let run: Recorded =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a run: {e}")))?;
    if run.lanesweep_estimate != 1 {
        return Err(wrong(format!("its version is {}, this program reads 1", run.lanesweep_estimate)));
    }
    same_engine(run.engine).map_err(wrong)?;
    if !["mc", "is", "ce", "subset"].contains(&run.estimator.as_str()) {
        return Err(wrong(format!("estimator `{}` is not known", run.estimator)));
    }
    Ok(run)
}

/// The plan of the sampling run that wrote this folder, with its density.
///
/// # Errors
/// [`Error::Io`], [`Error::Input`] where the folder does not hold a run of crude Monte Carlo, whole and unchanged.
pub(super) fn run_of(dir: &Path) -> Result<(LanePlan, DensityModel)> {
    let run = record_of(dir)?;
    let density = read_density(&dir.join("density.json"))?;
    let wrong = |problem: String| {
        let help = "give the folder (--out) of a `lanesweep sample` run of crude Monte Carlo by this version";
        Error::input(Place::file(dir.join("estimate.json")), problem, help)
    };
    if run.estimator != "mc" {
        return Err(wrong(format!("a run of estimator `{}` has no numbered lanes", run.estimator)));
    }
    let headways = match density.space.has_thw() {
        true => SampleHeadways::Sampled,
        false => SampleHeadways::Each(run.plan_headways),
    };
    let options = SampleOptions {
        seed: run.seed,
        source: if run.points == "sobol" { SampleSource::Sobol } else { SampleSource::Random },
        models: run.models,
        ..SampleOptions::new(Estimator::CRUDE, run.samples, headways)
    };
    let plan = plan_samples(&density, &mixture_of(&density, &run.given)?, &run.profile, &options)?;
    match run.plan_sha256 {
        Some(hash) if hash == plan.hash() => Ok((plan, density)),
        _ => Err(wrong("its plan does not match the density and the profile beside it".to_owned())),
    }
}
