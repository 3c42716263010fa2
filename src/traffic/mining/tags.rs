//! The tags of an ego and a target per sample, and the search for a sequence of items in them (*scenario = sequence of
//! items*).
//!
//! An item is a test on the tags of all actors at one sample; it holds over a whole interval; item i + 1 begins
//! exactly when item i ends. Intervals are half open: from the first sample with the item to the first without, or to
//! the last sample.

use super::lateral::{LaneChange, lane_changes};
use super::longitudinal::{Longitudinal, LongitudinalEvent, longitudinal_events};
use super::options::{MiningOptions, TOLERANCE};
use crate::trajectory::{Carriageway, Track};

/// Tags of one ego and one target at one sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tags {
    /// The target is the ego's leader.
    pub leader: bool,
    /// The target changes into the lane the ego is in (`li` or `ri`).
    pub changes_in: bool,
    /// The target changes out of the lane the ego is in (`lo` or `ro`).
    pub changes_out: bool,
    /// The target decelerates.
    pub decelerates: bool,
    /// The ego is in a lane and in no lane change.
    pub ego_keeps_lane: bool,
}

/// Activities of a vehicle over its whole track; computed once for all egos.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Activities {
    /// Accelerating, decelerating, cruising.
    pub longitudinal: Vec<LongitudinalEvent>,
    /// Lane changes relative to each lane of the carriageway; empty if the vehicle reaches no line.
    pub lane_changes: Vec<Vec<LaneChange>>,
}

impl Activities {
    /// Detects all activities of a vehicle.
    pub(super) fn of(track: &Track, carriageway: &Carriageway, frame_rate_hz: f64, options: &MiningOptions) -> Self {
        let (low, high) = track.d_m.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &d| (l.min(d), h.max(d)));
        let reaches_a_line =
            carriageway.lane_lines_m.iter().any(|&line| line >= low - TOLERANCE && line <= high + TOLERANCE);
        let lanes = if reaches_a_line { carriageway.lane_count() } else { 0 };
        let changes = |lane| lane_changes(&track.d_m, lane, frame_rate_hz, &options.lateral);
        let lane_changes = (0..lanes).filter_map(|lane| carriageway.lane(lane)).map(changes).collect();
        let longitudinal = longitudinal_events(&track.v_s_mps, frame_rate_hz, &options.longitudinal);
        Activities { longitudinal, lane_changes }
    }

    /// Changes lane somewhere.
    pub(super) fn changes_lane(&self) -> bool {
        self.lane_changes.iter().any(|changes| !changes.is_empty())
    }

    /// Decelerates somewhere.
    pub(super) fn decelerates(&self) -> bool {
        self.longitudinal.iter().any(|e| e.activity == Longitudinal::Decelerating)
    }

    /// The lane change relative to `lane` in progress at sample `k`.
    pub(super) fn lane_change(&self, lane: u16, k: usize) -> Option<&LaneChange> {
        self.lane_changes.get(usize::from(lane))?.iter().find(|change| (change.start..change.end).contains(&k))
    }

    /// The longitudinal activity at sample `k`.
    pub(super) fn longitudinal_at(&self, k: usize) -> Option<Longitudinal> {
        let after = self.longitudinal.partition_point(|e| e.start <= k);
        Some(self.longitudinal.get(after.checked_sub(1)?)?.activity)
    }
}

/// A test on the tags of one sample.
pub type Item<'a, T> = &'a dyn Fn(&T) -> bool;

/// The samples of a match.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Match {
    /// First sample of each item.
    pub starts: Vec<usize>,
    /// First sample after the last item, or the last sample of the tags if the item still holds there.
    pub end: usize,
    /// The last item holds to the end of the tags, so `end` is one sample with the item.
    pub clamped: bool,
}

impl Match {
    /// First sample.
    pub fn start(&self) -> usize {
        self.starts[0]
    }

    /// Samples from start to end.
    pub(crate) fn len(&self) -> usize {
        self.end - self.start()
    }

    /// The samples at which the last item holds.
    pub fn last_item(&self) -> std::ops::Range<usize> {
        let from = self.starts[self.starts.len() - 1];
        from..if self.clamped { self.end + 1 } else { self.end }
    }
}

/// First sequence that begins at `from` or later. The search ignores tags before `from`: an item that already holds
/// at `from` begins there.
pub fn find_match<T>(tags: &[T], items: &[Item<T>], from: usize) -> Option<Match> {
    let mut k = from;
    let first = items.first()?;
    while k < tags.len() {
        if !first(&tags[k]) {
            k += 1;
            continue;
        }
        let mut starts = Vec::with_capacity(items.len());
        let mut at = k;
        for item in items {
            let end = run_end(tags, *item, at);
            if end == at {
                break;
            }
            starts.push(at);
            at = end;
        }
        if starts.len() == items.len() {
            let clamped = at == tags.len();
            return Some(Match { starts, end: at.min(tags.len() - 1), clamped });
        }
        k = run_end(tags, *first, k);
    }
    None
}

/// First sample from `k` on without the item.
fn run_end<T>(tags: &[T], item: Item<T>, k: usize) -> usize {
    tags[k..].iter().position(|t| !item(t)).map_or(tags.len(), |n| k + n)
}
