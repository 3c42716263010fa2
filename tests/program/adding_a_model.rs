//! The example of `examples/adding-a-driver-model` is built in a copy of the sources and runs on the CPU and on a device
//! (minutes): `cargo test --release --test commands adding_a_model:: -- --ignored`

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::device::software_device;
use crate::common::program::{Files, files, put, words};

const SOURCES: [&str; 9] =
    ["Cargo.toml", "Cargo.lock", "README.md", "src", "shaders", "configs", "benches", "tests", "python"];

/// The three touches: two new files and, in the third, one new line.
const RUST: &str = "src/model/driver/aeb.rs";
const WGSL: &str = "shaders/aeb.wgsl";
const REGISTRY: &str = "src/model/driver/registry.rs";

/// A copy of the sources with the example's model: two files and a line after the registry's last. Only what differs is
/// written, so that cargo sees from the times of the files that nothing else is to be built again.
fn copy_with_the_example(root: &Path, copy: &Path) {
    let mut tree = Files::new();
    for at in SOURCES.map(str::to_owned) {
        match root.join(&at) {
            folder if folder.is_dir() => {
                tree.extend(files(&folder).into_iter().map(|(name, content)| (format!("{at}/{name}"), content)));
            }
            file => drop(tree.insert(at, fs::read(file).unwrap())),
        }
    }
    let read = |name: &str| fs::read(root.join("examples/adding-a-driver-model").join(name)).unwrap();
    for (at, name) in [(RUST, "aeb.rs"), (WGSL, "aeb.wgsl")] {
        assert!(tree.insert(at.to_owned(), read(name)).is_none(), "{at} is new");
    }
    let line = String::from_utf8(read("registry-line.txt")).unwrap();
    let registry = String::from_utf8(tree[REGISTRY].clone()).unwrap();
    let mut lines: Vec<&str> = registry.lines().collect();
    let last = lines.iter().rposition(|l| l.ends_with("\";")).expect("the registry has models");
    lines.insert(last + 1, line.trim_end());
    tree.insert(REGISTRY.to_owned(), (lines.join("\n") + "\n").into_bytes());
    let present = files(copy);
    present.keys().filter(|at| !tree.contains_key(*at)).for_each(|stale| fs::remove_file(copy.join(stale)).unwrap());
    tree.retain(|at, content| present.get(at) != Some(content));
    put(&tree, copy);
}

/// Builds the program of the copy. Dependencies are those that are built already, because the folder of intermediate
/// files is shared. Cargo knows a package by its path from its own root, which is the same for the copy and for us; only
/// the profile tells the two apart there, and without a difference in it each would be taken for the other. The
/// finished program goes to a folder of its own, so that it does not replace the ordinary one.
fn build(copy: &Path) {
    let build_dir = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(copy).args(["build", "--release", "--offline", "--locked", "--bin", "lanesweep"]);
    // As the dependencies have been built; CI says with which further flags.
    command.arg("--all-features").args(std::env::var_os("CARGO_SELECTION"));
    for package in packages(copy) {
        command.args(["--config", &format!("profile.release.package.{package}.opt-level=1")]);
        command.args(["--config", &format!("profile.release.package.{package}.codegen-units=16")]);
    }
    command.env("CARGO_BUILD_BUILD_DIR", build_dir).env("CARGO_TARGET_DIR", target_dir());
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}\n{}", output.status, said(&output));
}

fn packages(copy: &Path) -> Vec<String> {
    let folders = fs::read_dir(copy.join("src")).unwrap().map(|entry| entry.unwrap());
    let crates = folders.filter(|entry| entry.path().join("Cargo.toml").exists());
    let names = crates.map(|entry| format!("lanesweep-{}", entry.file_name().to_string_lossy()));
    names.chain(["lanesweep".to_owned()]).collect()
}

fn target_dir() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("adding-a-model-target")
}

