//! Car-following: the Intelligent Driver Model with the constant-acceleration heuristic.
//!
//! The acceleration is the minimum of the free and the interaction term, so that a driver settles at the desired time
//! headway. With the original sum, the gap is much larger near the desired speed. The heuristic (Kesting, Treiber,
//! Helbing 2010, "Enhanced intelligent driver model", eq. 11.3 ff.) keeps the IDM's smooth approach but removes its
//! full braking after a merge with a short gap. Real drivers open such a gap slowly.

/// Parameters of one driver.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct DriverParameters {
    /// Desired speed v0, m/s.
    pub desired_speed_mps: f64,
    /// Desired time headway T, s.
    pub time_headway_s: f64,
    /// Standstill gap s0, m.
    pub standstill_gap_m: f64,
    /// Maximum acceleration a, m/s².
    pub acceleration_mps2: f64,
    /// Comfortable deceleration b, m/s².
    pub comfortable_mps2: f64,
    /// How much harder than needed the driver brakes where the gap is too short, as a fraction of the comfortable
    /// deceleration. 1 is the published model.
    pub overreaction: f64,
}

/// The vehicle ahead as the driver perceives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LeaderView {
    /// Bumper to bumper, m.
    pub gap_m: f64,
    /// Its speed, m/s.
    pub speed_mps: f64,
    /// Its acceleration as perceived, m/s².
    pub acceleration_mps2: f64,
}

/// Maximum braking of any driver, m/s².
pub(super) const HARDEST_BRAKING_MPS2: f64 = 8.0;

/// Braking that drivers exceed only if necessary, m/s²: 2.4 % of the published decelerations of leaders exceed 2 m/s².
const GENTLE_MPS2: f64 = 1.8;
/// It is necessary if avoiding contact needs more than this fraction of it, or if the leader brakes harder than this
/// fraction.
const URGENT: f64 = 0.8;
const BRAKING_LEADER_MPS2: f64 = -0.5;

/// Weight of the heuristic ("coolness").
const COOLNESS: f64 = 0.95;

/// Acceleration on a free road, m/s².
pub(super) fn free_acceleration(speed_mps: f64, driver: &DriverParameters) -> f64 {
    let ratio = speed_mps / driver.desired_speed_mps;
    let squared = ratio * ratio;
    // Above the desired speed the fourth power would brake hard; real drivers coast instead.
    (driver.acceleration_mps2 * (1.0 - squared * squared)).max(-0.5 * driver.comfortable_mps2)
}

/// Acceleration behind a leader, m/s², never harder than [`HARDEST_BRAKING_MPS2`].
///
/// `headway_s` is the present headway: the desired one or, after a cut-in, the shorter one that the driver tolerates.
pub(super) fn following_acceleration(
    speed_mps: f64,
    headway_s: f64,
    leader: LeaderView,
    driver: &DriverParameters,
) -> f64 {
    let gap_m = leader.gap_m.max(0.1);
    let closing_mps = speed_mps - leader.speed_mps;
    let root = 2.0 * (driver.acceleration_mps2 * driver.comfortable_mps2).sqrt();
    let dynamic_m = (speed_mps * headway_s + speed_mps * closing_mps / root).max(0.0);
    let ratio = (driver.standstill_gap_m + dynamic_m) / gap_m;
    let free = free_acceleration(speed_mps, driver);
    let idm = free.min(driver.acceleration_mps2 * (1.0 - ratio * ratio));

    let heuristic = constant_acceleration_heuristic(speed_mps, gap_m, leader, driver.acceleration_mps2);
    let mixed = if idm >= heuristic {
        idm
    } else {
        let b = driver.comfortable_mps2;
        let surplus = driver.overreaction * b * libm::tanh((idm - heuristic) / b);
        (1.0 - COOLNESS) * idm + COOLNESS * (heuristic + surplus)
    };

    // Lower bound: the braking that avoids contact.
    let needed = if closing_mps > 0.0 { closing_mps * closing_mps / (2.0 * (gap_m - 1.0).max(0.5)) } else { 0.0 };
    let guarded = if needed > 2.0 * driver.comfortable_mps2 { mixed.min(-1.2 * needed) } else { mixed };
    let must = needed > URGENT * GENTLE_MPS2 || leader.acceleration_mps2 < BRAKING_LEADER_MPS2;
    guarded.max(if must { -HARDEST_BRAKING_MPS2 } else { -GENTLE_MPS2 })
}

/// Deceleration that avoids a collision if the leader keeps its acceleration, m/s².
fn constant_acceleration_heuristic(speed_mps: f64, gap_m: f64, leader: LeaderView, own_max: f64) -> f64 {
    let leader_acceleration = leader.acceleration_mps2.min(own_max);
    let closing_mps = speed_mps - leader.speed_mps;
    let stops_first = leader.speed_mps * closing_mps <= -2.0 * gap_m * leader_acceleration;
    if stops_first {
        let denominator = leader.speed_mps * leader.speed_mps - 2.0 * gap_m * leader_acceleration;
        if denominator > 1e-6 { speed_mps * speed_mps * leader_acceleration / denominator } else { 0.0 }
    } else {
        let approach = closing_mps.max(0.0);
        leader_acceleration - approach * approach / (2.0 * gap_m)
    }
}
