//! Encoded cases in memory, for plans whose cases are no function of the unit.

use super::lane_case::LaneCase;
use super::plan::CaseSource;
use lanesweep_model::scenario::Tables;

/// The cases of every block, and the series that they share.
#[derive(Default)]
pub struct CaseTable {
    /// In the plan's order.
    pub blocks: Vec<EncodedBlock>,
    /// The series.
    pub tables: Tables<f64>,
}

/// The cases of consecutive units of a block.
#[derive(Clone)]
pub struct EncodedBlock {
    /// Unit of the first case, within the block.
    pub first_unit: u64,
    /// Number of variants.
    pub variants: usize,
    /// Unit-major, variant-minor.
    pub cases: Vec<LaneCase<f64>>,
}

impl CaseTable {
    /// An empty table of blocks with these numbers of variants; each begins with its first unit.
    pub fn new(variants: impl IntoIterator<Item = usize>) -> CaseTable {
        let block = |variants| EncodedBlock { first_unit: 0, variants, cases: Vec::new() };
        CaseTable { blocks: variants.into_iter().map(block).collect(), tables: Tables::default() }
    }
}

impl CaseSource for CaseTable {
    fn case(&self, block: usize, unit: u64, variant: usize) -> LaneCase<f64> {
        let block = &self.blocks[block];
        block.cases[(unit - block.first_unit) as usize * block.variants + variant]
    }

    fn tables(&self) -> &Tables<f64> {
        &self.tables
    }
}
