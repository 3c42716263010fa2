//! How well a density represents unseen scenarios: M = W(gen, test) + 0.25 (W(gen, test) − W(gen, train)), smaller is
//! better (arXiv 2202.12025). The first term is fidelity; the second penalizes generated scenarios that only repeat the
//! training scenarios.
//!
//! Scenarios are split at random, several times. Each time the density (and the decomposition of a parameterization by
//! SVD) is fitted on the training part, and the same number of valid scenarios is drawn from it. Under the reduction,
//! distances are those of the whole weighted vectors w∘z, so different numbers of coefficients can be compared.
//! Kinematic parameterizations are compared as points divided by their scales, so their M can be compared only between
//! runs of the same parameterization.
//!
//! The held-out log-likelihood of the test scenarios, and the Sinkhorn divergence between them and the drawn ones, tell
//! apart densities of several kinds over the same parameters.
//!
//! W is exact. Sets larger than [`MAX_SET`] are replaced by random subsets of that size, on both
//! sides: W of small sets is larger, for all terms of one table alike.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::bandwidth::BandwidthRule;
use super::kde::Kde;
use super::moments::{scale_of, standard_deviation};
use super::normal::Draws;
use super::parameters::ParameterSpace;
use super::transformed::{DensityKind, TransformedMixture};
use super::transport::{mean_distance, sinkhorn, wasserstein};
use crate::random::Stream;
use crate::scenario::Scenario;
use crate::scenario::parameterization::Reduction;
use crate::{Error, Place, Result};

/// β of the metric.
const BETA: f64 = 0.25;
/// Maximum number of points of a set; larger sets are subsampled.
const MAX_SET: usize = 256;
/// ε of the Sinkhorn divergence, as a fraction of the mean distance between training and test scenarios.
const SINKHORN_EPSILON: f64 = 0.05;
/// Random splits.
const REPETITIONS: usize = 5;
/// Maximum number of draws per required valid scenario before a split fails.
const MAX_TRIES: u64 = 1000;
/// [`Stream::purpose`] of splits and draws; the repetition is added.
const PURPOSE: u32 = 0x7265_7000;

/// The metric, as the mean over the splits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Representativeness {
    /// M.
    pub metric: f64,
    /// Standard deviation of M over the splits, ddof 0.
    pub metric_deviation: f64,
    /// W(gen, test).
    pub generated_test: f64,
    /// W(gen, train).
    pub generated_train: f64,
    /// W(train, test): the value that the same number of recorded scenarios reaches.
    pub train_test: f64,
    /// Sinkhorn divergence between drawn and test scenarios, with ε = 0.05 of the mean distance between training and test
    /// scenarios; `None` in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sinkhorn: Option<f64>,
    /// Mean log-likelihood of a test scenario under the density of the training scenarios, truncated to the valid region
    /// [ln of 1 / product of the units]; `None` in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_likelihood: Option<f64>,
    /// Its standard deviation over the splits, ddof 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_likelihood_deviation: Option<f64>,
    /// Splits.
    pub repetitions: u64,
    /// Scenarios in the training part; as many are drawn.
    pub train: u64,
    /// Scenarios in the test part.
    pub test: u64,
    /// Seed of splits and draws.
    pub seed: u64,
}

/// M from its three sets; exact.
pub fn metric(generated: &[Vec<f64>], train: &[Vec<f64>], test: &[Vec<f64>]) -> f64 {
    combine(wasserstein(generated, test), wasserstein(generated, train))
}

fn combine(generated_test: f64, generated_train: f64) -> f64 {
    generated_test + BETA * (generated_test - generated_train)
}

impl Representativeness {
    /// Splits, fits, draws and compares. `scenarios` are those that the density of `space` is fitted on, all valid.
    ///
    /// # Errors
    /// [`Error::Input`] if a training part is too small or too uniform to be fitted, or its density hardly ever gives a
    /// valid scenario.
    pub(super) fn estimate(
        space: &ParameterSpace,
        scenarios: &[&Scenario],
        form: (DensityKind, BandwidthRule),
        seed: u64,
    ) -> Result<Representativeness> {
        let test = (scenarios.len() / 5).max(1);
        let split = |repetition: usize| {
            one_split(space, scenarios, test, form, Stream { seed, purpose: PURPOSE + repetition as u32 })
        };
        let distances = (0..REPETITIONS).into_par_iter().map(split).collect::<Result<Vec<_>>>()?;
        let mean = |k: usize| distances.iter().map(|d| d[k]).sum::<f64>() / REPETITIONS as f64;
        let metrics: Vec<f64> = distances.iter().map(|d| combine(d[0], d[1])).collect();
        Ok(Representativeness {
            metric: metrics.iter().sum::<f64>() / REPETITIONS as f64,
            metric_deviation: standard_deviation(&metrics),
            generated_test: mean(0),
            generated_train: mean(1),
            train_test: mean(2),
            sinkhorn: Some(mean(3)),
            log_likelihood: Some(mean(4)),
            log_likelihood_deviation: Some(standard_deviation(&distances.iter().map(|d| d[4]).collect::<Vec<_>>())),
            repetitions: REPETITIONS as u64,
            train: (scenarios.len() - test) as u64,
            test: test as u64,
            seed,
        })
    }
}

