//! The paper's qualitative claims, judged on the user's data.
//!
//! A claim holds if the paired bootstrap interval of its statistic excludes 0 with the claimed sign, is
//! contradicted if it excludes 0 with the other, and undecided otherwise. Cells in which S fails in few
//! scenarios are left out; where none remains the data is too few. It is also too few below ten scenarios: a bootstrap over one
//! scenario has no width. A claimed equality holds if the interval lies within
//! ±0.05 and is contradicted if it lies wholly outside; over several cells it is about the mean size of the
//! difference, so that differences of opposite sign do not cancel.
//!
//! The mean over cells is taken over the same cells in every draw: a draw in which one of them is undefined is
//! undefined, and where more than 5 % of the draws are, the claim is undecided.

use super::bootstrap::{BootstrapInterval, interval};
use super::published::PAPER_MODELS;
use super::statistic::Statistic;
use super::table::{CategoryScores, ScoreTable};
use crate::engine::Headway;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::scenario::Category;

/// Bound of a claimed equality of F1.
const NEAR: f64 = 0.05;

/// Below so many scenarios a bootstrap over scenarios says nothing, and no claim is judged.
const MIN_SCENARIOS: u64 = 10;

/// Share of undefined draws above which a claim is undecided.
const MAX_UNDEFINED: f64 = 0.05;

/// A claim as data.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Short name.
    pub id: &'static str,
    /// Kind of scenario.
    pub category: Category,
    /// What the paper says.
    pub statement: &'static str,
    /// The cells it speaks of. A claim that compares models has one cell per criterion, under its first model.
    pub cells: Vec<(ModelId, Criterion)>,
    /// The number it is about.
    pub statistic: Statistic,
}

/// What the data says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// The interval has the claimed sign.
    Holds,
    /// The interval has the other sign.
    Contradicted,
    /// The interval holds 0.
    Undecided,
    /// S fails in fewer scenarios than needed, or there are fewer than ten.
    TooFew,
    /// A variant, a model or a headway that it speaks of was not run.
    NotRun,
}

impl ClaimVerdict {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            ClaimVerdict::Holds => "holds",
            ClaimVerdict::Contradicted => "contradicted",
            ClaimVerdict::Undecided => "undecided",
            ClaimVerdict::TooFew => "too few",
            ClaimVerdict::NotRun => "not computed",
        }
    }
}

/// A statistic with its interval and verdict, over all usable cells or for one.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimRow {
    /// The cell; `None` for the mean over all usable ones.
    pub cell: Option<(ModelId, Criterion)>,
    /// Failures of S: in the cell, or in all cells of the claim, those that are left out included.
    pub failures: u64,
    /// Value on the whole sample.
    pub value: Option<f64>,
    /// Paired bootstrap interval.
    pub interval: Option<BootstrapInterval>,
    /// Draws in which the statistic is undefined.
    pub undefined_draws: u32,
    /// Verdict.
    pub verdict: ClaimVerdict,
}

/// A claim with its rows: first the mean, then each cell.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimResult {
    /// The claim.
    pub claim: Claim,
    /// Mean over the usable cells.
    pub overall: ClaimRow,
    /// Each cell.
    pub rows: Vec<ClaimRow>,
    /// Cells left out for too few failing scenarios.
    pub left_out: usize,
}

impl ClaimRow {
    /// Says nothing of what was not run.
    fn leave_out(&mut self) {
        (self.value, self.interval, self.undefined_draws) = (None, None, 0);
        self.verdict = ClaimVerdict::NotRun;
    }
}

fn cells(models: &[ModelId], criteria: &[Criterion]) -> Vec<(ModelId, Criterion)> {
    models.iter().flat_map(|&m| criteria.iter().map(move |&c| (m, c))).collect()
}

