//! Whatever a user names as an input file (a pipe, a folder, a device, a file whose line never ends), the program
//! ends at once with the exit status of bad data and names the file.
#![cfg(unix)]

use crate::common::golden;
use crate::common::program::{self, ran, unbroken, words};

use std::path::Path;
use std::time::{Duration, Instant};

/// Of a file of 1 GiB the beginning and the end are looked at: memory for its content is not there.
#[test]
fn plans_parts_journals_and_densities_that_are_zeros_or_cut_off_are_refused_without_being_read() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let run = |line: &str| {
        let started = Instant::now();
        let line = format!("-q --threads 1 {line}");
        let (code, _, err) = program::limited(dir, "ulimit -v 400000", &words(&line));
        (code, unbroken(err.as_bytes()), started.elapsed())
    };
    let fit = "fit --synth-recordings 2 --categories cut-in --parameterizations 2 --out d.json";
    let sample = "sample d.json --samples 1000 --thw 0.6 --models FSM --backend cpu --out out";
    let study = "study --synth-recordings 1 --categories cut-in --backend cpu --out study";
    for line in [fit, &format!("{sample} --shard 0/2"), &format!("{study} --shard 0/2")] {
        let (code, said, _) = run(line);
        assert_eq!(code, 0, "{line}: {said}");
    }
    let of_length = |path: &Path, content: &[u8], length: u64| {
        std::fs::write(path, content).unwrap();
        std::fs::OpenOptions::new().write(true).open(path).unwrap().set_len(length).unwrap();
    };
    let cases = [
        ("d.json", "sample d.json --samples 10 --out other"),
        ("out/plan.json", "merge out"),
        ("out/part-00000-of-00002.json", &*format!("{sample} --shard 0/2")),
        ("study/plan.json", "study --plan study/plan.json --backend cpu --shard 1/2 --out study"),
        ("study/part-00000-of-00002.json", "study --plan study/plan.json --backend cpu --shard 0/2 --out study"),
    ];
    for (name, line) in cases {
        let path = dir.join(name);
        let whole = std::fs::read(&path).unwrap();
        // A file of zeros, one with zeros behind what was written, one that was cut off.
        for (damage, before) in [(1 << 30, &b""[..]), (1 << 30, &whole[..]), (whole.len() as u64 - 10, &whole[..])] {
            of_length(&path, before, damage);
            let (code, said, took) = run(line);
            assert!(code == 3 && said.contains(name.rsplit('/').next().unwrap()), "{name} {damage}: {code} {said}");
            assert!(took < Duration::from_secs(2), "{name} {damage}: {took:?}");
        }
        std::fs::write(&path, &whole).unwrap();
    }
    // A journal that goes on in zeros keeps its records; zeros alone are none.
    let journal = dir.join("out/part-00001-of-00002.journal");
    of_length(&journal, b"", 1 << 30);
    let (code, said, took) = run(&format!("{sample} --shard 1/2"));
    assert!(code == 3 && said.contains("no journal of lanesweep") && took < Duration::from_secs(2), "{code} {said}");
    assert_eq!(std::fs::metadata(&journal).unwrap().len(), 1 << 30, "a foreign file stays");
}

/// An id that acts on a terminal, forges a line of a message, turns the direction of reading, and is a formula.
const HOSTILE: &str = "=1+1\u{1b}[2J\u{9b}31m\u{202e}b\rc\u{7f}";

/// Golden scenarios, a kept cut-in with this id.
fn scenarios_with(dir: &Path, id: &str) {
    let text = std::fs::read_to_string(golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
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
    // `@` is the word beside it, which has blanks that are none.
    for (line, word, expected) in [
        ("simulate --scenarios s.jsonl --lane @", &*lane, 0),
        ("simulate --scenarios s.jsonl --lane @ --compare all --models all", &lane, 0),
        ("simulate --scenarios s.jsonl --lane @ --format json", &lane, 0),
        ("simulate --scenarios s.jsonl --lane @", "\u{1b}[2J/S/1.2s/FSM", 2),
        ("study --scenarios s.jsonl --backend cpu --config study.compare_reference=true", "", 0),
        ("study --scenarios broken.jsonl", "", 3),
        ("study --scenarios @", named, 3),
        ("study --profile key.toml", "", 2),
        ("study @", "--\u{1b}[2J\u{202e}", 2),
    ] {
        let args: Vec<&str> = line.split(' ').map(|arg| if arg == "@" { word } else { arg }).collect();
        let (code, out, err) = program::lanesweep(dir, &args);
        assert_eq!(code, expected, "{args:?}: {err}");
        let acts = |c: char| (c.is_control() && c != '\n') || ('\u{2028}'..='\u{202e}').contains(&c);
        assert!(!out.chars().chain(err.chars()).any(acts), "{args:?}: {out:?} {err:?}");
        if line.ends_with("--format json") {
            let document: serde_json::Value = serde_json::from_str(&out).unwrap();
            assert_eq!(document["lanes"][0]["lane"], lane, "JSON reads back the id itself");
        }
        assert!(word != named || err.contains("\\u{1b}[2J\\u{202e}\\nsuch.jsonl"), "{err}");
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
        let study = "-q study --scenarios s.jsonl --config study.reference=true --rows lanes.csv --thw 1.2";
        ran(dir, &format!("{study} --models FSM --categories cut-in"));
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
        ran(dir, &format!("simulate --scenarios cases.csv --lane={id}/S/1.2s/FSM"));
    }
}
