//! The ratio of two rates that are measured on the same clusters: the recorded runs of a scenario and the draws around
//! it, say. Clusters are independent of one another, the two measurements on one cluster are not.

use serde::Serialize;

use super::interval::{Interval, rule_of_three, student_quantile, wilson};

/// Runs and failures, one number per cluster; both slices are equally long.
#[derive(Debug, Clone, Copy)]
pub struct Clusters<'a> {
    /// Runs; a cluster may have none.
    pub runs: &'a [u64],
    /// Those that failed.
    pub failures: &'a [u64],
}

impl Clusters<'_> {
    /// Failed runs.
    pub fn failed(&self) -> u64 {
        self.failures.iter().sum()
    }

    /// Clusters with a failed run.
    pub fn failing(&self) -> u64 {
        self.failures.iter().filter(|k| **k > 0).count() as u64
    }

    /// Failed runs over runs; 0 without runs.
    pub fn rate(&self) -> f64 {
        let runs: u64 = self.runs.iter().sum();
        if runs > 0 { self.failed() as f64 / runs as f64 } else { 0.0 }
    }

    /// What each cluster adds to rate − expected rate: (k_i − R·m_i)/Σm (the linearized ratio of totals).
    fn influences(&self) -> impl Iterator<Item = f64> + '_ {
        let total = self.runs.iter().sum::<u64>().max(1) as f64;
        let rate = self.rate();
        self.failures.iter().zip(self.runs).map(move |(&k, &m)| (k as f64 - rate * m as f64) / total)
    }
}

/// A rate with the interval that its clusters tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClusterRate {
    /// Failed runs over runs.
    pub rate: f64,
    /// Its variance over repeats of the whole sampling of clusters.
    pub variance: f64,
    /// Its interval.
    pub interval: Interval,
}

/// The rate with the variance between clusters, N/(N − 1)·Σ((k_i − R·m_i)/Σm)² (the ultimate-cluster estimator: it
/// holds what happens within clusters too; Cochran, "Sampling Techniques", 11.9). The interval is made as that of
/// [`super::from_clusters`], which this is for clusters of equal size.
pub fn cluster_rate(clusters: Clusters, level: f64) -> ClusterRate {
    let n = clusters.runs.len() as f64;
    let (rate, total) = (clusters.rate(), clusters.runs.iter().sum::<u64>());
    let squares: f64 = clusters.influences().map(|z| z * z).sum();
    let variance = if n > 1.0 { n / (n - 1.0) * squares } else { rate * (1.0 - rate) };
    let interval = if clusters.failed() == 0 {
        rule_of_three(clusters.runs.len() as u64, level)
    } else {
        let binomial = rate * (1.0 - rate);
        let effective = if variance > 0.0 { (binomial / variance).clamp(1.0, total as f64) } else { n };
        wilson(rate * effective, effective, level)
    };
    ClusterRate { rate, variance, interval }
}

/// What a ratio says of its numerator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RatioVerdict {
    /// The interval of the ratio holds 1.
    Agrees,
    /// The interval lies above 1.
    TooHigh,
    /// The interval lies below 1.
    TooLow,
    /// Too few failures to tell.
    Undecided,
}

impl RatioVerdict {
    /// All, in the order of every table.
    pub const ALL: [RatioVerdict; 4] =
        [RatioVerdict::Agrees, RatioVerdict::TooHigh, RatioVerdict::TooLow, RatioVerdict::Undecided];

    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            RatioVerdict::Agrees => "agrees",
            RatioVerdict::TooHigh => "too high",
            RatioVerdict::TooLow => "too low",
            RatioVerdict::Undecided => "undecided",
        }
    }

    /// In one character.
    pub fn mark(self) -> char {
        match self {
            RatioVerdict::Agrees => '=',
            RatioVerdict::TooHigh => '>',
            RatioVerdict::TooLow => '<',
            RatioVerdict::Undecided => '?',
        }
    }
}

