//! `lanesweep compare`: scenarios in, rates of failure of S, S' and densities beside one another out.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::backend_flags::{BackendFlags, Opened};
use super::configured::Configured;
use super::console::{self, Verbosity};
use super::dry_run::{self, BUDGET, DryRun, Part};
use super::format::FormatFlag;
use super::source::{self, PlausibilityFlag, Source};
use super::study_run::run_plan;
use super::synth::GeneratorFlags;
use super::{Exit, ProfileFlags, fit, lists};
use crate::engine::{Forecast, Headway, LanePlan, Partial, SweepSummary, Wanted, forecast};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::compare::CompareFile;
use crate::report::compare_figures;
use crate::report::html::PageFigure;
use crate::run::sampling::{
    CategoryComparison, ComparedParameterization, SampleHeadways, SamplePlanOptions, SampleSource, ScenarioCounts,
    compare_cells, kernel_scenarios, plan_samples, recorded_cells, sample_by_scenario,
};
use crate::run::study::{StudyOptions, plan_study};
use crate::scenario::Scenario;
use crate::scenario::parameterization::ParameterizationId;
use crate::stats::density::{BandwidthRule, DataFacts, DensityModel, Exposure, FitOptions};
use crate::stats::estimate::Enough;
use crate::support::files::check_folder;
use crate::support::readable::count;
use crate::support::run_dir::{COMPARE_RECORD, Results, RunFolder};
use crate::traffic::mining::counts_text;
use crate::{Error, Place, Result};

/// Memory of the counts of sampled lanes and of the figures, bytes, measured.
const BYTES_OF_COUNTS: u64 = 8 << 20;

/// Nominal level of every interval.
const LEVEL: f64 = 0.95;

/// Which parameterizations give the right risk, not only the right labels?
///
/// Simulates the recorded scenarios (S) and their parameterized replays (S'), fits a density per parameterization on
/// the same scenarios, draws --samples scenarios from each, and sets the rates of failure beside one another: per
/// category, driver model and criterion, with the ratio to S and its interval. A ratio whose interval holds 1
/// agrees. Without data it runs on synthetic recordings of its own. Tables go to stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  lanesweep compare\n  lanesweep compare recordings --categories cut-in --samples \
                        1000000\n  lanesweep compare --scenarios scenarios.jsonl --parameterizations i,iii --models \
                        FSM,RSS --thw 0.6,1.0")]
pub struct Compare {
    /// Folder of highD-format recordings [default: synthetic recordings]
    #[arg(value_name = "DIR", conflicts_with = "scenarios")]
    dir: Option<PathBuf>,
    /// Scenario file (.jsonl, .parquet, .csv) instead of recordings
    #[arg(long, value_name = "FILE")]
    scenarios: Option<PathBuf>,
    /// Folder for compare.csv, compare.json and compare.txt
    #[arg(long, value_name = "DIR", default_value = "lanesweep-compare")]
    out: PathBuf,
    #[command(flatten)]
    categories: lists::CategoriesFlag,
    #[command(flatten)]
    parameterizations: lists::ParameterizationsFlag,
    #[command(flatten)]
    models: lists::ModelsFlag,
    /// Time headways; paper is 2.0, 1.8, … 0.2
    #[arg(long, value_name = "s,s,…|paper", default_value = "paper")]
    thw: String,
    /// Samples of each density; each runs from every headway
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    samples: u64,
    /// Seed of the draws
    #[arg(long, value_name = "N", default_value_t = 157)]
    seed: u64,
    /// Print lanes, memory and estimated time; write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    exposure: lists::ExposureFlags,
    #[command(flatten)]
    format: FormatFlag,
    #[command(flatten)]
    backend: BackendFlags,
    #[command(flatten)]
    profile: ProfileFlags,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
    #[command(flatten)]
    generator: GeneratorFlags,
}

/// Everything that a run was given, read and checked, with the lanes of its study.
struct Run<'a> {
    flags: &'a Compare,
    scenarios: &'a [Scenario],
    facts: &'a DataFacts,
    fit: FitOptions,
    profile: &'a Profile,
    models: Vec<ModelId>,
    headways: Vec<Headway>,
    enough: Enough,
    opened: &'a Opened,
    study: &'a LanePlan,
    partial: &'a Partial,
}

