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
fn one_bad_recording_among_many_is_reported_the_others_are_used_and_the_exit_status_says_so() {
    let dir = recordings();
    std::fs::write(dir.path().join("data/03_tracks.csv"), "frame,id\n").unwrap();
    let (code, said) = said(dir.path(), "study data --out out");
    assert!(code == 4 && said.contains("03_tracksMeta.csv"), "{code} {said}");
    assert!(dir.path().join("out/results.csv").exists());
    assert!(read(dir.path(), "out/run.json").contains("03_tracksMeta.csv"), "what was left out stands in run.json");
}

/// The longest step in which no vehicle is driven through; other wrong words are in `tests/messages`.
#[test]
fn a_time_step_in_which_a_vehicle_is_driven_through_is_refused() {
    let fast = "simulate --category lvd --ego-speed 50m/s --speed 0 --gap 20 --acceleration 0 --dt";
    for (more, hint) in [
        ("0.3 --models FSM", "at most 0.25 s"),
        ("0.2 --models all", "at most 0.1 s"),
        ("0.085 --models Reg157", "at most 0.07 s"),
    ] {
        refused(Path::new("."), &format!("{fast} {more}"), 2, hint);
    }
}

#[test]
fn help_names_every_verb_and_every_exit_code() {
    let help = done(Path::new("."), &["--help"]);
    for word in ["study", "mine", "tracks", "simulate", "verify", "merge", "Exit codes"] {
        assert!(help.contains(word), "{word}");
    }
    for (exit, meaning) in lanesweep::cli::Exit::ALL {
        assert!(help.contains(meaning), "{exit:?}");
    }
    let chapter = include_str!("../../docs/src/tables.md");
    for code in lanesweep::cli::Exit::ALL.map(|(exit, _)| exit.code()).into_iter().chain([129, 130, 143]) {
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
fn too_many_open_files_are_answered_with_their_limit() {
    let dir = tempfile::tempdir().unwrap();
    let mut refused = 0;
    for files in 4..12 {
        let study = format!("study --scenarios {} --backend cpu --out {}", scenarios(), dir.path().display());
        let output = limited(&format!("-n {files}"), &study);
        let said = stderr(&output);
        // The system's loader needs files too, beside those that are open here.
        assert!([0, 6, 127].contains(&code(&output)), "{files}: {said}");
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
