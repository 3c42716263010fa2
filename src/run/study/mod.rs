//! Studies: scenarios and parameterizations become a plan of lanes, a window of scenarios at a time, and a plan file.

pub(crate) mod plan;
pub(crate) mod plan_file;
pub(crate) mod unit_record;

pub use plan::{Study, StudyOptions, StudyOutline, StudyPlan, outline_study, plan_study};
pub use plan_file::StudyHead;
