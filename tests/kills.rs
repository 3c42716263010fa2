//! A run that is killed (SIGKILL, as a power cut or the system's memory killer would) at any moment and started again
//! ends as if undisturbed. Six kills by default; the long form is
//! `LANESWEEP_KILLS=200 cargo test --release --test kills -- --nocapture`.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn program(dir: &Path, args: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_lanesweep"))
        .current_dir(dir)
        .args(args)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn done(dir: &Path, args: &[&str]) {
    assert!(program(dir, args).wait().unwrap().success(), "{args:?}");
}

/// Every file of a finished run but its record, which holds times; nothing hidden or half-written may be left.
fn results(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = PathBuf::from(path.file_name().unwrap());
        let is_record = ["run.json", "estimate.json", "report.html"].iter().any(|record| name == Path::new(record));
        let content = if is_record { Vec::new() } else { std::fs::read(&path).unwrap() };
        files.push((name, content));
    }
    files.sort();
    files
}

#[test]
fn a_killed_run_continues_and_ends_as_if_undisturbed() {
    let kills: u64 = std::env::var("LANESWEEP_KILLS").ok().map_or(6, |text| text.parse().unwrap());
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let fit = ["-q", "fit", "--synth-recordings", "3", "--category", "cut-in", "--parameterization", "2"];
    done(dir, &[&fit[..], &["--no-comparison", "--out", "densities"]].concat());
    let plan =
        ["-q", "study", "--synth-recordings", "3", "--reference", "--dt", "0.02", "--plan-only", "--out", "plan"];
    done(dir, &plan);
    let study = ["-q", "study", "--plan", "plan/plan.json", "--backend", "cpu", "--threads", "1"];
    let sample = [
        "-q",
        "sample",
        "densities/cut-in-2.json",
        "--backend",
        "cpu",
        "--samples",
        "800000",
        "--thw",
        "0.6",
        "--threads",
        "1",
    ];
    let density = sample[2];
    let found = ["-q", "sample", density, "--estimator", "is", "--pilot", "2000", "--samples", "100", "--out", "pilot"];
    done(dir, &[&found[..], &["--thw", "0.6", "--models", "RSS"]].concat());
    let proposal = "pilot/proposal-RSS.json";
    let plan = ["-q", "sample", density, "--estimator", "is", "--proposal", proposal, "--thw", "0.6", "--plan-only"];
    done(dir, &[&plan[..], &["--samples", "600000", "--models", "RSS,FSM", "--out", "weighted"]].concat());
    let weighted = ["-q", "sample", "--plan", "weighted/plan.json", "--backend", "cpu", "--threads", "1"];
    let runs: [&[&str]; 3] = [&study, &sample, &weighted];
    let undisturbed = runs.map(|run| {
        let started = Instant::now();
        done(dir, &[run, &["--out", "undisturbed"]].concat());
        let (took, files) = (started.elapsed(), results(&dir.join("undisturbed")));
        std::fs::remove_dir_all(dir.join("undisturbed")).unwrap();
        (took, files)
    });
    let (mut alive, mut continued) = (0, 0);
    for kill in 0..kills {
        let at = (kill % 3) as usize;
        let (took, expected) = &undisturbed[at];
        // A low-discrepancy sequence of moments over the whole run.
        let share = (kill as f64 * 0.618_033_988_749_895 + 0.5).fract();
        let out = dir.join("killed");
        let run = [runs[at], &["--out", "killed"]].concat();
        let mut child = program(dir, &run);
        std::thread::sleep(Duration::from_secs_f64(took.as_secs_f64() * share));
        alive += u64::from(child.try_wait().unwrap().is_none());
        // Has no effect where it has ended already.
        child.kill().unwrap();
        child.wait().unwrap();
        let has_journal = |out: &Path| {
            let names = std::fs::read_dir(out).into_iter().flatten().flatten();
            names.into_iter().any(|entry| entry.path().extension().is_some_and(|ending| ending == "journal"))
        };
        continued += u64::from(has_journal(&out));
        done(dir, &run);
        let found = results(&out);
        let names = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&found), names(expected), "kill {kill}");
        assert!(found == *expected, "kill {kill} of {run:?} at {share} of the run changed a result");
        std::fs::remove_dir_all(&out).unwrap();
    }
    println!("{kills} kills, {alive} while running, {continued} with a journal: {kills} results identical");
    assert!(alive > 0, "no run was killed before its end");
}
