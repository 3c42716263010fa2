//! A dossier: is a parameterization appropriate for one driver model, one kind of scenario and one criterion on this data?
//! The question that the paper ends with.
//!
//! Here lives what is computed: which failures are hidden, scores with their intervals, groups, risk ratios, coverage and
//! the conclusion by rules. Lanes and densities come from [`crate::run::compare`]; the page is made by [`crate::report`].

mod rules;
mod scores;

pub use rules::{Conclusion, Finding, Need, Rules};
pub use scores::{Group, Scored, Share};

use crate::engine::{Executor, LaneKey, LaneRunner, Outcome, Partial, SweepSummary, Trace, Verdicts, Wanted};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::compare::{Compare, CompareOptions};
use crate::run::sampling::ComparedCell;
use crate::run::score::ScoreOptions;
use crate::scenario::Scenario;
use crate::scenario::parameterization::Parameterization;
use crate::stats::density::{DataFacts, DensityModel, FitOptions};
use crate::{Error, Place, Result};

/// What is asked.
#[derive(Debug, Clone)]
pub struct JustifyOptions {
    /// Data and density: one category, one model, one parameterization.
    pub compare: CompareOptions,
    /// Criterion.
    pub criterion: Criterion,
    /// Confidence and least failures.
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

/// How much of the recorded scenarios the parameters and their density cover.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Scenarios of the category that were found.
    pub found: u64,
    /// Those that passed the filters of mining.
    pub kept: u64,
    /// Those of the kept ones that are points of the parameter space.
    pub points: u64,
    /// Share of the fitted density inside its valid region.
    pub valid_share: f64,
    /// Representativeness metric M of the density and what as many recorded scenarios reach; `None` with too few.
    pub representativeness: Option<(f64, f64)>,
}

/// What a dossier says.
pub struct Dossier {
    /// The parameterization.
    pub parameterization: Parameterization,
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Scenarios, and lanes of S.
    pub scenarios: u64,
    /// Lanes of S.
    pub lanes: u64,
    /// Scores of the parameterization.
    pub scored: Scored,
    /// By headway, speed and severity.
    pub groups: Vec<Group>,
    /// Hidden failures, the most severe first.
    pub hidden: Vec<Hidden>,
    /// S and S' of the most severe hidden failure, step by step.
    pub example: Option<[Trace; 2]>,
    /// S' and density against S; `None` where there is no density.
    pub compared: Option<ComparedCell>,
    /// Coverage; `None` where there is no density.
    pub coverage: Option<Coverage>,
    /// Why there is no density.
    pub no_density: Option<Error>,
    /// All parameterizations of the category, this one too.
    pub alternatives: Vec<(Parameterization, Scored, Conclusion)>,
    /// What each rule finds.
    pub findings: Vec<Finding>,
    /// What follows.
    pub conclusion: Conclusion,
    /// SHA-256 of the plan of S and S'.
    pub plan_sha256: String,
    /// SHA-256 of the density.
    pub density_sha256: Option<String>,
    /// How the sweeps went.
    pub summary: SweepSummary,
    /// What was left out, with the reason.
    pub left_out: Vec<Error>,
}

