//! Subset simulation (Au and Beck, "Estimation of small failure probabilities in high dimensions by subset simulation",
//! Probabilistic Engineering Mechanics 16, 2001). The probability is a product of fractions of about p0; each is the
//! fraction of one level's samples that reach the next level. From the second level on, the samples are states of
//! Markov chains that start at the samples that reached the level.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, DVectorView};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::importance::no_valid_point;
use super::interval::{Interval, log_normal};
use super::problem::{Density, LimitState, evaluate_checked, evaluated, normals, purpose};
use super::stop::StopReason;
use super::summary::Estimate;
use super::trust::Warning;
use crate::Result;
use crate::stats::density::moments::{factor_or_diagonal, moments};
use crate::stats::density::normal::uniform;
use crate::stats::random::Stream;

/// Target acceptance rate for adapting the step size between levels.
const GOAL_ACCEPTANCE: f64 = 0.4;

/// Options of a subset simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subset {
    /// Seed.
    pub seed: u64,
    /// Level of the interval.
    pub level: f64,
    /// Samples of each level, ≥ 20.
    pub samples_per_level: u64,
    /// p0: fraction of a level that starts the next, in (0, 1).
    pub share: f64,
    /// Maximum number of levels.
    pub levels: usize,
}

impl Subset {
    /// p0 = 0.1, at most 12 levels, 95 %.
    pub fn new(seed: u64, samples_per_level: u64) -> Subset {
        Subset { seed, level: 0.95, samples_per_level, share: 0.1, levels: 12 }
    }
}

/// One level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SubsetLevel {
    /// Limit state at which the next level starts; 0 at the last level.
    pub threshold: f64,
    /// Fraction of the level's samples that reach it.
    pub share: f64,
    /// Fraction of the chains' steps that moved; 1 at the first level, which has no chains.
    pub acceptance: f64,
    /// Coefficient of variation of this fraction.
    pub coefficient_of_variation: f64,
}

/// The estimate and its levels.
#[derive(Debug, Clone, PartialEq)]
pub struct SubsetRun {
    /// The estimate.
    pub estimate: Estimate,
    /// The levels.
    pub levels: Vec<SubsetLevel>,
    /// Points of the last level that fail.
    pub failures: Vec<Vec<f64>>,
}

/// A sample of a level: a state of a chain.
#[derive(Clone)]
struct State {
    point: Vec<f64>,
    log_density: f64,
    value: f64,
    /// Chain within the level.
    chain: u32,
    /// Index of the first level's sample that it descends from.
    root: u32,
}

/// Runs level by level until enough samples of a level fail.
///
/// # Errors
/// Those of the limit state; [`crate::Error::Usage`] if the density has no valid point.
pub fn subset(density: &dyn Density, limit_state: &dyn LimitState, options: &Subset) -> Result<SubsetRun> {
    let stream = Stream { seed: options.seed, purpose: purpose::NOMINAL };
    let first = evaluated(density, limit_state, stream, 0..options.samples_per_level.max(20))?;
    if first.points.is_empty() {
        return Err(no_valid_point("subset simulation"));
    }
    let mut states: Vec<State> = Vec::with_capacity(first.points.len());
    for (i, (point, value)) in first.points.into_iter().zip(first.values).enumerate() {
        let log_density = density.log_density(&point);
        states.push(State { point, log_density, value, chain: i as u32, root: i as u32 });
    }
    let mut walk = Walk::new(density, options.seed, &states);
    let mut runs = states.len() as u64;
    let mut levels: Vec<SubsetLevel> = Vec::new();
    let mut influence: BTreeMap<u32, f64> = BTreeMap::new();
    let mut probability = 1.0;
    let mut acceptance = 1.0;
    let mut reached = false;
    for level in 1..=options.levels.max(1) {
        let Some(threshold) = threshold_of(&states, options.share) else { break };
        let share = states.iter().filter(|s| s.value <= threshold).count() as f64 / states.len() as f64;
        let coefficient_of_variation = chain_variation(&states, threshold, share);
        for state in &states {
            let deviation = f64::from(u8::from(state.value <= threshold)) - share;
            *influence.entry(state.root).or_default() += deviation / (states.len() as f64 * share);
        }
        probability *= share;
        levels.push(SubsetLevel { threshold, share, acceptance, coefficient_of_variation });
        if threshold <= 0.0 {
            reached = true;
            break;
        }
        if level == options.levels.max(1) {
            break;
        }
        let (next, new_runs, accepted) = walk.level(limit_state, &states, threshold, level as u32)?;
        states = next;
        runs += new_runs;
        acceptance = accepted;
    }
    let failures: Vec<Vec<f64>> = states.iter().filter(|s| s.value <= 0.0).map(|s| s.point.clone()).collect();
    let estimate =
        conclude(options, &levels, &influence, probability, reached, runs, failures.len() as u64, &states, first.voids);
    Ok(SubsetRun { estimate, levels, failures })
}

