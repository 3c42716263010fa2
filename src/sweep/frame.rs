//! The frame: one lane from start to end. The latched step stands here, once for all models.
//!
//! Order inside a step: the state at i gives the criteria and the contact, then the check, then v[i+1]
//! (semi-implicit Euler). The state is the gap: positions never enter, so f32 keeps millimetres.

use crate::criterion::{BrakeThreatMaximum, BtnContact, Contact, Criteria, Criterion, TtcMinimum, contact};
use crate::driver::{DriverModel, DriverState, Hazard, View};
use crate::profile::FrameProfile;
use crate::scalar::Real;
use crate::scenario::Tables;

use super::lane_case::{LaneCase, LaneOther};
use super::outcome::{EndReason, NO_STEP, Outcome, Verdicts};

/// Constants of the frame at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<R> {
    /// Time step, s.
    pub dt: R,
    /// 1/dt, 1/s.
    pub inverse_dt: R,
    /// Number of steps that are evaluated at most.
    pub step_cap: u32,
    /// Index 0 is one step after the nominal start.
    pub start_shift: bool,
    /// End where nothing can happen any more.
    pub end_when_settled: bool,
    /// Abort at lateral overlap with |TTC| above this, s (the JRC's rule for CCHDM); off where not positive.
    pub abort_above_ttc: R,
}

impl<R: Real> Frame<R> {
    /// Plain constants; `abort_above_ttc_s` is the driver model's.
    pub fn resolve(profile: &FrameProfile, abort_above_ttc_s: f64) -> Self {
        Frame {
            dt: R::from_f64(profile.dt_s),
            inverse_dt: R::from_f64(1.0 / profile.dt_s),
            step_cap: profile.step_cap(),
            start_shift: profile.start_shift,
            end_when_settled: profile.end_when_settled,
            abort_above_ttc: R::from_f64(abort_above_ttc_s),
        }
    }

    /// The constants by the names that the shaders give them; flags are 0 or 1.
    pub fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("frame_dt", self.dt.to_f64()),
            ("frame_inverse_dt", self.inverse_dt.to_f64()),
            ("frame_step_cap", f64::from(self.step_cap.max(1))),
            ("frame_start_shift", f64::from(u8::from(self.start_shift))),
            ("frame_end_when_settled", f64::from(u8::from(self.end_when_settled))),
            ("frame_abort_above_ttc", self.abort_above_ttc.to_f64()),
        ]
    }
}

/// The headway of a lane: it sets the initial gap, bumper to bumper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<R> {
    /// Time headway, s: the gap is this times the ego's speed.
    Headway(R),
    /// Gap, m.
    Gap(R),
}

/// One other vehicle at one step.
#[derive(Debug, Clone, Copy)]
pub struct Seen<R> {
    /// What the driver sees.
    pub view: View<R>,
    /// Lateral position, m.
    pub lateral: R,
    /// Present for the ego at this step.
    pub present: bool,
    /// TTC and BTN look at it.
    pub judged: bool,
}

/// One step of a lane, for traces.
#[derive(Debug, Clone, Copy)]
pub struct Step<R> {
    /// Index i.
    pub index: u32,
    /// Speed of the ego, m/s.
    pub v_ego: R,
    /// The other vehicles; the second only where the case has one.
    pub seen: [Seen<R>; 2],
    /// The result of the check that counts.
    pub hazard: Hazard<R>,
}

/// Listens to the steps of a lane. Sweeps listen to nothing and pay nothing.
pub trait Observer<R> {
    /// Called once per evaluated step.
    fn step(&mut self, step: &Step<R>);
}

/// Listens to nothing.
pub struct Silent;

impl<R> Observer<R> for Silent {
    #[inline(always)]
    fn step(&mut self, _: &Step<R>) {}
}

impl<R, F: FnMut(&Step<R>)> Observer<R> for F {
    fn step(&mut self, step: &Step<R>) {
        self(step);
    }
}

/// What the steps of a lane have gathered so far.
#[derive(Clone, Copy)]
struct Record<R> {
    ttc: TtcMinimum<R>,
    btn: BrakeThreatMaximum<R>,
    min_gap: R,
}

/// What all lanes of one model have in common.
#[derive(Debug, Clone, Copy)]
pub struct Simulation<'a, R, M> {
    /// Time and end rules.
    pub frame: &'a Frame<R>,
    /// Criteria.
    pub criteria: &'a Criteria<R>,
    /// The ego's driver.
    pub model: &'a M,
    /// Its position in the registry: selects the attention windows.
    pub model_index: usize,
}

