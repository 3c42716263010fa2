//! Modified and resealed plan files give an error or a usable plan, never a panic. The library's readers have the same
//! test, with more inputs, in `tests/memory/mutated_inputs.rs`.

use std::path::Path;

use serde_json::value::RawValue;

use crate::engine::Headway;
use crate::model::profile::Profile;
use crate::run::parts::seal;
use crate::run::sampling::{Estimator, MapAxes, Sample, SampleHeadways, SampleOptions, plan_file};
use crate::run::study::Study;
use crate::scenario::parameterization::Parameterization;
use crate::scenario::{Category, Scenario};
use crate::stats::density::{DensityModel, FitOptions};
use crate::traffic::DataProvenance;
use crate::traffic::mining::{Collection, MiningOptions, mine_generated};
use crate::traffic::trajectory::generator::GeneratorOptions;
use crate::{Error, Result};

#[path = "../../tests/memory/mutated_inputs/mutate.rs"]
mod mutate;

/// Number of modified files of each kind.
const INPUTS: u64 = 1500;

#[test]
fn a_changed_plan_is_an_error_or_a_plan_and_never_a_panic() {
    let generator = GeneratorOptions { recordings: 2, duration_s: 240.0, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios;
    let profile = Profile::load("paper").unwrap();
    let facts =
        DataProvenance { data: "synthetic".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let options = FitOptions { representativeness: false, valid_draws: 100, ..FitOptions::default() };
    let id = Parameterization::find(Category::CutIn, "2").unwrap();
    let density = DensityModel::fit(id, &scenarios, &facts, &options).unwrap().model;
    let headways = SampleHeadways::Each(vec![Headway::ThwS(0.6)]);
    let map = MapAxes::of(&density, "v_ego_mps", "v_target_mps").unwrap();
    let crude =
        SampleOptions { map: Some(map), worst: 3, ..SampleOptions::new(Estimator::CRUDE, 1000, headways.clone()) };
    let given = Estimator::Given { proposal: Some(density.mixture().unwrap()), defence: 0.1 };
    let weighted = SampleOptions::new(given, 1000, headways);
    for options in [crude, weighted] {
        let sample = Sample::plan(density.clone(), &profile, &options).unwrap();
        let content = content_of(&sample.plan_file().unwrap().0).to_string();
        try_all(plan_file::KIND, &content, &[], &|path| Sample::read(path).map(drop));
    }
    let study = study_of(scenarios, |scenario| scenario.category == Category::Lvd);
    let content = content_of(&study.seal().unwrap().0).to_string();
    try_all(Study::KIND, &content, &lines_of(&study), &|path| Study::read(path, None).map(drop));
}

/// A study of the first six scenarios of a kind.
fn study_of(scenarios: Vec<Scenario>, is_of_kind: impl Fn(&Scenario) -> bool) -> Study {
    let few = scenarios.into_iter().filter(|scenario| scenario.kept && is_of_kind(scenario)).take(6).collect();
    let few = Collection { scenarios: few, ..Collection::default() };
    Study::builder(&few, Profile::load("paper").unwrap()).plan().unwrap()
}

fn lines_of(study: &Study) -> Vec<u8> {
    let mut lines = Vec::new();
    study.cases().write_file(b"", &mut lines).unwrap();
    lines
}

fn content_of(sealed: &[u8]) -> serde_json::Value {
    let mut sealed: serde_json::Value = serde_json::from_slice(sealed).unwrap();
    sealed["content"].take()
}

/// Floats that are critical for a scenario or a case.
const FLOATS: [f64; 11] = [-0.0, 0.0, 5e-324, f64::MIN_POSITIVE, 1e-9, 0.1, -1.0, 1e6, 1e15, f64::MAX, f64::MIN];

#[test]
fn changed_scenarios_under_checksums_that_fit_are_an_error_or_scenarios_with_plausible_cases() {
    let generator = GeneratorOptions { recordings: 2, duration_s: 240.0, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("plan.json");
    for category in Category::ALL {
        let study = study_of(scenarios.clone(), |scenario| scenario.category == category);
        let (lines, mut content) = (lines_of(&study), content_of(&study.seal().unwrap().0));
        let (mut accepted, mut refused) = (0, 0);
        for input in 0..INPUTS {
            let dice = &mut mutate::Dice(input);
            let changed = match input % 4 {
                0 => mutate::mutated(dice, std::slice::from_ref(&lines), std::slice::from_ref(&lines)),
                _ => with_changed_number(dice, &lines),
            };
            let head = study.cases().head().with_changed_lines(&changed).unwrap();
            content["plan"] = serde_json::to_value(head).unwrap();
            std::fs::write(&path, [seal(Study::KIND, &content).unwrap().0, changed].concat()).unwrap();
            let read = Study::read(&path, None);
            match read.and_then(|read| read.cases().window(0..read.plan().unit_count())) {
                Ok(plan) => {
                    let mut numbers = plan.tables().speed.iter().chain(plan.tables().lateral.as_flattened());
                    assert!(numbers.all(|number| number.abs() < 1e9), "input {input} of {category:?}");
                    accepted += 1;
                }
                Err(error) => {
                    assert!(!matches!(error, Error::Internal(_)), "input {input} of {category:?}: {error}");
                    assert!(error.help().is_some_and(|help| !help.is_empty()), "{error}");
                    refused += 1;
                }
            }
        }
        assert!(accepted > INPUTS / 20 && refused > INPUTS / 4, "{accepted} accepted, {refused} refused");
    }
}

/// Modifies a number in one of the lines: a size, a rate, a value of a series, the length of a series.
fn with_changed_number(dice: &mut mutate::Dice, lines: &[u8]) -> Vec<u8> {
    let mut lines: Vec<&[u8]> = lines.split_inclusive(|byte| *byte == b'\n').collect();
    let at = dice.below(lines.len());
    let mut scenario: serde_json::Value = serde_json::from_slice(lines[at]).unwrap();
    let float = serde_json::json!(FLOATS[dice.below(FLOATS.len())]);
    let series = ["v", "y"][dice.below(2)];
    let vehicle = if scenario["lead"].is_null() { "target" } else { ["target", "lead"][dice.below(2)] };
    match dice.below(9) {
        0 => scenario["fps"] = float,
        1 => scenario["ego"][["v0", "length", "width"][dice.below(3)]] = float,
        2 => scenario[vehicle][["length", "width"][dice.below(2)]] = float,
        3 => scenario[["D", "gap0"][dice.below(2)]] = float,
        4 => drop(scenario[vehicle][series].as_array_mut().unwrap().pop()),
        5 => scenario[["kept", "category", "side"][dice.below(3)]] = float,
        _ => {
            let series = scenario[vehicle][series].as_array_mut().unwrap();
            let at = dice.below(series.len());
            series[at] = float;
        }
    }
    let changed = format!("{scenario}\n");
    lines[at] = changed.as_bytes();
    lines.concat()
}

/// Tests the original content and modified contents, each with a matching checksum and followed by the same bytes.
fn try_all(kind: &str, content: &str, rest: &[u8], read: &dyn Fn(&Path) -> Result<()>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("plan.json");
    let read_sealed = |content: &str| {
        let content: Box<RawValue> = serde_json::from_str(content).ok()?;
        std::fs::write(&path, [&seal(kind, &content).unwrap().0, rest].concat()).unwrap();
        Some(read(&path))
    };
    let seeds = [content.as_bytes().to_vec()];
    let (mut accepted, mut refused) = (0, 0);
    for input in 0..INPUTS {
        let changed = mutate::mutated(&mut mutate::Dice(input), &seeds, &seeds);
        match std::str::from_utf8(&changed).ok().and_then(read_sealed) {
            Some(Ok(())) => accepted += 1,
            Some(Err(error)) => {
                assert!(!matches!(error, Error::Internal(_)), "input {input} of {kind}: {error}");
                refused += 1;
            }
            // Not JSON: the seal would be invalid.
            None => {}
        }
    }
    assert!(accepted + refused > INPUTS / 4, "{kind}: {accepted} accepted, {refused} refused");
}
