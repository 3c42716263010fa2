//! Cases on a threshold. The numbers of a first step are solved in f32 so that both sides of one comparison are equal,
//! or so that they are the two neighbours between which a decision changes. The lane records begin with these numbers.

use super::decision::{HEADWAYS, Threshold};
use super::series::{LateralStart, TINY, ThresholdSeries, rounded};
use super::{CaseRandom, Purpose};
use crate::{CaseSource, Constants, LaneCase, LaneOther, NO_STEP};
use lanesweep_model::criterion::{BrakeThreatMaximum, BtnForm};
use lanesweep_model::driver::{DriverModel, MODELS, View};
use lanesweep_model::profile::Profile;
use lanesweep_model::scalar::Flag;
use lanesweep_model::scenario::{Category, Lateral, Motion, Tables};

/// Neighbours of gap 0 for starts of 10 m, where 2⁻³² is too small: one ULP of 10 m.
const SMALL: f32 = 1.0 / (1 << 20) as f32;
/// Tries per unit: not every speed has a gap that f32 hits exactly.
const TRIES: usize = 64;
/// A gap beyond any threshold, m.
const FAR: f32 = 600.0;

/// Cases of all units.
pub(super) struct ThresholdCases {
    seed: u64,
    profile: Profile,
    categories: Vec<Category>,
    /// One per category.
    constants: Vec<Constants<f32>>,
    series: ThresholdSeries,
}

/// The first step of a lane, with the data of later ones.
#[derive(Debug, Clone, Copy)]
struct FirstStep {
    v_ego: f32,
    v_other: f32,
    gap: f32,
    half_lengths: f32,
    half_widths: f32,
    ego_width: f32,
    lane_width: f32,
    motion: Motion<f64>,
    attend_from: u32,
    present_from: u32,
    present_until: u32,
    horizon: u32,
    /// Index of the headway that the gap is solved for.
    start: usize,
    /// Slot of the deciding vehicle: 0 the only one, 1 the first of two, 2 the second of two; the other has no effect.
    pairing: u64,
}

impl FirstStep {
    /// From the ego's side to the marking, m, as a lane computes it.
    fn marking_gap(&self) -> f32 {
        (self.lane_width - self.ego_width) * 0.5
    }
}

impl CaseSource for ThresholdCases {
    /// A pure function of seed, category, unit and side.
    fn case(&self, block: usize, unit: u64, side: usize) -> LaneCase<f64> {
        let draw = |attempt| CaseRandom::new(Purpose::Threshold, self.seed, self.categories[block], unit, attempt);
        let exact = (0..TRIES).find_map(|attempt| {
            let cases = self.cases(&mut draw(attempt), block, unit)?;
            let offsets = cases.map(|first_step| self.gap_offset(&first_step, block));
            offsets.iter().all(Option::is_some).then_some(())?;
            Some(self.record(&cases[side], offsets[side]?))
        });
        // Without an exact solution the unit is still an ordinary lane.
        exact.unwrap_or_else(|| self.record(&self.base(&mut draw(TRIES), unit, LateralStart::Ahead), 10.0))
    }

    fn tables(&self) -> &Tables<f64> {
        &self.series.tables
    }
}

impl ThresholdCases {
    pub(super) fn new(profile: &Profile, seed: u64, categories: &[Category]) -> ThresholdCases {
        ThresholdCases {
            seed,
            profile: profile.clone(),
            categories: categories.to_vec(),
            constants: categories.iter().map(|&c| Constants::resolve(profile, c)).collect(),
            series: ThresholdSeries::new(seed, profile.frame.dt_s),
        }
    }

