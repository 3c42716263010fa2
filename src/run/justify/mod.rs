//! A dossier: whether a parameterization is appropriate for one driver model, one kind of scenario and one criterion on
//! this data. The paper ends with this question.
//!
//! This module computes hidden failures, scores with intervals, groups, risk ratios, coverage and the conclusion by
//! rules. Lanes and densities come from [`crate::run::compare`]; the report makes the page.

mod rules;
mod scores;

pub use rules::{Conclusion, Finding, LIMITS, Need, Rules};
use scores::Replay;
pub use scores::{Group, Scored, Share};

use crate::engine::{Executor, Headway, LaneKey, LaneRunner, Outcome, SweepSummary, Trace};
use crate::model::criterion::{Contact, Criterion};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::close_following::{CloseFollowing, close_units};
use crate::run::compare::CompareOptions;
use crate::run::sampling::ComparedCell;
use crate::run::score::ScoreOptions;
use crate::scenario::DataProvenance;
use crate::scenario::Scenario;
use crate::scenario::parameterization::Parameterization;
use crate::stats::density::{DensityKind, Fitted};
use crate::support::ranges;
use crate::{Error, Place, Result};

/// Profile whose recall is reported in addition to that of the selected profile: a reading of UN R157.
pub const REGULATION: &str = "un-r157";

/// Options of a dossier.
#[derive(Debug, Clone)]
pub struct JustifyOptions {
    /// Data and density: one category, one model, one parameterization.
    pub compare: CompareOptions,
    /// Criterion.
    pub criterion: Criterion,
    /// Confidence level and minimum number of failures.
    pub score: ScoreOptions,
    /// When a parameterization is appropriate.
    pub rules: Rules,
}

/// A failure of S that the parameterization hides.
#[derive(Debug, Clone)]
pub struct Hidden {
    /// Lane of S'.
    pub lane: LaneKey,
    /// Its key as text.
    pub key: String,
    /// Scenario.
    pub scenario: String,
    /// Headway.
    pub headway: String,
    /// Outcome of S.
    pub recorded: Outcome<f64>,
    /// Outcome of S'.
    pub parameterized: Outcome<f64>,
}

impl Hidden {
    /// Kind of the recorded contact in a word, if S collides.
    pub fn contact(&self) -> Option<&'static str> {
        let label = self.recorded.contact.label().split(' ').next();
        label.filter(|_| self.recorded.contact != Contact::None)
    }
}

/// Coverage of the recorded scenarios by the parameters and their density.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Number of scenarios of the category that were found.
    pub found: u64,
    /// Number that passed the filters of mining: the rule on coverage is about these.
    pub kept: u64,
    /// Number of kept scenarios that are points of the parameter space.
    pub points: u64,
    /// Fraction of the fitted density inside its valid region.
    pub valid_fraction: f64,
    /// Representativeness metric M of the density, and the value for the same number of recorded scenarios; `None` with
    /// too few.
    pub representativeness: Option<(f64, f64)>,
}

/// Content of a dossier.
pub struct Dossier {
    /// The parameterization.
    pub parameterization: Parameterization,
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Number of scenarios of the category that were found.
    pub found: u64,
    /// Number that passed the filters of mining: the simulated ones.
    pub scenarios: u64,
    /// Lanes of S.
    pub lanes: u64,
    /// Headways of the simulations.
    pub headways: Vec<Headway>,
    /// Scores of the parameterization.
    pub scored: Scored,
    /// The same under [`REGULATION`]; `None` if that is the selected profile.
    pub regulation: Option<Scored>,
    /// Failures of S from headways below 0.5 s; `None` if the headways are gaps in metres.
    pub close_following: Option<CloseFollowing>,
    /// Scores by headway, speed and severity.
    pub groups: Vec<Group>,
    /// Hidden failures, the most severe first.
    pub hidden: Vec<Hidden>,
    /// S and S' of the most severe hidden failure, step by step.
    pub example: Option<[Trace; 2]>,
    /// S' and density compared with S; `None` if there is no density.
    pub compared: Option<ComparedCell>,
    /// Coverage; `None` if there is no density.
    pub coverage: Option<Coverage>,
    /// Why there is no density.
    pub no_density: Option<Error>,
    /// All parameterizations of the category, including this one.
    pub alternatives: Vec<(Parameterization, Scored, Conclusion)>,
    /// The finding of each rule.
    pub findings: Vec<Finding>,
    /// The conclusion from the findings.
    pub conclusion: Conclusion,
    /// SHA-256 of the plan of S and S'.
    pub plan_sha256: String,
    /// SHA-256 of the density.
    pub density_sha256: Option<String>,
    /// How the sweeps went.
    pub summary: SweepSummary,
    /// Skipped input, with the reason.
    pub left_out: Vec<Error>,
}

