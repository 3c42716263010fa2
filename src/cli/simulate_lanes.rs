//! The lanes of a `simulate` that names one by its key: of a study's folder, of a sampling run's, or of a scenario file.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::sample_distribution;
use super::source::scenarios_of;
use crate::engine::{Headway, LaneKey, LanePlan, LaneRunner, Outcome, Trace};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::model::scalar::Real;
use crate::run::parts::{PLAN_FILE, RUN_PLAN_FILE, kind_of};
use crate::run::sampling::{Sample, SampleKind};
use crate::run::study::{Study, StudyOptions, plan_study};
use crate::stats::density::DensityModel;
use crate::support::input_file;
use crate::support::plausibility::Implausible;
use crate::support::repeats::refuse_repeats;
use crate::{Error, Place, Result};

/// Which lanes are asked for: one by its key, and others of the same scenario and headway beside it.
pub(super) struct Asked<'a> {
    pub key: &'a str,
    /// Instead of the key's own model.
    pub models: Option<Vec<ModelId>>,
    /// Variants before the key's own one: S, keys of parameterizations, or `all`.
    pub compare: &'a [String],
}

/// A lane that has been run.
pub(super) struct Traced {
    /// The lane's key; without one what tells it from the others.
    pub key: String,
    /// Name on a sheet with others.
    pub name: String,
    pub trace: Trace,
    /// The same lane in f64, where the trace is in the lane arithmetic of a finished run.
    pub reference: Option<Outcome<f64>>,
}

/// Lanes that have been run, and what a reader should know of all of them.
pub(super) struct Lanes {
    pub traced: Vec<Traced>,
    /// What they are of, in a few words.
    pub origin: String,
    pub synthetic: bool,
    /// Other scenarios of the file were left out.
    pub incomplete: bool,
}

/// Lanes of a finished run, in its own arithmetic.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a folder without a run's plan, or with another's; [`Error::Usage`] for a lane
/// that the run does not have.
pub(super) fn of_run(dir: &Path, asked: &Asked) -> Result<Lanes> {
    match find_run(dir, asked.key)? {
        Run::Study(study) => {
            let facts = &study.facts();
            let key = find(study.plan(), asked.key)?;
            let unit = study.plan().blocks[key.block].first_unit + key.unit;
            let plan = study.cases().window(unit..unit + 1)?;
            let traced =
                if facts.reference { traced::<f64>(&plan, asked, false)? } else { traced::<f32>(&plan, asked, true)? };
            let arithmetic = if facts.reference { "f64" } else { "f32" };
            let origin = format!("profile {}, {arithmetic}, {}", plan.profile.name, facts.data);
            Ok(Lanes { traced, origin, synthetic: facts.synthetic, incomplete: false })
        }
        Run::Sample(plan, density) => {
            refuse_void(&plan, &find(&plan, asked.key)?)?;
            let synthetic = density.provenance.synthetic;
            let origin = format!("profile {}, f32, sampled", plan.profile.name);
            Ok(Lanes { traced: traced::<f32>(&plan, asked, true)?, origin, synthetic, incomplete: false })
        }
        Run::Distribution(plan, data) => {
            let origin = format!("profile {}, f32, {data}", plan.profile.name);
            Ok(Lanes { traced: traced::<f32>(&plan, asked, true)?, origin, synthetic: false, incomplete: false })
        }
    }
}

/// Lanes of a scenario file, in f64. A scenario that the filters dropped can be looked at too, and any headway.
///
/// # Errors
/// As [`scenarios_of`]; [`Error::Usage`] for a lane that the file does not have.
pub(super) fn of_scenarios(path: &Path, profile: &Profile, asked: &Asked, implausible: Implausible) -> Result<Lanes> {
    let (mut scenarios, incomplete) = scenarios_of(path, implausible)?;
    let id = asked.key.rsplitn(4, '/').last().unwrap_or(asked.key);
    if let Some(wanted) = scenarios.iter_mut().find(|s| s.id == id) {
        wanted.kept = true;
    }
    let mut options = StudyOptions::default();
    if let Some(headway) = asked.key.rsplit('/').nth(1).and_then(Headway::parse) {
        options.headways = vec![headway];
    }
    let plan = plan_study(&scenarios, profile, &options)?.plan;
    let synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
    let origin = format!("profile {}, f64, scenarios of {}", profile.name, path.display());
    Ok(Lanes { traced: traced::<f64>(&plan, asked, false)?, origin, synthetic, incomplete })
}

