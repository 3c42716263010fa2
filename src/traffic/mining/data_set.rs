//! The ego-centric data set: one ego, the part of its track in the data set, the vehicles in range, and the leader.
//! Its extent is that of [`EgoViewOptions`](crate::traffic::trajectory::EgoViewOptions); neighbours come from the frame index.

use super::frame_index::FrameIndex;
use super::options::{MiningOptions, TOLERANCE};
use super::tags::{Activities, Tags};
use crate::traffic::trajectory::{Carriageway, NO_LANE, Recording, Track};

/// A recording with its activities and neighbours, which are computed once.
pub(super) struct RecordingTags<'a> {
    pub recording: &'a Recording,
    pub options: &'a MiningOptions,
    /// Activities of every track, in the recording's order.
    pub activities: Vec<Activities>,
    /// Neighbours on every carriageway.
    pub neighbours: Vec<FrameIndex>,
}

impl<'a> RecordingTags<'a> {
    pub fn new(recording: &'a Recording, options: &'a MiningOptions) -> Self {
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
    pub fn new(recording_tags: &'a RecordingTags<'a>, ego_index: usize) -> Option<Self> {
        let ego = &recording_tags.recording.tracks[ego_index];
        let samples = recording_tags.options.ego_view.last_sample(ego)? + 1;
        let carriageway = &recording_tags.recording.carriageways[ego.carriageway];
        let mut set = DataSet { recording_tags, ego_index, ego, carriageway, samples, leader: Vec::new() };
        set.leader = (0..samples).map(|k| set.leader_at(k)).collect();
        Some(set)
    }

    /// All vehicles that lead at some sample, in the order of their first leading sample.
    pub fn leaders(&self) -> Vec<usize> {
        let mut leaders: Vec<usize> = Vec::new();
        let mut last = None;
        for leader in self.leader.iter().flatten().map(|&l| l as usize) {
            if last != Some(leader) && !leaders.contains(&leader) {
                leaders.push(leader);
            }
            last = Some(leader);
        }
        leaders
    }

    /// The vehicle with track `other` is within range (along the road, centre to centre) at the ego's sample `k`, the other's sample
    /// `j`.
    pub fn in_range(&self, k: usize, other: &Track, j: usize) -> bool {
        (other.s_m[j] - self.ego.s_m[k]).abs() <= self.recording_tags.options.ego_view.range_m + TOLERANCE
    }

    /// The lateral position `d_m` is in `lane`.
    pub fn in_lane(&self, lane: u16, d_m: f64) -> bool {
        self.carriageway
            .lane(usize::from(lane))
            .is_some_and(|lane| lane.left_m - d_m >= -TOLERANCE && lane.right_m - d_m <= TOLERANCE)
    }

    /// Gap from the ego to `other`, bumper to bumper, m, at the ego's sample `k` and the other's `j`.
    pub fn gap_m(&self, k: usize, other: &Track, j: usize) -> f64 {
        other.s_m[j] - self.ego.s_m[k] - 0.5 * (self.ego.length_m + other.length_m)
    }

    /// Vehicles ahead of `s_m` in the ego's lane and in range at the ego's sample `k`, nearest first:
    /// index of the track, its sample.
    pub fn ahead_in_lane(&self, k: usize, s_m: f64) -> impl Iterator<Item = (usize, usize)> {
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

    /// Leader: in front, same lane, gap of at most the leader's THW, nearest of those.
    fn leader_at(&self, k: usize) -> Option<u32> {
        let options = self.recording_tags.options;
        let reach = options.leader_max_thw_s * self.ego.v_s_mps[k] + TOLERANCE;
        self.ahead_in_lane(k, self.ego.s_m[k])
            .find(|&(track, j)| self.gap_m(k, &self.recording_tags.recording.tracks[track], j) <= reach)
            .map(|(track, _)| track as u32)
    }

    /// The tags of the ego and the target with index `target`, where the target is in the data set.
    pub fn stretches(&self, target_index: usize) -> Vec<Stretch> {
        let target = &self.recording_tags.recording.tracks[target_index];
        let offset = self.ego.first_frame - target.first_frame; // target's sample = ego's sample + offset
        let first = (-offset).max(0);
        let end = (target.len() as i64 - offset).min(self.samples as i64);
        let mut stretches: Vec<Stretch> = Vec::new();
        let mut open = false;
        for k in first..end {
            let (k, j) = (k as usize, (k + offset) as usize);
            if !self.in_range(k, target, j) {
                open = false;
                continue;
            }
            if !open {
                stretches.push(Stretch { first: k, tags: Vec::new() });
                open = true;
            }
            if let Some(stretch) = stretches.last_mut() {
                stretch.tags.push(self.tags(k, target_index, j));
            }
        }
        stretches
    }

    fn tags(&self, k: usize, target_index: usize, j: usize) -> Tags {
        let lane = self.ego.lane[k];
        let (ego, target) =
            (&self.recording_tags.activities[self.ego_index], &self.recording_tags.activities[target_index]);
        let change = target.lane_change(lane, j).map(|c| c.kind.is_in());
        let decelerates = target.longitudinal_at(j) == Some(super::longitudinal::Longitudinal::Decelerating);
        Tags::default()
            .with(Tags::LEADER, self.leader[k] == Some(target_index as u32))
            .with(Tags::CHANGES_IN, change == Some(true))
            .with(Tags::CHANGES_OUT, change == Some(false))
            .with(Tags::DECELERATES, decelerates)
            .with(Tags::EGO_KEEPS_LANE, lane != NO_LANE && ego.lane_change(lane, k).is_none())
    }
}
