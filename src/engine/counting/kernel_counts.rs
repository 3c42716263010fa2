//! Samples and failures by the kernel that they were drawn from. A kernel is one scenario, so these counts give the
//! uncertainty of an estimate caused by the data.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::backend::Chunk;
use crate::outcome::Verdicts;
use crate::plan::LanePlan;
use lanesweep_model::criterion::Criterion;

/// Maximum number of groups of kernels: kernel k counts in group k mod 512. With fewer kernels, each is a group. With
/// more kernels, groups vary as much as kernels do, and a journal stays small.
const MAX_GROUPS: usize = 512;

/// Kernel of a void sample.
pub(super) const NO_KERNEL: u32 = u32::MAX;

/// Adds counts to others of the same places.
pub(super) fn add_counts(ours: &mut [u64], theirs: &[u64]) {
    ours.iter_mut().zip(theirs).for_each(|(ours, theirs)| *ours = ours.saturating_add(*theirs));
}

/// Index of a cell among headway × model × criterion, the last innermost.
pub fn cell_of(plan_models: usize, headway: usize, model: usize, criterion: Criterion) -> usize {
    (headway * plan_models + model) * Criterion::ALL.len() + criterion.index()
}

/// Counts over a set of samples, per group of kernels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KernelCounts {
    /// Valid samples per group.
    #[serde(with = "packed")]
    samples: Vec<u64>,
    /// Failed lanes: headway × model × criterion × group, the last innermost.
    #[serde(with = "packed")]
    failures: Vec<u64>,
}

impl KernelCounts {
    /// Counts of zero; `None` for a plan whose points do not come from kernels.
    pub(super) fn empty(plan: &LanePlan) -> Option<KernelCounts> {
        let points = &plan.generator()?.points;
        // Either all points have a kernel or none.
        points.component(0, 1)?;
        Some(KernelCounts::zero(points.components() as usize, plan.headways.len() * plan.models.len()))
    }

    /// Counts of zero of so many kernels and lanes of a sample.
    pub fn zero(kernels: usize, lanes: usize) -> KernelCounts {
        let groups = kernels.min(MAX_GROUPS);
        KernelCounts { samples: vec![0; groups], failures: vec![0; lanes * Criterion::ALL.len() * groups] }
    }

    /// Counts the lanes of a chunk; `kernels` has one number per sample.
    pub(super) fn count(&mut self, plan: &LanePlan, chunk: &Chunk, kernels: &[u32]) {
        let groups = self.samples.len();
        let group = |kernel: u32| kernel as usize % groups;
        let valid = || kernels.iter().enumerate().filter(|(_, kernel)| **kernel != NO_KERNEL);
        valid().for_each(|(_, kernel)| self.samples[group(*kernel)] += 1);
        let lanes = plan.headways.len() * plan.models.len();
        // One task per lane of a sample, because each has separate counts.
        self.failures.par_chunks_mut(Criterion::ALL.len() * groups).enumerate().for_each(|(at, counts)| {
            for (sample, kernel) in valid() {
                let verdicts = chunk.verdicts[sample * lanes + at];
                for criterion in Criterion::ALL {
                    counts[criterion.index() * groups + group(*kernel)] += u64::from(verdicts.failed(criterion));
                }
            }
        });
    }

    /// Counts that a backend has made: samples by group, then failures in the order of these.
    pub(super) fn counted(samples: &[u64], failures: &[u64]) -> KernelCounts {
        KernelCounts { samples: samples.to_vec(), failures: failures.to_vec() }
    }

    /// Counts one sample of a kernel; `verdicts` has one per lane of it.
    pub fn count_sample(&mut self, kernel: u32, verdicts: &[Verdicts]) {
        let groups = self.samples.len();
        let group = kernel as usize % groups;
        self.samples[group] += 1;
        for (verdicts, counts) in verdicts.iter().zip(self.failures.chunks_mut(Criterion::ALL.len() * groups)) {
            for criterion in Criterion::ALL {
                counts[criterion.index() * groups + group] += u64::from(verdicts.failed(criterion));
            }
        }
    }

