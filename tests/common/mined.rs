//! Scenarios of the generator, and densities over them.

use std::sync::OnceLock;

use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::scenario::{Category, DataProvenance, Scenario};
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

/// What is mined from the first recordings of the generator.
pub fn mined(recordings: usize) -> Collection {
    let generator = GeneratorOptions { recordings, ..GeneratorOptions::default() };
    mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap()
}

/// The scenarios of the default study.
pub fn scenarios() -> &'static [Scenario] {
    static MINED: OnceLock<Vec<Scenario>> = OnceLock::new();
    MINED.get_or_init(|| mined(24).scenarios)
}

/// Where they come from.
pub fn provenance() -> DataProvenance {
    DataProvenance { data: "synthetic".to_owned(), synthetic: true, scenarios_sha256: String::new(), driven: None }
}

/// A density over scenarios, with few draws for what is valid.
pub fn fitted(scenarios: &[Scenario], category: Category, key: &str, with_thw: bool) -> DensityModel {
    let options = FitOptions { valid_draws: 1000, with_thw, ..FitOptions::default() };
    let id = Parameterization::find(category, key).unwrap();
    DensityModel::fit(id, scenarios, &provenance(), &options).unwrap().model
}
