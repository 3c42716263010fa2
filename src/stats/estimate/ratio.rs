//! The ratio of two rates measured on the same clusters, for example the recorded runs of a scenario and the draws
//! around it. Clusters are independent; the two measurements on one cluster are not.

use serde::Serialize;

use super::interval::{Interval, IntervalKind, rule_of_three, student_factor, student_quantile, wilson};

/// Runs and failures, one number per cluster; both slices have the same length.
#[derive(Debug, Clone, Copy)]
pub struct Clusters<'a> {
    /// Runs; a cluster may have none.
    pub runs: &'a [u64],
    /// Number of failed runs.
    pub failures: &'a [u64],
}

impl Clusters<'_> {
    /// Total number of failed runs.
    pub(crate) fn failed(&self) -> u64 {
        self.failures.iter().sum()
    }

    /// Number of clusters with a failed run.
    pub(crate) fn failing(&self) -> u64 {
        self.failures.iter().filter(|k| **k > 0).count() as u64
    }

    /// Failed runs over runs; 0 without runs.
    pub fn rate(&self) -> f64 {
        let runs: u64 = self.runs.iter().sum();
        if runs > 0 { self.failed() as f64 / runs as f64 } else { 0.0 }
    }

    /// Contribution of each cluster to rate − expected rate: (k_i − R·m_i)/Σm (the linearized ratio of totals).
    fn influences(&self) -> impl Iterator<Item = f64> + '_ {
        let total = self.runs.iter().sum::<u64>().max(1) as f64;
        let rate = self.rate();
        self.failures.iter().zip(self.runs).map(move |(&k, &m)| (k as f64 - rate * m as f64) / total)
    }
}

/// A rate with its interval over clusters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClusterRate {
    /// Failed runs over runs.
    pub rate: f64,
    /// Its variance over repeated sampling of clusters.
    pub variance: f64,
    /// Its interval.
    pub interval: Interval,
    /// Effective number of failing clusters, (Σk)²/Σk²; 0 without failures.
    pub effective_failing: f64,
}

/// (Σx)²/Σx² (Kish): the equivalent number of equal values; 0 if all are 0.
fn effective_number(values: impl Iterator<Item = u64>) -> f64 {
    let (sum, squares) = values.fold((0.0, 0.0), |(sum, squares), x| (sum + x as f64, squares + x as f64 * x as f64));
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

/// The rate with the variance between clusters, N/(N − 1)·Σ((k_i − R·m_i)/Σm)². This ultimate-cluster estimator
/// includes the variance within clusters (Cochran, "Sampling Techniques", 11.9).
///
/// The interval is Wilson's with the effective number of runs R(1 − R)/variance·(z/t)² (Korn and Graubard, Survey
/// Methodology 24, 1998). This number lies between the effective number of clusters, (Σm)²/Σm², which fully correlated
/// runs within clusters would give, and the number of runs. The degrees of freedom of t are the smaller of the
/// effective numbers of failing and of passing clusters minus one, because few clusters determine the variance.
pub fn cluster_rate(clusters: Clusters, level: f64) -> ClusterRate {
    let n = clusters.runs.len() as f64;
    let (rate, total) = (clusters.rate(), clusters.runs.iter().sum::<u64>());
    let squares: f64 = clusters.influences().map(|z| z * z).sum();
    let variance = if n > 1.0 { n / (n - 1.0) * squares } else { rate * (1.0 - rate) };
    let effective_failing = effective_number(clusters.failures.iter().copied());
    let passed = clusters.runs.iter().zip(clusters.failures).map(|(runs, failures)| runs.saturating_sub(*failures));
    let min_effective = effective_number(clusters.runs.iter().copied()).max(1.0);
    let interval = if clusters.failed() == 0 {
        rule_of_three(min_effective as u64, level)
    } else {
        let freedom = effective_failing.min(effective_number(passed)) - 1.0;
        of_clusters(rate, variance, freedom, [min_effective, total as f64], level)
    };
    ClusterRate { rate, variance, interval, effective_failing }
}

/// Wilson's interval of a rate with the effective number of runs between `ends`, as of [`cluster_rate`].
pub(super) fn of_clusters(rate: f64, variance: f64, freedom: f64, ends: [f64; 2], level: f64) -> Interval {
    let [least, most] = ends;
    let factor = student_factor(freedom, level);
    let effective = rate * (1.0 - rate) / variance * factor * factor;
    // With variance 0, only the number of clusters bounds the rate.
    let effective = if variance > 0.0 { effective.clamp(least, most.max(least)) } else { least };
    Interval { kind: IntervalKind::Clusters, ..wilson(rate * effective, effective, level) }
}

/// Verdict on the numerator of a ratio.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RatioVerdict {
    /// The interval of the ratio lies within 0.8 to 1.25.
    Agrees,
    /// The interval is above 1 and extends beyond the margin.
    TooHigh,
    /// The interval is below 1 and extends beyond the margin.
    TooLow,
    /// The interval contains 1 and extends beyond the margin, or too few clusters fail.
    Undecided,
}

