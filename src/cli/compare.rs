//! `lanesweep compare`: scenarios in, rates of failure of S, S' and densities beside one another out.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::backend_flags::BackendFlags;
use super::configured::Configured;
use super::console::{self, Verbosity};
use super::dry_run::DryRun;
use super::format::FormatFlag;
use super::source::{self, GeneratorFlags, PlausibilityFlag, source_of};
use super::{Exit, ProfileFlags, lists};
use crate::report::compare::CompareFile;
use crate::report::sampling::HostRecord;
use crate::run::compare::{self, CompareOptions, CompareResult};
use crate::run::study::StudyOptions;
use crate::stats::estimate::Enough;
use crate::support::files::check_folder;
use crate::support::readable::count;
use crate::support::run_dir::{COMPARE_RECORD, OutputDir};
use crate::traffic::DataProvenance;
use crate::{Error, Place, Result};

/// Which parameterizations give the right risk, not only the right labels?
///
/// Simulates the recorded scenarios (S) and their parameterized replays (S'), fits a density per parameterization on
/// the same scenarios, draws --samples scenarios from each, and compares the rates of failure per category, driver
/// model and criterion, with the ratio to S and its interval. A ratio agrees if its interval lies within the margin.
/// Without data it runs on generated recordings. Tables go to stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep compare\n  \
                  lanesweep compare recordings --categories cut-in --samples 1000000\n  \
                  lanesweep compare --scenarios scenarios.jsonl --parameterizations i,iii --models FSM,RSS \\\n      \
                  --thw 0.6,1.0")]
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
    /// Time headways; observed: the recorded gaps
    ///
    /// paper is 2.0, 1.8, … 0.2; r157 the minimum following distance of UN R157, 5.2.3.3. observed: S and S' start from
    /// the recorded gap of each scenario; a density draws the headway as one more parameter.
    #[arg(long, value_name = "s,s,…|observed", default_value = "paper")]
    thw: String,
    #[arg(long, value_name = "N", value_parser = lists::whole::<u64>)]
    samples: u64,
    #[arg(long, value_name = "N")]
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
        let source = source_of(self.dir.as_ref(), self.scenarios.as_ref(), &self.generator, configured)?;
        self.guard_inputs(configured)?;
        check_folder(&self.out)?;
        let opened = self.backend.open()?;
        tracing::info!("{}", source.describe(false));
        let collection = source::load(&source, &config.mining, self.plausibility.policy(), verbosity)?;
        let facts = DataProvenance::of(&source, &collection, typed)?;
        if facts.driven.is_none() {
            tracing::warn!(
                "exposure is unknown, because the scenarios have no driven time and distance; give --hours and --km"
            );
        }

        let options = CompareOptions {
            study: StudyOptions { categories, models, headways, parameterization: config.of_densities() },
            parameterizations: ids,
            samples: self.samples,
            seed: self.seed,
            enough: Enough { clusters: config.score.least_failures.into(), margin: config.compare.margin },
        };
        let compare = compare::Compare::plan(&collection.scenarios, &facts, profile, options)?;
        let plan = compare.lane_plan();
        if self.dry_run {
            let (backend, before_s) = (opened.backend(), Some(started.elapsed().as_secs_f64()));
            return DryRun { run: compare.forecast(backend)?, backend: backend.describe(), before_s }
                .print(self.format);
        }
        let folder = OutputDir::open(&self.out, COMPARE_RECORD)?;
        tracing::info!("{} lanes of S and S' on {}", count(plan.lane_count()), opened.backend().describe());
        let executor = opened.executor().with_recheck(self.seed);
        let bar = console::progress(verbosity, plan.unit_count(), "sweeping");
        let (counts, mut swept) = compare.replay(&executor.clone().with_progress(console::inc(&bar)))?;
        bar.finish_and_clear();
        let bar = console::progress(
            verbosity,
            compare.options().parameterizations.len() as u64 * self.samples,
            "fitting and sampling",
        );
        let result = compare.sample(&counts, &executor.with_progress(console::inc(&bar)));
        bar.finish_and_clear();
        let CompareResult { categories, left_out, failed, summary } = result?;
        swept.add(&summary);
        console::warn(left_out.iter().chain(&failed));
        let complete = collection.problems.is_empty() && left_out.is_empty();

        let left_out = collection.problems.iter().chain(&failed).map(Error::to_string).collect();
        let mut file =
            CompareFile::of(&compare, categories, left_out, HostRecord::of(&opened, swept.rechecked_lanes, started));
        file.write(folder.results()?)?;
        self.format.print_results(|| file.text(), || file.json(), &self.out)?;
        Ok(if complete && failed.is_empty() { Exit::Ok } else { Exit::Incomplete })
    }

    fn check_samples(&self) -> Result<()> {
        let problem = match self.samples {
            0 => "0 samples give no estimate",
            n if n >= 1 << 48 => "the number of samples must be below 2^48",
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