/// How the interval of a ratio was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RatioMethod {
    /// Student's t on the logarithm, differences cluster by cluster.
    Paired,
    /// One rate's interval over the other's: too few failures for the logarithm.
    Separate,
}

/// How many failures each side needs for the paired interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Enough {
    /// Failed runs.
    pub failures: u64,
    /// Clusters with a failed run.
    pub clusters: u64,
}

impl Default for Enough {
    fn default() -> Self {
        Enough { failures: 10, clusters: 5 }
    }
}

/// A ratio of rates. Values that are not finite are `None`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    /// Numerator over denominator.
    pub ratio: Option<f64>,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// How the interval was made.
    pub method: RatioMethod,
    /// What it says.
    pub verdict: RatioVerdict,
}

/// The ratio of two rates over the same clusters, in the same order.
///
/// With enough failures on both sides the interval is R·exp(∓t·σ) with
/// σ² = N/(N − 1)·Σ(z_i/P − y_i/S)², z and y being the clusters' influences on numerator and denominator: the delta
/// method on the logarithm, which takes the covariance of the two with it. What varies within clusters (draws of a
/// Monte Carlo sample) is in σ² as well. t has one degree of freedom less than the side with fewer failing clusters
/// has of them. A numerator that equals the denominator cluster by cluster has the interval [1, 1].
///
/// With too few failures the interval is [P_low/S_high, P_high/S_low] of [`cluster_rate`]: 1 outside still decides,
/// 1 inside is undecided, not agreement.
pub fn paired_ratio(numerator: Clusters, denominator: Clusters, enough: Enough, level: f64) -> Ratio {
    let finite = |v: f64| v.is_finite().then_some(v);
    let (p, s) = (numerator.rate(), denominator.rate());
    let side = |c: Clusters| c.failed() >= enough.failures.max(1) && c.failing() >= enough.clusters.max(2);
    if !(side(numerator) && side(denominator)) {
        let (above, below) = (cluster_rate(numerator, level).interval, cluster_rate(denominator, level).interval);
        let (low, high) = (above.low / below.high, above.high / below.low);
        let verdict = match () {
            () if low > 1.0 => RatioVerdict::TooHigh,
            () if high < 1.0 => RatioVerdict::TooLow,
            () => RatioVerdict::Undecided,
        };
        let method = RatioMethod::Separate;
        return Ratio { ratio: finite(p / s), low: finite(low), high: finite(high), method, verdict };
    }
    let n = numerator.runs.len() as f64;
    let pairs = numerator.influences().zip(denominator.influences());
    let squares: f64 = pairs.map(|(z, y)| (z / p - y / s) * (z / p - y / s)).sum();
    let sigma = (n / (n - 1.0) * squares).sqrt();
    let freedom = numerator.failing().min(denominator.failing()) as f64 - 1.0;
    let factor = libm::exp(student_quantile(0.5 + 0.5 * level, freedom) * sigma);
    let ratio = p / s;
    let (low, high) = (ratio / factor, ratio * factor);
    let verdict = match () {
        () if low > 1.0 => RatioVerdict::TooHigh,
        () if high < 1.0 => RatioVerdict::TooLow,
        () => RatioVerdict::Agrees,
    };
    Ratio { ratio: Some(ratio), low: finite(low), high: finite(high), method: RatioMethod::Paired, verdict }
}

#[cfg(test)]
mod tests {
    use super::super::{StopReason, from_clusters};
    use super::*;
    use crate::random::{Stream, unit_uniform};

