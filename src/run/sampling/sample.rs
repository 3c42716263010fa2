//! A sampling run: planned from a density or read from a plan file.

use std::path::Path;

use super::crude_plan::{self, CrudeFacts, CrudePlan};
use super::plan::SamplePlanOptions;
use super::sample_options::{Estimator, SampleOptions, one_headway};
use super::sequential::Sequential;
use super::weighted_plan::{self, WeightedFacts, WeightedPlan};
use crate::engine::{Executor, LanePlan};
use crate::model::profile::Profile;
use crate::run::parts::{kind_of, leave_plan};
use crate::stats::density::DensityModel;
use crate::stats::estimate::{BinomialInterval, Pilot, StopRule};
use crate::{Error, Place, Result};

/// A sampling run ready to be run: whole, or one shard of it where its samples are independent.
///
/// As two shards in a folder; together they give the estimates of the run in one piece:
///
/// ```
/// use lanesweep::engine::{CpuBackend, Executor, Headway};
/// use lanesweep::model::profile::Profile;
/// use lanesweep::run::parts::Shard;
/// use lanesweep::run::sampling::{Estimator, Sample, SampleHeadways, SampleOptions};
/// # use lanesweep::scenario::Category;
/// # use lanesweep::scenario::parameterization::Parameterization;
/// # use lanesweep::stats::density::{DensityModel, FitOptions};
/// # use lanesweep::traffic::DataProvenance;
/// # use lanesweep::traffic::mining::{MiningOptions, mine_generated};
/// # use lanesweep::traffic::trajectory::generator::GeneratorOptions;
///
/// # fn main() -> lanesweep::Result<()> {
/// # let recordings = GeneratorOptions { recordings: 2, ..GeneratorOptions::default() };
/// # let scenarios = mine_generated(&recordings, &MiningOptions::default(), || ())?.scenarios;
/// # let facts = DataProvenance { data: "synthetic".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
/// # let options = FitOptions { representativeness: false, valid_draws: 100, ..FitOptions::default() };
/// # let id = Parameterization::find(Category::CutIn, "2").unwrap();
/// # let density = DensityModel::fit(id, &scenarios, &facts, &options)?.model;
/// # let folder = tempfile::tempdir().unwrap();
/// # let folder = folder.path();
/// let headways = SampleHeadways::Each(vec![Headway::ThwS(0.6)]);
/// let options = SampleOptions::new(Estimator::CRUDE, 10_000, headways);
/// let sample = Sample::plan(density, &Profile::load("paper")?, &options)?;
/// let backend = CpuBackend::lane_arithmetic();
/// let executor = Executor::new(&backend);
/// let whole = sample.run(&executor)?;
/// for row in &whole.rows {
///     assert!(row.estimate.interval.low <= row.estimate.probability);
/// }
/// for index in 0..2 {
///     sample.run_shard(folder, Shard { index, of: 2 }, &executor)?;
/// }
/// let (_, merged) = Sample::merge(folder)?;
/// assert_eq!(merged.rows, whole.rows);
/// # Ok(())
/// # }
/// ```
pub struct Sample(pub(crate) SampleKind);

/// By how it is run.
pub(crate) enum SampleKind {
    /// Crude Monte Carlo.
    Crude(Box<CrudePlan>, StopRule),
    /// Importance sampling of a fixed number of samples.
    Weighted(Box<WeightedPlan>),
    /// The same, whose proposals are to be found.
    Pilot(Box<WeightedPlan>, Pilot),
    /// Adaptive, of several proposals, or with a stop rule.
    Sequential(Box<Sequential>),
}

impl Sample {
    /// Plans a run.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that contradict one another or the density.
    pub fn plan(density: DensityModel, profile: &Profile, options: &SampleOptions) -> Result<Sample> {
        let is_fixed = options.stop.relative_half_width.is_none() && options.stop.time_limit.is_none();
        let weighted = |density, proposals, defence, pilot| {
            let facts = WeightedFacts {
                density: String::new(),
                proposals: Vec::new(),
                pilot,
                pilots: Vec::new(),
                defence,
                profile: profile.clone(),
                models: options.models.clone(),
                headway: one_headway(options)?,
                criterion: options.criterion,
                samples: options.stop.samples,
                seed: options.seed,
                level: options.level,
            };
            WeightedPlan::new(density, proposals, facts).map(Box::new)
        };
        Ok(Sample(match &options.estimator {
            Estimator::Crude { points, interval } => {
                let plan_options = SamplePlanOptions {
                    samples: options.stop.samples,
                    seed: options.seed,
                    source: *points,
                    models: options.models.clone(),
                    headways: options.headways.clone(),
                };
                let facts = CrudeFacts {
                    criterion: options.criterion,
                    worst: options.worst,
                    map: options.map.clone(),
                    clopper_pearson: *interval == BinomialInterval::ClopperPearson,
                    level: options.level,
                    ..CrudeFacts::new(&plan_options, profile, &options.given)
                };
                SampleKind::Crude(Box::new(CrudePlan::new(density, facts)?), options.stop)
            }
            Estimator::Pilot(pilot) if is_fixed => {
                SampleKind::Pilot(weighted(density, Vec::new(), pilot.defence, Some(*pilot))?, *pilot)
            }
            Estimator::Given { proposals, defence } if is_fixed && proposals.len() == 1 => {
                SampleKind::Weighted(weighted(density, proposals.clone(), *defence, None)?)
            }
            _ => SampleKind::Sequential(Box::new(Sequential::new(density, profile, options)?)),
        }))
    }

