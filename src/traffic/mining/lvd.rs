//! LVD, leading vehicle decelerates: one item, the leader decelerates. The ego may change lanes, and there is no
//! pause between two matches.
//!
//! The interval of the tags is trimmed to the first maximum and the first minimum of the leader's speed, so that it
//! contains exactly the loss of speed.

use super::data_set::{DataSet, FoundScenario};
use super::options::{LvdOptions, TOLERANCE};
use super::tags::{Item, Match, Tags};
use lanesweep_model::scenario::{Category, Scenario, Side};

/// The items, in order.
pub const ITEMS: [Item<'static, Tags>; 1] = [&|t: &Tags| t.leader && t.decelerates];

/// The scenario of one match, with the verdict of the filter; `None` if too little is left after trimming. `first` is
/// the ego's sample of the first tags of the match's stretch.
pub(super) fn scenario(set: &DataSet, target_index: usize, matched: &Match, first: usize) -> Option<Scenario> {
    let target = &set.recording_tags.recording.tracks[target_index];
    let options = set.recording_tags.options;
    let offset = set.ego.first_frame - target.first_frame;
    let v = |k: usize| target.v_s_mps[(k as i64 + offset) as usize];
    let tagged = matched.last_item();
    let (mut start, mut end) = (first + tagged.start, first + tagged.start);
    for k in first + tagged.start..first + tagged.end {
        if v(k) > v(start) {
            start = k;
        }
        if v(k) < v(end) {
            end = k;
        }
    }
    let duration_s = (end as f64 - start as f64) / set.recording_tags.recording.frame_rate_hz;
    if end <= start || duration_s < options.lvd.min_duration_s - TOLERANCE {
        return None;
    }
    let found = FoundScenario { set, target, category: Category::Lvd, start, end };
    let d_m = target.d_m[found.sample_of(target, start)?];
    let side = if d_m < found.lane()?.centre_m() - TOLERANCE { Side::Right } else { Side::Left };
    let mut scenario = found.scenario(side)?;
    scenario.tag_frames = Some([found.frame(first + tagged.start), found.frame(first + tagged.end)]);
    (scenario.kept, scenario.reason) = verdict(&scenario, &options.lvd);
    Some(scenario)
}

/// The filter of the paper, over the trimmed interval.
pub(super) fn verdict(scenario: &Scenario, options: &LvdOptions) -> (bool, String) {
    let limit = options.min_peak_deceleration_mps2;
    let of_speeds =
        || scenario.target.v.windows(2).map(|v| (v[0] - v[1]) * scenario.fps).fold(f64::NEG_INFINITY, f64::max);
    match scenario.peak_decel.unwrap_or_else(of_speeds) > limit + TOLERANCE {
        true => (true, format!("peak deceleration > {limit}")),
        false => (false, format!("peak deceleration <= {limit}")),
    }
}
