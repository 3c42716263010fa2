//! What a run must never do to its user's files. Locks are in `mechanisms.rs`.

use crate::common::program::{json, names, ran, refused};
use crate::common::{self, program};

use std::path::Path;
use std::process::Stdio;

/// The golden scenarios as `s.jsonl`.
fn scenarios(dir: &Path) {
    std::fs::copy(common::golden("paper_sumo_01_02_scenarios.jsonl"), dir.join("s.jsonl")).unwrap();
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn an_output_never_replaces_an_input_or_another_result() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, "-q tracks --convert in --synth-recordings 1 --config generator.duration_s=60");
    let tracks = read(&dir.join("in/01_tracks.csv"));
    refused(dir, "mine in --out in/01_tracks.csv", 2, "no format");
    refused(dir, "study in --rows in/01_tracks.csv --out out", 2, "would be overwritten");
    // A folder of recordings holds no run, before and after: neither run begins.
    for _ in 0..2 {
        refused(dir, "study in --out in", 2, "a new or empty folder");
    }
    assert!(read(&dir.join("in/01_tracks.csv")) == tracks);
    scenarios(dir);
    for rows in ["s.jsonl", "out/results.csv"] {
        refused(dir, &format!("study --scenarios s.jsonl --rows {rows} --out out"), 2, "would be overwritten");
    }
    std::fs::write(dir.join("cases.csv"), "category,ego_speed_kmh,thw_s,acceleration_mps2\nlvd,60,1,-5\n").unwrap();
    refused(dir, "check cases.csv --profiles un-r157 --rows cases.csv", 2, "would be overwritten");
}

#[test]
fn what_the_run_before_left_goes_and_what_no_record_lists_stays() {
    let dir = tempfile::tempdir().unwrap();
    let (dir, out) = (dir.path(), dir.path().join("out"));
    scenarios(dir);
    ran(dir, "-q study --scenarios s.jsonl --config study.compare_reference=true --out out");
    assert!(out.join("figures/radar-cut-in.svg").exists() && out.join("tables/reference.csv").exists());
    // The second has a name that a study could give.
    let mine = ["notes.txt", "figures/radar-of-mine.svg"];
    mine.iter().for_each(|name| std::fs::write(out.join(name), "mine").unwrap());
    ran(dir, "-q study --scenarios s.jsonl --categories lvd --out out");
    assert!(!out.join("figures/radar-cut-in.svg").exists() && !out.join("tables/reference.csv").exists());
    assert!(out.join("figures/radar-lvd.svg").exists());
    mine.iter().for_each(|name| assert_eq!(read(&out.join(name)), "mine"));
}

#[test]
fn a_reader_that_goes_away_loses_no_result() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    scenarios(dir);
    let study = program::words("study --scenarios s.jsonl --categories lvd --out out");
    let mut run = program::command(dir, &study).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(run.stdout.take());
    let (code, said) = program::ended(run);
    assert!(code == 0 && !said.contains("panicked") && dir.join("out/run.json").exists(), "{code}: {said}");
}

#[test]
fn a_foreign_index_of_exported_scenarios_and_a_file_of_their_name_stay() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let export = "simulate --category lvd --models FSM --ego-speed 30m/s --thw 1 --acceleration=-5 --xosc .";
    std::fs::write(dir.join("a.csv"), "mine").unwrap();
    for (name, content, held) in
        [("index.csv", "file,label\na.csv,1\n", "a.csv"), ("001-lvd_1s_FSM.xosc", "mine", "001-lvd_1s_FSM.xosc")]
    {
        std::fs::write(dir.join(name), content).unwrap();
        refused(dir, export, 2, &format!("it holds {held}"));
        assert_eq!((read(&dir.join(name)).as_str(), read(&dir.join("a.csv")).as_str()), (content, "mine"));
        std::fs::remove_file(dir.join(name)).unwrap();
    }
}

