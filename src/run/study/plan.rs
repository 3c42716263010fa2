//! Plans a study: mined scenarios and options become cases; sizes are limited before anything is allocated.

use crate::study::cases::{StudyCases, entries_per_step, parameterizations};
use crate::study::external_replays::ExternalReplay;
use crate::study::folds::cross_validated;
use crate::study::plan_file::{BlockHead, StudyHead, stripped};
use lanesweep_engine::plan::{Headway, LanePlan};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::parameterization::{
    ParameterizationOptions, ReducedScenario, Reduction, SvdFit, TimeGrid, steps_of, vehicle_ahead,
};
use lanesweep_model::scenario::{Category, Scenario};
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result};

/// Options of a study.
#[derive(Debug, Clone)]
pub struct StudyOptions {
    /// Categories, in order.
    pub categories: Vec<Category>,
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Headways, in order.
    pub headways: Vec<Headway>,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
    /// Folds of a cross-validation: each decomposition gets a variant whose scenarios are replayed by a basis that has
    /// not seen them.
    pub folds: Option<usize>,
    /// S' of other programs.
    pub external: Vec<ExternalReplay>,
}

impl Default for StudyOptions {
    fn default() -> Self {
        StudyOptions {
            categories: Category::ALL.to_vec(),
            models: ModelId::ALL.to_vec(),
            headways: Headway::paper(),
            parameterization: ParameterizationOptions::default(),
            folds: None,
            external: Vec::new(),
        }
    }
}

/// Maximum number of entries of all series at the paper's time step: this constant, plus an amount for each value in
/// the file. Sufficient for any number of scenarios sampled at 10 Hz or more. Sparse series of long scenarios would
/// otherwise expand a small file to gigabytes.
const MAX_ENTRIES: f64 = (4 << 20) as f64;
const MAX_ENTRIES_PER_VALUE: f64 = 15.0;
const PAPER_DT_S: f64 = 0.04;

/// Plans a study over mined scenarios with all of its cases. The kept ones are simulated, in the order given; a
/// decomposition may be fitted on more (see [`SvdFit`]).
///
/// # Errors
/// As [`outline_study`] and [`StudyCases::window`].
/// As [`outline_study`] and [`StudyCases::window`].
pub fn plan_study(scenarios: &[Scenario], profile: &Profile, options: &StudyOptions) -> Result<LanePlan> {
    let cases = outline_study(scenarios, profile, options)?;
    cases.window(0..cases.outline.unit_count())
}

/// Plans a study as [`plan_study`] does, without making its cases.
///
/// # Errors
/// [`Error::Usage`] for a duplicate category, model, headway or kept scenario, because lane keys must be unique.
pub fn outline_study(scenarios: &[Scenario], profile: &Profile, options: &StudyOptions) -> Result<StudyCases> {
    refuse_repeats(|| Place::option("categories"), options.categories.iter().map(|c| (*c, c.label())))?;
    let kept = scenarios.iter().filter(|scenario| scenario.kept);
    refuse_repeats(|| Place::item("scenarios"), kept.map(|scenario| (&scenario.id, &scenario.id)))?;
    let dt_s = profile.frame.dt_s;
    let parameterization = &options.parameterization;
    let is_observed = Headway::is_observed(&options.headways);
    let grid = TimeGrid::of(profile);
    let (mut entries, mut values) = (0.0, 0.0);
    let mut held = Vec::new();
    let (mut blocks, mut reductions, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    for &category in &options.categories {
        let of_category = || scenarios.iter().filter(move |s| s.category == category);
        let kept: Vec<&Scenario> = of_category().filter(|s| s.kept).collect();
        let fitted: Vec<&Scenario> = match parameterization.svd_fit {
            SvdFit::Kept => kept.clone(),
            SvdFit::All => of_category().filter(|s| category != Category::CutOut || s.lead.is_some()).collect(),
        };
        if kept.is_empty() {
            continue;
        }
        let reduction = match Reduction::fit(category, &fitted, parameterization) {
            Ok(reduction) => Some(reduction),
            Err(error @ Error::Input { .. }) => {
                left_out.push(error);
                None
            }
            Err(error) => return Err(error),
        };
        let (mut fold_of, mut folds) = (Vec::new(), Vec::new());
        if let Some(count) = options.folds.filter(|_| reduction.is_some()) {
            match cross_validated(category, &kept, parameterization, count) {
                Ok(made) => (fold_of, folds) = made,
                Err(error @ Error::Input { .. }) => left_out.push(error),
                Err(error) => return Err(error),
            }
        }
        let replays: Vec<&ExternalReplay> =
            options.external.iter().filter(|replay| replay.category == category).collect();
        let given = |scenario: &Scenario| -> Result<Vec<ReducedScenario>> {
            let of = |replay: &&ExternalReplay| replay.scenarios.get(&scenario.id).cloned();
            let all: Option<Vec<ReducedScenario>> = replays.iter().map(of).collect();
            all.ok_or_else(|| Error::Internal(format!("an S' of scenario {} is missing", scenario.id)))
        };
        let keys = replays.iter().map(|replay| replay.key.clone()).collect();
        let block = BlockHead::new(category, kept.len() as u64, reduction.as_ref(), &folds, keys);
        let ids = parameterizations(category, reduction.is_some());
        let per_step = entries_per_step(category, ids, block.others().count());
        entries += kept.iter().map(|s| steps_of(s.duration_s(), grid) as f64).sum::<f64>() * per_step;
        let recorded = if category == Category::Lvd { 1.0 } else { 2.0 };
        values += kept.iter().map(|s| s.target.v.len() as f64).sum::<f64>() * recorded;
        check_size(entries, values, dt_s)?;
        held.reserve_exact(kept.len());
        for (at, scenario) in kept.iter().enumerate() {
            if category == Category::CutOut {
                vehicle_ahead(scenario)?;
            }
            let gap_m = is_observed.then(|| scenario.start_gap_m()).transpose()?;
            let (replays, fold) = (given(scenario)?, fold_of.get(at).copied());
            held.push(Scenario { replays, fold, ..stripped(scenario, gap_m) });
        }
        blocks.push(block);
        reductions.push(reduction);
    }
    let head = StudyHead::new(profile, options, blocks, &held)?;
    // The report data need more of the decompositions than the file stores.
    Ok(StudyCases { reductions, left_out, ..head.with_scenarios(0, held)? })
}

/// Limits the size of the tables before they are allocated.
fn check_size(entries: f64, values: f64, dt_s: f64) -> Result<()> {
    let size = format!("the scenarios and their parameterizations have {entries:.1e} values at a step of {dt_s} s");
    // The user, not the file, chooses a finer time step.
    if entries > (MAX_ENTRIES + MAX_ENTRIES_PER_VALUE * values) * (PAPER_DT_S / dt_s).max(1.0) {
        let problem = format!("{size}, but only {values:.1e} were recorded");
        let help = "their sample rate is low for so many or so long ones: give more samples, or study fewer at once";
        return Err(Error::input(Place::item("scenarios"), problem, help));
    }
    Ok(())
}
