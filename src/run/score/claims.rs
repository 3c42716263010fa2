//! Checks the paper's qualitative claims on the user's data.
//!
//! A cell (model and criterion) of a claim holds if the interval of its statistic excludes 0 with the claimed sign. It
//! is contradicted if the interval excludes 0 with the other sign, and undecided otherwise. A claimed equality holds in
//! a cell if the interval lies within ±0.05, and is contradicted if it lies wholly outside. A cell in which S fails in
//! few scenarios is not evaluated.
//!
//! [`ClaimVerdict::of_cells`] combines the cells to a verdict on the claim.

use super::ScoreTable;
use super::difference::ScoreInterval;
use super::paper_claims::{Claim, paper_claims};
use super::statistic::{Scenarios, Statistic};
use lanesweep_engine::{Headway, LanePlan, Partial, UnitCounts};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;

/// Bound of a claimed equality of F1.
const NEAR: f64 = 0.05;

/// Verdict on a claim or a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// The interval has the claimed sign.
    Holds,
    /// The interval has the other sign.
    Contradicted,
    /// The interval contains 0.
    Undecided,
    /// S fails in fewer scenarios than needed.
    TooFew,
    /// A variant, model or headway of the claim was not run.
    NotRun,
}

impl ClaimVerdict {
    /// All, in the order of every table.
    pub const ALL: [ClaimVerdict; 5] = [
        ClaimVerdict::Holds,
        ClaimVerdict::Contradicted,
        ClaimVerdict::Undecided,
        ClaimVerdict::TooFew,
        ClaimVerdict::NotRun,
    ];

    /// Text of the rule that combines cells to a verdict.
    pub const RULE: &'static str = "A claim holds if at least half of its cells (driver model and criterion) hold and \
                                    none contradicts it. It is contradicted if at least half contradict it and none \
                                    holds. It has too few failing scenarios if more than half of its cells have. \
                                    Otherwise it is undecided.";

    /// Text for reports.
    pub fn text(self) -> &'static str {
        match self {
            ClaimVerdict::Holds => "holds",
            ClaimVerdict::Contradicted => "contradicted",
            ClaimVerdict::Undecided => "undecided",
            ClaimVerdict::TooFew => "too few",
            ClaimVerdict::NotRun => "not computed",
        }
    }

    /// Verdict on a number that is claimed to be positive.
    pub fn of_sign(interval: ScoreInterval) -> ClaimVerdict {
        match interval {
            ScoreInterval { low, .. } if low > 0.0 => ClaimVerdict::Holds,
            ScoreInterval { high, .. } if high < 0.0 => ClaimVerdict::Contradicted,
            _ => ClaimVerdict::Undecided,
        }
    }

    /// Verdict on a number that is claimed to be nearly 0.
    fn of_nearness(interval: ScoreInterval) -> ClaimVerdict {
        match interval {
            ScoreInterval { low, high } if low >= -NEAR && high <= NEAR => ClaimVerdict::Holds,
            ScoreInterval { low, high } if low > NEAR || high < -NEAR => ClaimVerdict::Contradicted,
            _ => ClaimVerdict::Undecided,
        }
    }

    /// Verdict on a claim from the verdicts of its cells. If each cell errs in 2.5 % of repeats, at most 5 % of the
    /// claims that are false in all cells hold, for any dependence between cells (Markov's inequality).
    pub fn of_cells(cells: &[ClaimVerdict]) -> ClaimVerdict {
        let count = |verdict: ClaimVerdict| cells.iter().filter(|cell| **cell == verdict).count();
        let [holding, contradicting, _, too_few, not_run] = ClaimVerdict::ALL.map(count);
        if not_run > 0 {
            ClaimVerdict::NotRun
        } else if 2 * too_few > cells.len() || cells.is_empty() {
            ClaimVerdict::TooFew
        } else if contradicting == 0 && 2 * holding >= cells.len() {
            ClaimVerdict::Holds
        } else if holding == 0 && 2 * contradicting >= cells.len() {
            ClaimVerdict::Contradicted
        } else {
            ClaimVerdict::Undecided
        }
    }
}

