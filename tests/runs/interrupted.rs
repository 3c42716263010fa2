//! What an interrupted run leaves behind: its exit status, and no half-written file.
#![cfg(unix)]

use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::lane_sets::random;
use crate::common::program::{ended, names, send, start, wait_for_run, wait_until, words};
use lanesweep::prelude::*;

fn unfinished(dir: &Path) -> Vec<String> {
    names(dir).into_iter().filter(|name| name.ends_with(".part")).collect()
}

/// A study that is sent `signal` while it writes its lanes.
fn study_interrupted_by(signal: &str) -> i32 {
    let dir = &*crate::common::folder();
    std::fs::write(dir.join("lanes.csv"), "of an earlier run").unwrap();
    let small = "--config study.reference=true --synth-recordings 2 --config generator.duration_s=300";
    let mut study = start(dir, &words(&format!("-q --threads 1 study {small} --out out --rows lanes.csv")));
    wait_for_run(&mut study, "rows are being written", || {
        unfinished(dir).iter().any(|name| std::fs::metadata(dir.join(name)).is_ok_and(|file| file.len() > 0))
    });
    assert!(unfinished(dir)[0].starts_with(".lanesweep-lanes.csv-"), "{:?}", unfinished(dir));
    send(signal, study.id());
    let (code, _) = ended(study);
    assert!(unfinished(dir).is_empty(), "after {signal}: {:?}", unfinished(dir));
    let lanes = std::fs::read_to_string(dir.join("lanes.csv")).unwrap();
    assert_eq!(lanes, "of an earlier run", "what was there stays");
    assert!(!dir.join("out/run.lock").exists(), "the lock goes, whatever else stays");
    code
}

/// Ten scenarios of 100 s, as a file.
fn long_scenarios(path: &Path) {
    let golden = crate::common::text_of("tests/golden/paper_sumo_01_02_scenarios.jsonl");
    let mut scenario: serde_json::Value = golden.lines().next().unwrap().parse().unwrap();
    let samples = 2500;
    let speeds: Vec<f64> = (0..samples).map(|k| 25.0 + f64::from(k % 100) / 100.0).collect();
    let lateral: Vec<f64> = (0..samples).map(|k| 3.5 - 3.5 * f64::from(k) / f64::from(samples)).collect();
    (scenario["kept"], scenario["reason"]) = (true.into(), "".into());
    (scenario["frame0"], scenario["frame1"]) = (0.into(), (samples - 1).into());
    (scenario["target"]["v"], scenario["target"]["y"]) = (speeds.into(), lateral.into());
    let line = |k: i32| {
        scenario["id"] = format!("long-{k}").into();
        // Equal scenarios would count once.
        scenario["ego"]["v0"] = (28.0 + 0.1 * f64::from(k)).into();
        format!("{scenario}\n")
    };
    std::fs::write(path, (0..10).map(line).collect::<String>()).unwrap();
}

/// The first chunk alone, a scenario, takes 15 s.
#[test]
fn a_signal_ends_a_run_within_five_seconds_also_in_its_first_chunk_and_a_second_one_at_once() {
    let dir = &*crate::common::folder();
    long_scenarios(&dir.join("long.jsonl"));
    let long = "--config study.reference=true --dt 0.0001 --scenarios long.jsonl --out out";
    let signalled = |signals: &[&str]| {
        let mut study = start(dir, &words(&format!("-q --threads 1 study {long}")));
        wait_for_run(&mut study, "the folder is locked", || dir.join("out/run.lock").exists());
        for signal in signals {
            std::thread::sleep(Duration::from_millis(500));
            send(signal, study.id());
        }
        let sent = Instant::now();
        let (code, said) = ended(study);
        (code, said, sent.elapsed())
    };
    let (code, said, waited) = signalled(&["TERM"]);
    // A second for a machine that is busy with other tests.
    assert!(waited < Duration::from_secs(6), "{waited:?}: {said}");
    assert!(code == 75 && said.contains("the same command continues"), "{code:?}: {said}");
    assert!(!dir.join("out/run.lock").exists(), "the lock goes");
    let (code, said, waited) = signalled(&["INT", "TERM"]);
    assert!(code == 143 && waited < Duration::from_secs(1), "{code}, {waited:?}: {said}");
    assert!(said.contains("ending after the present chunk; again to end at once"), "{said}");
}

#[test]
fn a_run_without_a_journal_that_is_interrupted_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let map = words("-q --threads 1 map cut-in --backend cpu --preset jrc --dt 0.001 --out out");
    let mut map = start(dir.path(), &map);
    wait_for_run(&mut map, "the folder is locked", || out.join("run.lock").exists());
    send("INT", map.id());
    assert_eq!((ended(map).0, out.exists()), (128 + 2, false));
}

#[test]
fn a_study_that_is_interrupted_leaves_no_half_written_file() {
    // Its counts are kept: the same command continues.
    assert_eq!(["TERM", "INT"].map(study_interrupted_by), [75, 75]);
    // What a closed terminal sends; a test that was itself started by `nohup` hands that down.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    match ignored {
        Some(mask) if mask & 1 == 0 => assert_eq!(study_interrupted_by("HUP"), 75),
        _ => eprintln!("SKIPPED: needs Linux, and SIGHUP not ignored"),
    }
}

#[test]
fn a_time_limit_and_a_request_are_seen_until_they_are_withdrawn() {
    let cancel = Cancel::default();
    assert!(!cancel.requested());
    cancel.stop_after(0.05);
    wait_until("the time limit", || cancel.requested());
    cancel.withdraw();
    assert!(!cancel.requested());
    for (time_s, is_over) in
        [1e9, f64::MAX, f64::INFINITY].map(|s| (s, false)).into_iter().chain([0.0, -1.0, f64::NAN].map(|s| (s, true)))
    {
        cancel.stop_after(time_s);
        assert_eq!(cancel.requested(), is_over, "{time_s}");
    }
    cancel.withdraw();
    cancel.request();
    assert!(cancel.requested());
}

#[test]
fn a_sweep_whose_owner_cancels_it_ends_after_the_chunk_and_keeps_nothing() {
    let plan = random(&Profile::load("paper").unwrap(), 200);
    let executor = Executor { chunk_lanes: Some(100), ..Executor::new(CpuBackend::lane_arithmetic()) };
    let (cancel, mut chunks) = (executor.cancel.clone(), 0);
    let swept = executor.sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, |_| {
        chunks += 1;
        if chunks == 3 {
            cancel.request();
        }
        Ok(())
    });
    assert!(matches!(swept, Err(Error::Interrupted { is_kept: false, .. })));
    assert_eq!(chunks, 3);
    cancel.withdraw();
    assert!(executor.sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, |_| Ok(())).is_ok());
}
