//! What a run must never do to its user's files.

use crate::common;

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

fn lanesweep(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lanesweep")).env("NO_COLOR", "1").args(args).output().unwrap()
}

fn refused(args: &[&str], hint: &str) {
    refused_with(2, args, hint);
}

fn refused_with(code: i32, args: &[&str], hint: &str) {
    let output = lanesweep(args);
    let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    assert!(said.contains(hint), "{args:?} should say `{hint}`: {said}");
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn an_output_never_replaces_an_input_or_another_result() {
    let dir = tempfile::tempdir().unwrap();
    let (recordings, out) = (dir.path().join("recordings"), dir.path().join("out"));
    let made = lanesweep(&[
        "-q",
        "synth",
        text(&recordings),
        "--synth-recordings",
        "1",
        "--config",
        "generator.duration_s=60",
    ]);
    assert!(made.status.success());
    let tracks = recordings.join("01_tracks.csv");
    let before = std::fs::read(&tracks).unwrap();
    refused(&["mine", text(&recordings), "--out", text(&tracks)], "would be overwritten");
    refused(&["study", text(&recordings), "--rows", text(&tracks), "--out", text(&out)], "would be overwritten");
    refused(&["synth", text(&recordings), "--synth-recordings", "1"], "already holds a recording");
    assert!(std::fs::read(&tracks).unwrap() == before);

    let scenarios = dir.path().join("scenarios.jsonl");
    std::fs::copy(common::golden("paper_sumo_01_02_scenarios.jsonl"), &scenarios).unwrap();
    let study = |lanes: &Path| {
        refused(
            &["study", "--scenarios", text(&scenarios), "--rows", text(lanes), "--out", text(&out)],
            "would be overwritten",
        );
    };
    study(&scenarios);
    std::fs::create_dir(&out).unwrap();
    study(&out.join("f1.csv"));
}

#[test]
fn a_study_on_written_synthetic_recordings_still_says_synthetic() {
    let dir = tempfile::tempdir().unwrap();
    let (recordings, out) = (dir.path().join("recordings"), dir.path().join("out"));
    lanesweep(&["-q", "synth", text(&recordings), "--synth-recordings", "1", "--config", "generator.duration_s=120"]);
    let study = lanesweep(&["-q", "study", text(&recordings), "--out", text(&out)]);
    assert!(String::from_utf8_lossy(&study.stdout).contains("SYNTHETIC DATA"), "{study:?}");
}

#[test]
fn what_an_earlier_run_left_in_the_folder_does_not_stay_beside_a_new_record() {
    let dir = tempfile::tempdir().unwrap();
    let (scenarios, out) = (common::golden("paper_sumo_01_02_scenarios.jsonl"), dir.path().join("out"));
    let run = |more: &[&str]| {
        let args = ["-q", "study", "--scenarios", text(&scenarios), "--out", text(&out)];
        let output = lanesweep(&[&args[..], more].concat());
        assert!(output.status.success(), "{output:?}");
    };
    run(&["--config", "study.compare_reference=true"]);
    assert!(out.join("radar-cut-in.svg").exists() && out.join("reference.csv").exists());
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    run(&["--categories", "lvd"]);
    assert!(!out.join("radar-cut-in.svg").exists() && !out.join("reference.csv").exists());
    assert!(out.join("radar-lvd.svg").exists());
    assert!(out.join("notes.txt").exists(), "only our own files are taken away");
}

#[test]
fn files_that_no_record_lists_stay_whatever_they_are_called() {
    let dir = tempfile::tempdir().unwrap();
    let (density, out) = (dir.path().join("d.json"), dir.path().join("out"));
    let fit = ["fit", "--synth-recordings", "2", "--categories", "cut-in", "--parameterizations", "2"];
    let run = |args: &[&str]| {
        let output = lanesweep(&[&["-q"], args].concat());
        assert!(output.status.success(), "{output:?}");
    };
    run(&[&fit[..], &["--out", text(&density)]].concat());
    std::fs::create_dir(&out).unwrap();
    let mine =
        ["map-of-germany.svg", "estimates.csv.svg", "estimates-of-mine.csv", "headways.json", "proposal-letter.html"];
    mine.iter().for_each(|name| std::fs::write(out.join(name), "mine").unwrap());
    let sample = ["sample", text(&density), "--samples", "500", "--models", "FSM", "--out", text(&out)];
    run(&[&sample[..], &["--thw", "0.6,0.2"]].concat());
    assert!(out.join("headways.svg").exists());
    run(&[&sample[..], &["--thw", "0.6"]].concat());
    assert!(!out.join("headways.svg").exists(), "what the record lists goes with it");
    for name in mine {
        assert_eq!(std::fs::read_to_string(out.join(name)).unwrap(), "mine", "{name}");
    }
}

#[test]
fn files_that_a_foreign_record_names_stay_and_the_record_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = text(dir.path());
    let at = |name: &str| dir.path().join(name);
    let kept = |names: &[(&str, &str)]| {
        for (name, content) in names {
            assert_eq!(&std::fs::read_to_string(at(name)).unwrap(), content, "{name}");
            std::fs::remove_file(at(name)).unwrap();
        }
    };
    let lvd = ["export", "xosc", "--category", "lvd", "--models", "FSM", "--ego-speed", "30m/s", "--thw", "1"];
    let export = [&lvd[..], &["--acceleration=-5", "--out", out]].concat();
    let map = [
        "map",
        "lvd",
        "--x",
        "deceleration_mps2=2,4",
        "--y",
        "ego_speed_kmh=60,90",
        "--set",
        "thw_s=1.2",
        "--out",
        out,
    ];
    let foreign = r#"{"program":"QGIS 3","files":["a.csv"]}"#;
    for (run, record, content) in [(&export[..], "index.csv", "file,label\na.csv,1\n"), (&map, "map.json", foreign)] {
        std::fs::write(at("a.csv"), "mine").unwrap();
        std::fs::write(at(record), content).unwrap();
        refused(run, record);
        kept(&[("a.csv", "mine"), (record, content)]);
    }
    // A result's own name, and a name that only this run of the verb has.
    for (run, name) in [(&export[..], "001-lvd_S_1s_FSM.xosc"), (&map, "report.html"), (&map, "map-FSM-collision.svg")]
    {
        std::fs::write(at(name), "mine").unwrap();
        let output = lanesweep(run);
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(output.status.code() == Some(2) && said.contains(name), "{said}");
        }
        kept(&[(name, "mine")]);
    }
}

