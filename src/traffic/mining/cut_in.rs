//! Cut-in: another vehicle changes into the ego's lane and becomes its leader.
//!
//! | item | target | ego |
//! |---|---|---|
//! | 1 | changes into the ego's lane (`li`, `ri`), is not the leader | keeps its lane |
//! | 2 | changes into the ego's lane, is the leader | keeps its lane |
//!
//! t = 0 is the first sample of item 1 inside the data set; the end is the first of: end of the lane
//! change, target no longer leader, ego no longer keeps its lane, end of the data.

use super::data_set::{DataSet, FoundScenario, Stretch};
use super::lateral::LaneChangeKind;
use super::options::{CutInOptions, TOLERANCE};
use super::tags::{Item, Match, Tags};
use lanesweep_model::scenario::{Category, Scenario, Side};

/// The items, in order.
pub const ITEMS: [Item<'static, Tags>; 2] = [&|t: &Tags| t.changes_in && t.ego_keeps_lane && !t.leader, &|t: &Tags| {
    t.changes_in && t.ego_keeps_lane && t.leader
}];

/// The scenario of one match, with the verdict of the filters.
pub(super) fn scenario(set: &DataSet, target_index: usize, matched: &Match, stretch: &Stretch) -> Option<Scenario> {
    let (_, mut scenario) = with_lane_change(set, Category::CutIn, target_index, matched, stretch)?;
    (scenario.kept, scenario.reason) = verdict(&scenario, &set.recording_tags.options.cut_in);
    Some(scenario)
}

/// The filters of the paper at t = 0: the target is slower than the ego and its headway is short.
pub(super) fn verdict(scenario: &Scenario, options: &CutInOptions) -> (bool, String) {
    let (v_target, v_ego) = (scenario.target.v[0], scenario.ego.v0);
    let slower = v_target < options.max_speed_share * v_ego - TOLERANCE;
    let thw = scenario.thw0.or_else(|| Some(scenario.start_gap_m().ok()? / v_ego));
    let near = thw.is_some_and(|thw| thw < options.max_thw_s - TOLERANCE);
    let mut reasons = Vec::new();
    if !slower {
        reasons.push(format!("v_c >= {} v_e", options.max_speed_share));
    }
    if !near {
        reasons.push(format!("thw >= {} s", options.max_thw_s));
    }
    match reasons.is_empty() {
        true => (true, "slower and close".to_owned()),
        false => (false, reasons.join("; ")),
    }
}

/// A match with a lane change of the target (cut-in and cut-out), and its scenario, not kept.
pub(super) fn with_lane_change<'a>(
    set: &'a DataSet<'a>,
    category: Category,
    target_index: usize,
    matched: &Match,
    stretch: &Stretch,
) -> Option<(FoundScenario<'a>, Scenario)> {
    let target = &set.recording_tags.recording.tracks[target_index];
    let (start, end) = (stretch.first + matched.start(), stretch.first + matched.end);
    let found = FoundScenario { set, target, category, start, end };
    // Relative to the ego's lane, in progress at t = 0.
    let sample = found.sample_of(target, start)?;
    let change = set.recording_tags.activities[target_index].lane_change(set.ego.lane[start], sample)?;
    let mut scenario = found.scenario(match change.kind {
        LaneChangeKind::RightIn | LaneChangeKind::LeftOut => Side::Left,
        LaneChangeKind::LeftIn | LaneChangeKind::RightOut => Side::Right,
    })?;
    scenario.truncated_start = Some(target.first_frame + (change.start as i64) < scenario.frame0);
    scenario.frame_switch = Some(found.frame(stretch.first + matched.starts[1]));
    scenario.end_cause = Some(end_cause(stretch.tags[matched.end], matched, category).to_owned());
    Some((found, scenario))
}

/// The event that ended a match, from the tags at its end.
fn end_cause(at_end: Tags, matched: &Match, category: Category) -> &'static str {
    // Whether the lane change is in progress, and whether the target leads in the last item.
    let is_cut_in = category == Category::CutIn;
    let (changes, leads) = (if is_cut_in { at_end.changes_in } else { at_end.changes_out }, is_cut_in);
    match (changes, at_end.leader == leads) {
        _ if matched.clamped => "data_end",
        (false, _) => "lc_end",
        (true, false) => "leader",
        (true, true) => "ego_lane",
    }
}
