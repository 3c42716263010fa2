//! The text of the scripts: commands with their flags.
//!
//! Words are quoted so that the shell, or `sbatch` in its `#SBATCH` lines, reads back the same text.

use std::fmt::Write;

use super::slurm::{MAX_RESTARTS, Resources, STATUS_INTERRUPTED, SlurmArray};
use crate::{Error, Place, Result};

impl SlurmArray {
    pub(super) fn array(&self) -> Result<String> {
        let Resources { cpus, gpu, signal_before_s, .. } = self.resources;
        let mut text = self.head("lanesweep", "%A_%a.log")?;
        directive(&mut text, "array", &format!("0-{}", self.shards - 1));
        directive(&mut text, "cpus-per-task", &cpus.to_string());
        if gpu {
            directive(&mut text, "gres", "gpu:1");
        }
        // Only to the batch shell: lanesweep is not a job step, and the shell's own processes get no signal.
        directive(&mut text, "signal", &format!("B:USR1@{signal_before_s}"));
        let plan = shell_quoted(Place::option("out"), &format!("{}/plan.json", self.out))?;
        let words = [
            shell_quoted(Place::option("program"), &self.program)?,
            shell_quoted(Place::item("the run"), self.run.verb())?,
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

    pub(super) fn merge(&self) -> Result<String> {
        let mut text = self.head("lanesweep-merge", "merge_%j.log")?;
        directive(&mut text, "cpus-per-task", &self.resources.cpus.to_string());
        let program = shell_quoted(Place::option("program"), &self.program)?;
        let out = self.out_quoted()?;
        let _ = writeln!(
            text,
            "\n# The result of the whole run, from the parts of all tasks.\nexec {program} cluster merge {out} --threads {}",
            self.resources.cpus
        );
        Ok(text)
    }

    pub(super) fn submit(&self) -> Result<String> {
        let mut plan = vec![shell_quoted(Place::option("program"), &self.program)?, self.run.verb().to_owned()];
        for argument in self.run.arguments() {
            plan.push(shell_quoted(Place::item("the run"), argument)?);
        }
        plan.push(format!("--plan-only --out {}", self.out_quoted()?));
        let script = |name: &str| shell_quoted(Place::option("scripts"), &format!("{}/{name}", self.scripts));
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
            start = shell_quoted(Place::item("the present folder"), &self.start)?,
            plan = plan.join(" "),
            array = script("array.sbatch")?,
            merge = script("merge.sbatch")?,
        ))
    }

    /// First lines of both jobs: their common resources.
    fn head(&self, name: &str, log: &str) -> Result<String> {
        let resources = &self.resources;
        let mut text = String::from("#!/usr/bin/env bash\n");
        directive(&mut text, "job-name", name);
        directive(&mut text, "nodes", "1");
        directive(&mut text, "ntasks", "1");
        directive(&mut text, "time", &resources.time);
        for (option, value) in resources.optional() {
            if let Some(value) = value {
                directive(&mut text, option, value);
            }
        }
        text.push_str("#SBATCH --requeue\n");
        directive(&mut text, "open-mode", "append");
        directive(&mut text, "output", &log_pattern(Place::option("scripts"), &self.scripts, log)?);
        Ok(text)
    }

    fn out_quoted(&self) -> Result<String> {
        shell_quoted(Place::option("out"), &self.out)
    }
}

fn directive(text: &mut String, option: &str, value: &str) {
    let _ = writeln!(text, "#SBATCH --{option}={value}");
}

/// Before the program starts. The traps are set first, so that no signal in between is lost.
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

/// Characters without a special meaning for the shell or `sbatch` anywhere in a word. `=` is excluded, because before a
/// command it is an assignment.
fn is_plain(c: char) -> bool {
    c.is_ascii_alphanumeric() || "_-./:,+@%".contains(c)
}

