//! Lanes with every step: a reopened lane with other variants and models of its scenario, or the lanes of one case.

use super::Reopened;
use lanesweep_engine::{Headway, LaneCase, LaneKey, LanePlan, LaneRunner, Outcome, Trace, check_time_step};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::parameterization::{Sizes, VehicleSize};
use lanesweep_model::scenario::{Case, Tables};
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result};

/// A lane with every step.
pub struct TracedLane {
    /// The lane's key; without one, a text that distinguishes it from the others.
    pub key: String,
    /// Name on a sheet with several lanes.
    pub name: String,
    /// The steps.
    pub trace: Trace,
    /// The outcome of the same lane in f64, if the trace is in the lane arithmetic.
    pub reference: Option<Outcome<f64>>,
}

/// Lanes with every step, and their common properties.
pub struct TracedLanes {
    /// At least one.
    pub lanes: Vec<TracedLane>,
    /// Origin of the lanes, in a few words.
    pub origin: String,
    /// The program generated the data, in whole or in part.
    pub is_synthetic: bool,
}

/// One concrete case with every step of each model, in f64.
pub struct TracedCase {
    /// The case record of its lanes.
    pub case: LaneCase<f64>,
    /// The series that the case indexes.
    pub tables: Tables<f64>,
    /// The initial headway or gap.
    pub headway: Headway,
    /// Sizes of its vehicles.
    pub sizes: Sizes,
    /// One per model.
    pub traces: Vec<Trace>,
}

impl TracedCase {
    /// Runs a case.
    ///
    /// # Errors
    /// [`Error::Usage`] for a time step that is too long for a model or the case.
    pub fn run(case: &Case, headway: Headway, profile: &Profile, models: &[ModelId]) -> Result<TracedCase> {
        let size = |length_m, width_m| VehicleSize { length_m, width_m };
        let sizes = Sizes {
            ego: size(case.ego_length_m, case.ego_width_m),
            target: size(case.principal.length_m, case.principal.width_m),
            lead: case.ahead.as_ref().map(|a| size(a.vehicle.length_m, a.vehicle.width_m)),
            lane_width_m: case.lane_width_m,
        };
        let (category, mut tables) = (case.category, Tables::default());
        let case = LaneCase::encode(case, profile, &mut tables);
        profile.check_time_step(models)?;
        check_time_step(&case, &tables, profile.frame.dt_s, || Place::item("the case"))?;
        let trace = |model: &ModelId| Trace::record(profile, category, &case, &tables, headway, *model);
        let traces = models.iter().map(trace).collect();
        Ok(TracedCase { case, tables, headway, sizes, traces })
    }

    /// Its lanes, for the profile that they were run with.
    pub fn into_lanes(self, profile: &Profile) -> TracedLanes {
        let lane = |trace: Trace| {
            let name = trace.model.name().to_owned();
            TracedLane { key: name.clone(), name, trace, reference: None }
        };
        TracedLanes {
            lanes: self.traces.into_iter().map(lane).collect(),
            origin: format!("profile {}, f64, one case", profile.name),
            is_synthetic: false,
        }
    }
}

impl Reopened {
    /// Runs lanes; see [`Reopened::named`].
    ///
    /// # Errors
    /// As [`Reopened::with_cases`].
    pub fn traced(&self, keys: &[LaneKey]) -> Result<TracedLanes> {
        let lanes = self.with_cases(keys, |plan| {
            Ok(if self.is_reference {
                traced::<f64>(plan, keys, None)
            } else {
                traced::<f32>(plan, keys, Some(LaneRunner::new(plan)))
            })
        })?;
        let arithmetic = if self.is_reference { "f64" } else { "f32" };
        let data = if self.density().is_some() { "sampled" } else { &*self.data };
        let origin = format!("profile {}, {arithmetic}, {data}", self.plan().profile.name);
        Ok(TracedLanes { lanes, origin, is_synthetic: self.is_synthetic })
    }
}

fn traced<R: Real>(plan: &LanePlan, keys: &[LaneKey], reference: Option<LaneRunner<'_, f64>>) -> Vec<TracedLane> {
    let runner = LaneRunner::<R>::new(plan);
    // A name says in what the lanes differ.
    let parts = |text: &str| text.rsplitn(4, '/').map(str::to_owned).collect::<Vec<_>>();
    let texts: Vec<String> = keys.iter().map(|key| plan.key_text(key)).collect();
    let differs = |at: usize| texts.iter().any(|text| parts(text)[at] != parts(&texts[0])[at]);
    let differing: Vec<usize> = (0..4).rev().filter(|at| differs(*at)).collect();
    let lane = |(key, text): (&LaneKey, &String)| {
        let of = parts(text);
        let name = differing.iter().map(|at| of[*at].clone()).collect::<Vec<_>>().join(", ");
        TracedLane {
            name: if name.is_empty() { of[0].clone() } else { name },
            trace: runner.trace(key),
            reference: reference.as_ref().map(|runner| runner.run(key)),
            key: text.clone(),
        }
    };
    keys.iter().zip(&texts).map(lane).collect()
}

/// The variants to compare with, in the plan's order, then the lane's own.
pub(super) fn variants(plan: &LanePlan, key: &LaneKey, compare: &[String]) -> Result<Vec<usize>> {
    let names = &plan.blocks[key.block].variants;
    let mut variants = Vec::new();
    refuse_repeats(|| Place::option("compare"), compare.iter().map(|name| (name.trim(), name.trim())))?;
    for name in compare.iter().map(|name| name.trim()) {
        match names.iter().position(|n| n == name) {
            Some(at) => variants.push(at),
            None if name == "all" => variants.extend(0..names.len()),
            None => {
                let problem = format!("this lane's scenario has no variant `{name}`");
                let help = format!("use {} or `all`", names.join(", "));
                return Err(Error::usage(Place::option("compare"), problem, help));
            }
        }
    }
    variants.sort_unstable();
    variants.dedup();
    variants.retain(|variant| *variant != key.variant);
    if variants.is_empty() && !compare.is_empty() {
        let problem = "this is the lane itself, so there is nothing to compare";
        let others = names.iter().enumerate().filter(|(at, _)| *at != key.variant).map(|(_, name)| name.as_str());
        let help = format!("name other variants: {}", others.collect::<Vec<_>>().join(", "));
        return Err(Error::usage(Place::option("compare"), problem, help));
    }
    // S first, because the others are compared with it.
    variants.push(key.variant);
    variants.sort_by_key(|variant| *variant != 0);
    Ok(variants)
}