/// The claims of the paper, sections on results and discussion.
pub fn paper_claims() -> Vec<Claim> {
    use Category::{CutIn, CutOut, Lvd};
    use Criterion::{Btn, Collision, Ttc};
    use ModelId::{Cchdm, Fsm, Reg157, Rss};
    use Statistic::*;
    let all = || cells(&PAPER_MODELS, &Criterion::ALL);
    let elsewhere = || {
        let mut list = all();
        list.retain(|&(m, c)| m != Reg157 || c == Collision);
        list
    };
    let reg157_rest = || cells(&[Reg157], &[Ttc, Btn]);
    let careful = || cells(&[Rss, Fsm], &Criterion::ALL);
    let hasty = || cells(&[Reg157, Cchdm], &Criterion::ALL);
    let often = || cells(&[Reg157], &[Ttc, Btn]);
    let claim = |id, category, statement, cells, statistic| Claim { id, category, statement, cells, statistic };
    let mut claims = vec![
        claim("cut-in 2 > 1", CutIn, "2 is better than 1", all(), F1Above(&["2"], &["1"])),
        claim("cut-in 3 < 1", CutIn, "3 is clearly worse than 1", elsewhere(), F1Above(&["1"], &["3"])),
        claim("cut-in 4 < 2", CutIn, "4 is clearly worse than 2", elsewhere(), F1Above(&["2"], &["4"])),
        claim(
            "cut-in 3, 4 FP",
            CutIn,
            "3 and 4 err by false positives",
            elsewhere(),
            FalsePositivesDominate(&["3", "4"]),
        ),
        claim(
            "cut-in Reg157 2, 4",
            CutIn,
            "Reg157 with TTC and BTN: 2 and 4 are best",
            reg157_rest(),
            F1Above(&["2", "4"], &["1", "3", "5", "6", "7"]),
        ),
        claim(
            "cut-in 6, 7 best",
            CutIn,
            "elsewhere 6 and 7 are best",
            elsewhere(),
            F1Above(&["6", "7"], &["1", "2", "3", "4", "5"]),
        ),
        claim("cut-out b = d", CutOut, "b and d are nearly the same", all(), F1Near("b", "d")),
        claim(
            "cut-out b, d best",
            CutOut,
            "Reg157 and CCHDM are low for all but b and d",
            hasty(),
            F1Above(&["b", "d"], &["a", "c", "e", "f", "g"]),
        ),
        claim("cut-out c ~ 0", CutOut, "RSS and FSM: c is almost zero (F1 below 0.1)", careful(), F1Below("c", 0.1)),
        claim("cut-out c < a", CutOut, "RSS and FSM: c is below a", careful(), F1Above(&["a"], &["c"])),
        claim(
            "cut-out c FN",
            CutOut,
            "RSS and FSM: c errs by false negatives",
            careful(),
            FalseNegativesDominate(&["c"]),
        ),
        claim(
            "cut-out e, f low",
            CutOut,
            "RSS and FSM: e and f are below b, d and g",
            careful(),
            F1Above(&["b", "d", "g"], &["e", "f"]),
        ),
        claim(
            "LVD iii-v > i, ii",
            Lvd,
            "RSS and FSM: iii to v are far above i and ii",
            careful(),
            F1Above(&["iii", "iv", "v"], &["i", "ii"]),
        ),
        claim(
            "LVD i, ii FN",
            Lvd,
            "RSS and FSM: i and ii err by false negatives",
            careful(),
            FalseNegativesDominate(&["i", "ii"]),
        ),
        claim("LVD v best", Lvd, "v is best in all cases", all(), F1Above(&["v"], &["i", "ii", "iii", "iv"])),
    ];
    let fails = ["cut-in failures", "cut-out failures", "LVD failures"];
    for (category, id) in Category::ALL.into_iter().zip(fails) {
        let statement = "Reg157 and CCHDM fail TTC and BTN more often than RSS and FSM";
        claims.push(claim(id, category, statement, often(), FailsMoreOften(&[Reg157, Cchdm], &[Rss, Fsm])));
    }
    claims.push(claim(
        "cut-in side hits",
        CutIn,
        "side collisions make collisions outnumber TTC failures",
        cells(&[Cchdm, Rss, Fsm], &[Collision]),
        FailsMoreThan(Ttc),
    ));
    claims
}

/// Judges every claim whose category was simulated. The paper's are about all its headways and models: without one of
/// them a claim is [`ClaimVerdict::NotRun`].
pub fn judge_claims(table: &ScoreTable) -> Vec<ClaimResult> {
    let paper = Headway::paper();
    let has_paper_headways =
        table.headways.len() == paper.len() && paper.iter().all(|headway| table.headways.contains(headway));
    let judge = |claim: Claim| {
        let scores = table.categories.iter().find(|c| c.category == claim.category)?;
        let mut judged = judge_claim(claim, scores, table.options.least_failures, table.options.confidence);
        if !has_paper_headways {
            std::iter::once(&mut judged.overall).chain(&mut judged.rows).for_each(ClaimRow::leave_out);
        }
        Some(judged)
    };
    paper_claims().into_iter().filter_map(judge).collect()
}

