//! `lanesweep sample`: a density in, probabilities of failure out.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};

use super::backend_flags::{BackendFlags, Opened};
use super::console::{self, Verbosity};
use super::lists;
use super::sample_join as join;
use super::sample_lanes;
use super::{Exit, ProfileFlags};
use crate::criterion::Criterion;
use crate::density::{BandwidthRule, DensityModel, Kde, Mixture, read_density, write_density};
use crate::driver::ModelId;
use crate::estimate::{
    BinomialInterval, Checkpoints, CrossEntropy, Defended, Density, Estimate, Importance, Pilot, StopRule, Subset,
    Technique, balance_heuristic, cross_entropy, defended, from_pilot_with_proposal, importance, subset,
};
use crate::profile::Profile;
use crate::report::files::make_folder;
use crate::report::sampling::{EstimateFile, HostRecord, Levels, RunFacts};
use crate::sampling::{
    EstimateRow, LaneLimitState, Lanes, MapAxes, Risk, SampleHeadways, SamplePlanOptions, SampleSource, TallyOptions,
    bootstrap, plan_points, plan_samples, read_proposal, truncated, write_proposal,
};
use crate::sweep::{Headway, ONE_IN, Recheck};
use crate::{Error, Place, Result};

/// How likely does a driver fail?
///
/// Draws concrete scenarios from a density (see `lanesweep fit`), runs each against the driver models and estimates
/// the probability of failure with its interval: by crude Monte Carlo, importance sampling, cross-entropy or subset
/// simulation. Each estimate says when it should not be trusted. A table goes to stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(
    after_help = "Examples:\n  lanesweep sample lanesweep-densities/cut-in-2.json --samples 1000000\n  lanesweep \
                        sample cut-in-1.json --estimator subset --models FSM --thw 0.6\n  lanesweep sample \
                        cut-in-1.json --samples 100000000 --lanes 0..50000000 --out part-1"
)]
pub struct Sample {
    /// Density file
    #[arg(value_name = "DENSITY", required_unless_present = "join")]
    density: Option<PathBuf>,
    /// Join the parts of a run, made with --lanes, instead of sampling: their folders. The result is that of the whole
    /// run, without its convergence
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with_all = [
        "density", "estimator", "samples", "models", "criterion", "thw", "points", "until", "time_limit", "worst", "map",
        "rows", "lanes", "pilot", "worst_share", "broad", "defence", "proposal", "bootstrap", "bootstrap_samples", "seed",
    ])]
    join: Vec<PathBuf>,
    /// mc (crude), is (importance sampling around the worst of a pilot), ce (cross-entropy), subset
    #[arg(long, value_enum, default_value_t)]
    estimator: EstimatorFlag,
    /// Samples at most; of ce: of the final sample; of subset: per level [default: 100000; subset: 2000]
    #[arg(long, value_name = "N")]
    samples: Option<u64>,
    /// Driver models, separated by commas [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    models: Vec<String>,
    /// Criterion of the adaptive estimators, of the worst lanes, the map and the stop rule
    #[arg(long, value_name = "collision|ttc|btn", default_value = "collision")]
    criterion: String,
    /// Time headways in seconds, separated by commas; `paper` (2.0, 1.8, … 0.2) or `sampled` (a density fitted with
    /// --with-thw) [default: sampled where the density has it, else paper; the adaptive estimators take one]
    #[arg(long, value_name = "LIST|paper|sampled")]
    thw: Option<String>,
    /// Kind of points of mc
    #[arg(long, value_enum, default_value_t)]
    points: PointsFlag,
    /// Kind of interval of mc
    #[arg(long, value_enum, default_value_t)]
    interval: IntervalFlag,
    /// Level of the intervals
    #[arg(long, value_name = "SHARE", default_value_t = 0.95)]
    level: f64,
    /// End once the interval's half-width over the estimate is at most this; looked at after 4096·2^k samples
    #[arg(long, value_name = "SHARE")]
    until: Option<f64>,
    /// End at the first look after so many seconds: not reproducible
    #[arg(long, value_name = "SECONDS")]
    time_limit: Option<f64>,
    /// Worst lanes to list per model; 0 runs faster
    #[arg(long, value_name = "N", default_value_t = 20)]
    worst: usize,
    /// Failure map over two parameters, or `none` [default: the first two]
    #[arg(long, value_name = "X,Y|none")]
    map: Option<String>,
    /// Also write one row per lane
    #[arg(long, value_name = "FILE")]
    rows: Option<PathBuf>,
    /// Only these samples of the run: a part that joins with others
    #[arg(long, value_name = "A..B")]
    lanes: Option<String>,
    /// Runs of the pilot of is
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    pilot: u64,
    /// Share of the pilot's worst points that the proposal of is is fitted to
    #[arg(long, value_name = "SHARE", default_value_t = 0.02)]
    worst_share: f64,
    /// Share of one broad Gaussian over the worst points in the proposal of is; 0 is the published form
    #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
    broad: f64,
    /// Share of the density in the proposals of is and ce; 0 is the published form
    #[arg(long, value_name = "SHARE", default_value_t = 0.1)]
    defence: f64,
    /// Proposal file to sample instead of looking for one; several are combined by the balance heuristic
    #[arg(long, value_name = "FILE")]
    proposal: Vec<PathBuf>,
    /// Replicates over resampled scenarios, for the data's share of the uncertainty (mc)
    #[arg(long, value_name = "N", default_value_t = 0)]
    bootstrap: u32,
    /// Samples of each replicate
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    bootstrap_samples: u64,
    /// Seed of the draws
    #[arg(long, value_name = "N", default_value_t = 157)]
    seed: u64,
    /// Folder for estimate.json, tables and figures
    #[arg(long, value_name = "DIR", default_value = "lanesweep-sample")]
    out: PathBuf,
    #[command(flatten)]
    backend: BackendFlags,
    #[command(flatten)]
    profile: ProfileFlags,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum EstimatorFlag {
    #[default]
    Mc,
    Is,
    Ce,
    Subset,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum PointsFlag {
    /// Independent draws
    #[default]
    Random,
    /// Owen-scrambled Sobol points
    Sobol,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum IntervalFlag {
    #[default]
    Wilson,
    ClopperPearson,
}

impl EstimatorFlag {
    fn key(self) -> &'static str {
        match self {
            EstimatorFlag::Mc => "mc",
            EstimatorFlag::Is => "is",
            EstimatorFlag::Ce => "ce",
            EstimatorFlag::Subset => "subset",
        }
    }
}

/// Points that an adaptive estimator holds at once, at most.
const MOST_HELD: u64 = 10_000_000;
/// Draws that the valid share of each of several proposals is counted on.
const VALIDITY_DRAWS: u64 = 1_000_000;

/// Everything that a run was given, read and checked.
struct Run<'a> {
    flags: &'a Sample,
    density: DensityModel,
    profile: Profile,
    models: Vec<ModelId>,
    criterion: Criterion,
    headways: SampleHeadways,
    opened: Opened,
    verbosity: Verbosity,
    started: Instant,
}

