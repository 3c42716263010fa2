//! Commands and what they print, in ```` ```console ```` blocks of Markdown. A shell runs `$ command`; below it stand `? 3` for
//! another exit status than 0, and stdout with stderr, in which `...` is any lines and `[..]` any part of a line.
//! With `LANESWEEP_RENEW=1` what is printed is written into the text.

use std::path::Path;
use std::process::Command;

use rayon::prelude::*;

use crate::common::program::PROGRAM;
use crate::common::with_threads;

/// Runs the commands of a Markdown file, in order, in a folder, and returns where they print something else than stands
/// there; `None` if they do not.
pub fn difference(file: &Path, dir: &Path) -> Option<String> {
    let text = std::fs::read_to_string(file).unwrap();
    let now = renewed(&text, dir);
    if std::env::var_os("LANESWEEP_RENEW").is_some() {
        std::fs::write(file, now).unwrap();
        return None;
    }
    let at = text.lines().zip(now.lines()).position(|(a, b)| a != b)?;
    let after = now.lines().skip(at).take(30).collect::<Vec<_>>().join("\n");
    Some(format!("{}, line {}: printed is\n{after}", file.display(), at + 1))
}

/// The text with what its commands print; outputs that fit stay as they are.
fn renewed(text: &str, dir: &Path) -> String {
    let (mut new, mut block) = (String::new(), None);
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        new += &format!("{line}\n");
        if line.trim_start().starts_with("```") {
            block = block.is_none().then(|| line.contains("```console"));
        }
        let Some(command) = line.strip_prefix("$ ").filter(|_| block == Some(true)) else { continue };
        let mut expected = Vec::new();
        while let Some(line) = lines.next_if(|line| !line.starts_with("$ ") && !line.trim_start().starts_with("```")) {
            expected.push(line);
        }
        let blank = expected.iter().rev().take_while(|line| line.is_empty()).count();
        expected.truncate(expected.len() - blank);
        let found = run(command, dir);
        let found: Vec<&str> = found.trim_end_matches('\n').lines().collect();
        let printed = if fits(&expected, &found) { expected } else { found };
        printed.iter().chain(&vec![""; blank]).for_each(|line| new += &format!("{line}\n"));
    }
    new
}

/// The exit status, unless it is 0, and what a command prints.
fn run(command: &str, dir: &Path) -> String {
    let folder = Path::new(PROGRAM).parent().unwrap().display();
    let path = format!("{folder}:{}", std::env::var("PATH").unwrap());
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("exec 2>&1\n{command}")]).current_dir(dir).env("NO_COLOR", "1").env("PATH", path);
    shell.env_remove("LANESWEEP_CONFIG").env_remove("COLUMNS");
    let output = shell.output().unwrap();
    let status =
        if output.status.success() { String::new() } else { format!("? {}\n", output.status.code().unwrap_or(-1)) };
    status + &String::from_utf8_lossy(&output.stdout)
}

fn fits(expected: &[&str], found: &[&str]) -> bool {
    match expected {
        [] => found.is_empty(),
        ["...", rest @ ..] => (0..=found.len()).any(|at| fits(rest, &found[at..])),
        [first, rest @ ..] => {
            found.split_first().is_some_and(|(line, more)| line_fits(first, line) && fits(rest, more))
        }
    }
}

fn line_fits(expected: &str, found: &str) -> bool {
    let Some((begin, rest)) = expected.split_once("[..]") else { return expected == found };
    let found = found.strip_prefix(begin);
    found.is_some_and(|found| {
        (0..=found.len()).filter(|at| found.is_char_boundary(*at)).any(|at| line_fits(rest, &found[at..]))
    })
}

/// Answers and messages stand in `tests/messages/*.md`, the files that provoke them in the folders beside.
#[test]
fn every_answer_and_every_mistake_is_told_as_it_stands_in_the_messages() {
    let folder = crate::common::in_crate("tests/messages");
    let files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    let texts: Vec<_> = files.iter().filter(|path| path.extension().is_some_and(|ending| ending == "md")).collect();
    assert_eq!(texts.len(), 9);
    // The README's second command tests a program without Parquet.
    let needs_parquet = |line: &str| line.starts_with("$ ") && line.contains(".parquet");
    assert!(!texts.iter().any(|text| std::fs::read_to_string(text).unwrap().lines().any(needs_parquet)));
    let of = |text: &&std::path::PathBuf| {
        let dir = tempfile::tempdir().unwrap();
        crate::common::program::copy(&text.with_extension("in"), dir.path());
        difference(text, dir.path())
    };
    // Threads of its own: those that all tests have would wait for the commands.
    let differences: Vec<String> = with_threads(2, || texts.par_iter().filter_map(of).collect());
    assert!(differences.is_empty(), "{}", differences.join("\n\n"));
}

#[test]
fn a_line_that_is_not_printed_and_another_status_are_found() {
    let dir = tempfile::tempdir().unwrap();
    let is_so = |block: &str| {
        let text = format!("```console\n{block}```\n");
        renewed(&text, dir.path()) == text
    };
    assert!(is_so("$ echo one; echo two >&2\none\ntwo\n\n$ exit 3\n? 3\n"));
    assert!(is_so("$ printf '1\\n2\\n3\\n'\n...\n3\n") && is_so("$ echo 12 34 5\n1[..]4[..]\n"));
    for wrong in
        ["$ echo one\ntwo\n", "$ echo one\n", "$ exit 3\n", "$ printf '1\\n2\\n'\n...\n1\n", "$ echo 1\n[..]2\n"]
    {
        assert!(!is_so(wrong), "{wrong}");
    }
}
