//! Which questions crude Monte Carlo answers at less cost, and which importance sampling.
//!
//! Costs are numbers of crude lanes, not seconds, so that the choice is the same on every machine and device.

use std::time::Instant;

use super::result::SampleResult;
use super::sample_options::{Estimator, SampleOptions};
use super::{EstimateRow, Question, Sample};
use lanesweep_engine::Executor;
use lanesweep_model::driver::ModelId;
use lanesweep_stats::density::normal_quantile;
use lanesweep_stats::estimate::{Goal, Search, StopRule};
use lanesweep_support::Result;

/// Samples of the pilot.
const PILOT: u64 = 10_000;
/// Failures of the pilot below which it does not tell how many samples crude Monte Carlo needs.
const MIN_FAILURES: u64 = 3;
/// Points of a search for one question, and for each further one.
const SEARCH_POINTS: [f64; 2] = [20_000.0, 5000.0];
/// A lane of a search or weighted sample costs as much as this many crude lanes, because its values are computed.
const VALUED: f64 = 4.0;
/// Fits and densities of a searched point, in crude lanes.
const POINT: f64 = 200.0;
/// Densities of a weighted draw, in crude lanes.
const DRAW: f64 = 50.0;
/// Relative variance of a weighted draw for one question.
const VARIANCE: f64 = 3.0;
/// Factor on the number of crude samples, because the pilot knows the probability only roughly.
const RESERVE: f64 = 1.1;
/// Maximum number of final draws of importance sampling.
const MAX_DRAWS: u64 = 10_000_000;

/// A division of the questions.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Number of samples of crude Monte Carlo.
    pub samples: u64,
    /// Number of questions that these are expected to answer.
    pub by_crude: usize,
    /// Number of questions left to importance sampling.
    pub by_importance: usize,
    /// Samples with which crude Monte Carlo would answer all; `None` if one did not fail in the pilot.
    pub samples_for_all: Option<f64>,
    /// Measured seconds of a crude sample on this machine; they do not enter the choice.
    pub seconds_per_sample: f64,
}

impl Sample {
    /// Divides the questions after a pilot of crude Monte Carlo.
    ///
    /// # Errors
    /// Those of the lanes.
    pub fn choice(&self, half_width: f64, executor: &Executor) -> Result<Choice> {
        let pilot = SampleOptions { stop: StopRule::samples(PILOT), ..self.options.clone() };
        let pilot = Sample::plan(self.density.clone(), &self.profile, &pilot)?;
        let started = Instant::now();
        let rows = pilot.run(executor)?.rows;
        let seconds_per_sample = started.elapsed().as_secs_f64() / PILOT as f64;
        let z = normal_quantile(0.5 + 0.5 * self.options.level);
        let needed = |question: &Question| {
            let row = rows.iter().find(|row| self.is_row_of(row, question));
            match row.map(|row| (row.estimate.failures, row.estimate.probability)) {
                Some((failures, p)) if failures >= MIN_FAILURES => RESERVE * (z / half_width).powi(2) * (1.0 - p) / p,
                _ => f64::INFINITY,
            }
        };
        let mut needs: Vec<f64> = self.options.asked().iter().map(needed).collect();
        needs.sort_by(f64::total_cmp);
        let is_costly = self.options.models.iter().any(|model| matches!(model, ModelId::Foreign(_)));
        let (point, draw, valued) = if is_costly { (0.0, 0.0, 1.0) } else { (POINT, DRAW, VALUED) };
        let lanes = (self.options.models.len() * self.options.headways().len().max(1)) as f64;
        let all = needs.len();
        let cost = |by_crude: usize| {
            let samples = if by_crude == 0 { 0.0 } else { needs[by_crude - 1] };
            let left = (all - by_crude) as f64;
            if left == 0.0 {
                return samples * lanes;
            }
            // Of the rarest question; where the pilot does not know it, no division costs less.
            let rarest = Some(needs[all - 1] / (RESERVE * (z / half_width).powi(2))).filter(|odds| odds.is_finite());
            let crude =
                rarest.unwrap_or(0.0) * (Search::CRUDE_FAILURES + Goal::crude_failures(half_width)) * left.min(lanes);
            let of_point = valued * left.min(lanes);
            let points = SEARCH_POINTS[0] + SEARCH_POINTS[1] * (left - 1.0);
            let draws = VARIANCE * left.sqrt() * (z / half_width).powi(2);
            samples * lanes + points * (point + of_point) + draws * (draw + of_point) + crude
        };
        let by_crude = (0..=all).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(0);
        let samples = if by_crude == 0 { 0.0 } else { needs[by_crude - 1] };
        Ok(Choice {
            samples: (samples.ceil() as u64).max(PILOT),
            by_crude,
            by_importance: all - by_crude,
            samples_for_all: needs.last().copied().filter(|most| most.is_finite()),
            seconds_per_sample,
        })
    }

    /// Answers the questions of which a run of crude Monte Carlo did not reach the half-width, by importance sampling.
    ///
    /// # Errors
    /// Those of the lanes.
    pub fn refined(
        &self,
        mut result: SampleResult,
        search: &Search,
        half_width: f64,
        executor: &Executor,
    ) -> Result<SampleResult> {
        let is_open = |question: &Question| {
            let row = result.rows.iter().find(|row| self.is_row_of(row, question));
            row.is_none_or(|row| row.estimate.failures < StopRule::MIN_FAILURES || row.draws_half_width() > half_width)
        };
        let questions: Vec<Question> = self.options.asked().into_iter().filter(is_open).collect();
        if questions.is_empty() {
            return Ok(result);
        }
        let options = SampleOptions {
            estimator: Estimator::Search(*search),
            stop: StopRule { relative_half_width: Some(half_width), ..StopRule::samples(MAX_DRAWS) },
            questions: questions.clone(),
            ..self.options.clone()
        };
        let rare = Sample::plan(self.density.clone(), &self.profile, &options)?.run(executor)?;
        for (question, row) in questions.iter().zip(rare.rows) {
            if let Some(old) = result.rows.iter_mut().find(|old| self.is_row_of(old, question)) {
                *old = row;
            }
        }
        Ok(SampleResult { search: rare.search, proposal: rare.proposal, ..result })
    }

    fn is_row_of(&self, row: &EstimateRow, question: &Question) -> bool {
        row.model == question.model
            && row.criterion == question.criterion
            && row.headway == self.options.headway_name(question.headway)
    }
}
