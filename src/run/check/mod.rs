//! Checks one concrete case against the regulation: every profile and model, the margins, the clauses, and the distance
//! to another answer.
//!
//! All computations here are in f64. The case comes from [`lanesweep_model::scenario`]; the report makes the sheet.

mod annex;
mod boundary;
mod clauses;
mod finer;
mod nominal;
mod sensitivity;
mod subject;
mod verdict;

use std::cell::Cell;

use rayon::prelude::*;

pub use boundary::{Boundary, Change};
pub use clauses::{Demand, Holds, Reading, Relation};
pub use finer::FinerStep;
pub use nominal::nominal_verdicts;
pub use sensitivity::RuleVerdicts;
pub use subject::{Lane, Subject};
use verdict::settled;
pub use verdict::{Answer, CaseVerdicts, DriverRule, RunEnd, Verdict};

use crate::grid::{Perturbation, Point, without_reaction};
use lanesweep_engine::{NO_STEP, Outcome, StepMark, Trace, check_time_step};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{Category, GAP_ERROR_M};
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result};

/// Input of a check.
#[derive(Debug, Clone)]
pub struct Check {
    /// The case.
    pub subject: Subject,
    /// Profiles, in order; the first one determines the answer. At least one.
    pub profiles: Vec<Profile>,
    /// Models, in order. At least one.
    pub models: Vec<ModelId>,
}

/// Leaves out profiles that only add a cut-in clause of their own to the first one, in cases of another category.
pub fn retain_applicable(profiles: &mut Vec<Profile>, category: Category) {
    let Some(first) = profiles.first().filter(|_| category != Category::CutIn).cloned() else { return };
    let is_first =
        |p: &Profile| (&p.frame, &p.cchdm, &p.rss, &p.fsm) == (&first.frame, &first.cchdm, &first.rss, &first.fsm);
    profiles.retain(|profile| profile.name == first.name || !is_first(profile));
}

/// One driver model in the case.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The lane, step by step.
    pub trace: Trace,
    /// Perturbations that change the collision verdict.
    pub flips: Vec<&'static str>,
    /// See [`Judgement::touching`].
    pub touches: bool,
}

/// The case under one profile.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// Name of the profile.
    pub profile: String,
    /// One entry per model.
    pub models: Vec<Judged>,
    /// The verdicts of the unperturbed case.
    pub verdicts: CaseVerdicts,
    /// Perturbations that change the answer.
    pub flips: Vec<&'static str>,
    /// Perturbations of a case without conflict under which an ego that never reacts still closes at the time cap.
    pub open_with: Vec<&'static str>,
    /// Perturbations that change each driver's collision verdict, in the order of [`ModelId::ALL`].
    pub driver_flips: Vec<Vec<&'static str>>,
    /// Drivers that avoid the collision by a gap that is not distinguishable from a contact: it is below 1 cm, or
    /// becomes so as the time step goes to 0.
    pub touching: Vec<ModelId>,
    /// Perturbations that change what the cut-in clause demands.
    pub demand_flips: Vec<&'static str>,
    /// Clause of cut-ins, according to the profile; empty without one.
    pub clause: String,
    /// The danger that the profile's CCHDM detects, in a few words.
    pub danger: String,
    /// Why Annex 3 does not describe the case; `None` if it does, or if the profile does not implement Annex 3.
    pub outside_annex: Option<String>,
    /// Perturbations that change whether Annex 3 describes the case.
    pub annex_flips: Vec<&'static str>,
    /// Interpretations where the regulation is silent whose alternative changes the answer or the verdict of a reference
    /// driver.
    pub silent: Vec<String>,
    /// Whether such an alternative changes the answer.
    pub reading_turns_answer: bool,
    /// Whether such an alternative changes what the clause of cut-ins demands.
    pub reading_turns_demand: bool,
    /// The reference drivers whose verdict such an alternative changes.
    pub reading_turns: Vec<ModelId>,
    /// The clauses applied to the case.
    pub readings: Vec<Reading>,
    /// Values of each parameter at which the answer changes.
    pub boundaries: Vec<Boundary>,
    /// The runs with a tenth of the time step; `None` without the boundaries.
    pub finer: Option<FinerStep>,
    /// The verdicts by rule, of the profile as it is and of each other reading; empty without reference drivers or without the
    /// boundaries.
    pub by_rule: Vec<RuleVerdicts>,
    /// Maximum duration of a run, s.
    pub time_cap_s: f64,
    /// Cut-out: the time from which the vehicle that cuts out drives through the one ahead of it, s.
    pub drives_through_s: Option<f64>,
}

