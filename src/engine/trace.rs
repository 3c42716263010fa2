//! Every step of a lane as data, for checks by hand and for tables and figures of one case.

use super::cpu::runner::LaneRunner;
use super::drivers::Constants;
use super::lane::Step;
use super::lane_case::LaneCase;
use super::lane_step::Seen;
use super::outcome::{NO_STEP, Outcome};
use super::plan::{Headway, LaneKey};
use lanesweep_model::criterion::Contact;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::{Category, Tables};

/// Another vehicle at one step. The measures are computed in f64 from the values that the lane used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracedVehicle {
    /// Longitudinal position of its centre, m; the ego's starts at 0.
    pub x_m: f64,
    /// Lateral position of its centre, m; 0 is the middle of the ego's lane.
    pub y_m: f64,
    /// Speed, m/s.
    pub v_mps: f64,
    /// Gap, bumper to bumper, m; negative if the vehicles overlap along the road.
    pub gap_m: f64,
    /// Lateral gap, m; negative if the vehicles overlap laterally.
    pub lateral_gap_m: f64,
    /// Time to collision, s, ≥ 0; infinite if the ego does not close in.
    pub ttc_s: f64,
    /// Brake Threat Number, ≥ 0; infinite if no braking helps.
    pub btn: f64,
    /// Proactive fuzzy surrogate of the FSM, 0…1.
    pub pfs: f64,
    /// Critical fuzzy surrogate of the FSM, 0…1.
    pub cfs: f64,
    /// It is present for the ego.
    pub is_present: bool,
    /// TTC and BTN evaluate it: only such steps count for the minimum TTC and the maximum BTN.
    pub is_judged: bool,
}

/// One step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracedStep {
    /// Index.
    pub step: u32,
    /// Time, s.
    pub time_s: f64,
    /// Position of the ego's centre, m.
    pub x_ego_m: f64,
    /// Speed of the ego, m/s.
    pub v_ego_mps: f64,
    /// Mean acceleration of the ego since the step before, m/s².
    pub a_ego_mps2: f64,
    /// The driver finds the situation unsafe.
    pub is_unsafe: bool,
    /// Deceleration demanded by the driver, m/s²; `None` if the situation is safe.
    pub demand_mps2: Option<f64>,
    /// Principal vehicle, then the one ahead of it; see [`Trace::vehicles`].
    pub others: [TracedVehicle; 2],
}

/// An event that a trace marks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepMark {
    /// First step that the driver finds unsafe: the reaction time begins.
    Reaction,
    /// The ego begins to brake: from this step on it decelerates by more than CCHDM coasts during its delay.
    Braking,
    /// The vehicles touch.
    Contact,
}

impl StepMark {
    /// All, in the order in which they happen.
    pub const ALL: [StepMark; 3] = [StepMark::Reaction, StepMark::Braking, StepMark::Contact];

    /// Name in tables and figures.
    pub fn label(self) -> &'static str {
        match self {
            StepMark::Reaction => "reaction",
            StepMark::Braking => "braking",
            StepMark::Contact => "contact",
        }
    }
}

/// One lane from its first step to its last.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Kind of scenario.
    pub category: Category,
    /// Driver model.
    pub model: ModelId,
    /// Time step, s.
    pub dt_s: f64,
    /// Gap at the first step, m, bumper to bumper. If the profile's runs start one step later (`start_shift`), it
    /// differs from the gap of the case by the relative motion in that step.
    pub initial_gap_m: f64,
    /// Width of the ego, m.
    pub ego_width_m: f64,
    /// Width of the lanes, m.
    pub lane_width_m: f64,
    /// Widths of the other vehicles, m.
    pub widths_m: [f64; 2],
    /// Mean of the lengths of the ego and of each other vehicle, m.
    pub mean_lengths_m: [f64; 2],
    /// Deceleration during the reaction time that does not count as braking, m/s².
    pub coasting_mps2: f64,
    /// A TTC below this fails, s.
    pub ttc_threshold_s: f64,
    /// A BTN above this fails.
    pub btn_threshold: f64,
    /// Number of other vehicles: 1 or 2.
    pub vehicles: usize,
    /// The steps; at least one.
    pub steps: Vec<TracedStep>,
    /// The outcome of the lane.
    pub outcome: Outcome<f64>,
}

