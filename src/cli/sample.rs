//! Flags of `lanesweep sample`, which estimates failure probabilities over a density: what they mean for the library, and
//! checks that do not depend on the density.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;

use super::format::FormatFlag;
use super::lists;
use super::source::{PlausibilityFlag, check_lane_table};
use crate::settings::{Assurance, EstimatorKind, SampleSettings};
use lanesweep_engine::Headway;
use lanesweep_model::driver::ModelId;
use lanesweep_run::sampling::{Estimator, SampleHeadways, SampleOptions, read_proposal};
use lanesweep_stats::density::DensityModel;
use lanesweep_stats::estimate::{Goal, Search, StopRule};
use lanesweep_support::{Error, Place, Result, option};

/// How likely does a driver fail?
///
/// Draws concrete scenarios from a density (see `lanesweep fit`), runs each against the driver models and estimates
/// the probability of failure with its interval, by crude Monte Carlo or importance sampling. With --half-width it
/// takes the cheaper one for each question. Each estimate has a verdict on whether to trust it. A table goes to
/// stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "density" | "models" | "thw" | "proposal" => arg.conflicts_with("plan"),
    "rows" => arg.conflicts_with("plan_only"),
    "failures" => arg.conflicts_with_all(["shard", "plan_only"]),
    _ => arg,
}))]
#[command(after_help = "Examples:\n  \
                  lanesweep sample lanesweep-densities/cut-in-2.json --samples 1e6\n  \
                  lanesweep sample cut-in-1.json --models FSM --thw 2 --half-width 0.1\n  \
                  lanesweep sample cut-in-1.json --samples 1e8 --shard 0/2 --out big")]
pub(crate) struct Sample {
    /// Density file
    #[arg(value_name = "DENSITY", required_unless_present = "plan", help_heading = "Data")]
    pub density: Option<PathBuf>,
    #[command(flatten)]
    models: lists::ModelsFlag,
    /// Time headways, s [default: the density's, else paper]
    ///
    /// paper is 2.0, 1.8, … 0.2. observed (or sampled): the headway is drawn from the recorded ones, as a parameter of
    /// the density, which needs `fit --with-thw`.
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Scenario")]
    thw: Vec<String>,
    /// Also write one row per lane: .csv, .jsonl or .parquet
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(super) rows: Option<PathBuf>,
    /// Also write the first failing lanes of each model and criterion: .csv, .jsonl or .parquet
    ///
    /// The first 1000, or sample.failures_limit; with the columns of --rows. With importance sampling it may take as
    /// long as the run, on the CPU. For a run in parts: `merge --failures`.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(super) failures: Option<PathBuf>,
    /// Proposal file to sample, with --estimator is
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    pub(super) proposal: Option<PathBuf>,
    /// Folder for estimate.json, tables and figures
    #[arg(long, value_name = "DIR", default_value = "lanesweep-sample", help_heading = "Output")]
    pub(super) out: PathBuf,
    #[command(flatten)]
    pub(super) plausibility: PlausibilityFlag,
    #[command(flatten)]
    pub(super) format: FormatFlag,
    #[command(flatten)]
    pub(super) shards: lists::ShardFlags,
    /// The values of the flags that set keys.
    #[arg(skip)]
    pub(super) settings: SampleSettings,
}

impl Sample {
    pub(super) fn is_crude(&self) -> bool {
        self.settings.estimator != EstimatorKind::Is && self.proposal.is_none()
    }

    /// Whether importance sampling answers what crude Monte Carlo would answer at a higher cost.
    pub(super) fn is_refined(&self) -> bool {
        let needs_crude = self.rows.is_some()
            || self.settings.time_limit_s.is_some()
            || self.shards.is_split()
            || self.shards.plan.is_some();
        self.settings.estimator == EstimatorKind::Auto && self.settings.half_width.is_some() && !needs_crude
    }

    pub(super) fn models(&self) -> Result<Vec<ModelId>> {
        self.models.list()
    }

    pub(super) fn headways(&self, density: &DensityModel) -> Result<SampleHeadways> {
        match &self.thw.iter().map(|text| text.trim()).collect::<Vec<_>>()[..] {
            ["sampled" | "observed"] => Ok(SampleHeadways::Sampled),
            [] if density.space.has_thw() => Ok(SampleHeadways::Sampled),
            [] => Ok(SampleHeadways::Each(Headway::paper())),
            _ => Ok(SampleHeadways::Each(lists::headways(&self.thw)?)),
        }
    }

    /// The rule that ends the run.
    pub(super) fn stop(&self, samples: u64) -> StopRule {
        StopRule {
            samples,
            relative_half_width: match self.settings.estimator {
                // The choice is made after a pilot.
                EstimatorKind::Auto if self.is_refined() => None,
                EstimatorKind::Is if self.settings.samples.is_none() => {
                    Some(self.settings.half_width.unwrap_or(Goal::HALF_WIDTH))
                }
                _ => self.settings.half_width,
            },
            time_limit: self.settings.time_limit_s.map(Duration::from_secs_f64),
        }
    }

