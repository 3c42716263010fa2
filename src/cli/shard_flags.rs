//! Flags of verbs that can be split and resumed.

use std::path::{Path, PathBuf};

use clap::Args;

use lanesweep_run::parts::Shard;
use lanesweep_support::Result;
use lanesweep_support::files::check_folder;
use lanesweep_support::run_folder::RunFolder;

/// Flags of every verb that can be split.
#[derive(Debug, Clone, Args)]
pub(super) struct ShardFlags {
    /// Compute shard I of N (from 0); `merge` merges them
    ///
    /// The part is written to --out. `auto/N` takes I from a Kubernetes Indexed Job or a Slurm array.
    #[arg(long, value_name = "I/N", help_heading = "Run")]
    pub shard: Option<Shard>,
    /// Run a plan that --plan-only wrote
    #[arg(long, value_name = "FILE", conflicts_with = "plan_only", help_heading = "Run")]
    pub plan: Option<PathBuf>,
    /// Write the plan, plan.json in --out, and stop
    #[arg(long, conflicts_with = "shard", help_heading = "Run")]
    pub plan_only: bool,
}

impl ShardFlags {
    /// Whether this is not a run in one piece.
    pub(super) fn is_split(&self) -> bool {
        self.plan_only || self.shard.is_some()
    }

    /// Checks the folder before the work: parts share it, a run in one piece has it alone.
    pub(super) fn check_folder(&self, out: &Path, record: &'static str) -> Result<()> {
        if self.is_split() { check_folder(out) } else { RunFolder::open(out, record).map(drop) }
    }
}
