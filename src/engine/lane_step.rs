//! One step of a lane as a pure function, written once for single lanes and for batches. The latched step of all models
//! is here too.
//!
//! Order inside a step: the gap moves to i (a contact between two steps holds it), the state at i gives the criteria
//! and the contact, then the check, then v[i+1] (semi-implicit Euler). The state is the gap, not the positions, so f32
//! resolves millimetres.
//!
//! There is no loop, no early return and no side effect, so that a compiler can vectorize the step over many lanes.
//! Truth values are [`Flag`]s, which vector units combine fastest. Step indices are at most [`Flag::LATEST_STEP`],
//! which stands for "never".

use lanesweep_model::criterion::{BrakeThreatMaximum, Criteria, Measures, TtcMinimum, held_in_contact, overlaps_along};
use lanesweep_model::driver::{DriverModel, DriverState, Hazard, View};
use lanesweep_model::scalar::{Flag, Real};
use lanesweep_model::scenario::{Motion, Tables};

use super::frame::{Frame, Simulation, Start};
use super::lane_case::{LaneCase, LaneOther};
use super::outcome::NO_STEP;
use super::scene::Scene;

/// Constants of another vehicle within a lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OtherConstants<R> {
    /// (L_e + L_o)/2, m.
    pub half_lengths: R,
    /// (W_e + W_o)/2, m.
    pub half_widths: R,
    /// First step at which it is present for the ego.
    pub present_from: u32,
    /// First step at which it is no longer present.
    pub present_until: u32,
    /// First step at which the lane's driver may react to it.
    pub attend_from: u32,
    /// The criteria evaluate it.
    pub judged: Flag,
}

/// Constants of a lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LaneConstants<R> {
    /// Principal vehicle, then the one ahead of it.
    pub others: [OtherConstants<R>; 2],
    /// Width of the ego, m.
    pub ego_width: R,
    /// From the ego's side to the marking of its lane, m.
    pub marking_gap: R,
    /// First step that may end a lane in which no further event is possible.
    pub horizon: u32,
}

impl<R: Real> LaneConstants<R> {
    /// Constants of a case under a model.
    #[inline(always)]
    pub(super) fn new<M>(simulation: &Simulation<R, M>, case: &LaneCase<R>) -> Self {
        let known = |step: u32| step.min(Flag::LATEST_STEP);
        let of = |other: &LaneOther<R>| OtherConstants {
            half_lengths: other.half_lengths,
            half_widths: other.half_widths,
            present_from: known(other.present_from),
            present_until: if other.used != 0 { known(other.present_until) } else { 0 },
            attend_from: known(other.attend_from[simulation.model_index]),
            judged: Flag::of(other.judged != 0),
        };
        LaneConstants {
            others: [of(&case.others[0]), of(&case.others[1])],
            ego_width: case.ego_width,
            marking_gap: (case.lane_width - case.ego_width) * R::HALF,
            // LATEST_STEP is never reached, because the step cap is below it.
            horizon: known(if simulation.frame.end_when_settled { case.horizon } else { Flag::LATEST_STEP }),
        }
    }
}

/// State of another vehicle at one step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OtherState<R> {
    /// Speed, m/s.
    pub speed: R,
    /// Lateral position, m.
    pub position: R,
    /// Lateral speed towards the ego, m/s.
    pub towards: R,
}

impl<R: Real> OtherState<R> {
    /// Decodes a motion at a step.
    #[inline(always)]
    pub(super) fn of(motion: &Motion<R>, tables: &Tables<R>, step: u32) -> Self {
        let lateral = motion.lateral(tables, step);
        OtherState { speed: motion.speed(tables, step), position: lateral.position, towards: lateral.towards }
    }
}

/// One other vehicle at one step.
#[derive(Debug, Clone, Copy)]
pub struct Seen<R> {
    /// What the driver sees.
    pub view: View<R>,
    /// Lateral position, m.
    pub lateral: R,
    /// Present for the ego at this step.
    pub present: Flag,
    /// TTC and BTN evaluate it.
    pub judged: Flag,
}

/// Minima and maxima over the steps so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Record<R> {
    /// Minimum time to collision.
    pub ttc: TtcMinimum<R>,
    /// Maximum Brake Threat Number.
    pub btn: BrakeThreatMaximum<R>,
    /// Minimum gap to a vehicle that TTC and BTN evaluate, m.
    pub min_gap: R,
    /// Values without a verdict.
    pub measures: Measures<R>,
}

