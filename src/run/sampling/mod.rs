//! Sampling: a density becomes lanes, and their outcomes become probabilities of failure.
//!
//! [`Sample`] is the entry point: it plans a run of any estimator, runs it whole or in shards, resumes and merges it.
//! Densities and estimators come from [`lanesweep_stats`]; lanes run in [`lanesweep_engine`].

mod against_recorded;
mod bandwidth;
mod cheaper_estimator;
mod convergence;
mod crude;
mod estimate_rows;
mod failing_lanes;
mod generator;
mod limit_state;
mod plan;
pub(crate) mod plan_file;
mod proposal_file;
mod result;
mod sample_options;
mod sample_run;
mod uncertainty;
mod weighted;

pub use against_recorded::TRAFFIC_DRAWS;
pub use bandwidth::{AtBandwidth, BandwidthVerdict};
pub use cheaper_estimator::Choice;
pub use convergence::{Checkpoint, CheckpointRow};
pub use estimate_rows::{CarrierRow, EstimateRow, NoTraffic, RecordedRatios, Risk, RiskRate};
pub use failing_lanes::SampledPoint;
pub(crate) use generator::recipe_without_parameters;
pub use generator::{SAMPLE_PURPOSE, generator_of, generator_of_points};
pub use limit_state::{LaneLimitState, limit_state, truncated};
pub use plan::{plan_points, plan_samples};
pub(crate) use plan_file::KIND as SAMPLING_PLAN;
use plan_file::SEARCH_FILE;
pub use proposal_file::{proposal_from_text, proposal_text, read_proposal};
pub use result::SampleResult;
pub use sample_options::{Estimator, Question, SampleHeadways, SampleOptions};
pub use sample_run::{ESTIMATE_RECORD, SampleCounts};
pub use uncertainty::Uncertainty;
pub use weighted::WeightedTally;

use std::path::Path;

use crate::parts::PLAN_FILE;
use lanesweep_engine::{Executor, LanePlan};
use lanesweep_model::profile::Profile;
use lanesweep_stats::density::{DensityModel, Mixture};
use lanesweep_stats::estimate::{Importance, Search, SearchRun};
use lanesweep_support::{Error, Result};

/// A planned sampling run: whole, or one shard of it if its samples are independent.
///
/// The example runs two shards in a folder; together they give the estimates of the run in one piece:
///
/// ```
/// use lanesweep::engine::{CpuBackend, Executor, Headway};
/// use lanesweep::model::profile::Profile;
/// use lanesweep::run::parts::{Job, Shard};
/// use lanesweep::run::sampling::{Estimator, Sample, SampleHeadways, SampleOptions};
/// # use lanesweep::scenario::Category;
/// # use lanesweep::scenario::parameterization::Parameterization;
/// # use lanesweep::stats::density::{DensityModel, FitOptions};
/// # use lanesweep::scenario::DataProvenance;
/// # use lanesweep::traffic::mining::{MiningOptions, mine_generated};
/// # use lanesweep::traffic::trajectory::generator::GeneratorOptions;
///
/// # fn main() -> lanesweep::Result<()> {
/// # let recordings = GeneratorOptions { recordings: 2, ..GeneratorOptions::default() };
/// # let scenarios = mine_generated(&recordings, &MiningOptions::default(), || Ok(()))?.scenarios;
/// # let facts = DataProvenance { data: "synthetic".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
/// # let options = FitOptions { valid_draws: 100, ..FitOptions::default() };
/// # let id = Parameterization::find(Category::CutIn, "2").unwrap();
/// # let density = DensityModel::fit(id, &scenarios, &facts, &options)?.model;
/// # let folder = tempfile::tempdir().unwrap();
/// # let folder = folder.path();
/// let headways = SampleHeadways::Each(vec![Headway::ThwS(0.6)]);
/// let options = SampleOptions::new(Estimator::Crude, 10_000, headways);
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
/// let (_, merged) = Sample::merge_parts(folder, &|shard| format!("run shard {shard}"))?;
/// assert_eq!(merged.rows, whole.rows);
/// # Ok(())
/// # }
/// ```
pub struct Sample {
    /// Density of the parameters.
    pub density: DensityModel,
    /// Constants of the lanes.
    pub profile: Profile,
    /// Estimator, models, headways and criteria.
    pub options: SampleOptions,
    /// What the estimator needs.
    pub kind: SampleKind,
}

