//! The search for a proposal: where do the failures lie, for one question or several at once?
//!
//! It starts with draws of the density and of wider copies. Then every round draws from mixtures over what is known:
//! around the failures ([`shapes`](super::shapes)), and, as long as they may hide elsewhere, around the points that a
//! *guide* says are nearest to failure, level by level. All points of all rounds stay in one weighted pool. Guides
//! can mislead; they decide where points are drawn, never what an estimate is. If they lead nowhere, crude draws of the
//! density take their place. A proposal is accepted if a fresh sample of it shows no failure of large weight, and crude
//! draws of the density show none where it is thin.

use serde::{Deserialize, Serialize};

use super::evaluated_points::{Pool, effective_size};
use super::limit_state::{Density, LimitState, purpose};
use super::proposal_mixtures::{designs, fitted};
use crate::density::Mixture;
use lanesweep_random::Stream;
use lanesweep_support::{Error, Place, Result};

/// Variances of the wider copies of the density in the first round, relative to its own.
const WIDER: [f64; 2] = [4.0, 9.0];
/// Maximum number of draws of the density in the first round; below it, four for each kernel.
const MAX_FIRST: u64 = 8000;
/// Rounds of one question after which crude draws help, if no failure was found or the guides are stuck.
const PATIENCE: usize = 12;
/// Crude draws of the first round that has any; each further one has twice as many.
const CRUDE: u64 = 50_000;
/// Maximum number of crude draws where guides lead nowhere.
const MAX_CRUDE: u64 = 1 << 21;
/// A crude failure of one question counts as missed if the proposal over the density is below this fraction of the
/// reciprocal of its probability …
const THIN: f64 = 0.02;
/// … and a proposal is refused if such failures carry more than this fraction of an estimate.
const MAX_THIN: f64 = 0.07;
/// A guide descends in one round to no less than this fraction of the probability of its last level. Else failures that were
/// found far away in the tails would end its way, although more likely ones lie between.
const DESCENT: f64 = 0.05;
/// Questions followed in one round.
const ACTIVE: usize = 4;
/// Earlier mixtures in the accepted proposal: they meet failures that the last fits miss.
const LADDER: usize = 12;
/// Weight of these.
const LADDER_WEIGHT: f64 = 0.1;
/// Fraction of draws of the density in the sample that tests a proposal.
const OF_DENSITY: f64 = 0.1;
/// A fresh sample of a proposal is refused if one failure carries more than this fraction of an estimate …
const MAX_FRACTION: f64 = 0.03;
/// … or if the relative variance of a draw is larger than this, because the sample itself makes the next fit better …
const GOOD_VARIANCE: f64 = 10.0;
/// … at most so many times;
const MAX_REFINEMENTS: usize = 3;
/// and in all at most this many times.
const MAX_REFUSALS: usize = 6;

/// Options of a search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Search {
    /// Draws of a round, ≥ 100.
    pub batch: u64,
    /// Effective number of points below a guide's level, and of failures at the end.
    pub elite: f64,
    /// Maximum number of rounds for each question.
    pub rounds: usize,
    /// Maximum number of crude draws.
    pub crude: u64,
    /// Draws of the sample that tests a proposal.
    pub test: u64,
    /// Whether draws of the density bound what the search missed.
    pub is_bounded: bool,
}

impl Default for Search {
    fn default() -> Self {
        Search { batch: 2000, elite: 200.0, rounds: 50, crude: 100_000_000, test: 4000, is_bounded: true }
    }
}

impl Search {
    /// Failures that crude draws are expected to hold before a proposal is accepted: a way to fail that carries a fifth of the
    /// probability is then missed once in seven times, one that carries a third once in thirty.
    pub const CRUDE_FAILURES: f64 = 10.0;

    /// Maximum number of rounds.
    fn most_rounds(&self, questions: usize) -> usize {
        self.rounds * (1 + questions.div_ceil(ACTIVE))
    }

