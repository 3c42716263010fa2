//! `lanesweep sample --distribution`: random parameters of an OpenSCENARIO file, sampled as lanes.

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::Exit;
use super::configured::Configured;
use super::console::{self, Verbosity};
use super::rerun::record_of;
use super::sample::Sample;
use super::sample_checks::only_crude;
use super::sample_lanes;
use crate::cli::settings::{EstimatorKind, PointKind};
use crate::engine::{Headway, LanePlan, LaneRunner};
use crate::interop::openscenario::{DistributionSamples, Names, Rename, parse_distribution};
use crate::model::profile::Profile;
use crate::report::sampling::{DensityRecord, DrawRecord, EstimateFile, RunFacts};
use crate::report::sampling_tables::{WorstRow, convergence_csv};
use crate::run::grid::MapParameter;
use crate::run::sampling::{CrudeOptions, CrudeRun, TallyOptions, sample_crude};
use crate::scenario::Category;
use crate::stats::density::Provenance;
use crate::support::hex::sha256;
use crate::support::input_file;
use crate::support::plausibility::Doubts;
use crate::support::readable;
use crate::support::run_dir::{ESTIMATE_RECORD, OutputDir, Results};
use crate::{Error, Place, Result};

/// What a run leaves of its input, so that its lanes can be made again.
pub(super) const KEPT: &str = "distribution.json";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    lanesweep_distribution: u64,
    file: String,
    text: String,
    category: Category,
    /// Theirs, ours, factor.
    renames: Vec<(String, String, f64)>,
    set: Vec<(String, f64)>,
}

impl Kept {
    fn samples(&self) -> Result<DistributionSamples> {
        let path = Path::new(&self.file);
        let file = parse_distribution(&self.text, path)?;
        let rename = |(theirs, ours, factor): &(String, String, f64)| Rename {
            theirs: theirs.clone(),
            ours: ours.clone(),
            factor: *factor,
        };
        let renames: Vec<Rename> = self.renames.iter().map(rename).collect();
        let fixed = |(name, value): &(String, f64)| {
            let parameter = MapParameter::find(self.category, name, "--set")?;
            Ok((parameter, parameter.check(*value, "--set")?))
        };
        let fixed = self.set.iter().map(fixed).collect::<Result<Vec<_>>>()?;
        DistributionSamples::of(&file, &Names { category: self.category, renames: &renames, path }, fixed)
    }
}

/// Samples what a file says.
pub(super) fn run(
    flags: &Sample,
    configured: &Configured,
    path: &Path,
    started: Instant,
    verbosity: Verbosity,
) -> Result<Exit> {
    let settings = &flags.settings;
    if settings.estimator != EstimatorKind::Mc {
        return Err(only_crude("--distribution"));
    }
    if settings.points == PointKind::Sobol {
        let help = "leave out --points: draws of a distribution file are independent";
        return Err(Error::usage(
            Place::item("--points"),
            "Sobol points are not available for a distribution file",
            help,
        ));
    }
    let text = input_file::read_text(path, input_file::MAX_XML_BYTES)?;
    let name = flags.category.as_deref().unwrap_or_default();
    let category = Category::parse(name).ok_or_else(|| {
        let problem = format!("there is no category `{name}`");
        Error::usage(Place::item("--category"), problem, "use cut-in, cut-out or lvd")
    })?;
    let kept = Kept {
        lanesweep_distribution: 1,
        file: path.display().to_string(),
        text,
        category,
        renames: flags.rename.iter().map(|r| (r.theirs.clone(), r.ours.clone(), r.factor)).collect(),
        set: flags.set.clone(),
    };
    let samples = kept.samples()?;
    judge(&samples, Doubts::new(flags.plausibility.policy()))?;
    for p in samples.parameters.iter().filter(|p| p.kept_share < 1.0) {
        tracing::warn!(
            "{:.3} % of the distribution of {} are outside {} … {} {} and are not drawn",
            100.0 * (1.0 - p.kept_share),
            p.parameter.key,
            readable::value(p.parameter.least),
            readable::value(p.parameter.most),
            p.parameter.unit
        );
    }
    let listed = flags.listed_headways()?;
    if listed.is_some() && samples.has_distance() {
        let problem = "the initial distance is a parameter already";
        return Err(Error::usage(Place::item("--thw"), problem, "leave out --thw"));
    }
    let headways = listed.unwrap_or_else(Headway::paper);
    let (profile, models, criterion) = (configured.profile()?, flags.models()?, settings.criterion);
    let of_file = samples.seed.filter(|_| !configured.is_set("sample.seed"));
    let seed = of_file.unwrap_or(settings.seed);
    let count = settings.samples.unwrap_or(samples.runs);
    let opened = configured.open()?;
    let folder = OutputDir::open(&flags.out, ESTIMATE_RECORD)?;
    let (plan, tries) = samples.plan((count, seed), &profile, &models, &headways)?;
    let executor = opened.executor().with_recheck(seed);
    let counting = TallyOptions { worst: settings.worst, criterion, map: None };
    let options = CrudeOptions {
        stop: flags.stop(count),
        interval: flags.interval(),
        level: settings.level,
        // Nobody said how often such scenarios occur.
        exposure: None,
        is_sampled_headway: samples.has_distance(),
    };
    tracing::info!("{} samples on {}", readable::count(count), executor.backend.describe());
    let bar = console::progress(verbosity, count, "sampling");
    let crude = sample_crude(&plan, 0..count, &executor, &counting, &options, |chunk| {
        bar.inc(chunk.units.end - chunk.units.start);
        Ok(())
    })?;
    bar.finish_and_clear();
    let facts = RunFacts {
        estimator: "mc",
        profile,
        models,
        headways: plan.headways.clone(),
        points: "random",
        samples: count,
        seed,
        given: Vec::new(),
    };
    let host = opened.host(crude.summary.rechecked_lanes, started);
    let record = record(&kept, &samples, path);
    let mut file = EstimateFile::of(record, samples.has_distance(), facts, crude.rows.clone(), host);
    file.plan_sha256 = Some(plan.hash().to_owned());
    let mut draws = DrawRecord::of(&crude.tally, &plan);
    if draws.samples == count {
        draws.tries = tries;
        draws.rejected_share = (tries - count) as f64 / tries as f64;
    }
    file.draws = Some(draws);
    write(folder.results()?, &kept, &samples, &plan, &crude, &counting, &mut file)?;
    flags.format.print(|| file.text(), || file.json())?;
    tracing::info!("results written to {}", flags.out.display());
    Ok(Exit::Ok)
}

