//! The configuration: which source wins, what a wrong word is answered with, and that the default file, the schema and
//! the keys are the same.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output};

use lanesweep::cli::settings::{Key, KeyKind};
use serde_json::Value;

use crate::common::program::{PROGRAM, json, said, unbroken, words};

/// Runs the program with nothing configured but what the test configures.
fn run(dir: &Path, variables: &[(&str, &str)], line: &str) -> Output {
    let mut command = Command::new(PROGRAM);
    command.current_dir(dir).env_remove("LANESWEEP_CONFIG").envs(variables.iter().copied()).args(words(line));
    command.output().unwrap()
}

fn good(dir: &Path, variables: &[(&str, &str)], line: &str) -> String {
    let output = run(dir, variables, line);
    assert_eq!(output.status.code(), Some(0), "{line}: {}", unbroken(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a run that must be refused, in one line.
fn refused(dir: &Path, variables: &[(&str, &str)], line: &str) -> String {
    let output = run(dir, variables, line);
    let said = unbroken(&output.stderr);
    assert!(output.status.code() == Some(2) && output.stdout.is_empty(), "{line}: {said}");
    said
}

/// Value and source of a key.
fn shown(dir: &Path, variables: &[(&str, &str)], args: &str, key: &str) -> (Value, String) {
    let text = good(dir, variables, &format!("config show --format json {args}"));
    let list: Value = serde_json::from_str(&text).unwrap();
    let found = list.as_array().unwrap().iter().find(|one| one["key"] == key).unwrap_or_else(|| panic!("{key}"));
    (found["value"].clone(), found["source"].as_str().unwrap().to_owned())
}

#[test]
fn a_flag_wins_over_an_assignment_over_a_file_over_the_default() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    std::fs::write(dir.join("a.toml"), "# mine\n[generator]\nseed = 2\n[run]\ndt_s = 0.2\n").unwrap();
    let file = "--config a.toml";
    let assigned = "--config a.toml --config generator.seed=4 --config run.dt_s=0.4";
    let flags = format!("{assigned} --config generator.seed=5 --dt 0.5");
    let seed = |variables: &[(&str, &str)], args: &str| shown(dir, variables, args, "generator.seed");
    let dt = |args: &str| shown(dir, &[], args, "run.dt_s");
    let is = |value: Value, source: &str| (value, source.to_owned());
    assert_eq!([seed(&[], ""), dt("")], [is(20_240_901.into(), "default"), is(Value::Null, "default")]);
    assert_eq!(seed(&[], file), is(2.into(), "file a.toml, line 3"));
    assert_eq!(dt(file), is(0.2.into(), "file a.toml, line 5"));
    assert_eq!(seed(&[], assigned), is(4.into(), "flag --config"));
    assert_eq!(dt(assigned), is(0.4.into(), "flag --config"));
    assert_eq!([seed(&[], &flags), dt(&flags)], [is(5.into(), "flag --config"), is(0.5.into(), "flag --dt")]);
    // The environment names the file where no flag does, and nothing after `=` is the default again.
    assert_eq!(seed(&[("LANESWEEP_CONFIG", "a.toml")], ""), is(2.into(), "file a.toml, line 3"));
    std::fs::write(dir.join("b.toml"), "").unwrap();
    assert_eq!(seed(&[("LANESWEEP_CONFIG", "a.toml")], "--config b.toml").1, "default");
    assert_eq!(seed(&[], "--config a.toml --config generator.seed=").0, Value::from(20_240_901));
    // Nothing that is not named is read.
    std::fs::write(dir.join("lanesweep.toml"), "[generator]\nseed = 9\n").unwrap();
    assert_eq!(seed(&[], "").1, "default");
}

#[test]
fn every_verb_takes_its_values_from_all_layers() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
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
            good(dir, &[], &format!("-q --config a.toml {verb} {args}"));
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

#[test]
fn a_variable_that_would_be_ignored_is_named_and_a_misspelt_one_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    for (name, said) in [
        ("LANESWEEP_RUN_DT_S", "the variable LANESWEEP_RUN_DT_S is not read: write --config run.dt_s=VALUE"),
        ("LANESWEEP_MINING_CUT_IN_MAX_THW_S", "--config mining.cut_in.max_thw_s=VALUE"),
    ] {
        let output = run(dir.path(), &[(name, "0.05")], "config show");
        let text = unbroken(&output.stderr);
        assert!(output.status.success() && text.contains(said), "{text}");
    }
    for name in ["LANESWEEP_CONIFG", "LANESWEEP_CONFIG_FILE"] {
        let text = refused(dir.path(), &[(name, "a.toml")], "config show");
        assert!(text.contains("did you mean `LANESWEEP_CONFIG`"), "{text}");
    }
    // Variables of others, and of this program's tests, are none of them.
    let others = [("LANESWEEP_SHARED", "x"), ("LANESWEEP_CHIPS", "1"), ("LANESWEEP_NODE", "7")];
    let output = run(dir.path(), &others, "config show");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

/// Another valid value of a key, near its default.
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
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    // A device needs another backend; a width and a time decide how many samples are drawn, and what ends.
    let unset = ["run.device", "run.stop_after_s", "sample.half_width", "sample.time_limit_s"];
    let keys: Vec<Key> = Key::all().into_iter().filter(|key| !unset.contains(&key.name.as_str())).collect();
    let line = |key: &Key| format!("{} = {}\n", key.name, changed(key));
    std::fs::write(dir.join("all.toml"), keys.iter().map(line).collect::<String>()).unwrap();
    let run = |line: &str| good(dir, &[], &format!("-q --config all.toml {line}"));
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
fn what_is_configured_yields_to_a_flag_that_contradicts_it() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    for (name, run) in [
        ("device.toml", "device = \"no such device\""),
        ("gpu.toml", "backend = \"gpu\""),
        ("both.toml", "backend = \"cpu\"\ndevice = \"0\""),
        ("small.toml", "backend = \"cpu\""),
    ] {
        std::fs::write(dir.join(name), format!("[run]\n{run}\n[generator]\nrecordings = 1\n")).unwrap();
    }
    let [device, gpu, both, small] =
        ["device.toml", "gpu.toml", "both.toml", "small.toml"].map(|file| [("LANESWEEP_CONFIG", file)]);
    good(dir, &device, "-q study --backend cpu");
    good(dir, &gpu, "-q study --config study.reference=true --backend cpu");
    refused(dir, &device, "-q study");
    let said = refused(dir, &both, "-q study");
    assert!(said.contains("both.toml, line 3, `run.device`: `0` is named") && !said.contains("--backend"), "{said}");
    assert!(said.contains("both.toml, line 2, `run.backend` chooses the CPU"), "{said}");
    // A plan's lanes are decided; what the file of the environment says of them was there when it was made.
    good(dir, &small, "-q study --plan-only --out run");
    good(dir, &small, "-q study --plan run/plan.json");
    let said = refused(dir, &small, "study --plan run/plan.json --config score.seed=3");
    assert!(said.contains("`score.seed` is decided by the plan"), "{said}");
}

#[test]
fn mining_settings_without_meaning_are_refused_by_the_check_and_by_runs() {
    let dir = tempfile::tempdir().unwrap();
    for (table, words) in [
        ("[mining]\nleader_max_thw_s = 2000", "expected a number above 0 and at most 60"),
        ("[mining.longitudinal]\nwindow_s = 25", "expected a number above 0 and at most 10"),
        ("[mining.lateral]\nnear_share = 0.6", "0.6 is above `mining.lateral.far_share`, 0.5"),
    ] {
        std::fs::write(dir.path().join("own.toml"), format!("{table}\n")).unwrap();
        for line in ["config check own.toml", "study --config own.toml"] {
            let said = refused(dir.path(), &[], line);
            assert!(said.contains(words), "{line}: {said}");
        }
    }
}

#[test]
fn the_default_file_is_written_once_and_sets_what_is_so_anyway() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    assert!(good(dir, &[], "config init").contains("--config lanesweep.toml"));
    let written = std::fs::read_to_string(dir.join("lanesweep.toml")).unwrap();
    assert_eq!(written, good(dir, &[], "config init -"));
    assert_eq!(written, include_str!("../../configs/default.toml"));
    std::fs::write(dir.join("lanesweep.toml"), "[score]\nseed = 1\n").unwrap();
    assert!(refused(dir, &[], "config init").contains("is not overwritten"));
    assert_eq!(std::fs::read_to_string(dir.join("lanesweep.toml")).unwrap(), "[score]\nseed = 1\n");
    assert_eq!(good(dir, &[], "config check lanesweep.toml").lines().count(), 1);
    good(dir, &[], "config init new/other.toml");
    assert!(good(dir, &[], "config init un-r157.toml").contains("--profile un-r157.toml"));
    assert_eq!(
        std::fs::read_to_string(dir.join("un-r157.toml")).unwrap(),
        include_str!("../../configs/profiles/un-r157.toml")
    );
    // What is shown as a file sets the same again.
    let toml = good(dir, &[], "config show --format toml --config mining.cut_in.max_thw_s=1.5 --threads 1");
    std::fs::write(dir.join("again.toml"), &toml).unwrap();
    assert_eq!(toml, good(dir, &[], "config show --format toml --config again.toml"));
    assert!(
        toml.contains("[run]\nthreads = 1\n") && toml.contains("[mining.cut_in]\nmin_duration_s = 0.1\n"),
        "{toml}"
    );
}

