//! Folds of a cross-validation: scenarios of one recording stay together, because neighbours in time resemble each other.

use std::collections::BTreeMap;

use rayon::prelude::*;

use lanesweep_model::scenario::parameterization::{ParameterizationOptions, Reduction};
use lanesweep_model::scenario::{Category, Scenario};
use lanesweep_support::{Error, Place, Result};

/// The fold of each scenario, below `count` or the number of scenarios. Recordings go to the fold with the fewest scenarios,
/// the largest first. Fewer recordings than folds are cut into as many stretches of time.
///
/// # Errors
/// [`Error::Input`] for fewer than two scenarios.
fn folds(scenarios: &[&Scenario], count: usize) -> Result<Vec<usize>> {
    let count = count.min(scenarios.len());
    if count < 2 {
        let help = "use more data; results of decompositions are in sample";
        return Err(Error::input(Place::item("cross-validation"), "it needs two scenarios", help));
    }
    let mut recordings: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (at, scenario) in scenarios.iter().enumerate() {
        recordings.entry(&scenario.recording).or_default().push(at);
    }
    let mut of = vec![0; scenarios.len()];
    if recordings.len() < count {
        let mut order: Vec<usize> = (0..scenarios.len()).collect();
        let key = |at: usize| (&scenarios[at].recording, scenarios[at].frame0, &scenarios[at].id);
        order.sort_by(|a, b| key(*a).cmp(&key(*b)));
        order.iter().enumerate().for_each(|(rank, at)| of[*at] = rank * count / scenarios.len());
        return Ok(of);
    }
    let mut largest: Vec<(&str, Vec<usize>)> = recordings.into_iter().collect();
    largest.sort_by(|a, b| b.1.len().cmp(&a.1.len()).then_with(|| a.0.cmp(b.0)));
    let mut sizes = vec![0; count];
    for (_, members) in largest {
        let fold = (0..count).min_by_key(|fold| sizes[*fold]).unwrap_or_default();
        sizes[fold] += members.len();
        members.into_iter().for_each(|at| of[at] = fold);
    }
    Ok(of)
}

/// The fold of each scenario, and the decomposition of all folds but each.
///
/// # Errors
/// [`Error::Input`] for too few scenarios.
pub(super) fn cross_validated(
    category: Category,
    kept: &[&Scenario],
    options: &ParameterizationOptions,
    count: usize,
) -> Result<(Vec<usize>, Vec<Reduction>)> {
    let of = folds(kept, count)?;
    let train = |fold: usize| -> Vec<&Scenario> {
        kept.iter().zip(&of).filter(|(_, of)| **of != fold).map(|(scenario, _)| *scenario).collect()
    };
    let count = of.iter().max().map_or(0, |last| last + 1);
    let fit = |fold: usize| Reduction::fit(category, &train(fold), options);
    let fitted = (0..count).into_par_iter().map(fit).collect::<Result<_>>()?;
    Ok((of, fitted))
}