/// A statistic with its interval and verdict in one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimRow {
    /// The cell.
    pub cell: (ModelId, Criterion),
    /// Scenarios in which S fails in any of the compared cells.
    pub failing_scenarios: u64,
    /// Value on the whole sample.
    pub value: Option<f64>,
    /// Interval over scenarios.
    pub interval: Option<ScoreInterval>,
    /// Verdict.
    pub verdict: ClaimVerdict,
}

/// A claim with its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimResult {
    /// The claim.
    pub claim: Claim,
    /// Scenarios in which S fails in any cell of the claim.
    pub failing_scenarios: u64,
    /// Mean over the evaluated cells; for a claimed equality the mean absolute value.
    pub mean: Option<f64>,
    /// The combined verdict of the cells.
    pub verdict: ClaimVerdict,
    /// Each cell.
    pub rows: Vec<ClaimRow>,
}

/// Evaluates every claim whose category was simulated. The paper's claims cover all its headways and models: if one of
/// them was not run, a claim is [`ClaimVerdict::NotRun`]. `counts` are the counts that the table scores.
pub fn check_claims(table: &ScoreTable, plan: &LanePlan, counts: &Partial) -> Vec<ClaimResult> {
    let judge = |claim: Claim| {
        let scores = table.categories.iter().find(|c| c.category == claim.category)?;
        Some(check_claim(claim, Scenarios { scores, units: units_of(plan, counts, scores.category) }, table))
    };
    paper_claims().into_iter().filter_map(judge).collect()
}

/// The counts of a category's scenarios.
pub(super) fn units_of<'a>(plan: &LanePlan, counts: &'a Partial, category: Category) -> &'a [UnitCounts] {
    let range = |block: &lanesweep_engine::Block| {
        let first = block.first_unit as usize;
        first..first + block.units.len() as usize
    };
    let block = plan.blocks.iter().find(|block| block.category == category);
    block.and_then(|block| counts.units().get(range(block))).unwrap_or_default()
}

fn check_claim(claim: Claim, of: Scenarios, table: &ScoreTable) -> ClaimResult {
    let statistic = claim.statistic;
    let paper = Headway::paper();
    let has_headways = table.headways.len() == paper.len() && paper.iter().all(|h| table.headways.contains(h));
    let is_runnable = has_headways && statistic.variants().iter().all(|v| of.scores.variant(v).is_some());
    let row = |&cell: &(ModelId, Criterion)| {
        let compared = statistic.judged_by(cell);
        let failing_scenarios = of.failing(&compared);
        let has_run = is_runnable && compared.iter().all(|(model, _)| of.scores.models.contains(model));
        let measured = statistic.value(of, cell, table.options.confidence).filter(|_| has_run);
        let verdict = match measured {
            _ if !has_run => ClaimVerdict::NotRun,
            _ if failing_scenarios < u64::from(table.options.min_failures) => ClaimVerdict::TooFew,
            None => ClaimVerdict::Undecided,
            Some((_, interval)) if matches!(statistic, Statistic::F1Near(..)) => ClaimVerdict::of_nearness(interval),
            Some((_, interval)) => ClaimVerdict::of_sign(interval),
        };
        let (value, interval) = (measured.map(|m| m.0), measured.map(|m| m.1));
        ClaimRow { cell, failing_scenarios, value, interval, verdict }
    };
    let rows: Vec<ClaimRow> = claim.cells.iter().map(row).collect();
    let verdict = ClaimVerdict::of_cells(&rows.iter().map(|row| row.verdict).collect::<Vec<_>>());
    let size = |v: f64| if matches!(statistic, Statistic::F1Near(..)) { v.abs() } else { v };
    let judged = rows.iter().filter(|row| row.verdict != ClaimVerdict::TooFew);
    let values: Option<Vec<f64>> = judged.map(|row| row.value.map(size)).collect();
    let values = values.filter(|v| !v.is_empty() && verdict != ClaimVerdict::NotRun);
    let mean = values.map(|v| v.iter().sum::<f64>() / v.len() as f64);
    let compared: Vec<_> = claim.cells.iter().flat_map(|cell| statistic.judged_by(*cell)).collect();
    ClaimResult { failing_scenarios: of.failing(&compared), mean, verdict, rows, claim }
}
