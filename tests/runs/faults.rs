//! Faults of the world around a run: a disk that is full or read-only, a limit of the size of files, a folder that
//! vanishes, a worker that panics, a device that is lost, a clock that jumps. Each leaves a whole result or one that the
//! same command completes; the message tells which, and the result in the end is that of the undisturbed run, byte for
//! byte. What the machine does not allow (mounts, another user) is skipped loudly.
#![cfg(unix)]

use crate::common;
mod machine;
mod workers;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_lanesweep");

/// Longest wait for anything here; an unloaded machine needs a second or two.
const PATIENCE: Duration = Duration::from_secs(60);

/// Text without the drawing, which breaks long lines, also after a hyphen or a slash.
fn flat(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let words: Vec<&str> = text.split_whitespace().filter(|word| *word != "│").collect();
    words.join(" ").replace("- ", "-").replace("/ ", "/")
}

/// Runs a command of the program in a folder: exit code and stderr.
fn lanesweep(dir: &Path, args: &[&str]) -> (i32, String) {
    let output = Command::new(PROGRAM).env("NO_COLOR", "1").current_dir(dir).args(args).output().unwrap();
    (output.status.code().unwrap_or(-1), flat(&output.stderr))
}

fn done(dir: &Path, args: &[&str]) {
    let (code, said) = lanesweep(dir, args);
    assert_eq!(code, 0, "{args:?}: {said}");
}

/// Every file of a finished run but its record, which holds times; nothing hidden or half-written may be left.
fn results(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = PathBuf::from(path.file_name().unwrap());
        let is_record = ["run.json", "estimate.json", "report.html"].iter().any(|record| name == Path::new(record));
        files.push((name, if is_record { Vec::new() } else { std::fs::read(&path).unwrap() }));
    }
    files.sort();
    files
}

fn same(found: &Path, undisturbed: &Path, what: &str) {
    let (found, expected) = (results(found), results(undisturbed));
    let names = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&found), names(&expected), "{what}");
    for ((name, found), (_, expected)) in found.iter().zip(&expected) {
        assert!(found == expected, "{what}: {} differs", name.display());
    }
}

/// A folder with scenarios and a density.
struct Bench {
    dir: tempfile::TempDir,
}

/// What the tests share: made once, below the target folder. Scenarios, a density, and the results of runs that nothing
/// disturbed in `study` and `sample`.
fn shared() -> &'static Path {
    static MADE: std::sync::OnceLock<PathBuf> = std::sync::OnceLock::new();
    MADE.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("faults");
        let _ = std::fs::remove_dir_all(&dir);
        std::fs::create_dir_all(&dir).unwrap();
        std::fs::copy(common::golden("paper_sumo_01_02_scenarios.jsonl"), dir.join("scenarios.jsonl")).unwrap();
        let fit = ["-q", "fit", "--synth-recordings", "3", "--categories", "cut-in", "--parameterizations", "2"];
        done(&dir, &[&fit[..], &["--no-comparison", "--out", "density.json"]].concat());
        for (name, run) in RUNS {
            done(&dir, &[run, &["--out", name]].concat());
        }
        dir
    })
}

const STUDY: &[&str] = &["-q", "study", "--scenarios", "scenarios.jsonl", "--backend", "cpu", "--threads", "1"];
/// Half a second or more on one thread: long enough for a journal.
const SAMPLE: &[&str] = &[
    "-q",
    "sample",
    "density.json",
    "--samples",
    "1000000",
    "--thw",
    "0.6",
    "--models",
    "FSM",
    "--backend",
    "cpu",
    "--threads",
    "1",
];
const RUNS: [(&str, &[&str]); 2] = [("study", STUDY), ("sample", SAMPLE)];

impl Bench {
    fn new() -> Bench {
        let dir = tempfile::tempdir().unwrap();
        for name in ["scenarios.jsonl", "density.json"] {
            std::fs::copy(shared().join(name), dir.path().join(name)).unwrap();
        }
        Bench { dir }
    }

    fn path(&self) -> &Path {
        self.dir.path()
    }
}

#[test]
fn at_a_limit_of_the_size_of_files_the_run_says_so_and_ends_well_without_it() {
    let bench = Bench::new();
    for (name, run) in RUNS {
        let whole = shared().join(name);
        // In blocks of 512 or 1024 bytes, as the shell counts: less than a table of the study, than a sample's journal.
        let blocks = if name == "study" { "1" } else { "8" };
        let script = format!("ulimit -f {blocks} && exec \"$0\" \"$@\"");
        let command = [run, &["--out", name]].concat();
        let limited = Command::new("sh")
            .current_dir(bench.path())
            .env("NO_COLOR", "1")
            .args(["-c", &script, PROGRAM])
            .args(&command)
            .output()
            .unwrap();
        let said = flat(&limited.stderr);
        assert_eq!(limited.status.code(), Some(6), "{name}: {:?} {said}", limited.status);
        assert!(said.contains("File too large") && said.contains("ulimit -f"), "{said}");
        done(bench.path(), &command);
        same(&bench.path().join(name), &whole, name);
    }
}

#[test]
fn a_full_standard_output_is_told_and_the_result_is_whole() {
    if !Path::new("/dev/full").exists() {
        return common::skipped("needs /dev/full");
    }
    let bench = Bench::new();
    for (name, run) in RUNS {
        let whole = shared().join(name);
        let command = [run, &["--out", name]].concat();
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = Command::new(PROGRAM).current_dir(bench.path()).args(&command).stdout(full).output().unwrap();
        let said = flat(&output.stderr);
        assert_eq!(output.status.code(), Some(6), "{said}");
        assert!(said.contains("standard output") && said.contains("No space left"), "{said}");
        done(bench.path(), &command);
        same(&bench.path().join(name), &whole, name);
    }
}

