//! Converts lanes to concrete scenarios: runs them in their own arithmetic, with the sizes, paths and numbers of their
//! case.
//!
//! A lane stores the ego's width and half the sums of two lengths. Unknown lengths are chosen so that the sums, and
//! therefore every gap and contact, stay the same.

use super::concrete::{Concrete, EgoMotion, PlayedVehicle, paths};
use crate::records::smallest_gap_m;
use lanesweep_engine::{EndReason, LaneCase, LaneKey, LanePlan, LaneRunner, NO_STEP, Trace};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::NEVER;
use lanesweep_model::profile::{CutOutTarget, Profile};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::parameterization::{Sizes, VehicleSize};
use lanesweep_model::scenario::{Category, LATERAL_SAMPLED, SPEED_SAMPLED, Scenario, Side, Tables};
use lanesweep_run::reopen::{Reopened, TracedCase};
use lanesweep_support::{Error, Place, Result, option};

/// Options of the export.
#[derive(Debug, Clone, Copy)]
pub struct PlayOptions {
    /// Who drives the ego.
    pub ego: EgoMotion,
    /// Duration of a scenario with an external ego, s.
    pub duration_s: Option<f64>,
    /// Side of the other vehicles; overrides the scenario's.
    pub side: Option<Side>,
    /// Width of the road's lanes, m; overrides the scenario's.
    pub lane_width_m: Option<f64>,
}

/// Time after the last event for which a scenario with an external ego continues, s.
const AFTERWARDS_S: f64 = 10.0;

/// Facts about a lane in addition to its case.
struct LaneFacts<'a> {
    key: String,
    profile: &'a Profile,
    sizes: Option<Sizes>,
    scenario: Option<&'a Scenario>,
    data: &'a str,
    arithmetic: &'static str,
    is_synthetic: bool,
    /// Parameters of a sampled point.
    drawn: Vec<(String, f64)>,
}

/// Converts lanes; `scenarios` give sizes, side and lane width. Also returns whether the lengths of all vehicles are
/// known.
///
/// # Errors
/// [`Error::Input`] for a lane that cannot be exported, and for scenarios that do not belong to the run.
pub fn concrete_lanes(
    reopened: &Reopened,
    keys: &[LaneKey],
    scenarios: &[Scenario],
    options: &PlayOptions,
) -> Result<(Vec<Concrete>, bool)> {
    reopened.with_cases(keys, |plan| match reopened.is_reference {
        true => lanes::<f64>(plan, keys, reopened, scenarios, options),
        false => lanes::<f32>(plan, keys, reopened, scenarios, options),
    })
}

/// Converts one case with each of its models, in f64.
///
/// # Errors
/// As [`concrete_lanes`].
pub fn concrete_case(traced: &TracedCase, profile: &Profile, options: &PlayOptions) -> Result<Vec<Concrete>> {
    let one = |trace: &Trace| {
        let facts = LaneFacts {
            key: format!("{}/{}/{}", trace.category.key(), traced.headway, trace.model.name()),
            profile,
            sizes: Some(traced.sizes),
            scenario: None,
            data: "a case of flags",
            arithmetic: "binary64",
            is_synthetic: false,
            drawn: Vec::new(),
        };
        concrete(trace, (&traced.case, &traced.tables), &traced.case, &facts, options)
    };
    traced.traces.iter().map(one).collect()
}

fn lanes<R: Real>(
    plan: &LanePlan,
    keys: &[LaneKey],
    reopened: &Reopened,
    scenarios: &[Scenario],
    options: &PlayOptions,
) -> Result<(Vec<Concrete>, bool)> {
    let runner = LaneRunner::<R>::new(plan);
    let is_synthetic = reopened.is_synthetic || scenarios.iter().any(|scenario| scenario.synthetic);
    let (mut found, mut are_lengths_known) = (Vec::new(), true);
    for key in keys {
        let (case, tables) = runner.case(key.block, key.unit, key.variant);
        let id = plan.blocks[key.block].units.name(key.unit);
        let scenario = scenarios.iter().find(|s| s.id == id);
        let drawn = match (plan.generator(), reopened.density()) {
            (Some(generator), Some(density)) => {
                let values = generator.draw(key.unit).values;
                let shortest = |v: &f32| v.to_string().parse::<f64>().unwrap_or(f64::from(*v));
                let names = density.space.parameters().iter().map(|p| p.name.clone());
                names.zip(values.iter().map(shortest)).collect()
            }
            _ => Vec::new(),
        };
        let sizes = reopened.density().map(|density| density.sizes).or_else(|| scenario.map(Sizes::of));
        are_lengths_known &= sizes.is_some();
        let facts = LaneFacts {
            key: plan.key_text(key),
            profile: &plan.profile,
            sizes,
            scenario,
            data: &reopened.data,
            arithmetic: if reopened.is_reference { "binary64" } else { "binary32" },
            is_synthetic,
            drawn,
        };
        let (trace, own): (_, (_, &Tables<R>)) = (runner.trace(key), (&case, &tables));
        found.push(match plan.generator() {
            Some(_) => concrete(&trace, own, &case, &facts, options)?,
            None => concrete(&trace, own, &plan.case(key.block, key.unit, key.variant), &facts, options)?,
        });
    }
    Ok((found, are_lengths_known))
}

