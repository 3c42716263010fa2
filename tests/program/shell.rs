//! Completions, manual pages and help: for every shell and every verb.
#![cfg(unix)]

use std::path::Path;
use std::process::Command;

use crate::common::program::{ran, refused};

/// The verbs of the program, or those of one of its verbs, as its own help lists them.
pub fn verbs_of(verb: &str) -> Vec<String> {
    let help = ran(Path::new("."), &format!("{verb} --help"));
    let lines = help.lines().take_while(|line| !line.starts_with("Example"));
    let verbs =
        lines.filter(|line| line.starts_with("  ") && line[2..].starts_with(|first: char| first.is_ascii_lowercase()));
    verbs.filter_map(|line| line.split_whitespace().next()).filter(|verb| *verb != "help").map(str::to_owned).collect()
}

pub fn verbs() -> Vec<String> {
    let verbs = verbs_of("");
    assert!(verbs.len() >= 10 && verbs.len() <= 16, "{verbs:?}");
    verbs
}

#[test]
fn completions_of_every_shell_know_every_verb_and_bash_can_read_its_own() {
    let dir = tempfile::tempdir().unwrap();
    let verbs = verbs();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = ran(dir.path(), &format!("config completions {shell}"));
        for verb in &verbs {
            assert!(script.contains(verb.as_str()), "{shell}: {verb}");
        }
        if shell == "bash" {
            let path = dir.path().join("completions");
            std::fs::write(&path, script).unwrap();
            assert!(Command::new("bash").arg("-n").arg(&path).status().unwrap().success());
        }
    }
    refused(dir.path(), "config completions tcsh", 2, "");
}

#[test]
fn the_help_of_every_verb_says_what_it_is_for_and_ends_with_an_example() {
    for verb in verbs() {
        let help = ran(Path::new("."), &format!("{verb} --help"));
        assert!(help.lines().next().is_some_and(|line| line.len() > 15), "{verb}: {help}");
        let (_, examples) = help.split_once("\nExample").unwrap_or_else(|| panic!("{verb} ends with no example"));
        assert!(examples.contains(&format!("lanesweep {verb}")), "{verb}: {examples}");
    }
}

#[test]
fn the_short_help_of_every_verb_fits_in_24_lines_below_headings() {
    let inner = ["config show"];
    let help = ran(Path::new("."), "-h");
    assert!(help.lines().count() <= 27, "{help}");
    for verb in verbs().iter().map(String::as_str).chain(inner) {
        let help = ran(Path::new("."), &format!("{verb} -h"));
        assert!(help.lines().count() <= 24, "{verb}: {} lines\n{help}", help.lines().count());
        assert!(!help.contains("\nOptions:"), "a flag of {verb} has no heading\n{help}");
        let (flags, examples) = help.split_once("\nExample").unwrap_or((&help, ""));
        let commands = examples.replace("\\\n", "");
        // A verb below it has flags of its own, and what is behind `--` is another command.
        let is_of = |line: &&str| {
            let inner = line.split_once(&format!("lanesweep {verb} ")).and_then(|(_, rest)| rest.split(' ').next());
            inner.is_some_and(|inner| !flags.contains(&format!("\n  {inner} ")))
        };
        let own = commands.lines().filter(is_of).filter_map(|line| line.split(" -- ").next());
        for flag in own.flat_map(str::split_whitespace).filter(|word| word.starts_with("--")) {
            let is_listed = flags.split([' ', ',', '\n']).any(|word| word == flag);
            assert!(is_listed, "an example of {verb} uses {flag}, which -h does not list\n{help}");
        }
        // What is pasted is one command: a line that goes on ends with a backslash.
        let lines: Vec<&str> = examples.lines().skip(1).collect();
        for pair in lines.windows(2).filter(|pair| !pair[1].starts_with("  lanesweep ")) {
            assert!(pair[0].ends_with(" \\"), "{verb}: `{}` goes on without a backslash", pair[0]);
        }
    }
}
