//! What the counts of a whole study say: scores, claims, and the numbers of its figures.

use super::Study;
use crate::score::{Best, ClaimResult, HeadwayFailures, MeanF1, ScoreTable, best_parameterizations, check_claims};
use lanesweep_engine::Partial;
use lanesweep_model::criterion::Criterion;
use lanesweep_support::Result;

/// What the counts of one category say in addition to its scores.
#[derive(Debug, Clone)]
pub struct CategoryNumbers {
    /// Failures by headway.
    pub headways: HeadwayFailures,
    /// Mean F1 over all criteria, and over each.
    pub means: Vec<MeanF1>,
}

/// The evaluation of a whole study.
#[derive(Debug, Clone)]
pub struct StudyEvaluation {
    /// Scores.
    pub scores: ScoreTable,
    /// The paper's claims with their verdicts.
    pub claims: Vec<ClaimResult>,
    /// The best parameterizations for collisions.
    pub best: Vec<Best>,
    /// One per category of the scores.
    pub categories: Vec<CategoryNumbers>,
}

impl Study {
    /// Evaluates the counts of all lanes.
    ///
    /// # Errors
    /// As [`Study::score`].
    pub fn evaluate(&self, counts: &Partial) -> Result<StudyEvaluation> {
        let plan = self.plan();
        let scores = self.score(counts)?;
        let numbers = |block: usize| {
            let criteria = std::iter::once(&Criterion::ALL[..]).chain(Criterion::ALL.chunks(1));
            let mean = |criteria| MeanF1::of(&scores.categories[block], (plan, counts), criteria, &scores.options);
            Ok(CategoryNumbers {
                headways: HeadwayFailures::of(plan, counts, block)?,
                means: criteria.map(mean).collect(),
            })
        };
        let categories = (0..plan.blocks.len()).map(numbers).collect::<Result<_>>()?;
        let claims = check_claims(&scores, plan, counts);
        let best = best_parameterizations(&scores, plan, counts, Criterion::Collision);
        Ok(StudyEvaluation { scores, claims, best, categories })
    }
}