/// Looks at the fixed values and at the quartiles of the distributions: their tails are cut off anyway.
fn judge(samples: &DistributionSamples, mut doubts: Doubts) -> Result<()> {
    for (parameter, value) in &samples.fixed {
        parameter.judge(*value, &mut doubts)?;
    }
    for p in &samples.parameters {
        for share in [0.25, 0.75] {
            p.parameter.judge(p.draw.value(share) * p.factor, &mut doubts)?;
        }
    }
    doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
    Ok(())
}

fn record(kept: &Kept, samples: &DistributionSamples, path: &Path) -> DensityRecord {
    let mut data = format!("distributions of {}", path.file_name().unwrap_or_default().to_string_lossy());
    for (parameter, value) in &samples.fixed {
        let _ = write!(data, ", {} = {value}", parameter.key);
    }
    let sha = sha256(&kept.text);
    DensityRecord {
        sha256: sha.clone(),
        category: kept.category.key(),
        parameterization: "distribution".to_owned(),
        parameters: samples.parameters.iter().map(|p| p.parameter.key.to_owned()).collect(),
        kernels: 0,
        provenance: Provenance {
            program: format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
            data,
            synthetic: false,
            scenarios_sha256: sha,
            found: 0,
            kept: 0,
            left_out: 0,
        },
    }
}

/// Tables, page and record.
fn write(
    mut results: Results,
    kept: &Kept,
    samples: &DistributionSamples,
    plan: &LanePlan,
    crude: &CrudeRun,
    counting: &TallyOptions,
    file: &mut EstimateFile,
) -> Result<()> {
    results.add("convergence.csv", &convergence_csv(&crude.convergence)?)?;
    if counting.worst > 0 {
        let runner = LaneRunner::<f32>::new(plan);
        let missing = |lane: u64| Error::Internal(format!("lane {lane} is not in the plan"));
        let mut found = Vec::new();
        for (model, lanes) in crude.tally.worst.iter().enumerate() {
            for (at, &lane) in lanes.iter().enumerate() {
                let key = plan.key(lane.lane).ok_or_else(|| missing(lane.lane))?;
                let point = samples.draw(file.seed, key.unit, &plan.profile)?.values;
                found.push((model, at + 1, lane, key, point, runner.run(&key).widen()));
            }
        }
        let mut rows: Vec<WorstRow> = Vec::new();
        for (model, rank, lane, key, point, outcome) in &found {
            let headway =
                if samples.has_distance() { "sampled".to_owned() } else { plan.headways[key.headway].to_string() };
            rows.push(WorstRow {
                rank: *rank,
                lane: *lane,
                key: plan.key_text(key),
                sample: key.unit,
                model: plan.models[*model],
                headway,
                point: Vec::clone(point),
                outcome,
            });
        }
        let names: Vec<String> = samples.parameters.iter().map(|p| p.parameter.key.to_owned()).collect();
        sample_lanes::add_worst(&mut results, &rows, &names, counting.criterion, file)?;
    }
    let unwritten = |e: serde_json::Error| Error::Internal(format!("a distribution cannot be kept: {e}"));
    results.add(KEPT, &serde_json::to_vec_pretty(kept).map_err(unwritten)?)?;
    sample_lanes::publish_estimates(results, file, Vec::new())
}

/// The plan of the run that wrote this folder, and what it is of.
///
/// # Errors
/// [`Error::Io`], [`Error::Input`] where the folder does not hold such a run, whole and unchanged.
pub(super) fn plan_of(dir: &Path) -> Result<(LanePlan, String)> {
    let path = dir.join(KEPT);
    let wrong = |problem: String| {
        let help = "give the folder (--out) of a `lanesweep sample --distribution` run by this version";
        Error::input(Place::file(&path), problem, help)
    };
    let again = "run `lanesweep sample --distribution` into this folder again";
    let text = input_file::read_json(&path, input_file::MAX_TABLE_BYTES, "the record of a distribution", again)?;
    let kept: Kept =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a distribution: {e}")))?;
    if kept.lanesweep_distribution != 1 {
        return Err(wrong(format!("its version is {}, this program reads 1", kept.lanesweep_distribution)));
    }
    let (facts, plan_sha256) = record_of(dir)?;
    let profile: &Profile = &facts.profile;
    profile.check(&Place::file(dir.join("estimate.json")))?;
    let samples = kept.samples()?;
    let (plan, _) = samples.plan((facts.samples, facts.seed), profile, &facts.models, &facts.headways)?;
    if plan_sha256.as_deref() != Some(plan.hash()) {
        return Err(wrong("its plan does not match the distributions and the profile beside it".to_owned()));
    }
    let file = Path::new(&kept.file).file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok((plan, format!("distributions of {file}")))
}