impl Compare {
    pub fn run(&self, configured: &Configured, verbosity: Verbosity) -> Result<Exit> {
        let started = Instant::now();
        let config = &configured.settings;
        let categories = self.categories.list()?;
        let ids = self.parameterizations.list(&categories)?;
        let models = self.models.list()?;
        let headways = lists::paper_or_headways(&self.thw)?;
        self.check_samples()?;
        let typed = self.exposure.driven()?;
        let profile = self.profile.load()?;
        let source = match (&self.dir, &self.scenarios) {
            (Some(dir), _) => Source::Folder(dir.clone()),
            (None, Some(path)) => Source::Scenarios(path.clone()),
            (None, None) => Source::Generated(self.generator.options(configured)?),
        };
        self.guard_inputs(configured)?;
        check_folder(&self.out)?;
        let opened = self.backend.open()?;
        tracing::info!("{}", source.describe(false));
        let collection = source.load(&config.mining, self.plausibility.policy(), verbosity)?;
        tracing::info!("{}", counts_text(&collection.scenarios));
        let facts = fit::facts(&source, &collection, typed)?;
        if facts.driven.is_none() {
            tracing::warn!("exposure is unknown: the scenarios do not say what was driven; give --hours and --km");
        }

        let options = StudyOptions {
            // Categories without a wanted parameterization have nothing to be compared with.
            categories: categories.into_iter().filter(|c| ids.iter().any(|id| id.category == *c)).collect(),
            models: models.clone(),
            headways: headways.clone(),
            parameterization: config.parameterization.clone(),
        };
        let planned = plan_study(&collection.scenarios, &profile, &options)?;
        let plan = &planned.plan;
        if plan.unit_count() == 0 {
            return Err(Error::input(
                Place::item(facts.data),
                format!("no scenario to simulate ({})", counts_text(&collection.scenarios)),
                "use more recordings, or relax the filters ([mining] in --config)",
            ));
        }
        if self.dry_run {
            return self.forecast(&facts.data, plan, &ids, &opened, started.elapsed().as_secs_f64());
        }
        let folder = RunFolder::open(&self.out, COMPARE_RECORD)?;
        tracing::info!("{} lanes of S and S' on {}", count(plan.lane_count()), opened.backend().describe());
        let executor = opened.executor().with_recheck(self.seed);
        let (partial, mut swept) = run_plan(plan, &executor, verbosity)?;

        let run = Run {
            flags: self,
            scenarios: &collection.scenarios,
            facts: &facts,
            fit: FitOptions {
                parameterization: config.parameterization.clone(),
                with_thw: false,
                rule: BandwidthRule::Reduction,
                representativeness: false,
                ..FitOptions::default()
            },
            profile: &profile,
            models: models.clone(),
            headways: headways.clone(),
            enough: Enough {
                failures: config.score.least_failures.into(),
                margin: config.compare.margin,
                ..Enough::default()
            },
            opened: &opened,
            study: plan,
            partial: &partial,
        };
        let mut compared: Vec<CategoryComparison> =
            (0..plan.blocks.len()).map(|block| run.recorded(block)).collect::<Result<_>>()?;
        let bar = console::progress(verbosity, ids.len() as u64 * self.samples, "fitting and sampling");
        let (mut failed, mut complete) = (Vec::new(), collection.problems.is_empty());
        for id in &ids {
            match run.parameterization(*id, &mut swept, |n| bar.inc(n)) {
                Ok((cells, left_out)) => {
                    complete &= left_out.is_empty();
                    for error in &left_out {
                        bar.suspend(|| tracing::warn!("{error}; {}", error.help().unwrap_or_default()));
                    }
                    let of = compared.iter_mut().find(|c| c.category == id.category);
                    of.into_iter().for_each(|c| c.parameterizations.push(cells.clone()));
                }
                // A profile whose cut-outs cannot be sampled is a usage error of that category alone.
                Err(error @ (Error::Input { .. } | Error::Usage { .. })) => failed.push(error),
                Err(error) => return Err(error),
            }
        }
        bar.finish_and_clear();
        if compared.iter().all(|c| c.parameterizations.is_empty()) && !failed.is_empty() {
            return Err(failed.swap_remove(0));
        }
        for error in &failed {
            tracing::warn!("{error}; {}", error.help().unwrap_or_default());
        }

        let mut file = CompareFile {
            lanesweep_comparison: 1,
            program: format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
            data: facts.data.clone(),
            synthetic: facts.synthetic,
            scenarios_sha256: facts.scenarios_sha256.clone(),
            driven: facts.driven,
            profile: profile.name.clone(),
            models,
            headways: headways.iter().map(Headway::to_string).collect(),
            samples: self.samples,
            seed: self.seed,
            level: LEVEL,
            enough: run.enough,
            study_plan_sha256: plan.hash().to_owned(),
            left_out: collection.problems.iter().chain(&failed).map(Error::to_string).collect(),
            categories: compared,
            files: Vec::new(),
            host: opened.host(swept.rechecked_lanes, started),
        };
        self.write(&mut file, folder.results()?)?;
        Ok(if complete && failed.is_empty() { Exit::Ok } else { Exit::Incomplete })
    }

