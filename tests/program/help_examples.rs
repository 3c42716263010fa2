//! Every example that `--help` ends with, run as it stands there, in one folder; only sizes are smaller.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Output;

use crate::common::program::{command, words};
use crate::common::{in_crate, skipped};
use crate::program::command_line::verbs_of;

fn run(dir: &Path, line: &str) -> Output {
    // Help in one line per example.
    let envs = [("COLUMNS", "1000"), ("LANESWEEP_CONFIG", "fewer.toml")];
    command(dir, &words(line)[1..]).envs(envs).output().unwrap()
}

fn message_of(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// The verbs, those first whose results others read, and after them the verbs that they have.
fn verbs() -> Vec<String> {
    let mut verbs = verbs_of("");
    let first = ["tracks", "mine", "study", "fit"];
    verbs.sort_by_key(|verb| first.iter().position(|f| f == verb).unwrap_or(first.len()));
    let inner =
        |verb: &String| verbs_of(verb).into_iter().map(move |inner| format!("{verb} {inner}")).collect::<Vec<_>>();
    let inner: Vec<String> = verbs.iter().flat_map(inner).collect();
    assert!(verbs.len() >= 10 && inner.len() >= 6, "{verbs:?} {inner:?}");
    verbs.into_iter().chain(inner).collect()
}

fn examples(dir: &Path, verb: &str) -> Vec<String> {
    let help = String::from_utf8(run(dir, &format!("lanesweep {verb} --help")).stdout).unwrap();
    let (_, examples) = help.split_once("\nExample").unwrap_or_else(|| panic!("{verb} ends with no example"));
    let examples = examples.replace("\\\n", "");
    let lines = examples.lines().map(str::trim).filter(|line| line.starts_with("lanesweep "));
    // What a shell would do with the output is the shell's.
    lines.map(|line| line.split(" > ").next().unwrap_or_default().to_owned()).collect()
}

/// The same command on less: fewer samples, lanes and comparisons; nothing that the example shows is left out.
fn smaller(line: &str) -> String {
    let mut words: Vec<&str> = line.split_whitespace().collect();
    if let Some(at) = words.iter().position(|word| *word == "--samples") {
        words[at + 1] = "300";
    }
    match words[1] {
        "fit" => words.extend(["--config", "fit.valid_draws=1000"]),
        // One lane is little already.
        "verify" if !words.contains(&"devices") => {
            words.retain(|word| !matches!(*word, "--random-lanes" | "20000"));
            words.extend(["--random-lanes", "200", "--config", "verify.threshold_units=1", "--synth-recordings", "1"]);
        }
        _ => {}
    }
    words.join(" ")
}

fn tracks() -> String {
    let mut text = String::from("id;time;x;y;speed;length;width;lane\n");
    for vehicle in 0..8 {
        for step in 0..120 {
            let (time, lane) = (0.1 * f64::from(step), vehicle % 2);
            let (x, y) = (30.0 * f64::from(vehicle) + 25.0 * time, 1.75 + 3.5 * f64::from(lane));
            text += &format!("v{vehicle};{time:.2};{x:.2};{y:.2};25.00;5;1.8;east_{lane}\n");
        }
    }
    text
}

#[test]
#[ignore = "half a minute and more: .ci/run long-tests"]
fn every_example_of_the_help_runs() {
    let dir = &*crate::common::folder();
    std::fs::write(dir.join("fewer.toml"), "[generator]\nrecordings = 12\n").unwrap();
    let mut ran = BTreeSet::new();
    for verb in verbs() {
        for example in examples(dir, &verb) {
            if ran.contains(&example) {
                continue;
            }
            // What examples name and no other example leaves behind.
            for name in ["cut-in-1.json", "cut-in-2.json"] {
                let fitted = dir.join("densities").join(name);
                if fitted.exists() {
                    std::fs::copy(fitted, dir.join(name)).unwrap();
                }
            }
            let case = "category,ego_speed_mps,speed_mps,gap,lateral_speed\n";
            std::fs::write(dir.join("cases.csv"), format!("{case}cut-in,30,20,20,1\ncut-in,30,20,40,1\n")).unwrap();
            std::fs::write(dir.join("own.csv"), tracks()).unwrap();
            std::fs::copy(in_crate("configs/presets/generic.toml"), dir.join("own.toml")).unwrap();
            std::fs::write(dir.join("study.toml"), "[score]\nmin_failures = 5\n").unwrap();
            let output = run(dir, &smaller(&example));
            // Without a GPU `verify` says so.
            let is_without_device = verb == "verify" && output.status.code() == Some(7);
            if is_without_device {
                skipped(&format!("{example}: no such device here"));
            }
            // `check` ends with the status of its answer.
            let is_answer = verb == "check" && output.status.code() == Some(8);
            assert!(output.status.success() || is_without_device || is_answer, "{example}: {}", message_of(&output));
            ran.insert(example);
        }
    }
    assert!(ran.len() >= 30, "{ran:?}");
}