    /// All options of a run over a density.
    pub(super) fn options(&self, density: &DensityModel) -> Result<SampleOptions> {
        let samples = self.settings.samples.unwrap_or(match self.settings.estimator {
            EstimatorKind::Is if self.proposal.is_none() => MAX_DRAWS,
            _ => DEFAULT_SAMPLES,
        });
        let headways = self.headways(density)?;
        Ok(SampleOptions {
            models: self.models()?,
            criterion: self.settings.criterion,
            seed: self.settings.seed,
            level: self.settings.level,
            stop: self.stop(samples),
            ..SampleOptions::new(self.estimator(density)?, samples, headways)
        })
    }

    /// The search of importance sampling over so many lanes per draw. The lanes of a driver outside the registry are
    /// thousands of times as slow, so that there are fewer: the interval says what they may have missed.
    pub(super) fn search(&self, models: &[ModelId], headways: &SampleHeadways) -> Search {
        let lanes = match headways {
            SampleHeadways::Each(list) => models.len() * list.len(),
            SampleHeadways::Sampled => models.len(),
        };
        let is_bounded = self.settings.assurance == Assurance::Draws;
        let most = if is_bounded { self.settings.crude_lanes } else { SEARCH_CRUDE };
        let crude = most.div_ceil(lanes.max(1) as u64);
        let is_slow = models.iter().any(|model| model.foreign().is_some());
        Search { crude: if is_slow { crude.min(DRIVER_CRUDE) } else { crude }, is_bounded, ..Search::default() }
    }

    fn estimator(&self, density: &DensityModel) -> Result<Estimator> {
        let settings = &self.settings;
        Ok(match settings.estimator {
            EstimatorKind::Auto | EstimatorKind::Mc => Estimator::Crude,
            EstimatorKind::Is => {
                let search = self.search(&self.models()?, &self.headways(density)?);
                let Some(proposal) = &self.proposal else { return Ok(Estimator::Search(search)) };
                let crude = search.crude / settings.samples.unwrap_or(DEFAULT_SAMPLES).max(1);
                Estimator::Given {
                    proposal: Some(read_proposal(proposal, density)?),
                    crude_per_draw: crude.clamp(1, CRUDE_PER_DRAW),
                }
            }
        })
    }

    /// Checks that need no density.
    pub(super) fn check(&self) -> Result<()> {
        let settings = &self.settings;
        let is_crude = self.is_crude();
        let refused = |flag, problem: &str, help: &str| Err(Error::usage(Place::option(flag), problem, help));
        if self.rows.is_some() && !is_crude {
            return Err(only_crude("rows"));
        }
        if settings.estimator == EstimatorKind::Is && settings.time_limit_s.is_some() {
            return Err(only_crude("time_limit"));
        }
        if self.shards.is_split() && is_crude && (settings.half_width.is_some() || settings.time_limit_s.is_some()) {
            let problem = "a part of a run cannot evaluate a stop rule of the whole run";
            return refused("shard", problem, &format!("leave out the stop rules, or {}", option("shard")));
        }
        if self.proposal.is_some() && settings.assurance == Assurance::Search {
            return refused("assurance", "a given proposal is not searched", "leave out one of the two");
        }
        if self.proposal.is_some() && settings.estimator != EstimatorKind::Is {
            let problem = "a given proposal is sampled by importance sampling";
            return refused("proposal", problem, &format!("add {}", option("estimator = is")));
        }
        Ok(())
    }
}

/// Number of samples if none is given.
const DEFAULT_SAMPLES: u64 = 100_000;
/// Maximum number of draws of the density for each draw of a given proposal.
const CRUDE_PER_DRAW: u64 = 10;
/// Maximum number of crude draws of a search with a driver outside the registry.
const DRIVER_CRUDE: u64 = 1 << 15;
/// Maximum number of lanes of the density in a search that is not bounded.
const SEARCH_CRUDE: u64 = 20_000;
/// Maximum number of draws of importance sampling after a search, if none is given.
const MAX_DRAWS: u64 = 10_000_000;

/// The error for a flag that only crude Monte Carlo has.
pub(super) fn only_crude(flag: &'static str) -> Error {
    let problem = "this belongs to crude Monte Carlo";
    Error::usage(Place::option(flag), problem, format!("use {}, or leave it out", option("estimator = mc")))
}

/// Checks a table of lanes: that it replaces no other result, nor another table.
pub(super) fn guard(table: &Path, flag: &'static str, out: &Path, other: Option<&PathBuf>) -> Result<()> {
    let results = ["estimate.json", "estimates.csv", "convergence.csv", "density.json"].map(|name| out.join(name));
    check_lane_table(table, flag, &results.into_iter().chain(other.cloned()).collect::<Vec<_>>())
}
