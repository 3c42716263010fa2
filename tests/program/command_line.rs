//! The program as its users run it.

use crate::common;

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

fn lanesweep(args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lanesweep"));
    command.env("NO_COLOR", "1").args(args).output().unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("the program ended by itself")
}

fn stderr(output: &Output) -> String {
    // The drawing breaks long lines.
    String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ")
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Two synthetic recordings in a folder of their own.
fn recordings() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let made = lanesweep(&[
        "-q",
        "synth",
        text(dir.path()),
        "--synth-recordings",
        "2",
        "--config",
        "generator.duration_s=120",
    ]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    dir
}

const SMALL: [&str; 4] = ["--synth-recordings", "2", "--config", "generator.duration_s=120"];

#[test]
fn the_study_says_that_its_own_data_is_synthetic_in_every_output() {
    let out = tempfile::tempdir().unwrap();
    let study = lanesweep(&[&["-q", "study", "--out", text(out.path())], &SMALL[..]].concat());
    assert_eq!(code(&study), 0, "{}", stderr(&study));
    let answer = String::from_utf8(study.stdout).unwrap();
    assert!(
        answer.contains("SYNTHETIC DATA")
            && answer.replace('\n', " ").contains("No number here is a statement about real")
    );
    for file in ["failures.csv", "f1.csv", "claims.csv", "run.json"] {
        let content = std::fs::read_to_string(out.path().join(file)).unwrap();
        assert!(content.to_lowercase().contains("synthetic"), "{file}");
    }
    for category in ["cut-in", "cut-out", "lvd"] {
        let svg = std::fs::read_to_string(out.path().join(format!("radar-{category}.svg"))).unwrap();
        assert!(svg.contains("SYNTHETIC DATA"), "{category}");
    }
}

#[test]
fn recordings_their_scenario_file_and_the_generator_give_the_same_study() {
    let data = recordings();
    let out = tempfile::tempdir().unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| out.path().join(name));
    let scenarios = out.path().join("scenarios.jsonl");
    let run = |args: &[&str]| {
        let output = lanesweep(args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    };
    run(&[&["-q", "study", "--out", text(&a)], &SMALL[..]].concat());
    run(&["-q", "study", text(data.path()), "--out", text(&b), "--threads", "1"]);
    run(&["-q", "mine", text(data.path()), "--out", text(&scenarios)]);
    run(&["-q", "study", "--scenarios", text(&scenarios), "--out", text(&c), "--threads", "2"]);
    let read = |dir: &Path, file: &str| std::fs::read_to_string(dir.join(file)).unwrap();
    // The column `data` tells synthetic from recorded; every number is the same.
    let numbers = |dir: &Path, file: &str| read(dir, file).replace(",synthetic\n", ",recorded\n");
    for file in ["failures.csv", "f1.csv", "claims.csv"] {
        assert!(numbers(&a, file) == numbers(&b, file), "{file}: generated against written");
        assert!(numbers(&b, file) == numbers(&c, file), "{file}: recordings against scenario file");
    }
    let hash = |dir: &Path| {
        let record: serde_json::Value = serde_json::from_str(&read(dir, "run.json")).unwrap();
        record["plan_sha256"].as_str().unwrap().to_owned()
    };
    assert_eq!(hash(&a), hash(&b));
    assert_eq!(hash(&b), hash(&c));
}

#[test]
fn one_bad_recording_among_many_is_reported_the_others_are_used_and_the_exit_status_says_so() {
    let data = recordings();
    std::fs::write(data.path().join("03_tracks.csv"), "frame,id\n").unwrap();
    let out = tempfile::tempdir().unwrap();
    let study = lanesweep(&["study", text(data.path()), "--out", text(out.path())]);
    assert_eq!(code(&study), 4, "{}", stderr(&study));
    assert!(stderr(&study).contains("03_tracksMeta.csv"), "{}", stderr(&study));
    assert!(out.path().join("f1.csv").exists());
    let record = std::fs::read_to_string(out.path().join("run.json")).unwrap();
    assert!(record.contains("03_tracksMeta.csv"), "what was left out stands in run.json");
}

#[test]
fn a_folder_that_cannot_be_used_leaves_nothing_behind() {
    let empty = tempfile::tempdir().unwrap();
    let out = empty.path().join("out");
    for (dir, expected) in [(text(empty.path()).to_owned(), 3), ("no/such/folder".to_owned(), 6)] {
        let study = lanesweep(&["study", &dir, "--out", text(&out)]);
        assert!([3, expected].contains(&code(&study)), "{dir}: {} {}", code(&study), stderr(&study));
        assert!(study.stdout.is_empty());
        assert!(!out.exists(), "nothing may be written for {dir}");
    }
}

#[test]
fn every_lane_of_the_study_can_be_written_and_one_of_them_rerun_by_its_key() {
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let out = tempfile::tempdir().unwrap();
    let lanes = out.path().join("lanes.csv");
    let result = out.path().join("result");
    let study =
        lanesweep(&["-q", "study", "--scenarios", text(&scenarios), "--out", text(&result), "--rows", text(&lanes)]);
    assert_eq!(code(&study), 0, "{}", stderr(&study));
    let ours = std::fs::read_to_string(&lanes).unwrap();
    let golden = std::fs::read_to_string(common::golden("paper_sumo_01_02_lanes.csv")).unwrap();
    let (columns, golden) = (ours.lines().next().unwrap(), golden.lines().next().unwrap());
    assert_eq!(columns, format!("{golden},min_thw,max_drac,tet,tit,pet"), "the golden columns come first");
    let line = ours.lines().nth(1).unwrap();
    let fields: Vec<&str> = line.split(',').collect();
    let key = format!("{}/{}/{}s/{}", fields[0], fields[2], fields[3].trim_end_matches(".0"), fields[4]);
    let rerun = lanesweep(&["simulate", "--scenarios", text(&scenarios), "--lane", &key]);
    assert_eq!(code(&rerun), 0, "{key}: {}", stderr(&rerun));
    let verdict = if fields[5] == "1" { "Collision FAIL" } else { "Collision pass" };
    assert!(stderr(&rerun).contains(verdict), "{line}: {}", stderr(&rerun));
}

#[test]
fn too_few_scenarios_for_a_decomposition_leave_it_out_and_say_so() {
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let out = tempfile::tempdir().unwrap();
    let study = lanesweep(&["study", "--scenarios", text(&scenarios), "--out", text(out.path())]);
    assert_eq!(code(&study), 0, "{}", stderr(&study));
    assert!(stderr(&study).contains("too few for a decomposition"), "{}", stderr(&study));
}

#[test]
fn a_case_from_flags_from_toml_and_from_a_table_row_is_the_same_case() {
    let dir = tempfile::tempdir().unwrap();
    let (toml, table) = (dir.path().join("case.toml"), dir.path().join("cases.csv"));
    std::fs::write(
        &toml,
        "category = \"cut-in\"\nmodels = \"FSM\"\nego_speed_mps = 30\nspeed_kmh = 72\nthw = 1.2\nlateral_speed = 1.0\n",
    )
    .unwrap();
    std::fs::write(
        &table,
        "category,models,ego_speed_mps,speed_mps,thw,lateral_speed\nlvd,RSS,1,1,1,\ncut-in,FSM,30,20,1.2,1.0\n",
    )
    .unwrap();
    let flags = "simulate --category cut-in --models FSM --ego-speed 30m/s --speed 20m/s --thw 1.2 --lateral-speed 1";
    let by_flags = lanesweep(&flags.split(' ').collect::<Vec<_>>());
    let by_toml = lanesweep(&["simulate", "--case-file", text(&toml)]);
    let by_table = lanesweep(&["simulate", "--table", text(&table), "--row", "2"]);
    assert_eq!(code(&by_flags), 0, "{}", stderr(&by_flags));
    assert!(!by_flags.stdout.is_empty());
    assert_eq!(by_flags.stdout, by_toml.stdout, "{}", stderr(&by_toml));
    assert_eq!(by_flags.stdout, by_table.stdout, "{}", stderr(&by_table));
}

/// A standing vehicle 20 m ahead of 50 m/s: every time step ends in its rear, or is refused with the longest one.
#[test]
fn no_time_step_lets_the_ego_drive_through_a_vehicle() {
    let simulate = |dt: &str, model: &str| {
        let case = ["--category", "lvd", "--ego-speed", "50m/s", "--speed", "0", "--gap", "20", "--acceleration", "0"];
        lanesweep(&[&["simulate", "--dt", dt, "--models", model], &case[..]].concat())
    };
    for dt in ["0.04", "0.1", "0.17", "0.2", "0.25"] {
        let run = simulate(dt, "FSM");
        let said = stderr(&run);
        assert!(code(&run) == 0 && said.contains("Collision FAIL, TTC FAIL, BTN FAIL"), "{dt} s: {said}");
        let table = String::from_utf8(run.stdout).unwrap();
        assert!(table.lines().last().unwrap().ends_with(",contact"), "{dt} s");
    }
    for (dt, model, longest) in [("0.3", "FSM", "0.25 s"), ("0.2", "all", "0.1 s"), ("0.085", "Reg157", "0.07 s")] {
        let run = simulate(dt, model);
        let said = stderr(&run);
        assert!(code(&run) == 2 && said.contains(&format!("at most {longest}")), "{dt} s, {model}: {said}");
    }
}

#[test]
fn wrong_words_are_answered_with_what_to_write_instead() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, content).unwrap();
        text(&path).to_owned()
    };
    let key = file("key.toml", "[score]\nleast_failurez = 5\n");
    let range = file("range.toml", "[score]\nconfidence = 0\n");
    let svd = file("svd.toml", "[parameterization]\nsvd_instants = 1\n");
    let profile = file("profile.toml", "name = \"x\"\n");
    let cases: [(&[&str], i32, &str); 14] = [
        (&["study", "--profile", "papr"], 2, "did you mean `paper`"),
        (&["study", "--profile", &profile], 2, "missing field"),
        (&["study", "--dt", "0"], 2, "--dt"),
        (&["study", "--dt", "NaN"], 2, "--dt"),
        (&["study", "--config", &key], 2, "least_failurez"),
        (&["study", "--config", &range], 2, "score.confidence"),
        (&["study", "--config", &svd], 2, "svd_instants"),
        (&["study", "--categories", "cutin"], 2, "use cut-in, cut-out, lvd"),
        (&["study", "--threads", "0"], 2, "from 1 to 4096"),
        (&["study", "--scenarios", "no-such-file.jsonl"], 6, "no-such-file.jsonl"),
        (&["simulate", "--category", "cutin"], 2, "use cut-in, cut-out or lvd"),
        (
            &[
                "simulate",
                "--category",
                "lvd",
                "--ego-speed",
                "20m/s",
                "--gap",
                "5",
                "--acceleration",
                "-6",
                "--models",
                "XYZ",
            ],
            2,
            "Reg157, CCHDM",
        ),
        (
            &["simulate", "--category", "lvd", "--ego-speed", "-3m/s", "--gap", "5", "--acceleration", "-6"],
            2,
            "at least 0",
        ),
        (&["simulate", "--category", "lvd", "--ego-speed", "20m/s", "--acceleration", "-6"], 2, "--thw"),
    ];
    for (args, expected, hint) in cases {
        let output = lanesweep(args);
        let said = stderr(&output);
        assert_eq!(code(&output), expected, "{args:?}: {said}");
        assert!(said.contains(hint), "{args:?} should say `{hint}`: {said}");
        assert!(!said.contains("panicked"), "{args:?}: {said}");
    }
}

