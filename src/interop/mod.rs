//! Other programs: OpenSCENARIO files, tables of other simulators, scripts for workload managers.

pub mod cluster;
pub mod conformance;
pub mod openscenario;
