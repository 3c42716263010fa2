//! `lanesweep sample`: plans the run, executes it whole or as a shard, and writes the result.

use std::path::PathBuf;

use super::configured::Configured;
use super::sample::{Sample, guard, only_crude};
use super::signals::CANCEL;
use super::{COMMIT, Exit, Output};
use lanesweep_engine::{Chunk, CpuBackend, Executor, LanePlan, OpenBackend, SampleTally};
use lanesweep_report::host::Host;
use lanesweep_report::lanes;
use lanesweep_run::parts::{EachChunk, Job, PLAN_FILE};
use lanesweep_run::sampling::{self, SampleKind, SampleOptions, SampleResult};
use lanesweep_stats::density::read_density;
use lanesweep_stats::estimate::{Search, StopRule};
use lanesweep_support::atomic_file::StagedFile;
use lanesweep_support::readable::{count, counted, duration};
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::table::TableWriter;
use lanesweep_support::{Error, Place, Result};

impl Sample {
    pub(crate) fn run(&self, configured: &Configured) -> Result<Output> {
        self.check()?;
        if let Some(path) = &self.shards.plan {
            configured.refuse_with_plan()?;
            let sample = sampling::Sample::read(path)?;
            if self.rows.is_some() && sample.lane_plan().is_none() {
                return Err(only_crude("rows"));
            }
            self.guard_tables()?;
            return self.run_sample(sample, &configured.open()?, configured);
        }
        let (sample, data) = self.planned(configured)?;
        let opened = configured.open()?;
        tracing::info!("{data}");
        let sample = if self.is_refined() { self.chosen(sample, &opened)? } else { sample };
        self.run_sample(sample, &opened, configured)
    }

    /// The run of crude Monte Carlo with as many samples as are cheaper than importance sampling.
    fn chosen(&self, sample: sampling::Sample, opened: &OpenBackend) -> Result<sampling::Sample> {
        let choice = sample.choice(self.settings.half_width.unwrap_or_default(), &opened.executor())?;
        let seconds = |samples: f64| duration(samples * choice.seconds_per_sample);
        let samples = self.settings.samples.unwrap_or(choice.samples).min(choice.samples);
        let all = match choice.samples_for_all {
            Some(all) => format!("{} samples for all, about {}", count(all as u64), seconds(all)),
            None => format!("more than {} to find every failure", count(choice.samples)),
        };
        tracing::info!(
            "{} by {} samples of crude Monte Carlo (about {}), {} by importance sampling; crude Monte Carlo alone would \
             need {all}",
            counted(choice.by_crude, "question"),
            count(samples),
            seconds(samples as f64),
            choice.by_importance,
        );
        let options = SampleOptions { stop: StopRule::samples(samples), ..sample.options.clone() };
        sampling::Sample::plan(sample.density, &sample.profile, &options)
    }

    /// Plans a run over the density; returns the plan and a description of the data.
    ///
    /// # Errors
    /// Those that the run would end with.
    pub(super) fn planned(&self, configured: &Configured) -> Result<(sampling::Sample, String)> {
        self.check()?;
        let Some(density) = &self.density else {
            let help = "give a file that `lanesweep fit` wrote";
            return Err(Error::usage(Place::option("density"), "there is none", help));
        };
        let density = read_density(density)?;
        self.shards.check_folder(&self.out, sampling::ESTIMATE_RECORD)?;
        let profile = configured.profile()?;
        let options = self.options(&density)?;
        self.guard_tables()?;
        let data = density.provenance.data.clone();
        Ok((sampling::Sample::plan(density, &profile, &options)?, data))
    }

    /// Checks that no table of lanes replaces another result.
    fn guard_tables(&self) -> Result<()> {
        let guard = |table: &Option<PathBuf>, flag, other| {
            table.as_ref().map_or(Ok(()), |table| guard(table, flag, &self.out, other))
        };
        guard(&self.rows, "rows", None)?;
        guard(&self.failures, "failures", self.rows.as_ref())
    }

