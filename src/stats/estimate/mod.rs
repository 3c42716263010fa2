//! Probabilities of rare failures from samples: estimators, their intervals, and warnings about them.
//!
//! This module contains nothing about vehicles. A [`Density`] draws points as pure functions of an index. A
//! [`LimitState`] gives each point a value that is ≤ 0 if it fails. Every estimator returns one [`Estimate`]. Points
//! are passed to the limit state in batches, because it runs on vector hardware. The same seed gives the same bits for
//! any number of threads and any division of the indices.

mod blocks;
mod evaluated_points;
mod goal;
mod importance;
mod interval;
mod kernels;
mod limit_state;
mod monte_carlo;
mod proposal_mixtures;
mod ratio;
mod search;
mod stop;
mod summary;
mod warnings;
mod weights;

pub use blocks::{BlockSums, Join};
pub use goal::Goal;
pub use importance::{Importance, WeightedFailure, from_weight_sums, importance_of_points, importance_sums};
pub use interval::{Interval, IntervalKind, wilson};
pub use kernels::{Carrier, KernelShares, kernel_shares};
pub use limit_state::{ATTEMPTS, Density, Failure, LimitState, Truncated};
pub use monte_carlo::{Counts, from_clusters, from_counts};
pub use ratio::{ClusterRate, Clusters, Ratio, RatioMethod, RatioVerdict, cluster_rate, paired_ratio};
pub use search::{Found, Search, SearchRound, SearchRun, search};
pub use stop::{StopReason, StopRule};
pub use summary::Estimate;
pub use warnings::{Trust, Verdict, Warning};
pub use weights::{WeightFigures, WeightSums};
