//! Cases made where lanes run: they mean what the host's cases mean, and every backend makes the same bits of them.

use crate::common;
use crate::common::lane_sets::swept_on_cpu;
use crate::common::mined::{density_of, provenance, scenarios_of};

use lanesweep::engine::{Backend, Instructions, LaneCase, LanePlan, words};
use lanesweep::model::driver::MODELS;
use lanesweep::prelude::*;
use lanesweep::run::sampling::{
    Estimator, SAMPLE_PURPOSE, generator_of, generator_of_points, plan_points, plan_samples,
};
use lanesweep::run::study::plan_study;
use lanesweep::scenario::Tables;
use lanesweep::scenario::parameterization::ParameterizationOptions;
use lanesweep::stats::random::Stream;

fn density(category: Category, key: &str, with_thw: bool) -> DensityModel {
    density_of(12, category, key, with_thw)
}

fn options(samples: u64) -> SampleOptions {
    let headways = SampleHeadways::Each(vec![Headway::ThwS(1.4), Headway::ThwS(0.4)]);
    SampleOptions { seed: 2026, ..SampleOptions::new(Estimator::Crude, samples, headways) }
}

fn outcomes(plan: &LanePlan, backend: &dyn Backend, cuts: &[u64]) -> Vec<[(&'static str, u64); 17]> {
    let mut session = backend.prepare(plan).unwrap();
    let mut all = Vec::new();
    for ends in cuts.windows(2) {
        let chunk = session.run(ends[0]..ends[1], Wanted::Outcomes).unwrap();
        all.extend(chunk.outcomes.iter().map(words));
    }
    all
}

#[test]
fn a_case_made_for_a_lane_is_the_case_that_the_host_makes() {
    for profile in ["paper", "un-r157"].map(|name| Profile::load(name).unwrap()) {
        for id in Parameterization::ALL {
            let density = density(id.category, id.key, false);
            let points: Vec<Vec<f64>> = density.kde.points().to_vec();
            let generator = generator_of_points(&density.space, &points, &density.sizes, &profile).unwrap();
            let mut late = 0;
            for (index, point) in points.iter().enumerate() {
                // The point that lanes see is rounded; the host decodes the same.
                let drawn = generator.draw(index as u64);
                let seen: Vec<f64> = point.iter().map(|&v| f64::from(v as f32)).collect();
                assert_eq!(drawn.is_void(), !density.space.is_valid(&seen), "{id:?} {index}: host and generator");
                if drawn.is_void() {
                    continue;
                }
                let case = density.space.case(&seen, &density.sizes, profile.frame.dt_s).unwrap();
                let (mut tables, mut made_tables) = (Tables::default(), Tables::<f32>::default());
                let host = LaneCase::encode(&case, &profile, &mut tables);
                let made = generator.case(index as u64, &mut made_tables);
                assert!((host.ego_speed - f64::from(made.ego_speed)).abs() < 1e-4, "{id:?} {index}");
                assert!(host.horizon.abs_diff(made.horizon) <= 1, "{id:?} {index}: horizon");
                assert_eq!(host.pair, made.pair);
                for (ours, theirs) in made.others.iter().zip(&host.others).take(1 + host.pair as usize) {
                    assert!((theirs.half_lengths - f64::from(ours.half_lengths)).abs() < 1e-5);
                    assert!((theirs.half_widths - f64::from(ours.half_widths)).abs() < 1e-5);
                    assert!((theirs.gap_offset - f64::from(ours.gap_offset)).abs() < 1e-3);
                    assert_eq!((theirs.judged, theirs.used), (ours.judged, ours.used));
                    for step in 0..400 {
                        let speeds = (theirs.motion.speed(&tables, step), ours.motion.speed(&made_tables, step));
                        assert!((speeds.0 - f64::from(speeds.1)).abs() < 2e-3, "{id:?} {index} {step}: {speeds:?}");
                        let (a, b) = (theirs.motion.lateral(&tables, step), ours.motion.lateral(&made_tables, step));
                        assert!((a.position.abs() - f64::from(b.position).abs()).abs() < 2e-3, "{id:?} {index} {step}");
                        // Where a motion ends, rounding may decide by one step.
                        late += u32::from((a.towards - f64::from(b.towards)).abs() > 0.02);
                    }
                    for model in 0..MODELS {
                        let (a, b) = (theirs.attend_from[model], ours.attend_from[model]);
                        assert!(a.abs_diff(b) <= 1, "{id:?} {index}: attention at {a} and {b}");
                    }
                }
            }
            assert!(f64::from(late) < 0.01 * (points.len() * 400) as f64, "{id:?}: {late} lateral speeds differ");
        }
    }
}

#[test]
fn draws_have_the_mean_and_the_spread_of_their_mixture_and_stay_valid() {
    let density = density(Category::CutIn, "2", false);
    let profile = Profile::load("paper").unwrap();
    let mixture = density.kde.mixture().unwrap();
    let stream = Stream { seed: 7, purpose: SAMPLE_PURPOSE };
    let generator = generator_of(&density.space, &density.kde, &density.sizes, &profile, stream).unwrap();
    let n = 1 << 16;
    let d = mixture.dimensions();
    let (mut sum, mut valid) = (vec![0.0; d], 0.0);
    for index in 0..n {
        let drawn = generator.draw(index);
        if drawn.is_void() {
            continue;
        }
        let point: Vec<f64> = drawn.values[..d].iter().map(|&v| f64::from(v)).collect();
        assert!(density.space.is_valid(&point), "{point:?}");
        valid += 1.0;
        sum.iter_mut().zip(&point).for_each(|(s, v)| *s += v);
    }
    // The same by the mixture's own f64 draws.
    let stream = Stream { seed: 1, purpose: 2 };
    let draws: Vec<Vec<f64>> = (0..n).map(|index| mixture.draw(&stream, index, 0)).collect();
    let kept: Vec<&Vec<f64>> = draws.iter().filter(|p| density.space.is_valid(p)).collect();
    for j in 0..d {
        let mean = kept.iter().map(|p| p[j]).sum::<f64>() / kept.len() as f64;
        let spread = (kept.iter().map(|p| (p[j] - mean) * (p[j] - mean)).sum::<f64>() / kept.len() as f64).sqrt();
        let error = (sum[j] / valid - mean) / (spread / (n as f64).sqrt());
        assert!(error.abs() < 6.0, "parameter {j}: {error} standard errors off");
    }
    assert_eq!(valid, n as f64, "an invalid draw is drawn again");
}

#[test]
fn samples_are_the_same_whatever_the_chunks_threads_and_instructions() {
    let profile = Profile::load("paper").unwrap();
    for id in Parameterization::ALL {
        let n = 300;
        let plan = plan_samples(&density(id.category, id.key, false), &profile, &options(n)).unwrap();
        let whole = outcomes(&plan, &CpuBackend::lane_arithmetic(), &[0, n]);
        assert!(whole == outcomes(&plan, &CpuBackend::scalar(), &[0, 1, 37, n]), "{id:?} scalar, other chunks");
        for instructions in Instructions::available() {
            let backend = CpuBackend::with_instructions(instructions).unwrap();
            assert!(whole == outcomes(&plan, &backend, &[0, n / 2, n]), "{id:?} {instructions}");
        }
        let alone = common::with_threads(1, || outcomes(&plan, &CpuBackend::lane_arithmetic(), &[0, n]));
        assert!(whole == alone, "{id:?}: threads matter");
    }
}

/// A device makes the same lanes as the host, in several calls.
fn assert_alike(what: &str, plan: &LanePlan, device: &dyn Backend) {
    let n = plan.unit_count();
    let ours = outcomes(plan, &CpuBackend::lane_arithmetic(), &[0, n]);
    let theirs = outcomes(plan, device, &[0, 3, n / 2, n]);
    let differing = ours.iter().zip(&theirs).filter(|(a, b)| a != b).count();
    assert_eq!((differing, theirs.len()), (0, ours.len()), "{what}");
}

#[test]
fn a_device_makes_the_same_lanes_of_the_same_samples_and_draws_headways_and_given_points_alike() {
    let Some(device) = common::device::software_backend() else { return };
    // Cases of every parameterization; of a category's first one for every driver, under a profile with other attention.
    let firsts = Category::ALL.map(|of| Parameterization::ALL.into_iter().find(|id| id.category == of).unwrap());
    let paper = Parameterization::ALL.map(|id| ("paper", id, vec![ModelId::Cchdm, ModelId::Fsm]));
    let annex = firsts.map(|id| ("un-r157", id, ModelId::ALL.to_vec()));
    for (name, id, models) in paper.into_iter().chain(annex) {
        let options = SampleOptions { models, ..options(400) };
        let plan = plan_samples(&density(id.category, id.key, false), &Profile::load(name).unwrap(), &options).unwrap();
        assert_alike(&format!("{name} {}", id.key), &plan, &*device);
    }
    let profile = Profile::load("paper").unwrap();
    for (category, key) in
        [(Category::CutIn, "1"), (Category::CutOut, "b"), (Category::CutOut, "f"), (Category::Lvd, "ii")]
    {
        let density = density(category, key, true);
        let options = SampleOptions { headways: SampleHeadways::Sampled, ..options(500) };
        assert_alike(key, &plan_samples(&density, &profile, &options).unwrap(), &*device);
        let points = density.kde.points();
        let given = plan_points(&density, points, &profile, &ModelId::ALL, &SampleHeadways::Sampled).unwrap();
        assert_alike(&format!("{key} given"), &given, &*device);
    }
    // It refuses the draws that the host refuses.
    for (category, key) in [(Category::CutIn, "7"), (Category::CutOut, "e"), (Category::CutOut, "g")] {
        // Left and right in one decomposition: many draws are in the wrong lane.
        let parameterization = ParameterizationOptions::default();
        let fit = FitOptions { parameterization, valid_draws: 1000, ..FitOptions::default() };
        let id = Parameterization::find(category, key).unwrap();
        let density = DensityModel::fit(id, scenarios_of(12), &provenance(), &fit).unwrap().model;
        let plan = plan_samples(&density, &profile, &options(400)).unwrap();
        let generator = plan.generator().unwrap();
        let refused = (0..400).filter(|index| generator.draw(*index).tries > 1).count();
        assert!(refused > 5, "{key}: {refused} refused");
        assert_alike(key, &plan, &*device);
    }
}

#[test]
fn indices_beyond_32_bits_are_samples_of_their_own() {
    let density = density(Category::CutIn, "1", false);
    let profile = Profile::load("paper").unwrap();
    let plan = plan_samples(&density, &profile, &options(1 << 34)).unwrap();
    let (low, high) = (5_u64, (1_u64 << 32) + 5);
    let run = |backend: &dyn Backend, from: u64| {
        let chunk = backend.prepare(&plan).unwrap().run(from..from + 64, Wanted::Outcomes).unwrap();
        chunk.outcomes.iter().map(words).collect::<Vec<_>>()
    };
    let cpu = CpuBackend::lane_arithmetic();
    assert!(run(&cpu, low) != run(&cpu, high));
    // Across the border of the low word, on a device too.
    if let Some(device) = common::device::software_backend() {
        let border = (1 << 32) - 32;
        assert!(run(&cpu, border) == run(&*device, border));
    }
    let key = plan.key(plan.lane_count() - 1).unwrap();
    assert_eq!(plan.parse_key(&plan.key_text(&key)), Some(key));
}

/// Failures of samples, and of the scenarios that they come from, at finer and coarser steps: none vanish.
#[test]
fn failures_of_samples_and_studies_vary_smoothly_with_the_time_step() {
    let failures = |plan: &LanePlan| -> Vec<f64> {
        let mut counts = vec![[0_u64; 3]; plan.models.len()];
        let chunk = swept_on_cpu(plan, Wanted::Verdicts);
        for (lane, verdict) in chunk.verdicts.iter().enumerate() {
            let of_model = &mut counts[lane % plan.models.len()];
            for criterion in Criterion::ALL {
                of_model[criterion.index()] += u64::from(verdict.failed(criterion));
            }
        }
        counts.iter().flatten().map(|&count| count as f64 / chunk.verdicts.len() as f64).collect()
    };
    let densities = [(Category::CutIn, "1"), (Category::CutOut, "a"), (Category::Lvd, "i")]
        .map(|(category, key)| density(category, key, false));
    let shares = |dt_s: f64| -> Vec<Vec<f64>> {
        let profile = Profile::load("paper").unwrap().with_dt(dt_s).unwrap();
        let options = options(4000);
        let sampled = densities.iter().map(|density| failures(&plan_samples(density, &profile, &options).unwrap()));
        let studied = Category::ALL.into_iter().map(|category| {
            let study = StudyOptions { categories: vec![category], ..StudyOptions::default() };
            failures(&plan_study(scenarios_of(12), &profile, &study).unwrap())
        });
        sampled.chain(studied).collect()
    };
    let known = shares(0.1);
    assert!(known.iter().flatten().filter(|share| **share > 0.02).count() > 15, "{known:?}");
    for dt_s in [0.02, 0.04, 0.07] {
        for (at, (ours, known)) in shares(dt_s).iter().zip(&known).enumerate() {
            for (share, known) in ours.iter().zip(known) {
                let what = format!("plan {at}: {share} at {dt_s} s, {known} at 0.1 s");
                assert!((share - known).abs() <= 0.02 + 0.25 * known, "{what}");
                assert!(*share > 0.0 || *known < 0.02, "{what}");
            }
        }
    }
}