impl<R: Real> Record<R> {
    /// Before the first step.
    #[inline(always)]
    pub(super) fn new() -> Self {
        let (ttc, btn, measures) = (TtcMinimum::start(), BrakeThreatMaximum::start(), Measures::start());
        Record { ttc, btn, min_gap: R::INFINITY, measures }
    }
}

/// A lane between two steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LaneState<R> {
    /// Index of the next step.
    pub index: u32,
    /// Speed of the ego at the next step, m/s.
    pub v_ego: R,
    /// Speed of the ego one step before, m/s.
    pub v_before: R,
    /// Gaps at the last step, m; the next step updates them first.
    pub gaps: [R; 2],
    /// The driver's latched state.
    pub driver: DriverState<R>,
    /// First unsafe step, or [`NO_STEP`].
    pub reaction_step: u32,
    /// Minima and maxima over the steps so far.
    pub record: Record<R>,
    /// The last step has been made, possibly long before the time cap; the result (`cpu/lane_result.rs`)
    /// says why. Later steps change nothing, or in verdict-only sweeps nothing that affects a verdict.
    pub over: Flag,
}

impl<R: Real> LaneState<R> {
    /// State before the first step.
    #[inline(always)]
    pub(super) fn new<M: DriverModel<R>>(simulation: &Simulation<R, M>, case: &LaneCase<R>, start: Start<R>) -> Self {
        let gap_start = start.gap(case.ego_speed);
        LaneState {
            index: 0,
            v_ego: case.ego_speed,
            v_before: case.ego_speed,
            gaps: [gap_start + case.others[0].gap_offset, gap_start + case.others[1].gap_offset],
            driver: simulation.model.initial(),
            reaction_step: NO_STEP,
            record: Record::new(),
            over: Flag::FALSE,
        }
    }
}

/// Result of one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved<R> {
    /// State of the lane after the step.
    pub state: LaneState<R>,
    /// The other vehicles as the ego sees them; without a second vehicle, both are the first.
    pub seen: [Seen<R>; 2],
    /// The hazard that determines the reaction.
    pub hazard: Hazard<R>,
}

/// Makes one step; `places` are the other vehicles at `state.index`. The lane is over if its state says so, or if the
/// next index reaches the step cap. A lane that is over stays unchanged (see [`LaneState::over`]).
#[inline(always)]
pub(super) fn advance<R: Real, M: DriverModel<R>>(
    simulation: &Simulation<R, M>,
    lane: &LaneConstants<R>,
    state: &LaneState<R>,
    places: &[OtherState<R>; 2],
) -> Moved<R> {
    let &Simulation { frame, criteria, model, scene, .. } = simulation;
    let &LaneState { index, v_ego, .. } = state;
    let runs = !state.over;
    let keeps_values = criteria.keeps_values;
    let a_is_seen = keeps_values || M::SEES_OWN_ACCELERATION;
    let a = if a_is_seen { (v_ego - state.v_before) * frame.inverse_dt } else { R::ZERO };
    let ego = Ego::of(lane, v_ego, a);
    // Step 0 is the start itself, unless index 0 is one step after it.
    let moves = runs & (Flag::of(frame.start_shift) | Flag::reached(index, 1));
    let mut gaps = state.gaps;
    gaps[0] = moves.choose(moved_gap(simulation, &ego, &lane.others[0], &places[0], gaps[0], index), gaps[0]);
    let first = see(simulation, &ego, &lane.others[0], &places[0], gaps[0], index, runs);
    let mut record = update_record(criteria, &state.record, &first);
    let mut hazard = check(simulation, &first, &lane.others[0], index);
    let mut touched = is_touched(scene, &first, &lane.others[0]);
    let mut settled = is_settled(scene, &first);
    let mut aborted = aborts(frame, &first);
    let mut second = first;
    if scene.is_pair {
        gaps[1] = moves.choose(moved_gap(simulation, &ego, &lane.others[1], &places[1], gaps[1], index), gaps[1]);
        second = see(simulation, &ego, &lane.others[1], &places[1], gaps[1], index, runs);
        record = update_record(criteria, &record, &second);
        let other_hazard = check(simulation, &second, &lane.others[1], index);
        // Of two unsafe vehicles the nearer one determines the reaction, or the one that demands more.
        let (demand, other_demand) = (hazard.demand, other_hazard.demand);
        let counts = if frame.largest_demand { demand.is_below(other_demand) } else { gaps[1].is_below(gaps[0]) };
        hazard = Hazard {
            demand: (other_hazard.is_unsafe & (!hazard.is_unsafe | counts)).choose(other_demand, demand),
            is_unsafe: hazard.is_unsafe | other_hazard.is_unsafe,
        };
        touched = touched | is_touched(scene, &second, &lane.others[1]);
        settled = settled & is_settled(scene, &second);
        aborted = aborted | aborts(frame, &second);
    }
    if keeps_values && criteria.keeps_measures {
        let ahead = first.present & !gaps[0].is_negative() & Flag::reached(index, 1);
        let overlaps = runs & is_across(scene, &first);
        let nearest = nearest_ttc(simulation, &first, &second);
        record.measures = record.measures.expose(&nearest, criteria.tet_threshold);
        record.measures = record.measures.encroach(runs, overlaps, ahead, gaps[0], v_ego, v_ego * frame.dt);
    }
    let at_rest = !v_ego.is_positive();
    let past_horizon = Flag::reached(index, lane.horizon);
    let over = state.over | touched | aborted | (past_horizon & (at_rest | settled));

    // Latched: without a hazard the ego holds its present speed (it never accelerates again); with a hazard it reacts.
    hazard.is_unsafe = hazard.is_unsafe | (runs & model.keeps_braking(&state.driver, &first.view));
    let (reacting, v_reacting) = model.react(state.driver, &hazard, v_ego);
    let is_first = hazard.is_unsafe & Flag::of(state.reaction_step == NO_STEP);
    let state = LaneState {
        index: index + runs.one(),
        // The speed at a contact is kept.
        v_ego: (hazard.is_unsafe & !touched).choose(v_reacting, v_ego),
        v_before: if keeps_values { runs.choose(v_ego, state.v_before) } else { v_ego },
        gaps,
        driver: DriverState {
            deceleration: hazard.is_unsafe.choose(reacting.deceleration, state.driver.deceleration),
            delay_steps: hazard.is_unsafe.choose(reacting.delay_steps, state.driver.delay_steps),
        },
        reaction_step: is_first.choose(index, state.reaction_step),
        record,
        over,
    };
    Moved { state, seen: [first, second], hazard }
}

