//! The engine: cases become lanes, lanes become outcomes.
//!
//! This module contains the lane's record and step, the lane plan and the backends (`cpu`, `gpu`). It also contains the
//! checks of one backend against another ([`verify`], rechecks during a sweep), outcomes and partial counts. Cases come
//! from [`model`](lanesweep_model) and [`scenario`](lanesweep_model::scenario::parameterization); partials go to
//! the run. Driver models and criteria are in [`model`](lanesweep_model).

mod backend;
mod case_table;
mod confusion;
mod counting;
pub(crate) mod cpu;
mod device_choice;
mod drivers;
mod executor;
mod frame;
pub mod generated;
#[cfg(feature = "gpu")]
pub mod gpu;
mod lane;
pub mod lane_case;
mod lane_step;
mod open;
mod outcome;
mod partial;
pub mod plan;
mod recheck;
mod scene;
pub mod shader;
mod trace;
pub mod verify;
pub mod version;

pub use backend::{Backend, Chunk, RecheckBy, Session, Wanted};
pub use case_table::{CaseTable, EncodedBlock};
pub use confusion::Confusion;
pub use counting::{CountLayout, Counted, KernelCounts, SampleTally, cell_of};
pub use cpu::backend::CpuBackend;
pub use cpu::backend::lanes_within_seconds;
pub use cpu::runner::LaneRunner;
pub use cpu::simd::Instructions;
pub use device_choice::BackendChoice;
pub use drivers::Constants;
pub use executor::{Executor, SweepSummary, chunks};
pub use frame::{Frame, Start};
pub use lane::{Step, silent};
pub use lane_case::attention_rules;
pub use lane_case::{LaneCase, LaneOther, check_time_step};
pub use lane_step::Seen;
#[cfg(not(feature = "gpu"))]
pub use open::no_gpu;
pub use open::{DeviceRecord, OpenBackend};
pub use outcome::{EndReason, NO_STEP, Outcome, Verdicts};
pub use partial::{Partial, UnitCounts};
pub use plan::{Block, CaseSource, Headway, LaneKey, LanePlan, Units};
pub use recheck::{RecheckOptions, same_words, words};
pub use scene::{DeviceScene, MotionKind};
pub use trace::{StepMark, Trace, TracedStep, TracedVehicle};
pub use version::ENGINE_VERSION;
