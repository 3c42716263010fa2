//! The ego-centric data set: one ego, the part of its track in the data set, the vehicles in range, and the leader.
//! Its extent is that of [`EgoViewOptions`](crate::trajectory::EgoViewOptions).
//!
//! [`FoundScenario`] is what all categories take from the tracks of a match.

use super::longitudinal::Longitudinal;
use super::options::{MiningOptions, TOLERANCE};
use super::tags::{Activities, Tags};
use crate::trajectory::{Carriageway, FrameIndex, Lane, NO_LANE, Recording, Track};
use lanesweep_model::scenario::{Category, Ego, Other, Scenario, Side, mined_id};

/// A recording with its activities and neighbours, which are computed once.
pub(super) struct RecordingTags<'a> {
    pub recording: &'a Recording,
    pub options: &'a MiningOptions,
    /// Activities of every track, in the recording's order.
    pub activities: Vec<Activities>,
    /// Neighbours on every carriageway.
    neighbours: Vec<FrameIndex>,
}

impl<'a> RecordingTags<'a> {
    pub(super) fn new(recording: &'a Recording, options: &'a MiningOptions) -> Self {
        let activities = recording
            .tracks
            .iter()
            .map(|t| Activities::of(t, &recording.carriageways[t.carriageway], recording.frame_rate_hz, options))
            .collect();
        let neighbours = (0..recording.carriageways.len()).map(|c| FrameIndex::new(recording, c)).collect();
        RecordingTags { recording, options, activities, neighbours }
    }
}

/// The data set of one ego.
pub(super) struct DataSet<'a> {
    pub recording_tags: &'a RecordingTags<'a>,
    /// Index of the ego's track.
    pub ego_index: usize,
    pub ego: &'a Track,
    pub carriageway: &'a Carriageway,
    /// Number of the ego's samples that have tags, from its first.
    pub samples: usize,
    /// Index of the leader's track at each of them.
    leader: Vec<Option<u32>>,
}

/// Consecutive samples at which a target is in the data set, with the tags of ego and target.
pub(super) struct Stretch {
    /// The ego's sample of the first.
    pub first: usize,
    pub tags: Vec<Tags>,
}

impl<'a> DataSet<'a> {
    /// The data set of the track with index `ego_index`; `None` if the vehicle travels less than the end cut.
    pub(super) fn new(recording_tags: &'a RecordingTags<'a>, ego_index: usize) -> Option<Self> {
        let ego = &recording_tags.recording.tracks[ego_index];
        let samples = recording_tags.options.ego_view.last_sample(ego)? + 1;
        let carriageway = &recording_tags.recording.carriageways[ego.carriageway];
        let mut set = DataSet { recording_tags, ego_index, ego, carriageway, samples, leader: Vec::new() };
        let leader = (0..samples).scan(None, |last, k| {
            *last = set.leader_at(k, *last);
            Some(*last)
        });
        set.leader = leader.collect();
        Some(set)
    }

    /// All vehicles that lead at some sample, in the order of their first leading sample.
    pub(super) fn leaders(&self) -> Vec<usize> {
        let mut leaders: Vec<usize> = Vec::new();
        for leader in self.leader.iter().flatten().map(|&l| l as usize) {
            if !leaders.contains(&leader) {
                leaders.push(leader);
            }
        }
        leaders
    }

    /// The vehicle with track `other` is within range (along the road, centre to centre) at the ego's sample `k`, the other's sample
    /// `j`.
    pub(super) fn in_range(&self, k: usize, other: &Track, j: usize) -> bool {
        (other.s_m[j] - self.ego.s_m[k]).abs() <= self.recording_tags.options.ego_view.range_m + TOLERANCE
    }

    /// The lateral position `d_m` is in `lane`.
    pub(super) fn in_lane(&self, lane: u16, d_m: f64) -> bool {
        self.carriageway
            .lane(usize::from(lane))
            .is_some_and(|lane| lane.left_m - d_m >= -TOLERANCE && lane.right_m - d_m <= TOLERANCE)
    }

    /// Vehicles ahead of `s_m` in the ego's lane and in range at the ego's sample `k`, nearest first:
    /// index of the track, its sample.
    pub(super) fn ahead_in_lane(&self, k: usize, s_m: f64) -> impl Iterator<Item = (usize, usize)> {
        let options = self.recording_tags.options;
        let lane = self.ego.lane[k];
        let horizon = self.ego.s_m[k] + options.ego_view.range_m + TOLERANCE;
        self.recording_tags.neighbours[self.ego.carriageway]
            .ahead(self.ego_index, k, s_m + TOLERANCE, horizon)
            .map(|n| (n.track as usize, n.sample as usize))
            .filter(move |&(track, sample)| {
                let other = &self.recording_tags.recording.tracks[track];
                lane != NO_LANE && self.in_lane(lane, other.d_m[sample]) && self.in_range(k, other, sample)
            })
    }