/// `wide` is the case before it was rounded to the arithmetic of the lane, if that is known.
fn concrete<R: Real, W: Real>(
    trace: &Trace,
    (case, tables): (&LaneCase<R>, &Tables<R>),
    wide: &LaneCase<W>,
    facts: &LaneFacts,
    options: &PlayOptions,
) -> Result<Concrete> {
    let profile = facts.profile;
    let from = case.others[0].present_from;
    let is_exposed = trace.category == Category::CutOut && profile.frame.cut_out_target == CutOutTarget::Exposed;
    if is_exposed && from != NEVER {
        let problem = "the cutting-out vehicle hits the one ahead, whose position the lane has only after that";
        let help = "use a profile that judges every vehicle of a cut-out, such as paper";
        return Err(Error::input(Place::item(format!("lane {}", facts.key)), problem, help));
    }
    let sizes = sizes_of_case(&facts.key, wide, facts.sizes.as_ref(), profile.frame.default_length_m)?;
    let last_traced = trace.steps.last().map_or(0, |s| s.step);
    let last = match options.ego {
        EgoMotion::Model => last_traced,
        EgoMotion::External => {
            let steps = |seconds: f64| (seconds / trace.dt_s - 1e-9).ceil().max(0.0) as u32;
            let otherwise = || last_traced.max(case.horizon.min(profile.step_cap())) + steps(AFTERWARDS_S);
            options.duration_s.map_or_else(otherwise, steps)
        }
    };
    // A trajectory has at least two vertices.
    let mut all = paths(trace, case, tables, last.max(1)).into_iter();
    let mut vehicle = |name, size: VehicleSize| PlayedVehicle {
        name,
        length_m: size.length_m,
        width_m: size.width_m,
        path: all.next().unwrap_or_default(),
    };
    let mut vehicles = vec![vehicle("Ego", sizes.ego), vehicle("Other", sizes.target)];
    if let Some(lead) = sizes.lead.filter(|_| trace.vehicles == 2) {
        vehicles.push(vehicle("Ahead", lead));
    }
    let scenario = facts.scenario;
    Ok(Concrete {
        key: facts.key.clone(),
        category: trace.category,
        ego: options.ego,
        side: options.side.or(scenario.map(|s| s.side)).unwrap_or(Side::Left),
        lane_width_m: options
            .lane_width_m
            .or(scenario.map(|s| s.lane_width))
            .unwrap_or(wide.lane_width.to_f64())
            .clamp(1.0, 20.0),
        vehicles,
        parameters: parameters(trace, wide, facts),
        properties: properties(trace, facts, options),
        is_synthetic: facts.is_synthetic,
    })
}

/// The case's parameters by name; those of a sampled point by the names of its density.
fn parameters<W: Real>(trace: &Trace, case: &LaneCase<W>, facts: &LaneFacts) -> Vec<(String, f64)> {
    // Remove the rounding error of a product with the time step if the decimal gives the same product; else keep every
    // digit.
    let decimal = |value: f64| {
        let short = (value * 1e9).round() / 1e9;
        if short * trace.dt_s == value * trace.dt_s { short } else { value }
    };
    let first = &trace.steps[0];
    let mut list = vec![
        ("ego_speed_mps", decimal(first.v_ego_mps)),
        ("other_speed_mps", decimal(first.others[0].v_mps)),
        ("gap_m", decimal(trace.initial_gap_m)),
    ];
    let motion = &case.others[0].motion;
    if facts.drawn.is_empty() {
        let [speed_per_step, lateral_per_step] = [motion.speed_per_step, motion.lateral_per_step].map(W::to_f64);
        if motion.kind & SPEED_SAMPLED == 0 && speed_per_step != 0.0 {
            list.push(("other_acceleration_mps2", decimal(speed_per_step / trace.dt_s)));
            list.push(("end_speed_mps", decimal(motion.speed_end.to_f64())));
        }
        if motion.kind & LATERAL_SAMPLED == 0 && lateral_per_step != 0.0 {
            let distance_m = motion.lateral_end.to_f64() - motion.lateral_initial.to_f64();
            list.push(("lateral_speed_mps", decimal(lateral_per_step.abs() / trace.dt_s)));
            list.push(("lateral_distance_m", decimal(distance_m.abs())));
        }
    }
    if trace.vehicles == 2 {
        list.push(("ahead_speed_mps", decimal(first.others[1].v_mps)));
    }
    let mut list: Vec<(String, f64)> = list.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    let drawn = facts.drawn.iter().filter(|(_, value)| value.is_finite());
    list.extend(drawn.map(|(name, value)| (format!("sampled_{name}"), *value)));
    list
}

