//! The search in a recording: every vehicle once as ego, every category, every target that leads it.

use super::data_set::{DataSet, RecordingTags, Stretch};
use super::options::{MiningOptions, TOLERANCE, samples};
use super::tags::{Item, Match, Tags};
use super::{cut_in, cut_out, lvd, tags};
use crate::trajectory::Recording;
use lanesweep_model::scenario::Scenario;

/// Scenarios of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mined {
    /// Every scenario found, kept or not, ascending by (ego, category, first frame, target).
    pub scenarios: Vec<Scenario>,
    /// Number of ego-centric data sets: vehicles that travel at least the end cut.
    pub data_sets: u64,
}

/// Number of found and of kept scenarios of a category.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct CategoryCount {
    /// Found.
    pub found: u64,
    /// Kept by the paper's filters.
    pub kept: u64,
}

/// Finds every cut-in, cut-out and leader deceleration of a recording. The result
/// depends on the recording and the options only.
pub fn mine(recording: &Recording, options: &MiningOptions) -> Mined {
    let recording_tags = RecordingTags::new(recording, options);
    let mut mined = Mined::default();
    for ego_index in 0..recording.tracks.len() {
        let Some(set) = DataSet::new(&recording_tags, ego_index) else { continue };
        mined.data_sets += 1;
        for target_index in set.leaders() {
            mine_pair(&set, target_index, &mut mined.scenarios);
        }
    }
    mined.scenarios.sort_by_key(|s| (s.ego_id, s.category, s.frame0, s.target_id));
    mined
}

/// All scenarios of one ego with one target. In every category the target leads at some time, so other targets are
/// skipped.
fn mine_pair(set: &DataSet, target_index: usize, scenarios: &mut Vec<Scenario>) {
    let activities = &set.recording_tags.activities[target_index];
    if !activities.decelerates() && !activities.changes_lane() {
        return;
    }
    let options = set.recording_tags.options;
    let rate = set.recording_tags.recording.frame_rate_hz;
    let stretches = set.stretches(target_index);
    if activities.changes_lane() {
        let shorter = |min_s: f64| move |m: &Match| (m.len() as f64 / rate) < min_s - TOLERANCE;
        let discarded = shorter(options.cut_in.min_duration_s);
        each_match(&stretches, &cut_in::ITEMS, samples(options.cut_in.pause_s, rate), discarded, |stretch, m| {
            scenarios.extend(cut_in::scenario(set, target_index, m, stretch));
        });
        let discarded = shorter(options.cut_out.min_duration_s);
        each_match(&stretches, &cut_out::ITEMS, samples(options.cut_out.pause_s, rate), discarded, |stretch, m| {
            scenarios.extend(cut_out::scenario(set, target_index, m, stretch));
        });
    }
    if activities.decelerates() {
        let discarded = |m: &Match| m.last_item().len() as f64 / rate <= options.lvd.max_discarded_s + TOLERANCE;
        each_match(&stretches, &lvd::ITEMS, 0, discarded, |stretch, m| {
            scenarios.extend(lvd::scenario(set, target_index, m, stretch.first));
        });
    }
}

/// Calls `take` for every match that is not discarded, and continues `pause` samples after its end. After a discarded
/// match the search continues at its end.
fn each_match(
    stretches: &[Stretch],
    items: &[Item<Tags>],
    pause: usize,
    discarded: impl Fn(&Match) -> bool,
    mut take: impl FnMut(&Stretch, &Match),
) {
    let mut from: usize = 0; // the ego's sample
    for stretch in stretches {
        while let Some(matched) = tags::find_match(&stretch.tags, items, from.saturating_sub(stretch.first)) {
            from = stretch.first + matched.last_item().end;
            if !discarded(&matched) {
                from = from.max(stretch.first + matched.end + pause);
                take(stretch, &matched);
            }
        }
    }
}
