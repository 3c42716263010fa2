//! Counts that a backend makes where its lanes are, instead of the host: verdicts of samples by headway, model and criterion,
//! by cell of a map and by kernel. Integers, so that the order of samples has no effect.

use std::ops::Range;

use super::outcome::Verdicts;
use super::plan::LanePlan;
use crate::model::criterion::Criterion;

/// Cells along each axis of a map.
pub const MAP_CELLS: usize = 20;

/// One axis of a counted map.
#[derive(Debug, Clone, PartialEq)]
pub struct CountedAxis {
    /// Index of the parameter in a point.
    pub parameter: usize,
    /// The smallest number in each cell, then the smallest beyond the last one; infinite if there is none.
    pub edges: [f32; MAP_CELLS + 1],
}

/// What is counted besides voids, tries, failures, squares, caps and close following.
#[derive(Debug, Clone, PartialEq)]
pub struct Counting {
    /// Criterion of the map.
    pub criterion: Criterion,
    /// The map: horizontal axis, vertical axis.
    pub map: Option<[CountedAxis; 2]>,
    /// Groups of kernels, kernel modulo this; 0 if points do not come from kernels.
    pub groups: usize,
}

/// Places of the counts: voids, tries, lanes from close headways, then the lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CountLayout {
    headways: usize,
    models: usize,
    cells: usize,
    groups: usize,
}

impl CountLayout {
    /// Place of the number of samples without a valid point.
    pub const VOIDS: usize = 0;
    /// Place of the number of draws.
    pub const TRIES: usize = 1;
    /// Place of the lanes per model from headways below [`CLOSE_HEADWAY_S`](super::plan::CLOSE_HEADWAY_S).
    pub const CLOSE_LANES: usize = 2;
    const FAILURES: usize = 3;
    /// Counts of every sample that a device can gather.
    pub const GATHERED: usize = 1024;

    /// The layout of the counts of a plan.
    pub fn new(plan: &LanePlan, counting: &Counting) -> CountLayout {
        let cells = if counting.map.is_some() { MAP_CELLS * MAP_CELLS } else { 0 };
        CountLayout { headways: plan.headways.len(), models: plan.models.len(), cells, groups: counting.groups }
    }

    fn lanes(&self) -> usize {
        self.headways * self.models
    }

    /// Failed lanes: headway × model × criterion, the last innermost.
    pub fn failures(&self) -> Range<usize> {
        Self::FAILURES..Self::FAILURES + self.lanes() * Criterion::ALL.len()
    }

    /// Σ over samples of (failed headways)²: model × criterion.
    pub fn squares(&self) -> Range<usize> {
        let from = self.failures().end;
        from..from + self.models * Criterion::ALL.len()
    }

    /// Lanes that ended at the time cap: headway × model.
    pub fn capped(&self) -> Range<usize> {
        let from = self.squares().end;
        from..from + self.lanes()
    }

    /// Failed lanes from headways below [`CLOSE_HEADWAY_S`](super::plan::CLOSE_HEADWAY_S): model × criterion.
    pub fn close_failures(&self) -> Range<usize> {
        let from = self.capped().end;
        from..from + self.models * Criterion::ALL.len()
    }

    /// Samples by cell of the map.
    pub fn map_samples(&self) -> Range<usize> {
        let from = self.close_failures().end;
        from..from + self.cells
    }

    /// Failed lanes: headway × model × cell.
    pub fn map_failures(&self) -> Range<usize> {
        let from = self.map_samples().end;
        from..from + self.lanes() * self.cells
    }

    /// Samples by group of kernels.
    pub fn kernel_samples(&self) -> Range<usize> {
        let from = self.map_failures().end;
        from..from + self.groups
    }

    /// Failed lanes: headway × model × criterion × group.
    pub fn kernel_failures(&self) -> Range<usize> {
        let from = self.kernel_samples().end;
        from..from + self.lanes() * Criterion::ALL.len() * self.groups
    }

    /// Number of counts that every sample may change; the others belong to a cell or a group.
    pub fn of_every_sample(&self) -> usize {
        self.close_failures().end
    }

    /// Number of counts.
    pub fn total(&self) -> usize {
        self.kernel_failures().end
    }

    /// Constants of the pipeline that counts, by their names in the shaders.
    pub fn shader_constants(&self, criterion: Criterion) -> Vec<(&'static str, f64)> {
        vec![
            ("tally_headways", self.headways as f64),
            ("tally_models", self.models as f64),
            ("tally_groups", self.groups as f64),
            ("tally_cells", self.cells as f64),
            ("tally_criterion", criterion.index() as f64),
        ]
    }
}

/// Verdict words of consecutive samples: four bits per lane, for each model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PackedLanes {
    /// Lanes per model before these.
    pub first: u64,
    pub words: Vec<Vec<u32>>,
}

/// The counts of a chunk, made where its lanes are.
#[derive(Debug, Clone, PartialEq)]
pub struct Counted {
    /// Places of the counts.
    pub layout: CountLayout,
    /// Sums over the samples that are not left.
    pub counts: Vec<u64>,
    /// Samples (units) with a marked lane, which the counts do not contain; ascending.
    pub left: Vec<u64>,
    pub(super) packed: Vec<PackedLanes>,
}

impl Counted {
    /// Verdicts of a lane, by its place among those of the chunk, the model innermost.
    pub(super) fn verdicts(&self, at: usize) -> Verdicts {
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
        let layout = CountLayout { headways: 10, models: 4, cells: 400, groups: 512 };
        let lists = [
            layout.failures(),
            layout.squares(),
            layout.capped(),
            layout.close_failures(),
            layout.map_samples(),
            layout.map_failures(),
            layout.kernel_samples(),
            layout.kernel_failures(),
        ];
        assert_eq!(lists[0].start, 3);
        assert!(lists.windows(2).all(|two| two[0].end == two[1].start));
        assert_eq!(layout.total(), 3 + 120 + 12 + 40 + 12 + 400 + 40 * 400 + 512 + 120 * 512);
        assert_eq!(layout.of_every_sample(), 187);
    }
}
