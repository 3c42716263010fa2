//! `lanesweep sample`: plans what the flags ask for, runs it whole or as a shard, and writes the result.

use std::time::Instant;

use super::Exit;
use super::backend_flags::Opened;
use super::configured::Configured;
use super::console::{self, Verbosity};
use super::format::FormatFlag;
use super::sample::Sample;
use super::sample_checks::{guard, only_crude};
use super::sample_distribution;
use super::sample_forecast::forecast_sample;
use super::sample_lanes::{self, RowTable};
use crate::engine::Executor;
use crate::report::sampling::{DrawRecord, EstimateFile, HostRecord, RunFacts};
use crate::run::parts::{PLAN_FILE, Shard};
use crate::run::sampling::crude_plan::CrudePlan;
use crate::run::sampling::{self, SampleKind, SampleResult, conditional, proposal_text};
use crate::stats::density::read_density;
use crate::support::atomic_file::StagedFile;
use crate::support::files::check_folder;
use crate::support::readable::count;
use crate::support::run_dir::{ESTIMATE_RECORD, OutputDir, Results};
use crate::{Error, Place, Result};

/// A condition that so few scenarios are near is outside the data.
const FEW_SCENARIOS: f64 = 5.0;

impl Sample {
    pub fn run(&self, configured: &Configured, verbosity: Verbosity) -> Result<Exit> {
        let started = Instant::now();
        self.check()?;
        self.shards.start()?;
        if let Some(path) = &self.shards.plan {
            configured.refuse_with_plan()?;
            let sample = sampling::Sample::read(path)?;
            if let Some(rows) = &self.rows {
                if sample.lane_plan().is_none() {
                    return Err(only_crude("--rows"));
                }
                guard(rows, &self.out, std::iter::once(path))?;
            }
            return self.run_sample(sample, &configured.open()?, started, verbosity);
        }
        if let Some(path) = &self.distribution {
            return sample_distribution::run(self, configured, path, started, verbosity);
        }
        let (sample, data) = self.planned(configured)?;
        let opened = configured.open()?;
        tracing::info!("{data}");
        self.run_sample(sample, &opened, started, verbosity)
    }

    /// Plans a run of the density, for who writes the command down too; with what the data are.
    ///
    /// # Errors
    /// Those that the run would end with.
    pub(super) fn planned(&self, configured: &Configured) -> Result<(sampling::Sample, String)> {
        self.check()?;
        let Some(density) = &self.density else {
            return Err(Error::usage(
                Place::item("DENSITY"),
                "there is none",
                "give a file that `lanesweep fit` wrote",
            ));
        };
        let density = read_density(density)?;
        if !self.dry_run {
            check_folder(&self.out)?;
        }
        let profile = configured.profile()?;
        let options = self.options(&density)?;
        if let Some(rows) = &self.rows {
            guard(rows, &self.out, self.density.iter().chain(&self.proposal))?;
        }
        let data = density.provenance.data.clone();
        Ok((sampling::Sample::plan(density, &profile, &options)?, data))
    }

    /// From a plan to the estimates, or to a part of them.
    fn run_sample(
        &self,
        sample: sampling::Sample,
        opened: &Opened,
        started: Instant,
        verbosity: Verbosity,
    ) -> Result<Exit> {
        if self.dry_run {
            return forecast_sample(&sample, opened, self.format);
        }
        if self.shards.plan_only || self.shards.is_part() {
            sample.write_plan(&self.out)?;
        }
        if self.shards.plan_only {
            self.format.print_plan(sample.lane_count(), &self.out.join(PLAN_FILE))?;
            return Ok(Exit::Ok);
        }
        let executor = opened.executor().with_recheck(sample.seed());
        if matches!(sample.0, SampleKind::Sequential(_)) {
            let folder = OutputDir::open(&self.out, ESTIMATE_RECORD)?;
            let results = folder.results()?;
            let result = sample.run(&executor)?;
            return write(&sample, result, opened.host(0, started), results, self.format);
        }
        let sample = if matches!(sample.0, SampleKind::Pilot(..)) {
            // The proposals are kept in the folder, so the search needs the folder's lock too.
            let _folder = OutputDir::open(&self.out, ESTIMATE_RECORD)?;
            sample.searched(&executor, Some(&self.out))?
        } else {
            sample
        };
        self.run_split(&sample, opened, &executor, started, verbosity)
    }

