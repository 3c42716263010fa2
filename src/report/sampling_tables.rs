//! The tables of a sampling run as CSV: numbers in full precision, empty where undefined. Also the sentences that
//! explain them on the terminal and the page.

use serde::Serialize;

use super::sampling::{SampleReport, short};
use lanesweep_run::sampling::{
    BandwidthVerdict, CarrierRow, Checkpoint, EstimateRow, RiskRate, TRAFFIC_DRAWS, Uncertainty,
};
use lanesweep_stats::estimate::{Ratio, Warning, WeightFigures};
use lanesweep_support::readable::{count, counted, significant};
use lanesweep_support::table::{NamedValue, Table};

impl SampleReport<'_> {
    /// `estimates.csv`.
    pub(super) fn estimate_rows(&self) -> Table {
        let weights: [NamedValue<WeightFigures, f64>; 3] = [
            ("ess_failures", |w| w.effective_failures),
            ("largest_weight_fraction", |w| w.largest_fraction),
            ("crude_fraction", |w| w.crude_fraction),
        ];
        let risks: [NamedValue<RiskRate, f64>; 4] =
            [("", |r| r.estimate), ("_sd", |r| r.standard_deviation), ("_low", |r| r.low), ("_high", |r| r.high)];
        let ends: [NamedValue<Ratio, Option<f64>>; 3] = [("", |r| r.ratio), ("_low", |r| r.low), ("_high", |r| r.high)];
        let sources: [NamedValue<Uncertainty, Option<f64>>; 5] = [
            ("variance_from_draws", |u| Some(u.draws)),
            ("variance_from_scenarios", |u| Some(u.scenarios)),
            ("variance_from_exposure", |u| Some(u.exposure)),
            ("hours_factor", |u| u.hours_factor),
            ("samples_factor", |u| u.samples_factor),
        ];
        let rates: [NamedValue<EstimateRow, Option<RiskRate>>; 2] =
            [("risk_per_hour", |row| row.risk.per_hour), ("risk_per_1000_km", |row| row.risk.per_1000_km)];
        let ratios: [NamedValue<EstimateRow, Option<Ratio>>; 2] = [
            ("replayed_ratio", |row| row.recorded.map(|recorded| recorded.replayed)),
            ("sampled_ratio", |row| row.recorded.and_then(|recorded| recorded.sampled)),
        ];
        Table::of(self.estimates())
            .column("category", |_| self.id().category.key())
            .column("variant", |_| self.id().key)
            .column("estimator", |row| {
                if row.estimate.weights.is_some() { "is" } else { self.sample.options.estimator.key() }
            })
            .column("model", |row| row.model.name())
            .column("criterion", |row| row.criterion.key())
            .column("headway", |row| row.headway.as_str())
            .column("runs", |row| row.estimate.runs)
            .column("failures", |row| row.estimate.failures)
            .column("probability", |row| known(row.estimate.probability))
            .column("low", |row| known(row.estimate.interval.low))
            .column("high", |row| known(row.estimate.interval.high))
            .column("level", |row| known(row.estimate.interval.level))
            .column("interval", |row| word(row.estimate.interval.kind))
            .column("draws_low", |row| known(row.draws[0]))
            .column("draws_high", |row| known(row.draws[1]))
            .column("failing_scenarios", |row| row.failing_scenarios.and_then(known))
            .column("relative_half_width", |row| known(row.estimate.relative_half_width))
            .column("coefficient_of_variation", |row| known(row.estimate.coefficient_of_variation))
            .column("variance_reduction", |row| known(row.estimate.variance_reduction))
            .column("no_traffic_fraction", |row| row.no_traffic.map(|of| of.fraction))
            .column("possible_probability", |row| row.no_traffic.map(|of| of.possible_probability))
            .column("carrier", |row| row.carriers.first().map(carrier_name))
            .column("carrier_fraction", |row| row.carriers.first().map(|carrier| carrier.of.fraction))
            .columns(
                [("probability_narrow", 0), ("probability_wide", 1)],
                |(name, _)| name,
                |row, (_, end)| row.at_bandwidths[end].map(|of| of.probability).filter(|p| *p > 0.0),
            )
            .columns(weights, |(name, _)| name, |row, (_, of)| row.estimate.weights.as_ref().and_then(|w| known(of(w))))
            .columns(
                rates.into_iter().flat_map(|rate| risks.map(|of| (rate, of))),
                |(rate, of)| format!("{}{}", rate.0, of.0),
                |row, (rate, of)| rate.1(row).and_then(|rate| known(of.1(&rate))),
            )
            .columns(
                ratios.into_iter().flat_map(|ratio| ends.map(|of| (ratio, of))),
                |(ratio, of)| format!("{}{}", ratio.0, of.0),
                |row, (ratio, of)| ratio.1(row).and_then(|ratio| of.1(&ratio)).and_then(known),
            )
            .columns(
                sources,
                |(name, _)| name,
                |row, (_, of)| row.uncertainty.and_then(|uncertainty| of(&uncertainty)).and_then(known),
            )
            .column("draws", |row| row.estimate.trust.draws().to_string())
            .column("density", |row| row.estimate.trust.density())
            .column("scenarios", |row| row.estimate.trust.data())
            .column("bandwidth", |row| row.bandwidth.map(BandwidthVerdict::key))
            .column("data", |_| self.sample.density.provenance.data.as_str())
            .build()
    }
}

