//! Lateral activities: when a vehicle changes into or out of a given lane.
//!
//! The lane is fixed. For each of the four changes, `s` is the distance past the crossed line: negative before, zero
//! at the crossing, positive after. So one detector serves all four, and left and right are symmetric.

use super::longitudinal::trailing_min;
use super::options::{LaneChangeEnd, LateralOptions, TOLERANCE, samples, window_samples};
use crate::trajectory::Lane;

/// The four lane changes relative to one lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LaneChangeKind {
    /// To the left, into the lane (`li`): comes from the right.
    LeftIn,
    /// To the right, into the lane (`ri`): comes from the left.
    RightIn,
    /// To the left, out of the lane (`lo`).
    LeftOut,
    /// To the right, out of the lane (`ro`).
    RightOut,
}

impl LaneChangeKind {
    /// Entering before leaving: a vehicle that crosses a whole lane between two samples enters it first.
    const ALL: [LaneChangeKind; 4] =
        [LaneChangeKind::LeftIn, LaneChangeKind::RightIn, LaneChangeKind::LeftOut, LaneChangeKind::RightOut];

    /// Into the lane.
    pub fn is_in(self) -> bool {
        matches!(self, LaneChangeKind::LeftIn | LaneChangeKind::RightIn)
    }

    /// Distance past the crossed line, m.
    fn past_line(self, d_m: f64, lane: Lane) -> f64 {
        match self {
            LaneChangeKind::RightIn => lane.left_m - d_m,
            LaneChangeKind::LeftIn => d_m - lane.right_m,
            LaneChangeKind::LeftOut => d_m - lane.left_m,
            LaneChangeKind::RightOut => lane.right_m - d_m,
        }
    }
}

/// One lane change over the samples `start..end` of the track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LaneChange {
    /// Kind of the change.
    pub kind: LaneChangeKind,
    /// First sample.
    pub start: usize,
    /// First sample past the line.
    pub crossing: usize,
    /// First sample after it.
    pub end: usize,
}

/// Lane changes of a whole track with lateral positions `d_m` relative to `lane`: ascending, not overlapping.
pub fn lane_changes(d_m: &[f64], lane: Lane, frame_rate_hz: f64, options: &LateralOptions) -> Vec<LaneChange> {
    let mut found: Vec<LaneChange> = Vec::new();
    for (k, kind) in (1..d_m.len()).flat_map(|k| LaneChangeKind::ALL.map(|kind| (k, kind))) {
        let free_from = found.last().map_or(0, |c| c.end);
        let [before, now] = [k - 1, k].map(|k| kind.past_line(d_m[k], lane));
        let is_crossed = before <= TOLERANCE && now > TOLERANCE;
        // Not where the vehicle is already changing.
        if k < free_from || !is_crossed {
            continue;
        }
        let s: Vec<f64> = d_m.iter().map(|&d| kind.past_line(d, lane)).collect();
        let profile = LineDistance::new(&s, lane.width_m(), frame_rate_hz, options);
        if let Some(end) = profile.end(k) {
            let start = profile.start(k, free_from).unwrap_or(free_from);
            found.push(LaneChange { kind, start, crossing: k, end });
        }
    }
    found
}

/// `s` over the track, and the limits that determine begin and end of the change.
struct LineDistance<'a> {
    s: &'a [f64],
    window_min: Vec<f64>,
    window: usize,
    reach: usize,
    quiescent_gap_m: f64,
    far_m: f64,
    near_m: f64,
    lc_end: LaneChangeEnd,
}

impl<'a> LineDistance<'a> {
    fn new(s: &'a [f64], lane_width_m: f64, frame_rate_hz: f64, options: &LateralOptions) -> Self {
        let window = window_samples(options.window_s, frame_rate_hz);
        LineDistance {
            s,
            window_min: trailing_min(s, window),
            window,
            reach: samples(options.search_s, frame_rate_hz),
            quiescent_gap_m: options.quiescent_speed_mps * options.window_s,
            far_m: options.far_share * lane_width_m,
            near_m: options.near_share * lane_width_m,
            lc_end: options.lc_end,
        }
    }

    /// Whether progress over the window that ends at `k` is small. False for an incomplete window.
    fn is_calm(&self, k: usize) -> bool {
        k >= self.window && k < self.s.len() && self.s[k] - self.window_min[k] < self.quiescent_gap_m - TOLERANCE
    }

    /// Last sample before the crossing `k` at which the change had not begun.
    fn start(&self, k: usize, free_from: usize) -> Option<usize> {
        let first = free_from.max(k.saturating_sub(self.reach));
        (first..k)
            .rev()
            .find(|&j| self.s[j] < -self.far_m - TOLERANCE || (self.is_calm(j) && self.s[j] < -self.near_m - TOLERANCE))
    }

    /// First sample after the crossing `k` at which the change is over.
    fn end(&self, k: usize) -> Option<usize> {
        let last = (k + self.reach).min(self.s.len() - 1);
        (k + 1..=last).find(|&j| {
            let judged = match self.lc_end {
                LaneChangeEnd::Published => j + self.window,
                LaneChangeEnd::Observed => j,
            };
            self.s[j] > self.far_m + TOLERANCE || (self.is_calm(judged) && self.s[j] > self.near_m + TOLERANCE)
        })
    }
}
