//! The run that an array of tasks shares: its verb and arguments, without what the scripts add themselves.

use crate::{Error, Place, Result};

/// Verbs whose lanes can be split over tasks.
const VERBS: [&str; 2] = ["study", "sample"];

/// Options that the scripts give the run, each with what to write instead.
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
    /// [`Error::Usage`] where the verb is missing or cannot be split, or where a flag is the scripts' own.
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

    /// What follows the verb.
    pub fn arguments(&self) -> &[String] {
        &self.arguments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
