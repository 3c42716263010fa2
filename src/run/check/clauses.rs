//! The clauses of UN R157 applied to a case: each threshold with the value of the case. The numbers of a clause are
//! those of the profile, so that a reading shows what the lane did.

use serde::Serialize;

use lanesweep_engine::{Trace, TracedStep, TracedVehicle};
use lanesweep_model::driver::{BelowTrigger, ModelId, lane_centre};
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{Category, SPEED_ERROR_MPS};

/// Required relation of a value to its threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// Greater than it.
    Above,
    /// At least as large.
    AtLeast,
    /// At most as large.
    AtMost,
}

impl Relation {
    /// Its sign.
    pub fn sign(self) -> &'static str {
        match self {
            Relation::Above => ">",
            Relation::AtLeast => "≥",
            Relation::AtMost => "≤",
        }
    }

    fn compare(self, value: f64, threshold: f64) -> bool {
        // Times are multiples of a step, up to rounding.
        const EPSILON: f64 = 1e-9;
        match self {
            Relation::Above => value > threshold + EPSILON,
            Relation::AtLeast => value >= threshold - EPSILON,
            Relation::AtMost => value <= threshold + EPSILON,
        }
    }
}

/// Whether a condition holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// It holds.
    Yes,
    /// It does not hold, or its event does not happen.
    No,
    /// Its event began before the case, which shows less than the whole of it.
    Unknown,
}

impl Holds {
    /// Text for tables and files.
    pub fn label(self) -> &'static str {
        match self {
            Holds::Yes => "yes",
            Holds::No => "no",
            Holds::Unknown => "unknown",
        }
    }
}

/// What the clause of cut-ins demands of the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Demand {
    /// It has to avoid the collision.
    Avoid,
    /// Nothing: a condition does not hold.
    Nothing,
    /// A condition is unknown, and all others hold.
    Unknown,
}

/// One condition of a clause.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Number of the clause.
    pub clause: String,
    /// A condition under which the clause demands that the system avoids the collision.
    pub is_condition: bool,
    /// The compared quantity.
    pub quantity: &'static str,
    /// Unit of value and threshold.
    pub unit: &'static str,
    /// Value of the case; `None` if the event of the clause does not happen.
    pub value: Option<f64>,
    /// The event began before the case: the value is a lower bound.
    pub is_cut_off: bool,
    /// Required relation of the value to the threshold.
    pub relation: Relation,
    /// Threshold of the clause.
    pub threshold: f64,
    /// Time of the reading, s.
    pub time_s: Option<f64>,
    /// Consequence if the condition holds.
    pub then: &'static str,
}

impl Reading {
    /// Whether the condition holds.
    pub fn holds(&self) -> Holds {
        match self.value {
            Some(value) if self.relation.compare(value, self.threshold) => Holds::Yes,
            Some(_) if self.is_cut_off => Holds::Unknown,
            _ => Holds::No,
        }
    }
}

/// A clause of which readings are made.
struct Clause {
    name: String,
    /// Its readings are conditions: [`Reading::is_condition`].
    has_conditions: bool,
}

impl Clause {
    /// A reading of a quantity in a unit: its time and value, the required relation to a threshold, the consequence.
    fn reading(
        &self,
        (quantity, unit): (&'static str, &'static str),
        (time_s, value): (Option<f64>, Option<f64>),
        (relation, threshold): (Relation, f64),
        then: &'static str,
    ) -> Reading {
        let (clause, is_condition, is_cut_off) = (self.name.clone(), self.has_conditions, false);
        Reading { clause, is_condition, quantity, unit, value, is_cut_off, relation, threshold, time_s, then }
    }
}

