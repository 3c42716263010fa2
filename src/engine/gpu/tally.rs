//! What the counting kernel is told of a plan.

use super::ring::TallyJob;
use crate::engine::{CLOSE_HEADWAY_S, CountLayout, Counting, Headway, LanePlan, Marks, Watch};
use crate::model::driver::ModelId;

/// Maximum number of samples of a counted job, so that no count of it overflows.
pub(super) const MAX_COUNTED: u64 = 1 << 25;

/// Maximum number of counts of a job.
const MAX_COUNTS: usize = 1 << 20;

/// The counting of a plan, if a device can do it: few enough counts for a workgroup, and a bit for each headway.
pub(super) fn counter(plan: &LanePlan, counting: &Counting) -> Option<(CountLayout, TallyJob)> {
    let layout = CountLayout::new(plan, counting);
    let fits = plan.generator().is_some()
        && plan.blocks.len() == 1
        && plan.headways.len() < 32
        && layout.of_every_sample() <= CountLayout::GATHERED
        && layout.total() <= MAX_COUNTS;
    let [close_headways, drawn_headways] = close_headways(&plan.headways[..plan.headways.len().min(31)]);
    let constants = layout.shader_constants(counting.criterion);
    let tally = TallyJob { constants, counts: layout.total(), close_headways, drawn_headways, marks: 0 };
    fits.then_some((layout, tally))
}

/// Bits of the headways of a plan of samples below [`CLOSE_HEADWAY_S`], and of those that the sample draws.
fn close_headways(headways: &[Headway]) -> [u32; 2] {
    let bits = |is: &dyn Fn(&Headway) -> bool| {
        (0..).zip(headways).filter(|(_, headway)| is(headway)).fold(0, |bits, (at, _)| bits | 1 << at)
    };
    let fixed = |headway: &Headway| matches!(headway, Headway::ThwS(_));
    let is_close = |headway: &Headway| matches!(headway, Headway::ThwS(thw_s) if *thw_s < CLOSE_HEADWAY_S);
    [bits(&is_close), bits(&|headway| !fixed(headway))]
}

/// The marks of a plan's models, two bits each: 0 nothing, 1 contacts, 2 TTC, 3 BTN.
pub(super) fn mark_bits(plan: &LanePlan, watch: Option<Watch>) -> u32 {
    let of = |(at, model): (u32, &ModelId)| {
        let code = match watch.map_or(Marks::Nothing, |watch| watch.0[model.index()]) {
            Marks::Nothing => 0,
            Marks::Contacts(_) => 1,
            Marks::TtcBelow(_) => 2,
            Marks::BtnFailures => 3,
        };
        code << (2 * at)
    };
    (0..).zip(&plan.models).map(of).fold(0, |bits, code| bits | code)
}
