//! The paper's published numbers (arXiv 2409.01117, table of failures and figure of LVD results), and the misfit of a
//! study. They are results on highD. The synthetic recordings are calibrated to the failures, not to F1; other data
//! should agree qualitatively, not in these numbers.

use super::{ScoreTable, f1};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;

/// Failures of the recorded scenarios.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PublishedFailures {
    /// Simulations per model.
    pub simulations: u64,
    /// Failures.
    pub failures: u64,
}

impl PublishedFailures {
    /// Failures of 100 simulations.
    pub fn percent(self) -> f64 {
        100.0 * self.failures as f64 / self.simulations as f64
    }
}

const SIMULATIONS: [u64; 3] = [3620, 8190, 4820];

/// The models of the paper, in the order of its tables. The paper has no numbers for other models, and new models in
/// the registry must not shift its numbers.
pub(super) const PAPER_MODELS: [ModelId; 4] = [ModelId::Reg157, ModelId::Cchdm, ModelId::Rss, ModelId::Fsm];

/// Category, model, then collision, TTC, BTN.
const FAILURES: [[[u64; 3]; 4]; 3] = [
    [[349, 2249, 2481], [538, 457, 677], [266, 157, 329], [387, 205, 476]],
    [[195, 4623, 4607], [65, 1219, 366], [21, 94, 65], [23, 91, 65]],
    [[2202, 4819, 4819], [1303, 3221, 2482], [6, 26, 20], [15, 32, 22]],
];

/// LVD i … v.
const LVD_VARIANTS: [&str; 5] = ["i", "ii", "iii", "iv", "v"];

/// Model × criterion, then F1 of i … v.
const LVD_F1: [[f64; 5]; 12] = [
    [0.8687, 0.9209, 0.8805, 0.9071, 0.9425],
    [1.0000, 1.0000, 0.9999, 0.9999, 0.9999],
    [1.0000, 1.0000, 0.9999, 0.9999, 1.0000],
    [0.3919, 0.7480, 0.7115, 0.7941, 0.8792],
    [0.9554, 0.9624, 0.9435, 0.9479, 0.9662],
    [0.7902, 0.9183, 0.8680, 0.9165, 0.9575],
    [0.2857, 0.0000, 0.5000, 0.4000, 0.7273],
    [0.2667, 0.1429, 0.5778, 0.7111, 0.9200],
    [0.1818, 0.0000, 0.5000, 0.4828, 0.8235],
    [0.1250, 0.0000, 0.2727, 0.2105, 0.8571],
    [0.2222, 0.1176, 0.5098, 0.6275, 0.8621],
    [0.1667, 0.0000, 0.4706, 0.4516, 0.8718],
];

fn row_of(model: ModelId) -> Option<usize> {
    PAPER_MODELS.iter().position(|m| *m == model)
}

/// Failures of S in the paper's table; `None` for a model that is not in the paper.
pub fn published_failures(category: Category, model: ModelId, criterion: Criterion) -> Option<PublishedFailures> {
    let (category, row) = (category as usize, row_of(model)?);
    Some(PublishedFailures { simulations: SIMULATIONS[category], failures: FAILURES[category][row][criterion.index()] })
}

/// F1 of an LVD parameterization in the paper's figure; `None` for other variants and for a model that is not in
/// the paper.
pub fn published_lvd_f1(variant: &str, model: ModelId, criterion: Criterion) -> Option<f64> {
    let at = LVD_VARIANTS.iter().position(|v| *v == variant)?;
    Some(LVD_F1[row_of(model)? * 3 + criterion.index()][at])
}

/// Misfit between a study and the published numbers.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Misfit {
    /// Number of failure rates of S that are published for cells of the study, at most 36.
    pub rates: usize,
    /// How many of them are near the published ones; see [`Misfit::beyond_points`].
    pub near: usize,
    /// Root mean square difference of these rates, percentage points.
    pub rate_rms_points: f64,
    /// Number of F1 values of LVD parameterizations that are published and defined here, at most 60.
    pub f1_values: usize,
    /// Mean absolute difference of these F1; 0 without any.
    pub f1_mean: f64,
    /// Maximum absolute difference of these F1 values.
    pub f1_largest: f64,
}

impl Misfit {
    /// The misfit; `None` if no failure rate of the study is published.
    pub fn of(scores: &ScoreTable) -> Option<Misfit> {
        let (mut squares, mut differences, mut near) = (Vec::new(), Vec::new(), 0);
        for category in &scores.categories {
            for cell in &category.cells {
                let variant = &category.variants[cell.variant];
                let theirs = published_failures(category.category, cell.model, cell.criterion);
                if let (0, Some(theirs)) = (cell.variant, theirs) {
                    let ours = 100.0 * cell.counts.tp as f64 / category.simulations as f64;
                    squares.push((ours - theirs.percent()).powi(2));
                    near += usize::from(Self::beyond_points(ours, theirs.percent()) == 0.0);
                } else if let (Category::Lvd, Some(theirs), Some(ours)) =
                    (category.category, published_lvd_f1(variant, cell.model, cell.criterion), f1(&cell.counts))
                {
                    differences.push((ours - theirs).abs());
                }
            }
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        (!squares.is_empty()).then(|| Misfit {
            rates: squares.len(),
            near,
            rate_rms_points: mean(&squares).sqrt(),
            f1_values: differences.len(),
            f1_mean: mean(&differences),
            f1_largest: differences.iter().copied().fold(0.0, f64::max),
        })
    }

    /// Percentage points by which a rate exceeds the limit for near: within 3 points of the published rate or within a
    /// factor of 1.5, whichever is wider.
    pub fn beyond_points(ours: f64, theirs: f64) -> f64 {
        let (low, high) = ((theirs - 3.0).min(theirs / 1.5), (theirs + 3.0).max(theirs * 1.5));
        (low - ours).max(ours - high).max(0.0)
    }

    /// The misfit in one sentence.
    pub fn sentence(&self) -> String {
        let f1 = if self.f1_values == 0 {
            String::new()
        } else {
            format!(
                "; F1 of {} LVD cells: mean absolute difference {:.2}, largest {:.2}",
                self.f1_values, self.f1_mean, self.f1_largest
            )
        };
        format!(
            "Difference to the published numbers of highD: {} shares of failures, root mean square {:.1} percentage \
             points, {} within 3 points or a factor 1.5{f1}.",
            self.rates, self.rate_rms_points, self.near
        )
    }
}