/// The ego at one step.
pub(super) struct Ego<R> {
    pub v: R,
    pub a: R,
    pub width: R,
    pub marking_gap: R,
}

impl<R: Real> Ego<R> {
    #[inline(always)]
    pub(super) fn of(lane: &LaneConstants<R>, v: R, a: R) -> Self {
        Ego { v, a, width: lane.ego_width, marking_gap: lane.marking_gap }
    }
}

/// The gap one step later; a contact between the two steps holds it.
#[inline(always)]
fn moved_gap<R: Real, M>(
    simulation: &Simulation<R, M>,
    ego: &Ego<R>,
    other: &OtherConstants<R>,
    place: &OtherState<R>,
    gap: R,
    index: u32,
) -> R {
    let moved = gap + (place.speed - ego.v) * simulation.frame.dt;
    if !simulation.scene.may_cross {
        return moved;
    }
    let across = (place.position.abs() - other.half_widths).is_negative();
    let stops = is_present(other, index) & other.judged & across;
    stops.choose(held_in_contact(gap, moved, other.half_lengths), moved)
}

/// Whether the vehicle is present for the ego.
#[inline(always)]
fn is_present<R>(other: &OtherConstants<R>, index: u32) -> Flag {
    Flag::reached(index, other.present_from) & !Flag::reached(index, other.present_until)
}

/// `runs`: the lane is not over; otherwise no vehicle is present.
#[inline(always)]
pub(super) fn see<R: Real, M>(
    simulation: &Simulation<R, M>,
    ego: &Ego<R>,
    other: &OtherConstants<R>,
    place: &OtherState<R>,
    gap: R,
    index: u32,
    runs: Flag,
) -> Seen<R> {
    let view = View {
        v_ego: ego.v,
        a_ego: ego.a,
        v_other: place.speed,
        gap,
        lateral_gap: place.position.abs() - other.half_widths,
        lateral_towards: place.towards,
        half_lengths: other.half_lengths,
        marking_gap: ego.marking_gap,
    };
    let &Simulation { criteria, scene, .. } = simulation;
    let lateral = place.position;
    if scene.in_lane {
        return Seen { view, lateral, present: runs, judged: runs & !view.is_behind() };
    }
    let is_seen = criteria.sees(gap, other.half_lengths, view.lateral_gap, lateral, ego.width);
    if scene.always_there {
        return Seen { view, lateral, present: runs, judged: runs & is_seen };
    }
    let present = runs & is_present(other, index);
    Seen { view, lateral, present, judged: present & other.judged & is_seen }
}

