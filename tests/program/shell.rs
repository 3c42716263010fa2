//! Completions and manual pages: for every shell and every verb, and a reader that goes away is no error.
#![cfg(unix)]

use std::io::Read;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn lanesweep(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lanesweep")).current_dir(dir).args(args).output().unwrap()
}

fn text(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// The verbs as the program's own help lists them.
fn verbs(dir: &Path) -> Vec<String> {
    let help = text(&lanesweep(dir, &["--help"]));
    let lines = help.lines().take_while(|line| !line.starts_with("Example"));
    let verbs =
        lines.filter(|line| line.starts_with("  ") && line[2..].starts_with(|first: char| first.is_ascii_lowercase()));
    let verbs: Vec<String> = verbs.filter_map(|line| line.split_whitespace().next().map(str::to_owned)).collect();
    assert!(verbs.len() >= 10 && verbs.len() <= 17, "{help}");
    verbs
}

#[test]
fn completions_of_every_shell_know_every_verb_and_bash_can_read_its_own() {
    let dir = tempfile::tempdir().unwrap();
    let verbs = verbs(dir.path());
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = text(&lanesweep(dir.path(), &["config", "completions", shell]));
        for verb in verbs.iter().filter(|verb| *verb != "help") {
            assert!(script.contains(verb.as_str()), "{shell}: {verb}");
        }
        if shell == "bash" {
            let path = dir.path().join("completions");
            std::fs::write(&path, script).unwrap();
            assert!(Command::new("bash").arg("-n").arg(&path).status().unwrap().success());
        }
    }
    assert_eq!(lanesweep(dir.path(), &["config", "completions", "tcsh"]).status.code(), Some(2));
}

#[test]
fn every_verb_has_a_manual_page() {
    let dir = tempfile::tempdir().unwrap();
    text(&lanesweep(dir.path(), &["config", "man", "man1"]));
    for verb in verbs(dir.path()).iter().filter(|verb| *verb != "help") {
        let page = std::fs::read_to_string(dir.path().join(format!("man1/lanesweep-{verb}.1"))).unwrap();
        assert!(page.contains(".SH NAME") && page.contains(".SH SYNOPSIS") && page.contains(".SH RUN"), "{verb}");
        assert!(page.contains("Example"), "{verb} has no example");
    }
    assert!(dir.path().join("man1/lanesweep.1").exists());
}

#[test]
fn the_help_of_every_verb_says_what_it_is_for_and_ends_with_an_example() {
    let dir = tempfile::tempdir().unwrap();
    for verb in verbs(dir.path()).iter().filter(|verb| *verb != "help") {
        let help = text(&lanesweep(dir.path(), &[verb, "--help"]));
        assert!(help.lines().next().is_some_and(|line| line.len() > 15), "{verb}: {help}");
        let (_, examples) = help.split_once("\nExample").unwrap_or_else(|| panic!("{verb} ends with no example"));
        assert!(examples.contains(&format!("lanesweep {verb}")), "{verb}: {examples}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let dir = tempfile::tempdir().unwrap();
    for args in
        [&["--help"][..], &["config", "completions", "zsh"], &["study", "--synth-recordings", "1", "--backend", "cpu"]]
    {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lanesweep"));
        let mut child =
            command.current_dir(dir.path()).args(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{args:?}: {said}");
        assert!(!said.contains("panicked"), "{said}");
    }
}

#[test]
fn the_short_help_of_every_verb_fits_on_one_screen_below_headings() {
    let dir = tempfile::tempdir().unwrap();
    let inner = ["export xosc", "config show"];
    let help = text(&lanesweep(dir.path(), &["-h"]));
    assert!(help.lines().count() <= 40, "{help}");
    for verb in verbs(dir.path()).iter().map(String::as_str).chain(inner) {
        let words: Vec<&str> = verb.split(' ').chain(["-h"]).collect();
        let help = text(&lanesweep(dir.path(), &words));
        assert!(help.lines().count() <= 40, "{verb}: {} lines\n{help}", help.lines().count());
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