/// Runs one lane.
#[inline(always)]
pub fn run_lane<R: Real, M: DriverModel<R>>(
    simulation: &Simulation<R, M>,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    start: Start<R>,
    observer: &mut impl Observer<R>,
) -> Outcome<R> {
    let &Simulation { frame, criteria, model, model_index } = simulation;
    let gap_start = match start {
        Start::Headway(thw) => thw * case.ego_speed,
        Start::Gap(gap) => gap,
    };
    let mut gaps = [gap_start + case.others[0].gap_offset, gap_start + case.others[1].gap_offset];
    if frame.start_shift {
        for (gap, other) in gaps.iter_mut().zip(&case.others) {
            *gap = *gap + (other.motion.speed(tables, 0) - case.ego_speed) * frame.dt;
        }
    }
    let mut state = model.initial();
    let mut v_ego = case.ego_speed;
    let mut v_before = v_ego;
    let mut reaction_step = NO_STEP;
    let mut record = Record { ttc: TtcMinimum::new(), btn: BrakeThreatMaximum::new(), min_gap: R::INFINITY };
    let mut index = 0;
    loop {
        let a_ego = (v_ego - v_before) * frame.inverse_dt;
        let ego = EgoState { v: v_ego, a: a_ego, width: case.ego_width };
        let first = see(criteria, &ego, &case.others[0], tables, gaps[0], index);
        record = judge(criteria, &record, &first);
        let mut hazard = check(model, &first, &case.others[0], model_index, index);
        let mut touch = touches(&first, &case.others[0]);
        let mut settled = is_settled(&first);
        let mut touched = 0;
        let mut aborts = aborts(frame, &first);
        let mut second = first;
        if case.pair != 0 {
            second = see(criteria, &ego, &case.others[1], tables, gaps[1], index);
            record = judge(criteria, &record, &second);
            let other_hazard = check(model, &second, &case.others[1], model_index, index);
            // The nearest unsafe vehicle drives the reaction.
            let nearer = other_hazard.is_unsafe && (!hazard.is_unsafe || gaps[1] < gaps[0]);
            hazard = if nearer { other_hazard } else { hazard };
            let other_touch = touches(&second, &case.others[1]);
            touched = if touch == Contact::None { 1 } else { 0 };
            touch = if touch == Contact::None { other_touch } else { touch };
            settled = settled && is_settled(&second);
            aborts = aborts || self::aborts(frame, &second);
        }
        observer.step(&Step { index, v_ego, seen: [first, second], hazard });

        let (next_state, v_next) = step(model, state, &hazard, v_ego);
        if hazard.is_unsafe && reaction_step == NO_STEP {
            reaction_step = index;
        }
        let over = index >= case.horizon && frame.end_when_settled;
        let end = if touch != Contact::None {
            Some(EndReason::Contact)
        } else if aborts {
            Some(EndReason::Aborted)
        } else if over && v_ego <= R::ZERO {
            Some(EndReason::Standstill)
        } else if over && settled {
            Some(EndReason::Settled)
        } else if index + 1 >= frame.step_cap {
            Some(EndReason::Cap)
        } else {
            None
        };
        if let Some(end) = end {
            let closing = if touched == 0 { first.view.closing() } else { second.view.closing() };
            let last = Last { end, index, touch, touched, v_ego, closing };
            return outcome(criteria, record, reaction_step, last);
        }
        state = next_state;
        v_before = v_ego;
        v_ego = v_next;
        index += 1;
        gaps[0] = gaps[0] + (case.others[0].motion.speed(tables, index) - v_ego) * frame.dt;
        gaps[1] = gaps[1] + (case.others[1].motion.speed(tables, index) - v_ego) * frame.dt;
    }
}

/// The ego at one step.
struct EgoState<R> {
    v: R,
    a: R,
    width: R,
}

/// How a lane ended.
struct Last<R> {
    end: EndReason,
    index: u32,
    touch: Contact,
    touched: u8,
    v_ego: R,
    closing: R,
}

/// The latched step: not unsafe holds the present speed (the ego never accelerates again), unsafe reacts.
#[inline(always)]
fn step<R: Real, M: DriverModel<R>>(
    model: &M,
    state: DriverState<R>,
    hazard: &Hazard<R>,
    v_ego: R,
) -> (DriverState<R>, R) {
    let (reacting, v_reacting) = model.react(state, hazard, v_ego);
    if hazard.is_unsafe { (reacting, v_reacting) } else { (state, v_ego) }
}

