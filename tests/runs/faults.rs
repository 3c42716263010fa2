//! Faults of the world around a run: each leaves a whole result or one that the same command completes, byte for byte the
//! undisturbed one. What the machine does not allow (mounts, another user) is skipped loudly.
#![cfg(unix)]

use crate::common::{self, Folder, folder, program};
mod machine;
mod workers;

use crate::common::program::{
    ended, files, limited, names, ran, said, start, unbroken, wait_for_run, without_times, words,
};

use std::path::{Path, PathBuf};

/// Nothing hidden or half-written may be left in the folder of a finished run.
fn same(found: &Path, undisturbed: &Path) {
    let page = |(name, content): (String, Vec<u8>)| match std::str::from_utf8(&content) {
        Ok(text) if name == "report.html" => (name, program::page_without_host(text).into_bytes()),
        _ => (name, content),
    };
    let [found, expected] = [found, undisturbed].map(|dir| without_times(files(dir)).into_iter().map(page).collect());
    program::same(&found, &expected, &undisturbed.display().to_string());
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
        common::mined::write_cut_in_density(&dir.join("density.json"));
        let _ = RUNS.map(|(name, run)| ran(&dir, &format!("{run} --out {name}")));
        dir
    })
}

const STUDY: &str = "-q study --scenarios scenarios.jsonl --backend cpu --threads 1";
/// Half a second or more on one thread: long enough for a journal.
const SAMPLE: &str = "-q sample density.json --samples 1000000 --thw 0.6 --models FSM --backend cpu --threads 1";
const RUNS: [(&str, &str); 2] = [("study", STUDY), ("sample", SAMPLE)];

/// A folder with the scenarios and the density.
fn bench() -> Folder {
    let dir = folder();
    for name in ["scenarios.jsonl", "density.json"] {
        std::fs::copy(shared().join(name), dir.join(name)).unwrap();
    }
    dir
}

/// The same command, undisturbed, ends with the result of the undisturbed run.
fn ends_well(dir: &Path, name: &str, run: &str) {
    ran(dir, &format!("{run} --out {name}"));
    same(&dir.join(name), &shared().join(name));
}

#[test]
fn an_interrupted_run_continues_and_ends_as_if_undisturbed() {
    let bench = bench();
    let part = format!("{SAMPLE} --out parts --shard 0/1 --config run.stop_after_s=0.3");
    for interruptions in 0.. {
        let (code, said) = said(&bench, &part);
        assert!(interruptions < 200, "every run must come further: {said}");
        if code == 0 {
            assert!(interruptions > 0, "the run is too short to be interrupted");
            break;
        }
        assert!(code == 75 && said.contains("are done and kept") && said.contains("it continues"), "{code}: {said}");
    }
    ran(&bench, "-q merge parts");
    super::parts::same(&shared().join("sample"), &bench.join("parts"));
}

#[test]
fn at_a_limit_of_the_size_of_files_the_run_says_so_and_ends_well_without_it() {
    let bench = bench();
    // In blocks of 512 or 1024 bytes, as the shell counts: less than a table of the study, than a sample's journal.
    for ((name, run), blocks) in RUNS.into_iter().zip([1, 8]) {
        let line = format!("{run} --out {name}");
        let (code, _, err) = limited(&bench, &format!("ulimit -f {blocks}"), &words(&line));
        let said = unbroken(err.as_bytes());
        assert!(code == 6 && said.contains("File too large") && said.contains("ulimit -f"), "{code}: {said}");
        ends_well(&bench, name, run);
    }
}

#[test]
fn a_folder_that_vanishes_in_mid_run_is_told_or_made_again_and_nothing_is_claimed_that_is_lost() {
    let bench = bench();
    let out = bench.join("sample");
    for round in 0..2 {
        let long = format!("{SAMPLE} --config run.stop_after_s=100000 --out sample");
        let mut run = start(&bench, &words(&long));
        // Before its journal is begun, and after.
        let awaited = |entry: &String| if round == 0 { entry == "run.lock" } else { entry.ends_with(".journal") };
        wait_for_run(&mut run, "something is being written", || names(&out).iter().any(awaited));
        std::fs::remove_dir_all(&out).unwrap();
        let (code, err) = ended(run);
        let said = unbroken(err.as_bytes());
        // 0: it came to its end before the next record was due.
        if code != 0 {
            assert!(code == 6 && said.contains("sample vanished"), "{code}: {said}");
            let where_it_was = ["begins anew", "run.lock: cannot lock", "sample: cannot read"];
            assert!(where_it_was.iter().any(|place| said.contains(place)), "{said}");
            assert!(!said.contains("are done and kept"), "{said}");
            assert!(!out.exists(), "a folder that is taken away is not made again by a journal");
            ran(&bench, &format!("{SAMPLE} --out sample"));
        }
        same(&out, &shared().join("sample"));
        std::fs::remove_dir_all(&out).unwrap();
    }
}
