//! `lanesweep cluster`: a run over several machines.

use clap::{Args, Subcommand};

use super::Output;
use super::arguments::{Arguments, FromArguments};
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

impl FromArguments for Cluster {
    fn from_arguments(arguments: &mut Arguments) -> Result<Cluster> {
        Ok(Cluster { verb: ClusterVerb::Merge(Merge::from_arguments(arguments)?) })
    }
}

impl Cluster {
    pub(super) fn run(&self) -> Result<Output> {
        let ClusterVerb::Merge(verb) = &self.verb;
        verb.run()
    }
}
