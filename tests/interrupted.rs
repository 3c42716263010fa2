//! What an interrupted run leaves behind: its exit status, and no half-written file.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use lanesweep::interrupt;

/// Longest wait for anything here; an unloaded machine needs a second or two.
const PATIENCE: Duration = Duration::from_secs(60);

fn send(signal: &str, pid: u32) {
    assert!(Command::new("kill").args([format!("-{signal}"), pid.to_string()]).status().unwrap().success());
}

/// The hidden, unfinished files of a folder.
fn unfinished(dir: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.extension().is_some_and(|extension| extension == "part")).collect()
}

fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn ended(child: &mut Child) -> Option<i32> {
    let mut status = None;
    wait_until("the process ends", || {
        status = child.try_wait().unwrap();
        status.is_some()
    });
    status.unwrap().code()
}

/// A study that is sent `signal` while it writes its lanes.
fn study_interrupted_by(signal: &str) -> Option<i32> {
    let dir = tempfile::tempdir().unwrap();
    let lanes = dir.path().join("lanes.csv");
    std::fs::write(&lanes, "of an earlier run").unwrap();
    let mut study = Command::new(env!("CARGO_BIN_EXE_lanesweep"))
        .args(["-q", "--threads", "1", "study", "--reference", "--synth-recordings", "2", "--synth-duration", "300"])
        .args([Path::new("--out"), &dir.path().join("out"), Path::new("--lanes"), &lanes])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    wait_until("rows are being written", || {
        assert!(study.try_wait().unwrap().is_none(), "the study ended before it was interrupted");
        let in_middle = |path: &PathBuf| std::fs::metadata(path).is_ok_and(|file| file.len() > 0);
        unfinished(dir.path()).iter().any(in_middle)
    });
    let name = unfinished(dir.path())[0].file_name().unwrap().to_str().unwrap().to_owned();
    assert!(name.starts_with(".lanesweep-lanes.csv-"), "{name}");
    send(signal, study.id());
    let code = ended(&mut study);
    assert_eq!(unfinished(dir.path()), Vec::<PathBuf>::new(), "after {signal}");
    assert_eq!(std::fs::read_to_string(&lanes).unwrap(), "of an earlier run", "what was there stays");
    code
}

#[test]
fn a_study_that_is_interrupted_leaves_no_half_written_file() {
    assert_eq!(study_interrupted_by("TERM"), Some(128 + 15));
    assert_eq!(study_interrupted_by("INT"), Some(128 + 2));
}

#[test]
fn a_resumable_run_notes_the_first_signal_and_ends_at_once_by_the_second() {
    let mut run = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "the_resumable_run", "--nocapture"])
        .env(RESUMABLE_RUN, "1")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines().map(|line| line.unwrap());
    assert!(lines.any(|line| line == "at work"));
    send("INT", run.id());
    assert_eq!(lines.next().as_deref(), Some("ending after the present chunk; again to end at once"));
    assert_eq!(lines.next().as_deref(), Some("noted"));
    send("TERM", run.id());
    assert_eq!(ended(&mut run), Some(143));
}

const RESUMABLE_RUN: &str = "LANESWEEP_TEST_RESUMABLE_RUN";

/// The process that the test above interrupts; nothing by itself.
#[test]
fn the_resumable_run() {
    if std::env::var_os(RESUMABLE_RUN).is_none() {
        return;
    }
    interrupt::install();
    let _guard = interrupt::resumable();
    assert!(!interrupt::requested());
    eprintln!("at work");
    wait_until("the first signal", interrupt::requested);
    eprintln!("noted");
    std::thread::sleep(PATIENCE);
}

#[test]
fn a_time_limit_and_a_request_are_seen_until_they_are_withdrawn() {
    assert!(!interrupt::requested());
    interrupt::stop_after(0.05);
    wait_until("the time limit", interrupt::requested);
    interrupt::withdraw();
    assert!(!interrupt::requested());
    for never in [1e9, f64::MAX, f64::INFINITY] {
        interrupt::stop_after(never);
        assert!(!interrupt::requested(), "{never}");
    }
    for now in [0.0, -1.0, f64::NAN] {
        interrupt::stop_after(now);
        assert!(interrupt::requested(), "{now}");
    }
    interrupt::withdraw();
    interrupt::request();
    assert!(interrupt::requested());
    interrupt::withdraw();
}
