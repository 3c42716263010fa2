//! Which lanes may still be among the worst, once some samples are known: only these are valued.

use std::ops::Range;

use super::limit_state::MAX_BTN;
use super::sample_options::SampleOptions;
use super::tally::SampleTally;
use crate::engine::{LanePlan, Marks, Wanted, Watch};
use crate::model::criterion::Criterion;
use crate::model::profile::Profile;

/// The first samples are valued whole.
const FIRST_SAMPLES: u64 = 4096;
/// Where more lanes than one in so many would be marked, all are valued: a single lane costs about forty times its
/// verdicts.
const MARKED_ONE_IN: f64 = 1000.0;

/// Ends of pieces of an interval of samples. Each is as long as all before it, so that a list of worst lanes finds as many
/// new lanes in one piece as in the next.
pub(super) fn ends(range: &Range<u64>) -> impl Iterator<Item = u64> {
    let (first, end) = (range.start, range.end);
    std::iter::successors(Some(FIRST_SAMPLES), |length| length.checked_mul(2))
        .map(move |length| first.saturating_add(length))
        .take_while(move |to| *to < end)
}

/// What the lanes of further samples must return, so that the lists of worst lanes become what they would be with all
/// values. `options.worst` is at least 1, and the lanes of `tally` have smaller indices.
pub(super) fn wanted(plan: &LanePlan, tally: &SampleTally, options: &SampleOptions) -> Wanted {
    let (mut watch, mut marked) = (Watch::NOTHING, 0.0);
    let lanes_per_model = (tally.valid() * plan.headways.len() as u64).max(1) as f64;
    for (at, model) in plan.models.iter().enumerate() {
        let last = tally.worst[at].get(options.worst - 1);
        let marks = last.and_then(|last| marks_of(&plan.profile, options.criterion, last.value));
        let Some((of_model, failures_of)) = marks else { return Wanted::Outcomes };
        watch.0[model.index()] = of_model;
        if let Some(criterion) = failures_of {
            let cells = tally.failures.chunks(Criterion::ALL.len()).skip(at).step_by(plan.models.len());
            let failures: u64 = cells.map(|cell| cell[criterion.index()]).sum();
            marked += failures as f64 / lanes_per_model / plan.models.len() as f64;
        }
    }
    if marked * MARKED_ONE_IN > 1.0 { Wanted::Outcomes } else { Wanted::Watched(watch) }
}

/// The marks of lanes with a smaller [limit state](super::limit_state()) than the last of a list, and the criterion whose
/// failures all have them, where one's do; the few that enter the list have them in any case. `None` where every lane's
/// value is needed.
pub(crate) fn marks_of(profile: &Profile, criterion: Criterion, last: f64) -> Option<(Marks, Option<Criterion>)> {
    let criteria = &profile.criteria;
    let below = |ttc_s: f64| {
        let is_rare = ttc_s > criteria.ttc_threshold_s;
        (Marks::TtcBelow(ttc_s.max(criteria.ttc_threshold_s)), (!is_rare).then_some(Criterion::Ttc))
    };
    match criterion {
        Criterion::Collision if last <= 0.0 => Some((Marks::Contacts(-last), None)),
        Criterion::Collision => Some(below(last)),
        // No value is smaller, and of equal ones the first lane is worse.
        Criterion::Ttc if last <= -criteria.ttc_threshold_s => Some((Marks::Nothing, None)),
        Criterion::Btn if last <= criteria.btn_threshold - MAX_BTN => Some((Marks::Nothing, None)),
        Criterion::Ttc => Some(below(last + criteria.ttc_threshold_s)),
        Criterion::Btn if last <= 0.0 => Some((Marks::BtnFailures, Some(Criterion::Btn))),
        Criterion::Btn => None,
    }
}