    /// Maximum number of evaluated points.
    pub fn most_points(&self, questions: usize) -> u64 {
        let rounds = self.batch.max(self.test).saturating_mul(self.most_rounds(questions) as u64);
        rounds.saturating_add(self.crude).saturating_add(2 * self.batch.max(MAX_FIRST))
    }
}

/// What a search knows of one question.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// The probability, from the sample that tested the proposal; 0 if no proposal was found.
    pub probability: f64,
    /// Variance of one weighted draw of the proposal, divided by the squared probability; `None` without a proposal.
    pub relative_variance: Option<f64>,
}

/// One round.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchRound {
    /// Points evaluated so far.
    pub points: u64,
    /// Points that fail any question so far.
    pub failures: u64,
    /// Questions whose failures are known well enough.
    pub settled: usize,
}

/// Result of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchRun {
    /// The proposal; `None` if no failure was found. Files store it separately.
    #[serde(skip)]
    pub proposal: Option<Mixture>,
    /// Question by question.
    pub questions: Vec<Found>,
    /// The rounds.
    pub rounds: Vec<SearchRound>,
    /// Points evaluated.
    pub points: u64,
}

impl SearchRun {
    /// The proposal, or the density in its place.
    pub fn proposal_or(&self, nominal: &dyn Density) -> Mixture {
        self.proposal.clone().unwrap_or_else(|| nominal.mixture())
    }

    /// Whether there is a proposal.
    pub fn has_found(&self) -> bool {
        self.questions.iter().any(|found| found.relative_variance.is_some())
    }
}

/// State of one question.
#[derive(Default)]
struct Question {
    rounds: usize,
    /// Rounds with enough failures, but guides that have not come as deep.
    waited: usize,
    /// Scale of the covariances around design points while the failures are few.
    stretch: f64,
    /// Fraction of failures among the last draws around design points.
    hits: Option<f64>,
    /// Levels of the guides: value and probability; a guide that reached failure has level 0.
    levels: Vec<(f64, f64)>,
    depth: f64,
    is_settled: bool,
    is_given_up: bool,
    refusals: usize,
}

impl Question {
    fn is_open(&self) -> bool {
        !self.is_settled && !self.is_given_up
    }

    /// Reopens the question if its proposal is refused, at most [`MAX_REFUSALS`] times; returns whether it did.
    fn reopen_if(&mut self, is_refused: bool) -> bool {
        let reopens = is_refused && self.refusals < MAX_REFUSALS;
        self.refusals += usize::from(reopens);
        self.is_settled &= !reopens;
        reopens
    }
}

/// Searches a proposal under which every question that can fail is estimated well.
///
/// # Errors
/// Those of the limit state; [`lanesweep_support::Error::Usage`] if the density has no valid point.
pub fn search(nominal: &dyn Density, limit_state: &dyn LimitState, options: &Search, seed: u64) -> Result<SearchRun> {
    let mut searching = Searching::start(nominal, limit_state, options, seed)?;
    let mut rounds = Vec::new();
    while searching.rounds < options.most_rounds(limit_state.questions()) {
        searching.rounds += 1;
        let goes_on = searching.round()?;
        rounds.push(searching.record());
        if !goes_on {
            break;
        }
    }
    Ok(searching.finish(rounds))
}

struct Searching<'a> {
    nominal: &'a dyn Density,
    options: &'a Search,
    seed: u64,
    pool: Pool<'a>,
    kernels: Mixture,
    questions: Vec<Question>,
    found: Vec<Found>,
    /// The last tested proposal.
    proposal: Option<Mixture>,
    rounds: usize,
    crude: u64,
}

