//! The conclusion of a search: the best description of each size, judged again with intervals, in sample, and on data that
//! the search has not read, beside the paper's parameterizations.

use std::cmp::Reverse;

use super::evaluation::{Evaluation, Evaluator, Training, of_paper};
use super::{Candidate, Evaluated, Scope, Search, SearchOptions, candidates, cell_of};
use crate::engine::{Confusion, Executor};
use crate::model::driver::ModelId;
use crate::run::score::{Contrast, ScenarioRate, ScoreInterval, min_contrast};
use crate::scenario::parameterization::Parameterization;
use crate::scenario::{Category, Scenario};
use crate::{Error, Place, Result};

/// A score with its interval over scenarios.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scored {
    /// The objective; `None` for 0/0.
    pub value: Option<f64>,
    /// Its interval; `None` for the risk ratio and for 0/0.
    pub interval: Option<ScoreInterval>,
}

/// Scores of one description.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// By cross-validation.
    pub cross_validated: Scored,
    /// Fitted and judged on the same scenarios.
    pub in_sample: Scored,
    /// On data that the search has not read; `None` without.
    pub held_out: Option<Scored>,
}

/// A parameterization of the paper, or the best description of one size, in a scope.
#[derive(Debug, Clone, PartialEq)]
pub struct FrontPoint {
    /// The candidate.
    pub candidate: Candidate,
    /// Number of parameters.
    pub parameters: usize,
    /// Its scores.
    pub judged: Judged,
    /// Error of the motions.
    pub rmse: f64,
    /// Per model of the scope: score minus that of the paper's best, cross-validated; empty for the paper's own.
    pub gains: Vec<(ModelId, Option<(f64, ScoreInterval)>)>,
    /// The same on held-out data.
    pub held_out_gains: Vec<(ModelId, Option<(f64, ScoreInterval)>)>,
    /// Score minus that of the best size of the front, cross-validated.
    pub below_best: Option<(f64, ScoreInterval)>,
}

impl FrontPoint {
    /// The verdict over all models of gains against the paper's best.
    pub fn verdict(&self) -> &'static str {
        let gains = if self.held_out_gains.is_empty() { &self.gains } else { &self.held_out_gains };
        let gains: Option<Vec<ScoreInterval>> =
            gains.iter().map(|(_, gain)| gain.map(|(_, interval)| interval)).collect();
        let Some(gains) = gains else { return "not compared: undefined or without interval" };
        let better = gains.iter().filter(|gain| gain.low > 0.0).count();
        match () {
            () if better > 0 && better == gains.len() => "better for every model",
            () if gains.iter().any(|gain| gain.high < 0.0) => "worse for a model shown",
            () if better > 0 => "better for a model, worse shown for none",
            () => "no difference shown",
        }
    }
}

/// The best descriptions of a scope.
#[derive(Debug, Clone, PartialEq)]
pub struct Front {
    /// The models.
    pub scope: Scope,
    /// One per size, ascending; each better than all smaller ones.
    pub points: Vec<FrontPoint>,
    /// The paper's parameterizations.
    pub paper: Vec<FrontPoint>,
    /// F1 of the best S' that knows the headway only, and nothing of a scenario: on the searched data, and on held-out data.
    pub headway_only: [Option<f64>; 2],
    /// Index of the paper's best, by cross-validation.
    pub best_paper: Option<usize>,
    /// Index of the winner: the fewest parameters whose score is shown to be at most the margin below the best, among
    /// descriptions that can be sampled; the largest of these if none is.
    pub winner: Option<usize>,
}

/// A scenario whose outcomes no description of a size keeps.
#[derive(Debug, Clone, PartialEq)]
pub struct Unkept {
    /// Maximum number of parameters.
    pub parameters: usize,
    /// The scenario.
    pub scenario: String,
    /// Lanes whose verdict differs in the best of them.
    pub lanes: u64,
}

/// The error of the motions against the score, over all candidates with a score.
#[derive(Debug)]
pub struct RmseAgainstScore {
    /// Spearman's rank correlation over all.
    pub correlation: Option<f64>,
    /// The same at equal numbers of parameters.
    pub by_size: Vec<(usize, f64)>,
    /// A pair that the error orders wrongly, by the largest difference of scores: smaller error and lower score first.
    pub disagreement: Option<[Evaluated; 2]>,
}

