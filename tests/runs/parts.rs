//! Runs in parts: whatever the number and order of shards, and wherever a run was interrupted, the result is that of
//! the undisturbed run, byte for byte; a folder that cannot give it says what is missing.

use crate::common::program::{self, done, flat, kill, lanesweep, limited, start, wait_for_run, without_host};
use lanesweep::engine::ENGINE_VERSION;

use std::path::Path;

fn same(a: &Path, b: &Path) {
    let [found, expected] = [a, b].map(|dir| without_host(program::files(dir)));
    program::same(&found, &expected, &format!("{} and {}", a.display(), b.display()));
}

pub const STUDY: [&str; 7] = ["-q", "study", "--synth-recordings", "2", "--published", "--backend", "cpu"];

pub fn density(dir: &Path) {
    let fit = ["-q", "fit", "--synth-recordings", "3", "--categories", "cut-in", "--parameterizations", "2"];
    done(dir, &[&fit[..], &["--out", "densities"]].concat());
}

pub const SAMPLE: [&str; 9] =
    ["-q", "sample", "densities/cut-in-2.json", "--samples", "30000", "--thw", "0.6", "--backend", "cpu"];

/// Importance sampling that can be split: with a proposal of a run before.
pub fn weighted(dir: &Path) -> Vec<&'static str> {
    done(dir, &[&SAMPLE[..], &["--estimator", "is", "--models", "RSS", "--out", "pilot"]].concat());
    [&SAMPLE[..], &["--estimator", "is", "--proposal", "pilot/proposal.json", "--models", "RSS,FSM"]].concat()
}

#[test]
fn a_study_in_shards_is_the_study_in_one_piece() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let whole = done(dir, &[&STUDY[..], &["--out", "whole"]].concat());
    // Each makes the plan itself; in another order.
    for shard in ["2/3", "0/3", "1/3"] {
        done(dir, &[&STUDY[..], &["--out", "three", "--shard", shard]].concat());
    }
    assert_eq!(done(dir, &["-q", "merge", "three"]), whole);
    same(&dir.join("whole"), &dir.join("three"));
    // A second merge changes nothing, and a finished part is left alone.
    let part = dir.join("three/part-00001-of-00003.json");
    let before = std::fs::metadata(&part).unwrap().modified().unwrap();
    done(dir, &[&STUDY[..], &["--out", "three", "--shard", "1/3"]].concat());
    assert_eq!(std::fs::metadata(&part).unwrap().modified().unwrap(), before);
    done(dir, &["-q", "merge", "three"]);
    same(&dir.join("whole"), &dir.join("three"));
    // From one plan: the data are not read again. Shards without a unit are in `run/parts/folder.rs`.
    done(dir, &[&STUDY[..], &["--out", "plan", "--plan-only"]].concat());
    let read = |path: &str| std::fs::read(dir.join(path)).unwrap();
    assert!(read("whole/run-plan.json") == read("plan/plan.json"), "the plan that a whole run leaves is the same file");
    for shard in 0..7 {
        let shard = format!("{shard}/7");
        done(
            dir,
            &["-q", "study", "--plan", "plan/plan.json", "--out", "seven", "--shard", &shard, "--backend", "cpu"],
        );
    }
    assert_eq!(done(dir, &["-q", "merge", "seven"]), whole);
    same(&dir.join("whole"), &dir.join("seven"));
    assert_eq!(done(dir, &["-q", "study", "--plan", "plan/plan.json", "--out", "planned", "--backend", "cpu"]), whole);
    same(&dir.join("whole"), &dir.join("planned"));
}

#[test]
fn samples_in_shards_are_the_run_in_one_piece_with_its_convergence() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let whole = done(dir, &[&SAMPLE[..], &["--out", "whole"]].concat());
    for shard in ["6/7", "0/7", "3/7", "1/7", "5/7", "2/7", "4/7"] {
        done(dir, &[&SAMPLE[..], &["--out", "seven", "--shard", shard]].concat());
    }
    assert_eq!(done(dir, &["-q", "merge", "seven"]), whole);
    same(&dir.join("whole"), &dir.join("seven"));
    assert!(dir.join("seven/convergence.svg").exists());
}