/// Of each way of writing, a file.
#[cfg(unix)]
#[test]
fn a_folder_from_somebody_else_makes_no_run_write_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let (dir, out) = (dir.path(), dir.path().join("out"));
    scenarios(dir);
    std::fs::write(dir.join("precious"), "mine").unwrap();
    let study = "-q study --scenarios s.jsonl --categories lvd --out out";
    for (run, name, code) in [
        (study, "run.lock", 3),
        (study, "results.csv", 2),
        (study, "run-plan.json", 2),
        (&format!("{study} --shard 0/1"), "part-00000-of-00001.lock", 3),
        (&format!("{study} --shard 0/1"), "part-00000-of-00001.journal", 3),
        ("-q tracks --convert out --synth-recordings 1 --config generator.duration_s=20", "01_tracksMeta.csv", 2),
    ] {
        std::fs::create_dir(&out).unwrap();
        std::os::unix::fs::symlink(dir.join("precious"), out.join(name)).unwrap();
        // A folder that is not ours holds nothing of a run: any file there ends it.
        let held = format!("it holds {name}");
        refused(dir, run, code, if code == 2 { &held } else { "this is a link" });
        assert_eq!(read(&dir.join("precious")), "mine", "{run}, {name}");
        std::fs::remove_dir_all(&out).unwrap();
    }
}

#[test]
fn a_journal_replaces_no_file_of_the_users_and_has_one_writer() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    scenarios(dir);
    let study = "-q study --categories lvd --scenarios s.jsonl --shard 0/2 --out out";
    let journal = dir.join("out/part-00000-of-00002.journal");
    std::fs::create_dir(dir.join("out")).unwrap();
    std::fs::write(&journal, "my notes\n").unwrap();
    refused(dir, study, 3, "this is no journal of lanesweep");
    assert_eq!(read(&journal), "my notes\n");
    std::fs::remove_file(&journal).unwrap();
    let lock = dir.join("out/part-00000-of-00002.lock");
    let held = lanesweep::support::lock::FolderLock::acquire(&lock).unwrap();
    refused(dir, study, 75, "another lanesweep process");
    drop(held);
    ran(dir, study);
}

/// What a folder of results or a document says of its data.
fn is_synthetic(value: &serde_json::Value) -> bool {
    let label = value.pointer("/synthetic").or(value.pointer("/density/provenance/synthetic"));
    label.and_then(serde_json::Value::as_bool).expect("the document says whether its data are made up")
}

#[test]
fn the_label_of_made_up_data_is_in_the_data_and_follows_them_everywhere() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, "-q tracks --convert recordings --synth-recordings 2 --config generator.duration_s=150");
    // Copied without the sentence beside them, as among recordings of other origin.
    std::fs::remove_file(dir.join("recordings/SYNTHETIC.txt")).unwrap();
    ran(dir, "-q mine recordings --out s.jsonl");
    // What was driven is told beside the file, which may be lost too.
    std::fs::remove_file(dir.join("s.exposure.json")).unwrap();
    let mut files = vec!["recordings", "--scenarios s.jsonl", "--scenarios s.csv"];
    if cfg!(feature = "parquet") {
        ran(dir, "-q mine recordings --out s.parquet");
        std::fs::remove_file(dir.join("s.parquet.exposure.json")).unwrap();
        files.push("--scenarios s.parquet");
    }
    std::fs::write(
        dir.join("s.csv"),
        "id,category,ego_speed_mps,time_s,ego_length,ego_width,side,target_length,target_width,target_v,\
         target_y,synthetic\na,cut-in,30,0,4,2,left,4,2,20,3.5,1\na,,,1,,,,,,20,2.5,\n",
    )
    .unwrap();
    for file in files {
        let report = ran(dir, &format!("-q study {file} --out out")).replace('\n', " ");
        assert!(report.contains("No number here is a statement about real traffic"), "{file}");
        assert!(is_synthetic(&json(&dir.join("out/run.json"))), "{file}");
        for figure in names(&dir.join("out")).iter().filter(|name| name.ends_with(".svg")) {
            assert!(read(&dir.join("out").join(figure)).contains("SYNTHETIC DATA"), "{figure}");
        }
    }
    let id = read(&dir.join("s.jsonl")).lines().next().map(|line| line.parse::<serde_json::Value>().unwrap()).unwrap();
    let lane = format!("--scenarios s.jsonl --lane {}/S/1.2s/RSS", id["id"].as_str().unwrap());
    for line in [
        "fit --scenarios s.jsonl --categories lvd --parameterizations i --config fit.valid_draws=1000 --out i.json",
        "sample i.json --samples 500 --thw 0.6 --out sampled",
        &format!("simulate {lane}"),
    ] {
        assert!(is_synthetic(&ran(dir, &format!("-q {line} --format json")).parse().unwrap()), "{line}");
    }
    ran(dir, &format!("-q simulate --xosc played {lane}"));
    let played = names(&dir.join("played")).into_iter().find(|name| name.ends_with(".xosc")).unwrap();
    assert!(read(&dir.join("played").join(played)).contains("SYNTHETIC DATA"));
}

