//! `lanesweep sample`: a density in, probabilities of failure out.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;

use super::backend_flags::{BackendFlags, Opened};
use super::configured::Configured;
use super::console::Verbosity;
use super::format::FormatFlag;
use super::lists;
use super::sample_checks;
use super::sample_crude;
use super::sample_distribution;
use super::sample_lanes;
use super::sample_plan::{PlannedSample, SampleFacts};
use super::sample_weighted;
use super::shard_flags::ShardFlags;
use super::source::PlausibilityFlag;
use super::weighted_plan::{self, PlannedWeighted, WeightedFacts};
use super::{Exit, ProfileFlags};
use crate::cli::settings::SampleSettings;
pub(super) use crate::cli::settings::{
    Estimator as EstimatorFlag, IntervalKind as IntervalFlag, PointKind as PointsFlag,
};
use crate::engine::Headway;
use crate::interop::openscenario::Rename;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::sampling::{EstimateFile, RunFacts};
use crate::run::parts::kind_of;
use crate::run::sampling::{EstimateRow, MapAxes, SampleHeadways, SamplePlanOptions, SampleSource, read_proposal};
use crate::stats::density::{DensityModel, read_density};
use crate::stats::estimate::{Checkpoints, Pilot, StopRule};
use crate::support::run_dir::{ESTIMATE_RECORD, RunFolder};
use crate::{Error, Place, Result};

