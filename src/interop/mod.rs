//! Other programs: OpenSCENARIO files.

pub mod openscenario;
