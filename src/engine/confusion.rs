//! Counts of agreement between recorded and parameterized lanes, and their form in files.

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

// Serialized as four numbers without names: a unit of a study has about a hundred confusions.
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
    pub(crate) fn count(&mut self, s: bool, s_prime: bool) {
        match (s, s_prime) {
            (true, true) => self.tp += 1,
            (true, false) => self.fn_ += 1,
            (false, true) => self.fp += 1,
            (false, false) => self.tn += 1,
        }
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

/// Confusions as their counts, [packed](crate::counting::packed): a unit of a study has about a hundred, and journals and
/// parts are written while lanes wait.
pub(super) mod packed {
    use serde::de::Error as _;
    use serde::{Deserializer, Serializer};

    use super::Confusion;
    use crate::counting::packed;

    pub(crate) fn serialize<S: Serializer>(cells: &[Confusion<u32>], serializer: S) -> Result<S::Ok, S::Error> {
        let counts: Vec<u64> = cells.iter().flat_map(|cell| <[u32; 4]>::from(*cell)).map(u64::from).collect();
        packed::serialize(&counts, serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Confusion<u32>>, D::Error> {
        let counts = packed::deserialize(deserializer)?;
        let counts: Result<Vec<u32>, _> = counts.into_iter().map(u32::try_from).collect();
        let counts = counts.map_err(D::Error::custom)?;
        let (cells, rest) = counts.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(D::Error::custom("the counts of a cell are not complete"));
        }
        Ok(cells.iter().map(|cell| (*cell).into()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Unit {
        #[serde(with = "packed")]
        cells: Vec<Confusion<u32>>,
    }

    fn unit(counts: &[[u32; 4]]) -> Unit {
        Unit { cells: counts.iter().map(|&counts| counts.into()).collect() }
    }

    #[test]
    fn counts_come_back_whatever_their_size() {
        for counts in [vec![], vec![[0, 10, 63, 1]], vec![[0; 4], [64, 0, 0, 0]], vec![[u32::MAX; 4]; 3]] {
            let unit = unit(&counts);
            let text = serde_json::to_string(&unit).unwrap();
            assert_eq!(serde_json::from_str::<Unit>(&text).unwrap(), unit, "{text}");
        }
        assert_eq!(serde_json::to_string(&unit(&[[0, 1, 25, 63]])).unwrap(), r#"{"cells":"01pBv"}"#);
    }

    #[test]
    fn what_stands_for_no_counts_is_refused() {
        for text in [
            r#"{"cells":"012"}"#,
            r#"{"cells":"01!3"}"#,
            r#"{"cells":"012é"}"#,
            r#"{"cells":"012ZZZZZZZ0"}"#,
            r#"{"cells":3}"#,
        ] {
            assert!(serde_json::from_str::<Unit>(text).is_err(), "{text}");
        }
    }
}