#[cfg(unix)]
#[test]
fn a_search_and_manual_pages_replace_no_file_of_the_users_and_follow_no_link() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let fit = ["-q", "fit", "--synth-recordings", "2", "--categories", "cut-in", "--parameterizations", "2"];
    assert!(lanesweep(&[&fit[..], &["--out", text(&at("d.json"))]].concat()).status.success());
    let density = at("d.json");
    let sample = ["-q", "sample", text(&density), "--estimator", "is", "--samples", "1000"];
    let out = at("out");
    let sample = [&sample[..], &["--models", "RSS", "--thw", "0.6", "--out", text(&out)]].concat();
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("search.json"), "mine").unwrap();
    refused(&sample, "search.json");
    assert_eq!(std::fs::read_to_string(out.join("search.json")).unwrap(), "mine");
    std::fs::write(at("precious"), "mine").unwrap();
    let link = |path: &Path| {
        let _ = std::fs::remove_file(path);
        std::os::unix::fs::symlink(at("precious"), path).unwrap();
    };
    link(&out.join("search.json"));
    std::fs::create_dir(at("man1")).unwrap();
    link(&at("man1/lanesweep-study.1"));
    for run in [&sample[..], &["config", "man", text(&at("man1"))]] {
        let output = lanesweep(run);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(3) && said.contains("this is a link"), "{said}");
        assert_eq!(std::fs::read_to_string(at("precious")).unwrap(), "mine");
    }
}

