//! Scenarios as found in a recording ([`Scenario`]) and cases as simulated ([`Case`]).
//!
//! This module holds the mined scenario, its files and tables, and the concrete case with its motions. Mining and
//! simulation are elsewhere. Data comes from mining or a scenario file and goes to
//! [`crate::scenario::parameterization`].

mod case_file;
mod case_parameters;
mod case_quantity;
mod check;
mod columns;
mod file;
mod found;
mod mined;
mod parameter_table;
pub mod parameterization;
mod provenance;
mod schema;
mod table_reader;
mod units;

pub use crate::case::{Ahead, Case, LANE_WIDTH_M, Participant, PlainCase, check_headway};
pub use crate::category::Category;
pub use crate::motion::{LATERAL_SAMPLED, Lateral, LateralState, Motion, SPEED_SAMPLED, Speed, Tables};
pub use case_file::CaseFile;
pub use case_parameters::{CaseParameters, NamedNumber};
pub use case_quantity::{CaseNumber, CaseQuantity, GAP_ERROR_M, KMH, NUMBERS, SPEED_ERROR_MPS};
pub use check::problem_of;
pub use columns::HELP as COLUMNS_HELP;
pub use file::{
    check_scenario_file, read_scenario_file, read_scenarios, scenario_table, write_scenarios, write_scenarios_to,
};
pub use found::{ScenarioFile, usable};
pub use mined::{Ego, Other, Scenario, Side, mined_id};
pub use parameter_table::{CaseRow, ParameterRows, RowPlace};
pub use provenance::{DataProvenance, Driven};
pub use units::{Unusable, Written, si};