#[test]
fn the_schema_has_every_key_with_a_default_in_its_own_range() {
    let dir = tempfile::tempdir().unwrap();
    let schema: Value = serde_json::from_str(&good(dir.path(), &[], "config schema")).unwrap();
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
    let shown: Value = serde_json::from_str(&good(dir.path(), &[], "config show --format json")).unwrap();
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

/// Factors of ten and other units are reported, studies of unusual drivers run, and what no driver has is refused.
#[test]
fn a_profile_with_an_unusual_constant_is_used_and_reported() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let shipped = include_str!("../../configs/profiles/un-r157.toml").replace("name = \"un-r157\"", "name = \"own\"");
    let check = |old: &str, new: &str| {
        assert!(shipped.contains(old), "{old}");
        std::fs::write(dir.join("own.toml"), shipped.replace(old, new)).unwrap();
        let case = "--category cut-in --ego-speed 60km/h --speed 40km/h --gap 15 --lateral-speed 1";
        said(dir, &format!("check {case} --profiles own.toml"))
    };
    // A line of the profile, what stands there instead, and what is said: of what is used (`+`), and of what is not (`-`).
    let table = "\
wandering_m = 0.375 | 37.5 | + `cchdm.wandering_m`: 37.5 m is used as it is, shipped profiles have 0.375
\\ndelay_s = 0.75 | 0.06 | + `cchdm.delay_s`: 0.06 s is used as it is, shipped profiles have 0.6 to 0.75
jerk_mps3 = 12.65 | 1.29 | + `fsm.jerk_mps3`: 1.29 m/s³ is used as it is, shipped profiles have 12.65
lane_intrusion_m = 0.3 | 3.0 | + `reg157.lane_intrusion_m`: 3 m is used as it is, shipped profiles have 0.3
ttc_s = 2.0 | 0.2 | + `cchdm.ttc_s`: 0.2 s is used as it is, shipped profiles have 2
reaction_time_s = 0.75 | 5.0 | +
reaction_time_s = 0.75 | 0.1 | +
lateral_acceleration_mps2 = 1.0 | 0.8 | +
reaction_time_s = 0.75 | 75.0 | - `fsm.reaction_time_s`: 75 is not usable; expected 0, or 0.001 to 60 s
btn_threshold = 0.8 | 80.0 | - `criteria.btn_threshold`: 80 is not usable; expected 0.001 to 10
comfortable_deceleration_mps2 = 4.0 | 9.0 | - `fsm.comfortable_deceleration_mps2`: 9 is above `fsm.max_surrogate_deceleration_mps2`, 6";
    for line in table.lines() {
        let [old, value, expected] = line.split(" | ").collect::<Vec<_>>()[..] else { panic!("{line}") };
        let old = old.replace("\\n", "\n");
        let (code, text) = check(&old, &format!("{} = {value}", old.split(" = ").next().unwrap()));
        match expected.split_at(1) {
            ("+", "") => assert!([0, 1, 8].contains(&code) && !text.contains("is used as it is"), "{line}: {text}"),
            ("+", said) => assert!([0, 1, 8].contains(&code) && text.contains(said.trim()), "{line}: {code} {text}"),
            (_, said) => assert!(code == 2 && text.contains(said.trim()), "{line}: {code} {text}"),
        }
    }
}
