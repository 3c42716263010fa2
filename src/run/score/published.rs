//! The paper's published numbers (arXiv 2409.01117, table of failures and figure of LVD results), for
//! `--published`. They belong to highD: other data must agree in shape, not in these numbers.

use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::scenario::Category;

/// Failures of the recorded scenarios.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PublishedFailures {
    /// Simulations per model.
    pub simulations: u64,
    /// Failures.
    pub failures: u64,
}

const SIMULATIONS: [u64; 3] = [3620, 8190, 4820];

/// The models that the paper studies, in the order of its tables. It says nothing about any other, and a model
/// that the registry puts between them must not move its numbers.
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
