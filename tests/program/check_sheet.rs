//! The sheet of `lanesweep check` as evidence: what identifies it, what it rests on, what it leaves out.

use std::path::Path;

use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::common::program::{lanesweep, words};

const CASE: &str = "check --category cut-in --ego-speed 60km/h --speed 40km/h --gap 15 --lateral-speed 1";

/// Runs a check in a folder; its output.
fn check(folder: &Path, line: &str) -> String {
    let (code, out, error) = lanesweep(folder, &words(line));
    assert!([0, 1, 8, 9, 10].contains(&code), "{error}");
    out
}

/// The document and the page of a check.
fn sheet(folder: &Path, line: &str) -> (Value, String) {
    let out = check(folder, &format!("{line} --sheet case.html --format json"));
    (serde_json::from_str(&out).unwrap(), std::fs::read_to_string(folder.join("case.html")).unwrap())
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn the_same_inputs_give_the_same_bytes_in_every_run_folder_and_number_of_threads() {
    let [here, there] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let case = "category = \"cut-in\"\nego_speed_kmh = 60\nspeed_kmh = 40\ngap = 15\nlateral_speed = 1.0\n";
    let files = |folder: &Path, threads: &str| {
        std::fs::write(folder.join("case.toml"), case).unwrap();
        let line = format!("check case.toml --date 12.May --sheet case.html --threads {threads}");
        let document = check(folder, &format!("{line} --format json"));
        let page = std::fs::read_to_string(folder.join("case.html")).unwrap();
        let text = check(folder, &line);
        [document, page, text].map(|text| text.replace(&format!("--threads {threads}"), "--threads N"))
    };
    let first = files(here.path(), "1");
    assert_eq!(first, files(there.path(), "3"));
}

/// A hash of the file for who has it, and one of the numbers, which is the same for every way to write them.
#[test]
fn a_sheet_names_its_input_by_the_bytes_of_the_file_and_by_the_numbers_of_the_case() {
    let dir = tempfile::tempdir().unwrap();
    let case = "category = \"cut-in\"\nego_speed_kmh = 60\nspeed_kmh = 40\ngap = 15\nlateral_speed = 1.0\n";
    std::fs::write(dir.path().join("case.toml"), case).unwrap();
    let flags = sheet(dir.path(), &format!("{CASE} --profiles un-r157")).0["identity"].clone();
    let (document, page) = sheet(dir.path(), "check case.toml --profiles un-r157");
    assert_eq!(
        (&flags["file_sha256"], &document["identity"]["file_sha256"]),
        (&Value::Null, &sha256(case.as_bytes()).into())
    );
    assert_eq!(flags["case_sha256"], document["identity"]["case_sha256"]);
    for hash in ["case_sha256", "file_sha256"] {
        assert!(page.contains(document["identity"][hash].as_str().unwrap()), "{hash}");
    }
    let farther = sheet(dir.path(), "check case.toml --profiles un-r157 --gap 15.01").0;
    assert_eq!(farther["identity"]["file_sha256"], document["identity"]["file_sha256"]);
    assert_ne!(farther["identity"]["case_sha256"], document["identity"]["case_sha256"]);
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
    assert!(
        page.contains(&format!("{program}, commit {commit}, engine {}", ours["identity"]["engine_version"])),
        "{commit}"
    );
}

/// For who reads the chapter in place of a sheet.
#[test]
fn the_chapter_for_assessors_lists_what_a_sheet_does_not_consider() {
    let dir = tempfile::tempdir().unwrap();
    let document = sheet(dir.path(), CASE).0;
    let chapter = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/src/for-assessors.md")).unwrap();
    let chapter = chapter.replace("**", "").split_whitespace().collect::<Vec<_>>().join(" ");
    let not_considered = document["not_considered"].as_array().unwrap();
    assert!(not_considered.len() > 5);
    for text in not_considered {
        assert!(chapter.contains(text.as_str().unwrap()), "{text}");
    }
}
