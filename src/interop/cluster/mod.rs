//! Runs on the machines of a cluster: the scripts that its workload manager takes.
//!
//! Here live text and the quoting that keeps it safe. Nothing here starts a process or knows a lane: a shard, its
//! part file and the merge belong to the verbs that the scripts call.

mod shell;
mod slurm;
mod slurm_text;

pub use shell::{quoted_word, shell_quoted};
pub use slurm::{Resources, Scripts, SlurmArray, SplitRun};
