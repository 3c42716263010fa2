//! lanesweep: a massively parallel sweeper for the scenario-based assessment of automated driving systems.
//!
//! Modules, each from a crate that depends only on those before it: [`support`] (errors, files, tables), [`model`] (drivers, criteria,
//! profile, case), [`scenario`] (recorded scenarios and their parameterizations), [`traffic`] (recordings, mining),
//! [`stats`] (random numbers, densities, estimators), [`engine`] (lanes on CPUs and GPUs), [`run`] (studies, samples,
//! maps, scores), [`report`] (tables, figures, pages, exported scenarios) and `cli` (feature `cli`).
//! [`prelude`] has the names that most users need; `examples/library.rs` uses nothing else.
//!
//! A cut-in against one driver, in binary64:
//!
//! ```
//! use lanesweep::model::criterion::Criterion;
//! use lanesweep::model::driver::ModelId;
//! use lanesweep::model::profile::Profile;
//! use lanesweep::scenario::{Category, PlainCase, Tables};
//! use lanesweep::engine::{Headway, LaneCase, Trace};
//!
//! # fn main() -> lanesweep::Result<()> {
//! let profile = Profile::load("paper")?;
//! let cut_in = PlainCase {
//!     category: Category::CutIn,
//!     ego_speed_mps: 30.0,
//!     speed_mps: 20.0,
//!     acceleration_mps2: 0.0,
//!     end_speed_mps: None,
//!     lateral_speed_mps: 1.0,
//!     lateral_distance_m: 3.5,
//!     ahead_speed_mps: 0.0,
//!     ahead_gap_m: 0.0,
//!     ego_length_m: 4.3,
//!     ego_width_m: 1.9,
//!     length_m: 4.3,
//!     width_m: 1.9,
//!     lane_width_m: 3.5,
//!     duration_s: None,
//! };
//! let mut tables = Tables::default();
//! let case = LaneCase::encode(&cut_in.case(profile.frame.time_cap_s)?, &profile, &mut tables);
//! let trace = Trace::record(&profile, cut_in.category, &case, &tables, Headway::ThwS(1.2), ModelId::Fsm);
//! assert_eq!(trace.initial_gap_m, 36.0);
//! assert!(!trace.outcome.verdicts.failed(Criterion::Collision));
//! # Ok(())
//! # }
//! ```
//!
//! A study: recordings → scenarios → plan → counts → scores.
//!
//! ```
//! use lanesweep::prelude::*;
//!
//! # fn main() -> lanesweep::Result<()> {
//! let recordings = GeneratorOptions { recordings: 1, ..GeneratorOptions::default() };
//! let mined = mine_generated(&recordings, &MiningOptions::default(), || Ok(()))?;
//! let study = Study::builder(&mined, Profile::load("paper")?).plan()?;
//! let result = study.run(&Executor::new(CpuBackend::lane_arithmetic()))?;
//! assert_eq!(result.summary.lanes, study.plan().lane_count());
//! for cell in study.score(&result.counts)?.categories.iter().flat_map(|category| &category.cells) {
//!     // Undefined (0/0) where neither S nor S' fails.
//!     assert!(f1(&cell.counts).is_none_or(|f1| (0.0..=1.0).contains(&f1)));
//! }
//! # Ok(())
//! # }
//! ```

#[cfg(feature = "cli")]
pub use lanesweep_cli as cli;
pub use lanesweep_engine as engine;
pub use lanesweep_model::{self as model, scenario};
pub use lanesweep_report as report;
pub use lanesweep_run as run;
pub use lanesweep_stats as stats;
pub use lanesweep_support::{self as support, Error, Place, Result};
pub use lanesweep_traffic as traffic;

pub mod prelude;
