//! Whatever a user names as an input file (a pipe, a folder, a device, a file whose line never ends), the program
//! ends at once with the exit status of bad data and names the file.
#![cfg(unix)]

use crate::common::{self, program};

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// No wait, no reading of much: an unloaded machine needs milliseconds.
const AT_ONCE: Duration = Duration::from_secs(20);

/// Exit code and stderr without the drawing; a program that does not end is an error.
fn lanesweep(dir: &Path, args: &[&str]) -> (i32, String) {
    let errors = dir.join("stderr.txt");
    let mut child = program::command(dir, args)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&errors).unwrap())
        .spawn()
        .unwrap();
    let started = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if started.elapsed() > AT_ONCE {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{args:?} did not end within {AT_ONCE:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    // The drawing breaks long lines, also after a hyphen.
    let text = program::flat(&std::fs::read_to_string(errors).unwrap()).replace("- ", "-");
    (status.code().unwrap_or(-1), text)
}

fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// A place for every kind of strange file, with the strange ones in it.
fn strange() -> (tempfile::TempDir, Vec<(&'static str, &'static str)>) {
    let dir = tempfile::tempdir().unwrap();
    pipe(&dir.path().join("a_pipe"));
    std::fs::create_dir(dir.path().join("a_folder")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", dir.path().join("a_link")).unwrap();
    std::fs::write(dir.path().join("not_utf8"), b"a = \xff\xfe\n").unwrap();
    let said = vec![
        ("a_pipe", "a pipe, a device or a socket"),
        ("a_folder", "this is a folder"),
        ("/dev/zero", "a pipe, a device or a socket"),
        ("a_link", "a pipe, a device or a socket"),
    ];
    (dir, said)
}

/// Every flag and argument that names an input file, with what else the verb needs; `@` is the file.
fn readers() -> Vec<Vec<&'static str>> {
    let words = |line: &'static str| line.split(' ').collect::<Vec<_>>();
    [
        "study --scenarios @",
        "study --config @",
        "study --profile @",
        "study --plan @",
        "study --plan @ --shard 0/2",
        "mine recordings --config @",
        "fit --scenarios @",
        "fit --config @",
        "sample @",
        "sample --plan @",
        "sample density.json --estimator is --thw 0.6 --proposal @",
        "sample density.json --profile @",
        "simulate --case-file @",
        "simulate --table @",
        "simulate --scenarios @ --lane a/S/1.0s/FSM",
        "simulate --profile @",
        "verify --backend cpu --scenarios @",
        "verify --backend cpu --profile @",
    ]
    .map(words)
    .to_vec()
}

fn with(args: &[&'static str], file: &'static str) -> Vec<&'static str> {
    args.iter().map(|arg| if *arg == "@" { file } else { arg }).collect()
}

/// The good files that some verbs need beside the strange one.
fn furnish(dir: &Path) {
    std::fs::copy(common::golden("paper_sumo_01_02_scenarios.jsonl"), dir.join("scenarios.jsonl")).unwrap();
    let (code, said) = lanesweep(
        dir,
        &["-q", "synth", "recordings", "--synth-recordings", "1", "--config", "generator.duration_s=60"],
    );
    assert_eq!(code, 0, "{said}");
    let fit = ["-q", "fit", "--synth-recordings", "3", "--categories", "cut-in", "--parameterizations", "2"];
    let (code, said) = lanesweep(dir, &[&fit[..], &["--out", "density.json"]].concat());
    assert_eq!(code, 0, "{said}");
}

#[test]
fn pipes_folders_and_devices_are_refused_at_once_wherever_a_file_is_read() {
    let (dir, files) = strange();
    furnish(dir.path());
    for args in readers() {
        for (file, kind) in &files {
            let args = with(&args, file);
            let (code, said) = lanesweep(dir.path(), &args);
            assert_eq!(code, 3, "{args:?}: {said}");
            assert!(said.contains(file) && said.contains(kind), "{args:?}: {said}");
        }
    }
}

#[test]
fn what_is_not_text_is_refused_with_its_line() {
    let (dir, _) = strange();
    for args in ["study --config @", "study --profile @", "simulate --case-file @", "simulate --table @"] {
        let args = with(&args.split(' ').collect::<Vec<_>>(), "not_utf8");
        let (code, said) = lanesweep(dir.path(), &args);
        assert_eq!(code, 3, "{args:?}: {said}");
        assert!(said.contains("not_utf8, line 1: not UTF-8 text"), "{args:?}: {said}");
    }
}

/// Puts something strange under a name.
type Put = fn(&Path);

#[test]
fn strange_files_inside_a_folder_that_is_named_are_refused_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let names = [
        ("merge", "plan.json", vec!["merge", "in"]),
        ("rerun", "estimate.json", vec!["simulate", "--from", "in", "--lane", "a/S/1.0s/FSM"]),
    ];
    for (what, name, args) in names {
        let put: [(&str, Put); 3] = [
            ("pipe", pipe),
            ("folder", |path| std::fs::create_dir(path).unwrap()),
            ("device", |path| std::os::unix::fs::symlink("/dev/zero", path).unwrap()),
        ];
        for (kind, put) in put {
            std::fs::create_dir(dir.join("in")).unwrap();
            put(&dir.join("in").join(name));
            let (code, said) = lanesweep(dir, &args);
            assert_eq!(code, 3, "{what}, {kind}: {said}");
            assert!(said.contains(name) && said.contains("expected a regular file"), "{what}, {kind}: {said}");
            std::fs::remove_dir_all(dir.join("in")).unwrap();
        }
    }
    // The plan of a run in parts, where the program would leave its own.
    std::fs::create_dir(dir.join("out")).unwrap();
    pipe(&dir.join("out/plan.json"));
    let study =
        ["study", "--synth-recordings", "1", "--config", "generator.duration_s=120", "--out", "out", "--plan-only"];
    let (code, said) = lanesweep(dir, &study);
    assert_eq!(code, 3, "{said}");
    assert!(said.contains("out/plan.json") && said.contains("expected a regular file"), "{said}");
}

