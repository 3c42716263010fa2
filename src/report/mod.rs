//! Reports: what a person or another program reads of a study.
//!
//! Here live the terminal tables, the CSV files, the figures (SVG), `run.json` and the one way files are
//! written: temporary name, sync, rename. Here lives no arithmetic beyond formatting. Scores come from
//! [`crate::run::score`]; text and files go to the user.

pub mod axis;
pub mod compare;
pub mod compare_figures;
pub mod convergence;
pub mod csv;
pub mod density;
pub mod failure_map;
pub mod forest;
pub mod html;
pub mod lanes;
pub mod map;
mod map_page;
pub mod map_sheet;
pub mod plot;
pub mod radar;
pub mod records;
pub mod reference;
mod run_facts;
pub mod run_record;
pub mod sampled_rows;
pub mod sampling;
pub mod sampling_figures;
mod sampling_page;
mod sampling_rules;
pub mod sampling_tables;
pub mod study;
mod study_document;
pub mod study_figures;
mod study_page;
pub mod tables;
pub mod trace_figure;
mod trace_panels;
pub mod trace_table;
#[cfg(test)]
mod trace_tests;
pub mod verification;
