//! A study's counts, as the ledger holds them.

use std::ops::Range;

use super::ledger::MergeableCounts;
use crate::Result;
use crate::engine::Partial;

impl MergeableCounts for Partial {
    fn covered(&self) -> Vec<Range<u64>> {
        Partial::covered(self)
    }

    fn join(self, other: Self) -> Result<Self> {
        self.merge(other)
    }

    fn check(&self) -> std::result::Result<(), String> {
        Partial::check(self)
    }
}
