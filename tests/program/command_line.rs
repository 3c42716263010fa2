//! The program as its users run it.

use std::path::Path;
use std::process::{Command, Output};

use crate::common;
use crate::common::program::{PROGRAM, done, json, lanesweep, ran, refused, said, unbroken, words};

fn code(output: &Output) -> i32 {
    output.status.code().expect("the program ended by itself")
}

fn stderr(output: &Output) -> String {
    // The drawing breaks long lines.
    unbroken(&output.stderr)
}

const SMALL: &str = "--synth-recordings 2 --config generator.duration_s=120";

/// The path of a scenario file.
fn scenarios() -> String {
    common::golden("paper_sumo_01_02_scenarios.jsonl").display().to_string()
}

/// Two synthetic recordings in the folder `data` of a folder.
fn recordings() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    ran(dir.path(), &format!("-q tracks --convert data {SMALL}"));
    dir
}

fn read(dir: &Path, file: &str) -> String {
    std::fs::read_to_string(dir.join(file)).unwrap()
}

#[test]
fn the_study_says_that_its_own_data_is_synthetic_in_every_output() {
    let dir = tempfile::tempdir().unwrap();
    let answer = ran(dir.path(), &format!("-q study --out out {SMALL}")).replace('\n', " ");
    assert!(answer.contains("SYNTHETIC DATA") && answer.contains("No number here is a statement about real"));
    for file in ["failures.csv", "f1.csv", "claims.csv", "run.json"] {
        assert!(read(&dir.path().join("out"), file).to_lowercase().contains("synthetic"), "{file}");
    }
    for category in ["cut-in", "cut-out", "lvd"] {
        assert!(read(dir.path(), &format!("out/radar-{category}.svg")).contains("SYNTHETIC DATA"), "{category}");
    }
}

#[test]
fn recordings_their_scenario_file_and_the_generator_give_the_same_study() {
    let dir = recordings();
    let dir = dir.path();
    ran(dir, &format!("-q study --out a {SMALL}"));
    ran(dir, "-q study data --out b --threads 1");
    ran(dir, "-q mine data --out scenarios.jsonl");
    ran(dir, "-q study --scenarios scenarios.jsonl --out c --threads 2");
    // The column `data` tells synthetic from recorded; every number is the same.
    let numbers = |out: &str, file: &str| read(&dir.join(out), file).replace(",synthetic\n", ",recorded\n");
    for file in ["failures.csv", "f1.csv", "claims.csv"] {
        assert!(numbers("a", file) == numbers("b", file), "{file}: generated against written");
        assert!(numbers("b", file) == numbers("c", file), "{file}: recordings against scenario file");
    }
    let [a, b, c] = ["a", "b", "c"].map(|out| json(&dir.join(out).join("run.json"))["plan_sha256"].clone());
    assert!(a.is_string() && a == b && b == c);
}

#[test]
fn one_bad_recording_among_many_is_reported_the_others_are_used_and_the_exit_status_says_so() {
    let dir = recordings();
    std::fs::write(dir.path().join("data/03_tracks.csv"), "frame,id\n").unwrap();
    let (code, said) = said(dir.path(), "study data --out out");
    assert!(code == 4 && said.contains("03_tracksMeta.csv"), "{code} {said}");
    assert!(dir.path().join("out/f1.csv").exists());
    assert!(read(dir.path(), "out/run.json").contains("03_tracksMeta.csv"), "what was left out stands in run.json");
}

#[test]
fn a_folder_that_cannot_be_used_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("empty")).unwrap();
    std::fs::write(dir.path().join("file"), "in the way").unwrap();
    refused(dir.path(), "study empty --out out", 3, "no recording");
    refused(dir.path(), "study no/such/folder --out out", 3, "no/such/folder");
    refused(dir.path(), &format!("-q study --out file/out {SMALL}"), 6, "cannot");
    assert!(!dir.path().join("out").exists(), "nothing may be written");
}

#[test]
fn every_lane_of_the_study_can_be_written_and_one_of_them_rerun_by_its_key() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, &format!("-q study --scenarios {} --out result --rows lanes.csv", scenarios()));
    let ours = read(dir, "lanes.csv");
    assert!(
        ours.starts_with("id,category,variant,headway,model,collision,ttc,btn,"),
        "the key and the verdicts come first"
    );
    let line = ours.lines().nth(1).unwrap();
    let fields: Vec<&str> = line.split(',').collect();
    let key = format!("{}/{}/{}/{}", fields[0], fields[2], fields[3], fields[4]);
    let (code, said) = said(dir, &format!("simulate --scenarios {} --lane {key}", scenarios()));
    let verdict = if fields[5] == "1" { "Collision FAIL" } else { "Collision pass" };
    assert!(code == 0 && said.contains(verdict), "{line}: {said}");
}