#[test]
fn a_folder_that_cannot_give_a_result_says_why_and_what_makes_it() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let refused = |args: &[&str], code: i32, said: &[&str]| {
        let (found, out, err) = lanesweep(dir, args);
        assert_eq!(found, code, "{args:?}: {err}");
        for said in said {
            assert!(flat(&err).contains(said), "{args:?}: {err}");
        }
        assert!(out.is_empty(), "{out}");
    };
    std::fs::create_dir(dir.join("empty")).unwrap();
    refused(&["merge", "empty"], 3, &["plan.json is missing"]);
    refused(&["merge", "nowhere"], 3, &["no such folder"]);
    std::fs::write(dir.join("empty/run.json"), "{}").unwrap();
    refused(&["merge", "empty"], 3, &["an unsplit run"]);
    let shard = |shard: &str, out: &str| done(dir, &[&SAMPLE[..], &["--out", out, "--shard", shard]].concat());
    shard("0/3", "p");
    shard("2/3", "p");
    refused(&["merge", "p"], 3, &["10000 of 30000 units are missing", "--plan p/plan.json --shard 1/3 --out p"]);
    shard("1/3", "p");
    shard("0/1", "p");
    refused(&["merge", "p"], 3, &["doubled"]);
    std::fs::remove_file(dir.join("p/part-00000-of-00001.json")).unwrap();
    // Damaged: one byte.
    let part = dir.join("p/part-00001-of-00003.json");
    let whole = std::fs::read(&part).unwrap();
    let mut damaged = whole.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    std::fs::write(&part, &damaged).unwrap();
    refused(&["merge", "p"], 3, &["part-00001-of-00003.json", "--shard 1/3"]);
    std::fs::write(&part, &whole[..middle]).unwrap();
    refused(&["merge", "p"], 3, &["part-00001-of-00003.json", "no whole part"]);
    // Foreign: the same interval of another run.
    let other = [&SAMPLE[..], &["--out", "q", "--seed", "8", "--shard", "1/3"]].concat();
    done(dir, &other);
    std::fs::copy(dir.join("q/part-00001-of-00003.json"), &part).unwrap();
    refused(&["merge", "p"], 3, &["foreign"]);
    // Under another part's name.
    std::fs::write(&part, std::fs::read(dir.join("p/part-00000-of-00003.json")).unwrap()).unwrap();
    refused(&["merge", "p"], 3, &["its name stands for"]);
    std::fs::write(&part, &whole).unwrap();
    done(dir, &["-q", "merge", "p"]);
    // Another run into the same folder.
    let other = [&SAMPLE[1..], &["--out", "p", "--seed", "8", "--shard", "1/3"]].concat();
    refused(&other, 3, &["holds the plan of another run"]);
    // Of a plan, nothing but what does not change the run.
    refused(&["study", "--plan", "p/plan.json", "--seed", "3"], 2, &["cannot be used with"]);
    refused(&["study", "--plan", "p/plan.json", "--out", "x"], 3, &["a `study plan` is needed"]);
    std::fs::write(dir.join("p/plan.json"), "{}").unwrap();
    refused(&["merge", "p"], 3, &["no whole file of a run in parts"]);
}

/// Replaces the first occurrence of a text in a file.
fn edit(path: &Path, from: &str, to: &str) {
    let bytes = std::fs::read(path).unwrap();
    let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
    std::fs::write(path, [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()).unwrap();
}

/// Two commands in one folder must be refused with status 3 and these words.
fn refused(dir: &Path, args: &[&str], said: &str) {
    let (code, out, err) = lanesweep(dir, args);
    assert!(code == 3 && out.is_empty() && flat(&err).contains(said), "{args:?} gave {code}: {err}");
}

#[test]
fn files_of_another_engine_or_an_earlier_version_are_neither_merged_nor_continued() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let (own, other) = (ENGINE_VERSION, ENGINE_VERSION + 1);
    let (engine, another) = (format!("\"engine\":{own},"), format!("\"engine\":{other},"));
    let is_of_another = format!("of engine {other}, this program has engine {own}");
    for (run, name) in [(&STUDY[..], "study"), (&SAMPLE, "sample")] {
        let shard = |shard: &'static str| [run, &["--out", name, "--shard", shard]].concat();
        let _ = ["0/2", "1/2"].map(|of| done(dir, &shard(of)));
        for file in ["part-00001-of-00002.json", "plan.json"] {
            let path = dir.join(name).join(file);
            let whole = std::fs::read(&path).unwrap();
            edit(&path, &engine, &another);
            refused(dir, &["merge", name], &is_of_another);
            if file != "plan.json" {
                refused(dir, &shard("1/2"), &is_of_another);
            } else {
                let plan = format!("{name}/plan.json");
                refused(dir, &[run[1], "--plan", &plan, "--out", "x"], &is_of_another);
            }
            // As versions before engines wrote it, all in one line.
            let earlier = r#""version":1,"sha256":"00","content":"#;
            std::fs::write(&path, &whole).unwrap();
            edit(&path, &format!("\"version\":3,{engine}"), earlier);
            refused(dir, &["merge", name], "its version is 1, this program reads 3");
            if file == "plan.json" {
                let plan = format!("{name}/plan.json");
                let said = format!("{plan}: its version is 1, this program reads 3");
                refused(dir, &[run[1], "--plan", &plan, "--out", "x"], &said);
            }
            std::fs::write(&path, &whole).unwrap();
        }
        done(dir, &["-q", "merge", name]);
    }
    // The records of whole runs say it too.
    let record =
        |name: &str| -> serde_json::Value { serde_json::from_slice(&std::fs::read(dir.join(name)).unwrap()).unwrap() };
    assert_eq!(
        (&record("study/run.json")["engine"], &record("sample/estimate.json")["engine"]),
        (&own.into(), &own.into())
    );
    let lane = ["simulate", "--from", "sample", "--lane", "#0/2/0.6s/FSM"];
    done(dir, &lane);
    edit(&dir.join("sample/estimate.json"), &format!("\"engine\": {own}"), &format!("\"engine\": {other}"));
    refused(dir, &lane, &is_of_another);
}

