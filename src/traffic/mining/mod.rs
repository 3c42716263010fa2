//! Mining: recordings in, scenarios out, by tags (Gelder et al. 2020, arXiv 2006.00483).
//!
//! This module has the detectors of activities ([`longitudinal`], [`lateral`]), and the tags of an ego and a target
//! with the search for sequences of items ([`tags`]). Each category has a file with its items, its trimming and the
//! filters of the paper ([`cut_in`], `cut_out`, [`lvd`]). [`MiningOptions`] has every threshold; [`mine`] runs over a
//! recording. Mining depends neither on file formats nor on the use of scenarios. Data comes from
//! [`crate::trajectory`] and goes, as [`Scenario`](lanesweep_model::scenario::Scenario)s, to
//! [`lanesweep_model::scenario::parameterization`].
//!
//! A new category is one file beside [`lvd`] and its search in `miner.rs`.
//!
//! **Equality and the tolerance.** Recordings have two decimals, and the same position in a recording rotated by 180°
//! differs in the last bits. Therefore every comparison of a position, a distance or a filter value treats values
//! within 1e-6 of the limit as equal to it, and lengths in a mined scenario are rounded to 1e-6 m. Longitudinal
//! activities compare the recorded speeds exactly.

mod collection;
mod copies;
pub mod cut_in;
mod cut_out;
mod data_set;
pub mod lateral;
pub mod longitudinal;
pub mod lvd;
mod miner;
mod options;
pub mod tags;

pub(super) use collection::filter_given;
pub use collection::{
    Collection, RecordingSummary, count, counts, counts_text, mine_folder, mine_generated, mine_inputs, mine_loaded,
};
pub(super) use copies::leave_out_copies;
pub use miner::{CategoryCount, Mined, mine};
pub use options::{
    CutInOptions, CutOutOptions, LaneChangeEnd, LateralOptions, LongitudinalOptions, LvdOptions, MiningOptions,
};