impl RatioVerdict {
    /// One-character symbol.
    pub fn mark(self) -> char {
        match self {
            RatioVerdict::Agrees => '=',
            RatioVerdict::TooHigh => '>',
            RatioVerdict::TooLow => '<',
            RatioVerdict::Undecided => '?',
        }
    }
}

/// Method of a ratio's interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RatioMethod {
    /// Student's t on the logarithm, differences cluster by cluster.
    Paired,
    /// The interval of one rate divided by that of the other: too few failing clusters for the logarithm.
    Separate,
}

/// Failing clusters on each side that the paired interval requires.
const MIN_FAILING: u64 = 10;

/// Ratio up to which rates count as equal. 0.8 … 1.25 are the limits of bioequivalence of two drugs (European Medicines
/// Agency, CPMP/EWP/QWP/1401/98).
const MARGIN: f64 = 1.25;

/// A ratio of rates. Values that are not finite are `None`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    /// Numerator over denominator.
    pub ratio: Option<f64>,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Method of the interval.
    pub method: RatioMethod,
    /// Its verdict.
    pub verdict: RatioVerdict,
}

impl Ratio {
    /// Whether the rates are equal within the margin.
    pub fn agrees(&self) -> bool {
        self.verdict == RatioVerdict::Agrees
    }

    /// A paired interval may lie within the margin; only it can show agreement.
    fn new(ratio: f64, [low, high]: [f64; 2], method: RatioMethod) -> Ratio {
        let finite = |v: f64| v.is_finite().then_some(v);
        let verdict = match method {
            RatioMethod::Paired if low >= 1.0 / MARGIN && high <= MARGIN => RatioVerdict::Agrees,
            _ if low > 1.0 => RatioVerdict::TooHigh,
            _ if high < 1.0 => RatioVerdict::TooLow,
            _ => RatioVerdict::Undecided,
        };
        Ratio { ratio: finite(ratio), low: finite(low), high: finite(high), method, verdict }
    }
}

/// The ratio of two rates over the same clusters, in the same order.
///
/// With enough failing clusters on both sides the interval is R·exp(∓t·σ) with σ² = N/(N − 1)·Σ(z_i/P − y_i/S)². z and
/// y are the clusters' influences on numerator and denominator. This is the delta method on the logarithm, which
/// includes the covariance of the two rates. σ² also includes the variation within clusters (draws of a Monte Carlo
/// sample). The degrees of freedom of t are the smaller number of failing clusters minus one. A numerator that equals
/// the denominator cluster by cluster has the interval [1, 1]. Rates agree if the interval lies within the margin; a
/// wider interval that contains 1 is undecided.
///
/// With too few failing clusters the interval is [P_low/S_high, P_high/S_low] of [`cluster_rate`]. If it excludes 1, it
/// still decides; otherwise the verdict is undecided, not agreement.
pub fn paired_ratio(numerator: Clusters, denominator: Clusters, level: f64) -> Ratio {
    let (p, s) = (numerator.rate(), denominator.rate());
    let failing = numerator.failing().min(denominator.failing());
    if failing < MIN_FAILING {
        let (above, below) = (cluster_rate(numerator, level).interval, cluster_rate(denominator, level).interval);
        return Ratio::new(p / s, [above.low / below.high, above.high / below.low], RatioMethod::Separate);
    }
    let n = numerator.runs.len() as f64;
    let pairs = numerator.influences().zip(denominator.influences());
    let squares: f64 = pairs.map(|(z, y)| (z / p - y / s) * (z / p - y / s)).sum();
    let sigma = (n / (n - 1.0) * squares).sqrt();
    let factor = libm::exp(student_quantile(0.5 + 0.5 * level, failing as f64 - 1.0) * sigma);
    Ratio::new(p / s, [p / s / factor, p / s * factor], RatioMethod::Paired)
}

