//! Scores: how far S' agrees with S.
//!
//! Here live recall, precision and F1 ([`ScoreTable`]), intervals of their differences over scenarios, the best
//! parameterizations, the paper's claims as data with their verdicts, and the paper's published numbers. Here lives
//! nothing about lanes. Counts come from [`crate::engine`]'s partials; scores go to [`crate::report`].

mod best;
mod claims;
mod difference;
mod paper_claims;
mod published;
mod statistic;
mod table;

pub use best::{Best, BestScore, best_parameterizations};
pub use claims::{Claim, ClaimResult, ClaimRow, ClaimVerdict, check_claims};
pub use difference::{Contrast, ScenarioRate, ScoreInterval, min_contrast};
pub use paper_claims::paper_claims;
pub use published::{Misfit, PublishedFailures, published_failures, published_lvd_f1};
pub use statistic::Statistic;
pub use table::{CategoryScores, ScoreCell, ScoreOptions, ScoreTable, f1, f1_interval, precision, recall, score};
