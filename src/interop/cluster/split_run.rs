//! The run that an array of tasks shares: its verb and arguments, without what the scripts add themselves.

use crate::{Error, Place, Result};

/// Verbs whose lanes can be split over tasks.
const VERBS: [&str; 2] = ["study", "sample"];

/// Flags that the scripts give the run, each with what to write instead.
const TAKEN: [(&str, &str); 8] = [
    ("--shard", "leave it out: --array says into how many shards the run is split"),
    ("--out", "give --out DIR before the `--`: the folder belongs to all tasks"),
    ("--plan", "leave it out: submit.sh makes the plan and each task runs from it"),
    ("--plan-only", "leave it out: submit.sh makes the plan"),
    ("--stop-after", "leave it out: Slurm tells each task in time (--time, --signal-before)"),
    ("--threads", "give --cpus N before the `--`: each task uses the processors that Slurm gives it"),
    ("--backend", "give --gpus 1 or --gpus none before the `--`"),
    ("--device", "leave it out: each task uses the GPU that Slurm gives it (--gpus 1)"),
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
        let verbs =
            "study and sample are the verbs that can be split; example: -- sample cut-in-2.json --samples 1000000";
        let Some((verb, arguments)) = words.split_first() else {
            return Err(Error::usage(Place::item("the run"), "there is none", verbs));
        };
        if !VERBS.contains(&verb.as_str()) {
            return Err(Error::usage(Place::item("the run"), format!("`{verb}` cannot be split over tasks"), verbs));
        }
        for argument in arguments {
            let name = argument.split_once('=').map_or(argument.as_str(), |(name, _)| name);
            if let Some((flag, help)) = TAKEN.iter().find(|(flag, _)| *flag == name) {
                return Err(Error::usage(
                    Place::item("the run"),
                    format!("{flag} cannot be given after the `--`"),
                    *help,
                ));
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
        for (flag, _) in TAKEN {
            for words in [format!("study {flag} x"), format!("sample a.json {flag}=x")] {
                assert!(run(&words).unwrap_err().to_string().contains(&format!("{flag} cannot be given")), "{words}");
            }
        }
        run("study --lanes x.csv --seed 3").unwrap();
    }
}
