//! The seconds of a case that its figures show, and the recorded motion of the other vehicles.

use super::case_sheet::CaseSheet;
use lanesweep_engine::{StepMark, Trace, TracedStep, TracedVehicle};
use lanesweep_model::scenario::{GAP_ERROR_M, KMH};
use lanesweep_run::check::Subject;
use lanesweep_support::readable::value;

/// Time shown after the last decisive event, s.
const REST_S: f64 = 2.0;
/// A value this near to its worst counts as the worst, relative: near a steady state the last digits take a minute.
const NEAR: f64 = 0.05;
/// A TTC or BTN this many times from its threshold decides nothing, as on the axes of the figures.
const FAR: f64 = 10.0;
/// Smaller changes of an ego's speed decide nothing, m/s.
const SPEED_CHANGE_MPS: f64 = 1.0 / KMH;

impl CaseSheet<'_> {
    /// Last time that the figures show, s.
    pub(super) fn shown_until_s(&self) -> f64 {
        let traces = self.first().models.iter().map(|judged| decisive_s(&judged.trace));
        let readings = self.first().readings.iter().filter_map(|reading| reading.time_s);
        ((traces.chain(readings).fold(0.0, f64::max) + REST_S) * 10.0).ceil() / 10.0
    }

    /// What the figures leave out, in a sentence; empty if nothing.
    pub(super) fn cut(&self) -> String {
        let ends = self.first().models.iter().filter_map(|judged| Some(judged.trace.steps.last()?.time_s));
        let (end_s, until_s) = (ends.fold(0.0, f64::max), self.shown_until_s());
        if end_s <= until_s {
            return String::new();
        }
        format!(
            "Shown are the decisive {} s of {} s: to {} s after the last contact, reading of a clause, change of an ego's speed \
             by more than 1 km/h, and worst gap, TTC and BTN (to 5 %, a gap to 1 cm; no TTC or BTN ten times from its \
             threshold), of every driver.",
            value(until_s),
            value(end_s),
            value(REST_S)
        )
    }

    /// What the recorded motion shows, in a sentence; `None` for a case of plain numbers.
    pub(super) fn recorded_motion(&self) -> Option<String> {
        let Subject::Recorded(scenario, _) = self.subject else { return None };
        let end_s = scenario.target.v.len().saturating_sub(1) as f64 / scenario.fps;
        Some(format!(
            "The other vehicles move as recorded, at {} samples per second until {} s; after that they keep speed and \
             lateral position.",
            value(scenario.fps),
            value(end_s)
        ))
    }
}

/// The last time at which a driver decides or is decided, s.
fn decisive_s(trace: &Trace) -> f64 {
    let marks = StepMark::ALL.into_iter().filter_map(|mark| trace.step_of(mark)).map(|step| trace.time_s(step));
    let last_mps = trace.steps.last().map_or(0.0, |step| step.v_ego_mps);
    let changes = |step: &&TracedStep| (step.v_ego_mps - last_mps).abs() > SPEED_CHANGE_MPS;
    let braked = trace.steps.iter().rfind(changes).map(|step| step.time_s);
    let judged = |step: &TracedStep| step.others.into_iter().take(trace.vehicles).filter(|other| other.is_judged);
    let smallest = |step: &TracedStep, of: fn(&TracedVehicle) -> f64| {
        judged(step).map(|other| of(&other)).fold(f64::INFINITY, f64::min)
    };
    // The first time at which a value is as near to its worst as this; none if the worst is above a limit.
    let first = |of: fn(&TracedVehicle) -> f64, limit: f64, near: &dyn Fn(f64) -> f64| {
        let worst = trace.steps.iter().map(|step| smallest(step, of)).fold(f64::INFINITY, f64::min);
        let is_near = |step: &&TracedStep| worst.is_finite() && worst <= limit && smallest(step, of) <= near(worst);
        trace.steps.iter().find(is_near).map(|step| step.time_s)
    };
    let worst = [
        first(|other| other.gap_m, f64::MAX, &|worst| worst + GAP_ERROR_M.max(worst * NEAR)),
        first(|other| other.ttc_s, FAR * trace.ttc_threshold_s, &|worst| worst * (1.0 + NEAR)),
        first(|other| -other.btn, -trace.btn_threshold / FAR, &|worst| worst * (1.0 - NEAR)),
    ];
    marks.chain(braked).chain(worst.into_iter().flatten()).fold(0.0, f64::max)
}