#[test]
fn a_list_with_a_value_twice_is_refused_with_the_value() {
    let lane = "01_cut_in_81_74_836/S/0.6s/RSS";
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let export = ["export", "xosc", "--scenarios", text(&scenarios), "--lane", lane, "--lane"];
    let case = "--category lvd --ego-speed 20m/s --gap 20 --acceleration -6 --models FSM,fsm";
    let case: Vec<&str> = case.split(' ').collect();
    let lists: [(&[&str], &str); 16] = [
        (&["study", "--thw", "0.6,0.6"], "--thw: `0.6` is given twice"),
        (&["study", "--thw", "0.6,1, 0.60"], "--thw: `0.60` repeats `0.6`"),
        (&["study", "--thw", "0.6,0.6000000001"], "--thw: `0.6000000001` repeats `0.6`"),
        (&["study", "--thw", "r157,1,r157"], "--thw: `r157` is given twice"),
        (&["study", "--thw", "1,1.0"], "--thw: `1.0` repeats `1`"),
        (&["study", "--models", "FSM,RSS,FSM"], "--models: `FSM` is given twice"),
        (&["study", "--models", "FSM", "--models", "all"], "--models: `all` repeats `FSM`"),
        (&["study", "--categories", "lvd,cut-in,cut_in"], "--categories: `cut_in` repeats `cut-in`"),
        (&["fit", "--parameterizations", "2,i,2"], "--parameterizations: `2` is given twice"),
        (&["fit", "--parameterizations", "all,2"], "--parameterizations: `2` repeats `all`"),
        (&["map", "lvd", "--preset", "r157", "--models", "RSS,RSS"], "--models: `RSS` is given twice"),
        (
            &["sample", "a.json", "--estimator", "is", "--proposal", "p.json", "--proposal", "p.json"],
            "--proposal: `p.json` is given twice",
        ),
        (&[&["simulate"], &case[..]].concat(), "models: `fsm` repeats `FSM`"),
        (&[&["export", "xosc"], &case[..]].concat(), "models: `fsm` repeats `FSM`"),
        (
            &[
                "check",
                "--category",
                "lvd",
                "--ego-speed",
                "20m/s",
                "--gap",
                "9",
                "--acceleration",
                "-6",
                "--profiles",
                "paper,paper",
            ],
            "--profiles: `paper` is given twice",
        ),
        (&[&export[..], &["01_cut_in_81_74_836/S/0.60s/RSS"]].concat(), "01_cut_in_81_74_836/S/0.6s/RSS"),
    ];
    for (args, expected) in lists {
        let output = lanesweep(args);
        // The drawing breaks long lines.
        let said = stderr(&output);
        let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert_eq!(code(&output), 2, "{args:?}: {said}");
        assert!(said.contains(expected) && said.contains("give every value once"), "{args:?}: {said}");
    }
}

