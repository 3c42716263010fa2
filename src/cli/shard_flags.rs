//! Flags of verbs that can be split and resumed.

use std::path::PathBuf;

use clap::Args;

use lanesweep_run::parts::Shard;

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