/// The result of a search.
#[derive(Debug)]
pub struct SearchResult {
    /// Hash of data, options and engine, as in the journals.
    pub sha256: String,
    /// Kind of scenario.
    pub category: Category,
    /// Options, with the models that were scored.
    pub options: SearchOptions,
    /// Models without enough failures, with the number of failing scenarios.
    pub left_out: Vec<(ModelId, u64)>,
    /// Number of scenarios searched, and held out.
    pub scenarios: [usize; 2],
    /// Number of lanes of a study.
    pub lanes: u64,
    /// Studies: candidates that were evaluated, those that could not be fitted included.
    pub studies: usize,
    /// Every candidate's result.
    pub evaluated: Vec<Evaluated>,
    /// One per scope; all models first.
    pub fronts: Vec<Front>,
    /// How the error of the motions and the score go together.
    pub rmse: RmseAgainstScore,
    /// Scenarios that no description of the front keeps, by size.
    pub unkept: Vec<Unkept>,
    /// The winner for all models, fitted on all scenarios.
    pub winner: Option<Parameterization>,
    /// The folds are whole recordings.
    pub is_by_recording: bool,
}

/// Judges fronts and winners.
pub(super) fn conclude(
    search: &Search,
    evaluator: &Evaluator,
    training: &Training,
    evaluated: Vec<Evaluated>,
    studies: usize,
    held_out: Option<&[Scenario]>,
    executor: &Executor,
) -> Result<SearchResult> {
    let (options, category) = (&search.options, search.options.category);
    let scopes = Scope::all(options);
    let chosen: Vec<Vec<Candidate>> = scopes.iter().map(|scope| nondominated(&evaluated, *scope, options)).collect();
    let paper = candidates::paper(category);
    let mut all: Vec<Candidate> = paper.clone();
    for candidate in chosen.iter().flatten() {
        if !all.contains(candidate) {
            all.push(candidate.clone());
        }
    }
    let cross_validated = evaluator.evaluate(&all, training)?;
    let in_sample = evaluator.evaluate(&all, &Training::InSample)?;
    let unread: Option<Vec<&Scenario>> =
        held_out.map(|all| all.iter().filter(|s| s.kept && s.category == category).collect());
    let unread_evaluator = match &unread {
        Some(scenarios) if scenarios.len() < 2 => {
            let problem = format!("{} {} scenarios are too few", scenarios.len(), category.label());
            return Err(Error::input(Place::item("held-out data"), problem, "hold out more recordings"));
        }
        Some(scenarios) => Some(Evaluator::new(category, scenarios.clone(), search.profile, options, executor)?),
        None => None,
    };
    let on_unread = |evaluator: &Evaluator| evaluator.evaluate(&all, &Training::On(&search.scenarios));
    let held_out = unread_evaluator.as_ref().map(on_unread).transpose()?;
    let found = |candidate: &Candidate| all.iter().position(|known| known == candidate);
    let judged = |at: usize, scope: Scope| -> Option<Judged> {
        Some(Judged {
            cross_validated: scored(cross_validated[at].as_ref()?, scope, options),
            in_sample: scored(in_sample[at].as_ref()?, scope, options),
            held_out: held_out.as_ref().and_then(|of| Some(scored(of[at].as_ref()?, scope, options))),
        })
    };
    let mut fronts = Vec::new();
    for (scope, chosen) in scopes.iter().zip(&chosen) {
        let scope = *scope;
        let plain = |candidate: &Candidate| {
            let at = found(candidate)?;
            Some(FrontPoint {
                candidate: candidate.clone(),
                parameters: candidate.parameter_count(category),
                judged: judged(at, scope)?,
                rmse: cross_validated[at].as_ref()?.rmse,
                gains: Vec::new(),
                held_out_gains: Vec::new(),
                below_best: None,
            })
        };
        let paper: Vec<FrontPoint> = paper.iter().filter_map(plain).collect();
        let valued = paper.iter().enumerate();
        let valued = valued.filter_map(|(index, point)| Some((index, point.judged.cross_validated.value?)));
        let best_paper = valued.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index);
        let rival = best_paper.and_then(|index| found(&paper[index].candidate));
        let best = chosen.last().and_then(found);
        let gains = |of: &[Option<Evaluation>], at: usize| {
            let of_model = |model: ModelId| {
                let scope = Scope::Model(model);
                let gain = difference(of[at].as_ref()?, of[rival?].as_ref()?, scope, options);
                Some((model, gain))
            };
            scope.models(options).into_iter().filter_map(of_model).collect::<Vec<_>>()
        };
        let point = |candidate: &Candidate| {
            let at = found(candidate)?;
            let below_best = best.and_then(|best| {
                difference(cross_validated[at].as_ref()?, cross_validated[best].as_ref()?, scope, options)
            });
            Some(FrontPoint {
                gains: gains(&cross_validated, at),
                held_out_gains: held_out.as_ref().map_or(Vec::new(), |of| gains(of, at)),
                below_best,
                ..plain(candidate)?
            })
        };
        let points: Vec<FrontPoint> = chosen.iter().filter_map(point).collect();
        let margin = options.limits.margin;
        let is_enough = |(at, point): (usize, &FrontPoint)| {
            // Without an interval the value decides.
            let low =
                |best: &FrontPoint| Some(point.judged.cross_validated.value? - best.judged.cross_validated.value?);
            let low = point.below_best.map(|(_, interval)| interval.low).or_else(|| low(points.last()?));
            at + 1 == points.len() || low.is_some_and(|low| low >= -margin)
        };
        let is_sampled = |point: &FrontPoint| !matches!(&point.candidate, Candidate::Linear(spec) if spec.registered);
        let winner = points.iter().enumerate().position(|of| is_enough(of) && is_sampled(of.1));
        let winner = winner.or_else(|| points.iter().rposition(is_sampled));
        let headway_only = [
            evaluator.headway_only(scope, options),
            unread_evaluator.as_ref().and_then(|evaluator| evaluator.headway_only(scope, options)),
        ];
        fronts.push(Front { scope, points, paper, headway_only, best_paper, winner });
    }
    let winner = fronts.first().and_then(|front| Some(&front.points[front.winner?].candidate));
    let winner = winner.map(|candidate| fitted(candidate, search)).transpose()?;
    let unkept = unkept(&all, &cross_validated, search);
    let rmse_against_score = rmse_against_score(&evaluated, options);
    Ok(SearchResult {
        sha256: search.sha256.clone(),
        category,
        options: options.clone(),
        left_out: search.left_out.clone(),
        scenarios: [search.scenarios.len(), unread.map_or(0, |scenarios| scenarios.len())],
        lanes: search.scenarios.len() as u64 * (options.headways.len() * ModelId::ALL.len()) as u64,
        studies,
        evaluated,
        fronts,
        rmse: rmse_against_score,
        unkept,
        // Shuffled outcomes have none.
        winner: winner.filter(|_| !options.shuffled),
        is_by_recording: search.is_by_recording(),
    })
}

