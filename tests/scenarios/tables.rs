//! Tables: what is written as Parquet is what CSV and JSON Lines say, to the last bit and with its unit.
#![cfg(feature = "parquet")]

use crate::common::made;
use crate::common::mined::density_of;
use crate::common::program::{json, ran};
use crate::common::text_of;

use std::collections::BTreeMap;
use std::path::Path;

use lanesweep::model::plausibility::LIMITS;
use lanesweep::prelude::*;
use made::{Read, read};

#[test]
fn a_study_gives_the_same_bytes_from_parquet_and_from_json_lines() {
    let at = &*crate::common::folder();
    ran(at, "-q tracks --convert rec --synth-recordings 2");
    ran(at, "-q mine rec --out s.jsonl");
    ran(at, "-q mine rec --out s.parquet");
    let study = "-q study --backend cpu --thw 1.2,0.4 --config study.keep_plan=never";
    for of in ["--scenarios s.jsonl --threads 2 --out a", "--scenarios s.parquet --threads 1 --out b"] {
        for ending in ["csv", "parquet", "jsonl"] {
            ran(at, &format!("{study} {of} --rows {}.{ending}", &of[of.len() - 1..]));
        }
    }
    let bytes = |name: &str| std::fs::read(at.join(name)).unwrap();
    for name in [".csv", ".jsonl", ".parquet", "/results.csv", "/tables/claims.csv", "/tables/radar-cut-in.csv"] {
        assert!(bytes(&format!("a{name}")) == bytes(&format!("b{name}")), "{name}");
    }
    assert_same_rows(&at.join("a.csv"), &read(&at.join("a.parquet")));
    check_facts(&read(&at.join("a.parquet")), "lanes", true);
    let scenarios = read(&at.join("s.parquet"));
    check_facts(&scenarios, "scenarios", false);
    assert_eq!(scenarios.key_values["lanesweep.synthetic"], "true");
    // What `mine` knew of its recordings stands in the records of a study of either file; of other scenarios it is a note.
    let record = |data: &str| {
        ran(at, &format!("{study} {data} --models FSM --out of"));
        let record = json(&at.join("of/run.json"));
        ["recordings", "mining", "notes"].map(|key| record[key].clone())
    };
    let recorded = record("rec");
    let files = |of: &serde_json::Value| of["files"].as_array().unwrap().len();
    assert!(recorded[0].as_array().unwrap().iter().all(|of| files(of) == 3), "{recorded:?}");
    for file in ["s.jsonl", "s.parquet"] {
        assert_eq!(record(&format!("--scenarios {file} --config mining.leader_max_thw_s=9")), recorded, "{file}");
    }
    std::fs::write(at.join("t.jsonl"), std::fs::read_to_string(at.join("s.jsonl")).unwrap() + "\n").unwrap();
    std::fs::copy(at.join("s.exposure.json"), at.join("t.exposure.json")).unwrap();
    let [recordings, _, notes] = record("--scenarios t.jsonl");
    assert!(recordings == serde_json::json!([]) && notes.to_string().contains("belongs to other scenarios"), "{notes}");
    // A density of the same scenarios, of either file: its exposure stands beside each.
    for file in ["s.jsonl", "s.parquet"] {
        ran(at, &format!("-q fit --scenarios {file} --categories lvd --parameterizations i --out {file}.json"));
    }
}

#[test]
fn sampled_rows_are_the_same_in_every_format() {
    let at = &*crate::common::folder();
    write_density(&at.join("d.json"), &density_of(2, Category::Lvd, "i", false)).unwrap();
    for (name, threads) in [("r.csv", "2"), ("r.jsonl", "2"), ("r.parquet", "2"), ("again.parquet", "1")] {
        let sample = "-q sample d.json --samples 300 --thw 0.6,1.2 --backend cpu";
        ran(at, &format!("{sample} --rows {name} --threads {threads}"));
    }
    let parquet = read(&at.join("r.parquet"));
    assert_same_rows(&at.join("r.csv"), &parquet);
    check_facts(&parquet, "samples", true);
    assert!(std::fs::read(at.join("r.parquet")).unwrap() == std::fs::read(at.join("again.parquet")).unwrap());
    let lines = std::fs::read_to_string(at.join("r.jsonl")).unwrap();
    assert_eq!(lines.lines().count(), parquet.rows.len());
    for (line, row) in lines.lines().zip(&parquet.rows) {
        let object: BTreeMap<String, serde_json::Value> = serde_json::from_str(line).unwrap();
        for (column, value) in parquet.columns.iter().zip(row) {
            let text = match &object[column] {
                serde_json::Value::Null => String::new(),
                // JSON has no number for infinity.
                serde_json::Value::String(text) if text == "Infinity" => "inf".to_owned(),
                serde_json::Value::String(text) => text.clone(),
                serde_json::Value::Bool(flag) => u8::from(*flag).to_string(),
                number => number.as_f64().unwrap().to_string(),
            };
            assert_eq!(&text, value, "{column} in {line}");
        }
    }
}

