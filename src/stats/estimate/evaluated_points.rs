//! Evaluated points of a search, drawn from many sources. Every point has the weight f/Σ n_s g_s over all sources, from
//! whichever it came (the deterministic mixture weight; Owen and Zhou, "Safe and effective importance sampling", Journal
//! of the American Statistical Association 95, 2000), so no evaluation is lost when the proposals move.

use rayon::prelude::*;

use super::limit_state::{AT_ONCE, BATCH, Density, LimitState, evaluate_checked};
use crate::density::Mixture;
use lanesweep_random::Stream;
use lanesweep_support::Result;

/// A proposal that points were drawn from.
pub(super) struct Source {
    pub mixture: Mixture,
    /// Number of attempts, invalid ones included.
    pub draws: f64,
}

/// The points with their values and densities.
pub(super) struct Pool<'a> {
    nominal: &'a dyn Density,
    limit_state: &'a dyn LimitState,
    pub points: Vec<Vec<f64>>,
    /// Point × question × guide, the guide innermost.
    values: Vec<f64>,
    /// ln f.
    pub log_f: Vec<f64>,
    /// ln Σ n_s g_s, without the crude draws.
    log_sources: Vec<f64>,
    /// Whether a point is a crude draw. Of these only failures are kept.
    is_crude: Vec<bool>,
    pub sources: Vec<Source>,
    /// Draws of the density whose points are all kept.
    nominal_draws: f64,
    /// Attempts at draws of the density of which only failures are kept.
    crude_draws: f64,
    /// Number of evaluated points.
    pub evaluated: u64,
}

/// ln of a density at points.
fn at_points(of: &dyn Density, points: &[&[f64]]) -> Vec<f64> {
    points.par_chunks(AT_ONCE).flat_map_iter(|points| of.log_densities(points)).collect()
}

/// Adds draws of a source to the sums of points, given ln of its density there.
fn add_logs(sums: &mut [f64], draws: f64, logs: &[f64]) {
    let more = libm::log(draws);
    sums.iter_mut().zip(logs).for_each(|(sum, log)| *sum = log_add(*sum, more + log));
}

/// ln(eᵃ + eᵇ).
fn log_add(a: f64, b: f64) -> f64 {
    let top = a.max(b);
    if top == f64::NEG_INFINITY { top } else { top + libm::log(libm::exp(a - top) + libm::exp(b - top)) }
}

/// (Σw)²/Σw²; 0 without weights.
pub(super) fn effective_size(weights: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut squares) = (0.0, 0.0);
    for weight in weights {
        sum += weight;
        squares += weight * weight;
    }
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

impl<'a> Pool<'a> {
    pub(crate) fn new(nominal: &'a dyn Density, limit_state: &'a dyn LimitState) -> Self {
        Pool {
            nominal,
            limit_state,
            points: Vec::new(),
            values: Vec::new(),
            log_f: Vec::new(),
            log_sources: Vec::new(),
            is_crude: Vec::new(),
            sources: Vec::new(),
            nominal_draws: 0.0,
            crude_draws: 0.0,
            evaluated: 0,
        }
    }

    /// Number of attempts at draws of the density, which no guide has influenced.
    pub(crate) fn density_draws(&self) -> f64 {
        self.nominal_draws + self.crude_draws
    }

    /// The value of a guide; the sign of guide 0 decides failure.
    pub(crate) fn value(&self, point: usize, question: usize, guide: usize) -> f64 {
        let (questions, guides) = (self.limit_state.questions(), self.limit_state.guides());
        self.values[(point * questions + question) * guides + guide]
    }

    pub(crate) fn fails(&self, point: usize, question: usize) -> bool {
        self.value(point, question, 0) <= 0.0
    }

    /// The failures of a question.
    pub(crate) fn failures(&self, question: usize) -> Vec<usize> {
        (0..self.points.len()).filter(|point| self.fails(*point, question)).collect()
    }