/// How likely does a driver fail?
///
/// Draws concrete scenarios from a density (see `lanesweep fit`), runs each against the driver models and estimates
/// the probability of failure with its interval: by crude Monte Carlo, importance sampling, cross-entropy or subset
/// simulation. Each estimate says when it should not be trusted. A table goes to stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "density" | "distribution" | "category" | "rename" | "set" | "estimator" | "samples" | "models" | "criterion" | "thw" | "points" | "interval" | "level" | "half_width"
    | "time_limit" | "worst" | "map" | "pilot" | "elite_fraction" | "broad_weight" | "defensive_weight" | "given" | "proposal"
    | "bootstrap" | "bootstrap_samples" | "seed" | "profile" | "dt" => arg.conflicts_with("plan"),
    "rows" => arg.conflicts_with("plan_only"),
    _ => arg,
}))]
#[command(
    after_help = "Examples:\n  lanesweep sample lanesweep-densities/cut-in-2.json --samples 1000000\n  lanesweep \
                        sample cut-in-1.json --estimator subset --models FSM --thw 0.6\n  lanesweep sample \
                        cut-in-1.json --samples 100000000 --shard 0/2 --out big\n  lanesweep sample --distribution \
                        cut-in-stochastic.xosc --category cut-in --rename Ego_Speed_kph=ego_speed_kmh --rename \
                        Other_Speed_kph=other_speed_kmh"
)]
pub struct Sample {
    /// Density file
    #[arg(value_name = "DENSITY", required_unless_present_any = ["plan", "distribution"])]
    density: Option<PathBuf>,
    /// OpenSCENARIO file with stochastic distributions, not a density
    ///
    /// Its numberOfTestRuns and randomSeed are the defaults of --samples and --seed.
    #[arg(long, value_name = "FILE", requires = "category", conflicts_with_all = ["density", "plan", "given", "proposal", "map", "bootstrap", "rows", "shard", "plan_only"])]
    pub(super) distribution: Option<PathBuf>,
    /// With --distribution: kind of scenario: cut-in, cut-out, lvd
    #[arg(long, value_name = "NAME", requires = "distribution")]
    pub(super) category: Option<String>,
    /// With --distribution: parameter of the file that is one of ours, times a factor; repeatable
    #[arg(long, value_name = "THEIRS=OURS[*FACTOR]", requires = "distribution")]
    pub(super) rename: Vec<Rename>,
    /// With --distribution: value that is the same in every sample; repeatable
    #[arg(long, value_name = "NAME=VALUE", requires = "distribution", value_parser = sample_checks::given)]
    pub(super) set: Vec<(String, f64)>,
    /// Crude, importance, cross-entropy, subset
    ///
    /// Crude Monte Carlo, importance sampling, cross-entropy or subset simulation. Importance sampling draws around the worst points of a pilot.
    #[arg(long, value_name = "mc|is|ce|subset", value_enum, hide_possible_values = true, default_value_t)]
    pub(super) estimator: EstimatorFlag,
    /// Samples at most [default: 100000; subset: 2000 per level]
    ///
    /// With ce: of the final sample.
    #[arg(long, value_name = "N")]
    pub(super) samples: Option<u64>,
    #[command(flatten)]
    models: lists::ModelsFlag,
    #[command(flatten)]
    criterion: lists::CriterionFlag,
    /// Time headways [default: the density's, else paper]
    ///
    /// paper is 2.0, 1.8, … 0.2; sampled needs a density fitted with --with-thw. The adaptive estimators take one headway.
    #[arg(long, value_name = "s,s,…|paper|sampled")]
    thw: Option<String>,
    /// Kind of points of mc
    #[arg(long, value_name = "random|sobol", value_enum, hide_possible_values = true, default_value_t)]
    pub(super) points: PointsFlag,
    /// Kind of interval of mc
    #[arg(long, value_name = "wilson|clopper-pearson", value_enum, hide_possible_values = true, default_value_t)]
    pub(super) interval: IntervalFlag,
    /// Level of the intervals
    #[arg(long, value_name = "FRACTION", default_value_t = 0.95)]
    pub(super) level: f64,
    /// End once half-width over estimate is at most this
    ///
    /// The interval is looked at after 4096·2^k samples.
    #[arg(long, alias = "until", value_name = "FRACTION")]
    pub(super) half_width: Option<f64>,
    /// End at the first look after this time: not reproducible
    #[arg(long, value_name = "s")]
    pub(super) time_limit: Option<f64>,
    /// Worst lanes to list per model; 0 runs faster
    #[arg(long, value_name = "N", default_value_t = 20)]
    worst: usize,
    /// Failure map over two parameters, or `none` [default: the first two]
    #[arg(long, value_name = "X,Y|none")]
    pub(super) map: Option<String>,
    /// Also write one row per lane: .csv, .jsonl or .parquet
    #[arg(long, value_name = "FILE")]
    pub(super) rows: Option<PathBuf>,
    /// Runs of the pilot of is
    #[arg(long, hide = true, value_name = "N", default_value_t = 10_000)]
    pub(super) pilot: u64,
    /// Elite fraction: worst points of the pilot that the proposal of is is fitted to
    #[arg(long, alias = "worst-share", hide = true, value_name = "FRACTION", default_value_t = 0.02)]
    pub(super) elite_fraction: f64,
    /// Mixture weight of one broad Gaussian over the worst points in the proposal of is; 0 is the published form
    #[arg(long, alias = "broad", hide = true, value_name = "FRACTION", default_value_t = 0.2)]
    pub(super) broad_weight: f64,
    /// Defensive mixture weight: of the density in the proposals of is and ce; 0 is the published form
    #[arg(long, alias = "defence", hide = true, value_name = "FRACTION", default_value_t = 0.1)]
    pub(super) defensive_weight: f64,
    /// Draw given this value of a parameter (mc); repeatable
    #[arg(long, value_name = "NAME=VALUE", value_parser = sample_checks::given)]
    pub(super) given: Vec<(String, f64)>,
    /// Proposal file to sample, with --estimator is; repeatable
    ///
    /// Several are combined by the balance heuristic.
    #[arg(long, value_name = "FILE")]
    pub(super) proposal: Vec<PathBuf>,
    /// Replicates over resampled scenarios, for the data's share of the uncertainty (mc)
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) bootstrap: u32,
    /// Samples of each replicate
    #[arg(long, hide = true, value_name = "N", default_value_t = 10_000)]
    pub(super) bootstrap_samples: u64,
    /// Seed of the draws [default: 157, or the --distribution's]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Folder for estimate.json, tables and figures
    #[arg(long, value_name = "DIR", default_value = "lanesweep-sample")]
    pub(super) out: PathBuf,
    /// Print lanes, memory and estimated time; write nothing
    #[arg(long, conflicts_with_all = ["shard", "plan_only"])]
    pub(super) dry_run: bool,
    #[command(flatten)]
    pub(super) plausibility: PlausibilityFlag,
    #[command(flatten)]
    pub(super) format: FormatFlag,
    #[command(flatten)]
    pub(super) shards: ShardFlags,
    #[command(flatten)]
    backend: BackendFlags,
    #[command(flatten)]
    profile: ProfileFlags,
}

/// Everything that a run was given, read and checked.
pub(super) struct Run<'a> {
    pub(super) flags: &'a Sample,
    pub(super) density: DensityModel,
    pub(super) profile: Profile,
    pub(super) models: Vec<ModelId>,
    pub(super) criterion: Criterion,
    pub(super) headways: SampleHeadways,
    pub(super) opened: &'a Opened,
    pub(super) started: Instant,
}