#[inline(always)]
pub(super) fn update_record<R: Real>(criteria: &Criteria<R>, record: &Record<R>, seen: &Seen<R>) -> Record<R> {
    let (gap, closing) = (seen.view.gap, seen.view.closing());
    let keeps_values = criteria.keeps_values;
    let ttc = criteria.ttc.update(record.ttc, seen.judged, gap, closing, keeps_values);
    let btn = criteria.btn.update(record.btn, seen.judged, gap, closing, keeps_values);
    if !keeps_values {
        return Record { ttc, btn, ..*record };
    }
    let min_gap = seen.judged.choose(gap.smaller(record.min_gap), record.min_gap);
    let measures = &record.measures;
    let measures =
        if criteria.keeps_measures { measures.update(seen.judged, seen.view.v_ego, gap, closing) } else { *measures };
    Record { ttc, btn, min_gap, measures }
}

/// The smaller TTC of both vehicles at one step.
#[inline(always)]
fn nearest_ttc<R: Real, M>(simulation: &Simulation<R, M>, first: &Seen<R>, second: &Seen<R>) -> TtcMinimum<R> {
    let smaller = |ttc: TtcMinimum<R>, seen: &Seen<R>| {
        simulation.criteria.ttc.update(ttc, seen.judged, seen.view.gap, seen.view.closing(), true)
    };
    let nearest = smaller(TtcMinimum::start(), first);
    if simulation.scene.is_pair { smaller(nearest, second) } else { nearest }
}

/// The gap, m ≥ 0, above which no criterion in the record begins to fail at this closing speed, m/s, or a lower one.
/// Rounding is not included.
#[inline(always)]
pub(super) fn criteria_safe_gap<R: Real>(criteria: &Criteria<R>, record: &Record<R>, closing: R) -> R {
    let Record { ttc, btn, .. } = record;
    let mut safe = R::ZERO;
    if closing > R::ZERO && !ttc.failed.holds() {
        safe = safe.larger(criteria.ttc.safe_gap(closing));
    }
    if closing > R::ZERO && !btn.failed.holds() {
        safe = safe.larger(criteria.btn.safe_gap(closing));
    }
    safe
}

#[inline(always)]
pub(super) fn check<R: Real, M: DriverModel<R>>(
    simulation: &Simulation<R, M>,
    seen: &Seen<R>,
    other: &OtherConstants<R>,
    index: u32,
) -> Hazard<R> {
    let model = simulation.model;
    let hazard = if simulation.scene.is_steady { model.check_steady(&seen.view) } else { model.check(&seen.view) };
    let attends = if simulation.scene.in_lane { Flag::TRUE } else { Flag::reached(index, other.attend_from) };
    let attentive = seen.present & attends;
    Hazard { is_unsafe: hazard.is_unsafe & attentive, demand: hazard.demand }
}

#[inline(always)]
pub(super) fn is_touched<R: Real>(scene: Scene, seen: &Seen<R>, other: &OtherConstants<R>) -> Flag {
    let along = overlaps_along(seen.view.gap, other.half_lengths);
    let judged = if scene.always_there { Flag::TRUE } else { other.judged };
    seen.present & judged & is_across(scene, seen) & along
}

/// The vehicle overlaps the ego's path across the road.
#[inline(always)]
fn is_across<R: Real>(scene: Scene, seen: &Seen<R>) -> Flag {
    if scene.in_lane { Flag::TRUE } else { seen.view.lateral_gap.is_negative() }
}

/// No further event is possible with this vehicle: it is behind, out of the lane, or not slower.
#[inline(always)]
pub(super) fn is_settled<R: Real>(scene: Scene, seen: &Seen<R>) -> Flag {
    let in_lane = seen.judged | (seen.present & is_across(scene, seen));
    seen.view.is_behind() | !in_lane | !seen.view.closing().is_positive()
}

#[inline(always)]
pub(super) fn aborts<R: Real>(frame: &Frame<R>, seen: &Seen<R>) -> Flag {
    if frame.abort_above_ttc > R::ZERO {
        let overlap = seen.present & seen.view.lateral_gap.is_negative() & !seen.view.is_behind();
        let limit = frame.abort_above_ttc * seen.view.closing().abs();
        overlap & seen.view.gap.abs().is_above(limit)
    } else {
        Flag::FALSE
    }
}
