//! The same probabilities at other bandwidths of the density: at both ends of the 95 % interval of its leave-one-out
//! likelihood. No interval of an estimate holds the bandwidth. Lanes are the CPU's, so that a merge has the same ones.

use serde::Serialize;

use super::limit_state::{LaneLimitState, truncated};
use super::result::SampleResult;
use super::sample_options::SampleOptions;
use super::{Sample, SampleKind, Weighted};
use lanesweep_engine::{CpuBackend, Executor};
use lanesweep_stats::density::DensityModel;
use lanesweep_stats::estimate::{Importance, StopRule, Warning, WeightSums, from_weight_sums, importance_sums};
use lanesweep_support::Result;

/// Maximum number of draws of a proposal at each end, and of crude Monte Carlo …
const DRAWS: u64 = 20_000;
/// … unless this fraction of its samples is more.
const FRACTION: u64 = 16;
/// Maximum number of lanes of the density beside the draws of a proposal.
const BESIDE_LANES: u64 = 1 << 20;
/// Lanes of a driver outside the registry are thousands of times as slow, so that they are fewer.
const FEWER: u64 = 16;
/// Probabilities within this factor of one another agree, as in the comparison with recorded scenarios.
const AGREE: f64 = 1.25;
/// An interval that reaches beyond this factor does not tell whether they do.
const TELLING: f64 = 2.0;

/// What the interval of the bandwidth does to a probability; the worst first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BandwidthVerdict {
    /// P differs at an end, beyond chance and by more than a quarter.
    Decides,
    /// Too few failures at an end to tell.
    Open,
    /// Neither.
    Agrees,
}

impl BandwidthVerdict {
    /// Name in files.
    pub fn key(self) -> &'static str {
        match self {
            BandwidthVerdict::Decides => "decides",
            BandwidthVerdict::Open => "open",
            BandwidthVerdict::Agrees => "agrees",
        }
    }
}

/// A probability at another bandwidth, with the interval of its draws.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AtBandwidth {
    /// The bandwidth over that of the density.
    pub factor: f64,
    /// P.
    pub probability: f64,
    /// Lower end of the interval of the draws.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl AtBandwidth {
    /// Whether it is another probability than the one with this interval of its draws.
    fn verdict(&self, probability: f64, [low, high]: [f64; 2]) -> BandwidthVerdict {
        let factor = self.probability / probability;
        if (self.low > high || self.high < low) && !(1.0 / AGREE..=AGREE).contains(&factor) {
            return BandwidthVerdict::Decides;
        }
        let is_told = self.low * TELLING >= probability && self.high <= TELLING * probability && probability > 0.0;
        if is_told { BandwidthVerdict::Agrees } else { BandwidthVerdict::Open }
    }
}

impl Sample {
    /// Adds to every row its probability at both ends. Densities of files of earlier versions know none.
    ///
    /// # Errors
    /// Those of the lanes.
    pub(super) fn at_bandwidths(&self, mut result: SampleResult) -> Result<SampleResult> {
        let Some(likelihood) = self.density.kde.bandwidth().likelihood else { return Ok(result) };
        let is_slow = self.options.models.iter().any(|model| model.foreign().is_some());
        let share = if is_slow { FEWER } else { 1 };
        for (end, value) in [likelihood.low, likelihood.high].into_iter().enumerate() {
            // A kernel may be too wide for any valid draw.
            let Ok(density) = self.density.at_bandwidth(value) else { continue };
            let factor = value / self.density.kde.bandwidth().value;
            let found = match &self.kind {
                SampleKind::Crude(_) => {
                    self.crude_at(density, (self.options.stop.samples / FRACTION).max(DRAWS) / share)?
                }
                SampleKind::Weighted(weighted) => self.weighted_at(&density, weighted, share)?,
                SampleKind::Search(_) => return Ok(result),
            };
            for (row, (probability, [low, high])) in result.rows.iter_mut().zip(found) {
                row.at_bandwidths[end] = Some(AtBandwidth { factor, probability, low, high });
            }
        }
        for row in &mut result.rows {
            let [Some(narrow), Some(wide)] = row.at_bandwidths else { continue };
            let verdicts = [narrow, wide].map(|of| of.verdict(row.estimate.probability, row.draws));
            row.bandwidth = verdicts.into_iter().min();
            let warning = Warning::BandwidthDecides { narrow: narrow.probability, wide: wide.probability };
            row.estimate.trust.warn_if(row.bandwidth == Some(BandwidthVerdict::Decides), warning);
        }
        Ok(result)
    }

    /// Estimates of crude Monte Carlo with another density, in the order of the rows, with the intervals of the draws.
    fn crude_at(&self, density: DensityModel, draws: u64) -> Result<Vec<(f64, [f64; 2])>> {
        let draws = draws.min(self.options.stop.samples);
        let options = SampleOptions { stop: StopRule::samples(draws), ..self.options.clone() };
        let cpu = CpuBackend::lane_arithmetic();
        // It knows no likelihood, so that it asks for no further bandwidths.
        let rows = Sample::plan(density, &self.profile, &options)?.run(&Executor::new(&cpu))?.rows;
        Ok(rows.iter().map(|row| (row.estimate.probability, row.draws)).collect())
    }

    /// The same of importance sampling: the proposal is that of the run.
    fn weighted_at(&self, density: &DensityModel, of: &Weighted, share: u64) -> Result<Vec<(f64, [f64; 2])>> {
        let draws = of.draws.draws.min(DRAWS / share);
        let crude = (of.draws.draws * of.draws.crude_per_draw).min(BESIDE_LANES / share / self.lanes_per_sample());
        let options = Importance { seed: of.draws.seed, draws, crude_per_draw: (crude / draws).max(1) };
        let (nominal, asked, cpu) = (truncated(density)?, self.options.asked(), CpuBackend::lane_arithmetic());
        let executor = Executor::new(&cpu);
        let lanes = LaneLimitState::new(density, &self.profile, &self.options.headways, &asked, executor);
        let sums = importance_sums(&nominal, &of.proposal, &lanes, &options, 0..draws)?;
        // The bound on what was missed is wider than the change of a rare probability.
        let of_sums = |sums: WeightSums| {
            let found = sums.interval_of_found(self.options.level);
            let interval = if sums.failures > 0 { found } else { from_weight_sums(&sums, self.options.level).interval };
            (sums.probability().min(1.0), [interval.low, interval.high])
        };
        Ok(sums.iter().map(|of| of_sums(of.total().unwrap_or_default())).collect())
    }
}