/// The estimate from the levels.
#[allow(clippy::too_many_arguments)]
fn conclude(
    options: &Subset,
    levels: &[SubsetLevel],
    influence: &BTreeMap<u32, f64>,
    probability: f64,
    reached: bool,
    runs: u64,
    failures: u64,
    states: &[State],
    voids: u64,
) -> Estimate {
    // ln P = Σ ln p_l. A root's influence is the sum of its descendants' deviations in all levels. So the sum of
    // squares includes correlations within chains, between chains of one ancestor and between levels.
    let squares = influence.values().map(|d| d * d).sum::<f64>();
    let fourths = influence.values().map(|d| d.powi(4)).sum::<f64>();
    let by_levels: f64 = levels.iter().map(|l| l.coefficient_of_variation.powi(2)).sum();
    let coefficient_of_variation = squares.max(by_levels).sqrt();
    let degrees_of_freedom = if fourths > 0.0 { squares * squares / fourths } else { 1.0 };
    let interval = log_normal(probability, coefficient_of_variation, degrees_of_freedom, options.level);
    let mut lineages: BTreeMap<u32, f64> = BTreeMap::new();
    for state in states.iter().filter(|s| s.value <= 0.0) {
        *lineages.entry(state.root).or_default() += 1.0;
    }
    let sum: f64 = lineages.values().sum();
    let lineages = sum * sum / lineages.values().map(|n| n * n).sum::<f64>().max(1.0);
    let (estimated, variance, interval) = if reached {
        (probability, (probability * coefficient_of_variation).powi(2), interval)
    } else {
        // Chains that do not approach failure give no information beyond: the only bound is 1.
        (0.0, 0.0, Interval::nothing(options.level))
    };
    let mut estimate =
        Estimate::new("subset", estimated, variance, interval, runs, failures, voids, StopReason::Samples);
    estimate.trust.about_voids(voids, options.samples_per_level);
    for (i, level) in levels.iter().enumerate().skip(1) {
        let stuck = Warning::ChainsStuck { level: i + 1, acceptance: level.acceptance };
        estimate.trust.warn_if(level.acceptance < Warning::MIN_ACCEPTANCE, stuck);
    }
    estimate.trust.warn_if(reached && lineages < Warning::MIN_LINEAGES, Warning::FewLineages { lineages });
    let threshold = levels.last().map_or(f64::INFINITY, |l| l.threshold);
    estimate.trust.warn_if(!reached, Warning::LevelsNotReached { levels: levels.len(), threshold });
    estimate
}

/// The value that about a fraction `share` of the states reach, at least 0. On a plateau, where many states have the
/// same value, the next lower value; `None` if all states have one value above 0.
fn threshold_of(states: &[State], share: f64) -> Option<f64> {
    let mut values: Vec<f64> = states.iter().map(|s| s.value).collect();
    values.sort_by(f64::total_cmp);
    let wanted = ((share * values.len() as f64).round() as usize).clamp(1, values.len());
    let threshold = values[wanted - 1];
    if threshold <= 0.0 {
        return Some(0.0);
    }
    let reaching = values.partition_point(|v| *v <= threshold);
    let below = values.partition_point(|v| *v < threshold);
    if reaching > 2 * wanted && below > 0 {
        return Some(values[below - 1].max(0.0));
    }
    (reaching < values.len()).then_some(threshold)
}

