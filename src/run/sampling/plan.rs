//! The lane plan of a sampling run: one block whose units are sample indices. Also the density conditional on given
//! parameters, which a run may draw from.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::engine::generated::{Generator, PointSource};
use crate::engine::{Block, Headway, LanePlan, Units};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::model::scalar::Real;
use crate::random::{SOBOL_POINTS, Stream};
use crate::stats::density::{DensityKind, DensityModel, Mixture};
use crate::support::ranges::refuse_repeats;
use crate::{Error, Place, Result};

use super::generator::{SampleSource, generator_of, generator_of_points};
use super::sample_options::{SampleHeadways, SampleOptions};

/// The plan whose unit `i` is draw `i` of `proposal` (the density itself for crude Monte Carlo).
///
/// # Errors
/// [`Error::Usage`] without samples, for more than 2⁶³ lanes or more samples than Sobol points, for headways that the
/// density does not have, and as [`generator_of`].
pub fn plan_samples(
    density: &DensityModel,
    proposal: &Mixture,
    profile: &Profile,
    options: &SampleOptions,
) -> Result<LanePlan> {
    let samples = options.stop.samples;
    let place = || Place::option("samples");
    if samples == 0 {
        return Err(Error::usage(place(), "0 samples estimate nothing", "give 1000000, for instance"));
    }
    if options.source == SampleSource::Sobol && samples > SOBOL_POINTS {
        let problem = format!("{samples} Sobol points are asked for, {SOBOL_POINTS} there are");
        return Err(Error::usage(place(), problem, "use independent random points beyond"));
    }
    let generator = generator(density, proposal, profile, (options.source, options.seed))?;
    plan(density, profile, generator, samples, &options.models, &options.headways)
}

/// The plan whose unit `i` is draw `i` of the density in a stream.
///
/// # Errors
/// As [`plan_samples`].
pub(super) fn plan_draws(
    density: &DensityModel,
    stream: Stream,
    profile: &Profile,
    draws: u64,
    models: &[ModelId],
    headways: &SampleHeadways,
) -> Result<LanePlan> {
    let mut generator = generator(density, &density.mixture()?, profile, (SampleSource::Random, stream.seed))?;
    generator.points.source = PointSource::Random(stream);
    plan(density, profile, generator, draws, models, headways)
}

fn generator(
    density: &DensityModel,
    proposal: &Mixture,
    profile: &Profile,
    (source, seed): (SampleSource, u64),
) -> Result<Generator> {
    let mut generator = generator_of(&density.space, proposal, &density.sizes, profile, source, seed)?;
    if let Some(of) = &density.transformed {
        generator.points.knots = of.transformation.table().map(f32::from_f64).collect();
    }
    Ok(generator)
}

/// The plan whose unit `i` is point `i`.
///
/// # Errors
/// As [`plan_samples`].
pub fn plan_points(
    density: &DensityModel,
    points: &[Vec<f64>],
    profile: &Profile,
    models: &[ModelId],
    headways: &SampleHeadways,
) -> Result<LanePlan> {
    let generator = generator_of_points(&density.space, points, &density.sizes, profile)?;
    plan(density, profile, generator, points.len() as u64, models, headways)
}

fn plan(
    density: &DensityModel,
    profile: &Profile,
    generator: Generator,
    samples: u64,
    models: &[ModelId],
    headways: &SampleHeadways,
) -> Result<LanePlan> {
    let headways = match (headways, density.space.has_thw()) {
        (SampleHeadways::Sampled, true) => vec![Headway::GapM(0.0)],
        (SampleHeadways::Sampled, false) => {
            return Err(Error::usage(
                Place::option("thw"),
                "this density has no parameter `thw_s`, so observed headways cannot be drawn from it",
                "fit it with option `with_thw`, or give a headway in seconds",
            ));
        }
        (SampleHeadways::Each(_), true) => {
            return Err(Error::usage(
                Place::option("thw"),
                "this density draws the headway itself (parameter `thw_s`)",
                "use option `thw = sampled`, or fit it without option `with_thw`",
            ));
        }
        (SampleHeadways::Each(list), false) if Headway::is_observed(list) => {
            return Err(Error::usage(
                Place::option("thw"),
                "this density has no observed headways (parameter `thw_s`)",
                "fit it with option `with_thw`, or give a headway in seconds",
            ));
        }
        (SampleHeadways::Each(list), false) => list.clone(),
    };
    let id = density.space.id();
    let block = Block {
        category: id.category,
        units: Units::Numbered(samples),
        variants: vec![id.key.to_string()],
        first_unit: 0,
        first_lane: 0,
    };
    LanePlan::new(profile.clone(), models.to_vec(), headways, vec![block], Arc::new(generator))
}

/// Spread of a given parameter, relative to the spread of its kernels: negligible in the lane arithmetic, but not zero.
const NO_SPREAD: f64 = 1e-12;

/// A conditional density, and its effective number of scenarios.
#[derive(Debug, Clone, PartialEq)]
pub struct Conditional {
    /// f̂ given the values.
    pub mixture: Mixture,
    /// (Σw)²/Σw² over the kernels' weights: the number of scenarios near the given values.
    pub effective_scenarios: f64,
}

/// The density given the values of these parameters, by name. The weight of each kernel is its density at the values.
///
/// # Errors
/// [`Error::Usage`] for a density that is not over kernels, an unknown or duplicate parameter, if all are given, or for a value outside the valid range.
pub fn conditional(density: &DensityModel, given: &[(String, f64)]) -> Result<Conditional> {
    if density.kind() != DensityKind::Kernel {
        let problem = format!("a density of kind {} cannot be conditioned on a parameter", density.kind().key());
        return Err(Error::usage(Place::option("given"), problem, "fit one of kind kernel"));
    }
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

/// The mixture that a run draws from: the density, or the conditional density if parameters are given.
///
/// # Errors
/// As [`conditional`].
pub(crate) fn mixture_of(density: &DensityModel, given: &[(String, f64)]) -> Result<Mixture> {
    if given.is_empty() { density.mixture() } else { Ok(conditional(density, given)?.mixture) }
}
