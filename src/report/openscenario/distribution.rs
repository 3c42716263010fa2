//! Distributions of one parameter, sampled by inverse transform: one uniform number gives one value. Transcendental
//! functions come from `libm`, so that draws have the same bits on every machine.

use crate::stats::density::{normal_cdf, normal_quantile};

/// A closed interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Minimum.
    pub low: f64,
    /// Maximum, ≥ `low`.
    pub high: f64,
}

impl Range {
    /// All numbers.
    pub(crate) const ALL: Range = Range { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// The intersection; `None` if it is empty.
    fn and(self, other: Range) -> Option<Range> {
        let both = Range { low: self.low.max(other.low), high: self.high.min(other.high) };
        (both.low <= both.high).then_some(both)
    }

    /// The interval of one value.
    pub(super) fn point(value: f64) -> Range {
        Range { low: value, high: value }
    }

    /// Whether a number is inside.
    pub(crate) fn holds(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// A distribution as OpenSCENARIO describes it.
#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// Uniform over a range.
    Uniform(Range),
    /// Normal, truncated to a range.
    Normal {
        /// Mean before truncation.
        mean: f64,
        /// Standard deviation before truncation, ≥ 0.
        deviation: f64,
        /// Range of the truncation.
        range: Range,
    },
    /// Log-normal.
    LogNormal {
        /// Mean of the logarithm.
        mu: f64,
        /// Standard deviation of the logarithm, ≥ 0.
        sigma: f64,
    },
    /// Poisson, truncated to a range.
    Poisson {
        /// Mean before truncation, 0 … `MAX_POISSON`.
        mean: f64,
        /// Range of the truncation.
        range: Range,
    },
    /// Intervals with weights, each uniform inside; a single value is an interval of zero width.
    Steps(Vec<(Range, f64)>),
}

/// Maximum mean of a Poisson distribution, whose probabilities are tabulated.
pub(super) const MAX_POISSON: f64 = 1e6;

/// A distribution truncated to a range, ready for sampling.
#[derive(Debug, Clone, PartialEq)]
pub enum Draw {
    /// `mean + deviation · quantile`, for probabilities `from` to `to`, counted from above if `is_mirrored`.
    Normal {
        /// Mean before truncation.
        mean: f64,
        /// Standard deviation before truncation.
        deviation: f64,
        /// Range of the truncation.
        range: Range,
        /// Cumulative probability at the nearer end.
        from: f64,
        /// Cumulative probability at the other end.
        to: f64,
        /// Whether probabilities are counted from above, where they are small; this keeps precision in the tail.
        is_mirrored: bool,
    },
    /// e to the power of another draw.
    Exponential(Box<Draw>),
    /// Intervals with the cumulative probability at the end of each; a single value is an interval of zero width.
    Steps {
        /// Intervals.
        steps: Vec<Range>,
        /// Cumulative probabilities; the last is 1.
        until: Vec<f64>,
    },
}

impl Distribution {
    /// The distribution truncated to `within`, and the fraction of its probability that remains; `None` if none
    /// remains.
    pub(super) fn within(&self, within: Range) -> Option<(Draw, f64)> {
        match self {
            Distribution::Uniform(range) => {
                let both = range.and(within)?;
                let width = range.high - range.low;
                Some((Draw::uniform(both), if width > 0.0 { (both.high - both.low) / width } else { 1.0 }))
            }
            Distribution::Normal { mean, deviation, range } => normal(*mean, *deviation, range.and(within)?, *range),
            Distribution::LogNormal { mu, sigma } => {
                let logarithm = |x: f64| if x > 0.0 { libm::log(x) } else { f64::NEG_INFINITY };
                let range = Range { low: logarithm(within.low), high: logarithm(within.high) };
                let (draw, kept) = normal(*mu, *sigma, range, Range::ALL)?;
                Some((Draw::Exponential(Box::new(draw)), kept))
            }
            Distribution::Poisson { mean, range } => {
                let whole = poisson(*mean, *range);
                steps(&whole, within, whole.iter().map(|(_, weight)| weight).sum())
            }
            Distribution::Steps(all) => steps(all, within, all.iter().map(|(_, weight)| weight).sum()),
        }
    }

    /// Fraction of its probability that its own range keeps.
    pub(super) fn range_fraction(&self) -> f64 {
        match self {
            Distribution::Normal { mean, deviation, range } => normal(*mean, *deviation, *range, Range::ALL),
            Distribution::Poisson { mean, range } => steps(&poisson(*mean, *range), Range::ALL, 1.0),
            _ => return 1.0,
        }
        .map_or(0.0, |(_, kept)| kept)
    }
}

impl Draw {
    fn uniform(range: Range) -> Draw {
        Draw::Steps { steps: vec![range], until: vec![1.0] }
    }

    /// The value of a uniform number in (0, 1).
    pub fn value(&self, uniform: f64) -> f64 {
        match self {
            Draw::Normal { mean, deviation, range, from, to, is_mirrored } => {
                let p = from + uniform * (to - from);
                let z = normal_quantile(p);
                let value = if *is_mirrored { mean - deviation * z } else { mean + deviation * z };
                value.clamp(range.low, range.high)
            }
            Draw::Exponential(draw) => libm::exp(draw.value(uniform)),
            Draw::Steps { steps, until } => {
                let at = until.partition_point(|end| *end <= uniform).min(steps.len() - 1);
                let from = if at == 0 { 0.0 } else { until[at - 1] };
                let share = ((uniform - from) / (until[at] - from)).clamp(0.0, 1.0);
                let Range { low, high } = steps[at];
                if low == high { low } else { (low + share * (high - low)).clamp(low, high) }
            }
        }
    }
}

fn normal(mean: f64, deviation: f64, range: Range, own: Range) -> Option<(Draw, f64)> {
    if deviation == 0.0 {
        return range.holds(mean).then(|| (Draw::uniform(Range::point(mean)), 1.0));
    }
    let z = |x: f64| (x - mean) / deviation;
    // In the upper tail probabilities are counted from above, where they are small and not close to 1.
    let is_mirrored = z(range.low) > 0.0;
    let mass = |range: Range| {
        let (a, b) = if is_mirrored { (-z(range.high), -z(range.low)) } else { (z(range.low), z(range.high)) };
        (normal_cdf(a), normal_cdf(b))
    };
    let (from, to) = mass(range);
    let (own_from, own_to) = mass(own);
    let is_there = to - from > f64::MIN_POSITIVE;
    let draw = Draw::Normal { mean, deviation, range, from, to, is_mirrored };
    is_there.then(|| (draw, ((to - from) / (own_to - own_from)).min(1.0)))
}

/// Probabilities of the integers of a range, as far as they are significant in f64.
fn poisson(mean: f64, range: Range) -> Vec<(Range, f64)> {
    // Beyond 40 standard deviations (plus an offset for small means) probabilities are far below 2⁻⁵² and are never
    // drawn.
    let reach = 40.0 * mean.sqrt() + 40.0;
    let first = (mean - reach).max(range.low).max(0.0).ceil();
    let last = (mean + reach).min(range.high).floor();
    if first > last {
        return Vec::new();
    }
    let count = (last - first) as u64;
    let probability = |k: f64| {
        if mean == 0.0 {
            return if k == 0.0 { 1.0 } else { 0.0 };
        }
        libm::exp(k * libm::log(mean) - mean - libm::lgamma(k + 1.0))
    };
    let all = (0..=count).map(|at| first + at as f64).map(|k| (Range::point(k), probability(k)));
    all.filter(|(_, p)| *p > 0.0).collect()
}

/// Weighted intervals truncated to a range. A weight is uniform over its interval. `all` is the sum before truncation.
fn steps(all_steps: &[(Range, f64)], within: Range, all: f64) -> Option<(Draw, f64)> {
    let (mut steps, mut until, mut sum) = (Vec::new(), Vec::new(), 0.0);
    for &(range, weight) in all_steps {
        let Some(both) = range.and(within) else { continue };
        let width = range.high - range.low;
        let part = if width > 0.0 { weight * ((both.high - both.low) / width) } else { weight };
        if part > 0.0 {
            sum += part;
            steps.push(both);
            until.push(sum);
        }
    }
    if !(sum > 0.0 && sum.is_finite()) {
        return None;
    }
    until.iter_mut().for_each(|end| *end /= sum);
    Some((Draw::Steps { steps, until }, (sum / all).min(1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::stats::density::Draws;
    use statrs::distribution::{ContinuousCDF, Discrete, Normal, Poisson};

    const N: u64 = 100_000;

    fn drawn(distribution: &Distribution, within: Range) -> Vec<f64> {
        let (draw, _) = distribution.within(within).unwrap();
        let stream = Stream { seed: 157, purpose: 77 };
        (0..N).map(|index| draw.value(Draws::new(stream, index).uniform())).collect()
    }

    /// Maximum distance between the empirical and the exact cumulative probability, in units of its 0.1 % quantile.
    fn distance(mut values: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
        values.sort_by(f64::total_cmp);
        let n = values.len() as f64;
        let off = |(at, x): (usize, &f64)| {
            let p = cdf(*x);
            (p - at as f64 / n).abs().max((p - (at + 1) as f64 / n).abs())
        };
        values.iter().enumerate().map(off).fold(0.0, f64::max) * n.sqrt() / 1.95
    }

    #[test]
    fn a_normal_distribution_cut_anywhere_is_that_of_its_cumulative_probability() {
        let reference = Normal::new(20.0, 4.0).unwrap();
        for (low, high) in [
            (f64::NEG_INFINITY, f64::INFINITY),
            (15.0, 22.0),
            (f64::NEG_INFINITY, 12.0),
            (31.0, f64::INFINITY),
            (19.9, 20.1),
        ] {
            let range = Range { low, high };
            let distribution = Distribution::Normal { mean: 20.0, deviation: 4.0, range };
            let values = drawn(&distribution, Range::ALL);
            assert!(values.iter().all(|v| range.holds(*v)));
            let (a, b) = (reference.cdf(low), reference.cdf(high));
            let off = distance(values, |x| (reference.cdf(x) - a) / (b - a));
            assert!(off < 1.0, "{range:?}: {off}");
        }
    }

    #[test]
    fn the_far_tail_has_the_values_of_its_quantiles() {
        let range = Range { low: 8.0, high: f64::INFINITY };
        let distribution = Distribution::Normal { mean: 0.0, deviation: 1.0, range };
        let (draw, share) = distribution.within(Range::ALL).unwrap();
        assert_eq!(share, 1.0);
        // Half of the probability beyond 8 is beyond 8.0857.
        let median = draw.value(0.5);
        assert!((normal_cdf(-median) / normal_cdf(-8.0) - 0.5).abs() < 1e-9, "{median}");
        assert!(
            Distribution::Normal { mean: 0.0, deviation: 1.0, range: Range { low: 50.0, high: 60.0 } }
                .within(Range::ALL)
                .is_none()
        );
    }

    #[test]
    fn a_poisson_distribution_has_its_frequencies() {
        for (mean, range) in
            [(3.2, Range::ALL), (0.4, Range::ALL), (60.0, Range { low: 50.0, high: 61.5 }), (900.0, Range::ALL)]
        {
            let values = drawn(&Distribution::Poisson { mean, range }, Range::ALL);
            let reference = Poisson::new(mean).unwrap();
            let ks = (0..2000_u64).filter(|k| range.holds(*k as f64));
            let all: f64 = ks.clone().map(|k| reference.pmf(k)).sum();
            for k in ks {
                let p = reference.pmf(k) / all;
                let count = values.iter().filter(|v| **v == k as f64).count() as f64;
                let deviation = (N as f64 * p * (1.0 - p)).sqrt();
                assert!((count - N as f64 * p).abs() < 5.0 * deviation + 3.0, "{mean}: {k}: {count}");
            }
        }
    }

    #[test]
    fn a_histogram_and_a_set_have_their_weights_and_a_bin_is_even_inside() {
        let range = |low, high| Range { low, high };
        let bins = Distribution::Steps(vec![(range(0.0, 1.0), 1.0), (range(1.0, 4.0), 6.0), (range(5.0, 6.0), 3.0)]);
        let cdf = |x: f64| match x {
            x if x < 1.0 => 0.1 * x,
            x if x < 4.0 => 0.1 + 0.2 * (x - 1.0),
            x if x < 5.0 => 0.7,
            x => 0.7 + 0.3 * (x - 5.0),
        };
        assert!(distance(drawn(&bins, Range::ALL), cdf) < 1.0);
        // Truncated at 2.5, half of the second bin remains.
        let (_, share) = bins.within(range(0.0, 2.5)).unwrap();
        assert!((share - 0.4).abs() < 1e-15);
        assert!(distance(drawn(&bins, range(0.0, 2.5)), |x| cdf(x) / 0.4) < 1.0);
        let set = Distribution::Steps([(7.0, 1.0), (3.0, 0.0), (5.0, 3.0)].map(|(v, p)| (Range::point(v), p)).to_vec());
        let values = drawn(&set, Range::ALL);
        let sevens = values.iter().filter(|v| **v == 7.0).count() as f64 / N as f64;
        assert!((sevens - 0.25).abs() < 5.0 * (0.25 * 0.75 / N as f64).sqrt());
        assert!(values.iter().all(|v| *v == 7.0 || *v == 5.0));
        assert!(set.within(range(0.0, 4.0)).is_none());
    }

    #[test]
    fn a_uniform_distribution_is_even_and_says_what_is_cut_off() {
        let range = Range { low: -2.0, high: 6.0 };
        assert!(distance(drawn(&Distribution::Uniform(range), Range::ALL), |x| (x + 2.0) / 8.0) < 1.0);
        let within = Range { low: 0.0, high: 100.0 };
        let (_, share) = Distribution::Uniform(range).within(within).unwrap();
        assert_eq!(share, 0.75);
        assert!(drawn(&Distribution::Uniform(range), within).iter().all(|v| *v >= 0.0));
        let one = Distribution::Uniform(Range { low: 3.0, high: 3.0 });
        assert!(drawn(&one, Range::ALL).iter().all(|v| *v == 3.0));
    }
}
