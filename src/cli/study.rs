//! `lanesweep study`: trajectories in, F1 out.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde::{Deserialize, Serialize};

use super::backend_flags::BackendFlags;
use super::console::{self, Verbosity};
use super::source::{self, Source};
use super::synth::GeneratorFlags;
use super::{Exit, ProfileFlags};
use crate::mining::{Collection, MiningOptions, count};
use crate::parameterization::ParameterizationOptions;
use crate::report::files::make_folder;
use crate::report::lanes::{self, Digits};
use crate::report::reference::ReferenceComparison;
use crate::report::run_record::{CategoryRecord, RunRecord, SweepRecord, Timings};
use crate::report::study::StudyReport;
use crate::scenario::Category;
use crate::score::{ScoreOptions, f1, judge_claims, score};
use crate::sweep::{
    Backend, CpuBackend, LanePlan, ONE_IN, Partial, Recheck, StudyOptions, StudyPlan, SweepOptions, SweepSummary,
    Wanted, chunks, plan_study, sweep,
};
use crate::{Error, Place, Result};

/// How far do parameterized scenarios agree with recorded ones?
///
/// Mines cut-ins, cut-outs and leader decelerations, replays each as recorded (S) and parameterized (S')
/// from ten time headways against every driver model, judges collision, TTC and BTN, and scores S' against
/// S. Without data it runs on synthetic recordings of its own. Tables go to stdout, files to --out.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  lanesweep study\n  lanesweep study recordings --out result\n  lanesweep study \
                        --scenarios scenarios.jsonl --lanes lanes.csv")]
pub struct Study {
    /// Folder of highD-format recordings [default: synthetic recordings]
    #[arg(value_name = "DIR", conflicts_with = "scenarios")]
    dir: Option<PathBuf>,
    /// Scenario file (JSON Lines) instead of recordings
    #[arg(long, value_name = "FILE")]
    scenarios: Option<PathBuf>,
    /// Folder for tables, figures and run.json
    #[arg(long, value_name = "DIR", default_value = "lanesweep-out")]
    out: PathBuf,
    /// Also write one row per lane
    #[arg(long, value_name = "FILE")]
    lanes: Option<PathBuf>,
    /// Set the paper's published numbers beside (they are highD's)
    #[arg(long)]
    published: bool,
    /// Run the f64 reference instead of the f32 lane arithmetic
    #[arg(long)]
    reference: bool,
    /// Run both arithmetics and list every verdict that differs (reference.csv in --out)
    #[arg(long, conflicts_with = "reference")]
    compare_reference: bool,
    /// Study options (TOML): tables `mining`, `parameterization`, `score`
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Seed of the bootstrap [default: 157]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Categories, separated by commas [default: cut-in,cut-out,lvd]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    categories: Vec<String>,
    #[command(flatten)]
    backend: BackendFlags,
    #[command(flatten)]
    profile: ProfileFlags,
    #[command(flatten)]
    generator: GeneratorFlags,
}

/// The study file.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct StudyConfig {
    pub mining: MiningOptions,
    pub parameterization: ParameterizationOptions,
    pub score: ScoreOptions,
}

impl StudyConfig {
    pub fn read(path: Option<&Path>) -> Result<StudyConfig> {
        let config: StudyConfig = path.map_or(Ok(StudyConfig::default()), source::read_toml)?;
        config.mining.validate()?;
        config.parameterization.validate()?;
        config.score.validate()?;
        Ok(config)
    }
}

