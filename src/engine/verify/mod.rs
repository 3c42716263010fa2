//! Verification: lanes for which a backend must give the same words as the CPU, and the comparison.
//!
//! This module compares a backend with the CPU and the f64 reference ([`compare`]). It makes a random set of cases with
//! plausible numbers ([`random_plan`]), and a set on the decision thresholds ([`threshold_plan`]), where one unit in
//! the last place decides. Cases are pure functions of (seed, category, unit, variant), so the key of a lane suffices
//! to repeat it: each (purpose, seed, category, unit, variant) has its own stream of random numbers. Plans go to
//! [`crate`].

mod decision;
mod first_step;
mod pool;
mod random;
mod series;
mod thresholds;

pub use decision::Threshold;
pub use random::{VARIANTS, random_plan};
pub use thresholds::{SIDES, threshold_plan};

use std::ops::Range;

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

use crate::{Backend, Chunk, CpuBackend, LanePlan, Outcome, Session, Wanted, chunks, words};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result};

/// Options of a set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SetOptions {
    /// Seed; it determines all lanes.
    pub seed: u64,
    /// Random set: lanes of each model in each category, rounded up to whole units of 40. Threshold set: units of each
    /// threshold in each category; a unit is 12 lanes of each model.
    pub size: u64,
    /// Categories, in order, each at most once.
    pub categories: Vec<Category>,
    /// Models, in order.
    pub models: Vec<ModelId>,
}

impl Default for SetOptions {
    fn default() -> Self {
        SetOptions { seed: 157, size: 40, categories: Category::ALL.to_vec(), models: ModelId::ALL.to_vec() }
    }
}

impl SetOptions {
    /// Refuses a set without lanes, and a category named twice, because lane keys would be ambiguous.
    fn check(&self) -> Result<()> {
        let place = || Place::item("categories");
        if self.categories.is_empty() || self.size == 0 {
            return Err(Error::usage(place(), "the set has no lanes", "give a size, and one of cut_in, cut_out, lvd"));
        }
        refuse_repeats(place, self.categories.iter().map(|category| (*category, category.label())))
    }
}

/// Purpose of a stream; streams of different purposes never share a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    /// The series that the cases share.
    Pool = 1,
    /// Random cases.
    Random = 2,
    /// Cut-outs whose cutting-out vehicle hits the one ahead.
    Freeze = 3,
    /// Cases on thresholds.
    Threshold = 4,
    /// The series that cases on thresholds share.
    ThresholdPool = 5,
}

/// A stream of random numbers.
struct CaseRandom(ChaCha8Rng);

impl CaseRandom {
    /// The stream of one purpose, seed, category, unit and variant.
    fn new(purpose: Purpose, seed: u64, category: Category, unit: u64, variant: usize) -> CaseRandom {
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&unit.to_le_bytes());
        key[16..20].copy_from_slice(&(variant as u32).to_le_bytes());
        key[20] = category as u8;
        key[21] = purpose as u8;
        CaseRandom(ChaCha8Rng::from_seed(key))
    }

    /// Uniform in [0, 1), 53 bits.
    fn uniform(&mut self) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.0.next_u64() >> 11) as f64 * STEP
    }

    /// Uniform in [low, high).
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// True with this probability.
    fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// An index below `count`; 0 if `count` is 0.
    fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.0.next_u64()) * count as u128) >> 64) as usize
    }

    /// 1 or −1: left or right.
    fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }
}

/// Differing lanes that a comparison keeps.
const MAX_EXAMPLES: usize = 10;

/// Results of the lanes of one category and model.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupComparison {
    /// Kind of scenario.
    pub category: Category,
    /// The ego's driver.
    pub model: ModelId,
    /// Lanes that the backend under test computed itself.
    pub lanes: u64,
    /// Failures among these on the CPU, in the order of [`Criterion::ALL`].
    pub failed: [u64; Criterion::ALL.len()],
    /// Evaluated steps of all lanes.
    pub steps: u64,
    /// Lanes with a word that differs from the CPU's.
    pub lanes_differing: u64,
    /// Words that differ.
    pub words_differing: u64,
    /// Verdict bits (criteria and cap) that differ.
    pub verdicts_differing: u64,
    /// Verdicts in which the CPU differs from the f64 reference: rounding, no error.
    pub reference_differing: u64,
}