impl Sample {
    pub fn run(&self, verbosity: Verbosity) -> Result<Exit> {
        self.check()?;
        let Some(density) = &self.density else {
            return join::run(&self.join, &self.out, self.binomial(), self.level);
        };
        let density = read_density(density)?;
        let profile = self.profile.load()?;
        let models = self.models()?;
        let criterion = self.criterion()?;
        let headways = self.headways(&density)?;
        let opened = self.backend.open()?;
        let run = Run {
            flags: self,
            density,
            profile,
            models,
            criterion,
            headways,
            opened,
            verbosity,
            started: Instant::now(),
        };
        if let Some(rows) = &self.rows {
            guard(rows, &self.out, self.density.iter().chain(&self.proposal))?;
        }
        make_folder(&self.out)?;
        sample_lanes::check_writable(&self.out)?;
        tracing::info!("{}", run.density.provenance.data);
        let file = match self.estimator {
            EstimatorFlag::Mc if self.proposal.is_empty() => run.crude()?,
            _ => {
                // A proposal in this folder may be an input: it is read and written on the way.
                let file = run.adaptive()?;
                sample_lanes::clear(&self.out, &["proposal-"])?;
                file
            }
        };
        let folder = |name: &str| self.out.join(name);
        write_density(&folder("density.json"), &run.density)?;
        crate::report::files::write_atomically(&folder("estimates.csv"), &file.csv()?)?;
        crate::report::files::write_atomically(&folder("estimate.json"), &file.to_json()?)?;
        console::print(&file.text())?;
        tracing::info!("results written to {}", self.out.display());
        Ok(Exit::Ok)
    }

