//! `lanesweep cluster`: a run over several machines.

use clap::{Args, Subcommand};

use super::Exit;
use super::merge::Merge;
use crate::Result;

/// Split a run over several machines and merge its parts
///
/// `--shard I/N` of `study` and `sample` computes one part. `cluster merge` merges all parts into the result.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  lanesweep study --shard 0/2 --out result\n  lanesweep study --shard 1/2 --out \
                        result\n  lanesweep cluster merge result")]
pub(super) struct Cluster {
    #[command(subcommand)]
    verb: ClusterVerb,
}

#[derive(Debug, Subcommand)]
enum ClusterVerb {
    Merge(Merge),
}

impl Cluster {
    pub(super) fn run(&self) -> Result<Exit> {
        match &self.verb {
            ClusterVerb::Merge(verb) => verb.run(),
        }
    }
}