    /// The points whose values are all kept, also those that do not fail.
    pub(crate) fn guided(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.points.len()).filter(|point| !self.is_crude[*point])
    }

    /// The weight of a failure.
    pub(crate) fn weight(&self, point: usize) -> f64 {
        let crude = libm::log(self.crude_draws) + self.log_f[point];
        libm::exp(self.log_f[point] - log_add(self.log_sources[point], crude))
    }

    /// The weight of a point among [`Pool::guided`].
    pub(crate) fn guided_weight(&self, point: usize) -> f64 {
        libm::exp(self.log_f[point] - self.log_sources[point])
    }

    /// Draws from the density and keeps every point.
    pub(crate) fn add_nominal(&mut self, stream: Stream, draws: u64) -> Result<()> {
        add_logs(&mut self.log_sources, draws as f64, &self.log_f);
        self.nominal_draws += draws as f64;
        let points = self.attempts(self.nominal, stream, 0..draws);
        self.add(points, false)
    }

    /// Draws from the density and keeps only failures.
    pub(crate) fn add_crude(&mut self, stream: Stream, indices: std::ops::Range<u64>) -> Result<()> {
        let draws = indices.end - indices.start;
        // Valid draws, each as good as several attempts.
        self.crude_draws += draws as f64 / self.nominal.validity_fraction();
        self.evaluated += draws;
        let failures = self.limit_state.failures(self.nominal, stream, indices)?;
        let points: Vec<Vec<f64>> = failures.into_iter().map(|failure| failure.point).collect();
        self.add(points, true)
    }

    /// The failures among these draws.
    pub(crate) fn crude_failures(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.points.len()).filter(|point| self.is_crude[*point])
    }

    /// Draws from a mixture; returns the indices of the new points.
    pub(crate) fn add_source(
        &mut self,
        mixture: Mixture,
        stream: Stream,
        draws: u64,
    ) -> Result<std::ops::Range<usize>> {
        let from = self.points.len();
        let points = self.attempts(&mixture, stream, 0..draws);
        self.register(mixture, draws as f64);
        self.add(points, false)?;
        Ok(from..self.points.len())
    }

    /// Adds a source to the weights of all points.
    fn register(&mut self, mixture: Mixture, draws: f64) {
        let logs = at_points(&mixture, &self.points.iter().map(Vec::as_slice).collect::<Vec<_>>());
        add_logs(&mut self.log_sources, draws, &logs);
        self.sources.push(Source { mixture, draws });
    }

    /// One attempt per index; the valid points. An invalid attempt is a draw of weight 0.
    fn attempts(&self, of: &dyn Density, stream: Stream, indices: std::ops::Range<u64>) -> Vec<Vec<f64>> {
        let attempt = |index| Some(of.attempt(&stream, index, 0)).filter(|point| self.nominal.is_valid(point));
        indices.into_par_iter().map(attempt).collect::<Vec<_>>().into_iter().flatten().collect()
    }

    fn add(&mut self, points: Vec<Vec<f64>>, is_crude: bool) -> Result<()> {
        self.evaluated += if is_crude { 0 } else { points.len() as u64 };
        for batch in points.chunks(BATCH as usize) {
            let values = evaluate_checked(self.limit_state, batch)?;
            let points: Vec<&[f64]> = batch.iter().map(Vec::as_slice).collect();
            let log_f = at_points(self.nominal, &points);
            let mut log_sources = vec![f64::NEG_INFINITY; points.len()];
            add_logs(&mut log_sources, self.nominal_draws, &log_f);
            for source in &self.sources {
                add_logs(&mut log_sources, source.draws, &at_points(&source.mixture, &points));
            }
            self.points.extend_from_slice(batch);
            self.values.extend(values);
            self.log_f.extend(log_f);
            self.log_sources.extend(log_sources);
            self.is_crude.resize(self.points.len(), is_crude);
        }
        Ok(())
    }

    /// ln g/f of points.
    pub(crate) fn log_ratios(&self, proposal: &Mixture, points: impl Iterator<Item = usize> + Clone) -> Vec<f64> {
        let places: Vec<&[f64]> = points.clone().map(|point| self.points[point].as_slice()).collect();
        at_points(proposal, &places).into_iter().zip(points).map(|(log, point)| log - self.log_f[point]).collect()
    }
}