impl GroupComparison {
    /// Fraction of the lanes that fail a criterion.
    pub fn share(&self, criterion: Criterion) -> f64 {
        self.failed[criterion.index()] as f64 / self.lanes.max(1) as f64
    }

    /// Whether a criterion fails neither nearly always nor nearly never; otherwise the test is weak.
    pub fn tests(&self, criterion: Criterion) -> bool {
        (0.05..=0.95).contains(&self.share(criterion))
    }
}

/// A lane whose words differ.
#[derive(Debug, Clone, PartialEq)]
pub struct DifferingLane {
    /// Key in its set.
    pub key: String,
    /// On the backend under test.
    pub tested: Outcome<f64>,
    /// On the CPU.
    pub cpu: Outcome<f64>,
}

impl DifferingLane {
    /// Names of the words that differ.
    pub fn names(&self) -> Vec<&'static str> {
        let (a, b) = (words(&self.tested), words(&self.cpu));
        a.into_iter().zip(b).filter(|(a, b)| a != b).map(|((name, _), _)| name).collect()
    }

    /// Sort key: differences in verdicts first, then in steps, then the number of words.
    fn severity(&self) -> (bool, bool, usize) {
        let (a, b) = (words(&self.tested), words(&self.cpu));
        (a[0] != b[0], a[4..7] != b[4..7], self.names().len())
    }
}

/// Results of a set of lanes.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Name of the set.
    pub set: String,
    /// Hash of its plan.
    pub plan_sha256: String,
    /// Results per category and model.
    pub tallies: Vec<GroupComparison>,
    /// The worst lanes that differ, worst first.
    pub worst: Vec<DifferingLane>,
    /// Verdicts or counts that differ if only these are requested.
    pub modes_differing: u64,
}

impl Comparison {
    /// Whether every word of every lane is equal, and there is at least one lane.
    pub fn is_equal(&self) -> bool {
        self.modes_differing == 0 && self.lanes() > 0 && self.tallies.iter().all(|t| t.words_differing == 0)
    }

    /// Lanes with a word that differs, and values that differ if only verdicts or counts are requested.
    pub fn differing(&self) -> u64 {
        self.modes_differing + self.tallies.iter().map(|t| t.lanes_differing).sum::<u64>()
    }

    /// Lanes that the backend under test computed itself.
    pub fn lanes(&self) -> u64 {
        self.tallies.iter().map(|t| t.lanes).sum()
    }
}

/// Runs every lane of a plan on the three backends. `done` gets the number of lanes of each finished part.
///
/// The backend under test runs twice, for outcomes and for verdicts; both must agree. It has no fallback: a
/// lane that it cannot compute is an error.
///
/// # Errors
/// Those of the backend under test.
pub fn compare(set: &str, plan: &LanePlan, tested: &dyn Backend, done: impl Fn(u64)) -> Result<Comparison> {
    let (cpu, reference) = (CpuBackend::scalar(), CpuBackend::reference());
    let mut sessions = [tested.prepare(plan)?, cpu.prepare(plan)?, reference.prepare(plan)?];
    let mut comparison = Comparison {
        set: set.to_owned(),
        plan_sha256: plan.hash().to_owned(),
        tallies: tallies(plan),
        worst: Vec::new(),
        modes_differing: 0,
    };
    for units in chunks(plan, 0..plan.unit_count()) {
        let [tested, cpu, reference] = &mut sessions;
        let device = tested.run(units.clone(), Wanted::Outcomes)?;
        device.check(plan)?;
        let cpu = cpu.run(units.clone(), Wanted::Outcomes)?;
        let reference = reference.run(units.clone(), Wanted::Verdicts)?;
        comparison.modes_differing += modes(plan, tested.as_mut(), units, &device)?;
        add(&mut comparison, plan, [&device, &cpu, &reference]);
        done(device.lanes());
    }
    Ok(comparison)
}