/// Runs the study of one parameterization, model and criterion, and concludes.
///
/// # Errors
/// [`Error::Input`] where no scenario of the category was kept; [`Error::Usage`] for a parameterization that the data
/// cannot have; of the lanes.
pub fn justify(
    scenarios: &[Scenario],
    facts: &DataFacts,
    profile: &Profile,
    options: &JustifyOptions,
    executor: &Executor,
) -> Result<Dossier> {
    let id = options.compare.parameterizations.first().cloned().ok_or_else(|| {
        Error::usage(Place::option("parameterization"), "it is missing", "name one, such as 2 or iii")
    })?;
    let model = options
        .compare
        .study
        .models
        .first()
        .copied()
        .ok_or_else(|| Error::usage(Place::option("model"), "it is missing", "name one driver model"))?;
    let compare = Compare::plan(scenarios, facts, profile.clone(), options.compare.clone())?;
    let plan = compare.lane_plan();
    let block = &plan.blocks[0];
    let Some(variant) = block.variants.iter().position(|name| *name == id.key) else {
        let problem = format!("the data has no {}", id.name());
        let help = "its decomposition needs more scenarios: use more recordings, or another parameterization";
        return Err(Error::input(Place::item(&facts.data), problem, help));
    };
    // Every verdict is kept: which failures are hidden is a question of single lanes.
    let (mut verdicts, mut parts): (Vec<Verdicts>, _) = (Vec::new(), Vec::new());
    let mut summary = executor.sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
        verdicts.extend(chunk.verdicts.iter().copied());
        parts.push(Partial::from_chunk(plan, &chunk)?);
        Ok(())
    })?;
    let counts = parts.into_iter().try_fold(Partial::empty(plan), Partial::merge)?;
    let failed = |unit: usize, variant: usize, headway: usize| {
        let at = (unit * block.variants.len() + variant) * plan.headways.len() + headway;
        verdicts[at].failed(options.criterion)
    };
    let labels = scores::Labels { units: block.units.len() as usize, headways: plan.headways.len(), failed: &failed };
    let scored = labels.score(variant, &options.score);
    let runner = LaneRunner::<f32>::new(plan);
    let key = |unit: usize, variant, headway| LaneKey { block: 0, unit: unit as u64, variant, headway, model: 0 };
    let severity = |unit, headway| severity(&runner.run(&key(unit, 0, headway)).widen(), options.criterion);
    let ego_mps = |unit: usize| plan.case(0, unit as u64, 0).ego_speed;
    let headways: Vec<String> = plan.headways.iter().map(ToString::to_string).collect();
    let groups = labels.groups(variant, &headways, &ego_mps, &severity, &options.score);
    let mut hidden = Vec::new();
    for unit in 0..labels.units {
        for (headway, name) in headways.iter().enumerate() {
            if failed(unit, 0, headway) && !failed(unit, variant, headway) {
                let lane = key(unit, variant, headway);
                hidden.push(Hidden {
                    lane,
                    key: plan.key_text(&lane),
                    scenario: block.units.name(unit as u64).into_owned(),
                    headway: name.clone(),
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
    let mut left_out = Vec::new();
    let mut compared = None;
    let mut no_density;
    match compare.sample(&counts, executor, |_| ()) {
        Ok(result) => {
            summary.add(&result.summary);
            left_out.extend(result.left_out);
            let of = result.categories.into_iter().flat_map(|category| category.parameterizations).next();
            compared = of.and_then(|of| {
                Some((of.density_sha256, of.cells.into_iter().find(|c| c.criterion == options.criterion)?))
            });
            no_density = result.failed.into_iter().next();
        }
        Err(error @ (Error::Input { .. } | Error::Usage { .. })) => no_density = Some(error),
        Err(error) => return Err(error),
    }
    let (density_sha256, compared) = compared.map_or((None, None), |(sha256, cell)| (Some(sha256), Some(cell)));
    let coverage = match coverage(&id, scenarios, facts, options) {
        Ok(coverage) => Some(coverage),
        Err(error @ (Error::Input { .. } | Error::Usage { .. })) => {
            no_density.get_or_insert(error);
            None
        }
        Err(error) => return Err(error),
    };
    let alternatives = Parameterization::of(id.category).filter_map(|other| {
        let variant = block.variants.iter().position(|name| *name == other.key)?;
        let scored = labels.score(variant, &options.score);
        let findings = options.rules.of_labels(&scored, &options.score);
        Some((other, scored, Conclusion::of(&findings)))
    });
    let alternatives = alternatives.collect();
    let mut findings = options.rules.of_labels(&scored, &options.score);
    findings.extend(options.rules.of_density(compared.as_ref(), coverage.as_ref(), options.compare.enough.margin));
    Ok(Dossier {
        parameterization: id,
        model,
        criterion: options.criterion,
        scenarios: block.units.len(),
        lanes: block.units.len() * plan.headways.len() as u64,
        conclusion: Conclusion::of(&findings),
        scored,
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

/// How severe a failure is, larger is worse: closing speed at the contact, m/s; for TTC and BTN a contact first, then the
/// shortfall of TTC, s, or the excess of BTN.
fn severity(outcome: &Outcome<f64>, criterion: Criterion) -> f64 {
    let contact = if outcome.verdicts.failed(Criterion::Collision) { 1e3 + outcome.impact_closing_speed } else { 0.0 };
    match criterion {
        Criterion::Collision => outcome.impact_closing_speed,
        Criterion::Ttc => contact - outcome.min_ttc,
        Criterion::Btn => contact + outcome.max_btn.min(1e3),
    }
}

fn coverage(
    id: &Parameterization,
    scenarios: &[Scenario],
    facts: &DataFacts,
    options: &JustifyOptions,
) -> Result<Coverage> {
    let of_category = || scenarios.iter().filter(|scenario| scenario.category == id.category);
    let fit = FitOptions { parameterization: options.compare.study.parameterization.clone(), ..FitOptions::default() };
    let fitted = DensityModel::fit(id.clone(), scenarios, facts, &fit)?;
    let kept = of_category().filter(|scenario| scenario.kept).count() as u64;
    Ok(Coverage {
        found: of_category().count() as u64,
        kept,
        points: kept - fitted.left_out.len() as u64,
        valid_share: fitted.model.valid.estimate,
        representativeness: fitted.model.representativeness.map(|r| (r.metric, r.train_test)),
    })
}