/// Quotes a word for a POSIX shell: unchanged if nothing in it is special, else in single quotes. For commands in
/// messages.
pub fn quoted_word(word: &str) -> String {
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// Like [`quoted_word`], for a word of a script.
///
/// # Errors
/// [`Error::Usage`] naming `place` for control characters (including line breaks), which people could not read in a
/// script.
pub fn shell_quoted(place: Place, word: &str) -> Result<String> {
    refuse_control(place, word)?;
    Ok(quoted_word(word))
}

/// Quotes the value of an option in an `#SBATCH` line by the rules of `sbatch`: in double quotes, with a backslash
/// before quotes and backslashes; `$` and `` ` `` have no meaning there.
///
/// # Errors
/// [`Error::Usage`] naming `place` for control characters.
pub(super) fn directive_quoted(place: Place, value: &str) -> Result<String> {
    refuse_control(place, value)?;
    if !value.is_empty() && value.chars().all(is_plain) {
        return Ok(value.to_owned());
    }
    Ok(format!("\"{}\"", value.replace('\\', r"\\").replace('"', "\\\"")))
}

/// A file name pattern of `sbatch` in a folder: `name` keeps its `%` (`%A`, `%a`, `%j`); those of the folder are
/// escaped.
///
/// # Errors
/// [`Error::Usage`] for a folder with control characters, or with a backslash, which disables Slurm's patterns.
fn log_pattern(place: Place, folder: &str, name: &str) -> Result<String> {
    if folder.contains('\\') {
        let problem =
            format!("Slurm cannot write logs to `{folder}`: a backslash in a path ends its file name patterns");
        return Err(Error::usage(place, problem, "choose a folder without a backslash in its path"));
    }
    directive_quoted(place, &format!("{}/{name}", folder.replace('%', "%%")))
}

fn refuse_control(place: Place, word: &str) -> Result<()> {
    if word.chars().any(char::is_control) {
        let problem = format!("`{}` holds a line break or another control character", word.escape_debug());
        return Err(Error::usage(place, problem, "write it without; a file can be renamed"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_words_stay_readable() {
        for word in ["study", "--config", "a/b-1.toml", "paper,0.4", "64+1", "user@host:x", "50%"] {
            assert_eq!(shell_quoted(Place::item("x"), word).unwrap(), word);
            assert_eq!(directive_quoted(Place::item("x"), word).unwrap(), word);
        }
    }

    #[test]
    fn the_shell_reads_back_what_was_meant() {
        let words = [
            "", " ", "my data", "it's", "\"", "$HOME", "`id`", "$(id)", "a\\", "a;b", "*", "~", "x=1", "#", "!", "ä",
            "&", "'",
        ];
        for word in words {
            let quoted = shell_quoted(Place::item("x"), word).unwrap();
            let echoed = std::process::Command::new("sh").args(["-c", &format!("printf %s {quoted}")]).output();
            assert_eq!(String::from_utf8(echoed.unwrap().stdout).unwrap(), word, "{quoted}");
        }
    }

    #[test]
    fn line_breaks_are_refused_with_the_option() {
        for word in ["a\nb", "a\rb", "\t", "a\0b", "\u{1b}[0m"] {
            let error = shell_quoted(Place::option("out"), word).unwrap_err();
            assert!(matches!(error, Error::Usage { .. }));
            assert!(error.to_string().starts_with("option `out`: "), "{error}");
            assert!(directive_quoted(Place::option("out"), word).is_err());
        }
    }

    #[test]
    fn directives_follow_sbatch() {
        assert_eq!(directive_quoted(Place::item("x"), "my data").unwrap(), "\"my data\"");
        assert_eq!(directive_quoted(Place::item("x"), "a\"b\\c").unwrap(), r#""a\"b\\c""#);
        assert_eq!(log_pattern(Place::item("x"), "/out/slurm", "%A_%a.log").unwrap(), "/out/slurm/%A_%a.log");
        assert_eq!(log_pattern(Place::item("x"), "/my 50%", "%A.log").unwrap(), "\"/my 50%%/%A.log\"");
        assert!(log_pattern(Place::option("out"), "/a\\b", "%A.log").unwrap_err().to_string().contains("backslash"));
    }
}
