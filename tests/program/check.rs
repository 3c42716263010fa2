//! `lanesweep check`: one case against the regulation, from every kind of file.

use std::path::Path;

use serde_json::Value;

use crate::common::program::{flat, lanesweep, ran, refused, said, words};

/// Arguments of a case: its flags, or `cut-in EGO OTHER GAP ACROSS` with speeds in km/h and further flags; under `un-r157`
/// if no profile is named.
fn arguments(case: &str) -> String {
    let profile = if case.contains("--profiles") { "" } else { "--profiles un-r157" };
    match words(case)[..] {
        ["cut-in", ego, other, gap, across, ref more @ ..] if !ego.starts_with('-') => {
            let speeds = format!("--ego-speed {ego}km/h --speed {other}km/h");
            let more = more.join(" ");
            format!("check --category cut-in {speeds} --gap {gap} --lateral-speed {across} {profile} {more}")
        }
        _ => format!("check --category {case} {profile}"),
    }
}

fn run(case: &str) -> (i32, String, String) {
    lanesweep(Path::new("."), &words(&format!("{} --full", arguments(case))))
}

#[test]
fn without_full_a_sheet_is_one_screen_that_names_what_it_leaves_out() {
    let (_, full, _) = run("cut-in 60 40 15 1.0");
    let (code, brief, _) = lanesweep(Path::new("."), &words(&arguments("cut-in 60 40 15 1.0")));
    assert_eq!(code, 0);
    assert!(brief.lines().count() <= 30 && full.lines().count() > 60, "{brief}");
    for said in ["preventable under un-r157", "UN R157, 5.2.5.2", "FSM", "Initial gap (m)", "--full", "--sheet"] {
        assert!(brief.contains(said), "{said}: {brief}");
    }
    assert!(full.contains("Clauses under un-r157") && !brief.contains("Clauses under"));
}

fn json(case: &str) -> Value {
    let (code, out, error) = run(&format!("{case} --format json"));
    assert!([0, 1, 8, 9, 10].contains(&code), "{code} {error}");
    serde_json::from_str(&out).unwrap()
}

/// Per case its arguments and the status of its answer, then what the sheet says (`+`) and what it does not say (`-`).
fn agree(sheets: &str) {
    let mut sheet = (String::new(), String::new());
    for line in sheets.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')) {
        if let Some(words) = line.strip_prefix("+ ") {
            assert!(sheet.1.contains(words), "{}: no `{words}` in {}", sheet.0, sheet.1);
        } else if let Some(words) = line.strip_prefix("- ") {
            assert!(!sheet.1.contains(words), "{}: `{words}` in {}", sheet.0, sheet.1);
        } else {
            let (case, status) = line.rsplit_once(" = ").unwrap();
            let (code, out, error) = run(case);
            assert_eq!(code.to_string(), status, "{case}: {out} {error}");
            sheet = (case.to_owned(), flat(&out));
        }
    }
}

#[test]
fn every_answer_has_its_own_exit_status_and_the_sheet_begins_with_the_case_in_kmh() {
    let (_, out, _) = run("cut-in 108 72 36 1");
    let case = "cut-in under un-r157 (TTC ≤ 2 s): ego 108 km/h, other vehicle 72 km/h, gap 36 m, across 1 m/s";
    assert_eq!(out.lines().next().unwrap(), case);
    agree(
        "
        cut-in 108 72 36 1 = 0
        + preventable under un-r157: CCHDM and FSM avoid the collision
        cut-in 108 36 20 2 = 1
        + not preventable under un-r157: CCHDM and FSM collide
        cut-in 60 60 12 1 = 9
        + no conflict under un-r157: nothing collides even if the ego never reacts
        # An ego that never reacts misses the cutter; CCHDM brakes, stays beside it, and is hit.
        cut-in 130 60 93 0.3 = 8
        + undecided under un-r157: an ego that never reacts does not collide; CCHDM reacts and collides
        # 0.2 km/h over 15 m are 270 s; 0.01 m/s over 30 m is a matter of 50 minutes.
        cut-in 40.2 40 15 1 = 8
        + undecided under un-r157: no contact within the 120 s of a run, at whose end the gap still closes
        - robust: no change
        lvd --ego-speed 30m/s --thw 1 --acceleration -5 --end-speed 29.99m/s --profiles paper = 8
        + undecided under paper: no contact within
        + at whose end the gap still closes
        # FSM stops at the leader: its gap of 3 cm at the shipped step is 0.2 cm at a tenth of it.
        cut-in 60 20 22 1.2 = 8
        + undecided under un-r157:
        + FSM stops so close that the time step does not tell it from a contact
        + | FSM | touches
        + A BTN above 1 does not contradict an avoided collision
        cut-in 60 40 15 1 --profiles eu-2022-1426 = 10
        + not judged: profile eu-2022-1426 has no reference drivers
        + EU 2022/1426, 1.4.2: the system has to avoid the collision (robust)
        ",
    );
}

