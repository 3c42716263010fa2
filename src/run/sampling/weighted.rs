//! Importance sampling with a given proposal or with one that a search finds. It draws, evaluates and weights the
//! samples that the ledger does not hold; every question is asked of the same samples.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::estimate_rows::EstimateRow;
use super::limit_state::{LaneLimitState, place, scenario_shares, truncated};
use super::result::SampleResult;
use super::sample_options::Question;
use super::sample_run::SampleCounts;
use super::{Sample, Weighted};
use crate::parts::{Ledger, MergeableCounts};
use lanesweep_engine::{CpuBackend, Executor, lanes_within_seconds};
use lanesweep_stats::estimate::{
    BlockSums, Found, Importance, KernelShares, Search, Warning, WeightSums, from_weight_sums, importance_sums, search,
};
use lanesweep_support::cancel::Cancel;
use lanesweep_support::{Error, Place, Result};

/// Maximum number of samples evaluated between two journal updates.
const CHUNK: u64 = 1 << 16;

/// Number of kernels in the density for which weighting `CHUNK` samples takes about one second. The time is
/// proportional to the number of kernels, so a density with more kernels has smaller chunks.
const KERNELS: u64 = 1 << 10;

/// Returns the number of samples between two updates of the journal and checks for cancellation.
///
/// It is small enough that a chunk takes seconds, however long the lanes last. It is a power of two, because the sums
/// follow a binary tree over the sample indices.
fn chunk_samples(step_cap: u32, lanes: u64, kernels: u64) -> u64 {
    let evaluated = lanes_within_seconds(step_cap) / lanes.max(1);
    let weighted = CHUNK / (kernels / KERNELS).max(1);
    1 << evaluated.min(weighted).clamp(1, CHUNK).ilog2()
}

impl Sample {
    /// Number of samples between two updates of the journal.
    pub(crate) fn chunk_samples(&self, crude_per_draw: u64) -> u64 {
        let kernels = self.density.kde.points().len();
        chunk_samples(self.profile.step_cap(), self.lanes_per_sample() * (1 + crude_per_draw), kernels as u64)
    }

    /// Number of lanes of a sample of importance sampling.
    pub(crate) fn lanes_per_sample(&self) -> u64 {
        let (mut models, mut headways) = (Vec::new(), Vec::new());
        for question in self.options.asked() {
            place(&mut models, question.model);
            place(&mut headways, question.headway);
        }
        (models.len() * headways.len()) as u64
    }

    /// The lanes of all questions as a limit state.
    pub(super) fn limit_state<'a>(&'a self, executor: Executor<'a>) -> LaneLimitState<'a> {
        let options = &self.options;
        LaneLimitState::new(&self.density, &self.profile, &options.headways, &options.asked(), executor)
    }

    /// Finds a proposal. Without failures it is the density: its draws find none either, and the search says so.
    pub(super) fn search(&self, options: &Search, executor: &Executor) -> Result<Weighted> {
        tracing::info!("search on {}", executor.backend.describe());
        let nominal = truncated(&self.density)?;
        let run = search(&nominal, &self.limit_state(executor.clone()), options, self.options.seed)?;
        let draws = self.draws_after(&run.questions, options);
        Ok(Weighted { proposal: run.proposal_or(&nominal), draws, search: Some(run) })
    }

    /// The final draws after a search.
    pub(super) fn draws_after(&self, found: &[Found], search: &Search) -> Importance {
        let options = &self.options;
        let draws =
            options.goal(if search.is_bounded { search.crude } else { 0 }).draws(found, options.seed, options.level);
        match options.stop.relative_half_width {
            Some(_) => draws,
            None => draws.with_draws(options.stop.samples),
        }
    }

