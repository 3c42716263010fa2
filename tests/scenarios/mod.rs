//! Scenario files, tables of users, parameterizations, OpenSCENARIO.

mod openscenario;
mod reduction_goldens;
mod scenario_file;
mod tables;
mod user_tables;