/// A recording whose file of tracks is damaged so.
fn recording(dir: &Path, damage: impl FnOnce(&Path)) -> PathBuf {
    let (code, said) =
        lanesweep(dir, &["-q", "synth", "in", "--synth-recordings", "1", "--config", "generator.duration_s=60"]);
    assert_eq!(code, 0, "{said}");
    let tracks = dir.join("in/01_tracks.csv");
    damage(&tracks);
    tracks
}

#[test]
fn a_line_that_does_not_end_is_given_up_and_named() {
    let endless: [(&str, &str, &[u8], &str); 3] = [
        ("digits", "", b"7", ""),
        ("an open quotation mark", "\"", b"7,\n", "quotation mark"),
        ("zero bytes", "", b"\0", ""),
    ];
    for (what, begin, piece, hint) in endless {
        let dir = tempfile::tempdir().unwrap();
        recording(dir.path(), |tracks| {
            let mut text = std::fs::read(tracks).unwrap();
            text.truncate(text.iter().position(|&byte| byte == b'\n').unwrap() + 1);
            text.extend(begin.as_bytes());
            text.extend(piece.iter().copied().cycle().take(32 << 20));
            std::fs::write(tracks, text).unwrap();
        });
        let (code, said) = lanesweep(dir.path(), &["mine", "in"]);
        assert_eq!(code, 3, "{what}: {said}");
        assert!(said.contains("01_tracks.csv, line") && said.contains("within 1 MiB"), "{what}: {said}");
        assert!(said.contains(hint), "{what}: {said}");
    }
    let dir = tempfile::tempdir().unwrap();
    std::fs::File::create(dir.path().join("scenarios.jsonl")).unwrap().set_len(1 << 40).unwrap();
    let (code, said) = lanesweep(dir.path(), &["study", "--scenarios", "scenarios.jsonl"]);
    assert_eq!(code, 3, "{said}");
    assert!(said.contains("scenarios.jsonl, line 1: the line is longer than"), "{said}");
}

#[test]
fn a_file_of_the_recording_that_is_no_file_is_named() {
    for name in ["01_tracks.csv", "01_tracksMeta.csv", "01_recordingMeta.csv"] {
        let dir = tempfile::tempdir().unwrap();
        recording(dir.path(), |tracks| {
            std::fs::remove_file(tracks.with_file_name(name)).unwrap();
            pipe(&tracks.with_file_name(name));
        });
        for args in [&["mine", "in"][..], &["study", "in"]] {
            let (code, said) = lanesweep(dir.path(), args);
            assert_eq!(code, 3, "{name}: {said}");
            assert!(said.contains(name) && said.contains("expected a regular file"), "{name}: {said}");
        }
    }
}