    /// Executes a plan, whole or a shard of it.
    fn run_sample(&self, sample: sampling::Sample, opened: &OpenBackend, configured: &Configured) -> Result<Output> {
        let executor = &opened.executor().with_recheck(sample.options.seed);
        let is_split = self.shards.is_split();
        let sample = match sample.kind {
            SampleKind::Search(search) => {
                let units = warn_of_long(&sample, &search);
                // The search is kept in the folder, so it needs the folder's lock too.
                let _folder = (!is_split).then(|| RunFolder::open(&self.out, sampling::ESTIMATE_RECORD)).transpose()?;
                let found = configured.with_progress(units, "searching, at most", executor, |executor| {
                    sample.searched(executor, &self.out, is_split)
                })?;
                if !is_split {
                    found.keep_search(&self.out)?;
                }
                found
            }
            _ => sample,
        };
        if is_split {
            sample.write_plan(&self.out)?;
        }
        if self.shards.plan_only {
            return self.format.planned(Exit::Ok, sample.lane_count(), &self.out.join(PLAN_FILE));
        }
        // Rows are written during the run, so a run with rows cannot resume.
        let Some(mut run) = sample.open(&self.out, self.shards.shard, self.rows.is_none())? else {
            return Ok(Exit::Ok.into());
        };
        let missing = run.missing()?;
        let crude = match &sample.kind {
            SampleKind::Weighted(weighted) => missing.saturating_mul(weighted.draws.crude_per_draw),
            _ => 0,
        };
        let beside = if crude > 0 { format!(", and {} draws of the density,", count(crude)) } else { String::new() };
        tracing::info!("{} samples{beside} on {}", count(missing), executor.backend.describe());
        let is_empty = run.units().is_empty();
        let rows = self.rows.as_deref().filter(|_| !is_empty);
        let mut table = rows.map(|path| lanes::sampled_table(path, &sample)).transpose()?;
        let failures = self.failures.as_deref().map(|path| lanes::sampled_table(path, &sample)).transpose()?;
        let mut write_chunk = table
            .as_mut()
            .map(|table| |plan: &LanePlan, chunk: &Chunk| lanes::write_sampled_chunk(table, &sample, plan, chunk));
        let each = write_chunk.as_mut().map(|write| write as &mut EachChunk);
        let what = if sample.options.stop.is_fixed() { "sampling" } else { "sampling, at most" };
        configured.with_progress(missing, what, executor, |executor| run.compute(executor, each))?;
        let rows = table.map(TableWriter::stage).transpose()?;
        if self.shards.shard.is_some() {
            rows.map_or(Ok(()), StagedFile::publish)?;
            run.write_part()?;
            return Ok(Exit::Ok.into());
        }
        let mut result = run.take_result()?;
        if let Some(half_width) = self.settings.half_width.filter(|_| self.is_refined()) {
            tracing::info!("importance sampling of what is rare");
            let search = self.search(&sample.options.models, &sample.options.headways);
            let units = warn_of_long(&sample, &search);
            result = configured.with_progress(units, "searching, at most", executor, |executor| {
                sample.refined(result, &search, half_width, executor)
            })?;
        }
        if let Some(asked) = self.settings.half_width {
            let (wider, all) = result.wider_than(asked, self.settings.criterion);
            if wider > 0 {
                tracing::warn!(
                    "{wider} of {} did not reach the half-width of {asked}: its weights vary more than the search foresaw, \
                     draws of the density met failures that it had missed, or the maximum number of samples ended it",
                    counted(all, "row")
                );
            }
        }
        let failures = failures.map(|table| list_failures(table, &sample, &result, configured)).transpose()?;
        let settings = configured.record(self.shards.plan.is_some());
        let host = Host::of(COMMIT, opened, result.rechecked_lanes, configured.started, settings);
        let mut results = run.results()?;
        rows.into_iter().chain(failures).for_each(|table| results.join(table));
        let output = self.format.sample(&sample, &result, host, results)?;
        run.close()?;
        Ok(output)
    }
}

/// Fills the table of the first failing lanes.
pub(super) fn list_failures(
    mut table: TableWriter,
    sample: &sampling::Sample,
    result: &SampleResult,
    configured: &Configured,
) -> Result<StagedFile> {
    let cpu = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&cpu).with_cancel(CANCEL.clone());
    let samples = result.crude.as_ref().map_or(sample.unit_count(), SampleTally::samples);
    configured.with_progress(samples, "failing lanes", &executor, |executor| {
        let limit = configured.settings.sample.failures_limit;
        sample.failing_lanes(result, limit, executor, &mut |drawn, headway, model, outcome| {
            lanes::write_sampled_lane(&mut table, sample, drawn, (headway, model), outcome)
        })
    })?;
    table.stage()
}

/// The maximum number of points of a search, which may end long before it. Warns where it takes long.
fn warn_of_long(sample: &sampling::Sample, search: &Search) -> u64 {
    let most = search.most_points(sample.options.asked().len());
    for model in &sample.options.models {
        if model.foreign().is_some_and(|driver| driver.may_accelerate()) {
            tracing::warn!(
                "driver {} may accelerate, so that each lane runs to a contact or the time cap, {} steps; the search has up \
                 to {} points",
                model.name(),
                count(u64::from(sample.profile.step_cap())),
                count(most)
            );
        }
    }
    most
}
