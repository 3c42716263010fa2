//! The tables of a sampling run as CSV: numbers in full precision, empty where a value is undefined; and how they are
//! to be read, in words that the terminal and the page share.

use super::sampling::EstimateFile;
use crate::Result;
use crate::engine::{NO_STEP, Outcome};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::sampling::{Checkpoint, EstimateRow, RiskRate, WorstSample};
use crate::stats::estimate::{IntervalKind, Ratio};

impl EstimateFile {
    /// `estimates.csv`.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn csv(&self) -> Result<Vec<u8>> {
        let header = [
            "category",
            "parameterization",
            "estimator",
            "model",
            "criterion",
            "headway",
            "runs",
            "failures",
            "probability",
            "low",
            "high",
            "level",
            "interval",
            "draws_low",
            "draws_high",
            "failing_scenarios",
            "relative_half_width",
            "coefficient_of_variation",
            "variance_reduction",
            "ess",
            "ess_failures",
            "largest_weight_share",
            "mean_weight",
            "risk_per_hour",
            "risk_per_hour_sd",
            "risk_per_hour_low",
            "risk_per_hour_high",
            "risk_per_1000_km",
            "risk_per_1000_km_sd",
            "risk_per_1000_km_low",
            "risk_per_1000_km_high",
            "replayed_ratio",
            "replayed_ratio_low",
            "replayed_ratio_high",
            "sampled_ratio",
            "sampled_ratio_low",
            "sampled_ratio_high",
            "verdict",
            "data",
        ];
        let mut rows = vec![header.map(str::to_owned).to_vec()];
        for row in &self.estimates {
            let e = &row.estimate;
            let weight = |f: fn(&crate::stats::estimate::WeightFigures) -> f64| e.weights.as_ref().map(f);
            let rate = |r: Option<RiskRate>| {
                [r.map(|r| r.estimate), r.map(|r| r.standard_deviation), r.map(|r| r.low), r.map(|r| r.high)]
            };
            let mut fields = vec![
                self.density.category.to_owned(),
                self.density.parameterization.clone(),
                self.estimator.to_owned(),
                row.model.name().to_owned(),
                row.criterion.key().to_owned(),
                row.headway.clone(),
                e.runs.to_string(),
                e.failures.to_string(),
            ];
            let numbers = [Some(e.probability), Some(e.interval.low), Some(e.interval.high), Some(e.interval.level)];
            fields.extend(numbers.map(number));
            fields.push(kind_name(e.interval.kind).to_owned());
            fields.extend([Some(row.draws[0]), Some(row.draws[1]), row.failing_scenarios].map(number));
            let numbers = [
                Some(e.relative_half_width),
                Some(e.coefficient_of_variation),
                Some(e.variance_reduction),
                weight(|w| w.effective_size),
                weight(|w| w.effective_size_failures),
                weight(|w| w.largest_share_failures),
                weight(|w| w.mean_weight),
            ];
            fields.extend(numbers.map(number));
            fields.extend(rate(row.risk.per_hour).map(number));
            fields.extend(rate(row.risk.per_1000_km).map(number));
            let of = |r: Option<Ratio>| r.map_or([None; 3], |r| [r.ratio, r.low, r.high]);
            fields.extend(of(row.recorded.map(|recorded| recorded.replayed)).map(number));
            fields.extend(of(row.recorded.and_then(|recorded| recorded.sampled)).map(number));
            fields.push(e.trust.verdict().to_string());
            fields.push(self.density.provenance.data.clone());
            rows.push(fields);
        }
        super::csv::text(rows)
    }
}

const CONVERGENCE: [&str; 9] = [
    "samples",
    "model",
    "criterion",
    "probability",
    "low",
    "high",
    "low_with_data",
    "high_with_data",
    "failing_scenarios",
];

/// `convergence.csv`.
///
/// # Errors
/// None for what this program made.
pub fn convergence_csv(checkpoints: &[Checkpoint]) -> Result<Vec<u8>> {
    let mut rows = vec![CONVERGENCE.map(str::to_owned).to_vec()];
    for checkpoint in checkpoints {
        for row in &checkpoint.rows {
            let [low, high] = [0, 1].map(|end: usize| row.with_data.map(|(ends, _)| ends[end]));
            let mut fields = vec![checkpoint.samples.to_string(), row.model.name().to_owned()];
            fields.push(row.criterion.key().to_owned());
            fields.extend([row.probability, row.interval[0], row.interval[1]].map(|v| v.to_string()));
            fields.extend([low, high, row.with_data.map(|(_, scenarios)| scenarios)].map(number));
            rows.push(fields);
        }
    }
    super::csv::text(rows)
}