    /// What no density is needed for.
    fn check(&self) -> Result<()> {
        let share = |name: &str, value: f64, from_zero: bool| {
            let fits = value < 1.0 && (value > 0.0 || (from_zero && value == 0.0));
            if fits {
                return Ok(());
            }
            let range = if from_zero { "from 0 to below 1" } else { "between 0 and 1" };
            Err(Error::usage(Place::item(name), format!("{value} is no share"), format!("give a number {range}")))
        };
        share("--level", self.level, false)?;
        share("--worst-share", self.worst_share, false)?;
        share("--defence", self.defence, true)?;
        share("--broad", self.broad, true)?;
        if self.until.is_some_and(|u| !(u > 0.0 && u.is_finite())) {
            return Err(Error::usage(Place::item("--until"), "no half-width", "give a number above 0, such as 0.05"));
        }
        if self.time_limit.is_some_and(|t| !(t > 0.0 && t < 1e9)) {
            return Err(Error::usage(Place::item("--time-limit"), "no time", "give seconds above 0"));
        }
        if self.samples == Some(0) {
            let help = "give 1000000, for instance";
            return Err(Error::usage(Place::item("--samples"), "0 samples estimate nothing", help));
        }
        if self.samples.is_some_and(|n| n >= 1 << 63) {
            let problem = "2^63 samples and more cannot be counted";
            return Err(Error::usage(Place::item("--samples"), problem, "give fewer"));
        }
        let is_crude = self.estimator == EstimatorFlag::Mc && self.proposal.is_empty();
        let only_crude = [
            ("--rows", self.rows.is_some()),
            ("--map", self.map.is_some()),
            ("--bootstrap", self.bootstrap > 0),
            ("--points sobol", self.points == PointsFlag::Sobol),
        ];
        if let Some((flag, _)) = only_crude.iter().find(|(_, given)| *given && !is_crude) {
            let problem = "this belongs to crude Monte Carlo";
            return Err(Error::usage(Place::item(*flag), problem, "use --estimator mc, or leave it out"));
        }
        let least = |flag: &str, value: u64, least: u64, most: u64| {
            if (least..=most).contains(&value) {
                return Ok(());
            }
            let help = format!("give at least {least} and at most {most}");
            Err(Error::usage(Place::item(flag), format!("{value} does not do"), help))
        };
        match self.estimator {
            EstimatorFlag::Is if self.proposal.is_empty() => least("--pilot", self.pilot, 500, MOST_HELD)?,
            EstimatorFlag::Subset => least("--samples", self.samples.unwrap_or(2000), 100, MOST_HELD)?,
            EstimatorFlag::Ce => least("--samples", self.samples.unwrap_or(100_000), 100, 10 * MOST_HELD)?,
            _ => (),
        }
        if self.bootstrap > 0 {
            least("--bootstrap", self.bootstrap.into(), 20, 1 << 20)?;
            least("--bootstrap-samples", self.bootstrap_samples, 100, 1 << 40)?;
            if self.lanes.is_some() {
                let problem = "a part of a run has no replicates of its own";
                return Err(Error::usage(Place::item("--bootstrap"), problem, "leave --bootstrap or --lanes out"));
            }
        }
        if self.lanes.is_some() && !is_crude {
            let problem = "only crude Monte Carlo can be split: the adaptive estimators are sequential";
            return Err(Error::usage(Place::item("--lanes"), problem, "use --estimator mc, or leave --lanes out"));
        }
        if !self.proposal.is_empty() && self.estimator != EstimatorFlag::Is {
            return Err(Error::usage(
                Place::item("--proposal"),
                "a given proposal is sampled by importance sampling",
                "add --estimator is",
            ));
        }
        Ok(())
    }

    fn binomial(&self) -> BinomialInterval {
        match self.interval {
            IntervalFlag::Wilson => BinomialInterval::Wilson,
            IntervalFlag::ClopperPearson => BinomialInterval::ClopperPearson,
        }
    }

    fn models(&self) -> Result<Vec<ModelId>> {
        lists::models(&self.models)
    }

    fn criterion(&self) -> Result<Criterion> {
        Criterion::ALL.into_iter().find(|c| c.key().eq_ignore_ascii_case(self.criterion.trim())).ok_or_else(|| {
            let problem = format!("there is no criterion `{}`", self.criterion);
            Error::usage(Place::item("--criterion"), problem, "use collision, ttc or btn")
        })
    }

    fn headways(&self, density: &DensityModel) -> Result<SampleHeadways> {
        match self.thw.as_deref().map(str::trim) {
            Some("sampled") => Ok(SampleHeadways::Sampled),
            None if density.space.has_thw() => Ok(SampleHeadways::Sampled),
            None | Some("paper") => Ok(SampleHeadways::Each(Headway::paper())),
            Some(list) => Ok(SampleHeadways::Each(lists::headways(list, "`paper`, or `sampled`")?)),
        }
    }

