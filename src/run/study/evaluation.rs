//! What the counts of a whole study say: scores, claims, and the numbers of its figures.

use super::{CategoryProvenance, ParameterHistogram, Study};
use crate::Result;
use crate::engine::Partial;
use crate::model::criterion::Criterion;
use crate::run::score::{Best, ClaimResult, HeadwayFailures, MeanF1, ScoreTable, best_parameterizations, check_claims};
use crate::scenario::parameterization::ModeShape;

/// What is known of one category in addition to its scores.
#[derive(Debug, Clone)]
pub struct CategoryNumbers {
    /// Failures by headway.
    pub headways: HeadwayFailures,
    /// Mean F1 over all criteria, and over each.
    pub means: Vec<MeanF1>,
    /// Distributions of the mined parameters.
    pub parameters: Vec<ParameterHistogram>,
    /// Shapes of the decomposition, if there is one.
    pub modes: Vec<ModeShape>,
    /// Cumulative explained variance of its first coefficients.
    pub svd_explained: Vec<f64>,
    /// Fold of each scenario, with cross-validation.
    pub folds: Vec<(String, usize)>,
    /// Error of the motions of each variant, if S' are given as series or cross-validated.
    pub rmse: Vec<f64>,
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
        let numbers = |(block, of): (usize, &CategoryProvenance)| {
            let criteria = std::iter::once(&Criterion::ALL[..]).chain(Criterion::ALL.chunks(1));
            let mean = |criteria| MeanF1::of(&scores.categories[block], (plan, counts), criteria, &scores.options);
            Ok(CategoryNumbers {
                headways: HeadwayFailures::of(plan, counts, block)?,
                means: criteria.map(mean).collect(),
                parameters: of.parameters.clone(),
                modes: of.modes.clone(),
                svd_explained: of.svd_explained.clone(),
                folds: of.folds.clone(),
                rmse: of.rmse.clone(),
            })
        };
        let categories = self.facts().categories.iter().enumerate().map(numbers).collect::<Result<_>>()?;
        let claims = check_claims(&scores, plan, counts);
        let best = best_parameterizations(&scores, plan, counts, Criterion::Collision);
        Ok(StudyEvaluation { scores, claims, best, categories })
    }
}
