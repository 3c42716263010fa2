//! A run as a Slurm job array: one task per shard, a merge once all are done, and the command that submits both.
//!
//! What ends a task early loses nothing, for a shard keeps a journal and the same command continues it:
//! - the time limit: Slurm sends the batch shell USR1 some time before, the shell sends lanesweep TERM, lanesweep
//!   finishes its chunk and ends with 75, the task goes back to the queue;
//! - a crash (out of memory, a killed process): back to the queue, at most [`MAX_RESTARTS`] times;
//! - a lost node or preemption: Slurm itself puts the task back to the queue (`--requeue`);
//! - `scancel`: the task gets TERM, ends its chunk and stays out of the queue. That is why the time limit is told by
//!   USR1: TERM alone would not say whether the task is to come back.

use std::fmt::Write;

use super::shell::{directive_quoted, log_pattern, shell_quoted};
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
            return Err(Error::usage(Place::item("--array"), problem, format!("use 1 to {MAX_SHARDS}")));
        }
        self.resources.validate()?;
        Ok(Scripts { array: self.array()?, merge: self.merge()?, submit: self.submit()? })
    }

    fn array(&self) -> Result<String> {
        let Resources { cpus, gpu, signal_before_s, .. } = self.resources;
        let mut text = self.head("lanesweep", "%A_%a.log")?;
        directive(&mut text, "array", &format!("0-{}", self.shards - 1));
        directive(&mut text, "cpus-per-task", &cpus.to_string());
        if gpu {
            directive(&mut text, "gres", "gpu:1");
        }
        // To the batch shell alone: lanesweep is no job step, and processes of the shell's own get nothing.
        directive(&mut text, "signal", &format!("B:USR1@{signal_before_s}"));
        let plan = shell_quoted("--out", &format!("{}/plan.json", self.out))?;
        let words = [
            shell_quoted("--program", &self.program)?,
            shell_quoted("the run", self.run.verb())?,
            format!("--plan {plan} --shard \"$SLURM_ARRAY_TASK_ID/{}\" --out {}", self.shards, self.out_quoted()?),
            format!("--backend {} --threads {cpus}", if gpu { "gpu" } else { "cpu" }),
        ];
        text.push_str(ARRAY_HEAD);
        let _ = writeln!(text, "{} &\npid=$!", words.join(" "));
        text.push_str(
            &ARRAY_TAIL.replace("@75@", &STATUS_INTERRUPTED.to_string()).replace("@10@", &MAX_RESTARTS.to_string()),
        );
        Ok(text)
    }

    fn merge(&self) -> Result<String> {
        let mut text = self.head("lanesweep-merge", "merge_%j.log")?;
        directive(&mut text, "cpus-per-task", &self.resources.cpus.to_string());
        let program = shell_quoted("--program", &self.program)?;
        let out = self.out_quoted()?;
        let _ = writeln!(
            text,
            "\n# The result of the whole run, from the parts of all tasks.\nexec {program} cluster merge {out} --threads {}",
            self.resources.cpus
        );
        Ok(text)
    }

    fn submit(&self) -> Result<String> {
        let mut plan = vec![shell_quoted("--program", &self.program)?, self.run.verb().to_owned()];
        for argument in self.run.arguments() {
            plan.push(shell_quoted("the run", argument)?);
        }
        plan.push(format!("--plan-only --out {}", self.out_quoted()?));
        let script = |name: &str| shell_quoted("--scripts", &format!("{}/{name}", self.scripts));
        Ok(format!(
            "#!/usr/bin/env bash\n\
             # Makes the plan and submits the run: {shards} tasks, then their merge. Once more after a task failed, it\n\
             # continues what is unfinished.\n\
             set -euo pipefail\n\
             cd {start}\n\
             # What cannot be run is refused here, before anything is submitted.\n\
             {plan}\n\
             # `sbatch --parsable` writes ID or ID;CLUSTER.\n\
             array=$(sbatch --parsable {array})\n\
             array=${{array%%;*}}\n\
             # Where a task fails for good, there is nothing to merge, and the merge must not wait for ever.\n\
             merge=$(sbatch --parsable --dependency=\"afterok:$array\" --kill-on-invalid-dep=yes {merge})\n\
             merge=${{merge%%;*}}\n\
             echo \"array $array\"\n\
             echo \"merge $merge\"\n",
            shards = self.shards,
            start = shell_quoted("the present folder", &self.start)?,
            plan = plan.join(" "),
            array = script("array.sbatch")?,
            merge = script("merge.sbatch")?,
        ))
    }

    /// First lines of both jobs: what they ask for alike.
    fn head(&self, name: &str, log: &str) -> Result<String> {
        let resources = &self.resources;
        let mut text = String::from("#!/usr/bin/env bash\n");
        directive(&mut text, "job-name", name);
        directive(&mut text, "nodes", "1");
        directive(&mut text, "ntasks", "1");
        directive(&mut text, "time", &resources.time);
        for (option, _, value) in resources.optional() {
            if let Some(value) = value {
                directive(&mut text, option, value);
            }
        }
        text.push_str("#SBATCH --requeue\n");
        directive(&mut text, "open-mode", "append");
        directive(&mut text, "output", &log_pattern("--scripts", &self.scripts, log)?);
        Ok(text)
    }

    fn out_quoted(&self) -> Result<String> {
        shell_quoted("--out", &self.out)
    }
}