/// The best candidate of each size that is better than all smaller ones.
fn nondominated(evaluated: &[Evaluated], scope: Scope, options: &SearchOptions) -> Vec<Candidate> {
    let mut front = Vec::new();
    let mut reached = f64::NEG_INFINITY;
    for parameters in 1..=options.limits.max_parameters {
        let of_size = evaluated.iter().filter(|of| of.parameters == parameters);
        let scores = of_size.filter_map(|of| Some((of.score(scope, options)?, of)));
        // The first of equals, in the order of their texts.
        let best = scores.fold(None, |best: Option<(f64, &Evaluated)>, here| match best {
            Some(known) if known.0 >= here.0 => Some(known),
            _ => Some(here),
        });
        if let Some((score, best)) = best.filter(|(score, _)| *score > reached) {
            reached = score;
            front.push(best.candidate.clone());
        }
    }
    front
}

fn units_of(evaluation: &Evaluation, model: ModelId, options: &SearchOptions) -> Vec<Confusion<u32>> {
    let cell = cell_of(model, options.criterion);
    evaluation.units.iter().map(|unit| unit[cell]).collect()
}

/// The mean score of a scope with its interval.
fn scored(evaluation: &Evaluation, scope: Scope, options: &SearchOptions) -> Scored {
    let models = scope.models(options);
    let units: Vec<Vec<Confusion<u32>>> = models.iter().map(|model| units_of(evaluation, *model, options)).collect();
    let value = |units: &Vec<Confusion<u32>>| {
        let mut total = Confusion::default();
        units.iter().for_each(|unit| total.add(unit));
        options.objective.of(&total)
    };
    let values: Option<Vec<f64>> = units.iter().map(value).collect();
    let value = values.map(|values| values.iter().sum::<f64>() / values.len() as f64);
    let rates: Option<Vec<ScenarioRate>> = units.iter().map(|units| options.objective.rate(units)).collect();
    let share = 1.0 / models.len() as f64;
    let mean = Contrast { constant: 0.0, terms: (0..models.len()).map(|at| (share, at)).collect() };
    let interval = rates.and_then(|rates| min_contrast(&rates, &[mean], options.score.confidence));
    Scored { value, interval: interval.map(|(_, interval)| interval) }
}

/// The mean score of one description minus that of another, over the same scenarios.
fn difference(
    of: &Evaluation,
    other: &Evaluation,
    scope: Scope,
    options: &SearchOptions,
) -> Option<(f64, ScoreInterval)> {
    let models = scope.models(options);
    let share = 1.0 / models.len() as f64;
    let rates = [of, other].into_iter().flat_map(|evaluation| models.iter().map(move |model| (evaluation, *model)));
    let rates = rates.map(|(of, model)| options.objective.rate(&units_of(of, model, options)));
    let rates = rates.collect::<Option<Vec<ScenarioRate>>>()?;
    let signs = (0..rates.len()).map(|at| (if at < models.len() { share } else { -share }, at));
    min_contrast(&rates, &[Contrast { constant: 0.0, terms: signs.collect() }], options.score.confidence)
}