fn judge_claim(claim: Claim, scores: &CategoryScores, least: u32, confidence: f64) -> ClaimResult {
    let statistic = claim.statistic;
    let has_model = |m: &ModelId| scores.models.contains(m);
    let runnable =
        statistic.variants().iter().all(|v| scores.variant(v).is_some()) && statistic.models().iter().all(has_model);
    let has_all_models = claim.cells.iter().all(|(model, _)| has_model(model));
    let failures = |&(model, criterion): &(ModelId, Criterion)| statistic.failures(scores, model, criterion);
    let failing = |&(model, criterion): &(ModelId, Criterion)| statistic.failing_scenarios(scores, model, criterion);
    let of_draw = |draw: Option<usize>, (model, criterion): (ModelId, Criterion)| {
        let counts = |at: usize| draw.map_or(scores.cells[at].counts, |d| scores.draws[d][at]);
        statistic.value(scores, &counts, model, criterion)
    };
    // `cells` are those that are judged; the claim speaks of all.
    let row = |cell: Option<(ModelId, Criterion)>, all: &[(ModelId, Criterion)], cells: &[(ModelId, Criterion)]| {
        let sizes = matches!(statistic, Statistic::F1Near(..)) && cells.len() > 1;
        let mean = |draw: Option<usize>| {
            let values: Option<Vec<f64>> = cells.iter().map(|&c| of_draw(draw, c)).collect();
            let values = values.filter(|v| !v.is_empty())?;
            Some(values.iter().map(|v| if sizes { v.abs() } else { *v }).sum::<f64>() / values.len() as f64)
        };
        let values: Vec<f64> = (0..scores.draws.len()).filter_map(|d| mean(Some(d))).collect();
        let undefined_draws = (scores.draws.len() - values.len()) as u32;
        let value = mean(None);
        let interval = interval(values, confidence).filter(|_| value.is_some());
        let total: u64 = all.iter().map(failures).sum();
        let failing = all.iter().map(failing).max().unwrap_or(0);
        let verdict = if scores.scenarios < MIN_SCENARIOS || cells.is_empty() || failing < u64::from(least) {
            ClaimVerdict::TooFew
        } else if f64::from(undefined_draws) > MAX_UNDEFINED * scores.draws.len() as f64 {
            ClaimVerdict::Undecided
        } else {
            verdict(&statistic, interval)
        };
        let mut row = ClaimRow { cell, failures: total, value, interval, undefined_draws, verdict };
        if !runnable || !cell.map_or(has_all_models, |(model, _)| has_model(&model)) {
            row.leave_out();
        }
        row
    };
    let usable: Vec<_> = claim.cells.iter().copied().filter(|c| failing(c) >= u64::from(least)).collect();
    let overall = row(None, &claim.cells, &usable);
    let rows = claim.cells.iter().map(|&cell| row(Some(cell), &[cell], &[cell])).collect();
    ClaimResult { left_out: claim.cells.len() - usable.len(), claim, overall, rows }
}

