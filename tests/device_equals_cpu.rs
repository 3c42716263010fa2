//! Every output word of a device equals the CPU's, bit for bit, whatever the cut into jobs. The software
//! Vulkan stands for a device here; `lanesweep verify` asks the same of any other.

mod common;

use common::device::software_device;
use lanesweep::gpu::{GpuBackend, GpuOptions};
use lanesweep::mining::{MiningOptions, mine_generated};
use lanesweep::profile::Profile;
use lanesweep::sweep::{Backend, Chunk, CpuBackend, LanePlan, StudyOptions, Wanted, plan_study};
use lanesweep::trajectory::generator::GeneratorOptions;

fn open(options: GpuOptions) -> Option<GpuBackend> {
    let (adapters, index) = software_device()?;
    Some(GpuBackend::open(&adapters, index, options).unwrap())
}

fn study_plan(profile: &str, recordings: usize) -> LanePlan {
    let generator = GeneratorOptions { recordings, ..GeneratorOptions::default() };
    let collection = mine_generated(&generator, &MiningOptions::default(), || ()).unwrap();
    let profile = Profile::load(profile).unwrap();
    plan_study(&collection.scenarios, &profile, &StudyOptions::default()).unwrap().plan
}

fn run(backend: &dyn Backend, plan: &LanePlan, wanted: Wanted) -> Chunk {
    let chunk = backend.prepare(plan).unwrap().run(0..plan.unit_count(), wanted).unwrap();
    chunk.check(plan).unwrap();
    chunk
}

/// Lanes in which any word differs: outcomes are exact widenings, so their bits are the words' bits.
fn differing(plan: &LanePlan, ours: &Chunk, theirs: &Chunk) -> Vec<String> {
    let word = |o: &lanesweep::sweep::Outcome<f64>| format!("{o:?}");
    let pairs = ours.outcomes.iter().zip(&theirs.outcomes).enumerate();
    pairs
        .filter(|(_, (a, b))| word(a) != word(b))
        .map(|(at, (a, b))| format!("{}: {a:?} {b:?}", plan.key_text(&plan.key(at as u64).unwrap())))
        .collect()
}

#[test]
fn every_word_of_a_small_study_equals_the_cpus() {
    let Some(gpu) = open(GpuOptions::default()) else { return };
    assert!(gpu.is_exact());
    let plan = study_plan("paper", 2);
    let start = std::time::Instant::now();
    let device = run(&gpu, &plan, Wanted::Outcomes);
    println!("device {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let cpu = run(&CpuBackend::lane_arithmetic(), &plan, Wanted::Outcomes);
    println!("cpu {:?} {} lanes", start.elapsed(), plan.lane_count());
    let different = differing(&plan, &device, &cpu);
    assert!(
        different.is_empty(),
        "{} of {}: {:#?}",
        different.len(),
        plan.lane_count(),
        &different[..different.len().min(5)]
    );
    assert!(device.verdicts == cpu.verdicts);
}
