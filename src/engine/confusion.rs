//! Counts of agreement between recorded and parameterized lanes.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// Agreement of S' with S over the headways of one unit, variant, model and criterion. For variant 0 (S
/// against itself) `tp` counts the failures of S and `tn` its passes.
///
/// Sums are u64. The counts of one unit are u32, half the memory: they are at most its headways
/// ([`Partial::from_chunk`](super::Partial::from_chunk) refuses a plan with more than u32 holds).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "[N; 4]", into = "[N; 4]")]
#[serde(bound(serialize = "N: Copy + Serialize", deserialize = "N: Deserialize<'de>"))]
pub struct Confusion<N = u64> {
    /// TP: S and S' fail.
    pub tp: N,
    /// FN: only S fails.
    pub fn_: N,
    /// FP: only S' fails.
    pub fp: N,
    /// TN: both pass.
    pub tn: N,
}

// Four numbers instead of four names: a unit of a study has a hundred of them.
impl<N> From<[N; 4]> for Confusion<N> {
    fn from([tp, fn_, fp, tn]: [N; 4]) -> Confusion<N> {
        Confusion { tp, fn_, fp, tn }
    }
}

impl<N> From<Confusion<N>> for [N; 4] {
    fn from(c: Confusion<N>) -> [N; 4] {
        [c.tp, c.fn_, c.fp, c.tn]
    }
}

impl Confusion<u32> {
    /// Counts one lane of S' against its lane of S.
    pub fn count(&mut self, s: bool, s_prime: bool) {
        match (s, s_prime) {
            (true, true) => self.tp += 1,
            (true, false) => self.fn_ += 1,
            (false, true) => self.fp += 1,
            (false, false) => self.tn += 1,
        }
    }

    /// The largest of the four counts.
    pub fn largest(&self) -> u32 {
        self.tp.max(self.fn_).max(self.fp).max(self.tn)
    }
}

impl<N: From<u32> + AddAssign> Confusion<N> {
    /// Adds the counts of a unit.
    pub fn add(&mut self, unit: &Confusion<u32>) {
        self.tp += N::from(unit.tp);
        self.fn_ += N::from(unit.fn_);
        self.fp += N::from(unit.fp);
        self.tn += N::from(unit.tn);
    }
}
