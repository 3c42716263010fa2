//! Scenarios of the generator, and densities over them.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};

use lanesweep::prelude::*;
use lanesweep::scenario::DataProvenance;
use lanesweep::traffic::mining::mine;
use lanesweep::traffic::trajectory::generator::generate_one;
use rayon::prelude::*;

/// The scenarios of the first recordings. Each recording is mined once: its scenarios do not depend on how many are asked for.
pub fn scenarios_of(recordings: usize) -> &'static [Scenario] {
    type Known = (Vec<Vec<Scenario>>, BTreeMap<usize, &'static [Scenario]>);
    static KNOWN: Mutex<Known> = Mutex::new((Vec::new(), BTreeMap::new()));
    let (parts, joined) = &mut *KNOWN.lock().unwrap();
    joined.entry(recordings).or_insert_with(|| {
        let scenarios = |of: &&Recording| mine(of, &MiningOptions::default()).scenarios;
        let more: Vec<_> = self::recordings(recordings).par_iter().skip(parts.len()).map(scenarios).collect();
        parts.extend(more);
        parts[..recordings].concat().leak()
    })
}

pub fn kept(scenarios: &[Scenario], category: Category) -> Vec<&Scenario> {
    scenarios.iter().filter(|s| s.kept && s.category == category).collect()
}

pub fn provenance() -> DataProvenance {
    DataProvenance { data: "synthetic".to_owned(), synthetic: true, scenarios_sha256: String::new(), driven: None }
}

/// The first of the default recordings, made once: each is the same whatever their number.
pub fn recordings(count: usize) -> Vec<&'static Recording> {
    static MADE: Mutex<Vec<&Recording>> = Mutex::new(Vec::new());
    let mut made = MADE.lock().unwrap();
    let generator = GeneratorOptions { recordings: count, ..GeneratorOptions::default() };
    let one = |index| &*Box::leak(Box::new(generate_one(&generator, index).unwrap()));
    let more: Vec<_> = (made.len()..count).into_par_iter().map(one).collect();
    made.extend(more);
    made[..count].to_vec()
}

/// The density of a parameterization over the scenarios of the first recordings, fitted once.
pub fn density_of(recordings: usize, category: Category, key: &str, with_thw: bool) -> DensityModel {
    type Fitted = BTreeMap<(usize, Category, String, bool), Arc<OnceLock<DensityModel>>>;
    static FITTED: Mutex<Fitted> = Mutex::new(BTreeMap::new());
    let cell = FITTED.lock().unwrap().entry((recordings, category, key.to_owned(), with_thw)).or_default().clone();
    cell.get_or_init(|| fitted(scenarios_of(recordings), category, key, with_thw)).clone()
}

/// The density of cut-ins by parameterization 2 that runs of the program sample, as a file.
pub fn write_cut_in_density(path: &Path) {
    write_density(path, &density_of(24, Category::CutIn, "2", false)).unwrap();
}

/// A density over scenarios, with few draws for what is valid.
pub fn fitted(scenarios: &[Scenario], category: Category, key: &str, with_thw: bool) -> DensityModel {
    let options = FitOptions { valid_draws: 1000, with_thw, ..FitOptions::default() };
    let id = Parameterization::find(category, key).unwrap();
    DensityModel::fit(id, scenarios, &provenance(), &options).unwrap().model
}