#[test]
fn a_folder_that_vanishes_in_mid_run_is_told_or_made_again_and_nothing_is_claimed_that_is_lost() {
    let bench = Bench::new();
    let long = [SAMPLE, &["--stop-after", "100000"]].concat();
    let whole = shared().join("sample");
    let out = bench.path().join("out");
    let (mut told, mut made_again) = (0, 0);
    for round in 0..2 {
        let mut child = Command::new(PROGRAM)
            .current_dir(bench.path())
            .args([&long[..], &["--out", "out"]].concat())
            .env("NO_COLOR", "1")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let started = Instant::now();
        // Before its journal is begun, and after.
        let awaited = |entry: &str| match round % 2 {
            0 => entry == "run.lock",
            _ => entry.ends_with(".journal"),
        };
        while !std::fs::read_dir(&out)
            .into_iter()
            .flatten()
            .flatten()
            .any(|e| awaited(&e.file_name().to_string_lossy()))
        {
            assert!(started.elapsed() < PATIENCE && child.try_wait().unwrap().is_none(), "nothing is being written");
            std::thread::sleep(Duration::from_millis(2));
        }
        std::fs::remove_dir_all(&out).unwrap();
        let ended = child.wait_with_output().unwrap();
        let said = flat(&ended.stderr);
        match ended.status.code() {
            // It came to its end before the next record was due.
            Some(0) => made_again += 1,
            Some(6) => {
                assert!(said.contains("out vanished") && said.contains("begins anew"), "{said}");
                assert!(!said.contains("are done and kept"), "{said}");
                assert!(!out.exists(), "a folder that is taken away is not made again by a journal");
                told += 1;
                done(bench.path(), &[SAMPLE, &["--out", "out"]].concat());
            }
            other => panic!("{other:?}: {said}"),
        }
        same(&out, &whole, &format!("round {round}"));
        std::fs::remove_dir_all(&out).unwrap();
    }
    println!("{told} runs told of it, {made_again} made the folder again");
}

#[test]
fn an_output_that_is_a_file_or_inside_one_is_refused_before_the_work() {
    let bench = Bench::new();
    let dir = bench.path();
    done(dir, &["-q", "synth", "recordings", "--synth-recordings", "1", "--config", "generator.duration_s=60"]);
    std::fs::write(dir.join("taken"), "mine").unwrap();
    let commands = [
        "study --scenarios scenarios.jsonl --out @",
        "study --scenarios scenarios.jsonl --out @ --plan-only",
        "study --scenarios scenarios.jsonl --out @ --shard 0/2",
        "sample density.json --samples 1000 --out @",
        "sample density.json --samples 1000 --out @ --shard 0/2",
        "sample density.json --samples 1000 --out @ --estimator ce",
        "compare --scenarios scenarios.jsonl --samples 1000 --out @",
        "fit --scenarios scenarios.jsonl --out @",
        "synth @",
        "cluster slurm --array 2 --out @ -- study",
        "cluster merge @",
        "simulate --from @ --lane a/S/1.0s/FSM",
    ];
    for command in commands {
        for place in ["taken", "taken/inside", "taken/far/inside"] {
            let args: Vec<&str> = command.split(' ').map(|arg| if arg == "@" { place } else { arg }).collect();
            let (code, said) = lanesweep(dir, &args);
            assert!([2, 3, 6].contains(&code), "{args:?}: {code} {said}");
            assert!(said.contains("taken"), "{args:?}: {said}");
            assert!(said.contains("a file is where a folder is needed"), "{args:?}: {said}");
        }
    }
    for command in [
        "study --scenarios scenarios.jsonl --out fresh --rows taken/lanes.csv",
        "sample density.json --samples 1000 --out fresh --rows taken/rows.csv",
        "mine recordings --out taken/scenarios.jsonl",
        "fit --scenarios scenarios.jsonl --categories cut-in --parameterizations 2 --out taken/density.json",
        "cluster slurm --array 2 --out fresh --scripts taken/scripts -- study",
    ] {
        let args: Vec<&str> = command.split(' ').collect();
        let (code, said) = lanesweep(dir, &args);
        assert_eq!(code, 6, "{args:?}: {said}");
        assert!(said.contains("taken") && said.contains("a file is where a folder is needed"), "{args:?}: {said}");
    }
    for command in [
        "study --scenarios scenarios.jsonl --out fresh --rows recordings",
        "sample density.json --samples 1000 --out fresh --rows recordings",
        "mine recordings --out .",
    ] {
        let args: Vec<&str> = command.split(' ').collect();
        let (code, said) = lanesweep(dir, &args);
        assert!([2, 6].contains(&code) && said.contains("folder"), "{args:?}: {code} {said}");
    }
    assert_eq!(std::fs::read_to_string(dir.join("taken")).unwrap(), "mine");
}

/// A clock that is set while a run is at work can change nothing: nobody looks at it. Waiting and time limits follow
/// the monotonic clock (`Instant`), results hold no dates.
#[test]
fn nothing_reads_the_clock_of_the_day() {
    let mut files = vec![PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut seen = 0;
    while let Some(path) = files.pop() {
        if path.is_dir() {
            files.extend(std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        seen += 1;
        for word in ["SystemTime", "UNIX_EPOCH", ".modified()", ".accessed()", ".created()", "chrono", "now_utc"] {
            assert!(!text.contains(word), "{}: {word}: a clock that jumps would change the run", path.display());
        }
    }
    assert!(seen > 200, "{seen} files");
}
