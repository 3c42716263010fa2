//! The result of a finished lane: an outcome, or only verdicts.

use lanesweep_model::criterion::{BtnContact, Contact, Criterion, contact};
use lanesweep_model::scalar::{Flag, Real};

use crate::frame::Simulation;
use crate::lane_step::{
    Ego, LaneConstants, LaneState, OtherConstants, OtherState, Seen, aborts, is_settled, is_touched, see,
};
use crate::outcome::{EndReason, NO_STEP, Outcome, Verdicts};

/// The result that a sweep returns per lane: an outcome or only verdicts.
pub(crate) trait Ending {
    /// The result has minima and maxima, which the steps must accumulate.
    const HAS_VALUES: bool;

    /// Result of a lane after its last step, with the other vehicles in these states.
    fn of<M>(
        simulation: &Simulation<f32, M>,
        lane: &LaneConstants<f32>,
        state: &LaneState<f32>,
        places: &[OtherState<f32>; 2],
    ) -> Self;
}

impl Ending for Verdicts {
    const HAS_VALUES: bool = false;

    #[inline(always)]
    fn of<M>(
        simulation: &Simulation<f32, M>,
        lane: &LaneConstants<f32>,
        state: &LaneState<f32>,
        places: &[OtherState<f32>; 2],
    ) -> Self {
        verdicts(simulation, lane, state, places)
    }
}

impl Ending for Outcome<f32> {
    const HAS_VALUES: bool = true;

    #[inline(always)]
    fn of<M>(
        simulation: &Simulation<f32, M>,
        lane: &LaneConstants<f32>,
        state: &LaneState<f32>,
        places: &[OtherState<f32>; 2],
    ) -> Self {
        conclude(simulation, lane, state, places)
    }
}

/// Verdicts of a lane after its last step. Verdict-only batches know the ego's final speed only after a contact, which
/// keeps it. Therefore no speed may decide a verdict.
#[inline(always)]
fn verdicts<R: Real, M>(
    simulation: &Simulation<R, M>,
    lane: &LaneConstants<R>,
    state: &LaneState<R>,
    places: &[OtherState<R>; 2],
) -> Verdicts {
    let [first, second] = last_seen(simulation, lane, state, places);
    let scene = simulation.scene;
    let mut touched = is_touched(scene, &first, &lane.others[0]);
    if scene.is_pair {
        touched = touched | is_touched(scene, &second, &lane.others[1]);
    }
    let record = &state.record;
    let bit = |criterion: Criterion, failed: Flag| u8::from(failed.holds()) << criterion.index();
    // The only remaining reason is the time cap.
    let capped = if state.over.holds() { 0 } else { Verdicts::CAPPED };
    let contact_counts = Flag::of(simulation.criteria.btn_contact == BtnContact::Any);
    Verdicts(
        bit(Criterion::Collision, touched)
            | bit(Criterion::Ttc, record.ttc.failed)
            | bit(Criterion::Btn, record.btn.failed | (touched & contact_counts))
            | capped,
    )
}

/// Outcome of a lane after its last step.
#[inline(always)]
pub(crate) fn conclude<R: Real, M>(
    simulation: &Simulation<R, M>,
    lane: &LaneConstants<R>,
    state: &LaneState<R>,
    places: &[OtherState<R>; 2],
) -> Outcome<R> {
    let &Simulation { frame, criteria, scene, .. } = simulation;
    let (index, v_ego) = (state.index - 1, state.v_before);
    let [first, second] = last_seen(simulation, lane, state, places);
    let first_touch = touches(&first, &lane.others[0]);
    let by_second = scene.is_pair && first_touch == Contact::None;
    let contact = if by_second { touches(&second, &lane.others[1]) } else { first_touch };
    let closing = if by_second { second.view.closing() } else { first.view.closing() };
    let collided = contact != Contact::None;
    let aborted = (aborts(frame, &first) | aborts(frame, &second)).holds();
    let over = index >= lane.horizon;
    let settled = (is_settled(scene, &first) & is_settled(scene, &second)).holds();
    let end = if collided {
        EndReason::Contact
    } else if aborted {
        EndReason::Aborted
    } else if over && v_ego <= R::ZERO {
        EndReason::Standstill
    } else if over && settled {
        EndReason::Settled
    } else {
        EndReason::Cap
    };
    let record = &state.record;
    let btn = if collided && criteria.btn_contact == BtnContact::Any { record.btn.fail() } else { record.btn };
    Outcome {
        verdicts: verdicts(simulation, lane, state, places),
        contact,
        contact_with: u8::from(collided && by_second),
        end,
        reaction_step: state.reaction_step,
        contact_step: if collided { index } else { NO_STEP },
        end_step: index,
        impact_speed: if collided { v_ego } else { R::ZERO },
        impact_closing_speed: if collided { closing } else { R::ZERO },
        min_ttc: record.ttc.value(),
        max_btn: R::from_f64(criteria.btn.value(&btn)),
        min_gap: record.min_gap,
        min_thw: record.measures.min_thw(),
        max_drac: record.measures.max_drac(),
        tet_steps: record.measures.tet_steps,
        tit: record.measures.tit_sum * frame.dt,
        pet: record.measures.pet(frame.dt),
    }
}

/// The other vehicles at a lane's last step.
#[inline(always)]
fn last_seen<R: Real, M>(
    simulation: &Simulation<R, M>,
    lane: &LaneConstants<R>,
    state: &LaneState<R>,
    places: &[OtherState<R>; 2],
) -> [Seen<R>; 2] {
    let ego = Ego::of(lane, state.v_before, R::ZERO);
    let index = state.index - 1;
    let seen = |k: usize| see(simulation, &ego, &lane.others[k], &places[k], state.gaps[k], index, Flag::TRUE);
    let first = seen(0);
    [first, if simulation.scene.is_pair { seen(1) } else { first }]
}

#[inline(always)]
fn touches<R: Real>(seen: &Seen<R>, other: &OtherConstants<R>) -> Contact {
    let is_judged = (seen.present & other.judged).holds();
    if is_judged { contact(seen.view.gap, other.half_lengths, seen.view.lateral_gap) } else { Contact::None }
}
