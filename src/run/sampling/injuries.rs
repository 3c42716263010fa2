//! Expected injuries of crude Monte Carlo: the risk of each contact by a published curve, summed as whole numbers, so that no
//! order of threads, chunks or shards changes a bit.

use serde::{Deserialize, Serialize};

use super::estimate_rows::{EstimateRow, Risk, RiskRate, headway_name};
use super::kernel_counts::add_counts;
use super::sample_options::{SampleHeadways, SampleOptions};
use super::tally::SampleTally;
use crate::engine::{LanePlan, Outcome};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::severity::InjuryCurve;
use crate::scenario::parameterization::Sizes;
use crate::stats::density::Exposure;
use crate::stats::estimate::gamma;

/// A risk of 1 in the sums.
const ONE: f64 = (1_u64 << BITS) as f64;
const BITS: u32 = 26;

/// Curves of injury risk of a run, and the sizes of its vehicles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InjuryOptions {
    /// Names of the curves.
    pub curves: Vec<String>,
    /// Sizes, by which masses follow.
    pub sizes: Sizes,
}

/// Sums over samples: risk, square of the risk, contacts that the curve does not cover, square of the risk with these as 1. Of all
/// headways together the risk of a sample is the sum over them.
pub(super) type InjurySums = [u64; 4];

/// Expected injuries of one model from one headway, or from all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InjuryRow {
    /// Name of the curve.
    pub curve: &'static str,
    /// The injury.
    pub injury: &'static str,
    /// Driver model.
    pub model: ModelId,
    /// Headway, or `all`.
    pub headway: String,
    /// Lanes with a contact.
    pub contacts: u64,
    /// Those that the curve does not cover: side contacts, trucks, speeds beyond its data.
    pub uncovered: u64,
    /// Mean risk of a contact; uncovered ones count as 0.
    pub risk: f64,
    /// Interval of the mean risk: uncovered contacts count as 0 in the lower end, as 1 in the upper one. It covers the draws alone.
    pub interval: [f64; 2],
    /// Injuries per hour; the ends are those of the contacts times those of the risk. `None` if the exposure is not known.
    pub per_hour: Option<RiskRate>,
    /// The row of collisions, with the expected number of injuries as the probability.
    #[serde(skip)]
    pub(super) row: EstimateRow,
}

impl SampleOptions {
    /// Number of [`InjurySums`] of these options.
    pub(super) fn injury_sums(&self, plan: &LanePlan) -> usize {
        let curves = self.injury.as_ref().map_or(0, |injury| injury.curves.len());
        curves * (plan.headways.len() + 1) * plan.models.len()
    }
}

impl InjuryOptions {
    /// Adds one sample: an outcome per lane, headway × model.
    pub(super) fn count(&self, sums: &mut [InjurySums], outcomes: &[Outcome<f64>], models: usize) {
        let headways = outcomes.len() / models;
        let curves = self.curves.iter().filter_map(|name| InjuryCurve::find(name).ok());
        for (curve, sums) in curves.zip(sums.chunks_mut((headways + 1) * models)) {
            for model in 0..models {
                let mut all = [0; 2];
                for at in (model..outcomes.len()).step_by(models) {
                    let outcome = &outcomes[at];
                    if outcome.verdicts.failed(Criterion::Collision) {
                        let risk = curve.ego_risk(outcome.delta_v_mps(&self.sizes), self.sizes.ego.length_m);
                        let of_lane = [risk.map_or(0, |risk| (risk * ONE).round() as u64), u64::from(risk.is_none())];
                        add(&mut sums[at], of_lane);
                        all = [all[0] + of_lane[0], all[1] + of_lane[1]];
                    }
                }
                add(&mut sums[headways * models + model], all);
            }
        }
    }
}

/// Adds the risk of a sample and its uncovered contacts.
fn add(sums: &mut InjurySums, [risk, uncovered]: [u64; 2]) {
    let square = |value: u64| (u128::from(value).pow(2) >> BITS) as u64;
    add_counts(sums, &[risk, square(risk), uncovered, square(risk + (uncovered << BITS))]);
}

/// The rows of a tally, beside the `estimates` of collisions.
pub(super) fn injury_rows(
    plan: &LanePlan,
    tally: &SampleTally,
    options: &SampleOptions,
    (estimates, exposure): (&[EstimateRow], Option<&Exposure>),
) -> Vec<InjuryRow> {
    let (headways, models) = (plan.headways.len(), plan.models.len());
    let is_sampled = options.headways == SampleHeadways::Sampled;
    let curves =
        options.injury.iter().flat_map(|injury| &injury.curves).filter_map(|name| InjuryCurve::find(name).ok());
    let of_curve = |(curve, sums): (&'static InjuryCurve, &[InjurySums])| {
        let row = |row: &EstimateRow| {
            let headway = (0..headways).find(|at| headway_name(plan, *at, is_sampled) == row.headway);
            let model = plan.models.iter().position(|model| *model == row.model)?;
            let [risk, squares, uncovered, high_squares] = sums[headway.unwrap_or(headways) * models + model];
            let contacts = row.estimate.failures as f64;
            let part = |sum: u64| if contacts > 0.0 { sum as f64 / ONE / contacts } else { 0.0 };
            // One sample has a contact from each headway at most.
            let largest = headway.map_or(headways, |_| 1) as f64 / contacts.max(1.0);
            let ends = |mean: f64, squares: u64| gamma(mean, part(squares) / contacts.max(1.0), largest, options.level);
            let mean = part(risk);
            let high_mean = mean + part(uncovered << BITS);
            let interval = [ends(mean, squares).low, ends(high_mean, high_squares).high];
            let mut of = row.clone();
            of.estimate.probability *= mean;
            of.estimate.variance *= mean * mean;
            of.estimate.interval.low *= interval[0];
            of.estimate.interval.high *= interval[1];
            of.risk = Risk::of(&of.estimate, exposure);
            Some(InjuryRow {
                curve: curve.name,
                injury: curve.injury,
                model: row.model,
                headway: row.headway.clone(),
                contacts: row.estimate.failures,
                uncovered,
                risk: mean,
                interval,
                per_hour: of.risk.per_hour,
                row: of,
            })
        };
        estimates.iter().filter(|row| row.criterion == Criterion::Collision).filter_map(row).collect::<Vec<_>>()
    };
    curves.zip(tally.injuries.chunks((headways + 1) * models)).flat_map(of_curve).collect()
}