/// The readings of a category in the order of the clauses; `unreacting` is the trace of an ego that keeps its speed.
/// There is no reading of the deviation for a driver that attends at once.
pub(super) fn readings(
    profile: &Profile,
    category: Category,
    unreacting: impl FnOnce() -> Trace,
    trace: &dyn Fn(ModelId) -> Trace,
    attends_at_once: bool,
) -> Vec<Reading> {
    let mut list = lane_intrusion(profile, category, unreacting);
    if !attends_at_once {
        list.extend(competent_driver(profile, category, &trace(ModelId::Cchdm)));
    }
    list.extend(fuzzy_driver(&trace(ModelId::Fsm)));
    list
}

/// What the cut-in clause demands. `None` if there is no clause for the case.
pub(super) fn demand(readings: &[Reading]) -> Option<Demand> {
    let conditions = readings.iter().filter(|reading| reading.is_condition).map(Reading::holds);
    conditions.fold(None, |demand, holds| match (demand, holds) {
        (Some(Demand::Nothing), _) | (_, Holds::No) => Some(Demand::Nothing),
        (Some(Demand::Unknown), _) | (_, Holds::Unknown) => Some(Demand::Unknown),
        _ => Some(Demand::Avoid),
    })
}

/// The other vehicle at its intrusion into the ego's lane, interpolated between two steps to the lateral gap of the
/// clause.
struct Intrusion {
    time_s: f64,
    /// It was before the case.
    is_before: bool,
    closing_mps: f64,
    /// `None` if the vehicle is behind the ego.
    ttc_s: Option<f64>,
}

impl Intrusion {
    fn of(trace: &Trace, lateral_gate_m: f64) -> Option<Intrusion> {
        let at = trace.steps.iter().position(|step| step.others[0].lateral_gap_m <= lateral_gate_m)?;
        let (before, after) = (&trace.steps[at.saturating_sub(1)], &trace.steps[at]);
        let change_m = before.others[0].lateral_gap_m - after.others[0].lateral_gap_m;
        let share = if change_m > 0.0 { (before.others[0].lateral_gap_m - lateral_gate_m) / change_m } else { 1.0 };
        let between = |of: fn(&TracedStep) -> f64| of(before) + share * (of(after) - of(before));
        let gap_m = between(|step| step.others[0].gap_m);
        let closing_mps = between(|step| step.v_ego_mps - step.others[0].v_mps);
        let ttc_s = if closing_mps > 0.0 { gap_m.max(0.0) / closing_mps } else { f64::INFINITY };
        let ttc_s = (gap_m + trace.mean_lengths_m[0] >= 0.0).then_some(ttc_s);
        Some(Intrusion { time_s: between(|step| step.time_s), is_before: at == 0, closing_mps, ttc_s })
    }
}