    fn base(&self, draw: &mut CaseRandom, unit: u64, across: LateralStart) -> FirstStep {
        let turn = unit / Threshold::ALL.len() as u64;
        let motion = self.series.motion(draw, (turn % 4) as u32, across);
        let v_other = motion.cast::<f32>().speed(&self.series.lane_tables, 0);
        FirstStep {
            v_ego: v_other + rounded(draw.between(0.5, 15.0)),
            v_other,
            gap: rounded(draw.between(2.0, 30.0)),
            half_lengths: rounded(draw.between(3.6, 9.0)),
            half_widths: rounded(draw.between(1.3, 2.3)),
            ego_width: rounded(draw.between(1.6, 2.1)),
            lane_width: rounded(draw.between(2.7, 4.2)),
            motion,
            attend_from: 0,
            present_from: 0,
            // Half of the vehicles are present for one step only, so that this step alone decides.
            present_until: if draw.chance(0.5) { 1 } else { NO_STEP },
            horizon: draw.below(60) as u32,
            start: draw.below(HEADWAYS.len()),
            pairing: turn / 4 % 3,
        }
    }

    /// The case on its threshold and its two neighbours; `None` if these numbers have no exact solution.
    fn cases(&self, draw: &mut CaseRandom, block: usize, unit: u64) -> Option<[FirstStep; 3]> {
        use LateralStart::{Ahead, Beside, Coming};
        use Threshold::*;

        let threshold = Threshold::of_unit(unit);
        let across = match threshold {
            Reg157Gate | CchdmGate | RssLateral | LateralGap | EgoWidth => [Coming, Beside][draw.below(2)],
            FsmGate | LateralEvent => Coming,
            LateralSpeed => Beside,
            Centres => [Ahead, Beside][draw.below(2)],
            _ => Ahead,
        };
        let first_step = self.base(draw, unit, across);
        match threshold {
            Attention | Appearance | Disappearance | SpeedEvent | LateralEvent | Horizon | StepCap => {
                self.in_time(draw, block, threshold, first_step)
            }
            Reg157Gate | CchdmGate | RssLateral | LateralSpeed | LateralGap | EgoWidth => {
                self.across_the_road(draw, block, threshold, first_step)
            }
            _ => self.along_the_road(draw, block, threshold, first_step),
        }
    }