impl Resources {
    /// Slurm's option, the flag here, the value.
    fn optional(&self) -> [(&'static str, &'static str, Option<&str>); 4] {
        [
            ("mem", "--mem", self.memory.as_deref()),
            ("partition", "--partition", self.partition.as_deref()),
            ("account", "--account", self.account.as_deref()),
            ("qos", "--qos", self.qos.as_deref()),
        ]
    }

    fn validate(&self) -> Result<()> {
        let wrong = |flag: &str, problem: String, help: &str| Err(Error::usage(Place::item(flag), problem, help));
        if !is_time_limit(&self.time) {
            let help = "write hours:minutes:seconds, minutes, or days-hours, such as 02:00:00, 90 or 1-12";
            return wrong("--time", format!("`{}` is no time limit of Slurm", self.time), help);
        }
        if let Some(memory) = &self.memory {
            let number = memory.strip_suffix(['K', 'M', 'G', 'T']).unwrap_or(memory);
            if !number.parse::<u64>().is_ok_and(|n| n > 0) || !number.bytes().all(|b| b.is_ascii_digit()) {
                let help = "write a whole number with K, M, G or T, such as 4G";
                return wrong("--mem", format!("`{memory}` is no amount of memory of Slurm"), help);
            }
        }
        for (_, flag, value) in self.optional() {
            if let Some(value) = value
                && (value.is_empty() || directive_quoted(flag, value)? != value)
            {
                let help = "use letters, digits and any of _ - . / : , + @ %";
                return wrong(flag, format!("`{value}` holds characters that no name in Slurm has"), help);
            }
        }
        if self.cpus == 0 {
            return wrong("--cpus", "a task needs a processor".to_owned(), "use at least 1");
        }
        // Slurm's own bound.
        if self.signal_before_s == 0 || self.signal_before_s > 65_535 {
            let help = "use 1 to 65535; more than one chunk of lanes takes, some seconds, serves nothing";
            return wrong("--signal-before", format!("{} s cannot be used", self.signal_before_s), help);
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

fn directive(text: &mut String, option: &str, value: &str) {
    let _ = writeln!(text, "#SBATCH --{option}={value}");
}

/// Before the program starts. The traps are set first: a signal in between is not lost.
const ARRAY_HEAD: &str = r#"
# One task is one shard of the run. It may end at any time: the same command continues it.
set -u
task="${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"
restarts=${SLURM_RESTART_COUNT:-0}
pid=
signalled=
cancelled=
# The shell gets the signals: USR1 some time before the time limit, TERM from scancel and preemption.
stop() {
  signalled=1
  if [ -n "$pid" ]; then kill -TERM "$pid" 2>/dev/null; fi
}
trap 'stop' USR1
trap 'cancelled=1; stop' TERM INT
echo "task $task on $(hostname), restart $restarts"
"#;

/// From the start of the program to the end of the task.
const ARRAY_TAIL: &str = r#"
if [ -n "$signalled" ]; then kill -TERM "$pid" 2>/dev/null; fi
# A signal ends `wait` before the program has ended: wait again.
status=127
while :; do
  signalled=
  wait "$pid"
  ended=$?
  # 127: its status has been collected already.
  if [ "$ended" -ne 127 ]; then status=$ended; fi
  if [ -z "$signalled" ]; then break; fi
done

requeue() {
  echo "task $task: status $status, $1; back to the queue"
  scontrol requeue "$task"
}
if [ "$status" -eq 0 ]; then
  echo "task $task: done"
elif [ -n "$cancelled" ]; then
  # Slurm itself brings back what it preempts.
  echo "task $task: status $status, told to end"
elif [ "$status" -eq @75@ ]; then
  requeue "stopped before the time limit"
elif [ "$status" -gt 128 ]; then
  if [ "$restarts" -lt @10@ ]; then
    requeue "ended by signal $((status - 128)), restarts so far: $restarts"
  else
    echo "task $task: status $status, ended by signal $((status - 128)) after $restarts restarts: given up" >&2
  fi
else
  echo "task $task: failed with status $status" >&2
fi
exit "$status"
"#;

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