#[test]
fn a_shard_reads_its_interval_of_the_plan_and_the_merge_none() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    // More scenarios than stand under one checksum.
    let study = STUDY.map(|word| if word == "2" { "8" } else { word });
    done(dir, &[&study[..], &["--plan-only", "--out", "p"]].concat());
    let path = dir.join("p/plan.json");
    let whole = std::fs::read(&path).unwrap();
    let mut damaged = whole.clone();
    *damaged.last_mut().unwrap() ^= 1;
    std::fs::write(&path, &damaged).unwrap();
    let shard =
        |of: &'static str| ["-q", "study", "--plan", "p/plan.json", "--shard", of, "--out", "p", "--backend", "cpu"];
    done(dir, &shard("0/3"));
    refused(dir, &shard("2/3"), "are damaged: their checksum does not match");
    refused(dir, &["-q", "study", "--plan", "p/plan.json", "--out", "x"], "are damaged");
    // Cut off, or with something behind it: whatever the interval.
    for wrong in [&whole[..whole.len() - 1], &[&whole[..], b"x"].concat()] {
        std::fs::write(&path, wrong).unwrap();
        refused(dir, &shard("1/3"), "cut off or added to");
    }
    std::fs::write(&path, &whole).unwrap();
    let _ = ["1/3", "2/3"].map(|of| done(dir, &shard(of)));
    done(dir, &["-q", "merge", "p"]);
}

#[test]
fn a_damaged_plan_is_whole_again_after_the_command_that_its_message_names() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    for (run, name) in [(&STUDY[..], "study"), (&SAMPLE, "sample")] {
        let again = [run, &["--plan-only", "--out", name]].concat();
        done(dir, &again);
        let path = dir.join(name).join("plan.json");
        let whole = std::fs::read(&path).unwrap();
        let mut damaged = vec![[&whole[..], b"x"].concat()];
        if name == "study" {
            let mut changed = whole.clone();
            *changed.last_mut().unwrap() ^= 1;
            damaged.extend([changed, whole[..whole.len() - 1].to_vec()]);
        }
        for bytes in damaged {
            std::fs::write(&path, &bytes).unwrap();
            let plan = format!("{name}/plan.json");
            let (code, _, err) = lanesweep(dir, &[run[1], "--plan", &plan, "--out", "x"]);
            assert!(code == 3 && err.contains(&plan), "{err}");
            done(dir, &again);
            assert!(std::fs::read(&path).unwrap() == whole, "{name}");
        }
        // What stands before the records names the run: another one's plan is never written over.
        std::fs::write(&path, &whole[..whole.len().min(1000)]).unwrap();
        refused(dir, &again, "this folder holds the plan of another run");
    }
    // A shard that was given a plan leaves a whole one, too.
    done(dir, &[&STUDY[..], &["--plan-only", "--out", "given"]].concat());
    let whole = std::fs::read(dir.join("given/plan.json")).unwrap();
    std::fs::write(dir.join("study/plan.json"), &whole[..whole.len() - 1]).unwrap();
    done(dir, &["-q", "study", "--plan", "given/plan.json", "--shard", "0/9", "--out", "study", "--backend", "cpu"]);
    assert!(std::fs::read(dir.join("study/plan.json")).unwrap() == whole);
}