/// The texts of CSV are those of Parquet's values.
fn assert_same_rows(csv: &Path, parquet: &Read) {
    let mut reader = csv::Reader::from_path(csv).unwrap();
    assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), parquet.columns);
    let mut count = 0;
    for (record, row) in reader.records().zip(&parquet.rows) {
        for (text, value) in record.unwrap().iter().zip(row) {
            assert_eq!(text, value);
        }
        count += 1;
    }
    assert!(count > 100 && count == parquet.rows.len());
}

/// What a file says of itself, and that the chapter on tables says the same of every column.
fn check_facts(table: &Read, kind: &str, has_lanes: bool) {
    assert_eq!(table.key_values["lanesweep.version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(table.key_values["lanesweep.table"], kind);
    assert_eq!(table.key_values.contains_key("lanesweep.profile"), has_lanes);
    assert_eq!(table.key_values.contains_key("lanesweep.plan_sha256"), has_lanes);
    let words: Vec<serde_json::Value> = serde_json::from_str(&table.key_values["lanesweep.columns"]).unwrap();
    assert_eq!(words.iter().map(|w| w["name"].as_str().unwrap()).collect::<Vec<_>>(), table.columns);
    let chapter = text_of("docs/src/tables.md");
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().replace('`', "")).collect::<Vec<_>>();
    let rows_of = |kind: &str| -> Vec<Vec<String>> {
        let section = chapter.split("\n## ").find(|part| part.starts_with(&format!("`{kind}`"))).expect(kind);
        section.lines().filter(|line| line.starts_with("| `")).map(cells).collect()
    };
    let mut rows = rows_of(kind);
    // A row of lanes stands for the columns that samples have too.
    if let Some(at) = rows.iter().position(|row| row[1] == "collision … pet_s") {
        let samples = rows_of("samples");
        let place = |name: &str| samples.iter().position(|row| row[1] == name).expect(name);
        rows.splice(at..=at, samples[place("model")..=place("pet_s")].to_vec());
    }
    for (word, (unit, description)) in words.iter().zip(&table.metadata) {
        assert_eq!((word["unit"].as_str().unwrap(), word["description"].as_str().unwrap()), (&**unit, &**description));
        assert!(!description.is_empty() && description.ends_with('.'), "{word}");
        let text = |key: &str| word[key].as_str().unwrap().to_owned();
        // The parameters of a density are in one row.
        let of_all = rows.iter().find(|row| kind == "samples" && row[1] == "…");
        let row = rows.iter().find(|row| row[1] == text("name")).or(of_all);
        let row = row.unwrap_or_else(|| panic!("docs/src/tables.md, section on {kind}: no row for {word}"));
        assert_eq!(row[2], text("type"), "the chapter's type of {}", text("name"));
        if row[1] != "…" {
            let shown = if unit.is_empty() { "–" } else { unit };
            assert_eq!(row[3], shown, "the chapter's unit of {}", text("name"));
        }
    }
    if kind != "samples" {
        assert_eq!(rows.len(), words.len(), "the section on {kind} has rows for columns that are not written");
    }
}

#[test]
fn the_chapter_has_the_ranges_that_readers_apply() {
    let chapter = text_of("docs/src/tables.md");
    let section = chapter.split("\n## ").find(|part| part.starts_with("Plausible values")).unwrap();
    let rows: Vec<&str> = section.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
    assert_eq!(rows.len(), LIMITS.len());
    for (row, of) in rows.iter().zip(&LIMITS) {
        let range = |(min, max): (f64, f64)| format!("{min} … {max}");
        let (plausible, physical) = (range(of.plausible), range(of.physical));
        let expected = format!("| {} | {} | {plausible} | {physical} |", of.name, of.unit);
        assert!(row.starts_with(&expected), "{row} should begin with {expected}");
    }
}