/// Kinds of sampling runs.
pub enum SampleKind {
    /// Crude Monte Carlo: its lanes.
    Crude(Box<LanePlan>),
    /// Importance sampling of a known proposal.
    Weighted(Box<Weighted>),
    /// The same with a proposal that a search must find.
    Search(Search),
}

/// Importance sampling of a known proposal.
#[derive(Debug, Clone)]
pub struct Weighted {
    /// The proposal of all questions.
    pub proposal: Mixture,
    /// Draws of the proposal and of the density.
    pub draws: Importance,
    /// The search that found it; `None` for a given proposal.
    pub search: Option<SearchRun>,
}

impl Sample {
    /// Plans a run.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that contradict one another or the density.
    pub fn plan(density: DensityModel, profile: &Profile, options: &SampleOptions) -> Result<Sample> {
        let kind = match &options.estimator {
            Estimator::Crude => SampleKind::Crude(Box::new(plan_samples(&density, profile, options)?)),
            Estimator::Search(search) => SampleKind::Search(*search),
            Estimator::Given { proposal: Some(proposal), crude_per_draw } => {
                let (proposal, crude_per_draw) = (proposal.clone(), *crude_per_draw);
                let draws = Importance { seed: options.seed, draws: options.stop.samples, crude_per_draw };
                SampleKind::Weighted(Box::new(Weighted { proposal, draws, search: None }))
            }
            Estimator::Given { proposal: None, .. } => {
                return Err(Error::Internal("importance sampling of a given proposal without one".to_owned()));
            }
        };
        let sample = Sample { density, profile: profile.clone(), options: options.clone(), kind };
        sample.check_lanes()?;
        Ok(sample)
    }

    /// Tests one point as lanes if estimators make the points during the run, so that errors common to all points
    /// appear early.
    fn check_lanes(&self) -> Result<()> {
        if matches!(self.kind, SampleKind::Crude(_)) {
            return Ok(());
        }
        let first = self.density.kde.points()[0].clone();
        plan_points(&self.density, &[first], &self.profile, &self.options.models, &self.options.headways).map(drop)
    }

    /// The plan of crude Monte Carlo; its lanes have indices.
    pub fn lane_plan(&self) -> Option<&LanePlan> {
        match &self.kind {
            SampleKind::Crude(plan) => Some(plan),
            _ => None,
        }
    }

    /// Number of samples; before a search, and with a stop rule, the maximum.
    pub(crate) fn samples(&self) -> u64 {
        match &self.kind {
            SampleKind::Weighted(weighted) => weighted.draws.draws,
            _ => self.options.stop.samples,
        }
    }

    /// Number of lanes of a run with a fixed number of samples.
    pub fn lane_count(&self) -> u64 {
        let drawn = match &self.kind {
            SampleKind::Weighted(weighted) => weighted.draws.draws.saturating_mul(1 + weighted.draws.crude_per_draw),
            _ => self.samples(),
        };
        let weighted = || drawn.saturating_mul(self.lanes_per_sample());
        self.lane_plan().map_or_else(weighted, LanePlan::lane_count)
    }

    /// Finds the proposal if a search is needed, unless the folder has that of an interrupted run or of another shard. A
    /// repeated search gives the same bits, but takes time.
    ///
    /// # Errors
    /// Those of the lanes; [`Error::Io`].
    pub fn searched(self, executor: &Executor, out: &Path, is_shard: bool) -> Result<Sample> {
        let SampleKind::Search(search) = self.kind else { return Ok(self) };
        if let Some(kept) = self.kept_search(&out.join(if is_shard { PLAN_FILE } else { SEARCH_FILE }), is_shard)? {
            tracing::info!("the search is done already");
            return Ok(kept);
        }
        let kind = SampleKind::Weighted(Box::new(self.search(&search, executor)?));
        Ok(Sample { kind, ..self })
    }
}