pub(super) enum Run {
    Study(Box<Study>),
    /// With its density.
    Sample(Box<LanePlan>, Box<DensityModel>),
    /// Of distributions of parameters, with what they are of.
    Distribution(Box<LanePlan>, String),
}

/// Where a folder holds a study's results and a sampling run's, the key tells: samples are numbered.
pub(super) fn find_run(dir: &Path, key: &str) -> Result<Run> {
    crate::support::files::check_folder(dir)?;
    let (run, estimate) = (dir.join("run.json"), dir.join("estimate.json"));
    if run.exists() && !(estimate.exists() && key.starts_with('#')) {
        return study_of(dir, &run).map(|study| Run::Study(Box::new(study)));
    }
    if estimate.exists() && dir.join(sample_distribution::KEPT).exists() {
        let (plan, data) = sample_distribution::plan_of(dir)?;
        return Ok(Run::Distribution(Box::new(plan), data));
    }
    if estimate.exists() {
        let (plan, density) = super::rerun::run_of(dir)?;
        return Ok(Run::Sample(Box::new(plan), Box::new(density)));
    }
    let plan = dir.join(PLAN_FILE);
    if !plan.exists() {
        let help = "give the folder (--out) of a `lanesweep study` or `lanesweep sample`";
        return Err(Error::input(Place::file(dir), "there is no run here", help));
    }
    match kind_of(&plan)?.as_str() {
        kind if Sample::is_kind(kind) => match Sample::read(&plan)? {
            Sample { kind: SampleKind::Crude(plan), density, .. } => Ok(Run::Sample(plan, Box::new(density))),
            _ => {
                let help = "give the folder of a run of crude Monte Carlo";
                Err(Error::input(Place::file(&plan), "importance sampling has no numbered lanes", help))
            }
        },
        // Its reader refuses every other kind.
        _ => Ok(Run::Study(Box::new(Study::read(&plan, None)?))),
    }
}