#[test]
fn a_result_folder_that_cannot_be_written_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let study = lanesweep(&[&["-q", "study", "--out", text(&file.join("out"))], &SMALL[..]].concat());
    assert_eq!(code(&study), 6, "{}", stderr(&study));
    assert!(stderr(&study).contains("cannot"), "{}", stderr(&study));
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let program = env!("CARGO_BIN_EXE_lanesweep");
    let mut child = std::process::Command::new(program)
        .args(["simulate", "--category", "lvd", "--models", "RSS", "--ego-speed", "30m/s", "--thw", "2"])
        .args(["--acceleration", "-0.1", "--end-speed", "1m/s"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn help_names_every_verb_and_every_exit_code() {
    let help = String::from_utf8(lanesweep(&["--help"]).stdout).unwrap();
    for word in ["study", "mine", "synth", "simulate", "verify", "merge", "Exit codes"] {
        assert!(help.contains(word), "{word}");
    }
    for exit in lanesweep::cli::Exit::ALL {
        assert!(help.contains(exit.meaning()), "{exit:?}");
    }
    let chapter = include_str!("../../docs/src/reference/exit-codes.md");
    for code in lanesweep::cli::Exit::ALL.map(|exit| exit.code()).into_iter().chain([129, 130, 143]) {
        assert!(help.lines().any(|line| line.trim_start().starts_with(&format!("{code}  "))), "{code}: {help}");
        assert!(chapter.contains(&format!("\n| {code} | ")), "the chapter on exit codes has no {code}");
    }
}

const CASE: &str = "simulate --category cut-in --ego-speed 30m/s --speed 20m/s --lateral-speed 1.5 --models Reg157";

/// `simulate` on a case with more flags: stdout and, as one line, stderr.
fn simulated(flags: &str) -> (String, String) {
    let args: Vec<&str> = CASE.split(' ').chain(flags.split(' ')).collect();
    let output = lanesweep(&args);
    assert_eq!(code(&output), 0, "{flags}: {}", stderr(&output));
    (String::from_utf8(output.stdout.clone()).unwrap(), stderr(&output))
}

#[test]
fn a_contact_is_told_by_its_kind_and_its_closing_speed() {
    let (json, _) = simulated("--thw 0.4 --format json");
    let outcome: serde_json::Value = serde_json::from_str(&json).unwrap();
    let outcome = &outcome["lanes"][0]["outcome"];
    let speed = |name: &str| outcome[name].as_f64().unwrap_or_else(|| panic!("{name}: {outcome}"));
    let (ego, closing) = (speed("impact_speed_mps"), speed("impact_closing_speed_mps"));
    assert!((ego - closing - 20.0).abs() < 1e-9, "the other one drives 20 m/s: {outcome}");
    let (_, said) = simulated("--thw 0.4");
    assert!(said.contains("(rear-end contact, closing at ") && said.contains(" m/s, the ego at "), "{said}");
    let printed = said.split("closing at ").nth(1).unwrap().split(' ').next().unwrap().parse::<f64>().unwrap();
    assert!((printed - closing).abs() < 0.01, "{said}");
    // The ego is past the other's middle before that comes into its path.
    let beside =
        "simulate --category cut-in --ego-speed 30m/s --speed 20m/s --gap 14 --lateral-speed 0.8 --models Reg157";
    let said = stderr(&lanesweep(&beside.split(' ').collect::<Vec<_>>()));
    assert!(said.contains("side contact") && said.contains("min TTC –, max BTN ∞, min gap 0 m"), "{said}");
}

#[test]
fn numbers_for_people_have_four_digits_at_most_and_an_infinite_one_a_sign() {
    for flags in ["--thw 0.4", "--thw 1.1", "--gap 33.333333"] {
        let (_, said) = simulated(flags);
        for number in said.split(|c: char| !c.is_ascii_digit() && c != '.').filter(|n| n.contains('.') && n.len() > 1) {
            let digits = number.trim_start_matches(['0', '.']).chars().filter(char::is_ascii_digit).count();
            assert!(digits <= 4, "{number}: {said}");
        }
    }
    // At the contact no braking helps.
    let (csv, said) = simulated("--thw 0.4");
    assert!(said.contains("max BTN ∞") && !said.contains("inf"), "{said}");
    assert!(csv.contains(",inf,"), "files keep their spelling: {csv}");
}

#[test]
fn the_initial_gap_is_that_of_the_first_row_whatever_the_profile() {
    for profile in ["paper", "jrc-2021"] {
        let (csv, said) = simulated(&format!("--thw 1.2 --profile {profile}"));
        let mut lines = csv.lines();
        let column = lines.next().unwrap().split(',').position(|name| name == "other_gap_m").unwrap();
        let first: f64 = lines.next().unwrap().split(',').nth(column).unwrap().parse().unwrap();
        let printed = said.split("initial gap ").nth(1).unwrap().split(' ').next().unwrap().parse::<f64>().unwrap();
        assert!((printed - first).abs() < 0.005, "{profile}: {said} but the series starts at {first}");
    }
}

#[test]
fn quiet_means_errors_only() {
    let args: Vec<&str> = CASE.split(' ').chain(["-q", "--thw", "0.4"]).collect();
    let output = lanesweep(&args);
    assert!(output.stderr.is_empty() && !output.stdout.is_empty(), "{}", stderr(&output));
}

#[cfg(target_os = "linux")]
#[test]
fn an_error_stream_that_takes_nothing_does_not_end_the_work() {
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let run = |args: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_lanesweep"));
        command.args(args.split(' ')).stderr(full()).stdout(std::process::Stdio::null()).status().unwrap().code()
    };
    assert_eq!(run(&format!("{CASE} --thw 1")), Some(0));
    assert_eq!(run("mine no-such-folder"), Some(6));
    assert_eq!(run("study --synth-recordings"), Some(2));
}

/// Runs the case in a shell with a limit.
#[cfg(unix)]
fn limited(limit: &str, args: &str) -> Output {
    let script = format!("ulimit {limit}; exec \"$0\" {args}");
    // The environment counts as stack before the program begins, and cargo's is large.
    let mut shell = std::process::Command::new("sh");
    shell.env_clear().env("PATH", std::env::var_os("PATH").unwrap_or_default());
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_lanesweep")]).output().unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn an_address_space_that_is_too_small_is_told_with_its_limit_and_is_no_crash() {
    // Below, the system's loader does not get as far as the program.
    let is_loaded = |kib: &u32| limited(&format!("-v {kib}"), "--version").status.success();
    let mut limits = (20_000..400_000).step_by(1000).skip_while(|kib| !is_loaded(kib)).step_by(2).take(25);
    let (mut done, mut refused) = (0, 0);
    assert!(limits.all(|kib| {
        let output = limited(&format!("-v {kib}"), &format!("{CASE} --thw 1 --threads 4096"));
        let said = stderr(&output);
        match output.status.code() {
            Some(0) => done += 1,
            Some(6) => refused += 1,
            other => panic!("{kib} KiB: {other:?} {:?} {said}", output.status),
        }
        assert!(output.status.success() || said.contains("ulimit -v"), "{kib} KiB: {said}");
        true
    }));
    println!("{done} runs were done, {refused} were refused");
    assert!(refused > 0);
}

#[cfg(target_os = "linux")]
#[test]
fn the_stack_that_a_shell_allows_does_not_matter() {
    for kib in [16, 64, 100, 1000] {
        let output = limited(&format!("-s {kib}"), &format!("{CASE} --thw 1"));
        assert!(output.status.success(), "{kib} KiB: {:?} {}", output.status, stderr(&output));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn too_many_open_files_are_answered_with_their_limit() {
    let dir = tempfile::tempdir().unwrap();
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let mut refused = 0;
    for files in 4..12 {
        let study = format!("study --scenarios {} --backend cpu --out {}", text(&scenarios), text(dir.path()));
        let output = limited(&format!("-n {files}"), &study);
        let said = stderr(&output);
        assert!([0, 6].contains(&code(&output)), "{files}: {said}");
        if code(&output) == 6 {
            assert!(said.contains("ulimit -n") && !said.contains("disk"), "{files}: {said}");
            refused += 1;
        }
    }
    assert!(refused > 0);
}

#[cfg(target_os = "linux")]
#[test]
fn what_standard_output_does_not_take_is_no_success() {
    let run = |args: &str, to: std::process::Stdio| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_lanesweep"));
        command.args(args.split(' ')).stdout(to).output().unwrap()
    };
    let help = ["--help", "-h", "--version", "help", "study --help", "config -h", "help study"];
    let printed =
        ["config completions bash", "config init -", "config show", "config schema", &format!("{CASE} --thw 1")];
    for args in help.into_iter().chain(printed) {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = run(args, full.into());
        assert!(code(&output) == 6 && stderr(&output).contains("standard output"), "{args}: {}", stderr(&output));
        // A reader that goes away is no error.
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        assert_eq!(code(&run(args, writer.into())), 0, "{args}");
    }
}

#[test]
fn threads_beyond_the_useful_number_are_not_started_and_said_once() {
    let (one, many) = (["--threads", "1"], ["--threads", "4096"]);
    let case: Vec<&str> = CASE.split(' ').chain(["--thw", "1"]).collect();
    let (one, many) = (lanesweep(&[&case[..], &one].concat()), lanesweep(&[&case[..], &many].concat()));
    assert_eq!((code(&one), code(&many)), (0, 0), "{}", stderr(&many));
    assert!(one.stdout == many.stdout && !stderr(&one).contains("--threads"));
    assert_eq!(stderr(&many).matches("--threads 4096: ").count(), 1, "{}", stderr(&many));
    let dir = tempfile::tempdir().unwrap();
    let fit =
        ["-q", "fit", "--synth-recordings", "2", "--categories", "cut-in", "--parameterizations", "2", "--config"];
    let density = dir.path().join("d.json");
    assert_eq!(code(&lanesweep(&[&fit[..], &["fit.valid_draws=1000", "--out", text(&density)]].concat())), 0);
    let estimate = |threads: &str| {
        let out = dir.path().join(threads);
        let flags =
            ["--samples", "1000", "--models", "FSM", "--backend", "cpu", "--threads", threads, "--out", text(&out)];
        let sample = lanesweep(&[&["-q", "sample", text(&density)], &flags[..]].concat());
        assert_eq!(code(&sample), 0, "{}", stderr(&sample));
        let mut record: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("estimate.json")).unwrap()).unwrap();
        record.as_object_mut().unwrap().remove("settings").unwrap();
        let host = record.as_object_mut().unwrap().remove("host").unwrap();
        (host["threads"].as_u64().unwrap(), record)
    };
    let ((_, one), (threads, many)) = (estimate("1"), estimate("2048"));
    let cores = std::thread::available_parallelism().unwrap().get() as u64;
    assert!(threads <= 4 * cores, "{threads} threads on {cores} cores");
    assert_eq!(one, many);
}

