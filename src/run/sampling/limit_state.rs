//! One number per lane that is ≤ 0 exactly where a criterion failed, and shrinks on the way there.

use crate::engine::Outcome;
use crate::model::criterion::Criterion;
use crate::model::profile::Profile;

/// Far from any failure: nothing ever closed in.
const FAR: f64 = 1e3;
/// No demand counts for more: an infinite Brake Threat Number says only that no braking helps.
pub(super) const MAX_BTN: f64 = 10.0;
/// Values that rounding would put on the wrong side stand this close to the limit.
const MIN_UNFAILED: f64 = 1e-12;

/// Limit state of a lane. The verdict decides the sign, as the lane itself decides it.
///
/// | criterion | before failure | after |
/// |---|---|---|
/// | collision | smallest TTC, s | −(closing speed at the contact), m/s |
/// | TTC | smallest TTC − threshold, s | the same |
/// | BTN | threshold − largest BTN | the same, −(10 − threshold) at least |
///
/// The smallest TTC of a near miss goes to 0 with the gap that was left (braking ends √(2·gap/deceleration) before
/// it), and the closing speed of a contact goes to 0 towards the near miss: the value is continuous through the
/// collision. A contact by the side of a vehicle that is passed is not.
pub fn limit_state(profile: &Profile, criterion: Criterion, outcome: &Outcome<f64>) -> f64 {
    let failed = outcome.verdicts.failed(criterion);
    let ttc = outcome.min_ttc.min(FAR);
    let value = match criterion {
        Criterion::Collision if failed => -outcome.impact_closing_speed.abs(),
        Criterion::Collision => ttc,
        Criterion::Ttc => ttc - profile.criteria.ttc_threshold_s,
        Criterion::Btn => profile.criteria.btn_threshold - outcome.max_btn.min(MAX_BTN),
    };
    if failed { value.min(0.0) } else { value.max(MIN_UNFAILED) }
}