    /// Thresholds that are reached by the gap or the ego's speed.
    fn along_the_road(
        &self,
        draw: &mut CaseRandom,
        block: usize,
        on: Threshold,
        mut s: FirstStep,
    ) -> Option<[FirstStep; 3]> {
        let constants = &self.constants[block];
        let criteria = &constants.criteria;
        let dv = s.v_ego - s.v_other;
        // The smallest relevant gap: centres side by side.
        let nearest = -s.half_lengths;
        let signed = |draw: &mut CaseRandom, gap: f32| if gap < -nearest && draw.chance(0.25) { -gap } else { gap };
        let judged = |gap: f32| criteria.btn.update(BrakeThreatMaximum::start(), Flag::TRUE, gap, dv, true);
        let fsm = &constants.fsm;
        s.gap = match on {
            Threshold::Ttc => criteria.ttc.threshold * dv,
            Threshold::Btn => turn(0.01, FAR, |gap| judged(gap).failed.holds())?.1,
            Threshold::BtnRoom => turn(0.01, FAR, |gap| criteria.btn.value(&judged(gap)).is_infinite())?.0,
            Threshold::Reg157Ttc | Threshold::CchdmTtc => {
                if draw.chance(0.25) {
                    s.v_ego = s.v_other - rounded(draw.between(0.5, 1.9));
                }
                let dv = s.v_ego - s.v_other;
                if on == Threshold::Reg157Ttc {
                    signed(draw, dv.abs() * constants.reg157.ttc_threshold(dv))
                } else {
                    signed(draw, constants.cchdm.danger_gap(s.v_ego, dv))
                }
            }
            Threshold::RssLongitudinal => constants.rss.longitudinal_distance(s.v_ego, s.v_other),
            Threshold::PfsSafe => turn(nearest, FAR, |gap| fsm.pfs(s.v_ego, s.v_other, gap) > 0.0)?.1,
            Threshold::PfsUnsafe => turn(nearest, FAR, |gap| fsm.pfs(s.v_ego, s.v_other, gap) >= 1.0)?.0,
            Threshold::CfsSafe => turn(nearest, FAR, |gap| fsm.cfs(s.v_ego, s.v_other, gap, 0.0) > 0.0)?.1,
            Threshold::CfsUnsafe => turn(nearest, FAR, |gap| fsm.cfs(s.v_ego, s.v_other, gap, 0.0) >= 1.0)?.0,
            Threshold::FsmGate => {
                // A gap well inside PFS, then a width near the threshold of the gate.
                let reach = turn(nearest, FAR, |gap| fsm.pfs(s.v_ego, s.v_other, gap) > 0.0)?.0;
                let about = rounded(draw.between(0.1, 0.8)) * reach;
                let lateral = s.motion.cast::<f32>().lateral(&self.series.lane_tables, 0);
                let h = lateral.towards * (about + 2.0 * s.half_lengths + 0.1 * dv) / dv;
                s.half_widths = lateral.position.abs() - h;
                if s.half_widths < 0.3 {
                    return None;
                }
                let open = |gap: f32| fsm.check(&self.view(&FirstStep { gap, ..s })).is_unsafe.holds();
                turn(nearest, about + 0.5 * (reach - about), open)?.1
            }
            Threshold::Behind => -(s.half_lengths + s.half_lengths),
            Threshold::Centres => {
                let y = s.motion.cast::<f32>().lateral(&self.series.lane_tables, 0).position.abs();
                if y > 1.0 {
                    // Seen by TTC and BTN, but no contact.
                    (s.ego_width, s.half_widths) = (y + 0.3, y - 0.2);
                }
                nearest
            }
            Threshold::Gap => {
                let exact = s.start < 2 && !self.profile.frame.start_shift;
                let near = if exact { TINY } else { SMALL };
                return Some([0.0, -near, near].map(|gap| FirstStep { gap, ..s }));
            }
            Threshold::EqualSpeeds => {
                s.v_ego = s.v_other;
                // At gap 0 one ULP of closing speed is unsafe; at larger gaps only for FSM.
                s.gap = if draw.chance(0.5) { 0.0 } else { s.gap };
                let at = |v_ego: f32| FirstStep { v_ego, ..s };
                return Some([at(s.v_ego), at(s.v_ego.next_down()), at(s.v_ego.next_up())]);
            }
            Threshold::StandingEgo => {
                s.gap = if draw.chance(0.5) { 0.0 } else { rounded(draw.between(0.1, 5.0)) };
                let at = |v_ego: f32, v_other: f32| {
                    let motion = self.series.with_speed(s.motion, v_other, 0.0, 0.0);
                    FirstStep { v_ego, v_other, motion, ..s }
                };
                return Some([at(0.0, 0.0), at(0.0, TINY), at(TINY, 0.0)]);
            }
            _ => return None,
        };
        let kept = s.gap >= nearest || on == Threshold::Behind;
        (kept && self.products_meet(on, &s))
            .then(|| [s.gap, s.gap.next_down(), s.gap.next_up()].map(|gap| FirstStep { gap, ..s }))
    }

    /// If both sides are products, the decision may change without equality; only exact solutions count.
    fn products_meet(&self, on: Threshold, s: &FirstStep) -> bool {
        let dv = s.v_ego - s.v_other;
        let criteria = &self.profile.criteria;
        match on {
            Threshold::Btn if criteria.btn == BtnForm::EquivalentDelay => {
                let limit = rounded(2.0 * criteria.btn_threshold * criteria.max_deceleration_mps2);
                let delay = rounded(criteria.max_deceleration_mps2 / (2.0 * criteria.jerk_mps3));
                dv * dv == limit * (s.gap - dv * delay)
            }
            Threshold::FsmGate => {
                let view = self.view(s);
                let passing = s.gap + s.half_lengths + s.half_lengths;
                let margin = rounded(self.profile.fsm.lateral_gate_margin_s);
                view.lateral_gap * dv == view.lateral_towards * (passing + margin * dv)
            }
            _ => true,
        }
    }