    /// Runs what can be split and resumed.
    fn run_split(
        &self,
        sample: &sampling::Sample,
        opened: &Opened,
        executor: &Executor,
        started: Instant,
        verbosity: Verbosity,
    ) -> Result<Exit> {
        if let SampleKind::Crude(planned, _) = &sample.0 {
            warn(planned)?;
        }
        // Rows are written on the way: a run that writes them begins anew.
        let Some(mut run) = sample.open(&self.out, self.shards.shard, self.rows.is_none())? else {
            tracing::info!("this part exists already and is complete");
            return Ok(Exit::Ok);
        };
        let missing = run.missing()?;
        tracing::info!("{} samples on {}", count(missing), executor.backend.describe());
        let is_empty = run.units().is_empty();
        let rows = self.rows.as_deref().filter(|_| !is_empty);
        let mut rows = rows.and_then(|path| Some(RowTable::create(path, sample.lane_plan()?, sample.density())));
        let bar = console::progress(verbosity, missing, "sampling");
        let mut table = rows.take().transpose()?;
        let sampled = match &mut table {
            Some(table) => run.sample(executor, &mut |samples| bar.inc(samples), Some(&mut |chunk| table.add(chunk))),
            None => run.sample(executor, &mut |samples| bar.inc(samples), None),
        };
        bar.finish_and_clear();
        sampled?;
        let rows = table.map(RowTable::stage).transpose()?;
        if self.shards.is_part() {
            rows.map_or(Ok(()), StagedFile::publish)?;
            run.write_part()?;
            return Ok(Exit::Ok);
        }
        let result = run.take_result()?;
        let host = opened.host(result.rechecked_lanes, started);
        let mut results = run.results()?;
        rows.into_iter().for_each(|table| results.join(table));
        let exit = write(sample, result, host, results, self.format)?;
        run.close()?;
        Ok(exit)
    }
}

/// What limits the estimates of crude Monte Carlo.
fn warn(planned: &CrudePlan) -> Result<()> {
    if planned.facts.sobol {
        tracing::warn!("Sobol points: the intervals are those of independent draws, so they are conservative");
    }
    if !planned.facts.given.is_empty() {
        let left = conditional(&planned.density, &planned.facts.given)?.effective_scenarios;
        let of = planned.density.kde.points().len();
        if left < FEW_SCENARIOS {
            tracing::warn!(
                "only {left:.1} of {of} scenarios are near the given values: results depend on the kernels, not on data"
            );
        } else {
            tracing::info!("{left:.1} of {of} scenarios are near the given values");
        }
    }
    Ok(())
}

/// Makes the result of the parts in a folder; `again` gives the command that makes a shard.
pub(super) fn merge(folder: &OutputDir, again: &dyn Fn(Shard) -> String, format: FormatFlag) -> Result<Exit> {
    let (sample, result) = sampling::Sample::merge_or(folder.dir(), again)?;
    let host = HostRecord::of_parts(result.parts, result.rechecked_lanes);
    write(&sample, result, host, folder.results()?, format)
}

/// Tables, figures, the record.
fn write(
    sample: &sampling::Sample,
    result: SampleResult,
    host: HostRecord,
    mut results: Results,
    format: FormatFlag,
) -> Result<Exit> {
    let (out, density) = (results.dir().to_path_buf(), sample.density());
    let mut file = EstimateFile::new(density, RunFacts::of(sample), result.rows, host)?;
    let mut figures = Vec::new();
    if let (Some(crude), SampleKind::Crude(planned, _)) = (&result.crude, &sample.0) {
        figures = sample_lanes::write(&mut results, &planned.plan, density, crude, &planned.counting(), &mut file)?;
        file.plan_sha256 = Some(planned.plan.hash().to_owned());
        file.draws = Some(DrawRecord::of(&crude.tally, &planned.plan));
    }
    file.levels = result.levels;
    if sample.has_given_proposals() {
        // A proposal in this folder may be one that was given.
        results.keep(|name| name.starts_with("proposal-"))?;
    }
    for (model, proposal) in &result.proposals {
        results.add(&format!("proposal-{}.json", model.name()), proposal_text(density, proposal)?.as_bytes())?;
    }
    sample_lanes::write_estimates(results, density, &mut file, figures)?;
    format.print(|| file.text(), || file.json())?;
    tracing::info!("results written to {}", out.display());
    Ok(Exit::Ok)
}
