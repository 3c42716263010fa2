//! The documents and pages of `lanesweep check` beside one another; what they say stands in `tests/messages/check.md`.

use std::path::Path;

use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::common::program::{lanesweep, ran, words};
use crate::common::text_of;

const CASE: &str = "check --category cut-in --ego-speed 60km/h --speed 40km/h --gap 15 --lateral-speed 1";

fn document(dir: &Path, line: &str) -> Value {
    let (code, out, error) = lanesweep(dir, &words(&format!("{line} --format json")));
    assert!([0, 1, 8, 9, 10].contains(&code), "{code} {error}");
    serde_json::from_str(&out).unwrap()
}

fn sheet(dir: &Path, line: &str) -> (Value, String) {
    let document = document(dir, &format!("{line} --sheet case.html"));
    (document, std::fs::read_to_string(dir.join("case.html")).unwrap())
}

/// The table, the figure of the page, the series and the JSON take the time of braking from one place.
#[test]
fn the_sheet_and_the_series_have_one_time_of_braking() {
    let dir = tempfile::tempdir().unwrap();
    let (document, page) = sheet(dir.path(), &format!("{CASE} --profiles un-r157"));
    let simulate = CASE.replace("check", "simulate --models all --profile un-r157");
    let series = ran(dir.path(), &simulate);
    for part in ["the system has to avoid the collision", "TTC at lane intrusion", "<svg", "Initial gap (m)"] {
        assert!(page.contains(part), "{part}");
    }
    for model in document["profiles"][0]["models"].as_array().unwrap() {
        let (name, brakes_s) = (model["model"].as_str().unwrap(), model["braking_s"].as_f64().unwrap());
        let marked = series.lines().find(|row| row.starts_with(name) && row.ends_with("braking")).unwrap();
        let of_series: f64 = marked.split(',').nth(1).unwrap().parse().unwrap();
        assert!((of_series - brakes_s).abs() < 1e-9, "{name}: {of_series} {brakes_s}");
        // The legend of the figure, and the row of the table.
        let shown = format!("{brakes_s:.3}");
        let shown = shown.trim_end_matches('0');
        let times =
            page.matches(&format!("braking\u{a0}{shown}\u{a0}s")).count() + page.matches(&format!(">{shown}<")).count();
        assert!(times >= 2, "{name}: {shown} s is there {times} times");
    }
}

#[test]
fn the_numbers_of_a_row_are_those_of_simulate_and_of_its_sheet() {
    let dir = &*crate::common::folder();
    let rows =
        "id,category,ego_speed_kmh,speed_kmh,gap,lateral_speed\nslow,cut-in,108,36,20,2\nmild,cut-in,108,72,36,1\n";
    std::fs::write(dir.join("cases.csv"), rows).unwrap();
    let answers = document(dir, "check cases.csv");
    let sheet = document(dir, "check cases.csv --row 2 --profiles un-r157");
    let lanes = document(dir, "simulate --table cases.csv --row 2 --profile un-r157");
    let models = sheet["profiles"][0]["models"].as_array().unwrap();
    for (model, lane) in models.iter().zip(lanes["lanes"].as_array().unwrap()) {
        let mut numbers = lane["outcome"].as_object().unwrap().clone();
        numbers.insert("braking_s".to_owned(), model["braking_s"].clone());
        assert!(model["model"] == lane["model"] && numbers.len() == 19, "{numbers:?}");
        for (name, number) in numbers {
            let key = format!("{}_{name}", model["model"].as_str().unwrap());
            assert_eq!(answers["cases"][1][&key], number, "{key}");
        }
    }
}

/// A hash of the file for who has it, and one of the numbers, which is the same for every way to write them.
#[test]
fn a_sheet_names_its_input_by_the_bytes_of_the_file_and_by_the_numbers_of_the_case() {
    let dir = tempfile::tempdir().unwrap();
    let case = "category = \"cut-in\"\nego_speed_kmh = 60\nspeed_kmh = 40\ngap = 15\nlateral_speed = 1.0\n";
    std::fs::write(dir.path().join("case.toml"), case).unwrap();
    let flags = sheet(dir.path(), &format!("{CASE} --profiles un-r157")).0["identity"].clone();
    let (document, page) = sheet(dir.path(), "check case.toml --profiles un-r157");
    let of_file: String = Sha256::digest(case).iter().map(|byte| format!("{byte:02x}")).collect();
    let identity = &document["identity"];
    assert_eq!((&flags["file_sha256"], &identity["file_sha256"]), (&Value::Null, &of_file.into()));
    assert_eq!(flags["case_sha256"], identity["case_sha256"]);
    for hash in ["case_sha256", "file_sha256"] {
        assert!(page.contains(identity[hash].as_str().unwrap()), "{hash}");
    }
    let farther = sheet(dir.path(), "check case.toml --profiles un-r157 --gap 15.01").0;
    assert_eq!(farther["identity"]["file_sha256"], identity["file_sha256"]);
    assert_ne!(farther["identity"]["case_sha256"], identity["case_sha256"]);
}

#[test]
fn a_sheet_names_program_and_profile_and_a_comment_is_no_other_profile() {
    let dir = tempfile::tempdir().unwrap();
    let shipped = include_str!("../../configs/profiles/un-r157.toml");
    std::fs::write(dir.path().join("same.toml"), format!("# mine\n{shipped}")).unwrap();
    let changed = shipped.replace("delay_s = 0.75", "delay_s = 0.7").replace("\"un-r157\"", "\"mine\"");
    std::fs::write(dir.path().join("other.toml"), changed).unwrap();
    let of = |profile: &str| sheet(dir.path(), &format!("{CASE} --profiles {profile}"));
    let hash = |document: &Value| document["profiles"][0]["sha256"].as_str().unwrap().to_owned();
    let ((ours, page), (same, _), (other, other_page)) = (of("un-r157"), of("same.toml"), of("other.toml"));
    assert!(hash(&ours).len() == 64 && page.contains(&hash(&ours)));
    assert_eq!(hash(&ours), hash(&same));
    assert_ne!(hash(&ours), hash(&other));
    // Every constant has its source; one that the user changed has none, and the sheet says so.
    let sources = |document: &Value| {
        let all = document["assumptions"].as_array().unwrap().clone();
        let without = all.iter().filter(|of| of["source"].is_null()).map(|of| of["key"].as_str().unwrap().to_owned());
        (all.len(), without.collect::<Vec<_>>())
    };
    assert_eq!(sources(&ours).1, Vec::<String>::new());
    assert_eq!(sources(&other), (sources(&ours).0, vec!["cchdm.delay_s".to_owned()]));
    let none = "no source recorded: the profile&apos;s own value";
    assert!(!page.contains(none) && other_page.contains(none));
    let program = ours["program"].as_str().unwrap();
    let commit = ours["identity"]["commit"].as_str().map_or("unknown", |commit| commit);
    let named = format!("{program}, commit {commit}, engine {}", ours["identity"]["engine_version"]);
    assert!(page.contains(&named), "{named}");
}

/// For who reads the chapter in place of a sheet.
#[test]
fn the_chapter_for_assessors_lists_what_a_sheet_does_not_consider() {
    let dir = tempfile::tempdir().unwrap();
    let document = sheet(dir.path(), CASE).0;
    let chapter =
        text_of("docs/src/for-assessors.md").replace("**", "").split_whitespace().collect::<Vec<_>>().join(" ");
    let not_considered = document["not_considered"].as_array().unwrap();
    assert!(not_considered.len() > 5);
    for text in not_considered {
        assert!(chapter.contains(text.as_str().unwrap()), "{text}");
    }
}
