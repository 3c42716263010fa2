//! The tags of an ego and a target per sample, on which items are tests.

use super::lateral::{LaneChange, lane_change_at, lane_changes};
use super::longitudinal::{Longitudinal, LongitudinalEvent, longitudinal_events};
use super::options::{MiningOptions, TOLERANCE};
use crate::traffic::trajectory::{Carriageway, Track};

/// Tags of one ego and one target at one sample, as a set of bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tags(u8);

impl Tags {
    /// The target is the ego's leader.
    pub const LEADER: Tags = Tags(1);
    /// The target changes into the lane the ego is in (`li` or `ri`).
    pub const CHANGES_IN: Tags = Tags(2);
    /// The target changes out of the lane the ego is in (`lo` or `ro`).
    pub const CHANGES_OUT: Tags = Tags(4);
    /// The target decelerates.
    pub const DECELERATES: Tags = Tags(8);
    /// The ego is in a lane and in no lane change.
    pub const EGO_KEEPS_LANE: Tags = Tags(16);

    /// All of `others` are set.
    pub fn has(self, others: Tags) -> bool {
        self.0 & others.0 == others.0
    }

    /// With `others` set if `condition` holds.
    pub fn with(self, others: Tags, condition: bool) -> Tags {
        if condition { Tags(self.0 | others.0) } else { self }
    }
}

impl std::ops::BitOr for Tags {
    type Output = Tags;
    fn bitor(self, other: Tags) -> Tags {
        Tags(self.0 | other.0)
    }
}

/// Activities of a vehicle over its whole track; computed once for all egos.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Activities {
    /// Accelerating, decelerating, cruising.
    pub longitudinal: Vec<LongitudinalEvent>,
    /// Lane changes relative to each lane of the carriageway; empty if the vehicle reaches no line.
    pub lane_changes: Vec<Vec<LaneChange>>,
}

impl Activities {
    /// Detects all activities of a vehicle.
    pub fn of(track: &Track, carriageway: &Carriageway, frame_rate_hz: f64, options: &MiningOptions) -> Self {
        let (low, high) = track.d_m.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &d| (l.min(d), h.max(d)));
        let reaches_a_line =
            carriageway.lane_lines_m.iter().any(|&line| line >= low - TOLERANCE && line <= high + TOLERANCE);
        let lane_changes = if reaches_a_line {
            (0..carriageway.lane_count())
                .filter_map(|lane| carriageway.lane(lane))
                .map(|lane| lane_changes(&track.d_m, lane, frame_rate_hz, &options.lateral))
                .collect()
        } else {
            Vec::new()
        };
        let longitudinal = longitudinal_events(&track.v_s_mps, frame_rate_hz, &options.longitudinal);
        Activities { longitudinal, lane_changes }
    }

    /// Changes lane somewhere.
    pub fn changes_lane(&self) -> bool {
        self.lane_changes.iter().any(|changes| !changes.is_empty())
    }

    /// Decelerates somewhere.
    pub fn decelerates(&self) -> bool {
        self.longitudinal.iter().any(|e| e.activity == Longitudinal::Decelerating)
    }

    /// The lane change relative to `lane` in progress at sample `k`.
    pub fn lane_change(&self, lane: u16, k: usize) -> Option<&LaneChange> {
        lane_change_at(self.lane_changes.get(usize::from(lane))?, k)
    }

    /// The longitudinal activity at sample `k`.
    pub fn longitudinal_at(&self, k: usize) -> Option<Longitudinal> {
        let after = self.longitudinal.partition_point(|e| e.start <= k);
        Some(self.longitudinal.get(after.checked_sub(1)?)?.activity)
    }
}
