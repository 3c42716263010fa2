//! A run as a Slurm job array: one task per shard, a merge once all are done, and the command that submits both.
//!
//! Nothing is lost if a task ends early, because a shard keeps a journal and the same command resumes it:
//! - the time limit: Slurm sends USR1 to the batch shell before it, the shell sends TERM to lanesweep, lanesweep
//!   finishes its chunk and ends with 75, and the task is requeued;
//! - a crash (out of memory, a killed process): the task is requeued, at most [`MAX_RESTARTS`] times;
//! - a lost node or preemption: Slurm itself requeues the task (`--requeue`);
//! - `scancel`: the task gets TERM, ends its chunk and is not requeued. The time limit therefore uses USR1: TERM alone
//!   would not say whether to requeue.
//!
//! [`SplitRun`] is the run of all tasks: its verb and arguments, without those that the scripts add.

use super::shell::directive_quoted;
use crate::{Error, Place, Result};

/// Exit status of an interrupted run: its progress is saved, and the same command resumes it.
pub const STATUS_INTERRUPTED: u8 = 75;
/// Maximum number of restarts of a task for any reason; after them a crash is final.
pub const MAX_RESTARTS: u32 = 10;
/// Maximum number of shards: their numbers have five digits.
pub const MAX_SHARDS: u32 = 99_999;

/// Resources of each task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Resources {
    /// Time limit in Slurm's format, such as `02:00:00` or `1-12`.
    pub time: String,
    /// Whether each task gets a GPU and computes on it.
    pub gpu: bool,
    /// Processors per task, at least 1.
    pub cpus: u32,
    /// Memory per task in Slurm's format, such as `4G`; `None`: the cluster's default.
    pub memory: Option<String>,
    /// Partition; `None`: the cluster's default.
    pub partition: Option<String>,
    /// Account; `None`: the user's default.
    pub account: Option<String>,
    /// Quality of service; `None`: the account's default.
    pub qos: Option<String>,
    /// Time before the time limit at which a task gets the stop signal, s.
    pub signal_before_s: u32,
}

/// A run split over a job array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlurmArray {
    /// The run.
    pub run: SplitRun,
    /// Tasks of the array, 1 to 99,999.
    pub shards: u32,
    /// Folder of the run, absolute; all nodes access it.
    pub out: String,
    /// Folder of scripts and logs, absolute.
    pub scripts: String,
    /// Base folder of relative paths in the run's arguments, absolute.
    pub start: String,
    /// Path of the program in a job.
    pub program: String,
    /// Resources of each task.
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
    /// Builds the scripts.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the flag, for a value that Slurm would refuse or that cannot be quoted.
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
    /// Optional values, with Slurm's names and ours.
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
        // Slurm's own limit.
        if self.signal_before_s == 0 || self.signal_before_s > 65_535 {
            let help = "use 1 to 65535; more than one chunk of lanes takes, some seconds, serves nothing";
            return wrong("signal_before", format!("{} s cannot be used", self.signal_before_s), help);
        }
        Ok(())
    }
}

/// Whether a text is `minutes[:seconds]`, `hours:minutes:seconds` or `days-hours[:minutes[:seconds]]`, and above zero.
fn is_time_limit(text: &str) -> bool {
    let (days, rest) = text.split_once('-').map_or((None, text), |(days, rest)| (Some(days), rest));
    let parts: Vec<&str> = days.into_iter().chain(rest.split(':')).collect();
    let digits = parts.iter().all(|part| (1..=6).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit()));
    digits && rest.split(':').count() <= 3 && text.bytes().any(|b| (b'1'..=b'9').contains(&b))
}

/// Verbs whose lanes can be split over tasks.
const VERBS: [&str; 2] = ["study", "sample"];

/// Options that the scripts set for the run, each with what to write instead.
const TAKEN: [(&str, &str); 8] = [
    ("shard", "leave it out: option `array` says into how many shards the run is split"),
    ("out", "give option `out = DIR` before the `--`: the folder belongs to all tasks"),
    ("plan", "leave it out: submit.sh makes the plan and each task runs from it"),
    ("plan_only", "leave it out: submit.sh makes the plan"),
    ("stop_after", "leave it out: Slurm tells each task in time (option `time`, option `signal_before`)"),
    ("threads", "give option `cpus = N` before the `--`: each task uses the processors that Slurm gives it"),
    ("backend", "give option `gpus = 1` or option `gpus = none` before the `--`"),
    ("device", "leave it out: each task uses the GPU that Slurm gives it (option `gpus = 1`)"),
];

/// A run that can be split: `study` or `sample` with its own arguments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SplitRun {
    verb: String,
    arguments: Vec<String>,
}

impl SplitRun {
    /// From verb and arguments as typed.
    ///
    /// # Errors
    /// [`Error::Usage`] if the verb is missing or cannot be split, or if a flag is set by the scripts.
    pub fn new(words: &[String]) -> Result<SplitRun> {
        let verbs = "study and sample are the verbs that can be split; example: -- sample cut-in-2.json";
        let Some((verb, arguments)) = words.split_first() else {
            return Err(Error::usage(Place::item("the run"), "there is none", verbs));
        };
        if !VERBS.contains(&verb.as_str()) {
            return Err(Error::usage(Place::item("the run"), format!("`{verb}` cannot be split over tasks"), verbs));
        }
        for argument in arguments {
            let Some(flag) = argument.strip_prefix("--") else { continue };
            let name = flag.split_once('=').map_or(flag, |(name, _)| name).replace('-', "_");
            if let Some((option, help)) = TAKEN.iter().find(|(option, _)| *option == name) {
                let problem = format!("option `{option}` cannot be given after the `--`");
                return Err(Error::usage(Place::item("the run"), problem, *help));
            }
        }
        Ok(SplitRun { verb: verb.clone(), arguments: arguments.to_vec() })
    }

    /// `study` or `sample`.
    pub fn verb(&self) -> &str {
        &self.verb
    }

    /// The arguments after the verb.
    pub fn arguments(&self) -> &[String] {
        &self.arguments
    }
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

    fn run(words: &str) -> Result<SplitRun> {
        SplitRun::new(&words.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn study_and_sample_can_be_split_and_nothing_else() {
        assert_eq!(run("study --config a.toml").unwrap().arguments(), ["--config", "a.toml"]);
        assert_eq!(run("sample a.json").unwrap().verb(), "sample");
        for words in ["", "mine data", "compare a b", "--samples 10"] {
            assert!(matches!(run(words), Err(Error::Usage { .. })), "{words}");
        }
    }

    #[test]
    fn what_the_scripts_give_is_refused_in_both_spellings() {
        for (option, _) in TAKEN {
            let flag = option.replace('_', "-");
            for words in [format!("study --{flag} x"), format!("sample a.json --{flag}=x")] {
                let problem = run(&words).unwrap_err().to_string();
                assert!(problem.contains(&format!("option `{option}` cannot be given")), "{words}: {problem}");
            }
        }
        run("study --rows x.csv --seed 3").unwrap();
    }
}