/// The candidate fitted on all scenarios of the search.
fn fitted(candidate: &Candidate, search: &Search) -> Result<Parameterization> {
    let (category, parameterization) = (search.options.category, &search.options.parameterization);
    let spec = match candidate {
        Candidate::Linear(spec) => spec.clone(),
        Candidate::Paper(key) => {
            let id = Parameterization::find(category, key);
            let id = id.ok_or_else(|| Error::Internal(format!("there is no {key}")))?;
            match id.coefficients() {
                None => return Ok(id),
                Some(coefficients) => of_paper(coefficients, parameterization),
            }
        }
    };
    let reduction = spec.fit(category, &search.scenarios, parameterization)?;
    Ok(Parameterization::linear("winner", reduction))
}

/// Scenarios for which every description of at most a size has a wrong verdict, with the lanes of the best.
fn unkept(all: &[Candidate], evaluations: &[Option<Evaluation>], search: &Search) -> Vec<Unkept> {
    let options = &search.options;
    let cells: Vec<usize> = options.models.iter().map(|model| cell_of(*model, options.criterion)).collect();
    let wrong = |evaluation: &Evaluation, unit: usize| -> u64 {
        cells.iter().map(|cell| evaluation.units[unit][*cell]).map(|c| u64::from(c.fn_ + c.fp)).sum()
    };
    let mut unkept = Vec::new();
    for parameters in 2..=options.limits.max_parameters {
        let of_size: Vec<&Evaluation> = all
            .iter()
            .zip(evaluations)
            .filter(|(candidate, _)| candidate.parameter_count(options.category) <= parameters)
            .filter_map(|(_, evaluation)| evaluation.as_ref())
            .collect();
        for (unit, scenario) in search.scenarios.iter().enumerate() {
            let lanes = of_size.iter().map(|evaluation| wrong(evaluation, unit)).min().unwrap_or(0);
            if lanes > 0 {
                unkept.push(Unkept { parameters, scenario: scenario.id.clone(), lanes });
            }
        }
    }
    unkept.sort_by_cached_key(|of| (of.parameters, Reverse(of.lanes), of.scenario.clone()));
    unkept
}

/// Spearman's rank correlation of pairs; `None` for fewer than three or without any spread.
fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let ranks = |values: Vec<f64>| -> Vec<f64> {
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
        let mut ranks = vec![0.0; values.len()];
        for equals in order.chunk_by(|a, b| values[*a] == values[*b]) {
            // Equal values share the mean of their ranks.
            let below = values.iter().filter(|value| **value < values[equals[0]]).count();
            equals.iter().for_each(|at| ranks[*at] = below as f64 + (equals.len() - 1) as f64 / 2.0);
        }
        ranks
    };
    let (a, b): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    let (a, b) = (ranks(a), ranks(b));
    let mean = (pairs.len().max(1) - 1) as f64 / 2.0;
    let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum::<f64>();
    let correlation = product(&a, &b) / libm::sqrt(product(&a, &a) * product(&b, &b));
    (pairs.len() >= 3).then_some(correlation).filter(|correlation| correlation.is_finite())
}

/// Rank correlations of error and score, over all and by size, and the pair that the error orders wrongly by the largest
/// difference of scores.
fn rmse_against_score(evaluated: &[Evaluated], options: &SearchOptions) -> RmseAgainstScore {
    let mut known: Vec<(f64, f64, &Evaluated)> = evaluated
        .iter()
        .filter_map(|of| Some((of.rmse, of.score(Scope::All, options)?, of)))
        .filter(|(rmse, ..)| rmse.is_finite())
        .collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    let pairs = |size: Option<usize>| -> Vec<(f64, f64)> {
        let of = known.iter().filter(|(.., of)| size.is_none_or(|size| of.parameters == size));
        of.map(|(rmse, score, _)| (*rmse, *score)).collect()
    };
    let sizes = 1..=options.limits.max_parameters;
    let by_size = sizes.filter_map(|size| Some((size, rank_correlation(&pairs(Some(size)))?))).collect();
    // The highest score at a larger error, from the right.
    let mut best_right: Option<usize> = None;
    let mut worst: Option<(f64, [usize; 2])> = None;
    for at in (0..known.len()).rev() {
        if let Some(right) = best_right.filter(|right| known[*right].0 > known[at].0) {
            let by = known[right].1 - known[at].1;
            if worst.is_none_or(|(known, _)| by > known) {
                worst = Some((by, [at, right]));
            }
        }
        if best_right.is_none_or(|right| known[at].1 > known[right].1) {
            best_right = Some(at);
        }
    }
    let pair = worst.filter(|(by, _)| *by > 0.0).map(|(_, pair)| pair.map(|at| known[at].2.clone()));
    RmseAgainstScore { correlation: rank_correlation(&pairs(None)), by_size, disagreement: pair }
}