fn verdict(statistic: &Statistic, interval: Option<BootstrapInterval>) -> ClaimVerdict {
    let Some(BootstrapInterval { low, high }) = interval else { return ClaimVerdict::Undecided };
    let (holds, contradicted) = match statistic {
        Statistic::F1Near(..) => (low >= -NEAR && high <= NEAR, low > NEAR || high < -NEAR),
        _ => (low > 0.0, high < 0.0),
    };
    if holds {
        ClaimVerdict::Holds
    } else if contradicted {
        ClaimVerdict::Contradicted
    } else {
        ClaimVerdict::Undecided
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Confusion, Headway};
    use crate::run::score::ScoreOptions;
    use crate::run::score::table::ScoreCell;

    /// Cut-out scores in which S fails as given per model (same for every criterion) and b and d differ from it
    /// as given; every draw equals the sample.
    fn table(failures: [u64; 4], b: Confusion, d: Confusion) -> ScoreTable {
        let variants = ["S", "a", "b", "c", "d", "e", "f", "g"];
        let mut cells = Vec::new();
        for (variant, name) in variants.iter().enumerate() {
            for (model, &tp) in PAPER_MODELS.into_iter().zip(&failures) {
                for criterion in Criterion::ALL {
                    let counts = match *name {
                        "b" => b,
                        "d" => d,
                        _ => Confusion { tp, tn: 1000 - tp, ..Confusion::default() },
                    };
                    // One failing lane per scenario.
                    let failing_scenarios = counts.tp + counts.fn_;
                    let (f1_interval, undefined_draws) = (None, 0);
                    cells.push(ScoreCell {
                        variant,
                        model,
                        criterion,
                        counts,
                        failing_scenarios,
                        f1_interval,
                        undefined_draws,
                    });
                }
            }
        }
        let counts: Vec<Confusion> = cells.iter().map(|c| c.counts).collect();
        let scores = CategoryScores {
            category: Category::CutOut,
            scenarios: 100,
            simulations: 1000,
            variants: variants.map(str::to_owned).to_vec(),
            models: PAPER_MODELS.to_vec(),
            cells,
            capped: Vec::new(),
            draws: vec![counts; 20],
        };
        ScoreTable { categories: vec![scores], headways: Headway::paper(), options: ScoreOptions::default() }
    }

    fn verdict_of(table: &ScoreTable, id: &str) -> ClaimVerdict {
        judge_claims(table).into_iter().find(|r| r.claim.id == id).map(|r| r.overall.verdict).unwrap()
    }

    const GOOD: Confusion = Confusion { tp: 90, fn_: 10, fp: 10, tn: 890 };
    const BAD: Confusion = Confusion { tp: 20, fn_: 80, fp: 0, tn: 900 };

    #[test]
    fn equal_scores_are_nearly_the_same_and_distant_ones_contradict_it() {
        assert_eq!(verdict_of(&table([100; 4], GOOD, GOOD), "cut-out b = d"), ClaimVerdict::Holds);
        assert_eq!(verdict_of(&table([100; 4], GOOD, BAD), "cut-out b = d"), ClaimVerdict::Contradicted);
    }

    #[test]
    fn a_claim_of_the_paper_without_all_its_headways_or_models_is_not_computed() {
        let mut some = table([100; 4], GOOD, GOOD);
        some.headways.pop();
        assert!(
            judge_claims(&some).iter().all(|r| r.overall.verdict == ClaimVerdict::NotRun && r.overall.value.is_none())
        );
        let mut reordered = table([100; 4], GOOD, GOOD);
        reordered.headways.reverse();
        assert_eq!(verdict_of(&reordered, "cut-out b = d"), ClaimVerdict::Holds);
        let mut three = table([100; 4], GOOD, GOOD);
        let scores = &mut three.categories[0];
        scores.models.retain(|model| *model != ModelId::Fsm);
        scores.cells.retain(|cell| cell.model != ModelId::Fsm);
        scores.draws = vec![scores.cells.iter().map(|c| c.counts).collect(); 20];
        let judged = judge_claims(&three);
        let verdict = |id: &str| judged.iter().find(|r| r.claim.id == id).unwrap().overall.verdict;
        assert_eq!(verdict("cut-out b = d"), ClaimVerdict::NotRun);
        assert_ne!(verdict("cut-out b, d best"), ClaimVerdict::NotRun, "it is about Reg157 and CCHDM");
    }

    #[test]
    fn a_claim_about_few_failures_is_not_judged() {
        assert_eq!(verdict_of(&table([3; 4], GOOD, GOOD), "cut-out c < a"), ClaimVerdict::TooFew);
    }

    #[test]
    fn a_claim_about_fewer_than_ten_scenarios_is_not_judged_however_many_lanes_fail() {
        let mut one = table([100; 4], GOOD, GOOD);
        let scenarios = |table: &mut ScoreTable, count| table.categories[0].scenarios = count;
        scenarios(&mut one, 9);
        assert!(judge_claims(&one).iter().all(|r| r.overall.verdict == ClaimVerdict::TooFew));
        scenarios(&mut one, 10);
        assert_eq!(verdict_of(&one, "cut-out b = d"), ClaimVerdict::Holds);
    }

    #[test]
    fn failures_that_are_too_few_to_judge_by_are_still_told() {
        let judged = judge_claims(&table([3; 4], GOOD, GOOD));
        let claim = judged.iter().find(|r| r.claim.id == "cut-out c < a").unwrap();
        assert_eq!((claim.overall.verdict, claim.overall.failures), (ClaimVerdict::TooFew, 18), "2 models, 3 criteria");
    }

    #[test]
    fn a_model_that_never_fails_contradicts_that_it_fails_more_often() {
        assert_eq!(verdict_of(&table([500, 0, 20, 20], GOOD, GOOD), "cut-out failures"), ClaimVerdict::Contradicted);
        assert_eq!(verdict_of(&table([500, 300, 20, 20], GOOD, GOOD), "cut-out failures"), ClaimVerdict::Holds);
    }
}
