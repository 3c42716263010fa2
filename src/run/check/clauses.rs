//! What the clauses of UN R157 say of a case: each threshold beside the value that the case has. The numbers of a clause
//! are the profile's, so that a reading shows what the lane did.

use crate::engine::{Trace, TracedStep, TracedVehicle};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::scenario::Category;

/// The clause of cut-ins.
pub(super) const LANE_INTRUSION: &str = "5.2.5.2";

/// How a value stands to its threshold where the clause applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// Greater than it.
    Above,
    /// At least as large.
    AtLeast,
    /// At most as large.
    AtMost,
    /// Below it.
    Below,
}

impl Relation {
    /// Its sign.
    pub fn sign(self) -> &'static str {
        match self {
            Relation::Above => ">",
            Relation::AtLeast => "≥",
            Relation::AtMost => "≤",
            Relation::Below => "<",
        }
    }

    fn holds(self, value: f64, threshold: f64) -> bool {
        // Times are multiples of a step, up to rounding.
        const EPSILON: f64 = 1e-9;
        match self {
            Relation::Above => value > threshold + EPSILON,
            Relation::AtLeast => value >= threshold - EPSILON,
            Relation::AtMost => value <= threshold + EPSILON,
            Relation::Below => value < threshold - EPSILON,
        }
    }
}

/// One condition of a clause.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Number of the clause.
    pub clause: &'static str,
    /// What is compared.
    pub quantity: &'static str,
    /// Unit of value and threshold.
    pub unit: &'static str,
    /// Value of the case; `None` where the event of the clause does not happen.
    pub value: Option<f64>,
    /// How it has to stand to the threshold.
    pub relation: Relation,
    /// Threshold of the clause.
    pub threshold: f64,
    /// Time of the reading, s.
    pub time_s: Option<f64>,
    /// What follows where the condition holds.
    pub then: &'static str,
}

impl Reading {
    /// Does the condition hold? Not where its event does not happen.
    pub fn holds(&self) -> bool {
        self.value.is_some_and(|value| self.relation.holds(value, self.threshold))
    }
}

/// The readings of a category, in the order of the clauses.
pub(super) fn readings(profile: &Profile, category: Category, trace: &dyn Fn(ModelId) -> Trace) -> Vec<Reading> {
    let mut list = match category {
        Category::CutIn => lane_intrusion(profile, &trace(ModelId::Reg157)),
        Category::CutOut | Category::Lvd => Vec::new(),
    };
    list.extend(competent_driver(profile, category, &trace(ModelId::Cchdm)));
    list.extend(fuzzy_driver(&trace(ModelId::Fsm)));
    list
}

/// 5.2.5.2: a collision with a vehicle that cuts in has to be avoided where (a), (b) and (c) hold.
fn lane_intrusion(profile: &Profile, trace: &Trace) -> Vec<Reading> {
    let constants = &profile.reg157;
    let other = |step: &TracedStep| step.others[0];
    let intrudes = |step: &&TracedStep| other(step).lateral_gap_m <= constants.lateral_gate_m;
    let intrusion = trace.steps.iter().find(intrudes);
    let start_m = trace.steps.first().map_or(0.0, |step| other(step).y_m);
    let moves = |step: &&TracedStep| (other(step).y_m - start_m).abs() > 1e-9;
    // Movement is seen at the step that it begins from.
    let moved_s = trace.steps.iter().find(moves).map(|step| trace.time_s(step.step.saturating_sub(1)));
    let closing_mps = intrusion.map_or(0.0, |step| step.v_ego_mps - other(step).v_mps);
    let reading = |quantity, unit, value, relation, threshold, then| Reading {
        clause: LANE_INTRUSION,
        quantity,
        unit,
        value,
        relation,
        threshold,
        time_s: intrusion.map(|step| step.time_s),
        then,
    };
    let required_s = closing_mps.max(0.0) / (2.0 * constants.deceleration_mps2) + constants.reaction_time_s;
    vec![
        reading(
            "(a) relative speed at lane intrusion",
            "m/s",
            intrusion.map(|_| closing_mps),
            Relation::Above,
            0.0,
            "the other vehicle is slower",
        ),
        reading(
            "(b) lateral movement visible before lane intrusion",
            "s",
            intrusion.zip(moved_s).map(|(step, moved_s)| step.time_s - moved_s),
            Relation::AtLeast,
            constants.visible_lateral_movement_s,
            "the movement could be seen",
        ),
        reading(
            "(c) TTC at lane intrusion",
            "s",
            intrusion.map(|step| other(step).ttc_s),
            Relation::Above,
            required_s,
            "with (a) and (b): the system has to avoid the collision",
        ),
    ]
}

