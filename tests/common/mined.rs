//! Scenarios of the generator, and densities over them.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock, Mutex, OnceLock};

use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, DataProvenance, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::Recording;
use lanesweep::traffic::trajectory::generator::{GeneratorOptions, generate};

pub fn mined(recordings: usize) -> Collection {
    let generator = GeneratorOptions { recordings, ..GeneratorOptions::default() };
    mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap()
}

pub fn scenarios_of(recordings: usize) -> &'static [Scenario] {
    static MINED: Mutex<BTreeMap<usize, &'static [Scenario]>> = Mutex::new(BTreeMap::new());
    MINED.lock().unwrap().entry(recordings).or_insert_with(|| mined(recordings).scenarios.leak())
}

/// Those of the default study.
pub fn scenarios() -> &'static [Scenario] {
    scenarios_of(24)
}

pub fn kept(scenarios: &[Scenario], category: Category) -> Vec<&Scenario> {
    scenarios.iter().filter(|s| s.kept && s.category == category).collect()
}

pub fn provenance() -> DataProvenance {
    DataProvenance { data: "synthetic".to_owned(), synthetic: true, scenarios_sha256: String::new(), driven: None }
}

/// The first of the default recordings, made once: each is the same whatever their number.
pub fn recordings(count: usize) -> &'static [Recording] {
    static MADE: LazyLock<Vec<Recording>> =
        LazyLock::new(|| generate(&GeneratorOptions { recordings: 28, ..GeneratorOptions::default() }).unwrap());
    &MADE[..count]
}

/// The density of a parameterization over the scenarios of the first recordings, fitted once.
pub fn density_of(recordings: usize, category: Category, key: &str, with_thw: bool) -> DensityModel {
    type Fitted = BTreeMap<(usize, Category, String, bool), Arc<OnceLock<DensityModel>>>;
    static FITTED: Mutex<Fitted> = Mutex::new(BTreeMap::new());
    let cell = FITTED.lock().unwrap().entry((recordings, category, key.to_owned(), with_thw)).or_default().clone();
    cell.get_or_init(|| fitted(scenarios_of(recordings), category, key, with_thw)).clone()
}

/// A density over scenarios, with few draws for what is valid.
pub fn fitted(scenarios: &[Scenario], category: Category, key: &str, with_thw: bool) -> DensityModel {
    let options = FitOptions { valid_draws: 1000, with_thw, ..FitOptions::default() };
    let id = Parameterization::find(category, key).unwrap();
    DensityModel::fit(id, scenarios, &provenance(), &options).unwrap().model
}
