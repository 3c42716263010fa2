//! Sampling: a density becomes lanes, and their outcomes become probabilities of failure.
//!
//! [`Sample`] is the way in: it plans a run of any estimator, runs it whole or in shards, resumes and merges it. Densities
//! and estimators come from [`crate::stats`], lanes run in [`crate::engine`].

mod against_recorded;
mod compare;
mod crude;
mod generator;
mod kernels;
mod limit_state;
mod map;
mod plan;
pub(crate) mod plan_file;
mod proposal_file;
mod rows;
mod sample;
mod sample_options;
mod sample_run;
mod sequential;
mod tally;
mod weighted;

pub use against_recorded::RecordedRatios;
pub use compare::{
    CategoryComparison, ComparedCell, ComparedParameterization, RateRecord, RecordedCell, ReplayedCell, SampledCell,
    SampledScenarios, ScenarioCounts, compare_cells, kernel_scenarios, recorded_cells, sample_by_scenario,
};
pub use crude::{Checkpoint, CheckpointRow, CrudeRun, checkpoints, crude_of_segments, cuts, sample_crude, sample_into};
pub use generator::{SAMPLE_PURPOSE, SampleSource, generator_of, generator_of_points};
pub use kernels::KernelCounts;
pub(crate) use limit_state::marks_of;
pub use limit_state::{LaneLimitState, limit_state, scenario_shares, truncated};
pub use map::{MAP_CELLS, MapAxes, MapAxis, MapCounts};
pub use plan::{Conditional, SampleHeadways, conditional, mixture_of, plan_points, plan_samples};
pub use proposal_file::{proposal_from_text, proposal_text, read_proposal};
pub use rows::{EstimateRow, Risk, RiskRate, crude_rows, headway_name};
pub use sample::Sample;
pub(crate) use sample::{Proposals, SampleKind};
pub use sample_options::{Estimator, SampleOptions};
pub use sample_run::{EachChunk, Levels, SampleResult, SampleRun};
pub use tally::{SampleTally, WorstSample};
pub use weighted::WeightedTally;