#[test]
fn a_study_of_some_headways_and_models_computes_no_claim_that_needs_all() {
    let out = tempfile::tempdir().unwrap();
    let few = ["--categories", "lvd", "--models", "FSM,RSS", "--thw", "1.2,0.4", "--backend", "cpu"];
    let study = lanesweep(&[&["-q", "study", "--out", text(out.path())], &few[..], &SMALL[..]].concat());
    assert_eq!(code(&study), 0, "{}", stderr(&study));
    let printed = String::from_utf8(study.stdout).unwrap();
    assert!(!printed.contains("Reg157") && !printed.contains("not computed"), "{printed}");
    let mut claims = csv::Reader::from_path(out.path().join("claims.csv")).unwrap();
    let verdict = claims.headers().unwrap().iter().position(|name| name == "verdict").unwrap();
    let verdicts: Vec<String> = claims.records().map(|row| row.unwrap()[verdict].to_owned()).collect();
    assert!(verdicts.len() > 3 && verdicts.iter().all(|v| v == "not computed"), "{verdicts:?}");
    let headways = std::fs::read_to_string(out.path().join("headways.csv")).unwrap();
    assert!(headways.contains(",1.2s,RSS,") && !headways.contains(",2s,") && !headways.contains("CCHDM"), "{headways}");
    assert_eq!(code(&lanesweep(&["study", "--thw", "0"])), 2);
    assert_eq!(code(&lanesweep(&["study", "--models", "ACC"])), 2);
}

