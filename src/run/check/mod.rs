//! One concrete case against the regulation: every profile and model, the margins, the clauses, and how far the case
//! lies from the boundary of preventable cases.
//!
//! Here lives what is computed, in f64. The case comes from [`crate::scenario`]; the sheet is made by
//! [`crate::report`].

mod boundary;
mod clauses;
mod subject;

use std::cell::Cell;

use rayon::prelude::*;

pub use boundary::{Boundary, Change};
pub use clauses::{Reading, Relation};
pub use subject::{Lane, Subject};

use crate::engine::{NO_STEP, Outcome, StepMark, Trace, check_time_step};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::grid::{Perturbation, Point};
use crate::scenario::Category;
use crate::support::repeats::refuse_repeats;
use crate::{Error, Place, Result};

/// The drivers of Annex 3: a collision is *preventable* where one of them avoids it.
pub const REFERENCE_DRIVERS: [ModelId; 2] = [ModelId::Cchdm, ModelId::Fsm];

/// What is asked.
#[derive(Debug, Clone)]
pub struct Check {
    /// The case.
    pub subject: Subject,
    /// Profiles, in order; the first one decides. At least one.
    pub profiles: Vec<Profile>,
    /// Models, in order. At least one.
    pub models: Vec<ModelId>,
}

/// One driver model in the case.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The lane, step by step.
    pub trace: Trace,
    /// Perturbations under which the collision verdict is another one.
    pub flips: Vec<&'static str>,
}

/// The case under one profile.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// Name of the profile.
    pub profile: String,
    /// One entry per model.
    pub models: Vec<Judged>,
    /// Drivers of Annex 3 that avoid the collision.
    pub avoided_by: Vec<ModelId>,
    /// Perturbations under which the case changes from preventable to not, or back.
    pub flips: Vec<&'static str>,
    /// What the clauses say of the case.
    pub readings: Vec<Reading>,
    /// Where along each parameter the case stops (or starts) to be preventable.
    pub boundaries: Vec<Boundary>,
}

impl Judged {
    /// Does the driver collide?
    pub fn collides(&self) -> bool {
        collides(&self.trace.outcome)
    }

    /// Time at which braking begins, s, coasting left out.
    pub fn braking_s(&self, coasting_mps2: f64) -> Option<f64> {
        let brakes = |step: &&crate::engine::TracedStep| step.a_ego_mps2 < -(coasting_mps2 + 1e-6);
        let first = self.trace.steps.iter().find(brakes)?;
        // The acceleration is that of the step before.
        Some(self.trace.time_s(first.step.saturating_sub(1)))
    }

    /// Time of the first reaction, s.
    pub fn reaction_s(&self) -> Option<f64> {
        self.trace.step_of(StepMark::Reaction).map(|step| self.trace.time_s(step))
    }

    /// Closing speed at a contact, m/s.
    pub fn impact_closing_mps(&self) -> Option<f64> {
        let outcome = &self.trace.outcome;
        (outcome.contact_step != NO_STEP).then_some(outcome.impact_closing_speed)
    }
}

impl Judgement {
    /// Does a driver of Annex 3 avoid the collision?
    pub fn is_preventable(&self) -> bool {
        !self.avoided_by.is_empty()
    }

    /// Do all conditions of 5.2.5.2 hold, so that the system has to avoid the collision? `None` but for cut-ins.
    pub fn is_demanded(&self) -> Option<bool> {
        let mut of_clause = self.readings.iter().filter(|reading| reading.clause == clauses::LANE_INTRUSION).peekable();
        of_clause.peek()?;
        Some(of_clause.all(Reading::holds))
    }
}

/// Does each model collide?
fn verdicts(lane: &Lane, profile: &Profile, category: Category, budget: &StepBudget) -> Vec<bool> {
    let collides = |model| {
        let outcome = lane.run(profile, category, model);
        budget.take(&outcome);
        collides(&outcome)
    };
    ModelId::ALL.map(collides).to_vec()
}

fn collides(outcome: &Outcome<f64>) -> bool {
    outcome.verdicts.failed(Criterion::Collision)
}

/// Steps of the lanes of a check under one profile: seconds. A common check needs some millions.
const MAX_STEPS: u64 = 1 << 28;
/// Steps that are kept for sheet and table under one profile, 0.2 kB each.
const MAX_TRACED_STEPS: u64 = 1 << 20;

/// The steps that the lanes of a check may still make under a profile.
struct StepBudget<'p> {
    profile: &'p Profile,
    left: Cell<u64>,
}