#[test]
fn too_few_scenarios_for_a_decomposition_leave_it_out_and_say_so() {
    let dir = tempfile::tempdir().unwrap();
    let (code, said) = said(dir.path(), &format!("study --scenarios {} --out out", scenarios()));
    assert!(code == 0 && said.contains("too few for a decomposition"), "{said}");
}

#[test]
fn wrong_words_are_answered_with_what_to_write_instead() {
    let dir = tempfile::tempdir().unwrap();
    for (name, content) in [
        ("key.toml", "[score]\nleast_failurez = 5\n"),
        ("range.toml", "[score]\nconfidence = 0\n"),
        ("svd.toml", "[parameterization]\nsvd_instants = 1\n"),
        ("profile.toml", "name = \"x\"\n"),
    ] {
        std::fs::write(dir.path().join(name), content).unwrap();
    }
    let lvd = "simulate --category lvd --acceleration -6";
    let fast = "simulate --category lvd --ego-speed 50m/s --speed 0 --gap 20 --acceleration 0";
    for (line, code, hint) in [
        ("study --profile papr", 2, "did you mean `paper`"),
        ("study --profile profile.toml", 2, "missing field"),
        ("study --dt 0", 2, "--dt"),
        ("study --dt NaN", 2, "--dt"),
        ("study --config key.toml", 2, "least_failurez"),
        ("study --config range.toml", 2, "score.confidence"),
        ("study --config svd.toml", 2, "svd_instants"),
        ("study --categories cutin", 2, "use cut-in, cut-out, lvd"),
        ("study --threads 0", 2, "from 1 to 4096"),
        ("study --thw 0", 2, ""),
        ("study --models ACC", 2, ""),
        ("study --scenarios no-such-file.jsonl", 3, "no-such-file.jsonl"),
        ("simulate --category cutin", 2, "use cut-in, cut-out or lvd"),
        (&format!("{lvd} --ego-speed 20m/s --gap 5 --models XYZ"), 2, "Reg157, CCHDM"),
        (&format!("{lvd} --ego-speed -3m/s --gap 5"), 2, "at least 0"),
        (&format!("{lvd} --ego-speed 20m/s"), 2, "--thw"),
        // The longest step in which no vehicle is driven through.
        (&format!("{fast} --dt 0.3 --models FSM"), 2, "at most 0.25 s"),
        (&format!("{fast} --dt 0.2 --models all"), 2, "at most 0.1 s"),
        (&format!("{fast} --dt 0.085 --models Reg157"), 2, "at most 0.07 s"),
    ] {
        refused(dir.path(), line, code, hint);
        assert!(!said(dir.path(), line).1.contains("panicked"), "{line}");
    }
}

#[test]
fn a_list_with_a_value_twice_is_refused_with_the_value() {
    let dir = tempfile::tempdir().unwrap();
    let lanes = "01_cut_in_81_74_836/S/0.6s/RSS --lane 01_cut_in_81_74_836/S/0.60s/RSS";
    let lanes = format!("simulate --scenarios {} --lane {lanes}", scenarios());
    let case = "--category lvd --ego-speed 20m/s --gap 20 --acceleration -6";
    for (line, hint) in [
        ("study --thw 0.6,0.6", "--thw: `0.6` is given twice"),
        ("study --thw 0.6,1,\u{2}0.60", "--thw: `0.60` repeats `0.6`"),
        ("study --thw 0.6,0.6000000001", "--thw: `0.6000000001` repeats `0.6`"),
        ("study --thw r157,1,r157", "--thw: `r157` is given twice"),
        ("study --thw 1,1.0", "--thw: `1.0` repeats `1`"),
        ("study --models FSM,RSS,FSM", "--models: `FSM` is given twice"),
        ("study --models FSM --models all", "--models: `all` repeats `FSM`"),
        ("study --categories lvd,cut-in,cut_in", "--categories: `cut_in` repeats `cut-in`"),
        ("fit --parameterizations 2,i,2", "--parameterizations: `2` is given twice"),
        ("fit --parameterizations all,2", "--parameterizations: `2` repeats `all`"),
        ("map lvd --preset r157 --models RSS,RSS", "--models: `RSS` is given twice"),
        ("sample a.json --estimator is --proposal p.json --proposal p.json", "--proposal: `p.json` is given twice"),
        (&format!("simulate {case} --models FSM,fsm"), "models: `fsm` repeats `FSM`"),
        (&format!("check {case} --profiles paper,paper"), "--profiles: `paper` is given twice"),
        (&lanes, "01_cut_in_81_74_836/S/0.6s/RSS"),
    ] {
        // A blank within a word.
        let words: Vec<String> = words(line).into_iter().map(|word| word.replace('\u{2}', " ")).collect();
        let (code, _, error) = lanesweep(dir.path(), &words.iter().map(String::as_str).collect::<Vec<_>>());
        let said = unbroken(error.as_bytes());
        assert!(code == 2 && said.contains(hint) && said.contains("give every value once"), "{line}: {said}");
    }
}

