//! One lane of a finished run again: from the run's folder and the lane's key, in the run's own arithmetic.

use std::path::Path;

use serde::Deserialize;

use crate::density::read_density;
use crate::driver::ModelId;
use crate::profile::Profile;
use crate::sampling::{SampleHeadways, SamplePlanOptions, SampleSource, plan_samples};
use crate::sweep::{Headway, LanePlan};
use crate::{Error, Place, Result};

/// What `estimate.json` must say of a run.
#[derive(Deserialize)]
struct Recorded {
    lanesweep_estimate: u64,
    estimator: String,
    samples: u64,
    seed: u64,
    points: String,
    models: Vec<ModelId>,
    plan_headways: Vec<Headway>,
    profile: Profile,
    plan_sha256: Option<String>,
}

/// The plan of the sampling run that wrote this folder.
///
/// # Errors
/// [`Error::Io`], [`Error::Input`] where the folder does not hold a run of crude Monte Carlo, whole and unchanged.
pub(super) fn plan_of(dir: &Path) -> Result<LanePlan> {
    let path = dir.join("estimate.json");
    let wrong = |problem: String| {
        let help = "give the folder (--out) of a `lanesweep sample` run of crude Monte Carlo by this version";
        Error::input(Place::file(&path), problem, help)
    };
    let text = std::fs::read(&path).map_err(|e| Error::io(&path, "read", e))?;
    let run: Recorded = serde_json::from_slice(&text).map_err(|e| wrong(format!("it tells no run: {e}")))?;
    if run.lanesweep_estimate != 1 || run.estimator != "mc" {
        return Err(wrong(format!("a run of estimator `{}` has no numbered lanes", run.estimator)));
    }
    let density = read_density(&dir.join("density.json"))?;
    let options = SamplePlanOptions {
        samples: run.samples,
        seed: run.seed,
        source: if run.points == "sobol" { SampleSource::Sobol } else { SampleSource::Random },
        models: run.models,
        headways: if density.space.has_thw() {
            SampleHeadways::Sampled
        } else {
            SampleHeadways::Each(run.plan_headways)
        },
    };
    let plan = plan_samples(&density, &density.mixture()?, &run.profile, &options)?;
    match run.plan_sha256 {
        Some(hash) if hash == plan.hash() => Ok(plan),
        _ => Err(wrong("its plan is not the one that the density and the profile beside it make".to_owned())),
    }
}