impl Judged {
    /// Whether the driver collides.
    pub fn collides(&self) -> bool {
        collides(&self.trace.outcome)
    }

    /// Time at which braking begins, s: [`StepMark::Braking`].
    pub fn braking_s(&self) -> Option<f64> {
        self.trace.step_of(StepMark::Braking).map(|step| self.trace.time_s(step))
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
    /// The answer, if no perturbation changes it, the time step resolves the gap that it rests on, and Annex 3 describes
    /// the case. An answer of no conflict does not need Annex 3.
    pub fn verdict(&self) -> Verdict {
        settled(self.verdicts.verdict(), self.flips.is_empty() && !self.rests_on_touching())
    }

    /// Reference drivers that avoid a collision which an ego without a reaction has.
    pub fn avoiders(&self) -> Vec<ModelId> {
        if self.verdicts.unreacting == RunEnd::Contact { self.verdicts.avoided_by() } else { Vec::new() }
    }

    /// Whether every driver that avoids the collision touches.
    pub fn rests_on_touching(&self) -> bool {
        self.verdicts.rests_on(&self.touching, DriverRule::Any)
    }

    /// What the clause of cut-ins demands. `None` for other cases and for a profile without a clause.
    pub fn demand(&self) -> Option<Demand> {
        clauses::demand(&self.readings)
    }

    /// The conditions of the clause of cut-ins.
    pub fn conditions(&self) -> impl Iterator<Item = &Reading> {
        self.readings.iter().filter(|reading| reading.is_condition)
    }

    /// Perturbations that change a driver's collision verdict.
    pub fn flips_of(&self, model: ModelId) -> &[&'static str] {
        let at = ModelId::ALL.iter().position(|m| *m == model);
        at.map_or(&[], |at| &self.driver_flips[at])
    }
}

/// How the run of each model and that of an ego that never reacts end.
fn verdicts(lane: &Lane, point: &Point, profile: &Profile, category: Category, budget: &StepBudget) -> CaseVerdicts {
    let ran = |profile: &Profile, model| {
        let run = lane.run(profile, category, model);
        budget.take(&run.outcome);
        (RunEnd::of(&run), run.min_gap_m)
    };
    let drivers = ModelId::ALL.map(|model| ran(profile, model));
    CaseVerdicts {
        collide: drivers.map(|(end, _)| end == RunEnd::Contact),
        min_gap_m: drivers.map(|(_, min_gap_m)| min_gap_m),
        unreacting: ran(&without_reaction(profile), ModelId::Reg157).0,
        is_outside_annex: annex::outside(profile, category, point).is_some(),
        reference_drivers: profile.reference_drivers.clone(),
    }
}

/// The gap to which that of two time steps tends as the step goes to 0, m. The error of a step is proportional to it.
fn limit_gap_m((gap_m, dt_s): (f64, f64), (finer_gap_m, finer_dt_s): (f64, f64)) -> f64 {
    if finer_dt_s < dt_s { finer_gap_m - (gap_m - finer_gap_m) * finer_dt_s / (dt_s - finer_dt_s) } else { gap_m }
}

fn collides(outcome: &Outcome<f64>) -> bool {
    outcome.verdicts.failed(Criterion::Collision)
}

/// Maximum steps of the lanes of a check under one profile: some seconds. A typical check makes some millions.
const MAX_STEPS: u64 = 1 << 28;
/// Maximum steps kept for sheet and table under one profile, 0.2 kB each.
const MAX_TRACED_STEPS: u64 = 1 << 20;

/// The remaining steps of a check under a profile.
struct StepBudget<'p> {
    profile: &'p Profile,
    left: Cell<u64>,
}

