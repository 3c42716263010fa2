//! Faults of the world around a run: a disk that is full or read-only, a limit of the size of files, a folder that
//! vanishes, a worker that panics, a device that is lost, a clock that jumps. Each leaves a whole result or one that the
//! same command completes; the message tells which, and the result in the end is that of the undisturbed run, byte for
//! byte. What the machine does not allow (mounts, another user) is skipped loudly.
#![cfg(unix)]

use crate::common::{self, page};
mod machine;
mod workers;

use crate::common::program::{
    self, command, done, ended, files, limited, names, start, unbroken, wait_for_run, without_times,
};

use std::path::{Path, PathBuf};

/// Runs a command of the program in a folder: exit code and stderr.
fn lanesweep(dir: &Path, args: &[&str]) -> (i32, String) {
    let (code, _, err) = program::lanesweep(dir, args);
    (code, unbroken(err.as_bytes()))
}

/// Nothing hidden or half-written may be left in the folder of a finished run.
fn same(found: &Path, undisturbed: &Path, what: &str) {
    let [found, expected] = [found, undisturbed].map(|dir| {
        let mut files = without_times(files(dir));
        if let Some(page) = files.get_mut("report.html") {
            *page = page::without_host(std::str::from_utf8(page).unwrap()).into_bytes();
        }
        files
    });
    program::same(&found, &expected, what);
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
        done(&dir, &[&fit[..], &["--out", "density.json"]].concat());
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
        let command = [run, &["--out", name]].concat();
        let (code, _, err) = limited(bench.path(), &format!("ulimit -f {blocks}"), &command);
        let said = unbroken(err.as_bytes());
        assert_eq!(code, 6, "{name}: {said}");
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
        let args = [run, &["--out", name]].concat();
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = command(bench.path(), &args).stdout(full).output().unwrap();
        let said = unbroken(&output.stderr);
        assert_eq!(output.status.code(), Some(6), "{said}");
        assert!(said.contains("standard output") && said.contains("No space left"), "{said}");
        done(bench.path(), &args);
        same(&bench.path().join(name), &whole, name);
    }
}

#[test]
fn a_folder_that_vanishes_in_mid_run_is_told_or_made_again_and_nothing_is_claimed_that_is_lost() {
    let bench = Bench::new();
    let long = [SAMPLE, &["--config", "run.stop_after_s=100000"]].concat();
    let whole = shared().join("sample");
    let out = bench.path().join("out");
    let (mut reported, mut made_again) = (0, 0);
    for round in 0..2 {
        let mut run = start(bench.path(), &[&long[..], &["--out", "out"]].concat());
        // Before its journal is begun, and after.
        let awaited = |entry: &String| if round == 0 { entry == "run.lock" } else { entry.ends_with(".journal") };
        wait_for_run(&mut run, "something is being written", || names(&out).iter().any(awaited));
        std::fs::remove_dir_all(&out).unwrap();
        let (code, err) = ended(run);
        let said = unbroken(err.as_bytes());
        match code {
            // It came to its end before the next record was due.
            0 => made_again += 1,
            6 => {
                assert!(said.contains("out vanished") && said.contains("begins anew"), "{said}");
                assert!(!said.contains("are done and kept"), "{said}");
                assert!(!out.exists(), "a folder that is taken away is not made again by a journal");
                reported += 1;
                done(bench.path(), &[SAMPLE, &["--out", "out"]].concat());
            }
            other => panic!("{other:?}: {said}"),
        }
        same(&out, &whole, &format!("round {round}"));
        std::fs::remove_dir_all(&out).unwrap();
    }
    println!("{reported} runs told of it, {made_again} made the folder again");
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
        "sample density.json --samples 1000 --out @ --estimator is",
        "fit --scenarios scenarios.jsonl --out @",
        "synth @",
        "merge @",
        "simulate --from @ --lane a/S/1.0s/FSM",
    ];
    for command in commands {
        for place in ["taken", "taken/inside", "taken/far/inside"] {
            let args: Vec<&str> = command.split(' ').map(|arg| if arg == "@" { place } else { arg }).collect();
            let (code, said) = lanesweep(dir, &args);
            assert!([2, 3, 6].contains(&code), "{args:?}: {code} {said}");
            assert!(said.contains("taken"), "{args:?}: {said}");
            let mut expected = vec!["a file is where a folder is needed"];
            if command.contains("merge") || command.contains("--from") {
                expected.extend(["expected the folder of a run", "there is no such folder", "there is no run here"]);
            }
            assert!(expected.iter().any(|text| said.contains(text)), "{args:?}: {said}");
        }
    }
    for command in [
        "study --scenarios scenarios.jsonl --out fresh --rows taken/lanes.csv",
        "sample density.json --samples 1000 --out fresh --rows taken/rows.csv",
        "mine recordings --out taken/scenarios.jsonl",
        "fit --scenarios scenarios.jsonl --categories cut-in --parameterizations 2 --out taken/density.json",
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
