//! Reports: the output of a run for people and for other programs.
//!
//! This module holds the terminal tables, the CSV files, the figures (SVG, all drawn by `plot`), the pages and
//! `run.json`. It computes nothing beyond formatting. Scores come from [`lanesweep_run::score`]; text and files go to the
//! user.

pub mod case_evidence;
mod case_sentences;
pub mod case_sheet;
pub mod case_table;
pub mod column_words;
pub mod density;
pub mod host;
mod html;
pub mod lanes;
pub mod map;
mod map_sheet;
mod map_tables;
pub mod openscenario;
mod plot;
pub mod records;
pub mod sampling;
pub mod sampling_tables;
pub mod study;
mod study_answer;
mod study_figures;
mod study_page;
pub mod tables;
pub mod trace;
pub mod tracks;
pub mod verification;
