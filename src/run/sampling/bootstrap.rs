//! The data's share of the uncertainty: scenarios are drawn again with replacement, the density and the exposure
//! follow, and each replicate is sampled anew.
//!
//! A replicate keeps scale and bandwidth of the density: resampled kernels stand on one another, and a
//! leave-one-out likelihood would shrink the bandwidth to nothing. A decomposition keeps its basis.

use serde::Serialize;

use super::crude::{CrudeOptions, sample_crude};
use super::generator::SampleSource;
use super::plan::{SamplePlanOptions, plan_samples};
use super::tally::TallyOptions;
use crate::engine::{Executor, RecheckOptions};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::stats::density::{DensityModel, Kde, quantile};
use crate::stats::estimate::{BinomialInterval, StopRule};
use crate::stats::random::{Stream, choose};
use crate::{Error, Result};

/// Purpose of the words that choose scenarios.
const RESAMPLING: u32 = 0x424f_4f54;
/// Purpose of the words that draw numbers of events.
const EVENTS: u32 = 0x4556_4e54;

/// Interval of one model and criterion over the replicates.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BootstrapRow {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// 2.5 % and 97.5 % of the replicates' probabilities.
    pub probability: [f64; 2],
    /// The same of failures per hour, λ drawn again as a Poisson count; where the hours are known.
    pub per_hour: Option<[f64; 2]>,
    /// The same of failures per 1,000 km, where the kilometres are known.
    pub per_1000_km: Option<[f64; 2]>,
}

/// All rows, with how they were made.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BootstrapRecord {
    /// Replicates.
    pub replicates: u32,
    /// Samples of each.
    pub samples: u64,
    /// Over all headways of the run.
    pub rows: Vec<BootstrapRow>,
}

/// Runs `replicates` replicates of `samples` samples each.
///
/// # Errors
/// Of the backends and the plans.
pub fn bootstrap(
    density: &DensityModel,
    profile: &Profile,
    options: &SamplePlanOptions,
    executor: &Executor,
    replicates: u32,
    samples: u64,
    mut progress: impl FnMut(),
) -> Result<BootstrapRecord> {
    let counting = TallyOptions { worst: 0, criterion: Criterion::Collision, map: None };
    let crude = CrudeOptions {
        stop: StopRule::samples(samples),
        interval: BinomialInterval::Wilson,
        level: 0.95,
        exposure: None,
        is_sampled_headway: density.space.has_thw(),
    };
    let cells = options.models.len() * Criterion::ALL.len();
    let mut probabilities: Vec<Vec<f64>> = vec![Vec::new(); cells];
    let mut events: Vec<f64> = Vec::new();
    for replicate in 0..replicates {
        let resampled = resampled(density, options.seed, replicate)?;
        // Every replicate has draws of its own.
        let seed = options.seed.wrapping_add(1 + u64::from(replicate));
        let options = SamplePlanOptions { samples, seed, source: SampleSource::Random, ..options.clone() };
        let plan = plan_samples(&resampled, &resampled.mixture()?, profile, &options)?;
        let executor = Executor { recheck: executor.recheck.map(|of| RecheckOptions { seed, ..of }), ..*executor };
        let run = sample_crude(&plan, 0..samples, &executor, &counting, &crude, |_| Ok(()))?;
        let overall = run.convergence.last().map(|c| c.rows.clone()).unwrap_or_default();
        if overall.len() != cells {
            return Err(Error::Internal("a replicate has other rows than the run".to_owned()));
        }
        for (list, row) in probabilities.iter_mut().zip(&overall) {
            list.push(row.probability);
        }
        events.push(poisson(density.provenance.kept as f64, options.seed, replicate));
        progress();
    }
    let exposure = density.exposure.as_ref();
    let hours = exposure.and_then(|e| e.driven.hours);
    let kilometres = exposure.and_then(|e| e.driven.kilometres);
    let ends = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        [quantile(values, 0.025), quantile(values, 0.975)]
    };
    let mut rows = Vec::new();
    for (at, list) in probabilities.iter().enumerate() {
        let rate = |units: Option<f64>, scale: f64| {
            units.map(|u| ends(&mut list.iter().zip(&events).map(|(p, n)| p * n / u * scale).collect()))
        };
        rows.push(BootstrapRow {
            model: options.models[at / Criterion::ALL.len()],
            criterion: Criterion::ALL[at % Criterion::ALL.len()],
            probability: ends(&mut list.clone()),
            per_hour: rate(hours, 1.0),
            per_1000_km: rate(kilometres, 1000.0),
        });
    }
    Ok(BootstrapRecord { replicates, samples, rows })
}

/// The density of as many scenarios, drawn with replacement.
fn resampled(density: &DensityModel, seed: u64, replicate: u32) -> Result<DensityModel> {
    let points = density.kde.points();
    let stream = Stream { seed, purpose: RESAMPLING.wrapping_add(replicate) };
    let n = points.len() as u32;
    let drawn = (0..n).map(|k| points[choose(stream.words(u64::from(k), 0)[0], n) as usize].clone()).collect();
    let kde = Kde::from_parts(drawn, density.kde.scale().to_vec(), *density.kde.bandwidth())?;
    Ok(DensityModel { kde, ..density.clone() })
}

/// A Poisson number of events around the counted one, by inversion of the normal approximation with continuity
/// correction where the mean is large, by products of uniform numbers where it is small.
fn poisson(mean: f64, seed: u64, replicate: u32) -> f64 {
    let stream = Stream { seed, purpose: EVENTS };
    if mean > 50.0 {
        let z = f64::from(crate::stats::random::standard_normal(stream.words(u64::from(replicate), 0)[0]));
        // Anscombe's root: √(N + 3/8) is normal around √(mean + 3/8) with deviation ½.
        let root = (mean + 0.375).sqrt() + 0.5 * z;
        return (root * root - 0.375).round().max(0.0);
    }
    let (limit, mut product, mut count) = (libm::exp(-mean), 1.0, 0.0);
    for block in 0.. {
        for word in stream.words(u64::from(replicate), block) {
            product *= f64::from(crate::stats::random::unit_uniform(word));
            if product <= limit {
                return count;
            }
            count += 1.0;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::poisson;

    #[test]
    fn numbers_of_events_have_mean_and_variance_of_their_distribution() {
        for mean in [3.0, 20.0, 170.0] {
            let n = 4000;
            let draws: Vec<f64> = (0..n).map(|r| poisson(mean, 5, r)).collect();
            let average = draws.iter().sum::<f64>() / f64::from(n);
            let variance = draws.iter().map(|d| (d - average) * (d - average)).sum::<f64>() / f64::from(n);
            assert!((average - mean).abs() < 4.0 * (mean / f64::from(n)).sqrt(), "{mean}: {average}");
            assert!((variance / mean - 1.0).abs() < 0.1, "{mean}: variance {variance}");
        }
    }
}
