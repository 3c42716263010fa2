//! `lanesweep fit` as its users run it.

use lanesweep::scenario::{Category, Scenario, read_scenarios, write_scenarios};
use lanesweep::stats::density::read_density;

use crate::common;
use crate::common::program::{ran, refused, said};

const SMALL: &str = "--synth-recordings 3 --config generator.duration_s=200";

#[test]
fn recordings_their_scenario_file_and_the_generator_give_the_same_densities() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, &format!("-q tracks --convert data {SMALL}"));
    let wanted = "--parameterizations 2,e,i";
    let printed = ran(dir, &format!("-q fit --out a {wanted} {SMALL}"));
    ran(dir, &format!("-q fit data --out b --threads 1 {wanted}"));
    ran(dir, "-q mine data --out scenarios.jsonl");
    ran(dir, &format!("-q fit --scenarios scenarios.jsonl --out c --threads 3 {wanted}"));
    for word in ["SYNTHETIC DATA", "no number above is a statement about real traffic", "lateral_speed_mps", "P_valid"]
    {
        assert!(printed.contains(word), "{word}: {printed}");
    }
    for name in ["cut-in-2.json", "cut-out-e.json", "lvd-i.json"] {
        let [a, b, c] = ["a", "b", "c"].map(|out| std::fs::read(dir.join(out).join(name)).unwrap());
        assert!(a == b, "{name}: generated against written recordings");
        assert!(b == c, "{name}: recordings against the scenario file");
        let model = read_density(&dir.join("a").join(name)).unwrap();
        assert!(model.provenance.synthetic && model.provenance.data.contains("SYNTHETIC"));
        let exposure = model.exposure.expect("recordings tell what was driven");
        assert!(exposure.per_hour.is_some() && exposure.per_kilometre.is_some());
        assert_eq!(exposure.events, model.provenance.kept);
    }
}

#[test]
fn what_was_driven_comes_with_the_mined_file_from_flags_or_is_unknown() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, &format!("-q tracks --convert data {SMALL}"));
    ran(dir, "-q mine data --out scenarios.jsonl");
    let fit = "fit --scenarios scenarios.jsonl --parameterizations 3 --out out.json";
    let exposure = || read_density(&dir.join("out.json")).unwrap().exposure;
    ran(dir, fit);
    let driven = exposure().unwrap().driven;
    // Three recordings of 200 s with some ten vehicles in view at a time, at some 30 m/s.
    let (hours, kilometres) = (driven.hours.unwrap(), driven.kilometres.unwrap());
    assert!((0.5..20.0).contains(&hours) && (60.0..140.0).contains(&(kilometres / hours)), "{hours} {kilometres}");

    ran(dir, &format!("{fit} --hours 44.5"));
    let typed = exposure().unwrap();
    assert_eq!((typed.driven.hours, typed.driven.kilometres), (Some(44.5), None));
    assert!(typed.per_kilometre.is_none());
    // Two sources that differ are named.
    let says = |factor: f64| {
        said(dir, &format!("{fit} --km {}", kilometres * factor)).1.contains("is used, but the recordings")
    };
    assert!(says(100.0) && says(0.62) && !says(1.0));

    let appended = std::fs::read_to_string(dir.join("scenarios.jsonl")).unwrap() + "\n";
    std::fs::write(dir.join("scenarios.jsonl"), appended).unwrap();
    refused(dir, fit, 3, "belongs to other scenarios");

    std::fs::remove_file(dir.join("scenarios.exposure.json")).unwrap();
    let (code, text) = said(dir, fit);
    assert!(code == 0 && text.contains("give --hours and --km"), "{code} {text}");
    assert!(ran(dir, fit).contains("exposure   unknown"));
    assert!(exposure().is_none());
}

#[test]
fn sets_that_make_no_density_are_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    let scenarios = read_scenarios(&common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    // The filter would leave three.
    let mut lvd: Vec<_> = scenarios.into_iter().filter(|s| s.category == Category::Lvd).collect();
    lvd.iter_mut().for_each(|s| s.kept = true);
    assert!((4..6).contains(&lvd.len()), "{}", lvd.len());
    let fit = |set: &[Scenario], key: &str| {
        write_scenarios(&dir.path().join("set.jsonl"), set).unwrap();
        said(dir.path(), &format!("fit --scenarios set.jsonl --parameterizations {key} --out out"))
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
    for (set, key, hint) in [
        (&dropped[..], "i", "passed the filters"),
        (&lvd[..1], "i", "1 scenario cannot tell a density of 3 parameters"),
        (&lvd[..3], "i", "3 scenarios cannot tell a density of 3 parameters"),
        (&same[..], "i", "`v0_mps`"),
        (&lvd[..3], "v", "too few for a decomposition"),
    ] {
        let (code, text) = fit(set, key);
        assert!(code == 3 && text.contains(hint), "should say `{hint}`: {code} {text}");
        assert!(!dir.path().join("out").exists(), "{hint}: nothing may be written");
    }
    // A category without scenarios is told once, with what there is.
    let (code, text) = fit(&lvd, "a,b,c,i");
    assert_eq!((code, text.matches("there is no such scenario").count()), (4, 1), "{text}");
    assert!(text.contains("cut-out: there is no such scenario") && text.contains("--categories lvd"), "{text}");
    // What can be fitted is, and the exit status says that something is missing.
    let (code, text) = fit(&lvd, "i,v");
    assert!(code == 4 && text.contains("too few for a decomposition"), "{code} {text}");
    assert!(dir.path().join("out/lvd-i.json").exists() && !dir.path().join("out/lvd-v.json").exists());
}
