//! The program, run in a folder.

use std::path::Path;
use std::process::{Command, Output};

fn output(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lanesweep")).current_dir(dir).env("NO_COLOR", "1").args(args).output().unwrap()
}

/// Runs a command that must succeed; what it says on stdout.
pub fn lanesweep(dir: &Path, args: &[&str]) -> String {
    let output = output(dir, args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Exit code and what a command says on stderr, without the drawing.
pub fn said(dir: &Path, args: &[&str]) -> (i32, String) {
    let output = output(dir, args);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let text = text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    (output.status.code().unwrap_or(-1), text.replace("- ", "-"))
}