/// Facts about the lane and its end. Times in s; empty if the event did not happen.
fn properties(trace: &Trace, facts: &LaneFacts, options: &PlayOptions) -> Vec<(&'static str, String)> {
    let outcome = &trace.outcome;
    let time = |step: u32| if step == NO_STEP { String::new() } else { trace.time_s(step).to_string() };
    let value = |v: f64| v.to_string();
    let at_contact = |v: f64| if outcome.contact_step == NO_STEP { String::new() } else { value(v) };
    let verdict = |c: Criterion| if outcome.verdicts.failed(c) { "fail" } else { "pass" }.to_owned();
    let end = match outcome.end {
        EndReason::Contact => "contact",
        EndReason::Settled => "settled",
        EndReason::Standstill => "standstill",
        EndReason::Cap => "time cap",
        EndReason::Aborted => "aborted",
    };
    let ego = match options.ego {
        EgoMotion::Model => "model",
        EgoMotion::External => "external",
    };
    vec![
        ("lane", facts.key.clone()),
        ("model", trace.model.name().to_owned()),
        ("profile", facts.profile.name.clone()),
        ("dt_s", trace.dt_s.to_string()),
        ("arithmetic", facts.arithmetic.to_owned()),
        ("data", facts.data.to_owned()),
        ("ego", ego.to_owned()),
        ("lengths", if facts.sizes.is_some() { "known" } else { "sums" }.to_owned()),
        ("initial_gap_m", value(trace.initial_gap_m)),
        ("collision", verdict(Criterion::Collision)),
        ("ttc", verdict(Criterion::Ttc)),
        ("btn", verdict(Criterion::Btn)),
        ("min_ttc_s", value(outcome.min_ttc)),
        ("max_btn", value(outcome.max_btn)),
        ("min_gap_m", value(smallest_gap_m(outcome))),
        ("reaction_s", time(outcome.reaction_step)),
        ("contact_s", time(outcome.contact_step)),
        ("impact_speed_mps", at_contact(outcome.impact_speed)),
        ("impact_closing_speed_mps", at_contact(outcome.impact_closing_speed)),
        ("end_s", time(outcome.end_step)),
        ("end", end.to_owned()),
    ]
}

/// Maximum difference between given sizes and the lane's, m: the rounding of binary32.
const TOLERANCE_M: f64 = 1e-3;

/// The sizes of a case's vehicles: the given ones if they match the lane; otherwise an ego of `ego_length_m`, or
/// shorter if the sums require it. Then only the sums of lengths are correct.
///
/// # Errors
/// [`Error::Input`] if the given sizes do not match the lane.
fn sizes_of_case<W: Real>(lane: &str, case: &LaneCase<W>, known: Option<&Sizes>, ego_length_m: f64) -> Result<Sizes> {
    let is_pair = case.pair != 0;
    let (ego_width, lane_width_m) = (case.ego_width.to_f64(), case.lane_width.to_f64());
    let lengths = case.others.map(|other| 2.0 * other.half_lengths.to_f64());
    let widths = case.others.map(|other| 2.0 * other.half_widths.to_f64());
    let Some(known) = known else {
        let shortest = if is_pair { lengths[0].min(lengths[1]) } else { lengths[0] };
        // Every vehicle has a length above 0.
        let ego = ego_length_m.min(shortest / 2.0);
        let size = |at: usize| VehicleSize { length_m: lengths[at] - ego, width_m: widths[at] - ego_width };
        return Ok(Sizes {
            ego: VehicleSize { length_m: ego, width_m: ego_width },
            target: size(0),
            lead: is_pair.then(|| size(1)),
            lane_width_m,
        });
    };
    let others = [Some(known.target), known.lead.filter(|_| is_pair)];
    let mut pairs = vec![("width of the ego", known.ego.width_m, ego_width)];
    for (at, other) in others.iter().enumerate().filter_map(|(at, other)| Some((at, other.as_ref()?))) {
        pairs.push(("sum of two lengths", known.ego.length_m + other.length_m, lengths[at]));
        pairs.push(("sum of two widths", known.ego.width_m + other.width_m, widths[at]));
    }
    let problem = match pairs.iter().find(|(_, a, b)| (a - b).abs() > TOLERANCE_M) {
        Some((what, known, run)) => format!("the {what} is {known} m by the scenarios and {run} m in the run"),
        None if is_pair && known.lead.is_none() => "the vehicle ahead has no size".to_owned(),
        None => return Ok(*known),
    };
    let scenarios = option("scenarios");
    let help = format!("give the scenario file of the run ({scenarios}), or leave it out: every gap and contact stays");
    Err(Error::input(Place::item(format!("lane {lane}")), problem, help))
}