    pub(super) fn add(&mut self, other: &KernelCounts) {
        add_counts(&mut self.samples, &other.samples);
        add_counts(&mut self.failures, &other.failures);
    }

    /// Number of groups.
    pub fn groups(&self) -> usize {
        self.samples.len()
    }

    /// Number of groups and of counts.
    pub(super) fn shape(&self) -> [usize; 2] {
        [self.samples.len(), self.failures.len()]
    }

    /// Lanes and failed lanes over some cells (headway × model × criterion), group by group.
    pub fn over(&self, cells: &[usize]) -> (Vec<u64>, Vec<u64>) {
        let groups = self.samples.len();
        let runs = self.samples.iter().map(|n| n * cells.len() as u64).collect();
        let of_group = |group: usize| cells.iter().map(|cell| self.failures[cell * groups + group]).sum();
        (runs, (0..groups).map(of_group).collect())
    }
}

/// Serializes counts as base-32 digits, the most significant first. The last digit of a number is a lower-case letter
/// or a digit, the others are capital letters. Most counts of a journal's record are one character.
pub(crate) mod packed {
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serializer};

    const LAST: &[u8; 32] = b"0123456789abcdefghijklmnopqrstuv";
    const MORE: &[u8; 32] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZ+-*/=_";

    pub(crate) fn serialize<S: Serializer>(counts: &[u64], serializer: S) -> Result<S::Ok, S::Error> {
        let mut text = String::with_capacity(2 * counts.len());
        for count in counts {
            let digits = (64 - count.leading_zeros()).div_ceil(5).max(1);
            for digit in (0..digits).rev() {
                let value = (count >> (5 * digit)) as usize % 32;
                text.push(if digit == 0 { LAST[value] } else { MORE[value] } as char);
            }
        }
        serializer.serialize_str(&text)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u64>, D::Error> {
        let text = String::deserialize(deserializer)?;
        let (mut counts, mut count, mut is_whole) = (Vec::new(), 0_u64, true);
        for byte in text.bytes() {
            let value = |digits: &[u8; 32]| digits.iter().position(|digit| *digit == byte).map(|value| value as u64);
            if count >> 59 != 0 {
                return Err(D::Error::custom("a count is too large"));
            }
            match (value(LAST), value(MORE)) {
                (Some(value), _) => {
                    counts.push(32 * count + value);
                    (count, is_whole) = (0, true);
                }
                (None, Some(value)) => (count, is_whole) = (32 * count + value, false),
                (None, None) => return Err(D::Error::custom("a character stands for no count")),
            }
        }
        if is_whole { Ok(counts) } else { Err(D::Error::custom("the last count is not complete")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_come_back_from_files_and_damage_does_not() {
        let samples = vec![0, 1, 31, 32, 1023, 1024, u64::MAX, 7];
        let counts = KernelCounts { failures: vec![3; 8], samples };
        let text = serde_json::to_string(&counts).unwrap();
        assert_eq!(serde_json::from_str::<KernelCounts>(&text).unwrap(), counts, "{text}");
        assert!(text.starts_with(r#"{"samples":"01vB0"#), "{text}");
        for wrong in ["A", "é", "!", "____________v", "ZZZZZZZZZZZZZZZZZZZZZ0"] {
            let text = format!(r#"{{"samples":"{wrong}","failures":"0"}}"#);
            assert!(serde_json::from_str::<KernelCounts>(&text).is_err(), "{text}");
        }
    }

    #[test]
    fn lanes_and_failures_of_cells_are_summed_group_by_group() {
        let counts = KernelCounts { samples: vec![5, 6], failures: vec![1, 2, 0, 4] };
        assert_eq!(counts.over(&[0, 1]), (vec![10, 12], vec![1, 6]));
    }
}
