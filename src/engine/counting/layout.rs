//! Counts that a backend makes where its lanes are, and their places.

use std::ops::Range;

use super::KernelCounts;
use crate::outcome::Verdicts;
use crate::plan::LanePlan;
use lanesweep_model::criterion::Criterion;

/// Places of the counts: voids, tries, then the lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CountLayout {
    headways: usize,
    models: usize,
    /// Groups of kernels; 0 if points do not come from kernels.
    groups: usize,
}

impl CountLayout {
    /// Place of the number of samples without a valid point.
    pub const VOIDS: usize = 0;
    /// Place of the number of draws.
    pub const TRIES: usize = 1;
    const FAILURES: usize = 2;
    /// Counts of every sample that a device can gather.
    pub const GATHERED: usize = 1024;

    /// The layout of the counts of a plan.
    pub fn new(plan: &LanePlan) -> CountLayout {
        let groups = KernelCounts::empty(plan).map_or(0, |counts| counts.groups());
        CountLayout { headways: plan.headways.len(), models: plan.models.len(), groups }
    }

    fn lanes(&self) -> usize {
        self.headways * self.models
    }

    /// Failed lanes: headway × model × criterion, the last innermost.
    pub(crate) fn failures(&self) -> Range<usize> {
        Self::FAILURES..Self::FAILURES + self.lanes() * Criterion::ALL.len()
    }

    /// Σ over samples of (failed headways)²: model × criterion.
    pub(crate) fn squares(&self) -> Range<usize> {
        let from = self.failures().end;
        from..from + self.models * Criterion::ALL.len()
    }

    /// Lanes that ended at the time cap: headway × model.
    pub(crate) fn capped(&self) -> Range<usize> {
        let from = self.squares().end;
        from..from + self.lanes()
    }

    /// Samples by group of kernels.
    pub(crate) fn kernel_samples(&self) -> Range<usize> {
        let from = self.capped().end;
        from..from + self.groups
    }

    /// Failed lanes: headway × model × criterion × group.
    pub(crate) fn kernel_failures(&self) -> Range<usize> {
        let from = self.kernel_samples().end;
        from..from + self.lanes() * Criterion::ALL.len() * self.groups
    }

    /// Number of counts that every sample may change; the others belong to a group.
    pub fn of_every_sample(&self) -> usize {
        self.capped().end
    }

    /// Number of counts.
    pub fn total(&self) -> usize {
        self.kernel_failures().end
    }

    /// Constants of the pipeline that counts, by their names in the shaders.
    pub fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("tally_headways", self.headways as f64),
            ("tally_models", self.models as f64),
            ("tally_groups", self.groups as f64),
        ]
    }
}

/// Verdict words of consecutive samples: four bits per lane, for each model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PackedLanes {
    /// Lanes per model before these.
    pub first: u64,
    pub words: Vec<Vec<u32>>,
}

/// The counts of a chunk, made where its lanes are.
#[derive(Debug, Clone, PartialEq)]
pub struct Counted {
    /// Places of the counts.
    pub layout: CountLayout,
    /// Sums over the samples.
    pub counts: Vec<u64>,
    pub(crate) packed: Vec<PackedLanes>,
}

impl Counted {
    /// Verdicts of a lane, by its place among those of the chunk, the model innermost.
    pub(crate) fn verdicts(&self, at: usize) -> Verdicts {
        let models = self.layout.models;
        let (lane, model) = ((at / models) as u64, at % models);
        let piece = &self.packed[self.packed.partition_point(|piece| piece.first <= lane) - 1];
        let inside = (lane - piece.first) as usize;
        Verdicts((piece.words[model][inside / 8] >> (4 * (inside % 8)) & 0xf) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lists lie one after the other, as the shader has them.
    #[test]
    fn the_counts_lie_one_after_the_other() {
        let layout = CountLayout { headways: 10, models: 4, groups: 512 };
        let lists =
            [layout.failures(), layout.squares(), layout.capped(), layout.kernel_samples(), layout.kernel_failures()];
        assert_eq!(lists[0].start, 2);
        assert!(lists.windows(2).all(|two| two[0].end == two[1].start));
        assert_eq!(layout.total(), 2 + 120 + 12 + 40 + 512 + 120 * 512);
        assert_eq!(layout.of_every_sample(), 174);
    }
}
