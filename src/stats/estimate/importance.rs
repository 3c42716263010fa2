//! Importance sampling: draws of a proposal g with weights f/g.
//!
//! The author's form fits the proposal to the worst points of a pilot drawn from f. The defensive mixture gives f the
//! weight δ in the proposal. This bounds the weights by 1/δ, and makes failure modes visible that g misses.

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::blocks::BlockSums;
use super::interval::{Interval, log_normal};
use super::problem::{Density, Draw, LimitState, batches, draw, evaluate_checked, evaluated, purpose};
use super::stop::{StopReason, StopRule};
use super::summary::Estimate;
use super::trust::Warning;
use super::weights::{WeightSums, WeightedDraw};
use crate::stats::density::moments::moments;
use crate::stats::density::normal::uniform;
use crate::stats::density::{Mixture, MixtureFitOptions as FitOptions};
use crate::stats::random::Stream;
use crate::{Error, Place, Result};

/// Fits a density to points, for example a kernel density estimate.
pub trait FitProposal {
    /// The density of the points.
    /// # Errors
    /// If the points do not determine a density.
    fn fit(&self, points: &[Vec<f64>]) -> Result<Mixture>;
}

impl<F: Fn(&[Vec<f64>]) -> Result<Mixture>> FitProposal for F {
    fn fit(&self, points: &[Vec<f64>]) -> Result<Mixture> {
        self(points)
    }
}

/// (1 − δ) g + δ f, truncated like f. Every attempt selects g or f anew, so the mixture is truncated as a whole.
pub struct Defended<'a> {
    nominal: &'a dyn Density,
    proposal: Mixture,
    weight: f64,
    validity: f64,
}

/// Mixes the density into a proposal with weight δ in [0, 1]; with 0 only the validity rule is adopted.
///
/// # Errors
/// [`Error::Usage`] if the weight is outside [0, 1] or the numbers of parameters differ.
pub fn defended(proposal: Mixture, nominal: &dyn Density, weight: f64) -> Result<Defended<'_>> {
    if !(0.0..=1.0).contains(&weight) || proposal.dimensions() != nominal.dimensions() {
        return Err(Error::usage(
            Place::item("defensive mixture"),
            format!(
                "a share of {weight}, {} parameters of the proposal and {} of the density do not fit together",
                proposal.dimensions(),
                nominal.dimensions()
            ),
            "give a share from 0 to 1 and two densities over the same parameters",
        ));
    }
    Ok(Defended { nominal, proposal, weight, validity: 1.0 })
}

impl Defended<'_> {
    /// The same with its valid fraction counted over `draws` draws. The balance heuristic needs this if points can be
    /// invalid. No interval includes its relative error √((1 − P)/(P·draws)).
    pub fn with_counted_validity(mut self, seed: u64, draws: u64) -> Self {
        let stream = Stream { seed, purpose: purpose::VALIDITY };
        let is_valid = |index: &u64| self.is_valid(&self.attempt(&stream, *index, 0));
        let valid = (0..draws).into_par_iter().filter(is_valid).count();
        // A proposal without a valid draw is detected when it is sampled.
        self.validity = (valid as f64 / draws.max(1) as f64).max(f64::MIN_POSITIVE);
        self
    }

    /// The proposal alone.
    pub fn proposal(&self) -> &Mixture {
        &self.proposal
    }
}

impl Density for Defended<'_> {
    fn validity_fraction(&self) -> f64 {
        self.validity
    }

    fn dimensions(&self) -> usize {
        self.proposal.dimensions()
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        if !self.nominal.is_valid(point) {
            return f64::NEG_INFINITY;
        }
        let of = |weight: f64, log: &dyn Fn() -> f64| {
            if weight > 0.0 { libm::log(weight) + log() } else { f64::NEG_INFINITY }
        };
        let a = of(1.0 - self.weight, &|| self.proposal.log_density(point));
        let b = of(self.weight, &|| self.nominal.log_density(point));
        let top = a.max(b);
        if top == f64::NEG_INFINITY { top } else { top + libm::log(libm::exp(a - top) + libm::exp(b - top)) }
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        let choice = Stream { purpose: stream.purpose.wrapping_add(purpose::CHOICE), ..*stream };
        if uniform(choice.words(index, attempt)[0]) < self.weight {
            self.nominal.attempt(stream, index, attempt)
        } else {
            self.proposal.draw(stream, index, attempt)
        }
    }

    fn is_valid(&self, point: &[f64]) -> bool {
        self.nominal.is_valid(point)
    }
}

/// Failures of a sample of the density itself, for comparison with an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PilotCheck {
    /// Number of runs of the pilot.
    pub runs: u64,
    /// Number of its failures.
    pub failures: u64,
}

impl PilotCheck {
    /// Adds the pilot's runs to a later estimate, and a warning if the two disagree.
    pub fn add_to(&self, estimate: &mut Estimate) {
        estimate.set_runs(estimate.runs + self.runs);
        self.check(estimate);
    }