#[test]
fn files_beyond_what_their_kind_can_be_are_not_read_to_their_end() {
    let dir = tempfile::tempdir().unwrap();
    // Without a byte on the disk.
    let huge = std::fs::File::create(dir.path().join("huge")).unwrap();
    huge.set_len(1 << 40).unwrap();
    for args in ["study --config @", "study --profile @", "simulate --case-file @", "simulate --table @"] {
        let args = with(&args.split(' ').collect::<Vec<_>>(), "huge");
        let (code, said) = lanesweep(dir.path(), &args);
        assert_eq!(code, 3, "{args:?}: {said}");
        // A table is read row by row, so it may be of any size, but a row may not.
        let why = if args.contains(&"--table") { "a row is longer than" } else { "larger than any file of this kind" };
        assert!(said.contains("huge") && said.contains(why), "{args:?}: {said}");
    }
}

/// Of a file of 1 GiB the beginning and the end are looked at: memory for its content is not there.
#[test]
fn plans_parts_journals_and_densities_that_are_zeros_or_cut_off_are_refused_without_being_read() {
    let dir = tempfile::tempdir().unwrap();
    let run = |args: &str| {
        let started = Instant::now();
        let args = [&["-q", "--threads", "1"], &args.split(' ').collect::<Vec<_>>()[..]].concat();
        let (code, _, err) = program::limited(dir.path(), "ulimit -v 400000", &args);
        (code, program::flat(&err), started.elapsed())
    };
    let fit = "fit --synth-recordings 2 --categories cut-in --parameterizations 2 --out d.json";
    let sample = "sample d.json --samples 1000 --thw 0.6 --models FSM --backend cpu --out out";
    let study = "study --synth-recordings 1 --categories cut-in --backend cpu --out study";
    for args in [fit, &format!("{sample} --shard 0/2"), &format!("{study} --shard 0/2")] {
        let (code, said, _) = run(args);
        assert_eq!(code, 0, "{args}: {said}");
    }
    let zeros = |path: &Path| std::fs::OpenOptions::new().write(true).open(path).unwrap().set_len(1 << 30).unwrap();
    let cut = |path: &Path| {
        let length = std::fs::metadata(path).unwrap().len();
        std::fs::OpenOptions::new().write(true).open(path).unwrap().set_len(length - 10).unwrap();
    };
    let cases = [
        ("d.json", "sample d.json --samples 10 --out other"),
        ("out/plan.json", "merge out"),
        ("out/part-00000-of-00002.json", &*format!("{sample} --shard 0/2")),
        ("study/plan.json", "study --plan study/plan.json --backend cpu --shard 1/2 --out study"),
        ("study/part-00000-of-00002.json", "study --plan study/plan.json --backend cpu --shard 0/2 --out study"),
    ];
    for (name, args) in cases {
        let path = dir.path().join(name);
        let whole = std::fs::read(&path).unwrap();
        // A file of zeros, one with zeros behind what was written, one that was cut off.
        for damage in [0, 1, 2] {
            match damage {
                0 => std::fs::write(&path, "").map(|()| zeros(&path)).unwrap(),
                1 => zeros(&path),
                _ => cut(&path),
            }
            let (code, said, took) = run(args);
            assert!(code == 3 && said.contains(name.rsplit('/').next().unwrap()), "{name} {damage}: {code} {said}");
            assert!(took < Duration::from_secs(2), "{name} {damage}: {took:?}");
            std::fs::write(&path, &whole).unwrap();
        }
    }
    // A journal that goes on in zeros keeps its records; zeros alone are none.
    let journal = dir.path().join("out/part-00001-of-00002.journal");
    std::fs::write(&journal, "").unwrap();
    zeros(&journal);
    let (code, said, took) = run(&format!("{sample} --shard 1/2"));
    assert!(code == 3 && said.contains("no journal of lanesweep") && took < Duration::from_secs(2), "{code} {said}");
    assert_eq!(std::fs::metadata(&journal).unwrap().len(), 1 << 30, "a foreign file stays");
}