impl StepBudget<'_> {
    /// Subtracts the steps of a lane.
    fn take(&self, outcome: &Outcome<f64>) {
        self.left.set(self.left.get().saturating_sub(u64::from(outcome.end_step) + 1));
    }

    fn is_spent(&self) -> bool {
        self.left.get() == 0
    }

    /// # Errors
    /// [`Error::Usage`] if the budget is spent.
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
    /// [`Error::Usage`] for an invalid case, a time step that is too long for it, lanes with too many steps, and a
    /// duplicate profile or model.
    pub fn run(&self) -> Result<Vec<Judgement>> {
        self.judge(true)
    }

    /// Like [`Check::run`], without the values at which the answer changes, which need by far the most lanes, and without
    /// the verdicts by rule.
    ///
    /// # Errors
    /// As [`Check::run`].
    pub fn run_without_boundaries(&self) -> Result<Vec<Judgement>> {
        self.judge(false)
    }

    fn judge(&self, with_boundaries: bool) -> Result<Vec<Judgement>> {
        refuse_repeats(|| Place::option("profiles"), self.profiles.iter().map(|p| (&p.name, &p.name)))?;
        refuse_repeats(|| Place::option("models"), self.models.iter().map(|model| (*model, model.name())))?;
        self.profiles.par_iter().map(|profile| self.under(profile, with_boundaries)).collect()
    }

    fn under(&self, profile: &Profile, with_boundaries: bool) -> Result<Judgement> {
        let (lane, category) = (self.subject.lane(profile, self.subject.point())?, self.subject.category());
        profile.check_time_step(&self.models)?;
        check_time_step(&lane.case, &lane.tables, profile.frame.dt_s, || Place::item("the case"))?;
        let trace = |model| lane.trace(profile, category, model);
        let budget = StepBudget { profile, left: Cell::new(MAX_STEPS) };
        let steps = |profile: &Profile, model| u64::from(lane.run(profile, category, model).outcome.end_step) + 1;
        let traced: u64 = self.models.iter().map(|model| steps(profile, *model)).sum();
        if traced + steps(&without_reaction(profile), ModelId::Reg157) > MAX_TRACED_STEPS {
            return Err(too_many_steps(profile));
        }
        let changed = self.perturbed(profile, false, &budget)?;
        let touching = self.touching(&changed, profile)?;
        let is_quiet = changed[0].verdicts.answer() == Answer::NoConflict;
        let opens = |changed: &&Changed| is_quiet && changed.verdicts.answer() == Answer::Open;
        let driver = |model: ModelId| flips(&changed, |changed| changed.verdicts.collides(model));
        let models = self.models.iter().map(|&model| Judged {
            trace: trace(model),
            flips: driver(model),
            touches: touching.contains(&model),
        });
        let unreacting = || lane.unreacting(profile, category);
        let attends_at_once = annex::attends_at_once(profile, category, &lane);
        let (mut silent, turned) = self.silent(profile, &changed[0], &budget)?;
        silent.extend(attends_at_once.map(str::to_owned));
        let is = &changed[0].verdicts;
        let turns =
            |model: &&ModelId| turned.iter().any(|other| other.verdicts.collides(**model) != is.collides(**model));
        let (mut boundaries, mut finer, mut by_rule) = Default::default();
        if with_boundaries {
            boundaries = boundary::boundaries(&self.subject, profile, &budget)?;
            finer = Some(FinerStep::run(self, profile, &budget)?);
            by_rule = self.by_rule(profile, (&changed, &touching), &budget)?;
        }
        Ok(Judgement {
            profile: profile.name.clone(),
            models: models.collect(),
            verdicts: changed[0].verdicts.clone(),
            flips: flips(&changed, |changed| changed.verdicts.answer_within_the_cap(DriverRule::Any)),
            open_with: changed.iter().filter(opens).map(|changed| changed.by).collect(),
            driver_flips: ModelId::ALL.map(driver).to_vec(),
            demand_flips: flips(&changed, |changed| changed.demand),
            clause: profile.reg157.clause.clone(),
            danger: annex::danger(profile, category),
            outside_annex: annex::outside(profile, category, self.subject.point()),
            annex_flips: flips(&changed, |changed| changed.verdicts.is_outside_annex),
            silent,
            reading_turns_answer: turned.iter().any(|other| other.verdicts.answer() != is.answer()),
            reading_turns_demand: turned.iter().any(|other| other.demand != changed[0].demand),
            reading_turns: is.reference_drivers.iter().filter(turns).copied().collect(),
            readings: clauses::readings(profile, category, unreacting, &trace, attends_at_once.is_some()),
            boundaries,
            finer,
            by_rule,
            touching,
            time_cap_s: profile.frame.time_cap_s,
            drives_through_s: self.subject.drives_through_s(profile)?,
        })
    }

    /// Drivers whose smallest gap is not distinguishable from a contact.
    fn touching(&self, changed: &[Changed], profile: &Profile) -> Result<Vec<ModelId>> {
        let finer = Perturbation::FINER_STEP;
        let Some(found) = changed.iter().find(|changed| changed.by == finer.label()) else { return Ok(Vec::new()) };
        let finer_dt_s = finer.profile(profile)?.frame.dt_s;
        let touches = |model: &ModelId| {
            let [gap, finer_gap] = [&changed[0], found].map(|of| of.verdicts.min_gap_m[model.index()]);
            let limit_m = limit_gap_m((gap, profile.frame.dt_s), (finer_gap, finer_dt_s));
            !changed[0].verdicts.collides(*model) && gap.min(limit_m) < GAP_ERROR_M
        };
        Ok(ModelId::ALL.into_iter().filter(touches).collect())
    }

    /// Interpretations where the regulation is silent on which the answer depends, and the verdicts with the other ones.
    fn silent(&self, profile: &Profile, is: &Changed, budget: &StepBudget) -> Result<(Vec<String>, Vec<Changed>)> {
        let mut all: (Vec<String>, Vec<Changed>) = Default::default();
        for other in annex::readings_where_silent(profile, &self.subject)? {
            let found = self.changed("", &other.profile, self.subject.point(), other.tests_once, budget)?;
            let (theirs, ours) = (&found.verdicts, &is.verdicts);
            let turns = |model: &ModelId| theirs.collides(*model) != ours.collides(*model);
            let turns_driver = ours.reference_drivers.iter().any(turns);
            if theirs.answer() != ours.answer() || found.demand != is.demand || turns_driver {
                if !all.0.contains(&other.sentence) {
                    all.0.push(other.sentence);
                }
                all.1.push(found);
            }
        }
        Ok(all)
    }

    /// The case with the numbers of a point.
    fn changed(
        &self,
        by: &'static str,
        profile: &Profile,
        point: &Point,
        tests_once: bool,
        budget: &StepBudget,
    ) -> Result<Changed> {
        budget.check()?;
        let category = self.subject.category();
        let lane = self.subject.lane(profile, point)?;
        let profile = &*annex::read_in(profile, tests_once, &lane, category);
        let verdicts = verdicts(&lane, point, profile, category, budget);
        let readings = clauses::lane_intrusion(profile, category, || lane.unreacting(profile, category));
        Ok(Changed { by, verdicts, demand: clauses::demand(&readings) })
    }

    /// The verdicts of the case, then those of each perturbation.
    fn perturbed(&self, profile: &Profile, tests_once: bool, budget: &StepBudget) -> Result<Vec<Changed>> {
        let changed = |by, profile: &Profile, point: &Point| self.changed(by, profile, point, tests_once, budget);
        let mut all = vec![changed("", profile, self.subject.point())?];
        for perturbation in Perturbation::all(self.subject.category()) {
            let point = perturbation.of_point(*self.subject.point());
            all.push(changed(perturbation.label(), &perturbation.profile(profile)?, &point)?);
        }
        Ok(all)
    }
}

/// The case after a perturbation.
struct Changed {
    by: &'static str,
    verdicts: CaseVerdicts,
    demand: Option<Demand>,
}

/// Perturbations under which a result differs from that of the first entry.
fn flips<T: PartialEq>(all: &[Changed], of: impl Fn(&Changed) -> T) -> Vec<&'static str> {
    let differs = |changed: &&Changed| of(changed) != of(&all[0]);
    all.iter().filter(differs).map(|changed| changed.by).collect()
}