/// Result of the self-check of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SelfCheck {
    /// Lanes compared.
    pub lanes: u64,
    /// Lanes with a word that differs.
    pub differing: u64,
}

/// The self-check: some thousand random lanes and lanes on thresholds, compared with the CPU.
///
/// # Errors
/// Those of the backend.
pub fn self_check(tested: &dyn Backend) -> Result<SelfCheck> {
    let profile = lanesweep_model::profile::Profile::load("paper")?;
    let random = SetOptions { size: 400, ..Default::default() };
    let thresholds = SetOptions { size: 2, ..Default::default() };
    let plans = [random_plan(&profile, &random)?, threshold_plan(&profile, &thresholds)?];
    let mut check = SelfCheck { lanes: 0, differing: 0 };
    for plan in &plans {
        let comparison = compare("self-check", plan, tested, |_| ())?;
        check.lanes += comparison.lanes();
        check.differing += comparison.differing();
    }
    Ok(check)
}

/// One empty tally per category and model.
fn tallies(plan: &LanePlan) -> Vec<GroupComparison> {
    let models = |category| {
        plan.models.iter().map(move |&model| GroupComparison {
            category,
            model,
            lanes: 0,
            failed: [0; Criterion::ALL.len()],
            steps: 0,
            lanes_differing: 0,
            words_differing: 0,
            verdicts_differing: 0,
            reference_differing: 0,
        })
    };
    plan.blocks.iter().flat_map(|block| models(block.category)).collect()
}

/// Lanes whose verdicts differ if the backend returns only verdicts instead of outcomes.
fn modes(plan: &LanePlan, tested: &mut dyn Session, units: Range<u64>, outcomes: &Chunk) -> Result<u64> {
    let verdicts = tested.run(units, Wanted::Verdicts)?;
    verdicts.check(plan)?;
    Ok(outcomes.outcomes.iter().zip(&verdicts.verdicts).filter(|(o, v)| o.verdicts != **v).count() as u64)
}

/// Adds a chunk of the three backends.
fn add(comparison: &mut Comparison, plan: &LanePlan, [tested, cpu, reference]: [&Chunk; 3]) {
    let models = plan.models.len();
    for (at, (a, b)) in tested.outcomes.iter().zip(&cpu.outcomes).enumerate() {
        let Some(key) = plan.key(tested.first_lane + at as u64) else { continue };
        let tally = &mut comparison.tallies[key.block * models + key.model];
        tally.lanes += 1;
        tally.steps += u64::from(b.end_step) + 1;
        for criterion in Criterion::ALL {
            let failed = b.verdicts.failed(criterion);
            tally.failed[criterion.index()] += u64::from(failed);
            tally.reference_differing += u64::from(failed != reference.verdicts[at].failed(criterion));
        }
        let differing = words(a).iter().zip(words(b)).filter(|(a, b)| **a != *b).count() as u64;
        tally.words_differing += differing;
        tally.lanes_differing += u64::from(differing > 0);
        tally.verdicts_differing += u64::from((a.verdicts.0 ^ b.verdicts.0).count_ones());
    }
    let keyed = |at: usize| plan.key(tested.first_lane + at as u64).map(|k| plan.key_text(&k)).unwrap_or_default();
    let differing: Vec<DifferingLane> = tested
        .outcomes
        .par_iter()
        .zip(&cpu.outcomes)
        .enumerate()
        .filter(|(_, (a, b))| words(a) != words(b))
        .map(|(at, (a, b))| DifferingLane { key: keyed(at), tested: *a, cpu: *b })
        .collect();
    comparison.worst.extend(differing);
    // Stable: among equally bad ones the first in the plan's order stays.
    comparison.worst.sort_by_key(|lane| std::cmp::Reverse(lane.severity()));
    comparison.worst.truncate(MAX_EXAMPLES);
}