fn with_the_model(line: &str) -> Output {
    let program = target_dir().join("release").join(format!("lanesweep{}", std::env::consts::EXE_SUFFIX));
    Command::new(program).env("NO_COLOR", "1").args(words(line)).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
#[ignore = "compiles the crate a second time"]
fn a_model_is_one_rust_file_one_wgsl_file_and_one_registry_line() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("adding-a-model");
    copy_with_the_example(root, &copy);

    let start = std::time::Instant::now();
    build(&copy);
    println!("built with the model in {:.0?}", start.elapsed());
    runs_one_case();
    takes_its_constants_from_a_profile();
    stands_in_every_table_of_a_study();
    gives_the_same_words_on_a_device();
}

/// A leader that brakes to a standstill.
const CASE: &str = "simulate --category lvd --ego-speed 12m/s --thw 1.5 --acceleration -6 --models AEB";

fn reaction(output: &Output) -> f64 {
    assert!(output.status.success(), "{}", said(output));
    let text = said(output);
    let after = text.split("reacted: ").nth(1).unwrap_or_else(|| panic!("{text}"));
    after.split(' ').next().unwrap().parse().unwrap_or_else(|_| panic!("{text}"))
}

fn runs_one_case() {
    let output = with_the_model(CASE);
    // By hand: the leader brakes at 6 m/s² from 12 m/s, 18 m ahead; dv = 6t and g = 18 − 3t², and g ≤ 1.5 dv from
    // t = (√(81 + 216) − 9)/6 = 1.37 s on; the next step of 0.04 s is 1.40 s.
    let reacted = reaction(&output);
    assert!((reacted - 1.40).abs() < 0.041, "{}", said(&output));
    let wrong = with_the_model(&CASE.replace("AEB", "AEBS"));
    assert!(!wrong.status.success() && said(&wrong).contains("FSM, AEB"), "{}", said(&wrong));
    let help = said(&with_the_model("simulate --help"));
    assert!(help.contains("FSM, AEB"), "{help}");
}

fn takes_its_constants_from_a_profile() {
    let dir = tempfile::tempdir().unwrap();
    let paper = include_str!("../../configs/profiles/paper.toml");
    let with = |table: &str| {
        let path = dir.path().join("own.toml");
        fs::write(&path, format!("{paper}\n[aeb]\n{table}\n")).unwrap();
        with_the_model(&format!("{CASE} --profile {}", path.display()))
    };
    assert!(reaction(&with("trigger_ttc_s = 3.0")) < 1.2, "an earlier trigger reacts earlier");
    let bad = with("trigger_ttc_s = -1.0");
    assert!(bad.status.code() == Some(2) && said(&bad).contains("aeb.trigger_ttc_s"), "{}", said(&bad));
}

fn stands_in_every_table_of_a_study() {
    let dir = tempfile::tempdir().unwrap();
    let (out, lanes) = (dir.path().join("result"), dir.path().join("lanes.csv"));
    let files = format!("--out {} --rows {}", out.display(), lanes.display());
    let output = with_the_model(&format!("-q study --synth-recordings 1 {files}"));
    assert!(output.status.success(), "{}", said(&output));
    let read = |path: &Path| fs::read_to_string(path).unwrap();
    assert!(read(&out.join("results.csv")).contains(",AEB,"));
    assert!(!read(&out.join("tables/claims.csv")).contains("AEB"), "the paper's claims are about its own models");
    assert!(read(&out.join("figures/radar-lvd.svg")).contains("AEB"), "a spoke per model and criterion");
    assert!(read(&out.join("run.json")).contains("trigger_ttc_s"), "the defaults are on record");
    let rows = read(&lanes);
    let of = |model: &str| rows.lines().filter(|l| l.contains(&format!(",{model},"))).count();
    assert!(of("AEB") > 0 && of("AEB") == of("FSM"), "{} {}", of("AEB"), of("FSM"));
}

fn gives_the_same_words_on_a_device() {
    if software_device().is_none() {
        return;
    }
    let verify =
        "-q verify --device llvmpipe --random-lanes 2000 --config verify.threshold_units=2 --synth-recordings 1";
    let output = with_the_model(verify);
    let text = said(&output);
    assert!(output.status.success(), "{text}");
    assert!(text.contains("every word equals the CPU's"), "{text}");
    let rows = text.lines().filter(|line| line.contains("| AEB ")).count();
    assert_eq!(rows, 9, "three sets of three categories hold it: {text}");
}
