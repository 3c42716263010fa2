//! A run as a Slurm job array: one task per shard, a merge once all are done, and the command that submits both.
//!
//! What ends a task early loses nothing, for a shard keeps a journal and the same command continues it:
//! - the time limit: Slurm sends the batch shell USR1 some time before, the shell sends lanesweep TERM, lanesweep
//!   finishes its chunk and ends with 75, the task goes back to the queue;
//! - a crash (out of memory, a killed process): back to the queue, at most [`MAX_RESTARTS`] times;
//! - a lost node or preemption: Slurm itself puts the task back to the queue (`--requeue`);
//! - `scancel`: the task gets TERM, ends its chunk and stays out of the queue. That is why the time limit is told by
//!   USR1: TERM alone would not say whether the task is to come back.

use super::shell::directive_quoted;
use super::split_run::SplitRun;
use crate::{Error, Place, Result};

/// Exit status of a run that was told to stop: complete so far, to be continued by the same command.
pub const STATUS_INTERRUPTED: u8 = 75;
/// Restarts of a task, for whatever reason, after which a crash ends it for good.
pub const MAX_RESTARTS: u32 = 10;
/// Shards at most: their numbers have five digits.
pub const MAX_SHARDS: u32 = 99_999;

/// What each task asks Slurm for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Resources {
    /// Time limit as Slurm writes it, such as `02:00:00` or `1-12`.
    pub time: String,
    /// Whether each task gets a GPU and computes on it.
    pub gpu: bool,
    /// Processors per task, at least 1.
    pub cpus: u32,
    /// Memory per task as Slurm writes it, such as `4G`; else the cluster's default.
    pub memory: Option<String>,
    /// Partition; else the cluster's default.
    pub partition: Option<String>,
    /// Account; else the user's default.
    pub account: Option<String>,
    /// Quality of service; else the account's default.
    pub qos: Option<String>,
    /// How long before the time limit a task is told to stop, s.
    pub signal_before_s: u32,
}

/// A run split over a job array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlurmArray {
    /// The run.
    pub run: SplitRun,
    /// Tasks of the array, 1 to 99,999.
    pub shards: u32,
    /// Folder of the run, absolute: nodes share it.
    pub out: String,
    /// Folder of scripts and logs, absolute.
    pub scripts: String,
    /// Folder that relative paths of the run's arguments start from, absolute.
    pub start: String,
    /// The program, as a job finds it.
    pub program: String,
    /// What each task asks for.
    pub resources: Resources,
}

/// The text of the three scripts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scripts {
    /// `array.sbatch`: one shard.
    pub array: String,
    /// `merge.sbatch`: the result of the whole run.
    pub merge: String,
    /// `submit.sh`: the plan, then both jobs.
    pub submit: String,
}

impl SlurmArray {
    /// The scripts.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the flag for a value that Slurm would not take or that cannot be quoted.
    pub fn scripts(&self) -> Result<Scripts> {
        if self.shards == 0 || self.shards > MAX_SHARDS {
            let problem = format!("{} tasks cannot be numbered", self.shards);
            return Err(Error::usage(Place::option("array"), problem, format!("use 1 to {MAX_SHARDS}")));
        }
        self.resources.validate()?;
        Ok(Scripts { array: self.array()?, merge: self.merge()?, submit: self.submit()? })
    }
}

impl Resources {
    /// Options with the names that Slurm and we give them, and their values.
    pub(super) fn optional(&self) -> [(&'static str, Option<&str>); 4] {
        [
            ("mem", self.memory.as_deref()),
            ("partition", self.partition.as_deref()),
            ("account", self.account.as_deref()),
            ("qos", self.qos.as_deref()),
        ]
    }

    fn validate(&self) -> Result<()> {
        let wrong =
            |option: &'static str, problem: String, help: &str| Err(Error::usage(Place::option(option), problem, help));
        if !is_time_limit(&self.time) {
            let help = "write hours:minutes:seconds, minutes, or days-hours, such as 02:00:00, 90 or 1-12";
            return wrong("time", format!("`{}` is no time limit of Slurm", self.time), help);
        }
        if let Some(memory) = &self.memory {
            let number = memory.strip_suffix(['K', 'M', 'G', 'T']).unwrap_or(memory);
            if !number.parse::<u64>().is_ok_and(|n| n > 0) || !number.bytes().all(|b| b.is_ascii_digit()) {
                let help = "write a whole number with K, M, G or T, such as 4G";
                return wrong("mem", format!("`{memory}` is no amount of memory of Slurm"), help);
            }
        }
        for (option, value) in self.optional() {
            if let Some(value) = value
                && (value.is_empty() || directive_quoted(Place::option(option), value)? != value)
            {
                let help = "use letters, digits and any of _ - . / : , + @ %";
                return wrong(option, format!("`{value}` holds characters that no name in Slurm has"), help);
            }
        }
        if self.cpus == 0 {
            return wrong("cpus", "a task needs a processor".to_owned(), "use at least 1");
        }
        // Slurm's own bound.
        if self.signal_before_s == 0 || self.signal_before_s > 65_535 {
            let help = "use 1 to 65535; more than one chunk of lanes takes, some seconds, serves nothing";
            return wrong("signal_before", format!("{} s cannot be used", self.signal_before_s), help);
        }
        Ok(())
    }
}

/// `minutes[:seconds]`, `hours:minutes:seconds`, `days-hours[:minutes[:seconds]]`, and not nothing at all.
fn is_time_limit(text: &str) -> bool {
    let (days, rest) = text.split_once('-').map_or((None, text), |(days, rest)| (Some(days), rest));
    let parts: Vec<&str> = days.into_iter().chain(rest.split(':')).collect();
    let digits = parts.iter().all(|part| (1..=6).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit()));
    digits && rest.split(':').count() <= 3 && text.bytes().any(|b| (b'1'..=b'9').contains(&b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_limits_as_slurm_writes_them() {
        for text in ["90", "90:30", "02:00:00", "1-12", "1-12:30", "1-00:00:30"] {
            assert!(is_time_limit(text), "{text}");
        }
        for text in ["", "0", "00:00:00", "2h", "1:2:3:4", "1-", "-1", "1-2-3", ":30", "02:00:00 --uid=0"] {
            assert!(!is_time_limit(text), "{text}");
        }
    }
}
