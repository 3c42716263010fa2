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
//! W is exact. Sets larger than [`MAX_SET`] are replaced by random subsets of that size, on both
//! sides: W of small sets is larger, for all terms of one table alike.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::bandwidth::BandwidthRule;
use super::kde::Kde;
use super::moments::{scale_of, standard_deviation};
use super::normal::Draws;
use super::parameters::ParameterSpace;
use super::transport::wasserstein;
use crate::scenario::Scenario;
use crate::scenario::parameterization::Reduction;
use crate::stats::random::Stream;
use crate::{Error, Place, Result};

/// β of the metric.
pub const BETA: f64 = 0.25;
/// Maximum number of points of a set; larger sets are subsampled.
pub const MAX_SET: usize = 256;
/// Random splits.
pub const REPETITIONS: usize = 5;
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
    pub fn estimate(
        space: &ParameterSpace,
        scenarios: &[&Scenario],
        rule: BandwidthRule,
        seed: u64,
    ) -> Result<Representativeness> {
        let test = (scenarios.len() / 5).max(1);
        let split = |repetition: usize| one_split(space, scenarios, test, rule, seed, repetition as u32);
        let distances = (0..REPETITIONS).into_par_iter().map(split).collect::<Result<Vec<_>>>()?;
        let mean = |k: usize| distances.iter().map(|d| d[k]).sum::<f64>() / REPETITIONS as f64;
        let metrics: Vec<f64> = distances.iter().map(|d| combine(d[0], d[1])).collect();
        Ok(Representativeness {
            metric: metrics.iter().sum::<f64>() / REPETITIONS as f64,
            metric_deviation: standard_deviation(&metrics),
            generated_test: mean(0),
            generated_train: mean(1),
            train_test: mean(2),
            repetitions: REPETITIONS as u64,
            train: (scenarios.len() - test) as u64,
            test: test as u64,
            seed,
        })
    }
}

/// W(gen, test), W(gen, train), W(train, test) of one split.
fn one_split(
    space: &ParameterSpace,
    scenarios: &[&Scenario],
    test: usize,
    rule: BandwidthRule,
    seed: u64,
    repetition: u32,
) -> Result<[f64; 3]> {
    let stream = Stream { seed, purpose: PURPOSE + repetition };
    // Index 0 of the stream shuffles, the others draw.
    let mut shuffled = scenarios.to_vec();
    let mut draws = Draws::new(stream, 0);
    for last in (1..shuffled.len()).rev() {
        shuffled.swap(last, draws.below(last + 1));
    }
    let (test, train) = shuffled.split_at(test);
    let reduction = space.reduction().map(|r| Reduction::fit(r.category, train, space.options())).transpose()?;
    let fitted = ParameterSpace::new(space.id().clone(), space.options(), reduction.as_ref(), space.has_thw())?;
    let points = |set: &[&Scenario]| set.iter().map(|s| fitted.point(s)).collect::<Result<Vec<_>>>();
    let train_points = points(train)?;
    let names: Vec<&str> = space.parameters().iter().map(|p| p.name.as_str()).collect();
    let kde = Kde::fit(train_points.clone(), &names, rule)?;
    let (train, test) = (&train[..train.len().min(MAX_SET)], &test[..test.len().min(MAX_SET)]);
    let max_draws = MAX_TRIES * train.len() as u64;
    let valid = (1..=max_draws).map(|index| kde.draw(&stream, index)).filter(|x| fitted.is_valid(x)).take(train.len());
    let generated: Vec<Vec<f64>> = valid.collect();
    if generated.len() < train.len() {
        return Err(Error::input(
            Place::item("representativeness"),
            format!("only {} of {max_draws} draws are valid scenarios", generated.len()),
            "nearly all of the density lies outside of the bounds: look at the scenarios",
        ));
    }
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
    Ok([wasserstein(&generated, &test), wasserstein(&generated, &train), wasserstein(&train, &test)])
}
