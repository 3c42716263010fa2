//! A density given the values of some parameters, as a mixture that lanes draw from.

use nalgebra::{DMatrix, DVector};

use crate::stats::density::{DensityModel, Mixture};
use crate::support::ranges::refuse_repeats;
use crate::{Error, Place, Result};

/// Spread of a given parameter, in spreads of its kernels: nothing in the lane arithmetic, and not zero.
const NO_SPREAD: f64 = 1e-12;

/// A conditional density with the number of scenarios that it still rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Conditional {
    /// f̂ given the values.
    pub mixture: Mixture,
    /// (Σw)²/Σw² over the kernels' weights: how many scenarios are near the given values.
    pub effective_scenarios: f64,
}

/// The density given these parameters, by name. Each kernel weighs as it fits the values.
///
/// # Errors
/// [`Error::Usage`] for a name that is no parameter, one that comes twice, all of them given, or a value outside the
/// valid range.
pub fn conditional(density: &DensityModel, given: &[(String, f64)]) -> Result<Conditional> {
    refuse_repeats(|| Place::option("given"), given.iter().map(|(name, _)| (name, name)))?;
    let mut places: Vec<(usize, f64)> = Vec::new();
    for (name, value) in given {
        let at = density.space.index_of(name)?;
        let parameter = &density.space.parameters()[at];
        if !parameter.holds(*value) {
            let problem = format!("`{name}` = {value} is not valid: {}", parameter.bounds_text());
            return Err(Error::usage(Place::option("given"), problem, "give a value inside the bounds"));
        }
        places.push((at, *value));
    }
    if places.len() >= density.space.dimensions() {
        let problem = "nothing is left to draw";
        return Err(Error::usage(Place::option("given"), problem, "leave a parameter open, or use `simulate`"));
    }
    let constrained = density.kde.conditional(&places)?;
    let weights = constrained.component_probabilities().to_vec();
    let effective_scenarios = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
    let mut means = density.kde.points().to_vec();
    let mut spread = density.kde.spread();
    for (at, value) in &places {
        means.iter_mut().for_each(|mean| mean[*at] = *value);
        spread[*at] *= NO_SPREAD;
    }
    let factor = DMatrix::from_diagonal(&DVector::from_vec(spread));
    let n = means.len();
    Ok(Conditional { mixture: Mixture::new(weights, means, vec![factor], vec![0; n])?, effective_scenarios })
}

/// The mixture that a run draws from: the density itself, or given some parameters.
///
/// # Errors
/// As [`conditional`].
pub fn mixture_of(density: &DensityModel, given: &[(String, f64)]) -> Result<Mixture> {
    if given.is_empty() { density.mixture() } else { Ok(conditional(density, given)?.mixture) }
}