#[test]
fn a_recording_with_speeds_that_no_scenario_holds_is_bad_data_and_no_defect() {
    // The recording is left out as implausible, or, where that is accepted, each scenario as what no file may hold.
    let data = recordings();
    let tracks = data.path().join("01_tracks.csv");
    let table = std::fs::read_to_string(&tracks).unwrap();
    let at = table.lines().next().unwrap().split(',').position(|name| name == "xVelocity").unwrap();
    let faster = |(line, text): (usize, &str)| {
        let mut fields: Vec<String> = text.split(',').map(str::to_owned).collect();
        if line > 0 {
            fields[at] = (fields[at].parse::<f64>().unwrap() * 1e6).to_string();
        }
        fields.join(",") + "\n"
    };
    std::fs::write(&tracks, table.lines().enumerate().map(faster).collect::<String>()).unwrap();
    let out = data.path().join("s.jsonl");
    let mined = lanesweep(&["-q", "mine", text(data.path()), "--out", text(&out)]);
    assert_eq!(code(&mined), 4, "{}", stderr(&mined));
    assert!(stderr(&mined).contains("line 2, column `xVelocity`"), "{}", stderr(&mined));
    let mined = lanesweep(&["-q", "mine", text(data.path()), "--out", text(&out), "--accept-implausible"]);
    assert_eq!(code(&mined), 4, "{}", stderr(&mined));
    assert!(stderr(&mined).contains("`ego.v0`") && stderr(&mined).contains("at most 1e6"), "{}", stderr(&mined));
}