#[test]
fn lanes_of_a_run_without_its_density_say_how_to_get_it_back() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (density, out) = (at("d.json"), at("out"));
    let fit = ["-q", "fit", "--synth-recordings", "2", "--categories", "cut-in", "--parameterizations", "2"];
    assert!(lanesweep(&[&fit[..], &["--out", text(&density)]].concat()).status.success());
    let sample =
        ["-q", "sample", text(&density), "--samples", "500", "--thw", "0.6", "--models", "FSM", "--out", text(&out)];
    assert!(lanesweep(&sample).status.success());
    // The density of the run, damaged and missing: what makes it again is the run.
    let simulate = ["simulate", "--from", text(&out), "--lane", "#77/2/0.6s/FSM"];
    assert!(lanesweep(&simulate).status.success());
    std::fs::write(out.join("density.json"), "{}").unwrap();
    refused_with(3, &simulate, "run `lanesweep sample` into this folder again");
    std::fs::remove_file(out.join("density.json")).unwrap();
    refused_with(3, &simulate, "density.json: the density of the run is missing");
}

#[cfg(unix)]
#[test]
fn a_folder_from_somebody_else_makes_no_run_write_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let (density, precious) = (dir.path().join("d.json"), dir.path().join("precious"));
    let fit = ["-q", "fit", "--synth-recordings", "2", "--categories", "cut-in", "--parameterizations", "2"];
    assert!(lanesweep(&[&fit[..], &["--out", text(&density)]].concat()).status.success());
    std::fs::write(&precious, "mine").unwrap();
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let study = ["-q", "study", "--scenarios", text(&scenarios), "--categories", "lvd"];
    let sample = ["-q", "sample", text(&density), "--samples", "500", "--thw", "0.6", "--models", "FSM"];
    let map = ["-q", "map", "lvd", "--x", "deceleration_mps2=2,4", "--y", "ego_speed_kmh=60,90", "--set", "thw_s=1.2"];
    let part = [&study[..], &["--shard", "0/1"]].concat();
    let links: [(&[&str], &[&str]); 5] = [
        (&study, &["run.lock", "run.json", "f1.csv", "run-plan.json", "lanesweep-files.json"]),
        (&part, &["run.lock", "part-00000-of-00001.lock", "part-00000-of-00001.journal"]),
        (&sample, &["run.lock", "estimate.json", "estimates.csv"]),
        (&map, &["run.lock", "map.json", "cells.csv"]),
        (
            &["-q", "synth", "--synth-recordings", "1", "--config", "generator.duration_s=20"],
            &["run.lock", "01_tracksMeta.csv"],
        ),
    ];
    for (run, names) in links {
        for name in names {
            let out = dir.path().join("out");
            std::fs::create_dir(&out).unwrap();
            std::os::unix::fs::symlink(&precious, out.join(name)).unwrap();
            let into: &[&str] = if run[1] == "synth" { &[text(&out)] } else { &["--out", text(&out)] };
            let output = lanesweep(&[run, into].concat());
            let said = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(output.status.code(), Some(3), "{run:?}, {name}: {said}");
            assert!(said.contains("this is a link"), "{run:?}, {name}: {said}");
            assert_eq!(std::fs::read_to_string(&precious).unwrap(), "mine", "{run:?}, {name}");
            std::fs::remove_dir_all(&out).unwrap();
        }
    }
}

