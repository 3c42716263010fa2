//! Mining: recordings in, scenarios out, by tags (Gelder et al. 2020, arXiv 2006.00483).
//!
//! Here live the detectors of activities ([`longitudinal`], [`lateral`]), the state tags of an ego and
//! a target ([`tags`]), the search for sequences of items in them ([`search`]), one file per category
//! with its items, its trimming and the filters of the paper ([`cut_in`], [`cut_out`], [`lvd`]), every
//! threshold by name ([`MiningOptions`]) and the run over a recording ([`mine`]). Here lives nothing
//! about file formats or about what is done with a scenario. Data comes from [`crate::traffic::trajectory`] and
//! goes, as [`Scenario`](crate::scenario::Scenario)s, to [`crate::scenario::parameterization`].
//!
//! A new category is one file beside [`lvd`] and its search in `miner.rs`.
//!
//! **Equality and the tolerance.** Recordings have two decimals, and the same place reached from the
//! other side of the road differs in the last bits. Every comparison of a position, a distance or a
//! filter value therefore treats values within 1e-6 as equal to the limit, and
//! lengths in a mined scenario are rounded to 1e-6 m: a recording turned by 180° gives the same
//! scenarios to the last bit. Longitudinal activities compare speeds as they were read.

mod collection;
pub mod cut_in;
pub mod cut_out;
mod data_set;
mod found;
pub mod lateral;
pub mod longitudinal;
pub mod lvd;
mod miner;
mod neighbours;
mod options;
pub mod search;
pub mod tags;
mod window;

pub use collection::{Collection, RecordingSummary, count, counts_text, mine_folder, mine_generated};
pub use miner::{CategoryCount, Mined, mine};
pub use options::{
    CutInOptions, CutOutOptions, LaneChangeEnd, LateralOptions, LongitudinalOptions, LvdOptions, MiningOptions,
};
