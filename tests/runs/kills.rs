//! A run that is killed at any moment leaves the files of one run beside a record, or no record; started again it ends as if
//! undisturbed. Long: `LANESWEEP_KILLS=300 cargo test --release --test commands kills:: -- --nocapture`
#![cfg(unix)]

use crate::common::mined::density_of;
use crate::common::program::{self, Files, ended, kill, names, ran, same, unbroken, without_times, words};
use crate::common::{Folder, folder};

use lanesweep::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Child;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

const LIST: &str = "lanesweep-files.json";

struct Verb {
    name: &'static str,
    /// With it, the files beside it are those of one run; none where each file is a result by itself.
    record: Option<&'static str>,
    /// Makes the result that is there before, with other flags; none for a part of a run.
    older: Option<&'static str>,
    run: &'static str,
}

const STUDY: &str = "study --synth-recordings 1 --config generator.duration_s=120 --config study.compare_reference=true \
                     --rows out/lanes.csv --out out";
const SAMPLE: &str = "sample d.json --thw 0.6 --models RSS --samples 3000 --backend cpu --out out";
const FIT: &str = "fit --synth-recordings 2 --categories cut-in --parameterizations 2 --config fit.valid_draws=999 \
                   --out out";

#[rustfmt::skip] // a table
const VERBS: [Verb; 5] = [
    Verb { name: "study", record: Some("run.json"), older: Some(STUDY), run: "study --plan plan/plan.json --backend cpu --threads 1 --out out" },
    Verb { name: "study --shard", record: None, older: None, run: "study --plan plan/plan.json --shard 0/2 --backend cpu --threads 1 --out out" },
    Verb { name: "merge", record: Some("run.json"), older: Some(STUDY), run: "merge out" },
    Verb { name: "sample", record: Some("estimate.json"), older: Some(SAMPLE),
           run: "sample d.json --estimator is --samples 10000 --thw 0.6 --models RSS,FSM --backend cpu --out out" },
    Verb { name: "fit", record: None, older: Some(FIT),
           run: "fit --synth-recordings 3 --categories cut-in --config fit.valid_draws=1000 --out out" },
];

fn start(dir: &Path, line: &str) -> Child {
    program::start(dir, &words(&format!("-q {line}")))
}

fn done(dir: &Path, line: &str) {
    ran(dir, &format!("-q {line}"));
}

/// The search that a sample keeps while it draws.
const SEARCH: &str = "search.json";

/// Not a result: the plan, and what is there only while a run is at work.
fn is_beside(name: &str) -> bool {
    let is_hidden = name.rsplit('/').next().is_some_and(|name| name.starts_with('.'));
    let is_of_work = is_hidden || name.ends_with(".lock") || name.ends_with(".journal");
    is_of_work || name == "plan.json" || name == LIST
}

fn is_switching(dir: &Path) -> bool {
    std::fs::read_to_string(dir.join(LIST)).is_ok_and(|text| text.contains("\"is_complete\":false"))
}

fn files(dir: &Path) -> Files {
    let mut files = program::files(dir);
    files.retain(|name, _| !is_beside(name));
    files
}

/// The results of a folder; the search that a sample keeps until it ends is none.
fn results(dir: &Path) -> Files {
    let mut files = files(dir);
    files.retain(|name, _| name != SEARCH);
    files
}

/// `out` as a copy of another folder, or empty.
fn put(dir: &Path, from: Option<&str>) {
    let _ = std::fs::remove_dir_all(dir.join("out"));
    std::fs::create_dir(dir.join("out")).unwrap();
    if let Some(from) = from {
        program::copy(&dir.join(from), &dir.join("out"));
    }
}

/// A folder with a density, a plan and the parts of its run, which are made once.
fn furnished() -> Folder {
    static MADE: LazyLock<Files> = LazyLock::new(|| {
        let dir = &*crate::common::folder();
        write_density(&dir.join("d.json"), &density_of(2, Category::CutIn, "2", false)).unwrap();
        done(dir, "study --synth-recordings 1 --config study.reference=true --dt 0.02 --plan-only --out plan");
        program::copy(&dir.join("plan"), &dir.join("parts"));
        let _ = ["0/2", "1/2"]
            .map(|shard| done(dir, &format!("study --plan plan/plan.json --shard {shard} --backend cpu --out parts")));
        program::files(dir)
    });
    let dir = folder();
    program::put(&MADE, &dir);
    dir
}

/// Where `out` starts from: parts for a merge, the older result.
fn base(dir: &Path, verb: &Verb, is_over_older: bool) -> Option<String> {
    let parts = (verb.name == "merge").then_some("parts");
    let older = verb.older.filter(|_| is_over_older)?;
    let name = format!("older-{}", verb.name);
    if !dir.join(&name).exists() {
        put(dir, parts);
        done(dir, older);
        std::fs::rename(dir.join("out"), dir.join(&name)).unwrap();
    }
    Some(name)
}

/// Nothing that a killed process left may stay.
fn assert_tidy(dir: &Path, what: &str) {
    let left: Vec<String> = names(&dir.join("out")).into_iter().filter(|name| name.starts_with('.')).collect();
    assert!(left.is_empty(), "{what}: {left:?}");
}

