//! The lane plan of a sampling run: one block whose units are sample indices.

use std::sync::Arc;

use lanesweep_engine::generated::Generator;
use lanesweep_engine::{Block, Headway, LanePlan, Units};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_random::Stream;
use lanesweep_stats::density::DensityModel;
use lanesweep_support::{Error, Place, Result, option};

use super::generator::{SAMPLE_PURPOSE, generator_of, generator_of_points};
use super::sample_options::{SampleHeadways, SampleOptions};

/// The plan whose unit `i` is draw `i` of the density.
///
/// # Errors
/// [`Error::Usage`] without samples, for more than 2⁶³ lanes, for headways that the
/// density does not have, and as [`generator_of`].
pub fn plan_samples(density: &DensityModel, profile: &Profile, options: &SampleOptions) -> Result<LanePlan> {
    let samples = options.stop.samples;
    let place = || Place::option("samples");
    if samples == 0 {
        return Err(Error::usage(place(), "0 samples estimate nothing", "give 1000000, for instance"));
    }
    let stream = Stream { seed: options.seed, purpose: SAMPLE_PURPOSE };
    plan_draws(density, stream, profile, samples, &options.models, &options.headways)
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
    let generator = generator_of(&density.space, &density.kde, &density.sizes, profile, stream)?;
    plan(density, profile, generator, draws, models, headways)
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
    let refused = |problem: &str, help: String| Err(Error::usage(Place::option("thw"), problem, help));
    let fit_with = format!("fit it with {}, or give a headway in seconds", option("with_thw"));
    let headways = match (headways, density.space.has_thw()) {
        (SampleHeadways::Sampled, true) => vec![Headway::GapM(0.0)],
        (SampleHeadways::Sampled, false) => {
            return refused(
                "this density has no parameter `thw_s`, so observed headways cannot be drawn from it",
                fit_with,
            );
        }
        (SampleHeadways::Each(_), true) => {
            let help = format!("use {}, or fit it without {}", option("thw = sampled"), option("with_thw"));
            return refused("this density draws the headway itself (parameter `thw_s`)", help);
        }
        (SampleHeadways::Each(list), false) if Headway::is_observed(list) => {
            return refused("this density has no observed headways (parameter `thw_s`)", fit_with);
        }
        (SampleHeadways::Each(list), false) => list.clone(),
    };
    let id = density.space.id();
    let block = Block::new(id.category, Units::Numbered(samples), vec![id.key.to_string()]);
    LanePlan::new(profile.clone(), models.to_vec(), headways, vec![block], Arc::new(generator))
}
