//! The order of the search: tasks that do not depend on one another, each a rule that says what to evaluate next.

use super::cma_es::CmaEs;
use super::{Candidate, Evaluated, Scope, SearchOptions};
use crate::Result;
use crate::scenario::Category;
use crate::scenario::parameterization::{Feature, FunctionKind, LinearFamily, LinearSpec, Parameterization, Signal};

/// Individuals of a generation of the optimiser.
pub(super) const POPULATION: usize = 12;
/// Maximum number of starts of the optimiser, if it ends before its budget.
const MAX_RESTARTS: u64 = 20;
/// First step of the optimiser, in logarithms of weights.
const STEP: f64 = 0.7;
/// Step at which the optimiser starts again, half of what the weights are rounded to.
const MIN_STEP: f64 = 5e-4;
/// Largest logarithm of a weight.
const MAX_WEIGHT: f64 = 8.0;

/// Looks candidates up or evaluates them.
pub(super) type Evaluate<'e> = dyn FnMut(&[Candidate]) -> Result<Vec<Option<Evaluated>>> + 'e;

/// A part of the search. Its evaluations follow from the options alone.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Task {
    /// The paper's parameterizations.
    Paper,
    /// Decompositions and fixed functions of every size.
    Families,
    /// Features, added and removed one at a time.
    Features(Scope),
    /// Weights of a decomposition with this many coefficients.
    Emphasis(Scope, usize),
}

impl Task {
    /// All tasks, in the order in which shards take them.
    pub(super) fn all(options: &SearchOptions) -> Vec<Task> {
        let scopes = Scope::all(options);
        let mut tasks = vec![Task::Paper, Task::Families];
        tasks.extend(scopes.iter().map(|scope| Task::Features(*scope)));
        for size in 2..=options.limits.max_parameters {
            tasks.push(Task::Emphasis(Scope::All, size));
        }
        tasks
    }

    /// Runs the task: `evaluate` looks candidates up or evaluates them. `budget` bounds the studies of the optimiser.
    ///
    /// # Errors
    /// Those of `evaluate`.
    pub(super) fn run(
        &self,
        category: Category,
        options: &SearchOptions,
        budget: usize,
        evaluate: &mut Evaluate<'_>,
    ) -> Result<()> {
        match self {
            Task::Paper => evaluate(&paper(category)).map(drop),
            Task::Families => evaluate(&families(category, options.limits.max_parameters)).map(drop),
            Task::Features(scope) => features(category, options, *scope, evaluate),
            Task::Emphasis(scope, size) => emphasis(category, options, (*scope, *size), budget, evaluate),
        }
    }
}

pub(super) fn paper(category: Category) -> Vec<Candidate> {
    Parameterization::of(category).map(|id| Candidate::Paper(id.key.to_string())).collect()
}

/// Decompositions and fixed functions with at most this many parameters.
fn families(category: Category, max_parameters: usize) -> Vec<Candidate> {
    let mut specs = Vec::new();
    let has_sides = category != Category::Lvd;
    for signal in [Signal::Values, Signal::Changes] {
        for mirrored in if has_sides { vec![false, true] } else { vec![true] } {
            for registered in [false, true] {
                for coefficients in 1..=max_parameters {
                    let family = LinearFamily::Svd { coefficients, signal, emphasis: Vec::new() };
                    specs.push(LinearSpec { family, mirrored, registered });
                }
            }
        }
    }
    let series = if category == Category::CutOut {
        3
    } else if has_sides {
        2
    } else {
        1
    };
    for kind in [FunctionKind::Polynomial, FunctionKind::Cosine, FunctionKind::BSpline, FunctionKind::Lines] {
        for registered in [false, true] {
            let mut sizes = vec![1; series];
            // Counts up the sizes like a number.
            loop {
                let spec = LinearSpec {
                    family: LinearFamily::Functions { kind, sizes: sizes.clone() },
                    mirrored: true,
                    registered,
                };
                if spec.parameter_count(category) <= max_parameters {
                    specs.push(spec);
                }
                let Some(at) = sizes.iter().position(|size| *size < max_parameters) else { break };
                sizes[at] += 1;
                sizes[..at].fill(1);
            }
        }
    }
    specs.into_iter().map(Candidate::Linear).collect()
}

pub(super) fn of_features(features: Vec<Feature>) -> Candidate {
    Candidate::Linear(LinearSpec { family: LinearFamily::Features(features), mirrored: true, registered: false })
}

