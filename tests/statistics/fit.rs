//! `lanesweep fit` as its users run it.

use crate::common;

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use lanesweep::scenario::{Category, read_scenarios, write_scenarios};
use lanesweep::stats::density::read_density;

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

const SMALL: [&str; 4] = ["--synth-recordings", "3", "--config", "generator.duration_s=200"];

#[test]
fn recordings_their_scenario_file_and_the_generator_give_the_same_densities() {
    let dir = tempfile::tempdir().unwrap();
    let [data, a, b, c] = ["data", "a", "b", "c"].map(|name| dir.path().join(name));
    let scenarios = dir.path().join("scenarios.jsonl");
    let run = |args: &[&str]| {
        let output = lanesweep(args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    run(&[&["-q", "synth", text(&data)], &SMALL[..]].concat());
    let wanted = ["--parameterizations", "2,e,i"];
    let printed = run(&[&["-q", "fit", "--out", text(&a)], &wanted[..], &SMALL[..]].concat());
    run(&[&["-q", "fit", text(&data), "--out", text(&b), "--threads", "1"], &wanted[..]].concat());
    run(&["-q", "mine", text(&data), "--out", text(&scenarios)]);
    run(&[&["-q", "fit", "--scenarios", text(&scenarios), "--out", text(&c), "--threads", "3"], &wanted[..]].concat());
    for word in ["SYNTHETIC DATA", "no number above is a statement about real traffic", "lateral_speed_mps", "P_valid"]
    {
        assert!(printed.contains(word), "{word}: {printed}");
    }
    for name in ["cut-in-2.json", "cut-out-e.json", "lvd-i.json"] {
        let read = |dir: &Path| std::fs::read(dir.join(name)).unwrap();
        assert!(read(&a) == read(&b), "{name}: generated against written recordings");
        assert!(read(&b) == read(&c), "{name}: recordings against the scenario file");
        let model = read_density(&a.join(name)).unwrap();
        assert!(model.provenance.synthetic && model.provenance.data.contains("SYNTHETIC"));
        let exposure = model.exposure.expect("recordings tell what was driven");
        assert!(exposure.per_hour.is_some() && exposure.per_kilometre.is_some());
        assert_eq!(exposure.events, model.provenance.kept);
    }
}

#[test]
fn what_was_driven_comes_with_the_mined_file_from_flags_or_is_unknown() {
    let dir = tempfile::tempdir().unwrap();
    let [data, out] = ["data", "out.json"].map(|name| dir.path().join(name));
    let scenarios = dir.path().join("scenarios.jsonl");
    assert_eq!(code(&lanesweep(&[&["-q", "synth", text(&data)], &SMALL[..]].concat())), 0);
    assert_eq!(code(&lanesweep(&["-q", "mine", text(&data), "--out", text(&scenarios)])), 0);
    let fit = |more: &[&str]| {
        let args = ["fit", "--scenarios", text(&scenarios), "--parameterizations", "3"];
        lanesweep(&[&args, &["--out", text(&out)][..], more].concat())
    };
    let beside = dir.path().join("scenarios.exposure.json");
    let mined = fit(&[]);
    assert_eq!(code(&mined), 0, "{}", stderr(&mined));
    let driven = read_density(&out).unwrap().exposure.unwrap().driven;
    // Three recordings of 200 s with some ten vehicles in view at a time, at some 30 m/s.
    let (hours, kilometres) = (driven.hours.unwrap(), driven.kilometres.unwrap());
    assert!((0.5..20.0).contains(&hours) && (60.0..140.0).contains(&(kilometres / hours)), "{hours} {kilometres}");

    let typed = fit(&["--hours", "44.5"]);
    assert_eq!(code(&typed), 0, "{}", stderr(&typed));
    let exposure = read_density(&out).unwrap().exposure.unwrap();
    assert_eq!((exposure.driven.hours, exposure.driven.kilometres), (Some(44.5), None));
    assert!(exposure.per_kilometre.is_none());

    let appended = std::fs::read_to_string(&scenarios).unwrap() + "\n";
    std::fs::write(&scenarios, appended).unwrap();
    let other = fit(&[]);
    assert_eq!(code(&other), 3, "{}", stderr(&other));
    assert!(stderr(&other).contains("belongs to other scenarios"), "{}", stderr(&other));

    std::fs::remove_file(&beside).unwrap();
    let unknown = fit(&[]);
    assert_eq!(code(&unknown), 0, "{}", stderr(&unknown));
    assert!(stderr(&unknown).contains("give --hours and --km"), "{}", stderr(&unknown));
    assert!(String::from_utf8_lossy(&unknown.stdout).contains("exposure   unknown"));
    assert!(read_density(&out).unwrap().exposure.is_none());
}

#[test]
fn sets_that_make_no_density_are_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    let scenarios = read_scenarios(&common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    // The filter would leave three.
    let mut lvd: Vec<_> = scenarios.into_iter().filter(|s| s.category == Category::Lvd).collect();
    lvd.iter_mut().for_each(|s| s.kept = true);
    assert!((4..6).contains(&lvd.len()), "{}", lvd.len());
    let out = dir.path().join("out");
    let fit = |name: &str, set: &[lanesweep::scenario::Scenario], key: &str| {
        let path = dir.path().join(name);
        write_scenarios(&path, set).unwrap();
        lanesweep(&["fit", "--scenarios", text(&path), "--parameterizations", key, "--out", text(&out)])
    };
    let mut dropped = lvd.clone();
    dropped.iter_mut().for_each(|s| s.kept = false);
    let mut same = lvd.clone();
    for (k, scenario) in same.iter_mut().enumerate() {
        let first = lvd[0].target.v[0];
        scenario.target.v[0] = first;
        let last = scenario.target.v.len() - 1;
        scenario.target.v[last] = 1.0 + 0.1 * k as f64;
    }
    for (name, set, key, hint) in [
        ("none", &dropped[..], "i", "passed the filters"),
        ("one", &lvd[..1], "i", "1 scenario cannot tell a density of 3 parameters"),
        ("few", &lvd[..3], "i", "3 scenarios cannot tell a density of 3 parameters"),
        ("same", &same[..], "i", "`v0_mps`"),
        ("svd", &lvd[..3], "v", "too few for a decomposition"),
    ] {
        let output = fit(name, set, key);
        assert_eq!(code(&output), 3, "{name}: {}", stderr(&output));
        assert!(stderr(&output).contains(hint), "{name} should say `{hint}`: {}", stderr(&output));
        assert!(output.stdout.is_empty() && !out.exists(), "{name}: nothing may be written");
    }
    // A category without scenarios is told once, with what there is.
    let empty = fit("empty", &lvd, "a,b,c,i");
    let said = stderr(&empty);
    assert_eq!((code(&empty), said.matches("there is no such scenario").count()), (4, 1), "{said}");
    assert!(said.contains("cut-out: there is no such scenario") && said.contains("--categories lvd"), "{said}");
    // What can be fitted is, and the exit status says that something is missing.
    let some = fit("some", &lvd, "i,v");
    assert_eq!(code(&some), 4, "{}", stderr(&some));
    assert!(stderr(&some).contains("too few for a decomposition"), "{}", stderr(&some));
    assert!(out.join("lvd-i.json").exists() && !out.join("lvd-v.json").exists());
}

#[test]
fn wrong_words_are_answered_with_what_to_write_instead() {
    let dir = tempfile::tempdir().unwrap();
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let file = dir.path().join("one.json");
    let cases: [(&[&str], i32, &str); 11] = [
        (&["fit", "--config", "fit.valid_draws=0"], 2, "expected a whole number from 1 to 1000000000"),
        (&["fit", "--config", "fit.valid_draws=1000000001"], 2, "expected a whole number from 1 to 1000000000"),
        (&["fit", "--parameterizations", "9"], 2, "there is no parameterization `9`"),
        (&["fit", "--parameterizations", "9"], 2, "LVD: i ii iii iv v"),
        (&["fit", "--categories", "cut-in", "--parameterizations", "ii"], 2, "of cut-in"),
        (&["fit", "--categories", "cutin"], 2, "use cut-in, cut-out, lvd"),
        (&["fit", "--config", "fit.bandwidth_rule=best"], 2, "reduction"),
        (&["fit", "--hours", "-1"], 2, "--hours"),
        (&["fit", "--km", "nan"], 2, "--km"),
        (&["fit", "--out", text(&file)], 2, "is one file, but 19 densities"),
        (&["fit", "--scenarios", "no-such-file.jsonl"], 6, "no-such-file.jsonl"),
    ];
    for (args, expected, hint) in cases {
        let output = lanesweep(args);
        let said = stderr(&output);
        assert_eq!(code(&output), expected, "{args:?}: {said}");
        let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(said.contains(hint), "{args:?} should say `{hint}`: {said}");
        assert!(!said.contains("panicked"), "{args:?}: {said}");
    }
    let input = dir.path().join("input.json");
    std::fs::copy(&scenarios, &input).unwrap();
    let over = lanesweep(&["fit", "--scenarios", text(&input), "--parameterizations", "i", "--out", text(&input)]);
    assert_eq!(code(&over), 2, "{}", stderr(&over));
    assert!(stderr(&over).contains("would be overwritten"), "{}", stderr(&over));
    let help = String::from_utf8(lanesweep(&["fit", "--help"]).stdout).unwrap();
    assert!(help.starts_with("How are the parameters of scenarios distributed?"), "{help}");
    assert!(help.contains("lanesweep fit recordings --out densities"), "{help}");
}