#[test]
fn a_killed_run_leaves_one_runs_files_and_ends_as_if_undisturbed() {
    let kills: usize = std::env::var("LANESWEEP_KILLS").map_or(VERBS.len(), |text| text.parse().unwrap());
    let dir = &*furnished();
    let mut undisturbed: BTreeMap<(usize, bool), (Duration, Files)> = BTreeMap::new();
    let (mut alive, mut continued, mut switching, mut recorded) = (0, 0, 0, 0);
    for at_kill in 0..kills {
        let (at, round) = (at_kill % VERBS.len(), at_kill / VERBS.len());
        let verb = &VERBS[at];
        let is_over_older = verb.older.is_some() && (at + round / 2) % 2 == 0;
        let parts = (verb.name == "merge").then(|| "parts".to_owned());
        let from = base(dir, verb, is_over_older).or(parts);
        let what = format!("kill {at_kill} of {}, over an older run: {is_over_older}", verb.name);
        let (took, expected) = undisturbed.entry((at, is_over_older)).or_insert_with(|| {
            put(dir, from.as_deref());
            let started = Instant::now();
            done(dir, verb.run);
            (started.elapsed(), without_times(files(&dir.join("out"))))
        });
        put(dir, from.as_deref());
        let before = results(&dir.join("out"));
        let mut child = start(dir, verb.run);
        if round % 2 == 0 && verb.record.is_some() {
            // As soon as the files get their names, or shortly after.
            while !is_switching(&dir.join("out")) && child.try_wait().unwrap().is_none() {}
            std::thread::sleep(Duration::from_micros(at_kill as u64 * 377 % 3000));
        } else {
            // A low-discrepancy sequence of moments over the whole run.
            let share = (at_kill as f64 * 0.618_033_988_749_895 + 0.5).fract();
            std::thread::sleep(Duration::from_secs_f64(took.as_secs_f64() * share));
        }
        alive += usize::from(kill(child));

        let out = dir.join("out");
        continued += usize::from(names(&out).iter().any(|name| name.ends_with(".journal")));
        let found = results(&out);
        match verb.record {
            Some(record) if found.contains_key(record) => {
                recorded += 1;
                if found != before {
                    same(&without_times(found), expected, &what);
                }
            }
            Some(_) => switching += usize::from(is_switching(&out)),
            None => {
                for (name, content) in &found {
                    assert!(before.get(name) == Some(content) || expected.get(name) == Some(content), "{what}: {name}");
                }
            }
        }
        done(dir, verb.run);
        same(&without_times(files(&out)), expected, &what);
        assert_tidy(dir, &what);
    }
    println!(
        "{kills} kills: {alive} at work, {continued} with a journal, {switching} while files got their names, \
         {recorded} with a record; all results identical"
    );
    assert!(alive > 0, "no run was killed before its end");
}

#[test]
fn scenarios_and_what_was_driven_for_them_are_of_one_run_after_a_kill() {
    let dir = &*crate::common::folder();
    for (data, seed) in [("a", 1), ("b", 2)] {
        let small = "--synth-recordings 1 --config generator.duration_s=60";
        done(dir, &format!("tracks --convert {data} {small} --config generator.seed={seed}"));
    }
    put(dir, None);
    let mine = |data: &str| format!("mine {data} --out out/s.jsonl");
    let expected = ["a", "b"].map(|data| {
        done(dir, &mine(data));
        files(&dir.join("out"))
    });
    for at_kill in 0..4 {
        let (data, new, old) = if at_kill % 2 == 0 { ("a", 0, 1) } else { ("b", 1, 0) };
        let mut child = start(dir, &mine(data));
        while names(&dir.join("out")).iter().all(|name| !name.ends_with(".part")) && child.try_wait().unwrap().is_none()
        {
        }
        std::thread::sleep(Duration::from_micros(at_kill * 700));
        kill(child);
        let found = files(&dir.join("out"));
        if found.contains_key("s.exposure.json") {
            assert!(found == expected[new] || found == expected[old], "kill {at_kill}: {:?}", found.keys());
        }
        done(dir, &mine(data));
        same(&files(&dir.join("out")), &expected[new], "mine");
        assert_tidy(dir, "mine");
    }
}

#[test]
fn of_two_processes_on_one_folder_each_ends_as_if_alone_or_is_refused() {
    let every = if std::env::var_os("LANESWEEP_KILLS").is_some() { 1 } else { 3 };
    let dir = &*furnished();
    let alone = VERBS.map(|verb| {
        put(dir, Some("parts"));
        done(dir, verb.run);
        without_times(files(&dir.join("out")))
    });
    let all = (0..VERBS.len()).flat_map(|a| (a..VERBS.len()).map(move |b| [a, b]));
    for at in all.step_by(every) {
        put(dir, Some("parts"));
        let children = at.map(|k| start(dir, VERBS[k].run));
        let codes = children.map(ended).map(|(code, said)| (code, unbroken(said.as_bytes())));
        let what = format!("{} and {}: {codes:?}", VERBS[at[0]].name, VERBS[at[1]].name);
        for (code, said) in &codes {
            match code {
                0 => {}
                75 => assert!(said.contains("another lanesweep process"), "{what}"),
                // It came after the other, whose result it would have mixed with its own.
                2 => assert!(said.contains("results of another verb"), "{what}"),
                _ => panic!("{what}"),
            }
        }
        let ended: Vec<usize> = (0..2).filter(|&k| codes[k].0 == 0).map(|k| at[k]).collect();
        assert!(!ended.is_empty(), "{what}");
        let found = without_times(files(&dir.join("out")));
        let is_replaced = ended.len() == 2 && VERBS[at[0]].record == VERBS[at[1]].record;
        if is_replaced && VERBS[at[0]].record.is_some() {
            assert!(found == alone[at[0]] || found == alone[at[1]], "{what}: {:?}", found.keys());
        } else {
            same(&found, &ended.iter().flat_map(|&k| alone[k].clone()).collect(), &what);
        }
        assert_tidy(dir, &what);
    }
}
