//! The decision to change lanes: a motive (a rate per second) times the acceptance of the gaps.

use super::idm::DriverParameters;
use super::options::Behaviour;

/// The motive to change to a faster lane increases up to this gain in speed, m/s.
const FULL_GAIN_MPS: f64 = 4.5;
/// Strength of keeping right, as a fraction of the full motive.
const KEEP_RIGHT: f64 = 0.38;
/// Strength of changes without visible reason (exits, habits), as a fraction of the full motive.
const NO_REASON: f64 = 0.08;
/// The same if the change costs much speed (exits only).
const NO_REASON_AT_A_LOSS: f64 = 0.02;
/// Minimum loss of speed that counts as much, m/s.
const GRAVE_LOSS_MPS: f64 = 3.0;
/// Headway to the new follower at which half of the drivers accept, s. Calibrated to the headway of cut-ins: mode
/// 0.8–1.0 s and 4 % below 0.5 s.
const LAG_HALF_S: f64 = 0.48;
/// Drivers take a closing gap at once; above this headway to the follower there is no urgency, s. Calibrated to the
/// mode of the headway of cut-ins.
const HURRY_S: f64 = 1.0;
/// Factor on the acceptance without urgency.
const NO_HURRY: f64 = 0.35;
/// Minimum time to collision with the new neighbours at the start of a change, s.
const MIN_TTC_S: f64 = 2.0;
/// Minimum gap to the new neighbours at the start, m.
const MIN_GAP_M: f64 = 4.0;
/// Maximum braking that a lane change may require of the new follower, m/s².
const MAX_FOLLOWER_BRAKING_MPS2: f64 = 4.0;
/// Headway to the new leader at which half of the drivers accept, s.
const LEAD_HALF_S: f64 = 0.55;
/// Own braking behind the new leader that reduces acceptance by a factor e, m/s².
const LEAD_BRAKING_MPS2: f64 = 0.5;
/// Minimum sum of the gaps ahead and behind, m.
const MIN_ROOM_M: f64 = 15.0;
/// A leader this much farther away than the desired headway has no influence, s.
const LOOK_AHEAD_S: f64 = 2.0;
/// Maximum loss of speed for keeping right, m/s.
const KEEP_RIGHT_LOSS_MPS: f64 = 0.8;
/// Maximum loss of speed for letting a follower pass, m/s.
const YIELDING_LOSS_MPS: f64 = 5.0;
/// Headway below which a follower presses, s.
const PRESSING_S: f64 = 1.5;

/// A vehicle next to the deciding one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Neighbour {
    /// Bumper to bumper, m; negative beside.
    pub gap_m: f64,
    /// Speed of the vehicle, m/s.
    pub speed_mps: f64,
}

/// Next vehicles ahead and behind in one lane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct LaneView {
    /// Ahead.
    pub ahead: Option<Neighbour>,
    /// Behind.
    pub behind: Option<Neighbour>,
}

/// Direction of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// To the faster side.
    Left,
    /// Back to the slower side.
    Right,
}

/// Expected speed in a lane: the desired one on a free road, the leader's close behind it.
fn promised_speed(speed_mps: f64, driver: &DriverParameters, ahead: Option<Neighbour>) -> f64 {
    let desired = driver.desired_speed_mps;
    let Some(leader) = ahead else { return desired };
    if leader.speed_mps >= desired {
        return desired;
    }
    let headway_s = leader.gap_m / speed_mps.max(1.0);
    let freedom = ((headway_s - driver.time_headway_s) / LOOK_AHEAD_S).clamp(0.0, 1.0);
    leader.speed_mps + (desired - leader.speed_mps) * freedom
}

/// The motive, from 0 to slightly above 1; multiplied by the rate of lane changes it is their hazard before the check
/// of the gaps.
pub(super) fn motive(
    way: Way,
    speed_mps: f64,
    driver: &DriverParameters,
    here: LaneView,
    there: Option<Neighbour>,
) -> f64 {
    let gain = promised_speed(speed_mps, driver, there) - promised_speed(speed_mps, driver, here.ahead);
    let pressed = here.behind.is_some_and(|follower| follower.gap_m < PRESSING_S * follower.speed_mps);
    let share = match way {
        Way::Left => (gain / FULL_GAIN_MPS).clamp(0.0, 1.0),
        Way::Right if gain > -KEEP_RIGHT_LOSS_MPS || pressed && gain > -YIELDING_LOSS_MPS => KEEP_RIGHT,
        Way::Right => 0.0,
    };
    let no_reason = if gain < -GRAVE_LOSS_MPS { NO_REASON_AT_A_LOSS } else { NO_REASON };
    share + no_reason
}

/// Probability of accepting the gaps of the lane to enter. A driver who accelerates lets the vehicle behind brake, others hardly.
pub(super) fn acceptance(speed_mps: f64, there: LaneView, accelerates: bool, behaviour: &Behaviour) -> f64 {
    let soft_step = |value: f64, half: f64| {
        let squared = (value / half) * (value / half);
        squared * squared / (1.0 + squared * squared)
    };
    let too_close =
        |gap_m: f64, closing_mps: f64| gap_m < MIN_GAP_M || (closing_mps > 0.0 && gap_m < MIN_TTC_S * closing_mps);
    let mut accepted = if there.behind.is_some() { 1.0 } else { NO_HURRY };
    if let Some(lag) = there.behind {
        let closing_mps = lag.speed_mps - speed_mps;
        if too_close(lag.gap_m, closing_mps) {
            return 0.0;
        }
        let lag_s = lag.gap_m / lag.speed_mps.max(5.0);
        let fits = soft_step(lag_s, LAG_HALF_S);
        // This step is steeper, because drivers agree on what is too close.
        accepted *= fits * fits / (fits * fits + (1.0 - fits) * (1.0 - fits));
        accepted *= NO_HURRY + (1.0 - NO_HURRY) * (1.0 - soft_step(lag_s, HURRY_S));
        if closing_mps > 0.0 {
            let braking = closing_mps * closing_mps / (2.0 * lag.gap_m);
            if braking > MAX_FOLLOWER_BRAKING_MPS2 {
                return 0.0;
            }
            let tolerated_mps2 = match accelerates {
                true => behaviour.accelerating_follower_braking_mps2,
                false => behaviour.follower_braking_mps2,
            };
            accepted *= libm::exp(-braking / tolerated_mps2);
        }
    }
    if let Some(lead) = there.ahead {
        let closing_mps = speed_mps - lead.speed_mps;
        if too_close(lead.gap_m, closing_mps) {
            return 0.0;
        }
        accepted *= soft_step(lead.gap_m / speed_mps.max(5.0), LEAD_HALF_S);
        if closing_mps > 0.0 {
            let braking = closing_mps * closing_mps / (2.0 * lead.gap_m);
            accepted *= libm::exp(-braking / LEAD_BRAKING_MPS2);
        }
    }
    if let (Some(lag), Some(lead)) = (there.behind, there.ahead)
        && lag.gap_m + lead.gap_m < MIN_ROOM_M
    {
        return 0.0;
    }
    accepted
}
