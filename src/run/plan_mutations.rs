//! Plan files that were changed and sealed again: an error or a plan that can be used, never a panic. The readers of
//! the library have the same test, with more inputs, in `tests/memory/mutated_inputs.rs`.

use std::path::Path;

use serde_json::value::RawValue;

use crate::engine::Headway;
use crate::model::profile::Profile;
use crate::run::parts::seal;
use crate::run::sampling::{Estimator, MapAxes, Sample, SampleHeadways, SampleOptions, plan_file};
use crate::run::study::Study;
use crate::scenario::parameterization::Parameterization;
use crate::scenario::{Category, Scenario};
use crate::stats::density::{DataFacts, DensityModel, FitOptions};
use crate::traffic::mining::{Collection, MiningOptions, mine_generated};
use crate::traffic::trajectory::generator::GeneratorOptions;
use crate::{Error, Result};

#[path = "../../tests/memory/mutated_inputs/mutate.rs"]
mod mutate;

/// Changed files of each kind.
const INPUTS: u64 = 1500;

#[test]
fn a_changed_plan_is_an_error_or_a_plan_and_never_a_panic() {
    let generator = GeneratorOptions { recordings: 2, duration_s: 240.0, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || ()).unwrap().scenarios;
    let profile = Profile::load("paper").unwrap();
    let facts = DataFacts { data: "synthetic".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let options = FitOptions { representativeness: false, valid_draws: 100, ..FitOptions::default() };
    let id = Parameterization::find(Category::CutIn, "2").unwrap();
    let density = DensityModel::fit(id, &scenarios, &facts, &options).unwrap().model;
    let headways = SampleHeadways::Each(vec![Headway::ThwS(0.6)]);
    let map = MapAxes::of(&density, "v_ego_mps", "v_target_mps").unwrap();
    let crude =
        SampleOptions { map: Some(map), worst: 3, ..SampleOptions::new(Estimator::CRUDE, 1000, headways.clone()) };
    let given = Estimator::Given { proposals: vec![density.mixture().unwrap()], defence: 0.1 };
    let weighted = SampleOptions::new(given, 1000, headways);
    for options in [crude, weighted] {
        let sample = Sample::plan(density.clone(), &profile, &options).unwrap();
        let content = content_of(&sample.plan_file().unwrap().0).to_string();
        try_all(plan_file::KIND, &content, &[], &|path| Sample::read(path).map(drop));
    }
    let study = study_of(scenarios, |scenario| scenario.category == Category::Lvd);
    let records = study.cases().records().unwrap().to_vec();
    try_all(Study::KIND, &content_of(&study.seal().unwrap().0).to_string(), &records, &|path| {
        Study::read(path, None).map(drop)
    });
}

/// A study of the first six scenarios of a kind.
fn study_of(scenarios: Vec<Scenario>, is_of_kind: impl Fn(&Scenario) -> bool) -> Study {
    let few = scenarios.into_iter().filter(|scenario| scenario.kept && is_of_kind(scenario)).take(6).collect();
    let few = Collection { scenarios: few, ..Collection::default() };
    Study::builder(&few, Profile::load("paper").unwrap()).plan().unwrap()
}

fn content_of(sealed: &[u8]) -> serde_json::Value {
    let mut sealed: serde_json::Value = serde_json::from_slice(sealed).unwrap();
    sealed["content"].take()
}

/// Floats that a scenario or a case stumbles over.
const FLOATS: [f64; 14] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    -0.0,
    0.0,
    5e-324,
    f64::MIN_POSITIVE,
    1e-9,
    0.1,
    -1.0,
    1e6,
    1e15,
    f64::MAX,
    f64::MIN,
];

/// Lengths and counts that a reader stumbles over.
const WORDS: [u32; 10] = [0, 1, 2, 13, 64, 65_536, 0x1000_0000, 0x1fff_ffff, 0x8000_0000, u32::MAX];

#[test]
fn changed_records_under_checksums_that_fit_are_an_error_or_scenarios_with_plausible_cases() {
    let generator = GeneratorOptions { recordings: 2, duration_s: 240.0, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || ()).unwrap().scenarios;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("plan.json");
    for category in Category::ALL {
        let study = study_of(scenarios.clone(), |scenario| scenario.category == category);
        let (records, mut content) = (study.cases().records().unwrap().to_vec(), content_of(&study.seal().unwrap().0));
        let (mut accepted, mut refused) = (0, 0);
        for input in 0..INPUTS {
            let dice = &mut mutate::Dice(input);
            let changed = match input % 4 {
                0 => mutate::mutated(dice, std::slice::from_ref(&records), std::slice::from_ref(&records)),
                _ => with_changed_number(dice, &records),
            };
            let head = study.cases().head().with_changed_records(&changed).unwrap();
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

/// Records with another number in one of them: a length, the count of samples, the flags, a float.
fn with_changed_number(dice: &mut mutate::Dice, records: &[u8]) -> Vec<u8> {
    let word = |at: usize| u32::from_le_bytes(records[at..at + 4].try_into().unwrap()) as usize;
    let mut begins = vec![0];
    while let Some(next) = begins.last().map(|at| at + 4 + word(*at)).filter(|next| *next < records.len()) {
        begins.push(next);
    }
    let mut changed = records.to_vec();
    let begin = begins[dice.below(begins.len())];
    let samples = begin + 8 + word(begin + 4);
    let floats = (begin + 4 + word(begin) - samples - 5) / 8;
    let mut put = |at: usize, bytes: &[u8]| changed[at..at + bytes.len()].copy_from_slice(bytes);
    match dice.below(8) {
        0 => put([begin, begin + 4, samples][dice.below(3)], &WORDS[dice.below(WORDS.len())].to_le_bytes()),
        1 => put(samples + 4, &[dice.below(256) as u8]),
        // The first six are sizes and rates; a series is long.
        kind => {
            let float = if kind < 5 { dice.below(9.min(floats)) } else { dice.below(floats) };
            put(samples + 5 + 8 * float, &FLOATS[dice.below(FLOATS.len())].to_le_bytes());
        }
    }
    changed
}

/// Content as it is and changed, each with a checksum that fits and followed by the same bytes.
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
            // No JSON: the seal itself would be broken.
            None => {}
        }
    }
    assert!(accepted + refused > INPUTS / 4, "{kind}: {accepted} accepted, {refused} refused");
}