/// Coefficient of variation of a level's fraction from the correlation within its chains: √(Σ over chains of the
/// squared sum of deviations)/(n p). This is Au and Beck's √((1 − p)/(p n) (1 + γ)) with all lags of γ.
fn chain_variation(states: &[State], threshold: f64, share: f64) -> f64 {
    let mut chains: BTreeMap<u32, f64> = BTreeMap::new();
    for state in states {
        *chains.entry(state.chain).or_default() += f64::from(u8::from(state.value <= threshold)) - share;
    }
    chains.values().map(|d| d * d).sum::<f64>().sqrt() / (states.len() as f64 * share)
}

/// The moves of the chains. Two kinds alternate; each alone leaves the density invariant. First, two steps of the
/// autoregressive move x' = m + √(1 − s²)(x − m) + s L z. It is reversible for the Gaussian with the density's mean and
/// covariance, and corrected by Metropolis-Hastings to the density (preconditioned Crank-Nicolson with a reference). It
/// crosses a level in few steps for any number of parameters. Second, one random walk step with the seeds' spread,
/// which does not get stuck where the density is far from that Gaussian. For the standard normal density the first kind
/// needs no correction and is used alone.
struct Walk<'a> {
    density: &'a dyn Density,
    seed: u64,
    /// Mean of the reference.
    mean: DVector<f64>,
    /// L of the reference.
    factor: DMatrix<f64>,
    /// Weight s of the new direction in an autoregressive move.
    turn: f64,
    /// Step of the random walk in units of the seeds' spread.
    stride: f64,
}

/// Every third step is a random walk.
const KINDS: u64 = 3;

impl<'a> Walk<'a> {
    /// Estimates the reference from draws of the density.
    fn new(density: &'a dyn Density, seed: u64, draws: &[State]) -> Self {
        let d = density.dimensions();
        let stride = 2.0 / (d as f64).sqrt();
        let (mean, factor) = spread(draws, d);
        Walk { density, seed, mean, factor, turn: 0.6, stride }
    }

    /// Makes the next level: chains from the states at or below the threshold, with the same total number of states;
    /// the seeds are the first states of the chains. All chains step together, one batch per step. Also returns the
    /// number of runs and the fraction of steps that moved.
    ///
    /// A move is accepted first by the density ratio, then by the limit state; both keep the density restricted to the
    /// level invariant. The whole level has one step size.
    fn level(
        &mut self,
        limit_state: &dyn LimitState,
        states: &[State],
        threshold: f64,
        level: u32,
    ) -> Result<(Vec<State>, u64, f64)> {
        let mut chains: Vec<State> = states.iter().filter(|s| s.value <= threshold).cloned().collect();
        chains.iter_mut().enumerate().for_each(|(i, state)| state.chain = i as u32);
        let (_, seeds) = spread(&chains, self.density.dimensions());
        let stream = Stream { seed: self.seed, purpose: purpose::CHAIN + level };
        let mut next = chains.clone();
        let mut runs = 0_u64;
        // Per kind of move: autoregressive, random walk.
        let (mut moves, mut steps) = ([0_u64; 2], [0_u64; 2]);
        let mut step = 0_u64;
        while next.len() < states.len() {
            step += 1;
            let walks = !self.density.is_standard_normal() && step.is_multiple_of(KINDS);
            let kind = usize::from(walks);
            chains.truncate(states.len() - next.len());
            let candidates: Vec<Option<(Vec<f64>, f64)>> = chains
                .par_iter()
                .map(|state| {
                    let index = (step << 32) | u64::from(state.chain);
                    if walks { self.walked(state, &seeds, &stream, index) } else { self.turned(state, &stream, index) }
                })
                .collect();
            let points: Vec<Vec<f64>> = candidates.iter().flatten().map(|(point, _)| point.clone()).collect();
            let mut values = evaluate_checked(limit_state, &points)?.into_iter();
            runs += points.len() as u64;
            steps[kind] += chains.len() as u64;
            for (state, candidate) in chains.iter_mut().zip(candidates) {
                let Some((point, log_density)) = candidate else { continue };
                let Some(value) = values.next() else { continue };
                if value <= threshold {
                    (state.point, state.log_density, state.value) = (point, log_density, value);
                    moves[kind] += 1;
                }
            }
            next.extend(chains.iter().cloned());
        }
        let share = |moves: u64, steps: u64| if steps > 0 { moves as f64 / steps as f64 } else { GOAL_ACCEPTANCE };
        let steer = |kind: usize| libm::exp(1.5 * (share(moves[kind], steps[kind]) - GOAL_ACCEPTANCE));
        self.turn = (self.turn * steer(0)).clamp(0.05, 0.95);
        self.stride *= steer(1);
        Ok((next, runs, share(moves[0] + moves[1], steps[0] + steps[1])))
    }

