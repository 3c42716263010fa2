//! The parts of a [`Scenario`] that all categories take from the tracks of a match.

use super::data_set::DataSet;
use crate::scenario::{Category, Ego, Other, Scenario, Side};
use crate::traffic::trajectory::{Lane, Track};

/// An ego, a target and the interval of a match.
pub(super) struct FoundScenario<'a> {
    pub set: &'a DataSet<'a>,
    pub target: &'a Track,
    pub category: Category,
    /// The ego's sample at t = 0.
    pub start: usize,
    /// The ego's last sample of the series, later than `start`.
    pub end: usize,
}

impl FoundScenario<'_> {
    /// Sample of `other` at the ego's sample `k`; `None` where it is not in view.
    pub fn sample_of(&self, other: &Track, k: usize) -> Option<usize> {
        other.index_of(self.frame(k))
    }

    /// Frame of the ego's sample `k`.
    pub fn frame(&self, k: usize) -> i64 {
        self.set.ego.first_frame + k as i64
    }

    /// The ego's lane at t = 0. All series refer to it, so they have no jump if the ego changes lanes (possible in an
    /// LVD only).
    pub fn lane(&self) -> Option<Lane> {
        self.set.carriageway.lane(usize::from(self.set.ego.lane[self.start]))
    }

    /// The scenario with `y > 0` on `side`, not kept, without what only some categories have. `None` if the target is
    /// not always in view or the ego is in no lane, which cannot occur in a match.
    pub fn scenario(&self, side: Side) -> Option<Scenario> {
        let DataSet { ego, recording_tags, .. } = self.set;
        let lane = self.lane()?;
        let (first, last) = (self.sample_of(self.target, self.start)?, self.sample_of(self.target, self.end)?);
        let v0 = speed(ego.v_s_mps[self.start]);
        let gap0 = micrometres(self.set.gap_m(self.start, self.target, first));
        let frame0 = self.frame(self.start);
        let (recording, key) = (&recording_tags.recording.id, self.category.key());
        Some(Scenario {
            id: format!("{recording}_{key}_{}_{}_{frame0}", ego.id, self.target.id),
            category: self.category,
            recording: recording.clone(),
            ego_id: ego.id,
            target_id: self.target.id,
            lead_id: None,
            frame0,
            frame1: self.frame(self.end),
            fps: recording_tags.recording.frame_rate_hz,
            kept: false,
            reason: String::new(),
            ego: Ego { v0, length: ego.length_m, width: ego.width_m },
            lane_width: micrometres(lane.width_m()),
            side,
            target: self.other(self.target, side)?,
            lead: None,
            thw0: (v0 > 0.0).then(|| gap0 / v0),
            gap0: Some(gap0),
            lead_gap: None,
            peak_decel: Some(peak_deceleration(&self.target.a_s_mps2[first..=last])),
            truncated_start: None,
            end_cause: None,
            frame_switch: None,
            tag_frames: None,
            synthetic: recording_tags.recording.synthetic,
        })
    }

    /// Sizes and series of another vehicle, `y > 0` on `side`; `None` if it is not always in view.
    pub fn other(&self, other: &Track, side: Side) -> Option<Other> {
        let centre_m = self.lane()?.centre_m();
        let (first, last) = (self.sample_of(other, self.start)?, self.sample_of(other, self.end)?);
        Some(Other {
            length: other.length_m,
            width: other.width_m,
            v: other.v_s_mps[first..=last].iter().map(|&v| speed(v)).collect(),
            y: other.d_m[first..=last].iter().map(|d| micrometres(side.sign() * (d - centre_m))).collect(),
        })
    }
}

/// A speed of a scenario, ≥ 0: recordings give stationary vehicles a few centimetres per second backwards.
pub(super) fn speed(v_mps: f64) -> f64 {
    if v_mps > 0.0 { v_mps } else { 0.0 }
}

/// A length rounded to 1e-6 m, far below any recording's resolution. Without rounding, a recording rotated by 180°
/// would differ in the last bits.
pub(super) fn micrometres(length_m: f64) -> f64 {
    (length_m * 1e6).round() / 1e6 + 0.0 // + 0.0: no negative zero
}

/// Largest deceleration, m/s²; negative where the vehicle accelerates throughout.
pub(super) fn peak_deceleration(a_mps2: &[f64]) -> f64 {
    a_mps2.iter().fold(f64::NEG_INFINITY, |peak, &a| peak.max(-a)) + 0.0
}