    /// Thresholds that are reached by a width or a lateral speed.
    fn across_the_road(
        &self,
        draw: &mut CaseRandom,
        block: usize,
        on: Threshold,
        mut s: FirstStep,
    ) -> Option<[FirstStep; 3]> {
        let constants = &self.constants[block];
        let dv = s.v_ego - s.v_other;
        let lateral = s.motion.cast::<f32>().lateral(&self.series.lane_tables, 0);
        let y = lateral.position.abs();
        let part = rounded(draw.between(0.2, 0.8));
        let soon = part * dv * constants.criteria.ttc.threshold;
        let lateral_gap = match on {
            Threshold::Reg157Gate => {
                s.gap = part * dv * constants.reg157.ttc_threshold(dv);
                constants.reg157.intrusion_gap(s.marking_gap())
            }
            Threshold::CchdmGate => {
                s.gap = part * constants.cchdm.danger_gap(s.v_ego, dv);
                rounded(self.profile.cchdm.lateral_gate_m)
            }
            Threshold::RssLateral => {
                s.gap = part * constants.rss.longitudinal_distance(s.v_ego, s.v_other).max(1.0);
                constants.rss.lateral_distance(lateral.towards)
            }
            Threshold::LateralGap => {
                // Overlapping along the road, or soon to.
                s.gap = if draw.chance(0.5) { -part * s.half_lengths } else { soon };
                0.0
            }
            Threshold::EgoWidth => {
                (s.gap, s.ego_width) = (soon, y);
                s.half_widths = rounded(draw.between(0.3, 1.2)) * y;
                return Some([y, y.next_down(), y.next_up()].map(|ego_width| FirstStep { ego_width, ..s }));
            }
            _ => {
                // With dv = 0 FSM's gate depends only on the lateral speed.
                s.v_ego = if draw.chance(0.7) { s.v_other } else { s.v_ego };
                s.gap = rounded(draw.between(0.5, 5.0));
                s.half_widths = s.half_widths.min(y - 0.2);
                return Some([0, 1, 2].map(|side| FirstStep { motion: self.series.still(s.motion, side), ..s }));
            }
        };
        let minus_gap = |width: f32| -(y - width);
        let width = hit(-lateral_gap, f64::from(y) - f64::from(lateral_gap), minus_gap)?;
        // A smaller lateral gap is a larger width.
        let widths = [width, next_other(width, true, minus_gap), next_other(width, false, minus_gap)];
        (width >= 0.2).then(|| widths.map(|half_widths| FirstStep { half_widths, ..s }))
    }

