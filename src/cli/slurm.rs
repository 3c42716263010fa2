//! `lanesweep cluster slurm`: a run as a Slurm job array.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;

use super::configured::{Configured, command};
use super::{Exit, Verb, console};
use crate::interop::cluster::{Resources, SlurmArray, SplitRun, shell_quoted};
use crate::support::atomic_file::refuse_link;
use crate::support::input_file::{MAX_SETTINGS_BYTES, read_text};
use crate::support::run_dir::OutputDir;
use crate::{Error, Place, Result};

/// Split a run over a Slurm job array
///
/// Writes three scripts: array.sbatch (one task per shard), merge.sbatch (the result of the whole run) and submit.sh,
/// which makes the plan and submits both. Tasks that reach their time limit, crash or lose their node are queued
/// again and resume. All nodes must share --out.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  lanesweep cluster slurm study.toml --array 20 --out result\n  lanesweep cluster slurm --array 20 \
                        --out result --gpus 1 -- sample cut-in-2.json --samples 1e9"
)]
pub struct Slurm {
    /// Study options: short for `-- study --config STUDY.toml`
    #[arg(value_name = "STUDY.toml", conflicts_with = "run", required_unless_present = "run", help_heading = "Data")]
    study: Option<PathBuf>,
    /// The run: study or sample with its arguments
    #[arg(last = true, value_name = "VERB ARGUMENTS", allow_hyphen_values = true, help_heading = "Data")]
    run: Vec<String>,
    /// Tasks; each computes one shard
    #[arg(long, value_name = "N", help_heading = "Run")]
    array: u32,
    /// Folder of the run: plan, parts and the result
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: PathBuf,
    /// Time limit of a task, in Slurm's format
    #[arg(long, value_name = "TIME", default_value = "02:00:00", help_heading = "Run")]
    time: String,
    /// GPUs per task: 1, or none to compute on the CPU
    #[arg(long, value_name = "1|none", default_value = "none", value_parser = ["1", "none"], help_heading = "Run")]
    gpus: String,
    /// Processors per task
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Run")]
    cpus: u32,
    /// Memory per task, such as 4G [default: the cluster's]
    #[arg(long, value_name = "SIZE", help_heading = "Run")]
    mem: Option<String>,
    /// Partition [default: the cluster's]
    #[arg(long, value_name = "NAME", help_heading = "Run")]
    partition: Option<String>,
    /// Account [default: yours]
    #[arg(long, value_name = "NAME", help_heading = "Run")]
    account: Option<String>,
    /// Quality of service [default: the account's]
    #[arg(long, value_name = "NAME", help_heading = "Run", hide_short_help = true)]
    qos: Option<String>,
    /// Time before the limit at which a task gets the stop signal
    #[arg(long, value_name = "SECONDS", default_value_t = 120, help_heading = "Run", hide_short_help = true)]
    signal_before: u32,
    /// Path of the program on the nodes
    #[arg(long, value_name = "PATH", default_value = "lanesweep", help_heading = "Run", hide_short_help = true)]
    program: String,
    /// Folder for scripts and logs [default: slurm in --out]
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    scripts: Option<PathBuf>,
}

impl Slurm {
    pub fn run(&self) -> Result<Exit> {
        let run = self.split_run()?;
        let out = absolute("--out", &self.out)?;
        let scripts = match &self.scripts {
            Some(dir) => absolute("--scripts", dir)?,
            None => format!("{}/slurm", out.trim_end_matches('/')),
        };
        // The job's shell looks up a name without a folder.
        let program = match self.program.contains('/') {
            true => absolute("--program", Path::new(&self.program))?,
            false => self.program.clone(),
        };
        let start = absolute("the present folder", Path::new("."))?;
        let array = SlurmArray { run, shards: self.array, out, scripts, start, program, resources: self.resources() };
        let texts = array.scripts()?;
        check_plan(&array)?;
        let folder = Path::new(&array.scripts);
        if self.scripts.is_none() && folder.exists() && !folder.symlink_metadata().is_ok_and(|about| about.is_dir()) {
            refuse_link(folder)?;
        }
        // submit.sh comes last: if it exists, all scripts are from the same command.
        let run_folder = OutputDir::open(folder, "submit.sh")?;
        let mut results = run_folder.results()?;
        let mut written = String::new();
        for (name, text, what) in [
            ("array.sbatch", &texts.array, format!("{} tasks, one shard each", array.shards)),
            ("merge.sbatch", &texts.merge, "the result of the whole run".to_owned()),
            ("submit.sh", &texts.submit, "makes the plan, submits both".to_owned()),
        ] {
            let path = folder.join(name);
            if name != "submit.sh" {
                results.add(name, text.as_bytes())?;
            }
            written += &format!("{}: {what}\n", path.display());
        }
        results.publish(texts.submit.as_bytes())?;
        let submit = shell_quoted(Place::option("scripts"), &format!("{}/submit.sh", array.scripts))?;
        console::print(&format!("{written}\nSubmit with:\n  bash {submit}\n"))?;
        Ok(Exit::Ok)
    }

    /// The run without the flags that the scripts set.
    fn split_run(&self) -> Result<SplitRun> {
        let words = match &self.study {
            Some(config) => {
                read_text(config, MAX_SETTINGS_BYTES)?;
                vec!["study".to_owned(), "--config".to_owned(), text("STUDY.toml", config)?]
            }
            None => self.run.clone(),
        };
        SplitRun::new(&words)
    }

    fn resources(&self) -> Resources {
        Resources {
            time: self.time.clone(),
            gpu: self.gpus == "1",
            cpus: self.cpus,
            memory: self.mem.clone(),
            partition: self.partition.clone(),
            account: self.account.clone(),
            qos: self.qos.clone(),
            signal_before_s: self.signal_before,
        }
    }
}

/// Checks the planning command as its verb would, so that errors appear here and not on the cluster.
fn check_plan(array: &SlurmArray) -> Result<()> {
    let run = &array.run;
    let own = ["--plan-only", "--out", &array.out];
    let typed = ["lanesweep", run.verb()].into_iter().chain(run.arguments().iter().map(String::as_str));
    let words: Vec<OsString> = typed.chain(own).map(OsString::from).collect();
    let matches = command().try_get_matches_from(words).map_err(|error| {
        let message = error.to_string();
        let problem = message.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
        Error::usage(Place::item("the run"), problem, format!("see lanesweep {} --help", run.verb()))
    })?;
    let (cli, configured) = Configured::of(&matches)?;
    match &cli.verb {
        Verb::Study(study) => study.check(&configured),
        Verb::Sample(sample) => sample.planned(&configured).map(drop),
        _ => Err(Error::Internal(format!("`{}` cannot be split", run.verb()))),
    }
}

/// The absolute path as text, because scripts run elsewhere. Links are not resolved, because nodes may resolve them
/// differently.
fn absolute(flag: &str, path: &Path) -> Result<String> {
    let path = std::path::absolute(path).map_err(|e| Error::io(path, "find", e))?;
    text(flag, &path)
}

fn text(flag: &str, path: &Path) -> Result<String> {
    path.to_str().map(str::to_owned).ok_or_else(|| {
        let problem = format!("`{}` is not UTF-8, which a script must be", path.display());
        Error::usage(Place::item(flag), problem, "rename it, or choose another path")
    })
}
