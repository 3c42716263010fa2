//! Folds of a cross-validation: scenarios of one recording stay together, because neighbours in time resemble each other.

use std::collections::BTreeMap;

use lanesweep_model::scenario::Scenario;
use lanesweep_support::{Error, Place, Result};

/// The fold of each scenario, below `count`. Recordings go to the fold with the fewest scenarios, the largest first. Fewer
/// recordings than folds are cut into as many stretches of time.
///
/// # Errors
/// [`Error::Usage`] for fewer than two folds or than scenarios.
pub(super) fn folds(scenarios: &[&Scenario], count: usize) -> Result<Vec<usize>> {
    if count < 2 || scenarios.len() < count {
        let problem = format!("{} scenarios cannot be divided into {count} folds", scenarios.len());
        return Err(Error::usage(Place::item("[study] folds"), problem, "use fewer folds, or more data"));
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