impl StepBudget<'_> {
    /// Takes the steps of a lane.
    fn take(&self, outcome: &Outcome<f64>) {
        self.left.set(self.left.get().saturating_sub(u64::from(outcome.end_step) + 1));
    }

    fn is_spent(&self) -> bool {
        self.left.get() == 0
    }

    /// # Errors
    /// [`Error::Usage`] once it is spent.
    fn check(&self) -> Result<()> {
        if self.is_spent() { Err(too_many_steps(self.profile)) } else { Ok(()) }
    }
}

fn too_many_steps(profile: &Profile) -> Error {
    let frame = &profile.frame;
    Error::usage(
        Place::item(format!("profile `{}`", profile.name)),
        format!(
            "a check runs thousands of lanes, and these have too many steps: {} s each, until {} s",
            frame.dt_s, frame.time_cap_s
        ),
        "use a longer `frame.dt_s` or a shorter `frame.time_cap_s` (120 s with 0.04 s, for instance)",
    )
}

impl Check {
    /// Runs every model under every profile.
    ///
    /// # Errors
    /// [`Error::Usage`] for a case that cannot be made, a time step that is too long for it, lanes with too many steps, and a
    /// profile or model that is there twice.
    pub fn run(&self) -> Result<Vec<Judgement>> {
        refuse_repeats(|| Place::option("profiles"), self.profiles.iter().map(|p| (&p.name, &p.name)))?;
        refuse_repeats(|| Place::option("models"), self.models.iter().map(|model| (*model, model.name())))?;
        self.profiles.par_iter().map(|profile| self.under(profile)).collect()
    }

    fn under(&self, profile: &Profile) -> Result<Judgement> {
        let lane = self.subject.lane(profile, self.subject.point())?;
        profile.check_time_step(&self.models)?;
        check_time_step(&lane.case, &lane.tables, profile.frame.dt_s, || Place::item("the case"))?;
        let trace = |model| lane.trace(profile, self.subject.category(), model);
        let budget = StepBudget { profile, left: Cell::new(MAX_STEPS) };
        let run = |model: &ModelId| lane.run(profile, self.subject.category(), *model);
        let traced: u64 = self.models.iter().map(|model| u64::from(run(model).end_step) + 1).sum();
        if traced > MAX_TRACED_STEPS {
            return Err(too_many_steps(profile));
        }
        let changed = self.perturbed(profile, &budget)?;
        let flips = |avoids: &dyn Fn(&[bool]) -> bool| {
            let nominal = avoids(&changed[0].1);
            let differs = |(_, verdicts): &&(&'static str, Vec<bool>)| avoids(verdicts) != nominal;
            let mut names: Vec<&'static str> = changed.iter().filter(differs).map(|(name, _)| *name).collect();
            names.dedup();
            names
        };
        let position = |model: ModelId| ModelId::ALL.iter().position(|m| *m == model).unwrap_or(0);
        let models = self
            .models
            .iter()
            .map(|&model| Judged { trace: trace(model), flips: flips(&|verdicts| verdicts[position(model)]) });
        let references = REFERENCE_DRIVERS.map(position);
        let avoided_by = REFERENCE_DRIVERS.into_iter().filter(|&model| !changed[0].1[position(model)]).collect();
        Ok(Judgement {
            profile: profile.name.clone(),
            models: models.collect(),
            avoided_by,
            flips: flips(&|verdicts| references.iter().any(|&at| !verdicts[at])),
            readings: clauses::readings(profile, self.subject.category(), &trace),
            boundaries: boundary::boundaries(&self.subject, profile, &budget)?,
        })
    }

    /// Does each model collide, in the case and under each perturbation? The case itself comes first.
    fn perturbed(&self, profile: &Profile, budget: &StepBudget) -> Result<Vec<(&'static str, Vec<bool>)>> {
        let verdicts = |profile: &Profile, point: &Point| -> Result<Vec<bool>> {
            budget.check()?;
            let lane = self.subject.lane(profile, point)?;
            Ok(verdicts(&lane, profile, self.subject.category(), budget))
        };
        let mut all = vec![("", verdicts(profile, self.subject.point())?)];
        for perturbation in Perturbation::ALL {
            let point = perturbation.of_point(*self.subject.point());
            all.push((perturbation.label(), verdicts(&perturbation.profile(profile)?, &point)?));
        }
        Ok(all)
    }
}
