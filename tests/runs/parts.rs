//! Runs in parts: whatever the shards and interruptions, the result is that of the undisturbed run, byte for byte.

use crate::common::mined::write_cut_in_density;
use crate::common::program::{self, flat, kill, lanesweep, ran, start, unbroken, wait_for_run, without_host, words};

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

pub fn same(a: &Path, b: &Path) {
    let [found, expected] = [a, b].map(|dir| without_host(program::files(dir)));
    program::same(&found, &expected, &format!("{} and {}", a.display(), b.display()));
}

const STUDY: &str = "-q study --synth-recordings 2 --published --backend cpu";

/// The study in one piece, made once below the target folder: its folder, and what it printed.
pub fn whole() -> &'static (PathBuf, String) {
    static MADE: OnceLock<(PathBuf, String)> = OnceLock::new();
    MADE.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("whole");
        let _ = std::fs::remove_dir_all(&dir);
        std::fs::create_dir_all(&dir).unwrap();
        let printed = ran(&dir, &format!("{STUDY} --out study"));
        (dir.join("study"), printed)
    })
}

#[test]
fn a_study_in_shards_is_the_study_in_one_piece() {
    let dir = &*crate::common::folder();
    let (folder, whole) = whole();
    // Each makes the plan itself; in another order.
    let shard = |shard: &str| ran(dir, &format!("{STUDY} --out three --shard {shard}"));
    let _ = ["2/3", "0/3", "1/3"].map(shard);
    assert_eq!(ran(dir, "-q merge three"), *whole);
    same(folder, &dir.join("three"));
    // A second merge changes nothing, and a finished part is left alone.
    let part = dir.join("three/part-00001-of-00003.json");
    let before = std::fs::metadata(&part).unwrap().modified().unwrap();
    shard("1/3");
    assert_eq!(std::fs::metadata(&part).unwrap().modified().unwrap(), before);
    ran(dir, "-q merge three");
    same(folder, &dir.join("three"));
    // From one plan: the data are not read again.
    ran(dir, &format!("{STUDY} --out plan --plan-only"));
    let [left, made] =
        [folder.join("run-plan.json"), dir.join("plan/plan.json")].map(|path| std::fs::read(path).unwrap());
    assert!(left == made, "the plan that a whole run leaves is the same file");
    assert_eq!(ran(dir, "-q study --plan plan/plan.json --backend cpu --out planned"), *whole);
    same(folder, &dir.join("planned"));
}

#[test]
fn parts_share_a_folder_and_keep_whole_runs_merges_and_themselves_out() {
    let dir = &*crate::common::folder();
    write_cut_in_density(&dir.join("density.json"));
    let run = "-q sample density.json --backend cpu --samples 100000000 --out run";
    let mut first = start(dir, &words(&format!("{run} --shard 0/2")));
    let lock = dir.join("run/part-00000-of-00002.lock");
    wait_for_run(&mut first, "the lock is taken", || std::fs::read(&lock).is_ok_and(|pid| !pid.is_empty()));
    let same_part = format!("{run} --shard 0/2");
    let others = [run, "-q merge run", &same_part].map(|line| lanesweep(dir, &words(line)));
    let beside = lanesweep(dir, &words(&format!("{run} --shard 1/2 --config run.stop_after_s=0.3")));
    let message = format!("another lanesweep process is writing this part or run (pid {})", first.id());
    kill(first);
    for (code, out, err) in &others {
        assert!(*code == 75 && out.is_empty() && flat(err).contains("another lanesweep process"), "{code}: {err}");
    }
    assert!(unbroken(others[2].2.as_bytes()).contains(&message), "{}", others[2].2);
    assert!(beside.0 == 75 && flat(&beside.2).contains("are done and kept"), "{}", beside.2);
}