    /// Adds a warning if the pilot's number of failures is too unlikely under an estimate.
    pub(crate) fn check(&self, estimate: &mut Estimate) {
        let p = estimate.probability;
        let interval = super::clopper_pearson(self.failures, self.runs, 1.0 - Warning::PILOT_LIKELIHOOD);
        // The estimate is uncertain too: overlapping intervals are no disagreement.
        let apart = estimate.interval.high < interval.low || estimate.interval.low > interval.high;
        let (failures, expected) = (self.failures, p * self.runs as f64);
        estimate.trust.warn_if(apart && !interval.holds(p), Warning::DisagreesWithPilot { failures, expected });
    }
}

/// Options for sampling a proposal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Importance {
    /// Seed.
    pub seed: u64,
    /// Level of the interval.
    pub level: f64,
    /// When to end.
    pub stop: StopRule,
    /// Divides by the sum of the weights instead of the number of draws. The bias is of order 1/n, and the variance is
    /// lower only if many draws fail. Required if a density is known only up to a constant.
    pub self_normalised: bool,
}

impl Importance {
    /// `samples` samples, unbiased, level 95 %.
    pub fn new(seed: u64, samples: u64) -> Importance {
        Importance { seed, level: 0.95, stop: StopRule::samples(samples), self_normalised: false }
    }
}

/// The leaf of one evaluated draw.
pub(crate) fn weigh(nominal: &dyn Density, proposal: &dyn Density, drawn: &Draw, response: f64) -> WeightedDraw {
    let ratio = libm::exp(nominal.log_density(&drawn.point) - proposal.log_density(&drawn.point));
    WeightedDraw {
        weight: ratio / nominal.validity_fraction(),
        response,
        tries: drawn.tries,
        is_void: false,
        is_thin: ratio > Warning::THIN_RATIO,
    }
}

/// Draws, evaluates and weights a range of indices. Sums of disjoint ranges merge to those of their union, bit for bit.
///
/// # Errors
/// Those of the limit state.
pub fn importance_sums(
    nominal: &dyn Density,
    proposal: &dyn Density,
    limit_state: &dyn LimitState,
    seed: u64,
    indices: Range<u64>,
) -> Result<BlockSums<WeightSums>> {
    sums_of_stream(nominal, proposal, limit_state, Stream { seed, purpose: purpose::PROPOSAL }, indices, proposal)
}

/// The same for draws of one density weighted relative to another (the mixture of several techniques).
pub(crate) fn sums_of_stream(
    nominal: &dyn Density,
    drawn_from: &dyn Density,
    limit_state: &dyn LimitState,
    stream: Stream,
    indices: Range<u64>,
    weighed_against: &dyn Density,
) -> Result<BlockSums<WeightSums>> {
    let mut sums = BlockSums::default();
    for batch in batches(indices) {
        let mut draws = draw(drawn_from, stream, batch.clone());
        let points: Vec<Vec<f64>> = draws.iter_mut().flatten().map(|drawn| std::mem::take(&mut drawn.point)).collect();
        let values = evaluate_checked(limit_state, &points)?;
        let mut judged = points.into_iter().zip(values);
        let judged: Vec<(Option<Draw>, f64)> = draws
            .into_iter()
            .map(|drawn| match drawn {
                Some(drawn) => match judged.next() {
                    Some((point, value)) => (Some(Draw { point, ..drawn }), value),
                    None => (None, 0.0),
                },
                None => (None, 0.0),
            })
            .collect();
        let leaves: Vec<WeightSums> = judged
            .par_iter()
            .map(|(drawn, value)| match drawn {
                Some(drawn) => weigh(nominal, weighed_against, drawn, f64::from(u8::from(*value <= 0.0))).into(),
                None => WeightedDraw::void().into(),
            })
            .collect();
        sums.merge(BlockSums::of_leaves(batch.start, &leaves))?;
    }
    Ok(sums)
}

/// Student's interval on the scale of ln P; the degrees of freedom are the effective number of failures minus one.
pub(crate) fn weighted_interval(probability: f64, variance: f64, effective_failures: f64, level: f64) -> Interval {
    if probability <= 0.0 || variance <= 0.0 {
        return Interval::nothing(level);
    }
    log_normal(probability, variance.sqrt() / probability, effective_failures - 1.0, level)
}

/// The estimate from sums.
pub fn from_weight_sums(sums: &WeightSums, self_normalised: bool, level: f64, stopped: StopReason) -> Estimate {
    let figures = sums.figures();
    let (method, probability, variance) = if self_normalised {
        ("importance_self_normalised", figures.self_normalised, figures.self_normalised_variance)
    } else {
        ("importance", sums.unbiased(), sums.unbiased_variance())
    };
    let probability = probability.min(1.0);
    let interval = weighted_interval(probability, variance, figures.effective_size_failures, level);
    let mut estimate =
        Estimate::new(method, probability, variance, interval, sums.draws, sums.failures, sums.voids, stopped);
    estimate.trust.about_voids(sums.voids, sums.draws + sums.voids);
    estimate.trust.about_weights(&figures, sums.failures);
    estimate.weights = Some(figures);
    estimate
}