#[test]
fn no_message_repeats_a_text_of_any_size() {
    let dir = tempfile::tempdir().unwrap();
    let long = "k".repeat(900_000);
    let golden = std::fs::read_to_string(common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    let mut scenario: serde_json::Value = serde_json::from_str(golden.lines().next().unwrap()).unwrap();
    scenario["id"] = long.clone().into();
    for (name, text) in [
        ("key.toml", format!("{long} = 1\n")),
        ("table.toml", format!("[{long}]\na = 1\n")),
        ("value.toml", format!("[run]\nbackend = \"{long}\"\n")),
        ("huge.toml", format!("# {long}{long}\n")),
        ("id.jsonl", format!("{scenario}\n")),
        ("columns.csv", format!("id,{long}\na,1\n")),
        ("cell.csv", format!("id,category\na,{long}\n")),
    ] {
        std::fs::write(dir.path().join(name), text).unwrap();
    }
    let word = "w".repeat(100_000);
    for (args, code, expected) in [
        ("config check key.toml", 2, "this key has 900000 bytes"),
        ("config check table.toml", 2, "bytes"),
        ("config check value.toml", 2, "line 2"),
        ("config check huge.toml", 3, "more than 1 MiB"),
        ("study --config key.toml", 2, "key.toml, line 1"),
        ("study --profile key.toml", 2, "key.toml, line 1"),
        ("study --scenarios id.jsonl --out o", 3, "expected at most 512"),
        ("study --scenarios columns.csv --out o", 3, "columns.csv"),
        ("study --scenarios cell.csv --out o", 3, "cell.csv"),
        ("check columns.csv", 2, "columns.csv"),
        ("check cell.csv", 2, ""),
        ("study --categories @", 2, "no category"),
        ("study --config @=1", 2, "key"),
        ("study --dt @", 2, "--dt"),
        ("study @", 6, "cannot read"),
        ("study --device @", 2, "--device"),
        ("study --@", 2, "unexpected argument"),
        ("@", 2, "unrecognized subcommand"),
        ("simulate --scenarios id.jsonl --lane @", 3, "id.jsonl"),
    ] {
        let args: Vec<String> = args.split(' ').map(|arg| arg.replace('@', &word)).collect();
        let started = Instant::now();
        let (status, said) = lanesweep(dir.path(), &args.iter().map(String::as_str).collect::<Vec<_>>());
        let args = args.join(" ").chars().take(60).collect::<String>();
        assert!(said.len() < 3000, "{args}: {} bytes: {said:.300}", said.len());
        assert!([code, 2, 3, 7].contains(&status) && said.contains(expected), "{args}: {status} {said}");
        assert!(started.elapsed() < Duration::from_secs(5), "{args}: {:?}", started.elapsed());
    }
}

/// An id that acts on a terminal, forges a line of a message, turns the direction of reading, and is a formula.
const HOSTILE: &str = "=1+1\u{1b}[2J\u{9b}31m\u{202e}b\rc\u{7f}";

/// Golden scenarios, the first with this id.
fn scenarios_with(dir: &Path, id: &str) {
    let text = std::fs::read_to_string(common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = lines.iter().position(|line| line.contains("\"cut_in\"") && line.contains("\"kept\":true")).unwrap();
    let mut first: serde_json::Value = serde_json::from_str(&lines[at]).unwrap();
    first["id"] = id.into();
    lines[at] = first.to_string();
    std::fs::write(dir.join("s.jsonl"), lines.join("\n") + "\n").unwrap();
}

#[test]
fn foreign_text_reaches_a_terminal_as_text_and_never_as_commands_to_it() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    scenarios_with(dir, HOSTILE);
    std::fs::write(dir.join("key.toml"), "\"\\u001b[2J\\u009b\\u202e\" = 1\n").unwrap();
    std::fs::write(dir.join("broken.jsonl"), format!("{{\"id\": \"{}\"\n", "\u{9b}\u{202e}")).unwrap();
    let lane = format!("{HOSTILE}/S/1.2s/FSM");
    let named = "no\u{1b}[2J\u{202e}\nsuch.jsonl";
    let runs: [(&[&str], i32); 9] = [
        (&["simulate", "--scenarios", "s.jsonl", "--lane", &lane], 0),
        (&["simulate", "--scenarios", "s.jsonl", "--lane", &lane, "--compare", "all", "--models", "all"], 0),
        (&["simulate", "--scenarios", "s.jsonl", "--lane", &lane, "--format", "json"], 0),
        (&["simulate", "--scenarios", "s.jsonl", "--lane", "\u{1b}[2J/S/1.2s/FSM"], 2),
        (&["study", "--scenarios", "s.jsonl", "--backend", "cpu", "--config", "study.compare_reference=true"], 0),
        (&["study", "--scenarios", "broken.jsonl"], 3),
        (&["study", "--scenarios", named], 6),
        (&["study", "--profile", "key.toml"], 2),
        (&["study", "--\u{1b}[2J\u{202e}"], 2),
    ];
    for (args, expected) in runs {
        let (code, out, err) = program::lanesweep(dir, args);
        assert_eq!(code, expected, "{args:?}: {err}");
        let acts = |c: char| (c.is_control() && c != '\n') || ('\u{2028}'..='\u{202e}').contains(&c);
        assert!(!out.chars().chain(err.chars()).any(acts), "{args:?}: {out:?} {err:?}");
        if args.contains(&"json") {
            let document: serde_json::Value = serde_json::from_str(&out).unwrap();
            assert_eq!(document["lanes"][0]["lane"], lane, "JSON reads back the id itself");
        }
        if args.contains(&named) {
            assert!(err.contains("\\u{1b}[2J\\u{202e}\\nsuch.jsonl"), "{err}");
        }
    }
    let page = std::fs::read_to_string(dir.join("lanesweep-out/report.html")).unwrap();
    assert!(!page.chars().any(|c| c.is_control() && c != '\n') && !page.contains('\u{202e}'));
}

#[test]
fn a_table_for_spreadsheets_begins_no_formula_with_foreign_text_and_reads_back_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    for id in ["=HYPERLINK(1)", "@a", "-2+3", "+x,y", "'=q"] {
        scenarios_with(dir, id);
        let study = [
            "-q",
            "study",
            "--scenarios",
            "s.jsonl",
            "--config",
            "study.reference=true",
            "--rows",
            "lanes.csv",
            "--thw",
            "1.2",
        ];
        let (code, _, err) =
            program::lanesweep(dir, &[&study[..], &["--models", "FSM", "--categories", "cut-in"]].concat());
        assert_eq!(code, 0, "{err}");
        let table = std::fs::read_to_string(dir.join("lanes.csv")).unwrap();
        let fields = table.lines().flat_map(|line| line.split(','));
        let formulas = fields.map(|f| f.trim_start_matches('"')).filter(|f| f.starts_with(['=', '+', '-', '@']));
        let formulas: Vec<&str> = formulas.filter(|field| field.parse::<f64>().is_err()).collect();
        assert!(formulas.is_empty() && table.contains(&format!("'{id}")), "{formulas:?}");
        let mut reader = csv::Reader::from_path(dir.join("lanes.csv")).unwrap();
        assert!(reader.records().any(|row| row.unwrap()[0] == format!("'{id}")), "{id} stands in one field");
        // Our reader of scenarios takes the apostrophe away.
        let row = format!("id,category,ego_speed_mps,speed_mps,lateral_speed\n\"'{id}\",cut-in,30,20,1\n");
        std::fs::write(dir.join("cases.csv"), row).unwrap();
        let lane = format!("--lane={id}/S/1.2s/FSM");
        let (code, _, err) = program::lanesweep(dir, &["simulate", "--scenarios", "cases.csv", &lane]);
        assert_eq!(code, 0, "{id}: {err}");
    }
}

#[test]
fn a_command_that_is_suggested_can_be_pasted_whatever_the_folder_is_called() {
    let dir = tempfile::tempdir().unwrap();
    let part = ["-q", "study", "--synth-recordings", "1", "--config", "generator.duration_s=120", "--shard", "0/2"];
    let (code, _, err) = program::lanesweep(dir.path(), &[&part[..], &["--out", "it's; mine"]].concat());
    assert_eq!(code, 0, "{err}");
    let (code, said) = lanesweep(dir.path(), &["merge", "it's; mine"]);
    assert_eq!(code, 3, "{said}");
    assert!(said.contains(r"--plan 'it'\''s; mine/plan.json' --shard 1/2 --out 'it'\''s; mine'"), "{said}");
}