#[cfg(unix)]
#[test]
fn a_journal_replaces_no_file_of_the_users_follows_no_link_and_has_one_writer() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (density, scenarios, precious) = (at("d.json"), at("s.jsonl"), at("precious"));
    let ran = |args: &[&str]| {
        let output = lanesweep(&[&["-q"], args].concat());
        assert!(output.status.success(), "{args:?}: {output:?}");
    };
    ran(&["synth", text(&at("data")), "--synth-recordings", "2"]);
    ran(&["mine", text(&at("data")), "--out", text(&scenarios)]);
    let fit = ["fit", "--scenarios", text(&scenarios), "--categories", "cut-in", "--parameterizations", "2"];
    ran(&[&fit[..], &["--out", text(&density)]].concat());
    std::fs::write(&precious, "mine").unwrap();
    let (data, shard) = (["--scenarios", text(&scenarios)], ["--shard", "0/2"]);
    let study = [&["-q", "study", "--categories", "lvd"], &data[..], &shard].concat();
    let sample = [&["-q", "sample", text(&density), "--samples", "1000"][..], &shard].concat();
    let runs: [(&[&str], &str, &str); 2] = [
        (&study, "part-00000-of-00002.journal", "part-00000-of-00002.lock"),
        (&sample, "part-00000-of-00002.journal", "part-00000-of-00002.lock"),
    ];
    for (run, journal, lock) in runs {
        let out = at("out");
        let run = [run, &["--out", text(&out)]].concat();
        std::fs::create_dir(&out).unwrap();
        std::fs::write(out.join(journal), "my notes\n").unwrap();
        refused_with(3, &run, "this is no journal of lanesweep");
        assert_eq!(std::fs::read_to_string(out.join(journal)).unwrap(), "my notes\n", "{run:?}");
        std::fs::remove_file(out.join(journal)).unwrap();
        std::os::unix::fs::symlink(&precious, out.join(journal)).unwrap();
        refused_with(3, &run, "this is a link");
        assert_eq!(std::fs::read_to_string(&precious).unwrap(), "mine", "{run:?}");
        std::fs::remove_file(out.join(journal)).unwrap();
        let held = lanesweep::support::lock::FolderLock::acquire(&out.join(lock)).unwrap();
        refused_with(75, &run, "another lanesweep process");
        drop(held);
        ran(&run[1..]);
        std::fs::remove_dir_all(&out).unwrap();
    }
}

#[test]
fn a_folder_holds_the_run_of_one_verb() {
    let dir = tempfile::tempdir().unwrap();
    let map = ["-q", "map", "lvd", "--x", "deceleration_mps2=2,4", "--y", "ego_speed_kmh=60,90", "--set", "thw_s=1.2"];
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let out = text(dir.path());
    assert!(lanesweep(&[&map[..], &["--out", out]].concat()).status.success());
    let page = std::fs::read(dir.path().join("report.html")).unwrap();
    refused(&["study", "--scenarios", text(&scenarios), "--out", out], "the results of another verb");
    assert!(std::fs::read(dir.path().join("report.html")).unwrap() == page);
}