    /// Thresholds that are reached by a step index.
    fn in_time(&self, draw: &mut CaseRandom, block: usize, on: Threshold, mut s: FirstStep) -> Option<[FirstStep; 3]> {
        let (dt, dt_s) = (self.constants[block].frames[0].dt, self.profile.frame.dt_s);
        let dv = s.v_ego - s.v_other;
        let step = 1 + draw.below(5) as u32;
        let around = |step: u32| [step, step.saturating_sub(1), step + 1];
        s.present_until = NO_STEP;
        match on {
            Threshold::Attention | Threshold::Appearance => {
                // For every model 0.4 s before the contact is unsafe.
                s.gap = dv * (0.4 + dt * step as f32);
                Some(around(step).map(|step| match on {
                    Threshold::Attention => FirstStep { attend_from: step, ..s },
                    _ => FirstStep { present_from: step, ..s },
                }))
            }
            Threshold::Disappearance => {
                s.attend_from = NO_STEP;
                s.gap = rounded(draw.between(0.5, 5.0));
                let contact = self.contact_step(&s, dt)?;
                Some(around(contact).map(|present_until| FirstStep { present_until, ..s }))
            }
            Threshold::SpeedEvent => {
                let acceleration = draw.between(-9.0, 3.0);
                Some([0.0, -1e-6, 1e-6].map(|early| {
                    let until_s = (f64::from(step) + early) * dt_s;
                    FirstStep { motion: self.series.with_speed(s.motion, s.v_other, acceleration, until_s), ..s }
                }))
            }
            Threshold::LateralEvent => {
                let lateral = s.motion.cast::<f32>().lateral(&self.series.lane_tables, 0);
                let (start, rate) = (f64::from(lateral.position), f64::from(lateral.towards));
                let travel = rate * dt_s * f64::from(step);
                // RSS becomes safe at the step at which the lateral speed ends.
                let rss = &self.constants[block].rss;
                let (still, moving) = (rss.lateral_distance(0.0), rss.lateral_distance(lateral.towards));
                let h = still + rounded(draw.between(0.1, 0.9)) * (moving - still);
                s.attend_from = step;
                s.half_widths = rounded(start.abs() - travel) - h;
                s.gap = rounded(draw.between(0.2, 0.8)) * rss.longitudinal_distance(s.v_ego, s.v_other).max(4.0);
                (s.half_widths > 0.2).then(|| {
                    [0.0, -1e-6, 1e-6].map(|early| {
                        let end_m = start - start.signum() * (travel + early * rate * dt_s);
                        let across = Lateral::Kinematic { start_m: start, rate_mps: -start.signum() * rate, end_m };
                        FirstStep { motion: self.series.with_lateral(s.motion, &across), ..s }
                    })
                })
            }
            _ => {
                s.v_ego = s.v_other;
                s.gap = s.gap.max(20.0);
                s.motion = self.series.with_speed(s.motion, s.v_other, 0.0, 0.0);
                let last = self.profile.step_cap().max(2) - 1;
                let horizon = if on == Threshold::StepCap { last } else { (1 + draw.below(200) as u32).min(last - 1) };
                Some(around(horizon).map(|horizon| FirstStep { horizon, ..s }))
            }
        }
    }

    /// First step at which an ego that keeps its speed touches the vehicle; `None` if it does not within the searched
    /// steps.
    fn contact_step(&self, s: &FirstStep, dt: f32) -> Option<u32> {
        let motion = s.motion.cast::<f32>();
        let mut gap = s.gap;
        (1..400).find(|&index| {
            gap += (motion.speed(&self.series.lane_tables, index) - s.v_ego) * dt;
            gap < 0.0
        })
    }

    fn view(&self, s: &FirstStep) -> View<f32> {
        let lateral = s.motion.cast::<f32>().lateral(&self.series.lane_tables, 0);
        View {
            v_ego: s.v_ego,
            a_ego: 0.0,
            v_other: s.v_other,
            gap: s.gap,
            lateral_gap: lateral.position.abs() - s.half_widths,
            lateral_towards: lateral.towards,
            half_lengths: s.half_lengths,
            marking_gap: s.marking_gap(),
        }
    }

    /// The offset to the headway that gives the lane this first gap.
    fn gap_offset(&self, s: &FirstStep, block: usize) -> Option<f32> {
        let frame = &self.constants[block].frames[0];
        let start = HEADWAYS[s.start].start::<f32>().gap(s.v_ego);
        let shift = (s.v_other - s.v_ego) * frame.dt;
        let first = |offset: f32| if frame.start_shift { start + offset + shift } else { start + offset };
        let guess = f64::from(s.gap) - f64::from(first(0.0));
        hit(s.gap, guess, first)
    }