/// The cut-in clause (UN R157, 5.2.5.2; EU 2022/1426, 1.4.2): a collision must be avoided if (a), (b) and (c) hold. EU
/// 2022/1426 has no (b). No reading for a profile without a clause.
pub(super) fn lane_intrusion(
    profile: &Profile,
    category: Category,
    unreacting: impl FnOnce() -> Trace,
) -> Vec<Reading> {
    let constants = &profile.reg157;
    if category != Category::CutIn || constants.clause.is_empty() {
        return Vec::new();
    }
    let trace = &unreacting();
    let other = |step: &TracedStep| step.others[0];
    let marking_gap_m = (trace.lane_width_m - trace.ego_width_m) / 2.0;
    let intrusion = Intrusion::of(trace, constants.intrusion_gap_m(marking_gap_m));
    let is_before = intrusion.as_ref().is_some_and(|intrusion| intrusion.is_before);
    let first = trace.steps.first().map(other);
    let start_m = first.map_or(0.0, |other| other.y_m);
    // Beyond normal wandering from the centre of its lane the movement began earlier.
    let has_begun = lane_centre(start_m, trace.lane_width_m) - start_m.abs() > profile.cchdm.wandering_m;
    let moves = |step: &&TracedStep| (other(step).y_m - start_m).abs() > 1e-9;
    // Movement counts from the step before its first change.
    let moved_s = trace.steps.iter().find(moves).map(|step| trace.time_s(step.step.saturating_sub(1)));
    let change_mps = |step: &TracedStep| first.map_or(0.0, |first| (other(step).v_mps - first.v_mps).abs());
    let changed = first_largest(trace.steps.iter().map(|step| (step.time_s, change_mps(step))));
    let clause = Clause { name: constants.clause.clone(), has_conditions: true };
    let time_s = intrusion.as_ref().map(|intrusion| intrusion.time_s);
    let closing_mps = intrusion.as_ref().map(|intrusion| intrusion.closing_mps);
    let required_s =
        closing_mps.unwrap_or(0.0).max(0.0) / (2.0 * constants.deceleration_mps2) + constants.reaction_time_s;
    let mut list = vec![
        clause.reading(
            ("(a) relative speed at lane intrusion", "m/s"),
            (time_s, closing_mps),
            (Relation::Above, 0.0),
            "the other vehicle is slower",
        ),
        clause.reading(
            ("(a) largest change of the other vehicle's speed", "m/s"),
            changed.unzip(),
            (Relation::AtMost, SPEED_ERROR_MPS),
            "the other vehicle keeps its speed, to 0.1 km/h",
        ),
    ];
    if constants.visible_lateral_movement_s > 0.0 {
        let visible = clause.reading(
            ("(b) lateral movement visible before lane intrusion", "s"),
            (time_s, time_s.zip(moved_s).map(|(time_s, moved_s)| time_s - moved_s)),
            (Relation::AtLeast, constants.visible_lateral_movement_s),
            "the movement could be seen",
        );
        list.push(Reading { is_cut_off: has_begun, ..visible });
    }
    let ttc = clause.reading(
        ("(c) TTC at lane intrusion", "s"),
        (time_s, intrusion.as_ref().and_then(|intrusion| intrusion.ttc_s)),
        (Relation::Above, required_s),
        if list.len() > 2 {
            "with (a) and (b): the system has to avoid the collision"
        } else {
            "with (a): the system has to avoid the collision; the profile has no (b)"
        },
    );
    list.push(Reading { is_cut_off: is_before, ..ttc });
    list
}

/// The maximum value and the first time at which it occurs.
fn first_largest(values: impl Iterator<Item = (f64, f64)>) -> Option<(f64, f64)> {
    values.reduce(|largest, next| if next.1 > largest.1 + 1e-9 { next } else { largest })
}

/// The first value above a threshold with its time; the maximum if there is none.
fn first_above(values: impl Iterator<Item = (f64, f64)> + Clone, threshold: f64) -> Option<(f64, f64)> {
    values.clone().find(|(_, value)| *value > threshold + 1e-9).or_else(|| first_largest(values))
}