#[test]
fn values_that_no_lane_can_hold_are_refused_with_their_line() {
    let dir = tempfile::tempdir().unwrap();
    let scenarios = dir.path().join("scenarios.jsonl");
    let golden = std::fs::read_to_string(common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    std::fs::write(&scenarios, golden.replacen("\"v0\":34.39", "\"v0\":1e300", 1)).unwrap();
    let study = lanesweep(&["study", "--scenarios", text(&scenarios), "--out", text(&dir.path().join("out"))]);
    let said = String::from_utf8_lossy(&study.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(study.status.code(), Some(4), "{said}");
    assert!(said.contains("line 1") && said.contains("ego.v0"), "{said}");
    refused(
        &[
            "simulate",
            "--category",
            "lvd",
            "--models",
            "FSM",
            "--ego-speed",
            "30m/s",
            "--gap",
            "1e300",
            "--acceleration=-5",
        ],
        "at most 1e6",
    );
}

#[test]
fn flags_that_would_not_be_heeded_and_absurd_numbers_of_threads_are_refused() {
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let lane = "01_cut_in_81_74_836/S/1.2s/RSS";
    refused(&["simulate", "--scenarios", text(&scenarios), "--lane", lane, "--gap", "5"], "would be ignored");
    refused(&["study", "--threads", "100000000"], "expected a whole number from 1 to");
    let dt = ["--config", "run.dt_s=0.05"];
    refused(&[&["simulate", "--from", "run", "--lane", lane][..], &dt].concat(), "`run.dt_s` is decided by the run");
    refused(
        &[&["export", "xosc", "--from", "run", "--lane", lane][..], &dt].concat(),
        "is decided by the run (--from)",
    );
    let check = ["check", "--category", "lvd", "--ego-speed", "30m/s", "--thw", "1", "--acceleration", "-6"];
    refused(&[&check[..], &dt].concat(), "`run.dt_s` has no effect on a check");
    for data in [&["--scenarios", text(&scenarios)][..], &["recordings"]] {
        refused(&[&["study", "--synth-recordings", "2"], data].concat(), "cannot be used with");
    }
}

/// What a folder of results or a document says of its data.
fn is_synthetic(json: &[u8]) -> bool {
    let value: serde_json::Value = serde_json::from_slice(json).unwrap();
    let label = value.pointer("/synthetic").or(value.pointer("/density/provenance/synthetic"));
    label.and_then(serde_json::Value::as_bool).expect("the document says whether its data are made up")
}

#[test]
fn the_label_of_made_up_data_is_in_the_data_and_follows_them_everywhere() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let ran = |args: &[&str]| {
        let output = lanesweep(args);
        assert!(output.status.success(), "{args:?}: {output:?}");
        output.stdout
    };
    let recordings = at("recordings");
    ran(&["-q", "synth", text(&recordings), "--synth-recordings", "2", "--config", "generator.duration_s=150"]);
    // Copied without the sentence beside them, as among recordings of other origin.
    std::fs::remove_file(recordings.join("SYNTHETIC.txt")).unwrap();
    let scenarios = at("s.jsonl");
    ran(&["-q", "mine", text(&recordings), "--out", text(&scenarios)]);
    // What was driven is told beside the file, which may be lost too.
    std::fs::remove_file(at("s.exposure.json")).unwrap();
    let mut files = vec![scenarios.clone()];
    if cfg!(feature = "parquet") {
        ran(&["-q", "mine", text(&recordings), "--out", text(&at("s.parquet"))]);
        std::fs::remove_file(at("s.parquet.exposure.json")).unwrap();
        files.push(at("s.parquet"));
    }
    std::fs::write(
        at("s.csv"),
        "id,category,ego_speed_mps,time_s,ego_length,ego_width,side,target_length,target_width,target_v,\
         target_y,synthetic\na,cut-in,30,0,4,2,left,4,2,20,3.5,1\na,,,1,,,,,,20,2.5,\n",
    )
    .unwrap();
    files.push(at("s.csv"));
    for file in &files {
        let (file, out) = (text(file), at("out"));
        let report = ran(&["-q", "study", "--scenarios", file, "--out", text(&out)]);
        let report = String::from_utf8_lossy(&report).replace('\n', " ");
        assert!(report.contains("No number here is a statement about real traffic"), "{file}");
        assert!(is_synthetic(&std::fs::read(out.join("run.json")).unwrap()), "{file}");
        let figures = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path());
        for figure in figures.filter(|path| path.extension().is_some_and(|ending| ending == "svg")) {
            assert!(std::fs::read_to_string(&figure).unwrap().contains("SYNTHETIC DATA"), "{}", figure.display());
        }
    }
    let (file, density) = (text(&scenarios), at("i.json"));
    let fit = [
        "fit",
        "--scenarios",
        file,
        "--categories",
        "lvd",
        "--parameterizations",
        "i",
        "--config",
        "fit.valid_draws=1000",
    ];
    let fitted = ran(&[&["-q"], &fit[..], &["--format", "json", "--out", text(&density)]].concat());
    assert!(is_synthetic(&fitted));
    let sampled = ["-q", "sample", text(&density), "--samples", "500", "--thw", "0.6", "--format", "json"];
    assert!(is_synthetic(&ran(&[&sampled[..], &["--out", text(&at("sampled"))]].concat())));
    let first: serde_json::Value =
        serde_json::from_str(std::fs::read_to_string(&scenarios).unwrap().lines().next().unwrap()).unwrap();
    let lane = format!("{}/S/1.2s/RSS", first["id"].as_str().unwrap());
    let of_lane = ["--scenarios", file, "--lane", &lane];
    assert!(is_synthetic(&ran(&[&["-q", "simulate", "--format", "json"], &of_lane[..]].concat())));
    ran(&[&["-q", "export", "xosc", "--out", text(&at("played"))], &of_lane[..]].concat());
    let mut played = std::fs::read_dir(at("played")).unwrap().map(|entry| entry.unwrap().path());
    let played = played.find(|path| path.extension().is_some_and(|ending| ending == "xosc")).unwrap();
    assert!(std::fs::read_to_string(played).unwrap().contains("SYNTHETIC DATA"));
}

