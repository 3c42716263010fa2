//! The claims of the paper as data, from its sections on results and discussion.

use super::published::PAPER_MODELS;
use super::statistic::Statistic;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;

/// A claim as data.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Short name.
    pub id: &'static str,
    /// Kind of scenario.
    pub category: Category,
    /// What the paper says.
    pub statement: &'static str,
    /// Its cells. A claim that compares models has one cell per criterion, under its first model.
    pub cells: Vec<(ModelId, Criterion)>,
    /// The statistic of the claim.
    pub statistic: Statistic,
}

fn cells(models: &[ModelId], criteria: &[Criterion]) -> Vec<(ModelId, Criterion)> {
    models.iter().flat_map(|&m| criteria.iter().map(move |&c| (m, c))).collect()
}

/// The claims of the paper.
pub(super) fn paper_claims() -> Vec<Claim> {
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
    let claim = |id, category, statement, cells, statistic| Claim { id, category, statement, cells, statistic };
    #[rustfmt::skip] // a table
    let mut claims = vec![
        claim("cut-in 2 > 1", CutIn, "2 is better than 1", all(), F1Above(&["2"], &["1"])),
        claim("cut-in 3 < 1", CutIn, "3 is clearly worse than 1", elsewhere(), F1Above(&["1"], &["3"])),
        claim("cut-in 4 < 2", CutIn, "4 is clearly worse than 2", elsewhere(), F1Above(&["2"], &["4"])),
        claim("cut-in 3, 4 FP", CutIn, "3 and 4 err by false positives", elsewhere(), ErrorsDominate(&["3", "4"], 1.0)),
        claim("cut-in Reg157 2, 4", CutIn, "Reg157 with TTC and BTN: 2 and 4 are best", reg157_rest(), F1Above(&["2", "4"], &["1", "3", "5", "6", "7"])),
        claim("cut-in 6, 7 best", CutIn, "elsewhere 6 and 7 are best", elsewhere(), F1Above(&["6", "7"], &["1", "2", "3", "4", "5"])),
        claim("cut-out b = d", CutOut, "b and d are nearly the same", all(), F1Near("b", "d")),
        claim("cut-out b, d best", CutOut, "Reg157 and CCHDM are low for all but b and d", hasty(), F1Above(&["b", "d"], &["a", "c", "e", "f", "g"])),
        claim("cut-out c ~ 0", CutOut, "RSS and FSM: c is almost zero (F1 below 0.1)", careful(), F1Below("c", 0.1)),
        claim("cut-out c < a", CutOut, "RSS and FSM: c is below a", careful(), F1Above(&["a"], &["c"])),
        claim("cut-out c FN", CutOut, "RSS and FSM: c errs by false negatives", careful(), ErrorsDominate(&["c"], -1.0)),
        claim("cut-out e, f low", CutOut, "RSS and FSM: e and f are below b, d and g", careful(), F1Above(&["b", "d", "g"], &["e", "f"])),
        claim("LVD iii-v > i, ii", Lvd, "RSS and FSM: iii to v are far above i and ii", careful(), F1Above(&["iii", "iv", "v"], &["i", "ii"])),
        claim("LVD i, ii FN", Lvd, "RSS and FSM: i and ii err by false negatives", careful(), ErrorsDominate(&["i", "ii"], -1.0)),
        claim("LVD v best", Lvd, "v is best in all cases", all(), F1Above(&["v"], &["i", "ii", "iii", "iv"])),
    ];
    let fails = ["cut-in failures", "cut-out failures", "LVD failures"];
    for (category, id) in Category::ALL.into_iter().zip(fails) {
        let statement = "Reg157 and CCHDM fail TTC and BTN more often than RSS and FSM";
        claims.push(claim(id, category, statement, reg157_rest(), FailsMoreOften(&[Reg157, Cchdm], &[Rss, Fsm])));
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