    /// An autoregressive move, or `None` if the density rejects it, which costs no run.
    fn turned(&self, state: &State, stream: &Stream, index: u64) -> Option<(Vec<f64>, f64)> {
        let d = self.density.dimensions();
        let z = normals(stream, index, 1, d);
        let keep = (1.0 - self.turn * self.turn).sqrt();
        if self.density.is_standard_normal() {
            let point: Vec<f64> = state.point.iter().zip(&z).map(|(x, z)| keep * x + self.turn * z).collect();
            let log_density = self.density.log_density(&point);
            return Some((point, log_density));
        }
        let step = &self.factor * DVector::from_vec(z);
        let point: Vec<f64> =
            (0..d).map(|j| self.mean[j] + keep * (state.point[j] - self.mean[j]) + self.turn * step[j]).collect();
        // The correction: ln of the reference density, up to its constant, at the old and at the proposed point.
        let gain = self.log_reference(&state.point) - self.log_reference(&point);
        self.evaluated_by_density(state, point, gain, stream, index)
    }

    /// A step of a random walk, or `None` if the density rejects it.
    fn walked(&self, state: &State, seeds: &DMatrix<f64>, stream: &Stream, index: u64) -> Option<(Vec<f64>, f64)> {
        let step = seeds * DVector::from_vec(normals(stream, index, 1, self.density.dimensions()));
        let point: Vec<f64> = state.point.iter().zip(&step).map(|(x, s)| x + self.stride * s).collect();
        self.evaluated_by_density(state, point, 0.0, stream, index)
    }

    fn log_reference(&self, point: &[f64]) -> f64 {
        let mut z = DVectorView::from_slice(point, point.len()) - &self.mean;
        self.factor.solve_lower_triangular_mut(&mut z);
        -0.5 * z.norm_squared()
    }

    fn evaluated_by_density(
        &self,
        state: &State,
        point: Vec<f64>,
        gain: f64,
        stream: &Stream,
        index: u64,
    ) -> Option<(Vec<f64>, f64)> {
        if !self.density.is_valid(&point) {
            return None;
        }
        let log_density = self.density.log_density(&point);
        let chance = libm::log(uniform(stream.words(index, 0)[0]));
        (chance <= log_density - state.log_density + gain).then_some((point, log_density))
    }
}

/// Mean of states and L of their covariance, shrunk a little towards its diagonal.
fn spread(states: &[State], d: usize) -> (DVector<f64>, DMatrix<f64>) {
    let (mean, mut covariance) = moments(states.iter().map(|s| (s.point.as_slice(), 1.0)), d);
    let keep = states.len() as f64 / (states.len() as f64 + d as f64 + 1.0);
    let mut diagonal = covariance.diagonal();
    diagonal.zip_apply(&mean, |variance, mean| *variance += (1e-9 * (1.0 + mean.abs())).powi(2));
    covariance *= keep;
    covariance.set_diagonal(&diagonal);
    (mean, factor_or_diagonal(covariance))
}
