//! lanesweep: a massively parallel sweeper for the scenario-based assessment of automated driving systems.
//!
//! Rooms in the order of the data: [`trajectory`] → [`mining`] → [`scenario`] → [`parameterization`] →
//! [`driver`] and [`criterion`] → [`sweep`]. Beside them: [`profile`] (every constant as data), [`scalar`]
//! (the number a lane computes with), [`random`], [`density`] and
//! [`estimate`] (samples of rare events), [`gpu`] (compute devices), [`grid`] (maps), [`conformance`] (other simulators' tables),
//! [`parts`] (shards, journals, merging), [`table`] (tables in files), [`openscenario`] (played scenarios and
//! distributions of parameters), [`cluster`] (scripts for workload managers), [`interrupt`] (ending early in
//! good order), [`run_folder`] (one run per folder, published at once), [`settings`] (what may be configured) and
//! [`cli`].
//!
//! A cut-in against one driver, in binary64:
//!
//! ```
//! use lanesweep::criterion::Criterion;
//! use lanesweep::driver::ModelId;
//! use lanesweep::profile::Profile;
//! use lanesweep::scenario::{Category, PlainCase, Tables};
//! use lanesweep::sweep::{Headway, LaneCase, Trace};
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
//!     length_m: 4.3,
//!     width_m: 1.9,
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
//! use lanesweep::mining::{MiningOptions, mine_generated};
//! use lanesweep::profile::Profile;
//! use lanesweep::score::{ScoreOptions, f1, score};
//! use lanesweep::sweep::{CpuBackend, Partial, StudyOptions, SweepOptions, Wanted, plan_study, sweep};
//! use lanesweep::trajectory::generator::GeneratorOptions;
//!
//! # fn main() -> lanesweep::Result<()> {
//! let recordings = GeneratorOptions { recordings: 1, ..GeneratorOptions::default() };
//! let mined = mine_generated(&recordings, &MiningOptions::default(), || ())?;
//! let plan = plan_study(&mined.scenarios, &Profile::load("paper")?, &StudyOptions::default())?.plan;
//! let options = SweepOptions::plain(Wanted::Verdicts);
//! let mut parts = Vec::new();
//! sweep(&plan, 0..plan.unit_count(), &CpuBackend::lane_arithmetic(), &options, |chunk| {
//!     parts.push(Partial::from_chunk(&plan, &chunk)?);
//!     Ok(())
//! })?;
//! let counts = parts.into_iter().try_fold(Partial::empty(&plan), Partial::merge)?;
//! let scores = score(&plan, &counts, &ScoreOptions::default())?;
//! for cell in scores.categories.iter().flat_map(|category| &category.cells) {
//!     // Undefined (0/0) where neither S nor S' fails.
//!     assert!(f1(&cell.counts).is_none_or(|f1| (0.0..=1.0).contains(&f1)));
//! }
//! # Ok(())
//! # }
//! ```

mod atomic_file;
pub mod cli;
pub mod cluster;
pub mod conformance;
pub mod criterion;
pub mod density;
#[macro_use]
pub mod driver;
pub mod error;
pub mod estimate;
pub mod flag;
pub mod gpu;
pub mod grid;
mod input_file;
pub mod interrupt;
mod lock;
pub mod mining;
mod near_name;
pub mod openscenario;
pub mod parameterization;
pub mod parts;
mod plain_text;
pub mod plausibility;
pub mod profile;
pub mod random;
mod readable;
pub mod report;
pub mod run_folder;
pub mod sampling;
pub mod scalar;
pub mod scenario;
pub mod score;
pub mod settings;
pub mod sweep;
pub mod table;
mod toml_file;
pub mod trajectory;
mod vector_state;
pub mod verify;

pub use error::{Error, Place, Result};