/// Floating forward selection: adds the best feature, then removes features as long as that beats the best known set of
/// that size (Pudil, Novovičová, Kittler 1994).
fn features(category: Category, options: &SearchOptions, scope: Scope, evaluate: &mut Evaluate<'_>) -> Result<()> {
    let mut best: Vec<Option<(f64, Vec<Feature>)>> = vec![None; options.limits.max_parameters + 1];
    let mut chosen: Vec<Feature> = Vec::new();
    // Every set is at most once the start of an addition, so the loop ends.
    let mut visited: Vec<Vec<Feature>> = Vec::new();
    while chosen.len() < options.limits.max_parameters {
        let with = |feature: Feature| [&chosen[..], &[feature]].concat();
        let sets: Vec<Vec<Feature>> =
            Feature::of_category(category).filter(|feature| !chosen.contains(feature)).map(with).collect();
        let Some(found) = best_of(&sets, scope, options, evaluate)? else { return Ok(()) };
        chosen.clone_from(&found.1);
        if best[chosen.len()].as_ref().is_none_or(|known| found.0 > known.0) {
            best[chosen.len()] = Some(found);
        } else if let Some((_, known)) = &best[chosen.len()] {
            chosen.clone_from(known);
        }
        while chosen.len() > 2 {
            let without = |at: usize| {
                let mut set = chosen.clone();
                set.remove(at);
                set
            };
            let sets: Vec<Vec<Feature>> = (0..chosen.len()).map(without).collect();
            let Some(found) = best_of(&sets, scope, options, evaluate)? else { break };
            let known = &mut best[found.1.len()];
            if known.as_ref().is_some_and(|known| found.0 <= known.0) {
                break;
            }
            chosen.clone_from(&found.1);
            *known = Some(found);
        }
        let mut key = chosen.clone();
        key.sort_by_key(|feature| *feature as usize);
        if visited.contains(&key) {
            // Go on from the best set of the largest size reached.
            let Some((_, largest)) = best.iter().rev().flatten().next() else { return Ok(()) };
            if largest.len() <= chosen.len() {
                return Ok(());
            }
            chosen.clone_from(largest);
        } else {
            visited.push(key);
        }
    }
    Ok(())
}

fn best_of(
    sets: &[Vec<Feature>],
    scope: Scope,
    options: &SearchOptions,
    evaluate: &mut Evaluate<'_>,
) -> Result<Option<(f64, Vec<Feature>)>> {
    let candidates: Vec<Candidate> = sets.iter().cloned().map(of_features).collect();
    let evaluated = evaluate(&candidates)?;
    let mut best: Option<(f64, Vec<Feature>)> = None;
    for (set, evaluated) in sets.iter().zip(evaluated) {
        let Some(score) = evaluated.and_then(|evaluated| evaluated.score(scope, options)) else { continue };
        if best.as_ref().is_none_or(|best| score > best.0) {
            best = Some((score, set.clone()));
        }
    }
    Ok(best)
}

/// Weights over time and signals, by CMA-ES on the outcomes.
fn emphasis(
    category: Category,
    options: &SearchOptions,
    (scope, coefficients): (Scope, usize),
    budget: usize,
    evaluate: &mut Evaluate<'_>,
) -> Result<()> {
    let start = vec![0.0; LinearSpec::emphasis_count(category)];
    let candidate = |x: &Vec<f64>| {
        // Three decimals: a journal of text gives the same candidates.
        let emphasis = x.iter().map(|v| (v.clamp(-MAX_WEIGHT, MAX_WEIGHT) * 1e3).round() / 1e3).collect();
        let family = LinearFamily::Svd { coefficients, signal: Signal::Values, emphasis };
        Candidate::Linear(LinearSpec { family, mirrored: true, registered: false })
    };
    let mut left = budget;
    for restart in 0..MAX_RESTARTS {
        let seed = options.limits.seed.wrapping_add(1000 * restart + coefficients as u64);
        let mut search = CmaEs::new(&start, STEP, POPULATION, seed);
        while left >= POPULATION && !search.has_ended(MIN_STEP) {
            let points = search.ask();
            let evaluated = evaluate(&points.iter().map(candidate).collect::<Vec<_>>())?;
            let loss = |(x, evaluated): (&Vec<f64>, Option<Evaluated>)| {
                let score = evaluated.and_then(|of| of.score(scope, options));
                // Beyond the bounds the distance to them counts.
                let beyond: f64 = x.iter().map(|v| (v.abs() - MAX_WEIGHT).max(0.0)).sum();
                1.0 - score.unwrap_or(0.0) + beyond
            };
            search.tell(&points.iter().zip(evaluated).map(loss).collect::<Vec<f64>>());
            left -= POPULATION;
        }
    }
    Ok(())
}
