//! What remains of draws from a given proposal: weighted sums of any set of samples, per driver model.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::model::driver::ModelId;
use crate::run::parts::MergeableCounts;
use crate::stats::estimate::{BlockSums, WeightSums};
use crate::{Error, Place, Result};

/// Sums over a set of samples of one run; all models over the same ones. Tallies of disjoint sets join in any order to
/// the same bits: the sums follow a binary tree over the indices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedTally {
    /// Model by model.
    pub sums: Vec<(ModelId, BlockSums<WeightSums>)>,
}

impl WeightedTally {
    fn models(&self) -> Vec<ModelId> {
        self.sums.iter().map(|(model, _)| *model).collect()
    }
}

impl MergeableCounts for WeightedTally {
    fn covered(&self) -> Vec<Range<u64>> {
        self.sums.first().map_or_else(Vec::new, |(_, sums)| sums.ranges())
    }

    fn join(mut self, other: Self) -> Result<Self> {
        if self.models() != other.models() {
            let help = "join only counts of one run: same density, proposal, flags and seed";
            return Err(Error::input(Place::item("weighted sums"), "they are of other driver models", help));
        }
        for ((_, ours), (_, theirs)) in self.sums.iter_mut().zip(other.sums) {
            ours.merge(theirs)?;
        }
        Ok(self)
    }

    fn check(&self) -> std::result::Result<(), String> {
        for (model, sums) in &self.sums {
            sums.check()?;
            if sums.ranges() != self.covered() {
                return Err(format!("{} holds other samples than the first model", model.name()));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::estimate::WeightedDraw;

    fn tally(models: &[ModelId], range: Range<u64>) -> WeightedTally {
        let leaf = |i: u64| {
            let response = f64::from(u8::from(i.is_multiple_of(3)));
            let weight = libm::exp(((i * 2_654_435_761) % 97) as f64 / 9.0 - 5.0);
            WeightSums::from(WeightedDraw { weight, response, tries: 1, is_void: false, is_thin: false })
        };
        let sums = || BlockSums::of_leaves(range.start, &range.clone().map(leaf).collect::<Vec<_>>());
        WeightedTally { sums: models.iter().map(|model| (*model, sums())).collect() }
    }

    #[test]
    fn parts_join_in_any_order_to_the_bits_of_the_whole() {
        let models = [ModelId::Rss, ModelId::Fsm];
        let whole = tally(&models, 0..1000);
        for cuts in [[0, 1, 512, 1000], [0, 333, 666, 1000], [0, 511, 513, 1000]] {
            let parts: Vec<WeightedTally> = cuts.windows(2).map(|w| tally(&models, w[0]..w[1])).collect();
            let [a, b, c] = [parts[0].clone(), parts[1].clone(), parts[2].clone()];
            assert_eq!(a.clone().join(b.clone()).unwrap().join(c.clone()).unwrap(), whole);
            assert_eq!(c.join(a).unwrap().join(b).unwrap(), whole);
        }
        assert_eq!(whole.covered().as_slice(), std::slice::from_ref(&(0..1000)));
    }

    #[test]
    fn samples_in_both_other_models_and_uneven_models_are_refused() {
        let models = [ModelId::Rss, ModelId::Fsm];
        assert!(tally(&models, 0..10).join(tally(&models, 9..12)).is_err());
        assert!(tally(&models, 0..10).join(tally(&models[..1], 10..12)).is_err());
        let mut uneven = tally(&models, 0..10);
        assert_eq!(uneven.check(), Ok(()));
        uneven.sums[1].1 = tally(&models, 0..9).sums[1].1.clone();
        assert!(uneven.check().unwrap_err().contains("FSM"));
    }
}