#[cfg(test)]
mod tests {
    use super::super::{StopReason, from_clusters};
    use super::*;
    use lanesweep_random::Stream;

    #[test]
    fn clusters_of_equal_size_have_the_interval_of_equal_clusters() {
        let failures: Vec<u64> = (0..200).map(|k| [0, 0, 3, 10, 1][k % 5]).collect();
        let runs = vec![10; 200];
        let ours = cluster_rate(Clusters { runs: &runs, failures: &failures }, 0.95);
        let squares = failures.iter().map(|k| k * k).sum();
        let theirs = from_clusters(200, 10, failures.iter().sum(), squares, 0.95, StopReason::Samples);
        assert_eq!(ours.rate, theirs.probability);
        assert!((ours.variance / theirs.variance - 1.0).abs() < 1e-12);
        // Student's t for the few clusters that the variance is known from.
        assert!(ours.interval.low < theirs.interval.low && theirs.interval.high < ours.interval.high);
        assert!((50.0..110.0).contains(&ours.effective_failing), "{}", ours.effective_failing);
    }

    #[test]
    fn few_clusters_never_make_a_narrow_interval() {
        let of =
            |failures: &[u64]| cluster_rate(Clusters { runs: &vec![1000; failures.len()], failures }, 0.95).interval;
        // All of one failing cluster's failures, or all runs of all: the number of clusters bounds the rate.
        let one = of(&[0, 0, 0, 0, 0, 0, 0, 0, 30]);
        assert!(one.low < 1e-4 && one.high > 0.04, "{one:?}");
        let all = of(&[1000; 9]);
        assert!(all.high == 1.0 && (0.6..0.8).contains(&all.low), "{all:?}");
        assert!((of(&[0; 9]).high - 0.283).abs() < 1e-3);
        let holds = |failures: &[u64]| {
            let rate = failures.iter().sum::<u64>() as f64 / (1000.0 * failures.len() as f64);
            of(failures).holds(rate)
        };
        assert!(holds(&[999, 1000]) && holds(&[1, 0, 0]) && holds(&[1000, 0]) && holds(&[1000]));
    }

    #[test]
    fn an_interval_that_holds_one_and_is_wide_decides_nothing() {
        let runs = vec![10; 40];
        let denominator: Vec<u64> = (0..40).map(|k| [0, 6, 0, 0][k % 4]).collect();
        let numerator: Vec<u64> = (0..40).map(|k| [0, 3, 0, 4][k % 4]).collect();
        let side = |failures| Clusters { runs: &runs, failures };
        let ratio = paired_ratio(side(&numerator), side(&denominator), 0.95);
        assert!(ratio.low < Some(1.0) && ratio.high > Some(1.25), "{ratio:?}");
        assert_eq!(ratio.verdict, RatioVerdict::Undecided);
    }

    #[test]
    fn equals_agree_and_a_share_of_them_is_too_low() {
        let runs = vec![10; 100];
        let failures: Vec<u64> = (0..100).map(|k| [0, 0, 4, 10][k % 4]).collect();
        let half: Vec<u64> = failures.iter().map(|k| k / 2).collect();
        let all = Clusters { runs: &runs, failures: &failures };
        let same = paired_ratio(all, all, 0.95);
        assert_eq!((same.low, same.high, same.verdict), (Some(1.0), Some(1.0), RatioVerdict::Agrees));
        let low = paired_ratio(Clusters { runs: &runs, failures: &half }, all, 0.95);
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
            let ratio = |a, b| paired_ratio(a, b, 0.95);
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
                    f64::from(stream.words(cluster, block)[0]) / 2_f64.powi(32)
                };
                let q = uniform() * uniform();
                let size = 20 + (uniform() * 20.0) as u64;
                recorded.push((0..m).filter(|_| uniform() < q).count() as u64);
                sampled.push((0..size).filter(|_| uniform() < 0.8 * q).count() as u64);
                draws.push(size);
            }
            let runs = vec![m; n as usize];
            let over = Clusters { runs: &draws, failures: &sampled };
            let ratio = paired_ratio(over, Clusters { runs: &runs, failures: &recorded }, 0.95);
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
