//! Runs in parts: shards of a plan, journals of finished chunks, part files, and what merging checks.
//!
//! A [`Job`] is computed in parts. A part is an interval of units. While it runs, a [`Ledger`] holds its counts and appends them to a journal; a
//! finished part becomes a part file. Both identify their run by its hash. The types of the counts are in the
//! [`engine`](lanesweep_engine) and [`sampling`](crate::sampling).

mod folder;
mod job;
mod journal;
mod ledger;
mod sealed;
mod shared_plan;

pub use folder::{Part, read_part, write_part};
pub(crate) use job::units_of;
pub use job::{Computed, EachChunk, Job, JobRun};
pub use journal::{Journal, Records};
pub use ledger::{Counted, Ledger, MergeableCounts};
pub(crate) use sealed::{check_engine, kind_of, read_sealed};
pub use sealed::{read_sealed_line, seal, unseal};
pub(crate) use shared_plan::leave_plan;
pub use shared_plan::{PLAN_FILE, RUN_PLAN_FILE};

use std::ops::Range;
use std::str::FromStr;

/// Shard `index` of `of`, from 0. Shards of one plan cover its units exactly once and differ by one unit at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 0, below [`Shard::of`].
    pub index: u64,
    /// Number of shards, 1 to `Shard::MAX_SHARDS`.
    pub of: u64,
}

/// Indices in the environment of a Kubernetes Indexed Job and of a Slurm job array. Each is the shard's index itself, so
/// that a task that is submitted again alone (`--array=3,7`) computes the same shard.
const INDICES: [&str; 2] = ["JOB_COMPLETION_INDEX", "SLURM_ARRAY_TASK_ID"];

impl Shard {
    /// Maximum number of shards: more than any cluster runs at once.
    const MAX_SHARDS: u64 = 100_000;

    /// The units of this shard, out of `count`.
    pub(crate) fn units(&self, count: u64) -> Range<u64> {
        // 128 bits, because index × count may exceed 64 bits.
        let cut = |index: u64| (u128::from(count) * u128::from(index) / u128::from(self.of)) as u64;
        cut(self.index)..cut(self.index + 1)
    }

    /// File name of its files without the extension: `part-00003-of-00020`.
    fn stem(&self) -> String {
        format!("part-{:05}-of-{:05}", self.index, self.of)
    }

    /// The shard at the beginning of a file name.
    fn of_stem(stem: &str) -> Option<Shard> {
        let (index, of) = stem.strip_prefix("part-")?.split_once("-of-")?;
        let shard = Shard { index: index.parse().ok()?, of: of.parse().ok()? };
        (shard.stem() == stem).then_some(shard)
    }

    /// Parses `i/n`, or `auto/n` with the index that Kubernetes or Slurm sets in `environment`.
    ///
    /// # Errors
    /// A sentence that says what is wrong and what to write.
    fn parse(text: &str, environment: impl Fn(&str) -> Option<String>) -> Result<Shard, String> {
        let form = "write i/n with i from 0 to n - 1, such as 0/20, or auto/n in a Slurm array or an Indexed Job";
        let (index, of) = text.split_once('/').ok_or(form)?;
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| form.to_owned());
        let of = number(of)?;
        let is_auto = index.trim() == "auto";
        let index = if is_auto { from_environment(environment)? } else { number(index)? };
        if of == 0 || of > Self::MAX_SHARDS {
            return Err(format!("there can be 1 to {} shards", Self::MAX_SHARDS));
        }
        if index >= of {
            let last = of - 1;
            let array = if is_auto { ", and so must a Slurm array" } else { "" };
            return Err(format!("there is no shard {index} of {of}: they count from 0 to {last}{array}"));
        }
        Ok(Shard { index, of })
    }
}

fn from_environment(environment: impl Fn(&str) -> Option<String>) -> Result<u64, String> {
    let found = INDICES.into_iter().find_map(|name| Some((name, environment(name)?)));
    let (name, text) = found.ok_or_else(|| format!("auto needs {} in the environment", INDICES.join(" or ")))?;
    text.trim().parse().map_err(|_| format!("{name} is `{text}`, not an index"))
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        Shard::parse(text, |name| std::env::var(name).ok())
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}