/// Annex 3, the competent and careful human driver.
fn competent_driver(profile: &Profile, category: Category, trace: &Trace) -> Vec<Reading> {
    let constants = &profile.cchdm;
    let first = trace.steps.first().map_or(0.0, |step| step.others[0].y_m);
    let deviation_m = |step: &TracedStep| (step.others[0].y_m - first).abs();
    let perceived = |event: Option<&TracedStep>| {
        let at_s = event.map(|step| step.time_s + constants.perception_time_s)?;
        trace.steps.iter().find(|step| step.time_s >= at_s - 1e-9)
    };
    let reading = |quantity, unit, value, relation, threshold, time_s, then| Reading {
        clause: "Annex 3, CCHDM",
        quantity,
        unit,
        value,
        relation,
        threshold,
        time_s,
        then,
    };
    if category == Category::Lvd {
        let dt_s = trace.dt_s;
        let pairs = || {
            trace.steps.windows(2).map(|pair| (&pair[1], (pair[0].others[0].v_mps - pair[1].others[0].v_mps) / dt_s))
        };
        let peak = pairs().max_by(|a, b| a.1.total_cmp(&b.1));
        let trigger_mps2 = constants.lead_deceleration_trigger_mps2;
        let first_s = pairs().find(|(_, a)| *a > trigger_mps2 + 1e-9).map(|(step, _)| step.time_s);
        let then = "perceived after the risk perception time";
        let peak_mps2 = peak.map(|(_, a)| a);
        return vec![reading(
            "largest deceleration of the leader",
            "m/s²",
            peak_mps2,
            Relation::Above,
            trigger_mps2,
            first_s,
            then,
        )];
    }
    let wandering_m = constants.wandering_m;
    let deviates = trace.steps.iter().find(|step| deviation_m(step) > wandering_m);
    let seen = perceived(deviates);
    let largest_m = trace.steps.iter().map(deviation_m).fold(0.0, f64::max);
    let deviates_s = deviates.map(|step| step.time_s);
    let mut list = vec![reading(
        "deviation from the lane centre",
        "m",
        Some(largest_m),
        Relation::Above,
        wandering_m,
        deviates_s,
        "perceived after the risk perception time",
    )];
    let danger = match category {
        Category::CutIn => {
            let ttc_s = seen.map(|step| step.others[0].ttc_s);
            ("TTC when perceived", ttc_s, constants.ttc_s)
        }
        _ => {
            let headway_s = seen.map(|step| step.others[0].gap_m / step.v_ego_mps.max(1e-9));
            ("headway when perceived", headway_s, constants.cut_out_headway_s)
        }
    };
    let (quantity, value, threshold) = danger;
    // Profiles without the headway test a TTC there as well.
    if threshold > 0.0 {
        let then = "braking begins after the delay; else once it holds";
        list.push(reading(quantity, "s", value, Relation::AtMost, threshold, seen.map(|step| step.time_s), then));
    }
    list
}

/// Annex 3, the driver of the fuzzy safety model: it reacts where a surrogate is above 0.
fn fuzzy_driver(trace: &Trace) -> Vec<Reading> {
    let first = trace.steps.iter().find(|step| step.is_unsafe);
    let largest = |of: fn(&TracedVehicle) -> f64| {
        first.map(|step| step.others[..trace.vehicles].iter().map(of).fold(0.0, f64::max))
    };
    let reading = |quantity, value| Reading {
        clause: "Annex 3, FSM",
        quantity,
        unit: "1",
        value,
        relation: Relation::Above,
        threshold: 0.0,
        time_s: first.map(|step| step.time_s),
        then: "the driver reacts",
    };
    vec![
        reading("PFS at the reaction", largest(|other| other.pfs)),
        reading("CFS at the reaction", largest(|other| other.cfs)),
    ]
}