    /// What the run would be. Sampled lanes are taken to cost what those of their category's scenarios do.
    fn forecast(
        &self,
        data: &str,
        plan: &LanePlan,
        ids: &[ParameterizationId],
        opened: &Opened,
        before_s: f64,
    ) -> Result<Exit> {
        let per_sample = (plan.headways.len() * plan.models.len()) as u64;
        let mut parts = dry_run::parts(plan);
        let mut whole = forecast(plan, opened.backend(), Wanted::Verdicts, BUDGET, |chunk| {
            Partial::from_chunk(plan, &chunk).map(drop)
        })?;
        let per_lane_s = whole.seconds / whole.lanes.max(1) as f64;
        for id in ids {
            let lanes = self.samples.saturating_mul(per_sample);
            let (of, what) = (id.category.label().to_owned(), format!("density {}", id.key));
            parts.push(Part { of, what, units: self.samples, lanes });
            whole.add(&Forecast { lanes, seconds: lanes as f64 * per_lane_s, measured_lanes: 0, lanes_at_once: 0 });
        }
        DryRun {
            data: data.to_owned(),
            parts,
            units: "cases",
            is_at_most: false,
            more_bytes: BYTES_OF_COUNTS,
            more: "counts per scenario and figures",
            forecast: Some(whole),
            backend: opened.backend().describe(),
            before: Some((before_s, "reading, mining and planning")),
            besides: "fitting the densities",
        }
        .print(self.format)?;
        Ok(Exit::Ok)
    }

    /// Tables, figures and record.
    fn write(&self, file: &mut CompareFile, mut results: Results) -> Result<()> {
        let text = file.text();
        results.add("compare.csv", &file.csv()?)?;
        results.add("compare.txt", text.as_bytes())?;
        let mut figures = Vec::new();
        for comparison in &file.categories {
            for criterion in Criterion::ALL {
                let name = format!("rates-{}-{}.svg", comparison.category.key(), criterion.key());
                let figure = compare_figures::rates(file, comparison, criterion);
                let svg = figure.svg();
                results.add(&name, svg.as_bytes())?;
                figures.push(PageFigure::new(&svg, &[&name, "compare.csv"]));
            }
        }
        results.add("report.html", file.html(figures)?.as_bytes())?;
        file.files = results.names();
        results.publish(file.json()?.as_bytes())?;
        self.format.print(|| text, || file.json())?;
        tracing::info!("results written to {}", self.out.display());
        Ok(())
    }

    fn check_samples(&self) -> Result<()> {
        let problem = match self.samples {
            0 => "0 samples estimate nothing",
            n if n >= 1 << 48 => "2^48 samples and more cannot be counted",
            _ => return Ok(()),
        };
        Err(Error::usage(Place::item("--samples"), problem, "give 20000, for instance"))
    }

    /// Results must not replace an input.
    fn guard_inputs(&self, configured: &Configured) -> Result<()> {
        let inputs: Vec<PathBuf> = self.scenarios.iter().chain(configured.files()).cloned().collect();
        for name in ["compare.csv", "compare.txt", "compare.json"] {
            source::refuse_overwriting(&self.out.join(name), &inputs, "--out")?;
        }
        Ok(())
    }
}

impl Run<'_> {
    /// S of one category.
    fn recorded(&self, block: usize) -> Result<CategoryComparison> {
        let of = &self.study.blocks[block];
        let exposure = self.facts.driven.map(|driven| Exposure::new(of.units.len(), driven));
        let counts = ScenarioCounts::of_variant(self.study, self.partial, block, 0)?;
        Ok(CategoryComparison {
            category: of.category,
            scenarios: of.units.len(),
            exposure,
            recorded: recorded_cells(self.study, &counts, exposure.as_ref(), LEVEL),
            parameterizations: Vec::new(),
        })
    }

    /// One parameterization, with the scenarios that its density leaves out.
    fn parameterization(
        &self,
        id: ParameterizationId,
        swept: &mut SweepSummary,
        progress: impl FnMut(u64),
    ) -> Result<(ComparedParameterization, Vec<Error>)> {
        let fitted = DensityModel::fit(id, self.scenarios, self.facts, &self.fit)?;
        let density = fitted.model;
        let find = |(at, block): (usize, &crate::engine::Block)| {
            let variant = block.variants.iter().position(|v| v == id.key)?;
            (block.category == id.category).then_some((at, variant))
        };
        let Some((block, variant)) = self.study.blocks.iter().enumerate().find_map(find) else {
            return Err(Error::Internal(format!("{} {} has a density but no lanes", id.category.label(), id.key)));
        };
        let options = SamplePlanOptions {
            samples: self.flags.samples,
            seed: self.flags.seed,
            source: SampleSource::Random,
            models: self.models.clone(),
            headways: SampleHeadways::Each(self.headways.clone()),
        };
        let plan = plan_samples(&density, &density.mixture()?, self.profile, &options)?;
        let executor = self.opened.executor().with_recheck(self.flags.seed);
        let kernels = kernel_scenarios(&density, self.scenarios)?;
        let scenarios = self.study.blocks[block].units.len() as usize;
        let exposure = density.exposure.as_ref();
        let sampled = sample_by_scenario(&plan, &kernels, scenarios, &executor, exposure, LEVEL, progress)?;
        swept.add(&sampled.summary);
        let compared = ComparedParameterization {
            key: id.key,
            parameters: id.parameters,
            density_sha256: density.content_sha256()?,
            kernels: kernels.len(),
            plan_sha256: plan.hash().to_owned(),
            voids: sampled.tally.voids,
            cells: compare_cells(self.study, self.partial, block, variant, &sampled, self.enough, LEVEL)?,
        };
        Ok((compared, fitted.left_out))
    }
}