    /// The samples of a part.
    fn range(&self, samples: u64) -> Result<Range<u64>> {
        let Some(text) = &self.lanes else { return Ok(0..samples) };
        let wrong = || {
            let problem = format!("`{text}` is no interval of the run's {samples} samples");
            Error::usage(Place::item("--lanes"), problem, "give A..B with A < B, counted from 0, B at most --samples")
        };
        let (from, to) = text.split_once("..").ok_or_else(wrong)?;
        let number = |part: &str| part.trim().replace('_', "").parse::<u64>().map_err(|_| wrong());
        let range = number(from)?..number(to)?;
        if range.start < range.end && range.end <= samples { Ok(range) } else { Err(wrong()) }
    }
}

impl Run<'_> {
    fn stop(&self, samples: u64) -> StopRule {
        StopRule {
            samples,
            relative_half_width: self.flags.until,
            time_limit: self.flags.time_limit.map(Duration::from_secs_f64),
            checkpoints: Checkpoints::Doubling,
        }
    }

    fn host(&self, rechecked_lanes: u64) -> HostRecord {
        HostRecord {
            backend: self.opened.backend().describe(),
            device: self.opened.device(),
            rechecked_lanes,
            seconds: self.started.elapsed().as_secs_f64(),
            threads: rayon::current_num_threads(),
        }
    }

    /// The parts of `estimate.json` that all estimators share.
    fn file(&self, samples: u64, estimates: Vec<EstimateRow>) -> Result<EstimateFile> {
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
            seed: self.flags.seed,
        };
        EstimateFile::new(&self.density, facts, estimates, self.host(0))
    }

    fn crude(&self) -> Result<EstimateFile> {
        let flags = self.flags;
        let samples = flags.samples.unwrap_or(100_000);
        let source = match flags.points {
            PointsFlag::Random => SampleSource::Random,
            PointsFlag::Sobol => SampleSource::Sobol,
        };
        if source == SampleSource::Sobol {
            tracing::warn!("Sobol points: the intervals are those of independent draws, and wider than need be");
        }
        let options = SamplePlanOptions {
            samples,
            seed: flags.seed,
            source,
            models: self.models.clone(),
            headways: self.headways.clone(),
        };
        let range = flags.range(samples)?;
        let plan = plan_samples(&self.density, &self.density.mixture()?, &self.profile, &options)?;
        let recheck = self.opened.device().map(|_| Recheck::new(&plan, flags.seed, ONE_IN));
        let lanes =
            Lanes { backend: self.opened.backend(), fallback: self.opened.fallback(), recheck: recheck.as_ref() };
        let counting = TallyOptions { worst: flags.worst, criterion: self.criterion, map: self.map()? };
        let crude = crate::sampling::CrudeOptions {
            stop: self.stop(samples),
            interval: flags.binomial(),
            level: flags.level,
            exposure: self.density.exposure.as_ref(),
            is_sampled_headway: self.density.space.has_thw(),
        };
        tracing::info!("{} samples on {}", range.end - range.start, lanes.backend.describe());
        let crude_run =
            sample_lanes::run(&plan, range, &lanes, &counting, &crude, flags.rows.as_deref(), self.verbosity)?;
        sample_lanes::write(&flags.out, &plan, &self.density, &crude_run, &counting, flags.lanes.is_some())?;
        let mut file = self.file(samples, crude_run.rows)?;
        file.plan_sha256 = Some(plan.hash().to_owned());
        file.draws = Some(crate::report::sampling::DrawRecord::of(&crude_run.tally, &plan));
        if flags.bootstrap > 0 {
            let bar = console::progress(self.verbosity, flags.bootstrap.into(), "resampling");
            let record = bootstrap(
                &self.density,
                &self.profile,
                &options,
                &lanes,
                flags.bootstrap,
                flags.bootstrap_samples,
                || bar.inc(1),
            )?;
            bar.finish_and_clear();
            file.bootstrap = Some(record);
        }
        file.host = self.host(crude_run.summary.rechecked_lanes);
        Ok(file)
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

    /// One model after the other, at one headway.
    fn adaptive(&self) -> Result<EstimateFile> {
        let headway = match &self.headways {
            SampleHeadways::Sampled => "sampled".to_owned(),
            SampleHeadways::Each(list) if list.len() == 1 => list[0].to_string(),
            SampleHeadways::Each(_) => {
                return Err(Error::usage(
                    Place::item("--thw"),
                    format!("--estimator {} follows one headway at a time", self.flags.estimator.key()),
                    "give one, such as --thw 0.6, or a density fitted with --with-thw",
                ));
            }
        };
        // The same complaint for every model: make it before any work.
        let first = self.density.kde.points()[0].clone();
        plan_points(&self.density, &[first], &self.profile, &self.models, &self.headways)?;
        let nominal = truncated(&self.density)?;
        let samples = self.flags.samples.unwrap_or(match self.flags.estimator {
            EstimatorFlag::Subset => 2000,
            _ => 100_000,
        });
        let (mut rows, mut levels) = (Vec::new(), Vec::new());
        for &model in &self.models {
            tracing::info!("{} on {}", model.name(), self.opened.backend().describe());
            let (estimate, level) = self.estimate(&nominal, model, samples)?;
            let risk = Risk::of(&estimate, self.density.exposure.as_ref());
            rows.push(EstimateRow { model, criterion: self.criterion, headway: headway.clone(), estimate, risk });
            levels.extend(level);
        }
        let mut file = self.file(samples, rows)?;
        file.levels = levels;
        Ok(file)
    }

    fn estimate(&self, nominal: &dyn Density, model: ModelId, samples: u64) -> Result<(Estimate, Option<Levels>)> {
        let flags = self.flags;
        let lanes = LaneLimitState {
            density: &self.density,
            profile: &self.profile,
            model,
            criterion: self.criterion,
            headway: self.headways.clone(),
            backend: self.opened.backend(),
            fallback: self.opened.fallback(),
        };
        let importance_options =
            Importance { level: flags.level, stop: self.stop(samples), ..Importance::new(flags.seed, samples) };
        let proposal_file = flags.out.join(format!("proposal-{}.json", model.name()));
        match flags.estimator {
            EstimatorFlag::Subset => {
                let options = Subset { level: flags.level, ..Subset::new(flags.seed, samples) };
                let run = subset(nominal, &lanes, &options)?;
                Ok((run.estimate, Some(Levels::Subset(run.levels))))
            }
            EstimatorFlag::Ce => {
                let options = CrossEntropy {
                    level: flags.level,
                    defence: flags.defence,
                    stop: self.stop(samples),
                    ..CrossEntropy::new(flags.seed, (samples / 10).max(2000), samples)
                };
                let run = cross_entropy(nominal, &lanes, &options)?;
                write_proposal(&proposal_file, &self.density, &run.proposal)?;
                Ok((run.estimate, Some(Levels::CrossEntropy(run.steps))))
            }
            EstimatorFlag::Mc | EstimatorFlag::Is if flags.proposal.is_empty() => {
                let names: Vec<&str> = self.density.space.parameters().iter().map(|p| p.name.as_str()).collect();
                let fit = |points: &[Vec<f64>]| Kde::fit(points.to_vec(), &names, BandwidthRule::Reduction)?.mixture();
                let (estimate, proposal) = from_pilot_with_proposal(
                    nominal,
                    &lanes,
                    &fit,
                    &Pilot {
                        worst: flags.worst_share,
                        broad: flags.broad,
                        defence: flags.defence,
                        ..Pilot::guarded(flags.pilot)
                    },
                    &importance_options,
                )?;
                write_proposal(&proposal_file, &self.density, &proposal)?;
                Ok((estimate, None))
            }
            EstimatorFlag::Mc | EstimatorFlag::Is => {
                let read = |path: &PathBuf| read_proposal(path, &self.density);
                let mixtures: Vec<Mixture> = flags.proposal.iter().map(read).collect::<Result<_>>()?;
                let is_one = mixtures.len() == 1;
                let prepared = |mixture| {
                    let proposal = defended(mixture, nominal, flags.defence)?;
                    // One proposal's valid share comes out of its own draws.
                    Ok(if is_one { proposal } else { proposal.with_counted_validity(flags.seed, VALIDITY_DRAWS) })
                };
                let proposals: Vec<Defended> = mixtures.into_iter().map(prepared).collect::<Result<_>>()?;
                let estimate = match &proposals[..] {
                    [one] => importance(nominal, one, &lanes, &importance_options)?,
                    several => {
                        let draws = samples / several.len() as u64;
                        let techniques: Vec<Technique> =
                            several.iter().map(|proposal| Technique { proposal, draws }).collect();
                        balance_heuristic(nominal, &techniques, &lanes, flags.seed, flags.level)?
                    }
                };
                Ok((estimate, None))
            }
        }
    }
}

/// The rows must replace neither an input nor another result.
fn guard<'a>(rows: &Path, out: &Path, inputs: impl Iterator<Item = &'a PathBuf>) -> Result<()> {
    let results = ["estimate.json", "estimates.csv", "worst.csv", "convergence.csv", "density.json", "part.json"];
    let others: Vec<PathBuf> = results.iter().map(|name| out.join(name)).chain(inputs.cloned()).collect();
    super::source::refuse_overwriting(rows, &others, "--rows")
}