    /// Leader: in front, same lane, gap of at most the leader's THW, nearest of those. A vehicle beside the ego does not become
    /// one; `last` stays it, because boxes that are a little too long touch in a queue.
    fn leader_at(&self, k: usize, last: Option<u32>) -> Option<u32> {
        let options = self.recording_tags.options;
        let reach = options.leader_max_thw_s * self.ego.v_s_mps[k] + TOLERANCE;
        let leads = |track: u32, gap_m: f64| gap_m <= reach && (gap_m >= -TOLERANCE || last == Some(track));
        let tracks = &self.recording_tags.recording.tracks;
        let mut ahead = self.ahead_in_lane(k, self.ego.s_m[k]);
        ahead.find(|&(at, j)| leads(at as u32, gap_m((self.ego, k), (&tracks[at], j)))).map(|(at, _)| at as u32)
    }

    /// The tags of the ego and the target with index `target`, where the target is in the data set.
    pub(super) fn stretches(&self, target_index: usize) -> Vec<Stretch> {
        let target = &self.recording_tags.recording.tracks[target_index];
        let offset = self.ego.first_frame - target.first_frame; // target's sample = ego's sample + offset
        let first = (-offset).max(0);
        let end = (target.len() as i64 - offset).min(self.samples as i64);
        let mut stretches: Vec<Stretch> = Vec::new();
        for (k, j) in (first..end).map(|k| (k as usize, (k + offset) as usize)) {
            if self.in_range(k, target, j) {
                let tags = self.tags(k, target_index, j);
                match stretches.last_mut() {
                    Some(open) if open.first + open.tags.len() == k => open.tags.push(tags),
                    _ => stretches.push(Stretch { first: k, tags: vec![tags] }),
                }
            }
        }
        stretches
    }

    fn tags(&self, k: usize, target_index: usize, j: usize) -> Tags {
        let lane = self.ego.lane[k];
        let (ego, target) =
            (&self.recording_tags.activities[self.ego_index], &self.recording_tags.activities[target_index]);
        let change = target.lane_change(lane, j).map(|c| c.kind.is_in());
        Tags {
            leader: self.leader[k] == Some(target_index as u32),
            changes_in: change == Some(true),
            changes_out: change == Some(false),
            decelerates: target.longitudinal_at(j) == Some(Longitudinal::Decelerating),
            ego_keeps_lane: lane != NO_LANE && ego.lane_change(lane, k).is_none(),
        }
    }
}

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
    pub(super) fn sample_of(&self, other: &Track, k: usize) -> Option<usize> {
        other.index_of(self.frame(k))
    }

    /// Frame of the ego's sample `k`.
    pub(super) fn frame(&self, k: usize) -> i64 {
        self.set.ego.first_frame + k as i64
    }

    /// The ego's lane at t = 0. All series refer to it, so they have no jump if the ego changes lanes (possible in an
    /// LVD only).
    pub(super) fn lane(&self) -> Option<Lane> {
        self.set.carriageway.lane(usize::from(self.set.ego.lane[self.start]))
    }

    /// The scenario with `y > 0` on `side`, not kept, without what only some categories have. `None` if the target is
    /// not always in view or the ego is in no lane, which cannot occur in a match.
    pub(super) fn scenario(&self, side: Side) -> Option<Scenario> {
        let DataSet { ego, recording_tags, .. } = self.set;
        let lane = self.lane()?;
        let (first, last) = (self.sample_of(self.target, self.start)?, self.sample_of(self.target, self.end)?);
        let v0 = speed(ego.v_s_mps[self.start]);
        let gap0 = micrometres(gap_m((ego, self.start), (self.target, first)));
        // A vehicle that was the leader and is beside the ego now is no start of a case.
        if self.category != Category::CutIn && gap0 < 0.0 {
            return None;
        }
        let frame0 = self.frame(self.start);
        let recording = &recording_tags.recording.id;
        Some(Scenario {
            id: mined_id(recording, self.category, &ego.id, &self.target.id, frame0),
            category: self.category,
            recording: recording.clone(),
            ego_id: ego.id,
            target_id: self.target.id,
            frame0,
            frame1: self.frame(self.end),
            fps: recording_tags.recording.frame_rate_hz,
            ego: Ego { v0, length: ego.length_m, width: ego.width_m },
            lane_width: micrometres(lane.width_m()),
            side,
            target: self.other(self.target, side)?,
            thw0: (v0 > 0.0).then(|| gap0 / v0),
            gap0: Some(gap0),
            // Negative where the vehicle accelerates throughout.
            peak_decel: Some(
                self.target.a_s_mps2[first..=last].iter().map(|a| -a).fold(f64::NEG_INFINITY, f64::max) + 0.0,
            ),
            synthetic: recording_tags.recording.synthetic,
            ..Scenario::default()
        })
    }

    /// Sizes and series of another vehicle, `y > 0` on `side`; `None` if it is not always in view.
    pub(super) fn other(&self, other: &Track, side: Side) -> Option<Other> {
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

/// Gap from a vehicle at its sample to another one ahead at its own, bumper to bumper, m.
pub(super) fn gap_m((behind, k): (&Track, usize), (ahead, j): (&Track, usize)) -> f64 {
    ahead.s_m[j] - behind.s_m[k] - 0.5 * (behind.length_m + ahead.length_m)
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
