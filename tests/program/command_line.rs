//! The program as its users run it: help, exit codes, limits. What it answers stands in `tests/messages`.

use std::path::Path;

use crate::common;
use crate::common::program::{self, ran};

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
fn the_short_help_of_every_verb_fits_in_24_lines_below_headings() {
    let help = ran(Path::new("."), "-h");
    assert!(help.lines().count() <= 27, "{help}");
    for verb in verbs().iter().map(String::as_str).chain(["config show"]) {
        let help = ran(Path::new("."), &format!("{verb} -h"));
        assert!(help.lines().count() <= 24, "{verb}: {} lines\n{help}", help.lines().count());
        assert!(!help.contains("\nOptions:"), "a flag of {verb} has no heading\n{help}");
        let (flags, examples) = help.split_once("\nExample").unwrap_or_else(|| panic!("{verb} ends with no example"));
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

#[test]
fn help_names_every_verb_and_every_exit_code() {
    let help = ran(Path::new("."), "--help");
    for word in ["study", "mine", "tracks", "simulate", "verify", "merge", "Exit codes"] {
        assert!(help.contains(word), "{word}");
    }
    for (exit, meaning) in lanesweep::cli::Exit::ALL {
        assert!(help.contains(meaning), "{exit:?}");
    }
    let chapter = include_str!("../../docs/src/tables.md");
    for code in lanesweep::cli::Exit::ALL.map(|(exit, _)| exit.code()).into_iter().chain([129, 130, 143]) {
        assert!(help.lines().any(|line| line.trim_start().starts_with(&format!("{code}  "))), "{code}: {help}");
        assert!(chapter.contains(&format!("\n| {code} | ")), "the chapter on exit codes has no {code}");
    }
}

#[cfg(target_os = "linux")]
fn limited(limit: &str, line: &str) -> (i32, String) {
    let (code, _, err) = program::limited(Path::new("."), &format!("ulimit {limit}"), &program::words(line));
    (code, program::unbroken(err.as_bytes()))
}

#[cfg(target_os = "linux")]
#[test]
fn an_address_space_that_is_too_small_is_told_with_its_limit_and_is_no_crash() {
    // Below, the system's loader does not get as far as the program.
    let is_loaded = |kib: &u32| limited(&format!("-v {kib}"), "--version").0 == 0;
    let mut limits = (20_000..400_000).step_by(1000).skip_while(|kib| !is_loaded(kib)).step_by(2).take(25);
    let (mut done, mut refused) = (0, 0);
    assert!(limits.all(|kib| {
        let case = "--category cut-in --ego-speed 30m/s --speed 20m/s --lateral-speed 1.5 --models Reg157 --thw 1";
        let (code, said) = limited(&format!("-v {kib}"), &format!("simulate {case} --threads 4096"));
        assert!(code == 0 || code == 6 && said.contains("ulimit -v"), "{kib} KiB: {code} {said}");
        done += u32::from(code == 0);
        refused += u32::from(code == 6);
        true
    }));
    println!("{done} runs were done, {refused} were refused");
    assert!(refused > 0);
}

#[cfg(target_os = "linux")]
#[test]
fn too_many_open_files_are_answered_with_their_limit() {
    let dir = tempfile::tempdir().unwrap();
    let mut refused = 0;
    for files in 4..12 {
        let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
        let study = format!("study --scenarios {} --out {}", scenarios.display(), dir.path().display());
        let (code, said) = limited(&format!("-n {files}"), &study);
        // The system's loader needs files too, beside those that are open here.
        assert!([0, 6, 127].contains(&code), "{files}: {said}");
        assert!(code != 6 || said.contains("ulimit -n") && !said.contains("disk"), "{files}: {said}");
        refused += u32::from(code == 6);
    }
    assert!(refused > 0);
}
