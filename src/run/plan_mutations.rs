//! Plan files that were changed and sealed again: an error or a plan that can be used, never a panic. The readers of
//! the library have the same test, with more inputs, in `tests/memory/mutated_inputs.rs`.

use std::path::Path;

use serde_json::value::RawValue;

use crate::engine::Headway;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::parts::seal;
use crate::run::sampling::crude_plan::{self, CrudeFacts, CrudePlan};
use crate::run::sampling::weighted_plan::{self, WeightedFacts, WeightedPlan};
use crate::run::sampling::{MapAxes, SampleHeadways, SamplePlanOptions, SampleSource};
use crate::run::study::Study;
use crate::scenario::Category;
use crate::scenario::parameterization::Parameterization;
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
    let headway = Headway::ThwS(0.6);
    let plan_options = SamplePlanOptions {
        samples: 1000,
        seed: 1,
        source: SampleSource::Random,
        models: ModelId::ALL.to_vec(),
        headways: SampleHeadways::Each(vec![headway]),
    };
    let map = MapAxes::of(&density, "v_ego_mps", "v_target_mps").unwrap();
    let crude = CrudeFacts { map: Some(map), worst: 3, ..CrudeFacts::new(&plan_options, &profile, &[]) };
    let crude = CrudePlan::new(density.clone(), crude).unwrap().facts;
    let proposal = density.mixture().unwrap();
    let weighted = WeightedFacts {
        density: String::new(),
        proposals: Vec::new(),
        pilot: None,
        pilots: Vec::new(),
        defence: 0.1,
        profile: profile.clone(),
        models: ModelId::ALL.to_vec(),
        headway: Some(headway),
        criterion: Criterion::Collision,
        samples: 1000,
        seed: 1,
        level: 0.95,
    };
    let weighted = WeightedPlan::new(density, vec![proposal], weighted).unwrap().facts;
    let few: Vec<_> = scenarios.into_iter().filter(|s| s.category == Category::Lvd && s.kept).take(2).collect();
    let few = Collection { scenarios: few, ..Collection::default() };
    let study = Study::builder(&few, profile).plan().unwrap();
    let text = |facts: serde_json::Result<String>| facts.unwrap();
    let crude = text(serde_json::to_string(&crude));
    try_all(crude_plan::KIND, &crude, &[], &|path| CrudePlan::read(path).map(drop));
    let weighted = text(serde_json::to_string(&weighted));
    try_all(weighted_plan::KIND, &weighted, &[], &|path| WeightedPlan::read(path).map(drop));
    let records = study.cases().records().unwrap().to_vec();
    let study: serde_json::Value = serde_json::from_slice(&study.seal().unwrap().0).unwrap();
    try_all(Study::KIND, &study["content"].to_string(), &records, &|path| Study::read(path, None).map(drop));
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