impl Sample {
    pub fn run(&self, configured: &Configured, verbosity: Verbosity) -> Result<Exit> {
        let started = Instant::now();
        self.check()?;
        self.shards.start()?;
        if let Some(path) = &self.shards.plan {
            configured.refuse_with_plan()?;
            return self.run_plan(path, started, verbosity);
        }
        if let Some(path) = &self.distribution {
            return sample_distribution::run(self, path, started, verbosity);
        }
        let Some(density) = &self.density else {
            return Err(Error::usage(
                Place::item("DENSITY"),
                "there is none",
                "give a file that `lanesweep fit` wrote",
            ));
        };
        let density = read_density(density)?;
        let profile = self.profile.load()?;
        let models = self.models()?;
        let criterion = self.criterion()?;
        let headways = self.headways(&density)?;
        let opened = self.backend.open()?;
        if let Some(rows) = &self.rows {
            sample_checks::guard(rows, &self.out, self.density.iter().chain(&self.proposal))?;
        }
        let run = Run { flags: self, density, profile, models, criterion, headways, opened: &opened, started };
        tracing::info!("{}", run.density.provenance.data);
        if self.is_crude() {
            let stop = run.stop(self.samples.unwrap_or(100_000));
            return sample_crude::run(self, &run.planned()?, &opened, stop, started, verbosity);
        }
        if self.has_pilot() && !self.dry_run && self.half_width.is_none() && self.time_limit.is_none() {
            // The pilot is kept in the folder, so it needs the folder's lock too.
            let folder = RunFolder::open(&self.out, ESTIMATE_RECORD)?;
            let planned = run.planned_after_pilot()?;
            drop(folder);
            return sample_weighted::run(self, &planned, &opened, started, verbosity);
        }
        if self.is_weighted() && self.half_width.is_none() && self.time_limit.is_none() {
            return sample_weighted::run(self, &run.planned_weighted()?, &opened, started, verbosity);
        }
        if self.dry_run {
            return run.forecast_adaptive();
        }
        let folder = RunFolder::open(&self.out, ESTIMATE_RECORD)?;
        let mut results = folder.results()?;
        let mut file = run.adaptive(&mut results)?;
        if !self.proposal.is_empty() {
            // Those that were given may be of this folder.
            results.keep(|name| name.starts_with("proposal-"));
        }
        sample_lanes::write_estimates(results, &run.density, &mut file, Vec::new())?;
        self.format.print(|| file.text(), || file.json())?;
        tracing::info!("results written to {}", self.out.display());
        Ok(Exit::Ok)
    }

    /// Runs what a plan file says: of crude Monte Carlo or over a given proposal.
    fn run_plan(&self, path: &PathBuf, started: Instant, verbosity: Verbosity) -> Result<Exit> {
        if kind_of(path)? == weighted_plan::KIND {
            if self.rows.is_some() {
                return Err(sample_checks::only_crude("--rows"));
            }
            let (planned, _) = PlannedWeighted::read(path)?;
            return sample_weighted::run(self, &planned, &self.backend.open()?, started, verbosity);
        }
        let (planned, _) = PlannedSample::read(path)?;
        let stop = StopRule::samples(planned.facts.samples);
        if let Some(rows) = &self.rows {
            sample_checks::guard(rows, &self.out, std::iter::once(path))?;
        }
        sample_crude::run(self, &planned, &self.backend.open()?, stop, started, verbosity)
    }

    /// The seed of the draws.
    pub(super) fn seed(&self) -> u64 {
        self.seed.unwrap_or(SampleSettings::default().seed)
    }

    /// The seed as it was typed.
    pub(super) fn given_seed(&self) -> Option<u64> {
        self.seed
    }

    pub(super) fn open(&self) -> Result<Opened> {
        self.backend.open()
    }

    pub(super) fn load_profile(&self) -> Result<Profile> {
        self.profile.load()
    }

    /// The headways of `--thw` where nothing draws them.
    pub(super) fn listed_headways(&self) -> Result<Option<Vec<Headway>>> {
        match self.thw.as_deref().map(str::trim) {
            None => Ok(None),
            Some("paper") => Ok(Some(Headway::paper())),
            Some(list) => lists::headways(list, "`paper`").map(Some),
        }
    }

    pub(super) fn worst(&self) -> usize {
        self.worst
    }

    pub(super) fn is_crude(&self) -> bool {
        self.estimator == EstimatorFlag::Mc && self.proposal.is_empty()
    }

    /// Importance sampling of one given proposal: its samples are independent, so the run can be split and continued.
    pub(super) fn is_weighted(&self) -> bool {
        self.estimator == EstimatorFlag::Is && self.proposal.len() == 1
    }

    /// Importance sampling of what a pilot finds.
    fn has_pilot(&self) -> bool {
        self.estimator == EstimatorFlag::Is && self.proposal.is_empty()
    }

    pub(super) fn models(&self) -> Result<Vec<ModelId>> {
        self.models.list()
    }

    pub(super) fn criterion(&self) -> Result<Criterion> {
        self.criterion.get()
    }

    fn headways(&self, density: &DensityModel) -> Result<SampleHeadways> {
        match self.thw.as_deref().map(str::trim) {
            Some("sampled") => Ok(SampleHeadways::Sampled),
            None if density.space.has_thw() => Ok(SampleHeadways::Sampled),
            None | Some("paper") => Ok(SampleHeadways::Each(Headway::paper())),
            Some(list) => Ok(SampleHeadways::Each(lists::headways(list, "`paper`, or `sampled`")?)),
        }
    }
}

