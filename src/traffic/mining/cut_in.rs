//! Cut-in: another vehicle changes into the ego's lane and becomes its leader.
//!
//! | item | target | ego |
//! |---|---|---|
//! | 1 | changes into the ego's lane (`li`, `ri`), is not the leader | keeps its lane |
//! | 2 | changes into the ego's lane, is the leader | keeps its lane |
//!
//! t = 0 is the first sample of item 1 inside the data set; the end is the first of: end of the lane
//! change, target no longer leader, ego no longer keeps its lane, end of the data.

use super::data_set::{DataSet, FoundScenario};
use super::lateral::LaneChangeKind;
use super::options::{CutInOptions, TOLERANCE};
use super::tags::{Item, Match, Tags};
use crate::scenario::{Category, Scenario, Side};
use crate::traffic::trajectory::Track;

/// The items, in order.
pub const ITEMS: [Item<'static, Tags>; 2] =
    [&|t: &Tags| t.has(Tags::CHANGES_IN | Tags::EGO_KEEPS_LANE) && !t.has(Tags::LEADER), &|t: &Tags| {
        t.has(Tags::CHANGES_IN | Tags::EGO_KEEPS_LANE | Tags::LEADER)
    }];

/// The scenario of one match, with the verdict of the filters. `tags` are those of the match's stretch,
/// `first` the ego's sample of the first of them.
pub(super) fn scenario(
    set: &DataSet,
    target_index: usize,
    matched: &Match,
    first: usize,
    tags: &[Tags],
) -> Option<Scenario> {
    let target = &set.recording_tags.recording.tracks[target_index];
    let (start, end) = (first + matched.start(), first + matched.end);
    let found = FoundScenario { set, target, category: Category::CutIn, start, end };
    let change = lane_change_of(&found, target_index)?;
    let side = match change.kind {
        LaneChangeKind::RightIn | LaneChangeKind::LeftOut => Side::Left,
        LaneChangeKind::LeftIn | LaneChangeKind::RightOut => Side::Right,
    };
    let mut scenario = found.scenario(side)?;
    (scenario.kept, scenario.reason) = verdict(&scenario, &set.recording_tags.options.cut_in);
    describe(&mut scenario, &found, change.start, matched, first, end_cause(tags, matched, Tags::CHANGES_IN, true));
    Some(scenario)
}

/// The filters of the paper at t = 0: the target is slower than the ego and its headway is short.
fn verdict(scenario: &Scenario, options: &CutInOptions) -> (bool, String) {
    let (v_target, v_ego) = (scenario.target.v[0], scenario.ego.v0);
    let slower = v_target < options.max_speed_share * v_ego - TOLERANCE;
    let near = scenario.thw0.is_some_and(|thw| thw < options.max_thw_s - TOLERANCE);
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

/// The target's lane change relative to the ego's lane that is in progress at t = 0.
pub(super) fn lane_change_of<'a>(
    found: &FoundScenario<'a>,
    target_index: usize,
) -> Option<&'a super::lateral::LaneChange> {
    let set: &'a DataSet<'a> = found.set;
    let j = found.sample_of(found.target, found.start)?;
    set.recording_tags.activities[target_index].lane_change(set.ego.lane[found.start], j)
}

/// Sets the origin fields common to cut-in and cut-out.
pub(super) fn describe(
    scenario: &mut Scenario,
    found: &FoundScenario,
    change_start: usize,
    matched: &Match,
    first: usize,
    end_cause: &str,
) {
    let target: &Track = found.target;
    scenario.truncated_start = Some(target.first_frame + (change_start as i64) < scenario.frame0);
    scenario.frame_switch = Some(found.frame(first + matched.starts[1]));
    scenario.end_cause = Some(end_cause.to_owned());
}

/// The event that ended a match. `change` is the lane change's tag; `leads`: the target leads in the last item.
pub(super) fn end_cause(tags: &[Tags], matched: &Match, change: Tags, leads: bool) -> &'static str {
    let at_end = tags[matched.end];
    if matched.clamped {
        "data_end"
    } else if !at_end.has(change) {
        "lc_end"
    } else if at_end.has(Tags::LEADER) != leads {
        "leader"
    } else {
        "ego_lane"
    }
}