/// Samples the proposal until a rule ends it. The proposal must be valid wherever the density is. If g = 0 where f > 0
/// and failure is possible, the estimate is too small without any warning.
///
/// # Errors
/// Those of the limit state.
pub fn importance(
    nominal: &dyn Density,
    proposal: &dyn Density,
    limit_state: &dyn LimitState,
    options: &Importance,
) -> Result<Estimate> {
    let started = Instant::now();
    let (mut sums, mut samples) = (BlockSums::default(), 0);
    loop {
        let next = options.stop.next(samples);
        sums.merge(importance_sums(nominal, proposal, limit_state, options.seed, samples..next)?)?;
        samples = next;
        let total: WeightSums = sums.total().unwrap_or_default();
        let of = |reason| from_weight_sums(&total, options.self_normalised, options.level, reason);
        let estimate = of(StopReason::Samples);
        if let Some(reason) = options.stop.at(samples, total.failures, estimate.relative_half_width, started) {
            return Ok(of(reason));
        }
    }
}

/// The fraction of the points with the smallest values, at least one point. Points with equal values keep their order.
pub fn worst_points(points: &[Vec<f64>], values: &[f64], fraction: f64) -> Vec<Vec<f64>> {
    let mut order: Vec<usize> = (0..points.len().min(values.len())).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]).then(a.cmp(b)));
    let count = ((fraction * order.len() as f64).round() as usize).clamp(1, order.len().max(1));
    order.into_iter().take(count).map(|i| points[i].clone()).collect()
}

/// Options of a pilot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pilot {
    /// Number of draws of the density.
    pub runs: u64,
    /// Fraction of the draws, the worst ones, that the proposal is fitted to.
    pub worst: f64,
    /// Weight of one broad Gaussian in the proposal: its covariance is that of the worst points plus a quarter of the
    /// pilot's. Kernels are narrow across the limit, where failures decrease more slowly than a kernel does. Without
    /// it, rare large weights make intervals too short.
    pub broad: f64,
    /// Defensive mixture weight δ of the density in the proposal.
    pub defence: f64,
}

impl Pilot {
    /// The worst 2 %, a broad weight of 0.2, a defensive mixture weight of 0.1.
    pub fn guarded(runs: u64) -> Pilot {
        Pilot { runs, worst: 0.02, broad: 0.2, defence: 0.1 }
    }
}

/// The author's form: a pilot drawn from the density, a fit to its worst fraction, then importance sampling. The
/// estimate is checked against the pilot. Also returns the proposal without its defensive part, for reuse.
///
/// # Errors
/// Those of the limit state and of the fit; [`Error::Usage`] if the pilot has no valid point or a fraction is outside
/// [0, 1].
pub fn from_pilot(
    nominal: &dyn Density,
    limit_state: &dyn LimitState,
    fit: &dyn FitProposal,
    pilot: &Pilot,
    options: &Importance,
) -> Result<(Estimate, Mixture)> {
    let (fitted, check) = pilot_proposal(nominal, limit_state, fit, pilot, options.seed)?;
    let proposal = defended(fitted, nominal, pilot.defence)?;
    let mut estimate = importance(nominal, &proposal, limit_state, options)?;
    check.add_to(&mut estimate);
    Ok((estimate, proposal.proposal().clone()))
}

/// The proposal of a pilot, without its defensive part, and the pilot's counts. Estimates from draws of both are
/// checked with [`PilotCheck::add_to`].
///
/// # Errors
/// As [`from_pilot`].
pub fn pilot_proposal(
    nominal: &dyn Density,
    limit_state: &dyn LimitState,
    fit: &dyn FitProposal,
    pilot: &Pilot,
    seed: u64,
) -> Result<(Mixture, PilotCheck)> {
    let stream = Stream { seed, purpose: purpose::NOMINAL };
    let first = evaluated(nominal, limit_state, stream, 0..pilot.runs)?;
    if first.points.is_empty() {
        return Err(no_valid_point("pilot"));
    }
    let worst = worst_points(&first.points, &first.values, pilot.worst);
    let mut fitted = fit.fit(&worst)?;
    if pilot.broad > 0.0 {
        let one = FitOptions { components: 1, choose: false, ..FitOptions::default() };
        let equal = first.points.iter().map(|p| (p.as_slice(), 1.0));
        let covariance = moments(equal, nominal.dimensions()).1;
        let broad = Mixture::fit(&worst, &vec![1.0; worst.len()], &one)?.widened(&covariance, 0.25)?;
        fitted = Mixture::join(&[(1.0 - pilot.broad, &fitted), (pilot.broad, &broad)])?;
    }
    let runs = first.points.len() as u64;
    let failures = first.values.iter().filter(|v| **v <= 0.0).count() as u64;
    Ok((fitted, PilotCheck { runs, failures }))
}

/// The error if no draw is valid.
pub(crate) fn no_valid_point(of: &str) -> Error {
    Error::usage(
        Place::item(of),
        "no draw of the density is valid",
        "check the bounds of the parameters: they must leave something of the density",
    )
}