impl Study {
    pub fn run(&self, verbosity: Verbosity) -> Result<Exit> {
        let mut config = StudyConfig::read(self.config.as_deref())?;
        config.score.seed = self.seed.unwrap_or(config.score.seed);
        let profile = self.profile.load()?;
        let options = StudyOptions {
            categories: self.categories()?,
            parameterization: config.parameterization.clone(),
            ..StudyOptions::default()
        };
        let source = match (&self.dir, &self.scenarios) {
            (Some(dir), _) => Source::Folder(dir.clone()),
            (None, Some(path)) => Source::Scenarios(path.clone()),
            (None, None) => Source::Generated(self.generator.options()?),
        };
        self.guard_inputs()?;
        // Before the work: a device that is not there is known at once.
        let opened = if self.reference { self.backend.none_but("--reference")? } else { self.backend.open()? };
        tracing::info!("{}", source.describe());

        let mut timings = Timings::default();
        let collection = timed(&mut timings.mine_s, || source.load(&config.mining, verbosity))?;
        tracing::info!("{}", source::counts(&collection.scenarios));
        let planned = timed(&mut timings.plan_s, || plan_study(&collection.scenarios, &profile, &options))?;
        for left_out in &planned.left_out {
            tracing::warn!("{left_out}; {}", left_out.help().unwrap_or_default());
        }
        if planned.plan.unit_count() == 0 {
            return Err(Error::input(
                Place::item(source.describe()),
                format!("no scenario to simulate ({})", source::counts(&collection.scenarios)),
                "use more recordings, or relax the filters in the study file (--config)",
            ));
        }
        let reference = CpuBackend::reference();
        let backend: &dyn Backend = if self.reference { &reference } else { opened.backend() };
        let recheck = opened.device().map(|_| Recheck::new(&planned.plan, config.score.seed, ONE_IN));
        // Before the work, so that a folder that cannot be written to is known at once.
        make_folder(&self.out)?;
        let how = How { backend, fallback: opened.fallback(), recheck: recheck.as_ref() };
        tracing::info!("{} lanes on {}", planned.plan.lane_count(), backend.describe());
        let (partial, mut swept) = timed(&mut timings.sweep_s, || run_plan(&planned.plan, &how, verbosity))?;
        let scores = timed(&mut timings.score_s, || score(&planned.plan, &partial, &config.score))?;
        let claims = judge_claims(&scores);
        if let Some(path) = &self.lanes {
            let digits = if self.reference { Digits::Binary64 } else { Digits::Binary32 };
            swept.add(&write_lanes(path, &planned.plan, &how, digits)?);
        }
        let comparison = self.compare_reference.then(|| compare_reference(&planned.plan)).transpose()?;
        let categories = category_records(&collection, &planned, &scores);
        let run = RunRecord {
            program: format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
            data: source.describe(),
            synthetic: source.is_synthetic(),
            backend: match (how.fallback, swept.redone_lanes) {
                (Some(stand_in), 1..) => format!("{}; where it failed {}", backend.describe(), stand_in.describe()),
                _ => backend.describe(),
            },
            device: opened.device(),
            sweep: SweepRecord {
                rechecked_lanes: swept.rechecked_lanes,
                recheck_seed: config.score.seed,
                redone_lanes: swept.redone_lanes,
                device_s: swept.device_s,
            },
            plan_sha256: planned.plan.hash().to_owned(),
            scenario_file_sha256: self.scenarios.as_deref().map(source::checksum).transpose()?,
            left_out: collection.problems.iter().chain(&planned.left_out).map(Error::to_string).collect(),
            recordings: collection.recordings,
            categories,
            lanes: planned.plan.lane_count(),
            profile,
            mining: config.mining,
            parameterization: config.parameterization,
            score: config.score,
            timings,
        };
        let report = StudyReport { scores, claims, run, published: self.published, comparison };
        let written = report.write(&self.out)?;
        console::print(&report.text())?;
        tracing::info!("{} files written to {}", written.len(), self.out.display());
        Ok(if collection.problems.is_empty() { Exit::Ok } else { Exit::Incomplete })
    }

    /// The lane table must replace neither an input nor another result.
    fn guard_inputs(&self) -> Result<()> {
        let Some(lanes) = &self.lanes else { return Ok(()) };
        let results = ["failures.csv", "f1.csv", "claims.csv", "report.txt", "reference.csv", "run.json"];
        let mut others: Vec<PathBuf> = results.map(|name| self.out.join(name)).to_vec();
        others.extend(self.scenarios.clone());
        others.extend(self.config.clone());
        source::refuse_overwriting(lanes, &others, "--lanes")?;
        self.dir.as_deref().map_or(Ok(()), |dir| source::refuse_recording(lanes, dir, "--lanes"))
    }

