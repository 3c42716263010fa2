//! The configuration: every verb takes it, every record names it, and schema and keys are the same.

use std::collections::BTreeSet;

use lanesweep::cli::settings::{Key, KeyKind};
use serde_json::Value;

use crate::common::program::{json, ran};

#[test]
fn every_verb_takes_its_values_from_all_layers() {
    let dir = &*crate::common::folder();
    let tables = "[run]\nbackend = \"cpu\"\n[generator]\nrecordings = 2\nduration_s = 100\n[score]\nseed = 11\n\
                  min_failures = 20\n[fit]\nseed = 12\nvalid_draws = 1000\n[sample]\nseed = 13\nsamples = 1e2\n";
    std::fs::write(dir.join("a.toml"), tables).unwrap();
    for (verb, result, pointer, table, in_file) in [
        ("study", "lanesweep-out/run.json", "/score/seed", "score", 11),
        ("fit --categories lvd --parameterizations i --out lvd-i.json", "lvd-i.json", "/p_valid/seed", "fit", 12),
        ("sample lvd-i.json", "lanesweep-sample/estimate.json", "/seed", "sample", 13),
    ] {
        let assignment = format!("--config {table}.seed=31");
        let with = |args: &str| {
            ran(dir, &format!("-q --config a.toml {verb} {args}"));
            let record = json(&dir.join(result));
            record.pointer(pointer).and_then(Value::as_u64)
        };
        assert_eq!(with(""), Some(in_file), "{verb}: file");
        assert_eq!(with(&assignment), Some(31), "{verb}: assignment");
        assert_eq!(with(&format!("{assignment} --seed 41")), Some(41), "{verb}: flag");
    }
    let record = json(&dir.join("lanesweep-out/run.json"));
    let settings = record["settings"].as_array().unwrap();
    let of = |key: &str| settings.iter().find(|one| one["key"] == key).unwrap_or_else(|| panic!("{key}"));
    assert_eq!(of("score.seed")["source"], "flag --seed");
    assert_eq!(of("score.min_failures")["source"], "file a.toml, line 8");
    assert_eq!(record["score"]["min_failures"], 20);
    assert!(record["data"].as_str().unwrap().contains("2 generated recordings of 100 s"));
}

fn changed(key: &Key) -> Value {
    let default = key.default.clone().unwrap_or_default();
    match (&key.kind, key.name.as_str()) {
        (_, "run.backend") => "cpu".into(),
        (_, "run.profile") => "paper-fit".into(),
        (_, "run.dt_s") => 0.05.into(),
        (_, "generator.recordings" | "run.threads") => 2.into(),
        (_, "generator.duration_s") => 100.0.into(),
        (_, "sample.samples") => 2000.into(),
        (_, "sample.estimator") => "mc".into(),
        (_, "fit.valid_draws") => 1000.into(),
        (_, "study.folds" | "score.min_failures") => 3.into(),
        (KeyKind::Boolean, _) => (!default.as_bool().unwrap()).into(),
        (KeyKind::Choice(words), _) => words.iter().find(|word| default != *word.word).unwrap().word.clone().into(),
        (KeyKind::Number(range), _) if range.is_whole => (default.as_u64().unwrap() + 1).into(),
        (KeyKind::Number(_), _) => (default.as_f64().unwrap() * 0.99).into(),
        (KeyKind::Text, name) => panic!("{name}"),
    }
}

#[test]
fn every_record_names_every_setting_with_its_source() {
    let dir = &*crate::common::folder();
    // A device needs another backend; a width and a time decide how many samples are drawn, and what ends.
    let unset = ["run.device", "run.stop_after_s", "sample.half_width", "sample.time_limit_s"];
    let keys: Vec<Key> = Key::all().into_iter().filter(|key| !unset.contains(&key.name.as_str())).collect();
    let line = |key: &Key| format!("{} = {}\n", key.name, changed(key));
    std::fs::write(dir.join("all.toml"), keys.iter().map(line).collect::<String>()).unwrap();
    let run = |line: &str| ran(dir, &format!("-q --config all.toml {line}"));
    let recorded = |record: &str, line: &str| {
        run(line);
        json(&dir.join(record))
    };
    run("tracks --convert data");
    let fit = run("fit --parameterizations i --out i.json --format json");
    let sample = "sample i.json --models FSM --thw 1";
    // A preset has its own initial distances and panels.
    let map = "map lvd --preset jrc --models FSM";
    let records = [
        ("study", recorded("lanesweep-out/run.json", "study --categories lvd")),
        ("mine", recorded("s.exposure.json", "mine data --out s.jsonl")),
        ("fit", serde_json::from_str(&fit).unwrap()),
        ("sample", recorded("lanesweep-sample/estimate.json", sample)),
        ("map", recorded("lanesweep-map/map.json", map)),
    ];
    for (verb, record) in records {
        let settings = record["settings"].as_array().unwrap_or_else(|| panic!("{verb}"));
        assert_eq!(settings.len(), Key::all().len(), "{verb}");
        for (row, key) in (1..).zip(&keys) {
            let of = settings.iter().find(|of| of["key"] == *key.name).unwrap_or(&Value::Null);
            let source = format!("file all.toml, line {row}").into();
            assert_eq!((&of["value"], &of["source"]), (&changed(key), &source), "{verb}: {}", key.name);
        }
        assert!(verb == "mine" || verb == "fit" || record["profile"]["frame"]["dt_s"] == 0.05, "{verb}");
    }
}

#[test]
fn the_schema_has_every_key_with_a_default_in_its_own_range() {
    let dir = tempfile::tempdir().unwrap();
    let schema: Value = serde_json::from_str(&ran(dir.path(), "config schema")).unwrap();
    let mut leaves = BTreeSet::new();
    walk(&schema, "", &mut |name, leaf| {
        let within = |limit: &str, fits: &dyn Fn(f64, f64) -> bool| {
            let pair = leaf["default"].as_f64().zip(leaf[limit].as_f64());
            assert!(pair.is_none_or(|(value, limit)| fits(value, limit)), "{name}: {leaf}");
        };
        within("minimum", &|value, limit| value >= limit);
        within("maximum", &|value, limit| value <= limit);
        within("exclusiveMinimum", &|value, limit| value > limit);
        within("exclusiveMaximum", &|value, limit| value < limit);
        assert!(leaf["description"].as_str().is_some_and(|text| !text.contains("[`")), "{name}: {leaf}");
        leaves.insert(name.to_owned());
    });
    let shown: Value = serde_json::from_str(&ran(dir.path(), "config show --format json")).unwrap();
    let keys = shown.as_array().unwrap().iter().map(|one| one["key"].as_str().unwrap().to_owned());
    assert_eq!(leaves, keys.collect());
    assert_eq!(schema["additionalProperties"], false);
}

fn walk(schema: &Value, prefix: &str, each: &mut dyn FnMut(&str, &Value)) {
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        let name = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        if property["properties"].is_object() { walk(property, &name, each) } else { each(&name, property) }
    }
}