impl Run<'_> {
    pub(super) fn stop(&self, samples: u64) -> StopRule {
        StopRule {
            samples,
            relative_half_width: self.flags.half_width,
            time_limit: self.flags.time_limit.map(Duration::from_secs_f64),
            checkpoints: Checkpoints::Doubling,
        }
    }

    /// The parts of `estimate.json` that all estimators share.
    pub(super) fn file(&self, samples: u64, estimates: Vec<EstimateRow>) -> Result<EstimateFile> {
        let facts = RunFacts {
            estimator: self.flags.estimator.key(),
            profile: self.profile.clone(),
            models: self.models.clone(),
            headways: match &self.headways {
                SampleHeadways::Each(list) => list.clone(),
                SampleHeadways::Sampled => Vec::new(),
            },
            points: if self.flags.points == PointsFlag::Sobol { "sobol" } else { "random" },
            samples,
            seed: self.flags.seed(),
            given: self.flags.given.clone(),
        };
        EstimateFile::new(&self.density, facts, estimates, self.opened.host(0, self.started))
    }

    /// Crude Monte Carlo as these flags ask for it.
    fn planned(self) -> Result<PlannedSample> {
        let flags = self.flags;
        let options = SamplePlanOptions {
            samples: flags.samples.unwrap_or(100_000),
            seed: flags.seed(),
            source: match flags.points {
                PointsFlag::Random => SampleSource::Random,
                PointsFlag::Sobol => SampleSource::Sobol,
            },
            models: self.models.clone(),
            headways: self.headways.clone(),
        };
        let facts = SampleFacts {
            criterion: self.criterion,
            worst: flags.worst,
            map: self.map()?,
            clopper_pearson: flags.interval == IntervalFlag::ClopperPearson,
            level: flags.level,
            ..SampleFacts::new(&options, &self.profile, &flags.given)
        };
        PlannedSample::new(self.density, facts)
    }

    /// Importance sampling of one given proposal, a fixed number of samples.
    fn planned_weighted(self) -> Result<PlannedWeighted> {
        let proposal = read_proposal(&self.flags.proposal[0], &self.density)?;
        let facts = self.weighted_facts(None)?;
        PlannedWeighted::new(self.density, vec![proposal], facts)
    }

    /// Importance sampling of what a pilot finds for each driver model, a fixed number of samples.
    fn planned_after_pilot(self) -> Result<PlannedWeighted> {
        let flags = self.flags;
        let pilot = Pilot {
            worst: flags.elite_fraction,
            broad: flags.broad_weight,
            defence: flags.defensive_weight,
            ..Pilot::guarded(flags.pilot)
        };
        let facts = self.weighted_facts(Some(pilot))?;
        let density = self.density.clone();
        PlannedWeighted::after_pilot(density, facts, &flags.out, || self.pilots(&pilot))
    }

    /// What both have in common; the proposals are added to it.
    fn weighted_facts(&self, pilot: Option<Pilot>) -> Result<WeightedFacts> {
        let flags = self.flags;
        let headway = match &self.headways {
            SampleHeadways::Sampled => None,
            SampleHeadways::Each(list) => Some(one_headway(list, flags.estimator)?),
        };
        Ok(WeightedFacts {
            density: String::new(),
            proposals: Vec::new(),
            pilot,
            pilots: Vec::new(),
            defence: flags.defensive_weight,
            profile: self.profile.clone(),
            models: self.models.clone(),
            headway,
            criterion: self.criterion,
            samples: flags.samples.unwrap_or(100_000),
            seed: flags.seed(),
            level: flags.level,
        })
    }

    fn map(&self) -> Result<Option<MapAxes>> {
        let parameters = self.density.space.parameters();
        match self.flags.map.as_deref() {
            Some("none") => Ok(None),
            None if parameters.len() < 2 => Ok(None),
            None => MapAxes::of(&self.density, &parameters[0].name, &parameters[1].name).map(Some),
            Some(text) => {
                let (x, y) = text.split_once(',').ok_or_else(|| {
                    let problem = format!("`{text}` names no two parameters");
                    Error::usage(Place::item("--map"), problem, "give two, separated by a comma, or `none`")
                })?;
                MapAxes::of(&self.density, x.trim(), y.trim()).map(Some)
            }
        }
    }
}

/// The estimators that weigh follow one headway.
pub(super) fn one_headway(list: &[Headway], estimator: EstimatorFlag) -> Result<Headway> {
    let [one] = list else {
        return Err(Error::usage(
            Place::item("--thw"),
            format!("--estimator {} follows one headway at a time", estimator.key()),
            "give one, such as --thw 0.6, or a density fitted with --with-thw",
        ));
    };
    Ok(*one)
}
