//! Runs on a cluster: the scripts for its workload manager.
//!
//! This module builds text and quotes it safely. It starts no process and knows no lanes: the verbs that the scripts
//! call handle shards, part files and the merge.

mod shell;
mod slurm;
mod slurm_text;

pub use shell::{quoted_word, shell_quoted};
pub use slurm::{Resources, Scripts, SlurmArray, SplitRun};