    /// Draws, evaluates and weights the samples that the ledger does not hold.
    pub(crate) fn sample_weighted(
        &self,
        weighted: &Weighted,
        ledger: &mut Ledger<SampleCounts>,
        executor: &Executor,
    ) -> Result<()> {
        let nominal = truncated(&self.density)?;
        let (units, chunk) = (ledger.units(), self.chunk_samples(weighted.draws.crude_per_draw));
        // The samples of a chunk are drawn, evaluated and weighted together, so a chunk cannot be cancelled.
        let whole = Executor { progress: None, ..executor.clone().with_cancel(Cancel::default()) };
        let lanes = self.limit_state(whole);
        for missing in ledger.missing(units.clone())? {
            let mut at = missing.start;
            while at < missing.end {
                let next = (at / chunk + 1).saturating_mul(chunk).min(missing.end);
                let sums = importance_sums(&nominal, &weighted.proposal, &lanes, &weighted.draws, at..next)?;
                let sums = self.options.asked().into_iter().zip(sums).collect();
                ledger.add(SampleCounts::Weighted(WeightedTally { sums }), [0; 2])?;
                executor.progress.iter().for_each(|progress| progress(next - at));
                at = next;
                ledger.kept(executor.check_cancelled(at - units.start, units.end - units.start))?;
            }
        }
        Ok(())
    }

    /// The estimates from sums, with the intervals of the draws.
    pub(super) fn weighted_rows(&self, tally: &WeightedTally) -> Vec<EstimateRow> {
        let of = |(question, sums): &(Question, BlockSums<WeightSums>)| {
            let estimate = from_weight_sums(&sums.total().unwrap_or_default(), self.options.level);
            let headway = self.options.headway_name(question.headway);
            EstimateRow::of_draws(question.model, question.criterion, headway, estimate, self.exposure())
        };
        tally.sums.iter().map(of).collect()
    }

    /// The estimates from the sums over all samples.
    ///
    /// # Errors
    /// [`Error::Input`] at `place` if a sample or a question is missing.
    pub(super) fn weighted_result(
        &self,
        weighted: &Weighted,
        counts: Option<SampleCounts>,
        place: Place,
    ) -> Result<SampleResult> {
        let options = &self.options;
        let counts = counts.filter(|counts| counts.covered().first() == Some(&(0..self.samples())));
        let Some(SampleCounts::Weighted(tally)) = counts else {
            return Err(Error::input(place, "the parts do not hold every sample", "make them again"));
        };
        // Some more lanes, on the CPU: a merge has no other backend, and all backends give the same bits.
        let cpu = CpuBackend::lane_arithmetic();
        let lanes = self.limit_state(Executor::new(&cpu));
        let mut rows = self.weighted_rows(&tally);
        // Enough for a scenario that carries a fifth of the rarest failures to be among them.
        let found = rows.iter().map(|row| row.estimate.probability).filter(|p| *p > 0.0);
        let rarest = found.fold(f64::INFINITY, f64::min);
        let crude =
            ((Search::CRUDE_FAILURES / rarest) as u64).min(weighted.draws.draws * weighted.draws.crude_per_draw);
        let shares = scenario_shares(&lanes, &weighted.proposal, (options.seed, crude))?;
        let searched = weighted.search.as_ref().map_or(0, |search| search.points);
        let with_shares = |(mut row, shares): (EstimateRow, Option<KernelShares>)| {
            row.estimate = row.estimate.after_search(searched);
            row.estimate.trust.warn_if(weighted.draws.crude_per_draw == 0, Warning::NotBounded);
            let with = shares.map(|of| (row.estimate.clone().over_kernels(&of), of.effective_failing, of.carriers));
            row.with_data(with, self.exposure())
        };
        rows = rows.into_iter().zip(shares).map(with_shares).collect();
        let proposal = weighted.search.as_ref().and_then(|search| search.proposal.clone());
        let search = weighted.search.as_ref().map(|search| search.rounds.clone()).unwrap_or_default();
        Ok(SampleResult { rows, proposal, search, ..SampleResult::default() })
    }
}

/// Sums over a set of samples of one run; all questions use the same samples. Tallies of disjoint sets can be merged in
/// any order to the same bits, because the sums follow a binary tree over the indices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedTally {
    /// Question by question.
    pub sums: Vec<(Question, BlockSums<WeightSums>)>,
}

impl MergeableCounts for WeightedTally {
    fn covered(&self) -> Vec<Range<u64>> {
        self.sums.first().map_or_else(Vec::new, |(_, sums)| sums.ranges())
    }

    fn join(mut self, other: Self) -> Result<Self> {
        for ((_, ours), (_, theirs)) in self.sums.iter_mut().zip(other.sums) {
            ours.merge(theirs)?;
        }
        Ok(self)
    }
}