/// Annex 3, the competent and careful human driver.
fn competent_driver(profile: &Profile, category: Category, trace: &Trace) -> Vec<Reading> {
    let constants = &profile.cchdm;
    let first = trace.steps.first().map_or(0.0, |step| step.others[0].y_m);
    // From the centre of its lane: the ego's in a cut-out.
    let deviation_m = |step: &TracedStep| match category {
        Category::CutIn => lane_centre(first, trace.lane_width_m) - step.others[0].y_m.abs(),
        _ => step.others[0].y_m.abs(),
    };
    let perceived = |event: Option<&TracedStep>| {
        let at_s = event.map(|step| step.time_s + constants.perception_time_s)?;
        trace.steps.iter().find(|step| step.time_s >= at_s - 1e-9)
    };
    let is_annex = constants.wandering_m > 0.0;
    let name = if is_annex { "Annex 3, CCHDM".to_owned() } else { format!("CCHDM of {}", profile.name) };
    let clause = Clause { name, has_conditions: false };
    if category == Category::Lvd {
        // The deceleration of a step acts from the step before.
        let decelerations = trace
            .steps
            .windows(2)
            .map(|pair| (pair[0].time_s, (pair[0].others[0].v_mps - pair[1].others[0].v_mps) / trace.dt_s));
        let trigger_mps2 = constants.lead_deceleration_trigger_mps2;
        // With `delay-only`, the first loss of speed decides.
        let delay_only = constants.lvd_below_threshold == BelowTrigger::DelayOnly;
        let found = first_above(decelerations, if delay_only { 0.0 } else { trigger_mps2 });
        let then = if delay_only {
            "perceived after the risk perception time; else the delay only"
        } else {
            "perceived after the risk perception time"
        };
        let quantity =
            if delay_only { "deceleration at the leader's first loss of speed" } else { "deceleration of the leader" };
        return vec![clause.reading((quantity, "m/s²"), found.unzip(), (Relation::Above, trigger_mps2), then)];
    }
    let wandering_m = constants.wandering_m;
    // A driver without wandering attends to vehicles within its lateral gate.
    let sees_gate = wandering_m <= 0.0 && category == Category::CutIn;
    let is_near = |step: &TracedStep| step.others[0].lateral_gap_m < constants.lateral_gate_m;
    let deviates = |step: &&TracedStep| if sees_gate { is_near(step) } else { deviation_m(step) > wandering_m };
    let event = trace.steps.iter().find(deviates);
    let seen = perceived(event);
    let found = first_above(trace.steps.iter().map(|step| (step.time_s, deviation_m(step))), wandering_m);
    let mut list = if sees_gate {
        vec![clause.reading(
            ("lateral gap at which the driver begins to see", "m"),
            event.map(|step| (step.time_s, step.others[0].lateral_gap_m)).unzip(),
            (Relation::AtMost, constants.lateral_gate_m),
            "perceived at once",
        )]
    } else {
        vec![clause.reading(
            ("deviation from the lane centre", "m"),
            found.unzip(),
            (Relation::Above, wandering_m),
            "perceived after the risk perception time",
        )]
    };
    let (quantity, value, threshold) = match category {
        Category::CutIn => {
            // A vehicle behind the ego has no TTC.
            let is_ahead = |step: &&TracedStep| step.others[0].gap_m + trace.mean_lengths_m[0] >= 0.0;
            let ttc_s = seen.filter(is_ahead).map(|step| step.others[0].ttc_s);
            ("TTC when perceived", ttc_s, constants.ttc_s)
        }
        _ => {
            let ego_mps = seen.map_or(f64::INFINITY, |step| step.v_ego_mps.max(1e-9));
            let headway_s = seen.map(|step| step.others[0].gap_m / ego_mps);
            // The driver's tolerance is a distance; this converts it to a headway.
            let tolerance_s = constants.cut_out_headway_tolerance_m / ego_mps;
            ("headway when perceived", headway_s, constants.cut_out_headway_s + tolerance_s)
        }
    };
    // Profiles without the headway test a TTC instead.
    if threshold > 0.0 {
        let then = if category != Category::CutIn && constants.cut_out_headway_tolerance_m > 0.0 {
            "braking begins after the delay; else once it holds (the threshold has the profile's tolerance, ours)"
        } else {
            "braking begins after the delay; else once it holds"
        };
        let at = (seen.map(|step| step.time_s), value);
        list.push(clause.reading((quantity, "s"), at, (Relation::AtMost, threshold), then));
    }
    list
}

/// Annex 3, the driver of the fuzzy safety model: it reacts if a surrogate is above 0.
fn fuzzy_driver(trace: &Trace) -> Vec<Reading> {
    let first = trace.steps.iter().find(|step| step.is_unsafe);
    let largest = |of: fn(&TracedVehicle) -> f64| {
        first.map(|step| step.others[..trace.vehicles].iter().map(of).fold(0.0, f64::max))
    };
    let clause = Clause { name: "Annex 3, FSM".to_owned(), has_conditions: false };
    let reading = |quantity, value| {
        let at = (first.map(|step| step.time_s), value);
        clause.reading((quantity, "1"), at, (Relation::Above, 0.0), "the driver reacts")
    };
    vec![
        reading("PFS at the reaction", largest(|other| other.pfs)),
        reading("CFS at the reaction", largest(|other| other.cfs)),
    ]
}
