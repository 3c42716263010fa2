//! The sweep: cases become lanes, lanes become outcomes.
//!
//! Here live the lane's record, its step and the loops over it (one lane, batches of lanes), the lane plan, the backends, outcomes
//! and partial results. Here lives no physics of a driver or a criterion, and nothing about scores. Cases
//! come from [`crate::scenario`] and [`crate::parameterization`]; partials go to [`crate::score`].

mod alone;
mod backend;
mod batch;
mod batch_arrays;
mod calm;
mod cpu;
mod drivers;
mod ease;
mod ending;
mod engine;
mod forecast;
mod frame;
pub mod generated;
mod instructions;
mod lane;
mod lane_case;
mod lane_step;
mod outcome;
mod packed_counts;
mod partial;
mod plan;
mod plan_file;
mod recheck;
mod rules;
mod run;
mod runner;
mod scene;
mod series;
mod simd;
mod stream;
mod study;
mod time_step;
mod trace;
mod unit_record;
mod units;
mod waiting;
mod window;

pub use backend::{Backend, CellCounts, Chunk, RecheckBy, Session, Wanted};
pub use cpu::CpuBackend;
pub(crate) use cpu::lanes_within_seconds;
pub use drivers::Constants;
pub use ending::Ending;
pub use engine::ENGINE_VERSION;
pub use forecast::{Forecast, forecast};
pub use frame::{Frame, Simulation, Start};
pub use instructions::Instructions;
pub use lane::{Observer, Silent, Step, run_lane};
pub(crate) use lane_case::attention_rules;
pub use lane_case::{LaneCase, LaneOther};
pub use lane_step::Seen;
pub use outcome::{EndReason, NO_STEP, Outcome, Verdicts};
pub use partial::{Confusion, Partial, UnitCounts, WORST_LANES, WorstLane};
pub use plan::{Block, CaseSource, Headway, LaneKey, LanePlan};
pub(crate) use plan::{hex, sha256};
pub use plan_file::StudyHead;
pub use recheck::{ONE_IN, Recheck, same_words, words};
pub use run::{SweepOptions, SweepSummary, chunks, sweep};
pub use runner::LaneRunner;
pub use scene::Scene;
pub use study::{Study, StudyOptions, StudyOutline, StudyPlan, outline_study, plan_study};
pub use time_step::check_time_step;
pub use trace::{Mark, Trace, TracedStep, TracedVehicle};
pub use units::Units;
