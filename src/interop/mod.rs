//! Other programs: OpenSCENARIO files, tables of other simulators.

pub mod conformance;
pub mod openscenario;