/// The annex follows at a headway of 2 s, to the error of gap and speed, and starts at equal speeds.
#[test]
fn a_case_that_annex_3_does_not_describe_has_its_own_answer_and_the_edge_is_said() {
    agree(
        "
        lvd --ego-speed 60km/h --speed 59.8km/h --thw 0.5 --acceleration=-8 = 10
        + outside Annex 3 under un-r157: the ego is faster than the leader at the start
        + LVD under un-r157 (leader beyond 5 m/s², else the delay only):
        lvd --ego-speed 60km/h --speed 60.2km/h --thw 0.5 --acceleration=-8 = 10
        + outside Annex 3 under un-r157:
        # It needs 1.9 s to clear the path, and covers 32 m in that time.
        cut-out --ego-speed 60km/h --lateral-speed 1 --ahead-gap 20 --thw 1.5 = 0
        + no such traffic: the vehicle that cuts out drives through the one ahead of it from 1.2 s on
        cut-out --ego-speed 70km/h --gap 38.965 --lateral-speed 1.0 --ahead-gap 60 = 0
        + preventable under un-r157:
        + the case leaves Annex 3 with gap + 1 cm
        ",
    );
}

/// (a) of 5.2.5.2 is a cutter that keeps its speed; (b) is visible for 0.72 s, and unknown where the case begins within the
/// lane change; (c) is the TTC at lane intrusion: 0.628 s from 7.2 m, between the EU's threshold and that of R157.
#[test]
fn each_clause_has_its_demand_beside_the_drivers() {
    agree(
        "
        cut-in 60 45 24 1 --acceleration -5 = 1
        + UN R157, 5.2.5.2: no demand: (a) largest change of the other vehicle's speed is
        - has to avoid the collision (robust)
        cut-in 60 40 15 1 --width 2.5 = 0
        + UN R157, 5.2.5.2: the system has to avoid the collision (robust)
        - 5.2.5.1
        cut-in 60 30 24 2 = 0
        + preventable under un-r157:
        + that does not mean unavoidable
        cut-in 60 40 15 1 --lateral-distance 2.3 = 0
        + UN R157, 5.2.5.2: unknown whether the system has to avoid the collision
        - 5.2.5.2: no demand
        cut-in 60 45 7.2 1 --profiles un-r157,eu-2022-1426,eu-2022-1426-standing = 0
        + UN R157, 5.2.5.2: no demand: (c) TTC at lane intrusion is 0.628 s; the clause applies where it is > 0.6972 s
        + EU 2022/1426, 1.4.2: the system has to avoid the collision (lane intrusion by a front tyre 0.1 m within
        + EU 2022/1426, 1.4.2, standing: no demand: (c)
        # These profiles drop condition (b), so the regulation's clause is not judged.
        cut-in 60 40 15 1 --profiles paper = 0
        + preventable under paper:
        - 5.2.5.2
        - lane intrusion
        # Each input of the case varies by its own error.
        lvd --ego-speed 60km/h --gap 10 --acceleration=-5 = 8
        + UN R157, 5.2.5.1 still holds, whatever the drivers of Annex 3 do
        + deceleration + 0.05 m/s²
        cut-in 60 40 15 0.38 = 8
        + undecided under un-r157:
        + the answer changes with lateral speed - 0.01 m/s
        ",
    );
}

/// "Robust" is said of every driver that the sentence names, and of no answer at its boundary.
#[test]
fn at_the_boundary_of_a_driver_or_of_the_answer_it_is_not_called_robust() {
    let sheet = json("cut-in 60 40 15 1");
    assert_eq!(sheet["verdict"], "preventable");
    let boundaries = sheet["profiles"][0]["boundaries"].as_array().unwrap();
    let gap = boundaries.iter().find(|boundary| boundary["parameter"] == "gap_m").unwrap();
    assert_eq!(gap["answer_becomes"]["below"], "not preventable");
    let at = |changes: &Value| {
        let (code, out, _) = run(&format!("cut-in 60 40 {} 1", changes["below"].as_f64().unwrap()));
        (code, out.lines().nth(1).unwrap().to_owned())
    };
    let (code, answer) = at(&gap["answer_changes_at"]);
    assert!(code == 8 && answer.starts_with("undecided under un-r157: ") && answer.contains("gap"), "{answer}");
    assert!(!answer.contains("robust"), "{answer}");
    // CCHDM collides from here on, FSM avoids well below.
    let (code, answer) = at(&gap["collision_changes_at"]["CCHDM"]);
    assert!(code == 0 && answer.contains("the answer is robust; the verdict of CCHDM changes with "), "{answer}");
}

/// FSM finds both vehicles unsafe from the start and brakes for the nearer one, which leaves; with the larger demand it stops.
/// A driver that tests the TTC once sees no danger at 40 m: it is above 2 s then. 30 km/h faster, the system has to avoid the
/// collision from 1.044 s of TTC on at the intrusion: 1.084 s 18.2 m ahead, 0.1 s less where the front tyre counts.
#[test]
fn what_another_reading_turns_is_named_and_not_called_robust() {
    agree(
        "
        cut-out --ego-speed 130km/h --thw 2 --lateral-speed 1.1 --ahead-gap 70 = 1
        + but another reading where Annex 3 is silent does
        + of two unsafe vehicles the nearer one sets the demand
        - robust: no change
        cut-in 60 20 40 1 = 0
        + the verdict of CCHDM rests on a reading
        + Rests on a reading: CCHDM tests TTC ≤ 2 s until it holds, not once
        - robust: no change
        cut-in 60 20 30 1 = 0
        + robust: no change
        + CCHDM tests TTC once
        - Rests on a reading
        cut-in 100 70 18.2 1 = 0
        + 5.2.5.2: the system has to avoid the collision (lane intrusion by a front tyre 0.1 m within the box turns this)
        + not a front tyre 0.1 m within it
        ",
    );
    let of = |case: &str, reading: &str, rule: &str| {
        let rows = json(case)["by_rule"].clone();
        let is_row = |row: &&Value| row["reading"] == reading && row["rule"] == rule;
        rows.as_array().unwrap().iter().find(is_row).unwrap()["verdict"].clone()
    };
    let cut_out = "cut-out --ego-speed 130km/h --thw 2 --lateral-speed 1.1 --ahead-gap 60";
    assert_eq!(of(cut_out, "frame.cut_out_target = largest-demand", "FSM alone"), "not preventable");
    assert_eq!(of("cut-in 60 20 40 1", "CCHDM tests TTC once", "all"), "not preventable");
}

#[test]
fn a_mined_scenario_is_checked_by_its_id() {
    let dir = tempfile::tempdir().unwrap();
    let scenarios = dir.path().join("scenarios.jsonl");
    ran(dir.path(), "-q tracks --convert recordings --synth-recordings 1 --config generator.duration_s=120");
    ran(dir.path(), "-q mine recordings --out scenarios.jsonl");
    let lines = std::fs::read_to_string(&scenarios).unwrap();
    let found = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let kept = found.filter(|scenario| scenario["kept"] == true);
    let ids: Vec<String> = kept.map(|scenario| scenario["id"].as_str().unwrap().to_owned()).collect();
    let of = |more: &str| lanesweep(dir.path(), &words(&format!("check scenarios.jsonl {more}")));
    let (_, out, error) = of(&format!("--scenario {} --thw 0.3 --format json", ids[0]));
    let closer: Value = serde_json::from_str(&out).unwrap_or_else(|_| panic!("{error}"));
    assert_eq!((&closer["synthetic"], &closer["case"]["thw_s"]), (&true.into(), &0.3.into()));
    for (more, said) in [
        ("--scenario nobody", "it has no scenario `nobody`"),
        (&format!("--scenario {} --speed 10m/s", ids[0]), "complete case"),
        ("", "--scenario ID"),
    ] {
        refused(dir.path(), &format!("check scenarios.jsonl {more}"), 2, said);
    }
    // Input that was left out is not masked by the answer.
    std::fs::write(&scenarios, format!("{lines}{{\"id\": 3\n")).unwrap();
    let is_collision = |id: &String| {
        let (code, out, error) = of(&format!("--scenario {id} --thw 0.1"));
        assert!(code == 4 && error.contains("not JSON"), "{id}: {code} {error}");
        out.contains("not preventable under un-r157: ")
    };
    assert!(ids.iter().take(6).any(is_collision));
}

/// The table, the figure of the page, the series and the JSON take the time of braking from one place.
#[test]
fn the_sheet_and_the_series_have_one_time_of_braking() {
    let dir = tempfile::tempdir().unwrap();
    let case = arguments("cut-in 60 40 15 1 --sheet case.html --format json");
    let sheet: Value = serde_json::from_str(&ran(dir.path(), &case)).unwrap();
    let page = std::fs::read_to_string(dir.path().join("case.html")).unwrap();
    let simulate = arguments("cut-in 60 40 15 1").replace("check", "simulate --models all");
    let series = ran(dir.path(), &simulate.replace("--profiles", "--profile"));
    for part in ["the system has to avoid the collision", "TTC at lane intrusion", "<svg", "Initial gap (m)"] {
        assert!(page.contains(part), "{part}");
    }
    for model in sheet["profiles"][0]["models"].as_array().unwrap() {
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
    refused(dir.path(), &arguments("cut-in 60 40 15 1 --sheet case.pdf"), 2, ".html");
}

#[test]
fn a_check_of_lanes_with_too_many_steps_is_refused_in_seconds() {
    let dir = tempfile::tempdir().unwrap();
    let profile = include_str!("../../configs/profiles/jrc-2021.toml");
    assert!(profile.contains("time_cap_s = 34.9"));
    // A cap that lost its point; then the longest one, whose lanes never settle.
    for (cap, dt, expected) in [("34900.0", "0.1", "0.001 to 3600 s"), ("3600.0", "0.002", "too many steps")] {
        let changed = profile
            .replace("time_cap_s = 34.9", &format!("time_cap_s = {cap}"))
            .replace("dt_s = 0.1", &format!("dt_s = {dt}"));
        std::fs::write(dir.path().join("cap.toml"), changed).unwrap();
        let started = std::time::Instant::now();
        let (code, error) = said(dir.path(), &arguments("cut-in 108 72 36 1 --profiles cap.toml"));
        assert!(code == 2 && error.contains(expected) && error.contains("time_cap_s"), "{cap}: {code} {error}");
        assert!(started.elapsed() < std::time::Duration::from_secs(30), "{cap}: {:?}", started.elapsed());
    }
}

/// Descriptions of a case as flags, and what is wrong with each: the key, and a part of the sentence.
const CONTRADICTIONS: [(&str, &str, &str); 15] = [
    ("lvd --ego-speed 30m/s --thw 1", "acceleration", "it is missing"),
    ("lvd --ego-speed 30m/s --thw 1 --end-speed 0", "acceleration", "it is missing"),
    ("lvd --ego-speed 30m/s --thw 1 --acceleration 0 --end-speed 0", "end_speed", "without an acceleration"),
    ("lvd --ego-speed 30m/s --thw 1 --acceleration -5 --end-speed 40m/s", "end_speed", "cannot be reached"),
    ("lvd --ego-speed 30m/s --thw 1 --acceleration -5 --end-speed 30m/s", "end_speed", "would have no effect"),
    ("lvd --ego-speed 30m/s --thw 1 --acceleration 5 --end-speed 40m/s", "acceleration", "leader of an LVD faster"),
    ("lvd --ego-speed 30m/s --thw 1 --acceleration -5 --ahead-gap 40", "ahead_gap", "no such parameter"),
    ("lvd --ego-speed 0 --thw 1 --acceleration -5 --speed 20m/s", "thw", "is no distance"),
    ("cut-in --ego-speed 30m/s --thw 1 --lateral-speed 1 --end-speed 10m/s", "end_speed", "without an acceleration"),
    ("cut-in --ego-speed 30m/s --thw 1 --lateral-speed 1 --acceleration 2 --end-speed 10m/s", "end_speed", "cannot be"),
    ("cut-in --ego-speed 30m/s --thw 1 --lateral-speed 0", "lateral_speed", "0 cannot be used"),
    ("cut-in --ego-speed 30m/s --thw 1 --lateral-speed 1 --lateral-distance 0", "lateral_distance", "0 cannot be used"),
    ("cut-in --ego-speed 30m/s --thw 1", "lateral_speed", "it is missing"),
    ("cut-out --ego-speed 30m/s --thw 1 --lateral-speed 1", "ahead_gap", "it is missing"),
    ("cut-out --ego-speed 30m/s --thw 1 --lateral-speed 1 --ahead-gap 40 --end-speed 9m/s", "end_speed", "without"),
];

#[test]
fn a_description_that_contradicts_itself_is_refused_alike_by_every_verb_and_from_every_source() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    for (at, (case, key, problem)) in CONTRADICTIONS.into_iter().enumerate() {
        let flags = format!("--category {case}");
        let pairs: Vec<(String, &str)> =
            words(&flags).chunks(2).map(|pair| (pair[0][2..].replace('-', "_"), pair[1])).collect();
        let toml: String = pairs.iter().map(|(key, value)| format!("{key} = \"{value}\"\n")).collect();
        std::fs::write(dir.join("case.toml"), toml).unwrap();
        let (keys, values): (Vec<&str>, Vec<&str>) = pairs.iter().map(|(key, value)| (key.as_str(), *value)).unzip();
        std::fs::write(dir.join("case.csv"), format!("{}\n{}\n", keys.join(","), values.join(","))).unwrap();
        let sources = [
            format!("check {flags}"),
            "check case.csv".to_owned(),
            format!("simulate {flags}"),
            format!("simulate --xosc out {flags}"),
            "check case.toml".to_owned(),
            "simulate --case-file case.toml".to_owned(),
            "simulate --xosc out --case-file case.toml".to_owned(),
            "simulate --table case.csv".to_owned(),
            "study --scenarios case.csv".to_owned(),
        ];
        // One check is behind all sources: the first case of each kind asks every one of them.
        let asked = if [0, 7, 12].contains(&at) { sources.len() } else { 2 };
        for line in sources.iter().take(asked) {
            let is_of_table = line.contains("case.csv");
            let place = if is_of_table { format!("line 2, column `{key}`: ") } else { format!("{key}: ") };
            let (code, text) = said(dir, line);
            assert_eq!(code, if is_of_table { 3 } else { 2 }, "{line}: {text}");
            assert!(text.contains(&place) && text.contains(problem), "{line}: {text}");
        }
    }
    // A cell of a map is a case.
    for (values, problem) in [
        ("--x deceleration_mps2=0..9/1 --set end_speed_kmh=0", "without an acceleration"),
        ("--x deceleration_mps2=1..9/1 --set end_speed_kmh=200", "cannot be reached"),
        ("--x end_speed_kmh=0..60/10", "needs the leader's deceleration"),
    ] {
        refused(dir, &format!("map lvd --y ego_speed_kmh=60,120 --set thw_s=1 --out out {values}"), 2, problem);
    }
    assert!(!dir.join("out").exists());
    // A value that was typed is not of the table.
    std::fs::write(dir.join("case.csv"), "category,ego_speed_mps,thw,acceleration\nlvd,30,1,-5\n").unwrap();
    refused(dir, "check case.csv --row 1 --end-speed 40m/s", 2, "end_speed: 40 m/s cannot be reached");
}

/// Annex 3 says what its driver does with a leader that decelerates beyond 5 m/s²: no reading of softer ones applies.
#[test]
fn readings_of_soft_leaders_are_not_named_for_hard_ones() {
    for (deceleration, is_soft) in [("-5", true), ("-5.1", false)] {
        let sheet = json(&format!("lvd --ego-speed 60km/h --gap 10 --acceleration={deceleration}"));
        let readings = sheet["by_rule"].as_array().unwrap().iter().filter_map(|row| row["reading"].as_str());
        let soft = readings.filter(|reading| reading.starts_with("cchdm.lvd_below_threshold")).count();
        assert_eq!(soft > 0, is_soft, "{deceleration}: {sheet}");
    }
}

#[test]
fn the_verdict_by_rule_names_each_driver_and_the_rule_in_force_is_the_answer() {
    // FSM alone avoids it.
    let split = "cut-in 60 30 18 1 --profiles un-r157,eu-2022-1426,paper";
    let found = json(split);
    let rows = found["by_rule"].as_array().unwrap();
    let verdict = |rule: &str| {
        let of_first = |row: &&Value| row["profile"] == "un-r157" && row["reading"].is_null() && row["rule"] == rule;
        let row = rows.iter().find(of_first).unwrap();
        (row["verdict"].as_str().unwrap().to_owned(), row["differs"] == Value::Bool(true))
    };
    assert_eq!(verdict("any (in force)"), (found["verdict"].as_str().unwrap().to_owned(), false));
    let [alone, all] = ["CCHDM alone", "all"].map(verdict);
    assert_eq!((alone.0.as_str(), alone.1, &all), ("not preventable", true, &alone), "{found}");
    assert_eq!(verdict("FSM alone").0, "preventable");
    let readings: Vec<&Value> = rows.iter().map(|row| &row["reading"]).filter(|reading| !reading.is_null()).collect();
    assert!(readings.len() == 12 && readings.contains(&&"cchdm.coasting_mps2 = 0".into()), "{readings:?}");
    // The EU's profiles have no reference drivers.
    assert!(rows.iter().all(|row| !row["profile"].as_str().unwrap().starts_with("eu-")));
    let (_, out, _) = run(split);
    assert!(out.contains("If one driver alone decides: CCHDM: not preventable; FSM: preventable."), "{out}");
    let sentence = flat(&out);
    assert!(sentence.contains("no paragraph of UN R157 prescribes that one driver suffices"), "{out}");
    assert!(sentence.contains("preventable*"), "{out}");
}
