//! What most users of the library need, in the order of the data flow: `use lanesweep::prelude::*;`.

pub use crate::engine::{CpuBackend, Executor, Headway, OpenBackend, Outcome, Trace, Wanted};
pub use crate::model::criterion::Criterion;
pub use crate::model::driver::{Accelerations, LaneColumns, ModelId, VectorDriver};
pub use crate::model::profile::Profile;
pub use crate::run::cases::Cases;
pub use crate::run::check::{Check, Subject};
pub use crate::run::grid::{Map, MapOptions};
pub use crate::run::parts::{Job, Shard};
pub use crate::run::sampling::{Sample, SampleHeadways, SampleOptions};
pub use crate::run::score::{ScoreOptions, f1, precision, recall};
pub use crate::run::study::{Study, StudyOptions};
pub use crate::scenario::parameterization::Parameterization;
pub use crate::scenario::{CaseParameters, Category, PlainCase, Scenario, read_scenarios, write_scenarios};
pub use crate::stats::density::{DensityModel, FitOptions, read_density, write_density};
pub use crate::support::cancel::Cancel;
pub use crate::traffic::mining::{Collection, MiningOptions, mine_folder, mine_generated};
pub use crate::traffic::trajectory::Recording;
pub use crate::traffic::trajectory::generator::GeneratorOptions;
pub use crate::{Error, Result};