#[inline(always)]
fn see<R: Real>(
    criteria: &Criteria<R>,
    ego: &EgoState<R>,
    other: &LaneOther<R>,
    tables: &Tables<R>,
    gap: R,
    index: u32,
) -> Seen<R> {
    let lateral = other.motion.lateral(tables, index);
    let view = View {
        v_ego: ego.v,
        a_ego: ego.a,
        v_other: other.motion.speed(tables, index),
        gap,
        lateral_gap: lateral.position.abs() - other.half_widths,
        lateral_towards: lateral.towards,
        half_lengths: other.half_lengths,
    };
    let present = other.used != 0 && index >= other.present_from && index < other.present_until;
    let judged = present
        && other.judged != 0
        && criteria.sees(gap, other.half_lengths, view.lateral_gap, lateral.position, ego.width);
    Seen { view, lateral: lateral.position, present, judged }
}

#[inline(always)]
fn judge<R: Real>(criteria: &Criteria<R>, record: &Record<R>, seen: &Seen<R>) -> Record<R> {
    let (gap, closing) = (seen.view.gap, seen.view.closing());
    Record {
        ttc: criteria.ttc.update(record.ttc, seen.judged, gap, closing),
        btn: criteria.btn.update(record.btn, seen.judged, gap, closing),
        min_gap: if seen.judged { gap.smaller(record.min_gap) } else { record.min_gap },
    }
}

#[inline(always)]
fn check<R: Real, M: DriverModel<R>>(
    model: &M,
    seen: &Seen<R>,
    other: &LaneOther<R>,
    model_index: usize,
    index: u32,
) -> Hazard<R> {
    let hazard = model.check(&seen.view);
    let attentive = seen.present && index >= other.attend_from[model_index];
    Hazard { is_unsafe: hazard.is_unsafe && attentive, demand: hazard.demand }
}

#[inline(always)]
fn touches<R: Real>(seen: &Seen<R>, other: &LaneOther<R>) -> Contact {
    if seen.present && other.judged != 0 {
        contact(seen.view.gap, other.half_lengths, seen.view.lateral_gap)
    } else {
        Contact::None
    }
}

/// Nothing can happen with this vehicle any more: it is behind, out of the lane, or not slower.
#[inline(always)]
fn is_settled<R: Real>(seen: &Seen<R>) -> bool {
    let in_lane = seen.judged || (seen.present && seen.view.lateral_gap < R::ZERO);
    seen.view.is_behind() || !in_lane || seen.view.closing() <= R::ZERO
}

#[inline(always)]
fn aborts<R: Real>(frame: &Frame<R>, seen: &Seen<R>) -> bool {
    let overlap = seen.present && seen.view.lateral_gap < R::ZERO && !seen.view.is_behind();
    let far = seen.view.gap.abs() > frame.abort_above_ttc * seen.view.closing().abs();
    frame.abort_above_ttc > R::ZERO && overlap && far
}

#[inline(always)]
fn outcome<R: Real>(criteria: &Criteria<R>, record: Record<R>, reaction_step: u32, last: Last<R>) -> Outcome<R> {
    let collided = last.touch != Contact::None;
    let counts = collided && criteria.btn_contact == BtnContact::Any;
    let btn = if counts { record.btn.fail() } else { record.btn };
    let bit = |criterion: Criterion, failed: bool| u8::from(failed) << criterion.index();
    let capped = if last.end == EndReason::Cap { Verdicts::CAPPED } else { 0 };
    Outcome {
        verdicts: Verdicts(
            bit(Criterion::Collision, collided)
                | bit(Criterion::Ttc, record.ttc.failed)
                | bit(Criterion::Btn, btn.failed)
                | capped,
        ),
        contact: last.touch,
        contact_with: if collided { last.touched } else { 0 },
        end: last.end,
        reaction_step,
        contact_step: if collided { last.index } else { NO_STEP },
        end_step: last.index,
        impact_speed: if collided { last.v_ego } else { R::ZERO },
        impact_closing_speed: if collided { last.closing } else { R::ZERO },
        min_ttc: record.ttc.value(),
        max_btn: R::from_f64(criteria.btn.value(&btn)),
        min_gap: record.min_gap,
    }
}
