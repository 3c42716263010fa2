//! Records of a finished run: `run.json` of a study, `estimate.json` of a sampling run.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::parts::{PLAN_FILE, RUN_PLAN_FILE, check_engine, kind_of};
use crate::sampling::{ESTIMATE_RECORD, Estimator, SampleHeadways, SampleOptions, plan_samples};
use crate::study::{STUDY_RECORD, Study};
use lanesweep_engine::{Headway, LanePlan};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_stats::density::{DensityModel, read_density};
use lanesweep_support::input_file::{MAX_TABLE_BYTES, read_json};
use lanesweep_support::{Error, Place, Result, option};

/// Crude Monte Carlo of a folder: the plan, remade from the density beside the record, and the density.
pub(super) fn sample_of(dir: &Path) -> Result<(LanePlan, DensityModel)> {
    #[derive(Deserialize)]
    struct Recorded {
        lanesweep_estimate: u64,
        /// Files of earlier versions have no engine number.
        engine: Option<u64>,
        estimator: String,
        samples: u64,
        seed: u64,
        models: Vec<ModelId>,
        plan_headways: Vec<Headway>,
        profile: Profile,
        plan_sha256: Option<String>,
    }
    let (path, density_path) = (&dir.join(ESTIMATE_RECORD), &dir.join("density.json"));
    let wrong = |problem: String| {
        let help = format!(
            "give the folder ({}) of a `lanesweep sample` run of crude Monte Carlo by this version",
            option("out")
        );
        Error::input(Place::file(path), problem, help)
    };
    let text =
        read_json(path, MAX_TABLE_BYTES, "the record of a run", "run `lanesweep sample` into this folder again")?;
    let run: Recorded =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a run: {e}")))?;
    if run.lanesweep_estimate != 1 {
        return Err(wrong(format!("its version is {}, this program reads 1", run.lanesweep_estimate)));
    }
    check_engine(run.engine).map_err(wrong)?;
    match &*run.estimator {
        "mc" => {}
        "is" => return Err(wrong("a run of estimator `is` has no numbered lanes".to_owned())),
        other => return Err(wrong(format!("estimator `{other}` is not known"))),
    }
    let again = "run `lanesweep sample` into this folder again: it writes the density that it samples";
    let density = read_density(density_path).map_err(|error| match error {
        Error::Input { place, problem, .. } => Error::input(*place, problem, again),
        Error::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
            Error::input(Place::file(density_path), "the density of the run is missing", again)
        }
        other => other,
    })?;
    let headways = match density.space.has_thw() {
        true => SampleHeadways::Sampled,
        false => SampleHeadways::Each(run.plan_headways),
    };
    let options = SampleOptions {
        seed: run.seed,
        models: run.models,
        ..SampleOptions::new(Estimator::Crude, run.samples, headways)
    };
    let plan = plan_samples(&density, &run.profile, &options)?;
    if run.plan_sha256.as_deref() != Some(plan.hash()) {
        return Err(wrong("its plan does not match the density and the profile beside it".to_owned()));
    }
    Ok((plan, density))
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
        let help = format!(
            "make the plan again with the study's own command and {}, into this folder; a study \
                    keeps it up to 256 MiB, and always with `study.keep_plan=always`",
            option("plan_only")
        );
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