    fn record(&self, s: &FirstStep, offset: f32) -> LaneCase<f64> {
        let deciding = LaneOther {
            motion: s.motion,
            half_lengths: f64::from(s.half_lengths),
            half_widths: f64::from(s.half_widths),
            gap_offset: f64::from(offset),
            present_from: s.present_from,
            present_until: s.present_until,
            attend_from: [s.attend_from; MODELS],
            used: 1,
            judged: 1,
        };
        let aside = Lateral::Kinematic { start_m: 12.0, rate_mps: 0.0, end_m: 12.0 };
        let far = LaneOther {
            motion: self.series.with_lateral(self.series.with_speed(s.motion, s.v_other, 0.0, 0.0), &aside),
            half_widths: 2.0,
            gap_offset: 150.0,
            present_from: 0,
            present_until: NO_STEP,
            attend_from: [NO_STEP; MODELS],
            ..deciding
        };
        let others = match s.pairing {
            0 => [deciding, LaneOther { used: 0, present_until: 0, ..deciding }],
            1 => [deciding, far],
            _ => [far, deciding],
        };
        LaneCase {
            others,
            ego_speed: f64::from(s.v_ego),
            ego_width: f64::from(s.ego_width),
            lane_width: f64::from(s.lane_width),
            horizon: s.horizon,
            pair: u32::from(s.pairing > 0),
        }
    }
}

/// The number nearest to `guess` for which the non-decreasing `f` equals `target`; `None` if there is none or only a
/// subnormal one, which devices may flush.
fn hit(target: f32, guess: f64, f: impl Fn(f32) -> f32) -> Option<f32> {
    let mut x = guess as f32;
    for _ in 0..8 {
        let y = f(x);
        if y == target {
            return (!x.is_subnormal()).then_some(x);
        }
        x = if y < target { x.next_up() } else { x.next_down() };
    }
    None
}

/// The nearest number below (`up` false) or above `x` with another value of `f`: if `f` rounds more coarsely than its
/// argument, one ULP changes nothing.
fn next_other(x: f32, up: bool, f: impl Fn(f32) -> f32) -> f32 {
    let mut other = x;
    for _ in 0..1024 {
        other = if up { other.next_up() } else { other.next_down() };
        if f(other) != f(x) {
            break;
        }
    }
    other
}

/// The two neighbours in [low, high] between which `holds` changes from its value at `low` to that at `high`; `None`
/// if both are equal.
fn turn(low: f32, high: f32, holds: impl Fn(f32) -> bool) -> Option<(f32, f32)> {
    let first = holds(low);
    if low >= high || holds(high) == first {
        return None;
    }
    let (mut from, mut to) = (ordered(low), ordered(high));
    while to - from > 1 {
        let middle = from + (to - from) / 2;
        if holds(number(middle)) == first { from = middle } else { to = middle }
    }
    Some((number(from), number(to)))
}

/// f32 as integers in the order of their values; both zeros are 0.
fn ordered(x: f32) -> i64 {
    let magnitude = i64::from(x.to_bits() & 0x7FFF_FFFF);
    if x.is_sign_negative() { -magnitude } else { magnitude }
}

fn number(ordered: i64) -> f32 {
    let magnitude = f32::from_bits(ordered.unsigned_abs() as u32);
    if ordered < 0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_found_between_neighbours_on_either_side_of_zero() {
        for at in [-7.3_f32, -0.0, 0.25, 31.7] {
            let (below, above) = turn(-50.0, 90.0, |x| x < at).unwrap();
            assert!(below < at && above >= at && below.next_up() == above, "{at}: {below} {above}");
        }
        assert_eq!(turn(0.0, 1.0, |_| true), None);
    }

    #[test]
    fn the_next_other_number_is_past_the_rounding() {
        assert_eq!(next_other(1.0, true, |x| x), 1.0_f32.next_up());
        let other = next_other(0.5, true, |x| 4.0 - x);
        assert!(other > 0.5_f32.next_up() && 4.0 - other != 3.5 && 4.0 - other.next_down() == 3.5);
    }

    #[test]
    fn a_hit_is_exact_or_none() {
        let x = hit(0.1, 0.1 - 10.0, |x| x + 10.0);
        assert!(x.is_none_or(|x| x + 10.0 == 0.1));
        assert_eq!(hit(12.5, 2.5, |x| x + 10.0), Some(2.5));
        assert_eq!(hit(f32::MIN_POSITIVE, 0.0, |x| x + 10.0), None);
    }
}