/// `convergence.csv`.
pub(super) fn convergence_table(checkpoints: &[Checkpoint]) -> Table {
    let rows = checkpoints.iter().flat_map(|of| of.rows.iter().map(move |row| (of.samples, row)));
    Table::of(rows)
        .column("samples", |(samples, _)| samples)
        .column("model", |(_, row)| row.model.name())
        .column("criterion", |(_, row)| row.criterion.key())
        .column("headway", |(_, row)| row.headway.as_str())
        .column("probability", |(_, row)| row.probability)
        .column("low", |(_, row)| row.interval[0])
        .column("high", |(_, row)| row.interval[1])
        .column("low_with_data", |(_, row)| row.with_data.and_then(|(ends, _)| known(ends[0])))
        .column("high_with_data", |(_, row)| row.with_data.and_then(|(ends, _)| known(ends[1])))
        .column("failing_scenarios", |(_, row)| row.with_data.and_then(|(_, scenarios)| known(scenarios)))
        .build()
}

/// The id of a scenario that carries a part of P, or its kernel.
fn carrier_name(carrier: &CarrierRow) -> String {
    carrier.scenario.clone().unwrap_or_else(|| format!("kernel {}", carrier.of.kernel))
}

/// A number; NaN is none.
fn known(value: f64) -> Option<f64> {
    Some(value).filter(|v| !v.is_nan())
}

/// The word of a choice, as records have it.
pub(super) fn word(choice: impl Serialize) -> Option<String> {
    serde_json::to_value(choice).ok()?.as_str().map(str::to_owned)
}

impl SampleReport<'_> {
    /// What is said about the shown rows, each time with what it is said about. Too few scenarios are said once.
    pub(super) fn remarks(&self) -> Vec<(String, String)> {
        let name = |row: &EstimateRow| format!("{} {} {}", row.model.name(), row.criterion.label(), row.headway);
        let (mut remarks, mut few, mut most) = (Vec::new(), Vec::new(), None);
        for row in self.estimates().iter().filter(|row| row.is_told(self.estimates())) {
            for warning in &row.estimate.trust.warnings {
                match warning {
                    Warning::FewScenarios { scenarios } => {
                        few.push(*scenarios);
                        let carriers =
                            row.carriers.iter().filter(|carrier| carrier.of.fraction > 0.01).map(|carrier| {
                                format!("{} % {}", significant(100.0 * carrier.of.fraction, 2), carrier_name(carrier))
                            });
                        most.get_or_insert(format!("{}: {}", name(row), carriers.collect::<Vec<_>>().join(", ")));
                    }
                    // The rule tells it of all rows.
                    Warning::BandwidthDecides { .. } => (),
                    _ => remarks.push((name(row), warning.to_string())),
                }
            }
            if let Some(times) = row.times_crude() {
                let remark = "times the lanes that crude Monte Carlo (`mc`) needs for the same interval";
                remarks.push((name(row), format!("this estimator used {} {remark}", short(times))));
            }
        }
        let (low, high) = few.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), few| (low.min(*few), high.max(*few)));
        if !few.is_empty() {
            // Rounded down: 9.96 scenarios are fewer than 10.
            let (low, high) =
                (format!("{:.1}", (low * 10.0).floor() / 10.0), format!("{:.1}", (high * 10.0).floor() / 10.0));
            let range = if low == high { low } else { format!("{low} to {high}") };
            let about = (
                counted(few.len(), "row"),
                format!(
                    "the failures come from effectively {range} scenarios ({}); with fewer than {}, other recordings would \
                     give another probability, and nothing tells how much so",
                    most.unwrap_or_default(),
                    Warning::MIN_SCENARIOS
                ),
            );
            remarks.insert(0, about);
        }
        remarks
    }
}