/// The study whose record this is: the plan beside it that has the record's hash.
fn study_of(dir: &Path, run: &Path) -> Result<Study> {
    #[derive(Deserialize)]
    struct Recorded {
        plan_sha256: String,
        engine: Option<u64>,
    }
    let wrong = |problem: String| {
        Error::input(
            Place::file(run),
            problem,
            "make the plan again with the study's own command and `--plan-only`, into this \
                 folder; a study keeps it up to 256 MiB, and always with `--keep-plan always`",
        )
    };
    let again = "run the study into this folder again";
    let text = input_file::read_json(run, input_file::MAX_TABLE_BYTES, "the record of a study", again)?;
    let recorded: Recorded =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a study: {e}")))?;
    super::rerun::same_engine(recorded.engine).map_err(wrong)?;
    let plans: Vec<PathBuf> =
        [RUN_PLAN_FILE, PLAN_FILE].iter().map(|name| dir.join(name)).filter(|path| path.exists()).collect();
    for path in &plans {
        // Another verb's plan may stand in the same folder.
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

/// A void sample has no case.
pub(super) fn refuse_void(plan: &LanePlan, key: &LaneKey) -> Result<()> {
    if plan.generator().is_some_and(|generator| generator.draw(key.unit).is_void()) {
        let help = "none of its draws was valid: use another sample";
        return Err(Error::usage(Place::item("--lane"), "this sample is void", help));
    }
    Ok(())
}

pub(super) fn find(plan: &LanePlan, key: &str) -> Result<LaneKey> {
    plan.parse_key(key).ok_or_else(|| {
        let why = wrong_part(plan, key);
        let example = plan.key(0).map_or(String::new(), |key| format!(", for instance {}", plan.key_text(&key)));
        Error::usage(
            Place::item("--lane"),
            format!("there is no lane `{key}`: {why}"),
            format!("a key is scenario/variant/headway/model, as errors and tables print it{example}"),
        )
    })
}

/// What of a key is in no lane of the plan.
fn wrong_part(plan: &LanePlan, key: &str) -> String {
    let parts: Vec<&str> = key.rsplitn(4, '/').collect();
    let [model, headway, variant, scenario] = parts[..] else {
        return format!("it has {} of four parts", parts.len());
    };
    let models: Vec<&str> = plan.models.iter().map(|model| model.name()).collect();
    if !ModelId::parse(model).is_some_and(|model| plan.models.contains(&model)) {
        return format!("no model `{model}` in this run ({})", models.join(", "));
    }
    let headways: Vec<String> = plan.headways.iter().map(ToString::to_string).collect();
    let is_there = headways.iter().any(|h| h == headway)
        || Headway::parse(headway).is_some_and(|headway| plan.headways.contains(&headway));
    if !is_there {
        return format!("no headway `{headway}` in this run ({})", headways.join(", "));
    }
    match plan.blocks.iter().find(|block| block.units.find(scenario).is_some()) {
        None => format!("no scenario `{scenario}` in this run"),
        Some(block) => format!("no variant `{variant}` of this scenario ({})", block.variants.join(", ")),
    }
}

/// Runs what is asked for: variants, and for each of them models.
fn traced<R: Real>(plan: &LanePlan, asked: &Asked, with_reference: bool) -> Result<Vec<Traced>> {
    let key = find(plan, asked.key)?;
    let variants = variants(plan, &key, asked.compare)?;
    let models = match &asked.models {
        None => vec![key.model],
        Some(list) => list.iter().map(|id| model(plan, *id)).collect::<Result<_>>()?,
    };
    let runner = LaneRunner::<R>::new(plan);
    let reference = with_reference.then(|| LaneRunner::<f64>::new(plan));
    let mut all = Vec::new();
    for &variant in &variants {
        for &model in &models {
            let key = LaneKey { variant, model, ..key };
            let (of, by) = (&plan.blocks[key.block].variants[variant], plan.models[model].name());
            let name = match (variants.len() > 1, models.len() > 1) {
                (true, true) => format!("{of}, {by}"),
                (true, false) => of.clone(),
                _ => by.to_owned(),
            };
            let reference = reference.as_ref().map(|runner| runner.run(&key));
            all.push(Traced { key: plan.key_text(&key), name, trace: runner.trace(&key), reference });
        }
    }
    Ok(all)
}

pub(super) fn model(plan: &LanePlan, id: ModelId) -> Result<usize> {
    plan.models.iter().position(|m| *m == id).ok_or_else(|| {
        let there: Vec<&str> = plan.models.iter().map(|m| m.name()).collect();
        let problem = format!("{} is not a model of this run", id.name());
        Error::usage(Place::item("--models"), problem, format!("use {}", there.join(", ")))
    })
}

/// Those to compare with, in the plan's order of variants, then the lane's own.
fn variants(plan: &LanePlan, key: &LaneKey, compare: &[String]) -> Result<Vec<usize>> {
    let names = &plan.blocks[key.block].variants;
    let mut variants = Vec::new();
    refuse_repeats(|| Place::item("--compare"), compare.iter().map(|name| (name.trim(), name.trim())))?;
    for name in compare.iter().map(|name| name.trim()) {
        match names.iter().position(|n| n == name) {
            Some(at) => variants.push(at),
            None if name == "all" => variants.extend(0..names.len()),
            None => {
                let problem = format!("this lane's scenario has no variant `{name}`");
                let help = format!("use {} or `all`", names.join(", "));
                return Err(Error::usage(Place::item("--compare"), problem, help));
            }
        }
    }
    variants.sort_unstable();
    variants.dedup();
    variants.retain(|variant| *variant != key.variant);
    if variants.is_empty() && !compare.is_empty() {
        let problem = "this is the lane itself, so there is nothing to compare";
        let others = names.iter().enumerate().filter(|(at, _)| *at != key.variant).map(|(_, name)| name.as_str());
        let help = format!("name other variants: {}", others.collect::<Vec<_>>().join(", "));
        return Err(Error::usage(Place::item("--compare"), problem, help));
    }
    // S first, wherever it comes from: the others are read against it.
    variants.push(key.variant);
    variants.sort_by_key(|variant| *variant != 0);
    Ok(variants)
}