#[test]
fn a_file_of_recorded_and_made_up_scenarios_is_made_up_and_one_of_recorded_ones_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let golden = std::fs::read_to_string(common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    let mixed = golden.replacen("{", "{\"synthetic\":true,", 1);
    for (text_of, is_made_up) in [(&golden, false), (&mixed, true)] {
        let (file, out) = (dir.path().join("s.jsonl"), dir.path().join("out"));
        std::fs::write(&file, text_of).unwrap();
        let study = lanesweep(&["-q", "study", "--scenarios", text(&file), "--out", text(&out)]);
        assert!(study.status.success(), "{study:?}");
        assert_eq!(is_synthetic(&std::fs::read(out.join("run.json")).unwrap()), is_made_up);
        assert_eq!(String::from_utf8_lossy(&study.stdout).contains("SYNTHETIC DATA"), is_made_up);
    }
}

#[test]
fn converted_recordings_of_one_name_stay_apart_and_made_up_and_replace_no_file() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (first, second, out) = (at("v1"), at("v2"), at("out"));
    for (folder, seed) in [(&first, "generator.seed=1"), (&second, "generator.seed=2")] {
        let small = ["--synth-recordings", "2", "--config", "generator.duration_s=60", "--config", seed];
        assert!(lanesweep(&[&["-q", "synth", text(folder)], &small[..]].concat()).status.success());
    }
    let convert = ["-q", "tracks", text(&first), text(&second), "--convert", text(&out)];
    // A file of the user's with the name of one of them.
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("03_tracksMeta.csv"), "mine").unwrap();
    refused(&convert, "already holds `03_tracksMeta.csv`");
    assert_eq!(std::fs::read_to_string(out.join("03_tracksMeta.csv")).unwrap(), "mine");
    std::fs::remove_file(out.join("03_tracksMeta.csv")).unwrap();
    assert!(lanesweep(&convert).status.success());
    let record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("converted.json")).unwrap()).unwrap();
    let names = record["recordings"].as_array().unwrap().iter().map(|of| (of["recording"].clone(), of["of"].clone()));
    let pairs = [("01", "01"), ("02", "02"), ("03", "01"), ("04", "02")];
    assert!(names.eq(pairs.map(|(name, of)| (name.into(), of.into()))), "{record}");
    // The scenarios of all four are found, and said to be made up.
    let mined = |folder: &Path| {
        let file = at("mined.jsonl");
        let ran = lanesweep(&["-q", "mine", text(folder), "--out", text(&file)]);
        assert!(ran.status.success(), "{ran:?}");
        std::fs::read_to_string(file).unwrap().lines().count()
    };
    assert_eq!(mined(&out), mined(&first) + mined(&second));
    let mined = std::fs::read_to_string(at("mined.jsonl")).unwrap();
    assert!(mined.lines().all(|line| is_synthetic(line.as_bytes())));
    refused(&convert, "already holds");
}