impl SampleReport<'_> {
    /// How to read the estimates, one sentence after the other.
    pub(super) fn rules(&self) -> impl Iterator<Item = String> {
        self.cautions().chain(self.sources_rule()).chain(self.recorded_rule())
    }

    /// Those of them without which a number is taken for another.
    pub(super) fn cautions(&self) -> impl Iterator<Item = String> {
        let rules =
            [self.bandwidth_rule(), self.traffic_rule(), self.tail_rule(), self.exposure_rule(), self.mean_rule()];
        rules.into_iter().flatten()
    }

    /// How far the bandwidth changes P; `None` if the density does not know its interval.
    fn bandwidth_rule(&self) -> Option<String> {
        let [Some(narrow), Some(wide)] = self.estimates().first()?.at_bandwidths else { return None };
        let [narrow, wide] = [narrow, wide].map(|of| significant(of.factor, 2));
        let of = |verdict| self.estimates().iter().filter(move |row| row.bandwidth == Some(verdict));
        let change = |row: &EstimateRow| {
            let factors = row.at_bandwidths.iter().flatten().map(|of| of.probability / row.estimate.probability);
            factors.map(|factor| factor.max(1.0 / factor)).filter(|of| of.is_finite()).fold(1.0, f64::max)
        };
        let most = of(BandwidthVerdict::Decides).map(change).fold(1.0, f64::max);
        let [decided, open] = [BandwidthVerdict::Decides, BandwidthVerdict::Open].map(|verdict| of(verdict).count());
        let all = self.estimates().len();
        let decides = match decided {
            0 => "no row".to_owned(),
            _ => format!("{decided} of {all} rows, by up to {} times", significant(most, 2)),
        };
        let open = if open > 0 { format!("; {open} have too few failures there to tell") } else { String::new() };
        Some(format!(
            "The bandwidth decides {decides} (P at {narrow} and {wide} times the density's, the ends of its 95 % interval: \
             estimates.csv){open}"
        ))
    }

    /// What P over all headways averages; `None` for a single headway.
    fn mean_rule(&self) -> Option<String> {
        let is_mean = self.estimates().iter().any(|row| row.headway == "all");
        is_mean.then(|| {
            format!(
                "THW all {}: P is the mean over {}, each counting the same; estimates.csv has every one",
                self.sample.options.headways().len(),
                self.headways().join(", ")
            )
        })
    }

    /// Which draws no traffic has; `None` if there are none.
    fn traffic_rule(&self) -> Option<String> {
        let fraction = self.estimates().iter().find_map(|row| row.no_traffic)?.fraction;
        Some(format!(
            "No such traffic in {} % of {} further draws: the vehicle that cuts out drives through the one ahead of it. P counts \
             them; P possible, without interval, is that of the other draws",
            significant(100.0 * fraction, 2),
            count(TRAFFIC_DRAWS)
        ))
    }

    /// A density of N scenarios is based on no data below a probability of 1/N; `None` where no row is below.
    fn tail_rule(&self) -> Option<String> {
        let kernels = self.sample.density.kde.points().len();
        let is_below = self.estimates().iter().any(|row| row.is_overall(self.estimates()) && row.is_of_tails(kernels));
        is_below.then(|| {
            let (resolved, kernels) = (short(1.0 / kernels as f64), count(kernels));
            format!("Probabilities below {resolved} (one in {kernels} scenarios) come from the tails of the density's kernels, not from data")
        })
    }

    /// Why there is no rate per hour; `None` if the density draws the headway.
    fn exposure_rule(&self) -> Option<String> {
        (!self.sample.options.headways().is_empty()).then(|| {
            "No rate per hour or per 1000 km: the headways are imposed; a density fitted `with_thw` draws them and has one"
                .to_owned()
        })
    }

    /// Where the width of the intervals comes from, and what would halve it; `None` if no row knows.
    fn sources_rule(&self) -> Option<String> {
        let known: Vec<Uncertainty> = self.estimates().iter().filter_map(|row| row.uncertainty).collect();
        let range = |values: Vec<f64>| {
            let ends = [values.iter().copied().fold(f64::INFINITY, f64::min), values.into_iter().fold(0.0, f64::max)];
            let [low, high] = ends.map(|end| significant(end, 2));
            if low == high { low } else { format!("{low} to {high}") }
        };
        let percent = |of: fn(&Uncertainty) -> f64| range(known.iter().map(|u| 100.0 * of(u)).collect());
        let factors = |of: fn(&Uncertainty) -> Option<f64>, what: &str| match known.iter().filter_map(of).count() {
            0 => format!("more {what} alone do not halve any"),
            some => {
                let rows = if some == known.len() { "them".to_owned() } else { format!("{some} of {}", known.len()) };
                format!("{} times the {what} halve {rows}", range(known.iter().filter_map(of).collect()))
            }
        };
        (!known.is_empty()).then(|| {
            format!(
                "Variance of the intervals: {} % from the draws, {} % from the recorded scenarios, {} % from their frequency; {}, {}",
                percent(|u| u.draws),
                percent(|u| u.scenarios),
                percent(|u| u.exposure),
                factors(|u| u.hours_factor, "recorded hours"),
                factors(|u| u.samples_factor, "samples"),
            )
        })
    }

    /// What the ratio to recorded scenarios and the verdict mean; `None` without a comparison.
    fn recorded_rule(&self) -> Option<String> {
        self.estimates().iter().any(|row| row.recorded.is_some_and(|of| of.sampled.is_some())).then(|| {
            "P/S: rate of the samples over that of the recorded scenarios (S), from the same headways; = agrees, > too \
             high, < too low, ? undecided (intervals: estimates.csv). The density agrees if S' (the same scenarios under this parameterization) and the \
             samples both fail as often as S to within a quarter: the intervals of S'/S and P/S lie within 0.80 to 1.25. \
             P's interval does not hold that difference"
                .to_owned()
        })
    }

    /// What the intervals cover in addition to the draws.
    pub(super) fn interval_rule(&self) -> &'static str {
        if self.estimates().iter().all(|row| row.failing_scenarios.is_some()) {
            " of draws and scenarios, at fixed bandwidth and scale; not determined: fewer than 3 scenarios carry P"
        } else {
            " none of what other scenarios would change"
        }
    }
}
