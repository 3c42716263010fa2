//! Sampling: a density becomes lanes, and their outcomes become probabilities of failure.
//!
//! [`Sample`] is the way in: it plans a run of any estimator, runs it whole or in shards, resumes and merges it. Densities
//! and estimators come from [`crate::stats`], lanes run in [`crate::engine`].

mod against_recorded;
mod compare;
mod conditional;
mod crude;
mod generator;
mod kernels;
mod lanes;
mod limit_state;
mod map;
mod plan;
pub(crate) mod plan_file;
mod proposal_file;
mod risk;
mod rows;
mod sample;
mod sample_options;
mod sample_result;
mod sample_run;
mod sequential;
mod tally;
mod watch;
mod weighted;
mod weighted_tally;

pub use against_recorded::RecordedRatios;
pub use compare::{
    CategoryComparison, ComparedCell, ComparedParameterization, RateRecord, RecordedCell, ReplayedCell, SampledCell,
    SampledScenarios, ScenarioCounts, compare_cells, kernel_scenarios, recorded_cells, sample_by_scenario,
};
pub use conditional::{Conditional, conditional, mixture_of};
pub use crude::{Checkpoint, CheckpointRow, CrudeRun, checkpoints, crude_of_segments, cuts, sample_crude, sample_into};
pub use generator::{SAMPLE_PURPOSE, SampleSource, generator_of, generator_of_points};
pub use kernels::KernelCounts;
pub use lanes::{LaneLimitState, scenario_shares, truncated};
pub use limit_state::limit_state;
pub use map::{MAP_CELLS, MapAxes, MapAxis, MapCounts};
pub use plan::{SampleHeadways, plan_points, plan_samples};
pub use proposal_file::{proposal_from_text, proposal_text, read_proposal};
pub use risk::{Risk, RiskRate};
pub use rows::{EstimateRow, crude_rows, headway_name};
pub use sample::Sample;
pub(crate) use sample::{Proposals, SampleKind};
pub use sample_options::{Estimator, SampleOptions};
pub use sample_result::{Levels, SampleResult};
pub use sample_run::{EachChunk, SampleRun};
pub use tally::{SampleTally, WorstSample};
pub(crate) use watch::marks_of;
pub use weighted_tally::WeightedTally;
