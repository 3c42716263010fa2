//! `lanesweep compare`: scenarios in, rates of failure of S, S' and densities beside one another out.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::backend_flags::Opened;
use super::configured::Configured;
use super::console::{self, Verbosity};
use super::dry_run::{self, BUDGET, DryRun, ForecastPart};
use super::format::FormatFlag;
use super::source::SourceFlags;
use super::{Exit, fit, lists};
use crate::engine::{Forecast, Headway, LanePlan, Partial, Wanted, forecast};
use crate::model::criterion::Criterion;
use crate::report::compare::{CompareFile, rates};
use crate::report::html::PageFigure;
use crate::run::compare::{self, CompareOptions, CompareResult};
use crate::run::study::StudyOptions;
use crate::scenario::parameterization::Parameterization;
use crate::stats::estimate::Enough;
use crate::support::files::check_folder;
use crate::support::readable::count;
use crate::support::run_dir::{COMPARE_RECORD, OutputDir, Results};
use crate::{Error, Result};

/// Memory of the counts of sampled lanes and of the figures, bytes, measured.
const BYTES_OF_COUNTS: u64 = 8 << 20;

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
    #[command(flatten)]
    data: SourceFlags,
    /// Folder for compare.csv, compare.json and compare.txt
    #[arg(long, value_name = "DIR", default_value = "lanesweep-compare", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    categories: lists::CategoriesFlag,
    #[command(flatten)]
    parameterizations: lists::ParameterizationsFlag,
    #[command(flatten)]
    models: lists::ModelsFlag,
    #[command(flatten)]
    headways: lists::HeadwaysFlag,
    /// Print lanes, memory and estimated time; write nothing
    #[arg(long, help_heading = "Run")]
    dry_run: bool,
    #[command(flatten)]
    exposure: lists::ExposureFlags,
    #[command(flatten)]
    format: FormatFlag,
}

impl Compare {
    pub fn run(&self, configured: &Configured, verbosity: Verbosity) -> Result<Exit> {
        let started = Instant::now();
        let config = &configured.settings;
        let categories = self.categories.list()?;
        let ids = self.parameterizations.list(&categories)?;
        let models = self.models.list()?;
        let headways = self.headways.list()?;
        let typed = self.exposure.driven()?;
        let profile = configured.profile()?;
        self.guard_inputs(configured)?;
        check_folder(&self.out)?;
        let opened = configured.open()?;
        let collection = self.data.load_told(configured, verbosity)?;
        let facts = fit::facts(&self.data.source(configured), &collection, typed)?;
        if facts.driven.is_none() {
            tracing::warn!(
                "exposure is unknown, because the scenarios have no driven time and distance; give --hours and --km"
            );
        }

        let options = CompareOptions {
            study: StudyOptions {
                categories,
                models: models.clone(),
                headways: headways.clone(),
                parameterization: config.of_densities(),
            },
            parameterizations: ids.clone(),
            samples: config.compare.samples,
            seed: config.compare.seed,
            enough: Enough { clusters: config.score.least_failures.into(), margin: config.compare.margin },
        };
        let enough = options.enough;
        let compare = compare::Compare::plan(&collection.scenarios, &facts, profile.clone(), options)?;
        let plan = compare.lane_plan();
        if self.dry_run {
            return self.forecast(
                &facts.data,
                plan,
                (&ids, config.compare.samples),
                &opened,
                started.elapsed().as_secs_f64(),
            );
        }
        let folder = OutputDir::open(&self.out, COMPARE_RECORD)?;
        tracing::info!("{} lanes of S and S' on {}", count(plan.lane_count()), opened.backend().describe());
        let executor = opened.executor().with_recheck(config.compare.seed);
        let bar = console::progress(verbosity, plan.unit_count(), "sweeping");
        let (counts, mut swept) = compare.replay(&executor, |units| bar.inc(units))?;
        bar.finish_and_clear();
        let bar = console::progress(verbosity, ids.len() as u64 * config.compare.samples, "fitting and sampling");
        let result = compare.sample(&counts, &executor, |samples| bar.inc(samples));
        bar.finish_and_clear();
        let CompareResult { categories, left_out, failed, summary } = result?;
        swept.add(&summary);
        for error in left_out.iter().chain(&failed) {
            tracing::warn!("{error}; {}", error.help().unwrap_or_default());
        }
        let complete = collection.problems.is_empty() && left_out.is_empty();

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
            samples: config.compare.samples,
            seed: config.compare.seed,
            level: compare::Compare::LEVEL,
            enough,
            study_plan_sha256: plan.hash().to_owned(),
            left_out: collection.problems.iter().chain(&failed).map(Error::to_string).collect(),
            categories,
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
        (ids, samples): (&[Parameterization], u64),
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
            let lanes = samples.saturating_mul(per_sample);
            let (of, what) = (id.category.label().to_owned(), format!("density {}", id.key));
            parts.push(ForecastPart { of, what, units: samples, lanes });
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
                let figure = rates(file, comparison, criterion).figure();
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

    /// Results must not replace an input.
    fn guard_inputs(&self, configured: &Configured) -> Result<()> {
        let mut results = ["compare.csv", "compare.txt", "compare.json"].into_iter();
        results.try_for_each(|name| self.data.refuse_overwriting(&self.out.join(name), configured, "--out"))
    }
}
