//! Which lanes may still be among the worst, once some samples are known: only these are valued.

use std::ops::Range;

use super::limit_state::MAX_BTN;
use super::sample_options::SampleOptions;
use super::tally::SampleTally;
use crate::engine::{LanePlan, Marks, Wanted, Watch};
use crate::model::criterion::Criterion;
use crate::model::driver::MODELS;

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
    let mut marks = [Marks::Nothing; MODELS];
    let mut share = 0.0;
    for (at, model) in plan.models.iter().enumerate() {
        let Some((of_model, marked)) = marks_of(plan, tally, options, at) else { return Wanted::Outcomes };
        marks[model.index()] = of_model;
        share += marked / plan.models.len() as f64;
    }
    if share * MARKED_ONE_IN > 1.0 { Wanted::Outcomes } else { Wanted::Watched(Watch(marks)) }
}

/// The marks of one model, and the share of its lanes that have them, apart from the few that enter a list. `None`
/// where every lane's value is needed.
fn marks_of(plan: &LanePlan, tally: &SampleTally, options: &SampleOptions, model: usize) -> Option<(Marks, f64)> {
    let last = tally.worst[model].get(options.worst - 1)?.value;
    let criteria = &plan.profile.criteria;
    let share = |criterion: Criterion| {
        let cells = tally.failures.chunks(Criterion::ALL.len()).skip(model).step_by(plan.models.len());
        let failures: u64 = cells.map(|cell| cell[criterion.index()]).sum();
        failures as f64 / (tally.valid() * plan.headways.len() as u64).max(1) as f64
    };
    let below = |ttc_s: f64| {
        let is_rare = ttc_s > criteria.ttc_threshold_s;
        (Marks::TtcBelow(ttc_s.max(criteria.ttc_threshold_s)), if is_rare { 0.0 } else { share(Criterion::Ttc) })
    };
    match options.criterion {
        Criterion::Collision if last <= 0.0 => Some((Marks::Contacts(-last), 0.0)),
        Criterion::Collision => Some(below(last)),
        // No value is smaller, and of equal ones the first lane is worse.
        Criterion::Ttc if last <= -criteria.ttc_threshold_s => Some((Marks::Nothing, 0.0)),
        Criterion::Btn if last <= criteria.btn_threshold - MAX_BTN => Some((Marks::Nothing, 0.0)),
        Criterion::Ttc => Some(below(last + criteria.ttc_threshold_s)),
        Criterion::Btn if last <= 0.0 => Some((Marks::BtnFailures, share(Criterion::Btn))),
        Criterion::Btn => None,
    }
}