/// Runs the study of one parameterization, model and criterion, and draws the conclusion.
///
/// # Errors
/// [`Error::Input`] if no scenario of the category was kept; [`Error::Usage`] for a parameterization that is impossible
/// with this data; those of the lanes.
pub fn justify(
    scenarios: &[Scenario],
    facts: &DataProvenance,
    profile: &Profile,
    options: &JustifyOptions,
    executor: &Executor,
) -> Result<Dossier> {
    ranges::check("justify", &options.rules)?;
    let id = options.compare.parameterizations.first().cloned().ok_or_else(|| {
        Error::usage(Place::option("parameterization"), "it is missing", "name one, such as 2 or iii")
    })?;
    let model = options.compare.study.models.first().copied();
    let model = model.ok_or_else(|| Error::usage(Place::option("model"), "it is missing", "name one driver model"))?;
    let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
    let replay = Replay::run(scenarios, facts, profile, options, executor, &mut summary)?;
    let (plan, variant) = (replay.plan(), replay.variant(&id)?);
    let block = &plan.blocks[0];
    let scored = replay.score(variant, &options.score);
    let regulation = match profile.name == REGULATION {
        true => None,
        false => {
            let replay = Replay::run(scenarios, facts, &Profile::load(REGULATION)?, options, executor, &mut summary)?;
            Some(replay.score(replay.variant(&id)?, &options.score))
        }
    };
    let runner = LaneRunner::<f32>::new(plan);
    let key = |unit: usize, variant, headway| LaneKey { block: 0, unit: unit as u64, variant, headway, model: 0 };
    let severity = |unit, headway| severity(&runner.run(&key(unit, 0, headway)).widen(), options.criterion);
    let groups = replay.groups(variant, &severity, &options.score);
    let mut hidden = Vec::new();
    for unit in 0..replay.units() {
        for (headway, of) in plan.headways.iter().enumerate() {
            if replay.failed(unit, 0, headway) && !replay.failed(unit, variant, headway) {
                let lane = key(unit, variant, headway);
                hidden.push(Hidden {
                    lane,
                    key: plan.key_text(&lane),
                    scenario: block.units.name(unit as u64).into_owned(),
                    headway: of.to_string(),
                    recorded: runner.run(&key(unit, 0, headway)).widen(),
                    parameterized: runner.run(&lane).widen(),
                });
            }
        }
    }
    let worse = |a: &Hidden, b: &Hidden| {
        let of = |hidden: &Hidden| self::severity(&hidden.recorded, options.criterion);
        of(b).total_cmp(&of(a)).then_with(|| a.key.cmp(&b.key))
    };
    hidden.sort_by(worse);
    let example = hidden.first().map(|h| [runner.trace(&LaneKey { variant: 0, ..h.lane }), runner.trace(&h.lane)]);
    let (mut compared, mut density_sha256, mut coverage) = (None, None, None);
    let (mut no_density, mut left_out) = (None, Vec::new());
    let sampled = replay.compare.fit(&id, DensityKind::Kernel, true).and_then(|fitted| {
        coverage = Some(Coverage::of(&fitted));
        left_out = fitted.left_out;
        replay.compare.sample_density(&fitted.model, &replay.counts, executor, &mut summary)
    });
    match sampled {
        Ok(of) => {
            density_sha256 = Some(of.density_sha256);
            compared = of.cells.into_iter().find(|cell| cell.criterion == options.criterion);
        }
        Err(error @ (Error::Input { .. } | Error::Usage { .. })) => no_density = Some(error),
        Err(error) => return Err(error),
    }
    let close_units = close_units(scenarios.iter().filter(|s| s.kept && s.category == id.category));
    let close_following = CloseFollowing::of_recorded(plan, &replay.counts, 0, &close_units)?;
    let alternatives = Parameterization::of(id.category).filter_map(|other| {
        let variant = replay.variant(&other).ok()?;
        let scored = replay.score(variant, &options.score);
        let findings = options.rules.of_labels(&scored, &options.score);
        Some((other, scored, Conclusion::of(&findings)))
    });
    let alternatives = alternatives.collect();
    let mut findings = options.rules.of_labels(&scored, &options.score);
    findings.extend(options.rules.of_density(compared.as_ref(), coverage.as_ref(), options.compare.enough.margin));
    let found = scenarios.iter().filter(|scenario| scenario.category == id.category).count() as u64;
    Ok(Dossier {
        parameterization: id,
        model,
        criterion: options.criterion,
        found,
        scenarios: block.units.len(),
        lanes: block.units.len() * plan.headways.len() as u64,
        conclusion: Conclusion::of(&findings),
        headways: plan.headways.clone(),
        scored,
        regulation,
        close_following,
        groups,
        hidden,
        example,
        compared,
        coverage,
        no_density,
        alternatives,
        findings,
        plan_sha256: plan.hash().to_owned(),
        density_sha256,
        summary,
        left_out,
    })
}

/// Severity of a failure, larger is worse. Collision: closing speed at the contact, m/s. TTC and BTN: contacts first,
/// then the shortfall of TTC, s, or the excess of BTN.
fn severity(outcome: &Outcome<f64>, criterion: Criterion) -> f64 {
    let contact = if outcome.verdicts.failed(Criterion::Collision) { 1e3 + outcome.impact_closing_speed } else { 0.0 };
    match criterion {
        Criterion::Collision => outcome.impact_closing_speed,
        Criterion::Ttc => contact - outcome.min_ttc,
        Criterion::Btn => contact + outcome.max_btn.min(1e3),
    }
}

impl Coverage {
    /// Points per kept scenario.
    pub fn of_kept(&self) -> Option<f64> {
        (self.kept > 0).then(|| self.points as f64 / self.kept as f64)
    }

    /// Points per found scenario: the filters of mining count too.
    pub fn of_found(&self) -> Option<f64> {
        (self.found > 0).then(|| self.points as f64 / self.found as f64)
    }

    /// The coverage of a density and of its scenarios.
    fn of(fitted: &Fitted) -> Coverage {
        let Fitted { model, left_out, .. } = fitted;
        Coverage {
            found: model.provenance.found,
            kept: model.provenance.kept,
            points: model.provenance.kept - left_out.len() as u64,
            valid_fraction: model.valid.estimate,
            representativeness: model.representativeness.map(|r| (r.metric, r.train_test)),
        }
    }
}