#[test]
fn help_names_every_verb_and_every_exit_code() {
    let help = done(Path::new("."), &["--help"]);
    for word in ["study", "mine", "tracks", "simulate", "verify", "merge", "Exit codes"] {
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
    let (code, out, error) = lanesweep(Path::new("."), &words(&format!("{CASE} {flags}")));
    assert_eq!(code, 0, "{flags}: {error}");
    (out, unbroken(error.as_bytes()))
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
    let (_, said) = common::program::said(Path::new("."), beside);
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
    let (out, said) = simulated("-q --thw 0.4");
    assert!(said.is_empty() && !out.is_empty(), "{said}");
}

#[cfg(target_os = "linux")]
#[test]
fn an_error_stream_that_takes_nothing_does_not_end_the_work() {
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let run = |args: &str| {
        let mut command = Command::new(PROGRAM);
        command.args(words(args)).stderr(full()).stdout(std::process::Stdio::null()).status().unwrap().code()
    };
    assert_eq!(run(&format!("{CASE} --thw 1")), Some(0));
    assert_eq!(run("mine no-such-folder"), Some(3));
    assert_eq!(run("study --synth-recordings"), Some(2));
}

/// Runs the case in a shell with a limit.
#[cfg(unix)]
fn limited(limit: &str, args: &str) -> Output {
    let script = format!("ulimit {limit}; exec \"$0\" {args}");
    // The environment counts as stack before the program begins, and cargo's is large.
    let mut shell = Command::new("sh");
    shell.env_clear().env("PATH", std::env::var_os("PATH").unwrap_or_default());
    shell.args(["-c", &script, PROGRAM]).output().unwrap()
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
    let mut refused = 0;
    for files in 4..12 {
        let study = format!("study --scenarios {} --backend cpu --out {}", scenarios(), dir.path().display());
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
        let mut command = Command::new(PROGRAM);
        command.args(words(args)).stdout(to).output().unwrap()
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
    let (one, many) = (simulated("--thw 1 --threads 1"), simulated("--thw 1 --threads 4096"));
    assert!(one.0 == many.0 && !one.1.contains("--threads"));
    assert_eq!(many.1.matches("--threads 4096: ").count(), 1, "{}", many.1);
    let dir = tempfile::tempdir().unwrap();
    let fit = "-q fit --synth-recordings 2 --categories cut-in --parameterizations 2";
    ran(dir.path(), &format!("{fit} --config fit.valid_draws=1000 --out d.json"));
    let estimate = |threads: &str| {
        let sample = "-q sample d.json --samples 1000 --models FSM --backend cpu";
        ran(dir.path(), &format!("{sample} --threads {threads} --out {threads}"));
        let mut record = json(&dir.path().join(threads).join("estimate.json"));
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
    let dir = tempfile::tempdir().unwrap();
    let few = "--categories lvd --models FSM,RSS --thw 1.2,0.4 --backend cpu";
    let printed = ran(dir.path(), &format!("-q study --out out {few} {SMALL}"));
    assert!(!printed.contains("Reg157") && !printed.contains("not computed"), "{printed}");
    let mut claims = csv::Reader::from_path(dir.path().join("out/claims.csv")).unwrap();
    let verdict = claims.headers().unwrap().iter().position(|name| name == "verdict").unwrap();
    let verdicts: Vec<String> = claims.records().map(|row| row.unwrap()[verdict].to_owned()).collect();
    assert!(verdicts.len() > 3 && verdicts.iter().all(|v| v == "not computed"), "{verdicts:?}");
    let headways = read(dir.path(), "out/headways.csv");
    assert!(headways.contains(",1.2s,RSS,") && !headways.contains(",2s,") && !headways.contains("CCHDM"), "{headways}");
}

#[test]
fn a_recording_with_speeds_that_no_scenario_holds_is_bad_data_and_no_defect() {
    // The recording is left out as implausible, or, where that is accepted, each scenario as what no file may hold.
    let dir = recordings();
    let table = read(dir.path(), "data/01_tracks.csv");
    let at = table.lines().next().unwrap().split(',').position(|name| name == "xVelocity").unwrap();
    let faster = |(line, text): (usize, &str)| {
        let mut fields: Vec<String> = text.split(',').map(str::to_owned).collect();
        if line > 0 {
            fields[at] = (fields[at].parse::<f64>().unwrap() * 1e6).to_string();
        }
        fields.join(",") + "\n"
    };
    let faster: String = table.lines().enumerate().map(faster).collect();
    std::fs::write(dir.path().join("data/01_tracks.csv"), faster).unwrap();
    let (code, text) = said(dir.path(), "-q mine data --out s.jsonl");
    assert!(code == 4 && text.contains("line 2, column `xVelocity`"), "{code} {text}");
    let (code, text) = said(dir.path(), "-q mine data --out s.jsonl --accept-implausible");
    assert!(code == 4 && text.contains("`ego.v0`") && text.contains("at most 1e6"), "{code} {text}");
}
