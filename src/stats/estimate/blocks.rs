//! Sums over indices with the same bits for any division of the indices among calls, threads and machines.
//!
//! Floating-point addition is not associative, so the order of all additions is fixed. They follow the binary tree over
//! the indices, in which a node of level l covers 2^l indices from a multiple of 2^l on. Any range of indices is stored
//! as the largest nodes that fill it, at most two per level; ranges join wherever they complete a node. Memory grows with
//! the logarithm of the range and with the number of its gaps.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use lanesweep_support::{Error, Place, Result};

/// Sums that can be joined: `left` covers the indices just before `right`.
pub trait Join: Default {
    /// Both together.
    fn join(left: &Self, right: &Self) -> Self;
}

/// Sums over any set of indices.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct BlockSums<S> {
    /// First index → level and sums of the node.
    nodes: BTreeMap<u64, (u32, S)>,
}

impl<S: Join + Clone> BlockSums<S> {
    /// Sums of the indices first, first + 1, …, one leaf each.
    pub fn of_leaves(first: u64, leaves: &[S]) -> BlockSums<S> {
        let mut sums = BlockSums::default();
        let end = first + leaves.len() as u64;
        let mut at = first;
        while at < end {
            // The largest node that starts here and ends within the range.
            let level = at.trailing_zeros().min(63 - (end - at).leading_zeros());
            let from = (at - first) as usize;
            sums.place(at, level, pairwise(&leaves[from..from + (1 << level)]));
            at += 1 << level;
        }
        sums
    }

    /// Adds a node and joins it with its sibling, repeatedly.
    fn place(&mut self, mut start: u64, mut level: u32, mut sums: S) {
        while level < 63 {
            let sibling = start ^ (1 << level);
            if self.nodes.get(&sibling).is_none_or(|(other, _)| *other != level) {
                break;
            }
            let Some((_, other)) = self.nodes.remove(&sibling) else { break };
            sums = if sibling < start { S::join(&other, &sums) } else { S::join(&sums, &other) };
            start = start.min(sibling);
            level += 1;
        }
        self.nodes.insert(start, (level, sums));
    }

    /// Adds another set of indices, in any order.
    ///
    /// # Errors
    /// [`Error::Usage`] where an index is in both.
    pub fn merge(&mut self, other: BlockSums<S>) -> Result<()> {
        for theirs in other.ranges() {
            if let Some(ours) = self.ranges().into_iter().find(|r| r.start < theirs.end && theirs.start < r.end) {
                return Err(Error::usage(
                    Place::item("sums over sample indices"),
                    format!(
                        "indices {} to {} are already in",
                        ours.start.max(theirs.start),
                        ours.end.min(theirs.end) - 1
                    ),
                    "give every range of indices once",
                ));
            }
        }
        for (start, (level, sums)) in other.nodes {
            self.place(start, level, sums);
        }
        Ok(())
    }

    /// The ranges of covered indices, ascending, adjacent ones joined.
    pub fn ranges(&self) -> Vec<Range<u64>> {
        let mut ranges: Vec<Range<u64>> = Vec::new();
        for (start, (level, _)) in &self.nodes {
            let end = start + (1 << level);
            match ranges.last_mut() {
                Some(last) if last.end == *start => last.end = end,
                _ => ranges.push(*start..end),
            }
        }
        ranges
    }

    /// The sum of all covered indices, nodes joined in index order; `None` if there are none.
    pub fn total(&self) -> Option<S> {
        let mut nodes = self.nodes.values().map(|(_, sums)| sums);
        let first = nodes.next()?.clone();
        Some(nodes.fold(first, |sum, node| S::join(&sum, node)))
    }
}

/// The sums of a node from its leaves, whose number is a power of two.
fn pairwise<S: Join + Clone>(leaves: &[S]) -> S {
    if leaves.len() == 1 {
        return leaves[0].clone();
    }
    let (left, right) = leaves.split_at(leaves.len() / 2);
    S::join(&pairwise(left), &pairwise(right))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Default, Clone, Copy, PartialEq)]
    struct Sum(f64);

    impl Join for Sum {
        fn join(left: &Self, right: &Self) -> Self {
            Sum(left.0 + right.0)
        }
    }

    fn leaves(n: u64) -> Vec<Sum> {
        (0..n).map(|i| Sum(libm::exp(((i * 2_654_435_761) % 1000) as f64 / 20.0 - 25.0))).collect()
    }

    fn whole(n: u64) -> BlockSums<Sum> {
        BlockSums::of_leaves(0, &leaves(n))
    }

    #[test]
    fn any_division_in_any_order_gives_the_same_bits() {
        let n = 50_001_u64;
        let all = leaves(n);
        let expected = whole(n);
        let naive: f64 = all.iter().map(|s| s.0).sum();
        assert_ne!(naive.to_bits(), expected.total().unwrap().0.to_bits(), "the leaves are too harmless to show it");
        for step in [1, 7, 1000, 4096, 4097, 32_768] {
            let starts: Vec<u64> = (0..n).step_by(step).collect();
            // Forwards, backwards, and the odd ones first.
            let mut orders = vec![starts.clone(), starts.iter().rev().copied().collect()];
            orders.push(starts.iter().skip(1).step_by(2).chain(starts.iter().step_by(2)).copied().collect());
            for order in orders {
                let mut sums = BlockSums::default();
                for start in order {
                    let end = (start + step as u64).min(n);
                    let part = BlockSums::of_leaves(start, &all[start as usize..end as usize]);
                    sums.merge(part).unwrap();
                }
                assert_eq!(sums, expected, "step {step}");
            }
        }
    }

    #[test]
    fn memory_does_not_grow_with_the_sample() {
        assert!(whole((1 << 17) - 1).nodes.len() <= 17);
        assert_eq!(whole(1 << 17).nodes.len(), 1);
        let middle = BlockSums::of_leaves(12_345, &leaves(100_000));
        assert!(middle.nodes.len() <= 34);
        assert_eq!(middle.ranges(), vec![12_345..112_345]);
    }

    #[test]
    fn an_index_given_twice_is_refused() {
        let mut sums = whole(5000);
        assert!(sums.merge(BlockSums::of_leaves(4999, &leaves(1))).is_err());
        assert!(sums.merge(BlockSums::of_leaves(5000, &leaves(1))).is_ok());
        assert_eq!(sums, whole_with_last_repeated());
    }

    fn whole_with_last_repeated() -> BlockSums<Sum> {
        let mut all = leaves(5000);
        all.push(leaves(1)[0]);
        BlockSums::of_leaves(0, &all)
    }
}