impl<'a> Searching<'a> {
    fn start(
        nominal: &'a dyn Density,
        limit_state: &'a dyn LimitState,
        options: &'a Search,
        seed: u64,
    ) -> Result<Searching<'a>> {
        let mut pool = Pool::new(nominal, limit_state);
        let kernels = nominal.mixture();
        let count = kernels.weights().len() as u64;
        let first = options.batch.max((4 * count).min(MAX_FIRST));
        let stream = |at: u32| Stream { seed, purpose: purpose::SEARCH + at };
        pool.add_nominal(stream(0), first)?;
        if pool.points.is_empty() {
            let help = "check the bounds of the parameters: they must leave something of the density";
            return Err(Error::usage(Place::item("search"), "no draw of the density is valid", help));
        }
        for (at, variance) in (1..).zip(WIDER) {
            pool.add_source(kernels.scaled(variance)?, stream(at), first / 2)?;
        }
        let levels = vec![(f64::INFINITY, 1.0); limit_state.guides()];
        let question = || Question { stretch: 1.0, levels: levels.clone(), depth: 1.0, ..Question::default() };
        let questions = (0..limit_state.questions()).map(|_| question()).collect();
        let found = vec![Found { probability: 0.0, relative_variance: None }; limit_state.questions()];
        Ok(Searching { nominal, options, seed, pool, kernels, questions, found, proposal: None, rounds: 0, crude: 0 })
    }

    /// A stream of this round.
    fn stream(&self, at: usize) -> Stream {
        Stream { seed: self.seed, purpose: purpose::SEARCH + 64 * self.rounds as u32 + at as u32 }
    }

    fn record(&self) -> SearchRound {
        let questions = self.questions.len();
        let fails = |point: &usize| (0..questions).any(|question| self.pool.fails(*point, question));
        SearchRound {
            points: self.pool.evaluated,
            failures: (0..self.pool.points.len()).filter(fails).count() as u64,
            settled: self.questions.iter().filter(|question| question.is_settled).count(),
        }
    }

    fn finish(self, rounds: Vec<SearchRound>) -> SearchRun {
        SearchRun { proposal: self.proposal, questions: self.found, rounds, points: self.pool.evaluated }
    }

    /// One round; `false` if nothing is left to do.
    fn round(&mut self) -> Result<bool> {
        let mut open: Vec<(f64, usize)> = Vec::new();
        for (at, _) in self.questions.iter().enumerate().filter(|(_, question)| question.is_open()) {
            let failures = self.pool.failures(at);
            open.push((effective_size(failures.iter().map(|point| self.pool.weight(*point))), at));
        }
        // The failures of one question lead to those of a rarer one.
        open.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        open.truncate(ACTIVE);
        let (mut next, mut is_stuck) = (Vec::new(), false);
        for (_, at) in &open {
            is_stuck |= self.follow(*at, &mut next)?;
        }
        if self.questions.iter().all(|question| !question.is_open()) {
            return self.test();
        }
        if is_stuck && self.crude < self.max_crude() {
            let draws = if self.crude == 0 { CRUDE } else { self.crude }.min(self.max_crude() - self.crude);
            self.add_crude(draws)?;
        }
        let draws = (self.options.batch / next.len().max(1) as u64).max(100);
        for (at, (mixture, around_designs)) in next.into_iter().enumerate() {
            let stream = self.stream(at);
            let new = self.pool.add_source(mixture, stream, draws)?;
            if let Some(question) = around_designs {
                let failing = new.clone().filter(|point| self.pool.fails(*point, question)).count();
                self.questions[question].hits = Some(failing as f64 / new.len().max(1) as f64);
            }
        }
        Ok(true)
    }

    /// Maximum number of crude draws where guides lead nowhere.
    fn max_crude(&self) -> u64 {
        self.options.crude.min(MAX_CRUDE)
    }

    fn add_crude(&mut self, draws: u64) -> Result<()> {
        let indices = self.crude..self.crude + draws;
        self.crude = indices.end;
        self.pool.add_crude(Stream { seed: self.seed, purpose: purpose::NOMINAL }, indices)
    }

    /// Adds the mixtures to draw from for one question, or settles it. Returns whether the guides are stuck.
    fn follow(&mut self, at: usize, next: &mut Vec<(Mixture, Option<usize>)>) -> Result<bool> {
        let has_crude_left = self.crude < self.max_crude();
        let pool = &self.pool;
        let (elite, seed) = (self.options.elite, self.seed.wrapping_add(self.rounds as u64));
        let failures = pool.failures(at);
        let weights: Vec<f64> = failures.iter().map(|point| pool.weight(*point)).collect();
        let effective = effective_size(weights.iter().copied());
        let validity = self.nominal.validity_fraction();
        let probability = weights.iter().sum::<f64>() / validity;
        let question = &mut self.questions[at];
        question.rounds += 1;
        let has_some = effective >= 0.25 * elite;
        if !failures.is_empty() {
            match question.hits {
                Some(hits) if !has_some && hits > 0.5 => question.stretch *= 2.0,
                Some(hits) if hits < 0.2 => question.stretch = (question.stretch / 2.0).max(1.0),
                _ => (),
            }
            let (heat, stretch) = if has_some { (0.7, 1.0) } else { (0.35, question.stretch) };
            next.push((designs(&self.kernels, pool, &failures, heat, stretch)?, Some(at)));
            if has_some {
                next.push((fitted(pool, &failures, &weights, seed)?, None));
            }
        }
        let mut depth = 3.0 / pool.density_draws();
        for guide in 0..question.levels.len() {
            let (level, of_level) = question.levels[guide];
            if level <= 0.0 {
                depth = depth.min(probability);
                continue;
            }
            let enough = (elite, DESCENT * of_level * validity);
            let below = level_of(pool, at, guide, level, enough);
            let Some((level, points)) = below.or_else(|| level_of(pool, at, guide, f64::INFINITY, enough)) else {
                continue;
            };
            let weights: Vec<f64> = points.iter().map(|point| pool.guided_weight(*point)).collect();
            let of_level = (weights.iter().sum::<f64>() / validity).min(of_level);
            question.levels[guide] = (level, of_level);
            depth = depth.min(if level <= 0.0 { probability } else { of_level });
            if level > 0.0 && of_level > 2.0 * probability {
                next.push((fitted(pool, &points, &weights, seed)?, None));
            }
        }
        question.depth = depth;
        let is_deep = question.depth <= 2.0 * probability;
        let is_known = effective >= elite;
        question.waited += usize::from(is_known && !is_deep);

        if is_known && (is_deep || (question.waited > PATIENCE && !has_crude_left)) {
            question.is_settled = true;
        } else if question.rounds >= self.options.rounds {
            // What is known of its failures is better than nothing.
            question.is_settled = has_some;
            question.is_given_up = !has_some;
        }
        Ok((failures.is_empty() && question.rounds > PATIENCE) || (!is_deep && question.waited > PATIENCE))
    }

    /// Draws a fresh sample of a proposal for all settled questions. Returns whether to go on.
    fn test(&mut self) -> Result<bool> {
        let settled: Vec<usize> = (0..self.questions.len()).filter(|at| self.questions[*at].is_settled).collect();
        if settled.is_empty() {
            return Ok(false);
        }
        let seed = self.seed.wrapping_add(self.rounds as u64);
        let mut parts: Vec<(f64, Mixture)> = Vec::new();
        let share = 0.5 * (1.0 - LADDER_WEIGHT) / settled.len() as f64;
        for at in &settled {
            let failures = self.pool.failures(*at);
            let weights: Vec<f64> = failures.iter().map(|point| self.pool.weight(*point)).collect();
            parts.push((share, fitted(&self.pool, &failures, &weights, seed)?));
            parts.push((share, designs(&self.kernels, &self.pool, &failures, 1.0, 1.0)?));
        }
        let sources = &self.pool.sources;
        let rungs = sources.len().min(LADDER);
        let ladder = (0..rungs).map(|rung| &sources[(rung + 1) * sources.len() / rungs - 1].mixture);
        let ladder = ladder.map(|mixture| (LADDER_WEIGHT / rungs as f64, mixture));
        let all = parts.iter().map(|(share, mixture)| (*share, mixture)).chain(ladder);
        let candidate = Mixture::join(&all.collect::<Vec<_>>())?;
        let draws = self.options.test;
        let of_density = (OF_DENSITY * draws as f64) as u64;
        let from = self.pool.add_source(candidate.clone(), self.stream(0), draws - of_density)?.start;
        self.pool.add_nominal(self.stream(1), of_density)?;
        let new = from..self.pool.points.len();
        let validity = self.nominal.validity_fraction();
        let weight = |log_ratio| 1.0 / ((OF_DENSITY + (1.0 - OF_DENSITY) * libm::exp(log_ratio)) * validity);
        let weights: Vec<f64> = self.pool.log_ratios(&candidate, new.clone()).into_iter().map(weight).collect();
        let mut goes_on = false;
        for &at in &settled {
            let failing = new.clone().zip(&weights).filter(|(point, _)| self.pool.fails(*point, at));
            let (mut sum, mut squares, mut largest) = (0.0, 0.0, 0.0_f64);
            for (_, weight) in failing {
                sum += weight;
                squares += weight * weight;
                largest = largest.max(*weight);
            }
            let probability = sum / draws as f64;
            let variance = squares / draws as f64 / (probability * probability) - 1.0;
            let question = &mut self.questions[at];
            self.found[at] =
                Found { probability, relative_variance: Some(variance).filter(|variance| variance.is_finite()) };
            let is_coarse = variance > GOOD_VARIANCE && question.refusals < MAX_REFINEMENTS;
            let is_refused = sum <= 0.0 || largest > MAX_FRACTION * sum || is_coarse;
            goes_on |= question.reopen_if(is_refused);
        }
        let goes_on = goes_on || self.misses(&candidate, &settled)?;
        self.proposal = Some(candidate);
        Ok(goes_on)
    }

    /// Whether crude draws fail where a tested proposal is thin; the search then goes on from these.
    fn misses(&mut self, proposal: &Mixture, settled: &[usize]) -> Result<bool> {
        let least =
            settled.iter().map(|at| self.found[*at].probability).filter(|p| *p > 0.0).fold(f64::INFINITY, f64::min);
        let wanted = ((Search::CRUDE_FAILURES / least).ceil() as u64).min(self.options.crude);
        if wanted > self.crude {
            self.add_crude(wanted - self.crude)?;
        }
        let crude: Vec<usize> = self.pool.crude_failures().collect();
        let log_ratios = self.pool.log_ratios(proposal, crude.iter().copied());
        let mut goes_on = false;
        for &at in settled {
            let probability = self.found[at].probability;
            let thin = libm::log(THIN / (settled.len() as f64 * probability * self.nominal.validity_fraction()));
            let is_missed = |(point, log_ratio): &(&usize, &f64)| self.pool.fails(**point, at) && **log_ratio < thin;
            let missed = crude.iter().zip(&log_ratios).filter(is_missed).count() as f64 / self.crude.max(1) as f64;
            goes_on |= self.questions[at].reopen_if(missed > MAX_THIN * probability);
        }
        Ok(goes_on)
    }
}

/// The lowest level of a guide, at most `last` and at least 0, below which the points have at least this effective size and
/// weight; and these points. `None` if there is none.
fn level_of(
    pool: &Pool,
    question: usize,
    guide: usize,
    last: f64,
    (elite, min_weight): (f64, f64),
) -> Option<(f64, Vec<usize>)> {
    let value = |point: &usize| pool.value(*point, question, guide);
    let mut order: Vec<usize> = pool.guided().filter(|point| value(point) <= last).collect();
    order.sort_by(|a, b| value(a).total_cmp(&value(b)).then(a.cmp(b)));
    let (mut sum, mut squares) = (0.0, 0.0);
    let mut end = 0;
    while end < order.len() {
        let level = value(&order[end]);
        // Points of equal value, and all failures, belong together.
        while end < order.len() && (value(&order[end]) <= level || value(&order[end]) <= 0.0) {
            let weight = pool.guided_weight(order[end]);
            sum += weight;
            squares += weight * weight;
            end += 1;
        }
        if sum >= min_weight && sum * sum >= elite * squares && squares > 0.0 {
            order.truncate(end);
            return Some((level.max(0.0), order));
        }
    }
    None
}
