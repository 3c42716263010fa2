//! Other programs: OpenSCENARIO files, scripts for workload managers.

pub mod cluster;
pub mod openscenario;
