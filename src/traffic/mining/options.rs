//! Every threshold of the mining and every filter of the paper, by name, with its published value as
//! default. Serialized into `run.json` and read from a study's TOML.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::trajectory::{EgoViewOptions, LIMIT_TOLERANCE_M};
use lanesweep_support::{Error, Place, Result, config_tables, ranges};

config_tables! {
    /// All options of `mine`. The ranges are those in which a value has its meaning.
    pub struct MiningOptions {
        /// Extent of an ego's data set. Default 100 m around the ego, to 100 m before its final position (paper).
        pub ego_view: EgoViewOptions = EgoViewOptions::default(),
        /// A vehicle ahead in the ego's lane is its leader up to this time headway, s. Default 2.
        #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 60.0))]
        pub leader_max_thw_s: f64 = 2.0,
        /// Detection of acceleration, deceleration and cruising.
        pub longitudinal: LongitudinalOptions = LongitudinalOptions::default(),
        /// Detection of lane changes.
        pub lateral: LateralOptions = LateralOptions::default(),
        /// The cut-in and its filters.
        pub cut_in: CutInOptions = CutInOptions::default(),
        /// The cut-out and its filters.
        pub cut_out: CutOutOptions = CutOutOptions::default(),
        /// The leader deceleration and its filter.
        pub lvd: LvdOptions = LvdOptions::default(),
    }

    /// Longitudinal activities.
    pub struct LongitudinalOptions {
        /// Window of a speed change, s. Default 1 (k_h).
        #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0))]
        pub window_s: f64 = 1.0,
        /// Mean acceleration over the window below which a vehicle cruises, m/s². Default 0.1 (a_cruise).
        #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 5.0))]
        pub cruise_acceleration_mps2: f64 = 0.1,
        /// An activity changes the speed by more than this, m/s. Default 1 (Δv).
        #[schemars(range(min = 0.0, max = 50.0))]
        pub min_speed_change_mps: f64 = 1.0,
        /// Cruising shorter than this between two activities is removed, s. Default 4 (N_cruise).
        #[schemars(range(min = 0.0, max = 600.0))]
        pub min_cruise_s: f64 = 4.0,
    }

    /// Lane changes.
    pub struct LateralOptions {
        /// Window of lateral motion, s. Default 1 (k_h).
        #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 10.0))]
        pub window_s: f64 = 1.0,
        /// Mean lateral speed over the window below which lateral motion is steady, m/s. Default 0.25 (v_lat).
        #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 5.0))]
        pub quiescent_speed_mps: f64 = 0.25,
        /// Beyond this fraction of the lane width from the line, the change has certainly ended or not yet begun.
        /// Default 0.5 (α_max).
        #[schemars(range(min = 0.0, max = 1.0))]
        pub far_share: f64 = 0.5,
        /// Beyond this fraction of the lane width from the line, steady lateral motion means that the change has ended
        /// or not yet begun. Default 0.1 (α_min).
        #[schemars(range(min = 0.0, max = 1.0))]
        pub near_share: f64 = 0.1,
        /// Maximum time from the crossing to start and end, s. Default 10.
        #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 60.0))]
        pub search_s: f64 = 10.0,
        /// Which window decides that a lane change has ended. Default [`LaneChangeEnd::Observed`].
        pub lc_end: LaneChangeEnd = LaneChangeEnd::Observed,
    }

    /// The cut-in: what counts as found, and the filters of the paper.
    pub struct CutInOptions {
        /// Shorter ones are discarded, s. Default 0.1.
        #[schemars(range(min = 0.0, max = 60.0))]
        pub min_duration_s: f64 = 0.1,
        /// The search goes on this long after a cut-in of the same ego and target, s. Default 5.
        #[schemars(range(min = 0.0, max = 600.0))]
        pub pause_s: f64 = 5.0,
        /// Kept only if the target's initial speed is below this fraction of the ego's. Default 0.95 (paper).
        #[schemars(range(min = 0.0, max = 2.0))]
        pub max_speed_share: f64 = 0.95,
        /// Kept only if the initial THW is below this, s. Default 2 (paper).
        #[schemars(range(min = 0.0, max = 60.0))]
        pub max_thw_s: f64 = 2.0,
    }

    /// The cut-out: what counts as found, and the filters of the paper.
    pub struct CutOutOptions {
        /// Shorter ones are discarded, s. Default 0.1.
        #[schemars(range(min = 0.0, max = 60.0))]
        pub min_duration_s: f64 = 0.1,
        /// The search goes on this long after a cut-out of the same ego and target, s. Default 5.
        #[schemars(range(min = 0.0, max = 600.0))]
        pub pause_s: f64 = 5.0,
        /// Kept only if the vehicle ahead of the target is initially slower than the ego. Default true (paper). A
        /// cut-out without a vehicle ahead is never kept.
        pub require_slower_lead: bool = true,
    }

    /// The leader deceleration: what counts as found, and the filter of the paper.
    pub struct LvdOptions {
        /// Intervals of the tags up to this long are discarded, s. Default 0.1.
        #[schemars(range(min = 0.0, max = 60.0))]
        pub max_discarded_s: f64 = 0.1,
        /// Dropped if shorter than this after trimming to the speed's maximum and minimum, s. Default 0.5.
        #[schemars(range(min = 0.0, max = 60.0))]
        pub min_duration_s: f64 = 0.5,
        /// Kept only if the peak deceleration is above this, m/s². Default 2 (paper).
        #[schemars(range(min = 0.0, max = 30.0))]
        pub min_peak_deceleration_mps2: f64 = 2.0,
    }
}

/// Position of the window in which steady lateral motion ends a lane change. It determines T.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LaneChangeEnd {
    /// The window begins at the sample (the published formula). The change ends up to 1 s early.
    Published,
    /// The window ends at the sample: closest to the true end of the motion.
    #[default]
    Observed,
}

impl MiningOptions {
    /// Refuses values for which the definitions have no meaning.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the option: not in its range, or `near_share` above `far_share`.
    pub fn validate(&self) -> Result<()> {
        let LateralOptions { near_share, far_share, .. } = self.lateral;
        if near_share > far_share {
            let problem = format!("{near_share} is above `mining.lateral.far_share`, {far_share}");
            let help =
                "give at most that: a change that has certainly ended has also ended where lateral motion is steady";
            return Err(Error::usage(Place::item("mining.lateral.near_share"), problem, help));
        }
        ranges::check("mining", self)
    }
}

/// Positions (m), filter values and times (s) within this distance of a limit count as equal to it.
pub(super) const TOLERANCE: f64 = LIMIT_TOLERANCE_M;

/// A time in samples, to the nearest whole one: thresholds in seconds hold at any frame rate.
pub(super) fn samples(time_s: f64, frame_rate_hz: f64) -> usize {
    (time_s * frame_rate_hz).round() as usize
}

/// A window in samples: as [`samples`], at least one.
pub(super) fn window_samples(window_s: f64, frame_rate_hz: f64) -> usize {
    samples(window_s, frame_rate_hz).max(1)
}