    fn categories(&self) -> Result<Vec<Category>> {
        source::categories(&self.categories, "--categories")
    }
}

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds = start.elapsed().as_secs_f64();
    result
}

/// Who computes the lanes, who stands in, who checks.
pub(super) struct How<'a> {
    pub backend: &'a dyn Backend,
    pub fallback: Option<&'a dyn Backend>,
    pub recheck: Option<&'a Recheck<'a>>,
}

impl How<'_> {
    fn options(&self, wanted: Wanted) -> SweepOptions<'_> {
        SweepOptions { wanted, fallback: self.fallback, recheck: self.recheck }
    }
}

/// Every lane of a plan, counted.
pub(super) fn run_plan(plan: &LanePlan, how: &How, verbosity: Verbosity) -> Result<(Partial, SweepSummary)> {
    let bar = console::progress(verbosity, plan.unit_count(), "sweeping");
    let mut parts = Vec::new();
    let summary = sweep(plan, 0..plan.unit_count(), how.backend, &how.options(Wanted::Verdicts), |chunk| {
        bar.inc(chunk.units.end - chunk.units.start);
        parts.push(Partial::from_chunk(plan, &chunk)?);
        Ok(())
    })?;
    bar.finish_and_clear();
    Ok((parts.into_iter().try_fold(Partial::empty(plan), Partial::merge)?, summary))
}

/// Every lane in f32 and in f64, chunk by chunk.
fn compare_reference(plan: &LanePlan) -> Result<ReferenceComparison> {
    let (narrow, wide) = (CpuBackend::lane_arithmetic(), CpuBackend::reference());
    let (mut narrow, mut wide) = (narrow.prepare(plan)?, wide.prepare(plan)?);
    let mut comparison = ReferenceComparison::default();
    for units in chunks(plan, 0..plan.unit_count()) {
        let reference = wide.run(units.clone(), Wanted::Outcomes)?;
        comparison.add(plan, &narrow.run(units, Wanted::Outcomes)?, &reference);
    }
    Ok(comparison)
}

/// One row per lane, chunk by chunk, so that memory does not grow with the lanes.
fn write_lanes(path: &Path, plan: &LanePlan, how: &How, digits: Digits) -> Result<SweepSummary> {
    if let Some(dir) = path.parent().filter(|d| !d.as_os_str().is_empty()) {
        make_folder(dir)?;
    }
    let mut swept = Ok(SweepSummary::default());
    let written = crate::report::files::write_atomically_with(path, |out| {
        lanes::write_header(out)?;
        let options = how.options(Wanted::Outcomes);
        swept = sweep(plan, 0..plan.unit_count(), how.backend, &options, |chunk| {
            lanes::write_chunk(out, plan, &chunk, digits).map_err(|e| Error::io(path, "write", e))
        });
        // The sweep's own error is the one to tell.
        if swept.is_ok() { Ok(()) } else { Err(std::io::Error::other("the sweep failed")) }
    });
    let summary = swept?;
    written.map(|()| summary)
}

fn category_records(
    collection: &Collection,
    planned: &StudyPlan,
    scores: &crate::score::ScoreTable,
) -> Vec<CategoryRecord> {
    let plan = &planned.plan;
    let record = |block: &crate::sweep::Block| {
        let of = count(&collection.scenarios, block.category);
        let scored = scores.categories.iter().find(|c| c.category == block.category);
        let cells = || scored.iter().flat_map(|c| &c.cells).filter(|c| c.variant > 0);
        let reduction = planned.reductions.iter().find(|r| r.category == block.category);
        CategoryRecord {
            category: block.category.key(),
            found: of.found,
            kept: of.kept,
            variants: block.variants.clone(),
            lanes: plan.lanes_per_unit(block) * block.units.len(),
            capped_lanes: scored.map_or(0, |c| c.capped.iter().sum()),
            undefined_f1: cells().filter(|c| f1(&c.counts).is_none()).count() as u64,
            undefined_draws: cells().map(|c| u64::from(c.undefined_draws)).sum(),
            svd_explained: reduction.map_or(Vec::new(), |r| r.basis.explained().into_iter().take(8).collect()),
        }
    };
    plan.blocks.iter().map(record).collect()
}