#[test]
fn a_file_of_recorded_and_made_up_scenarios_is_made_up_and_one_of_recorded_ones_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let golden = read(&common::golden("paper_sumo_01_02_scenarios.jsonl"));
    let mixed = golden.replacen("{", "{\"synthetic\":true,", 1);
    for (text, is_made_up) in [(&golden, false), (&mixed, true)] {
        std::fs::write(dir.join("s.jsonl"), text).unwrap();
        let study = ran(dir, "-q study --scenarios s.jsonl --out out");
        assert_eq!(is_synthetic(&json(&dir.join("out/run.json"))), is_made_up);
        assert_eq!(study.contains("SYNTHETIC DATA"), is_made_up);
    }
}

#[test]
fn converted_recordings_of_one_name_stay_apart_and_made_up_and_replace_no_file() {
    let dir = tempfile::tempdir().unwrap();
    let (dir, out) = (dir.path(), dir.path().join("out"));
    for seed in [1, 2] {
        let small = "--synth-recordings 2 --config generator.duration_s=60";
        ran(dir, &format!("-q tracks --convert v{seed} {small} --config generator.seed={seed}"));
    }
    let convert = "-q tracks v1 v2 --convert out";
    // A file of the user's with the name of one of them.
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("03_tracksMeta.csv"), "mine").unwrap();
    refused(dir, convert, 2, "it holds 03_tracksMeta.csv");
    assert_eq!(program::files(&out).get("03_tracksMeta.csv").unwrap(), b"mine");
    std::fs::remove_file(out.join("03_tracksMeta.csv")).unwrap();
    ran(dir, convert);
    let record = json(&out.join("converted.json"));
    let names = record["recordings"].as_array().unwrap().iter().map(|of| (of["recording"].clone(), of["of"].clone()));
    let pairs = [("01", "01"), ("02", "02"), ("03", "01-2"), ("04", "02-2")];
    assert!(names.eq(pairs.map(|(name, of)| (name.into(), of.into()))), "{record}");
    // The scenarios of all four are found, and said to be made up.
    let mined = |folder: &str| {
        ran(dir, &format!("-q mine {folder} --out mined.jsonl"));
        read(&dir.join("mined.jsonl")).lines().map(|line| line.parse().unwrap()).collect::<Vec<_>>()
    };
    let (v1, v2, all) = (mined("v1"), mined("v2"), mined("out"));
    assert_eq!(all.len(), v1.len() + v2.len());
    assert!(all.iter().all(is_synthetic));
    // A second conversion replaces the first, unless somebody else wrote there.
    ran(dir, "-q tracks v1 --convert out");
    assert!(out.join("02_tracks.csv").exists() && !out.join("03_tracks.csv").exists());
    std::fs::write(out.join("01_tracks.csv"), "mine").unwrap();
    refused(dir, convert, 2, "01_tracks.csv was changed");
}