    #[test]
    fn clusters_of_equal_size_have_the_interval_of_equal_clusters() {
        let failures: Vec<u64> = (0..200).map(|k| [0, 0, 3, 10, 1][k % 5]).collect();
        let runs = vec![10; 200];
        let ours = cluster_rate(Clusters { runs: &runs, failures: &failures }, 0.95);
        let squares = failures.iter().map(|k| k * k).sum();
        let theirs = from_clusters(200, 10, failures.iter().sum(), squares, 0.95, StopReason::Samples);
        assert_eq!(ours.rate, theirs.probability);
        assert!((ours.variance / theirs.variance - 1.0).abs() < 1e-12);
        assert!((ours.interval.high - theirs.interval.high).abs() < 1e-12);
    }

    #[test]
    fn equals_agree_and_a_share_of_them_is_too_low() {
        let runs = vec![10; 100];
        let failures: Vec<u64> = (0..100).map(|k| [0, 0, 4, 10][k % 4]).collect();
        let half: Vec<u64> = failures.iter().map(|k| k / 2).collect();
        let all = Clusters { runs: &runs, failures: &failures };
        let same = paired_ratio(all, all, Enough::default(), 0.95);
        assert_eq!((same.low, same.high, same.verdict), (Some(1.0), Some(1.0), RatioVerdict::Agrees));
        let low = paired_ratio(Clusters { runs: &runs, failures: &half }, all, Enough::default(), 0.95);
        assert_eq!((low.ratio, low.verdict), (Some(0.5), RatioVerdict::TooLow));
    }

    #[test]
    fn no_failure_on_one_side_is_undecided_until_the_other_cannot_be_chance() {
        let runs = vec![10; 100];
        let none = vec![0; 100];
        let with = |failing: usize| (0..100).map(|k| if k < failing { 10 } else { 0 }).collect::<Vec<u64>>();
        let of = |failing: usize| {
            let failures = with(failing);
            let some = Clusters { runs: &runs, failures: &failures };
            let nothing = Clusters { runs: &runs, failures: &none };
            let ratio = |a, b| paired_ratio(a, b, Enough::default(), 0.95);
            (ratio(some, nothing).verdict, ratio(nothing, some).verdict)
        };
        assert_eq!(of(0), (RatioVerdict::Undecided, RatioVerdict::Undecided));
        assert_eq!(of(3), (RatioVerdict::Undecided, RatioVerdict::Undecided));
        assert_eq!(of(40), (RatioVerdict::TooHigh, RatioVerdict::TooLow));
    }

    #[test]
    fn the_interval_holds_the_true_ratio_in_about_its_level_of_repeats() {
        // A scenario's hardness q decides both sides: recorded runs fail with q, draws with 0.8·q.
        let (repeats, n, m) = (1500_u64, 80_u64, 10_u64);
        let (mut held, mut width) = (0, 0.0);
        for repeat in 0..repeats {
            let stream = Stream { seed: repeat, purpose: 9 };
            let (mut recorded, mut sampled, mut draws) = (Vec::new(), Vec::new(), Vec::new());
            for cluster in 0..n {
                let mut block = 0;
                let mut uniform = || {
                    block += 1;
                    f64::from(unit_uniform(stream.words(cluster, block)[0]))
                };
                let q = uniform() * uniform();
                let size = 20 + (uniform() * 20.0) as u64;
                recorded.push((0..m).filter(|_| uniform() < q).count() as u64);
                sampled.push((0..size).filter(|_| uniform() < 0.8 * q).count() as u64);
                draws.push(size);
            }
            let runs = vec![m; n as usize];
            let over = Clusters { runs: &draws, failures: &sampled };
            let ratio = paired_ratio(over, Clusters { runs: &runs, failures: &recorded }, Enough::default(), 0.95);
            let (low, high) = (ratio.low.unwrap(), ratio.high.unwrap());
            held += u64::from(low <= 0.8 && 0.8 <= high);
            width += libm::log(high / low) / repeats as f64;
        }
        let share = held as f64 / repeats as f64;
        assert!((0.93..0.97).contains(&share), "{share}");
        // Independent sides would be judged with √(σ_P² + σ_S²), about 0.6 wide here.
        assert!(width < 0.4, "{width}");
    }
}
