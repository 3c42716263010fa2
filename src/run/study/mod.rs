//! Studies: scenarios and parameterizations become a plan of lanes; the plan is run whole or in shards, resumed, merged and
//! scored. [`Study`] is the way in.

mod cases;
mod facts;
mod plan;
pub(crate) mod plan_file;
mod planned;
mod read;
mod run;

pub use cases::StudyCases;
pub(crate) use cases::WINDOW;
pub use facts::{CategoryProvenance, ParameterHistogram, StudyProvenance, parameter_histograms};
pub use plan::{StudyOptions, outline_study, plan_study};
pub use plan_file::StudyHead;
pub use planned::{Study, StudyBuilder};
pub use run::{StudyResult, StudyRun};