/// One of the worst lanes, with what it was.
pub struct WorstRow {
    /// Place among the model's worst, from 1.
    pub rank: usize,
    /// The lane and its limit state.
    pub lane: WorstSample,
    /// Its key.
    pub key: String,
    /// Its sample index.
    pub sample: u64,
    /// Driver model.
    pub model: ModelId,
    /// Headway, s, where it is one of the plan's or a parameter.
    pub headway: String,
    /// Its point.
    pub point: Vec<f64>,
    /// Its outcome.
    pub outcome: Outcome<f64>,
}

/// `worst.csv`: the lanes with the smallest limit state of `criterion`, rerunnable by key.
///
/// # Errors
/// None for what this program made.
pub fn worst_csv(rows: &[WorstRow], parameters: &[String], criterion: Criterion) -> Result<Vec<u8>> {
    let mut header: Vec<String> =
        ["model", "rank", "lane", "sample", "headway", "criterion", "limit_state"].map(str::to_owned).to_vec();
    header.extend(
        [
            "collision",
            "ttc",
            "btn",
            "min_ttc_s",
            "max_btn",
            "min_gap_m",
            "impact_speed_mps",
            "impact_closing_speed_mps",
        ]
        .map(str::to_owned),
    );
    header.extend(parameters.iter().cloned());
    let mut table = vec![header];
    for row in rows {
        let o = &row.outcome;
        let mut fields = vec![
            row.model.name().to_owned(),
            row.rank.to_string(),
            row.key.clone(),
            row.sample.to_string(),
            row.headway.clone(),
            criterion.key().to_owned(),
            row.lane.value.to_string(),
        ];
        fields.extend(Criterion::ALL.map(|c| u8::from(o.verdicts.failed(c)).to_string()));
        let at_contact = |v: f64| (o.contact_step != NO_STEP).then_some(v);
        fields.extend([o.min_ttc, o.max_btn, o.min_gap].map(|v| number(Some(v))));
        fields.extend([o.impact_speed, o.impact_closing_speed].map(|v| number(at_contact(v))));
        fields.extend(row.point.iter().map(f64::to_string));
        table.push(fields);
    }
    super::csv::text(table)
}

fn number(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map_or(String::new(), |v| v.to_string())
}

fn kind_name(kind: IntervalKind) -> &'static str {
    match kind {
        IntervalKind::Wilson => "wilson",
        IntervalKind::ClopperPearson => "clopper_pearson",
        IntervalKind::RuleOfThree => "rule_of_three",
        IntervalKind::LogStudent => "log_student",
        IntervalKind::Clusters => "clusters",
        IntervalKind::Nothing => "nothing",
    }
}

impl EstimateFile {
    /// The headway of a row, or of how many P is the mean.
    pub(super) fn headway_cell(&self, row: &EstimateRow) -> String {
        if row.headway == "all" { format!("all {}", self.headways.len()) } else { row.headway.clone() }
    }

    /// What P over all headways is a mean of; `None` where there is one headway.
    pub(super) fn mean_rule(&self) -> Option<String> {
        let is_mean = self.estimates.iter().any(|row| row.headway == "all");
        is_mean.then(|| {
            format!(
                "THW all {}: P is the mean over {}; every sample runs from each of them, and each counts the same; every \
                 headway of its own is in estimates.csv",
                self.headways.len(),
                self.headways.join(", ")
            )
        })
    }

    /// What a rate per hour assumes; `None` where no risk is known or the density draws the headway.
    pub(super) fn exposure_rule(&self) -> Option<String> {
        let is_known = self.estimates.iter().any(|row| row.risk.per_hour.is_some() || row.risk.per_1000_km.is_some());
        (is_known && !self.plan_headways.is_empty()).then(|| {
            "Per hour and per 1000 km: scenarios occur as often as observed, but begin at these headways, which are \
             imposed, not observed; a density fitted with the headway as a parameter draws them"
                .to_owned()
        })
    }

    /// What the ratio to recorded scenarios and the verdict say; `None` where nothing is compared.
    pub(super) fn recorded_rule(&self) -> Option<&'static str> {
        self.estimates.iter().any(|row| row.recorded.is_some()).then_some(
            "P/S: rate of the samples over that of the recorded scenarios (S), from the same headways; = agrees, > too \
             high, < too low, ? undecided (intervals: estimates.csv). Sound: no warning, and S' (the same scenarios under this parameterization) and \
             the samples both fail as often as S to within a quarter: the intervals of S'/S and P/S lie within 0.80 to 1.25. \
             P's interval does not hold that difference",
        )
    }

    /// What the intervals hold besides the draws.
    pub(super) fn interval_rule(&self) -> &'static str {
        if self.density.kernels == 0 {
            ""
        } else if self.estimates.iter().all(|row| row.failing_scenarios.is_some()) {
            " cover the draws and what other scenarios would change, at fixed bandwidth and scale"
        } else {
            " cover the draws alone, not what other scenarios would change"
        }
    }
}
