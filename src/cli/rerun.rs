//! One lane of a finished run again: from the run's folder and the lane's key, in the run's own arithmetic.

use std::path::Path;

use serde::Deserialize;

use crate::engine::{ENGINE_VERSION, Headway, LanePlan};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::sampling::RunFacts;
use crate::run::sampling::{SampleHeadways, SamplePlanOptions, SampleSource, mixture_of, plan_samples};
use crate::stats::density::{DensityModel, read_density};
use crate::support::input_file;
use crate::{Error, Place, Result};

/// What `estimate.json` must say of a run.
#[derive(Deserialize)]
struct Recorded {
    lanesweep_estimate: u64,
    /// None before engines were told.
    engine: Option<u64>,
    estimator: String,
    samples: u64,
    seed: u64,
    points: String,
    models: Vec<ModelId>,
    plan_headways: Vec<Headway>,
    profile: Profile,
    #[serde(default)]
    given: Vec<(String, f64)>,
    plan_sha256: Option<String>,
    worst_sha256: Option<String>,
}

/// What the sampling run that wrote this folder was asked for, with its density.
///
/// # Errors
/// [`Error::Io`], [`Error::Input`] where the folder does not hold a run.
pub(super) fn facts_of(dir: &Path) -> Result<(RunFacts, DensityModel, Option<String>)> {
    let (facts, plan_sha256) = record_of(dir)?;
    Ok((facts, read_density(&dir.join("density.json"))?, plan_sha256))
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

/// Checksum of the table of worst lanes, as the record has it.
///
/// # Errors
/// As [`facts_of`].
pub(super) fn worst_sha256(dir: &Path) -> Result<Option<String>> {
    Ok(read(dir)?.1.worst_sha256)
}

/// The same of a run without a density of ours.
pub(super) fn record_of(dir: &Path) -> Result<(RunFacts, Option<String>)> {
    let (estimator, run) = read(dir)?;
    let facts = RunFacts {
        estimator,
        profile: run.profile,
        models: run.models,
        headways: run.plan_headways,
        points: if run.points == "sobol" { "sobol" } else { "random" },
        samples: run.samples,
        seed: run.seed,
        given: run.given,
    };
    Ok((facts, run.plan_sha256))
}

/// The estimator and the record of a folder.
fn read(dir: &Path) -> Result<(&'static str, Recorded)> {
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
    let estimator = ["mc", "is", "ce", "subset"].into_iter().find(|known| *known == run.estimator);
    Ok((estimator.ok_or_else(|| wrong(format!("estimator `{}` is not known", run.estimator)))?, run))
}

/// The plan of the sampling run that wrote this folder, with what the run was asked for and its density.
///
/// # Errors
/// [`Error::Io`], [`Error::Input`] where the folder does not hold a run of crude Monte Carlo, whole and unchanged.
pub(super) fn run_of(dir: &Path) -> Result<(RunFacts, LanePlan, DensityModel)> {
    let (facts, density, plan_sha256) = facts_of(dir)?;
    let wrong = |problem: String| {
        let help = "give the folder (--out) of a `lanesweep sample` run of crude Monte Carlo by this version";
        Error::input(Place::file(dir.join("estimate.json")), problem, help)
    };
    if facts.estimator != "mc" {
        return Err(wrong(format!("a run of estimator `{}` has no numbered lanes", facts.estimator)));
    }
    let options = SamplePlanOptions {
        samples: facts.samples,
        seed: facts.seed,
        source: if facts.points == "sobol" { SampleSource::Sobol } else { SampleSource::Random },
        models: facts.models.clone(),
        headways: if density.space.has_thw() {
            SampleHeadways::Sampled
        } else {
            SampleHeadways::Each(facts.headways.clone())
        },
    };
    let plan = plan_samples(&density, &mixture_of(&density, &facts.given)?, &facts.profile, &options)?;
    match plan_sha256 {
        Some(hash) if hash == plan.hash() => Ok((facts, plan, density)),
        _ => Err(wrong("its plan does not match the density and the profile beside it".to_owned())),
    }
}
