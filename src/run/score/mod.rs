//! Scores: how far S' agrees with S.
//!
//! Here live recall, precision and F1 ([`ScoreTable`]), the bootstrap over scenarios, the paper's claims
//! as data with their verdicts, and the paper's published numbers. Here lives nothing about lanes. Counts
//! come from [`crate::engine`]'s partials; scores go to [`crate::report`].

mod bootstrap;
mod claims;
mod contradiction;
mod published;
mod statistic;
mod table;

pub use bootstrap::{BootstrapInterval, ScoreOptions};
pub use claims::{Claim, ClaimResult, ClaimRow, ClaimVerdict, judge_claims, paper_claims};
pub use published::{Misfit, PublishedFailures, published_failures, published_lvd_f1};
pub use statistic::Statistic;
pub use table::{CategoryScores, ScoreCell, ScoreTable, f1, f1_interval, precision, recall, score};
