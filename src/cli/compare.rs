//! `lanesweep compare`: compares failure rates of S, S' and densities.

use std::path::PathBuf;

use clap::Args;

use super::arguments::from_arguments;
use super::configured::Configured;
use super::console::{self, Total};
use super::format::FormatFlag;
use super::source::SourceFlags;
use super::{Exit, Output, lists};
use crate::report::compare::CompareReport;
use crate::run::compare::{self, CompareOptions, CompareResult};
use crate::stats::density::DensityKind;
use crate::support::files::check_folder;
use crate::support::readable::count;
use crate::support::run_folder::{COMPARE_RECORD, RunFolder};
use crate::{Error, Result};

/// Which parameterizations give the right risk, not only the right labels?
///
/// Simulates the recorded scenarios (S) and their parameterized replays (S'), fits a density per parameterization on
/// the same scenarios, draws --samples scenarios from each, and compares the rates of failure per category, driver
/// model and criterion, with the ratio to S and its interval. A ratio agrees if its interval lies within the margin.
/// Without data it uses generated recordings. Tables go to stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep compare\n  \
                  lanesweep compare recordings --categories cut-in --samples 1000000\n  \
                  lanesweep compare --scenarios scenarios.jsonl --parameterizations i,iii --models FSM,RSS \\\n      \
                  --thw 0.6,1.0")]
pub(super) struct Compare {
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
    /// Sample Gaussian mixtures and copulas too, to see what the form of the density changes
    #[arg(long, help_heading = "Models and criteria", hide_short_help = true)]
    forms: bool,
    #[command(flatten)]
    exposure: lists::ExposureFlags,
    #[command(flatten)]
    format: FormatFlag,
}

from_arguments!(
    Compare { out, forms }
    groups { data, categories, parameterizations, models, headways, exposure, format }
);

impl Compare {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
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
        let (collection, facts) = self.data.load_with_exposure(configured, typed)?;

        let options = CompareOptions { every_form: self.forms, ..config.comparison(categories, models, headways, ids) };
        let compare = compare::Compare::plan(&collection.scenarios, &facts, profile, options)?;
        let plan = compare.lane_plan();
        let folder = RunFolder::open(&self.out, COMPARE_RECORD)?;
        tracing::info!("{} lanes of S and S' on {}", count(plan.lane_count()), opened.backend().describe());
        let executor = opened.executor().with_recheck(config.compare.seed);
        let units = Total::Exact(plan.unit_count());
        let (counts, mut swept) =
            configured.with_progress(units, "sweeping", &executor, |executor| compare.replay(executor))?;
        let densities = compare.options().parameterizations.len() * if self.forms { DensityKind::ALL.len() } else { 1 };
        let units = Total::Exact(densities as u64 * config.compare.samples);
        let CompareResult { categories, left_out, failed, summary } =
            configured.with_progress(units, "fitting and sampling", &executor, |executor| {
                compare.sample(&counts, executor)
            })?;
        swept.add(&summary);
        console::warn(left_out.iter().chain(&failed));
        let complete = collection.problems.is_empty() && left_out.is_empty();

        let left_out = collection.problems.iter().chain(&failed).map(Error::to_string).collect();
        let host = configured.host(&opened, swept.rechecked_lanes, false);
        let report = CompareReport { compare: &compare, categories, left_out, host };
        let files = report.write(folder.results()?)?;
        let exit = if complete && failed.is_empty() { Exit::Ok } else { Exit::Incomplete };
        self.format.output_in(&self.out, exit, || report.text(), || report.json(&files))
    }

    /// Results must not replace an input.
    fn guard_inputs(&self, configured: &Configured) -> Result<()> {
        let mut results = ["compare.csv", "compare.txt", "compare.json"].into_iter();
        results.try_for_each(|name| self.data.refuse_overwriting(&self.out.join(name), configured, "--out"))
    }
}
