//! Cut-out: the leader leaves the ego's lane and uncovers a slower vehicle (the mirror of
//! the cut-in).
//!
//! | item | target | ego |
//! |---|---|---|
//! | 1 | changes out of the ego's lane (`lo`, `ro`), is the leader | keeps its lane |
//! | 2 | changes out of the ego's lane, is not the leader | keeps its lane |
//!
//! That is *found*. A cut-out is *kept* if the nearest vehicle ahead of the target in the ego's lane at t = 0 stays
//! in that lane and in range until the end, and is slower than the ego at t = 0.

use super::cut_in::with_lane_change;
use super::data_set::{DataSet, FoundScenario, Stretch, gap_m, micrometres};
use super::options::{CutOutOptions, TOLERANCE};
use super::tags::{Item, Match, Tags};
use crate::trajectory::Track;
use lanesweep_model::scenario::{Category, Scenario};

/// The items, in order.
pub(super) const ITEMS: [Item<'static, Tags>; 2] =
    [&|t: &Tags| t.changes_out && t.ego_keeps_lane && t.leader, &|t: &Tags| {
        t.changes_out && t.ego_keeps_lane && !t.leader
    }];

/// The scenario of one match, with the verdict of the filters.
pub(super) fn scenario(set: &DataSet, target_index: usize, matched: &Match, stretch: &Stretch) -> Option<Scenario> {
    let (found, mut scenario) = with_lane_change(set, Category::CutOut, target_index, matched, stretch)?;
    match uncovered(&found) {
        Ok(lead) => {
            let target = found.target;
            let (j, l) = (found.sample_of(target, found.start)?, found.sample_of(lead, found.start)?);
            scenario.lead_id = Some(lead.id);
            scenario.lead = Some(found.other(lead, scenario.side)?);
            scenario.lead_gap = Some(micrometres(gap_m((target, j), (lead, l))));
            (scenario.kept, scenario.reason) = verdict(&scenario, &set.recording_tags.options.cut_out);
        }
        Err(reason) => scenario.reason = reason.to_owned(),
    }
    Some(scenario)
}

/// The nearest vehicle ahead of the target in the ego's lane at t = 0, if it stays there and in range to the end;
/// otherwise the reason.
fn uncovered<'a>(found: &FoundScenario<'a>) -> Result<&'a Track, &'static str> {
    let set: &'a DataSet<'a> = found.set;
    let nobody = "no vehicle ahead of the target in the ego's lane";
    let j = found.sample_of(found.target, found.start).ok_or(nobody)?;
    let lane = set.ego.lane[found.start];
    let tracks = &set.recording_tags.recording.tracks;
    let mut ahead = set.ahead_in_lane(found.start, found.target.s_m[j]);
    let is_ahead = |at: &(usize, usize)| gap_m((found.target, j), (&tracks[at.0], at.1)) >= -TOLERANCE;
    let lead = &tracks[ahead.find(is_ahead).ok_or(nobody)?.0];
    let stays = (found.start..=found.end)
        .all(|k| found.sample_of(lead, k).is_some_and(|l| set.in_lane(lane, lead.d_m[l]) && set.in_range(k, lead, l)));
    if stays { Ok(lead) } else { Err("vehicle ahead does not stay in the lane and in range") }
}

/// The filter of the paper, at t = 0.
pub(super) fn verdict(scenario: &Scenario, options: &CutOutOptions) -> (bool, String) {
    let Some(lead) = &scenario.lead else { return (false, scenario.reason.clone()) };
    let slower = lead.v[0] < scenario.ego.v0 - TOLERANCE;
    match (slower, options.require_slower_lead) {
        (true, _) => (true, "lead slower than ego".to_owned()),
        (false, false) => (true, "lead stays ahead".to_owned()),
        (false, true) => (false, "lead not slower than ego".to_owned()),
    }
}