    /// Reads a plan file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for anything but a whole plan of this version.
    pub fn read(path: &Path) -> Result<Sample> {
        if kind_of(path)? == weighted_plan::KIND {
            return Ok(Sample(SampleKind::Weighted(Box::new(WeightedPlan::read(path)?.0))));
        }
        let plan = CrudePlan::read(path)?.0;
        let stop = StopRule::samples(plan.facts.samples);
        Ok(Sample(SampleKind::Crude(Box::new(plan), stop)))
    }

    /// Whether a sealed file of this kind is the plan of a sampling run.
    pub fn is_kind(kind: &str) -> bool {
        kind == crude_plan::KIND || kind == weighted_plan::KIND
    }

    /// Finds the proposals where a pilot has to; they are kept in the folder, so that an interrupted run need not
    /// search again.
    ///
    /// # Errors
    /// Of the lanes; [`Error::Io`].
    pub fn searched(self, executor: &Executor, out: Option<&Path>) -> Result<Sample> {
        Ok(Sample(match self.0 {
            SampleKind::Pilot(plan, pilot) => {
                let found = plan.after_pilot(out, |plan| plan.pilots(&pilot, executor))?;
                SampleKind::Weighted(Box::new(found))
            }
            other => other,
        }))
    }

    /// Writes the plan file into a run's folder, or finds the same one there: many shards may do so at once.
    ///
    /// # Errors
    /// [`Error::Input`] where the folder holds the plan of another run; [`Error::Io`]; [`Error::Usage`] for a run that
    /// cannot be split.
    pub fn write_plan(&self, out: &Path) -> Result<()> {
        let text = self.seal()?.0;
        leave_plan(out, &text, |file| file.write_all(&text))
    }

    /// The plan file's text and the hash of the run.
    pub(super) fn seal(&self) -> Result<(Vec<u8>, String)> {
        match &self.0 {
            SampleKind::Crude(plan, _) => plan.seal(),
            SampleKind::Weighted(plan) => plan.seal(),
            SampleKind::Pilot(..) | SampleKind::Sequential(_) => {
                let problem = "the adaptive estimators are sequential: they make no shards";
                let help = "use crude Monte Carlo, or importance sampling with one given proposal";
                Err(Error::usage(Place::item("estimator"), problem, help))
            }
        }
    }

    /// The density.
    pub fn density(&self) -> &DensityModel {
        match &self.0 {
            SampleKind::Crude(plan, _) => &plan.density,
            SampleKind::Weighted(plan) | SampleKind::Pilot(plan, _) => &plan.density,
            SampleKind::Sequential(run) => &run.density,
        }
    }

    /// The plan of crude Monte Carlo, whose lanes are numbered.
    pub fn lane_plan(&self) -> Option<&LanePlan> {
        match &self.0 {
            SampleKind::Crude(plan, _) => Some(&plan.plan),
            _ => None,
        }
    }

    /// Samples, at most; of subset simulation per level.
    pub fn samples(&self) -> u64 {
        match &self.0 {
            SampleKind::Crude(plan, _) => plan.facts.samples,
            SampleKind::Weighted(plan) | SampleKind::Pilot(plan, _) => plan.facts.samples,
            SampleKind::Sequential(run) => run.options.stop.samples,
        }
    }

    /// Lanes of a run of a fixed number of samples.
    pub fn lane_count(&self) -> u64 {
        match &self.0 {
            SampleKind::Crude(plan, _) => plan.plan.lane_count(),
            SampleKind::Weighted(plan) | SampleKind::Pilot(plan, _) => {
                plan.facts.samples.saturating_mul(plan.facts.models.len() as u64)
            }
            SampleKind::Sequential(run) => self.samples().saturating_mul(run.options.models.len() as u64),
        }
    }

    /// Seed of the draws.
    pub fn seed(&self) -> u64 {
        match &self.0 {
            SampleKind::Crude(plan, _) => plan.facts.seed,
            SampleKind::Weighted(plan) | SampleKind::Pilot(plan, _) => plan.facts.seed,
            SampleKind::Sequential(run) => run.options.seed,
        }
    }

    /// Whether the proposals were given, not found.
    pub fn has_given_proposals(&self) -> bool {
        match &self.0 {
            SampleKind::Crude(..) | SampleKind::Pilot(..) => false,
            SampleKind::Weighted(plan) => plan.facts.pilot.is_none(),
            SampleKind::Sequential(run) => matches!(run.options.estimator, Estimator::Given { .. }),
        }
    }
}