/// 8,000 scenarios had 22 kB each in a plan: 600 MB to write it, 450 MB to read it.
#[cfg(unix)]
#[test]
fn a_plan_of_many_scenarios_takes_little_memory() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/paper_sumo_01_02_scenarios.jsonl");
    let rows: Vec<serde_json::Value> = std::fs::read_to_string(golden)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .filter(|row: &serde_json::Value| row["kept"] == true)
        .collect();
    let mut text = String::new();
    for number in 0..8000 {
        let mut row = rows[number % rows.len()].clone();
        row["id"] = format!("{}~{number}", row["id"].as_str().unwrap()).into();
        text += &format!("{row}\n");
    }
    std::fs::write(dir.join("many.jsonl"), text).unwrap();
    // Addresses, not memory that is in use: the limit that a shell can set.
    for args in ["--scenarios many.jsonl --plan-only", "--plan p/plan.json --shard 7/400"] {
        let study = format!("-q --threads 1 study --backend cpu --out p {args}");
        let (code, _, err) = limited(dir, "ulimit -v 400000", &study.split(' ').collect::<Vec<_>>());
        assert_eq!(code, 0, "{args}: {err}");
    }
    let bytes = std::fs::metadata(dir.join("p/plan.json")).unwrap().len();
    assert!(bytes < 8000 * 3000, "{bytes} bytes");
}

#[test]
fn an_interrupted_run_continues_and_ends_as_if_undisturbed() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let long = [
        "-q",
        "sample",
        "densities/cut-in-2.json",
        "--backend",
        "cpu",
        "--samples",
        "1000000",
        "--thw",
        "0.6",
        "--threads",
        "1",
    ];
    done(dir, &[&long[..], &["--out", "whole"]].concat());
    for out in [&["--out", "run"][..], &["--out", "parts", "--shard", "0/1"]] {
        let mut interruptions = 0;
        loop {
            let (code, _, err) = lanesweep(dir, &[&long[..], &["--config", "run.stop_after_s=0.3"], out].concat());
            match code {
                0 => break,
                75 => assert!(flat(&err).contains("are done and kept") && err.contains("it continues"), "{err}"),
                other => panic!("{other}: {err}"),
            }
            interruptions += 1;
            assert!(interruptions < 200, "every run must come further: {err}");
        }
        assert!(interruptions > 0, "the run is too short to be interrupted");
    }
    done(dir, &["-q", "merge", "parts"]);
    same(&dir.join("whole"), &dir.join("run"));
    same(&dir.join("whole"), &dir.join("parts"));
}

#[test]
fn two_processes_do_not_compute_the_same_part() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let long =
        ["-q", "sample", "densities/cut-in-2.json", "--backend", "cpu", "--samples", "100000000", "--out", "run"];
    let mut first = start(dir, &long);
    let lock = dir.join("run/run.lock");
    wait_for_run(&mut first, "the lock is taken", || std::fs::read(&lock).is_ok_and(|pid| !pid.is_empty()));
    let (code, out, err) = lanesweep(dir, &long);
    let message = format!("another lanesweep process is writing this part or run (pid {})", first.id());
    kill(first);
    assert_eq!(code, 75, "{err}");
    assert!(flat(&err).contains(&message) && out.is_empty(), "{err}");
}

#[test]
fn parts_share_a_folder_and_keep_whole_runs_and_merges_out() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let run = ["-q", "sample", "densities/cut-in-2.json", "--backend", "cpu", "--samples", "100000000", "--out", "run"];
    let shard = |index: &'static str| [&run[..], &["--shard", index]].concat();
    let mut first = start(dir, &shard("0/2"));
    wait_for_run(&mut first, "the lock is taken", || dir.join("run/part-00000-of-00002.lock").exists());
    let others = [&run[..], &["-q", "merge", "run"], &shard("0/2")].map(|args| lanesweep(dir, args));
    let beside = lanesweep(dir, &[&shard("1/2")[..], &["--config", "run.stop_after_s=0.3"]].concat());
    kill(first);
    for (code, _, err) in others {
        assert_eq!(code, 75, "{err}");
        assert!(flat(&err).contains("another lanesweep process"), "{err}");
    }
    assert_eq!(beside.0, 75, "{}", beside.2);
    assert!(flat(&beside.2).contains("are done and kept"), "{}", beside.2);
}