/// W(gen, test), W(gen, train), W(train, test), the Sinkhorn divergence and the log-likelihood of one split.
fn one_split(
    space: &ParameterSpace,
    scenarios: &[&Scenario],
    test: usize,
    (kind, rule): (DensityKind, BandwidthRule),
    stream: Stream,
) -> Result<[f64; 5]> {
    // Index 0 of the stream shuffles, the others draw.
    let mut shuffled = scenarios.to_vec();
    let mut draws = Draws::new(stream, 0);
    for last in (1..shuffled.len()).rev() {
        shuffled.swap(last, draws.below(last + 1));
    }
    let (test, train) = shuffled.split_at(test);
    let reduction = space.reduction().map(|r| Reduction::fit(r.category, train, space.options())).transpose()?;
    let fitted = ParameterSpace::new(*space.id(), space.options(), reduction.as_ref(), space.has_thw())?;
    let points = |set: &[&Scenario]| set.iter().map(|s| fitted.point(s)).collect::<Result<Vec<_>>>();
    let train_points = points(train)?;
    let names: Vec<&str> = space.parameters().iter().map(|p| p.name.as_str()).collect();
    let kde = Kde::fit(train_points.clone(), &names, rule)?;
    let mixture = TransformedMixture::fit(kind, &train_points, fitted.parameters())?;
    let draw = |index: u64| mixture.as_ref().map_or_else(|| kde.draw(&stream, index), |of| of.draw(&stream, index));
    let kernels = kde.mixture()?;
    let log_density =
        |point: &Vec<f64>| mixture.as_ref().map_or_else(|| kernels.log_density(point), |of| of.log_density(point));
    let log_likelihoods: Vec<f64> = points(test)?.par_iter().map(log_density).collect();
    let (train, test) = (&train[..train.len().min(MAX_SET)], &test[..test.len().min(MAX_SET)]);
    let max_draws = MAX_TRIES * train.len() as u64;
    let (mut generated, mut draws) = (Vec::new(), 0);
    while generated.len() < train.len() && draws < max_draws {
        draws += 1;
        generated.extend(Some(draw(draws)).filter(|x| fitted.is_valid(x)));
    }
    if generated.len() < train.len() {
        return Err(Error::input(
            Place::item("representativeness"),
            format!("only {} of {max_draws} draws are valid scenarios", generated.len()),
            "nearly all of the density lies outside of the bounds: look at the scenarios",
        ));
    }
    let log_valid = libm::log(generated.len() as f64 / draws as f64);
    let log_likelihood = log_likelihoods.iter().sum::<f64>() / log_likelihoods.len() as f64 - log_valid;
    let (generated, train, test) = match space.reduction() {
        // The same metric for all splits: the weights of the fit on all scenarios.
        Some(all) => {
            let coefficients = fitted.dimensions() - usize::from(fitted.has_thw());
            let thw = |p: &[f64], z: &mut Vec<f64>, scale: Option<f64>| {
                if let (Some(scale), Some(thw_s)) = (scale, fitted.thw_s(p)) {
                    z.push(thw_s / scale);
                }
            };
            let thw_scale = fitted.has_thw().then(|| kde.scale()[coefficients]);
            let weigh = |z: Vec<f64>| z.iter().zip(&all.basis.weights).map(|(z, w)| z * w).collect::<Vec<f64>>();
            let recorded = |set: &[&Scenario]| {
                let vector = |s: &&Scenario| {
                    let mut z = weigh(all.vector(s)?);
                    thw(&fitted.point(s)?, &mut z, thw_scale);
                    Ok(z)
                };
                set.iter().map(vector).collect::<Result<Vec<_>>>()
            };
            let basis = fitted.reduction().map(|r| &r.basis);
            let rebuilt = |p: &Vec<f64>| {
                let mut z = weigh(basis.map(|b| b.reconstruct(&p[..coefficients])).unwrap_or_default());
                thw(p, &mut z, thw_scale);
                z
            };
            (generated.iter().map(rebuilt).collect::<Vec<_>>(), recorded(train)?, recorded(test)?)
        }
        None => {
            let columns: Vec<f64> =
                (0..names.len()).map(|j| scale_of(&train_points.iter().map(|p| p[j]).collect::<Vec<_>>())).collect();
            let divide = |set: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
                set.iter().map(|p| p.iter().zip(&columns).map(|(v, s)| v / s).collect()).collect()
            };
            (divide(generated), divide(points(train)?), divide(points(test)?))
        }
    };
    let divergence = sinkhorn(&generated, &test, SINKHORN_EPSILON * mean_distance(&train, &test));
    let distances = [(&generated, &test), (&generated, &train), (&train, &test)].map(|(a, b)| wasserstein(a, b));
    Ok([distances[0], distances[1], distances[2], divergence, log_likelihood])
}