impl Trace {
    /// Runs a case in the arithmetic `R` and keeps every step.
    pub fn record<R: Real>(
        profile: &Profile,
        category: Category,
        case: &LaneCase<R>,
        tables: &Tables<R>,
        headway: Headway,
        model: ModelId,
    ) -> Trace {
        let measures = Constants::<f64>::resolve(profile, category);
        let lane = Constants::<R>::resolve(profile, category);
        let dt_s = profile.frame.dt_s;
        let (mut steps, mut x_ego_m) = (Vec::new(), 0.0);
        let each = |step: &Step<R>| {
            let v_ego_mps = step.v_ego.to_f64();
            if step.index > 0 {
                x_ego_m += v_ego_mps * dt_s;
            }
            let hazard = step.hazard;
            steps.push(TracedStep {
                step: step.index,
                time_s: time_s(step.index, dt_s),
                x_ego_m,
                v_ego_mps,
                a_ego_mps2: step.seen[0].view.a_ego.to_f64(),
                is_unsafe: hazard.is_unsafe.holds(),
                demand_mps2: hazard.is_unsafe.holds().then(|| hazard.demand.to_f64()),
                others: step.seen.map(|seen| vehicle(&measures, &seen, x_ego_m)),
            });
        };
        let start = headway.start::<R>();
        let outcome = lane.run(model, case, tables, start, each).widen();
        let gap = headway.start::<f64>().gap(case.ego_speed.to_f64());
        let nominal_gap_m = gap + case.others[0].gap_offset.to_f64();
        let shifted_gap_m = steps.first().filter(|_| profile.frame.start_shift).map(|first| first.others[0].gap_m);
        let ego_width_m = case.ego_width.to_f64();
        Trace {
            category,
            model,
            dt_s,
            initial_gap_m: shifted_gap_m.unwrap_or(nominal_gap_m),
            ego_width_m,
            lane_width_m: case.lane_width.to_f64(),
            widths_m: case.others.map(|other| 2.0 * other.half_widths.to_f64() - ego_width_m),
            mean_lengths_m: case.others.map(|other| other.half_lengths.to_f64()),
            coasting_mps2: if model == ModelId::Cchdm { profile.cchdm.coasting_mps2 } else { 0.0 },
            ttc_threshold_s: profile.criteria.ttc_threshold_s,
            btn_threshold: profile.criteria.btn_threshold,
            vehicles: if case.pair != 0 { 2 } else { 1 },
            steps,
            outcome,
        }
    }

    /// The step of a mark; `None` if it did not happen.
    pub fn step_of(&self, mark: StepMark) -> Option<u32> {
        let happened = |step: u32| (step != NO_STEP).then_some(step);
        match mark {
            StepMark::Reaction => happened(self.outcome.reaction_step),
            // The acceleration of a step is the mean since the step before.
            StepMark::Braking => {
                let brakes = |step: &&TracedStep| step.a_ego_mps2 < -(self.coasting_mps2 + 1e-6);
                self.steps.iter().find(brakes).map(|step| step.step.saturating_sub(1))
            }
            StepMark::Contact => happened(self.outcome.contact_step),
        }
    }

    /// Description of the contact. A vehicle that is beside the ego when it comes into its path hits its side, also where
    /// its centre is ahead of the ego's.
    pub fn contact_label(&self) -> &'static str {
        let at = self.outcome.contact_step as usize;
        let comes_beside = |pair: &[TracedStep]| {
            let of = |other: usize| {
                let [before, after] = [&pair[0], &pair[1]].map(|step| &step.others[other]);
                before.lateral_gap_m >= 0.0 && before.gap_m < 0.0 && after.lateral_gap_m < 0.0 && after.gap_m < 0.0
            };
            (0..self.vehicles).any(of)
        };
        let pair = at.checked_sub(1).and_then(|before| self.steps.get(before..=at));
        match self.outcome.contact {
            Contact::Frontal if pair.is_some_and(comes_beside) => Contact::BySide.label(),
            contact => contact.label(),
        }
    }

    /// Time of a step, s, without the rounding error of the product.
    pub fn time_s(&self, step: u32) -> f64 {
        time_s(step, self.dt_s)
    }
}

impl<R: Real> LaneRunner<'_, R> {
    /// Runs one lane and keeps every step; its outcome equals that of [`LaneRunner::run`], word for word.
    pub fn trace(&self, key: &LaneKey) -> Trace {
        let plan = self.plan();
        let (case, tables) = self.case(key.block, key.unit, key.variant);
        let (category, headway) = (plan.blocks[key.block].category, plan.headways[key.headway]);
        Trace::record(&plan.profile, category, &case, &tables, headway, plan.models[key.model])
    }
}

/// Computes the measures in binary64 from the values that the lane used.
fn vehicle<R: Real>(measures: &Constants<f64>, seen: &Seen<R>, x_ego_m: f64) -> TracedVehicle {
    let (view, of) = (&seen.view, R::to_f64);
    let (v_ego, v_other, gap_m) = (of(view.v_ego), of(view.v_other), of(view.gap));
    let closing = v_ego - v_other;
    TracedVehicle {
        x_m: x_ego_m + gap_m + of(view.half_lengths),
        y_m: of(seen.lateral),
        v_mps: v_other,
        gap_m,
        lateral_gap_m: of(view.lateral_gap),
        ttc_s: if closing > 0.0 { gap_m.max(0.0) / closing } else { f64::INFINITY },
        btn: measures.criteria.btn.at(gap_m, closing),
        pfs: measures.fsm.pfs(v_ego, v_other, gap_m),
        cfs: measures.fsm.cfs(v_ego, v_other, gap_m, of(view.a_ego)),
        is_present: seen.present.holds(),
        is_judged: seen.judged.holds(),
    }
}

fn time_s(step: u32, dt_s: f64) -> f64 {
    (f64::from(step) * dt_s * 1e9).round() / 1e9
}
