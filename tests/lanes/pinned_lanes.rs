//! The bits of lanes of every kind, pinned to the engine's version.

use sha2::{Digest, Sha256};

use crate::common::lane_sets::{run_lane, swept};

use lanesweep::engine::verify::{SetOptions, random_plan, threshold_plan};
use lanesweep::engine::{Backend, Constants, ENGINE_VERSION, LanePlan, Start, words};
use lanesweep::prelude::*;
use lanesweep::run::sampling::{SAMPLE_PURPOSE, generator_of};
use lanesweep::run::study::plan_of_parts;
use lanesweep::scenario::Tables;
use lanesweep::scenario::parameterization::{ParameterizationOptions, Reduction, Sizes, SvdBasis};
use lanesweep::stats::density::{Bandwidth, BandwidthRule, Kde, ParameterSpace, SearchEnd};
use lanesweep::stats::random::Stream;
use lanesweep::support::plain_text::hex;

/// A version, and the SHA-256 of a small set of lanes computed with it: of the words up to [`MEASURES`], and of the
/// others, which were added later. A test uses them to detect that [`ENGINE_VERSION`] must be raised.
const PINNED_LANES: (u64, [&str; 2]) = (
    5,
    [
        "ae79c7af5a69e011905c4608879c7f680e4c677911a7aaa5d16fc57ca0d71a27",
        "4cd193f50fceaeeb8a338b68fe1291ff6da445fad118e9c1f918fdba1c804be0",
    ],
);

/// The first word of a lane without influence on verdicts and estimates.
const MEASURES: usize = 12;

fn add(digests: &mut [Sha256; 2], outcome: &Outcome<f64>) {
    for (at, word) in words(outcome).into_iter().enumerate() {
        digests[usize::from(at >= MEASURES)].update(word.1.to_le_bytes());
    }
}

/// Formulas instead of recordings and fits, so that the bits are the same on every machine.
fn scenario(category: Category, number: u32) -> Scenario {
    let k = f64::from(number);
    let series = |of: &dyn Fn(f64) -> f64| (0..61).map(|i| of(f64::from(i))).collect::<Vec<f64>>();
    let speed = series(&|i| 22.0 + k - 0.0625 * i * (k + 1.0));
    let across = match category {
        Category::CutIn => series(&|i| 3.5 - 3.5 * (i / 60.0) * (2.0 - i / 60.0)),
        _ => series(&|i| 3.25 * (i / 60.0) * (i / 60.0)),
    };
    let vehicle = serde_json::json!({"length": 4.5 + k / 8.0, "width": 1.875, "v": speed, "y": across});
    let lead = serde_json::json!({
        "length": 5.0, "width": 2.0, "v": series(&|i| 9.0 + 0.03125 * i), "y": series(&|_| 0.0),
    });
    let is_cut_out = category == Category::CutOut;
    let text = serde_json::json!({
        "id": format!("{}_{number}", category.key()), "category": category, "fps": 25.0,
        "ego": {"v0": 27.0 + k, "length": 4.25, "width": 1.75}, "side": if number == 0 { "left" } else { "right" },
        "target": vehicle, "lead": is_cut_out.then_some(lead), "D": is_cut_out.then_some(20.0 + 4.0 * k),
    });
    serde_json::from_value(text).unwrap()
}

/// The models of every version; a new model changes no lane of these.
fn models() -> Vec<ModelId> {
    ["Reg157", "CCHDM", "RSS", "FSM"].map(|name| ModelId::parse(name).unwrap()).to_vec()
}

fn reduction(category: Category, options: &ParameterizationOptions) -> Reduction {
    let (series, extras): (&[f64], &[f64]) = match category {
        Category::CutIn => (&[1.5, 21.0], &[28.0, 2.5]),
        Category::CutOut => (&[1.0, 21.0, 10.0], &[28.0, 22.0, 2.5]),
        Category::Lvd => (&[21.0], &[2.5]),
    };
    let spread = |value: &f64| std::iter::repeat_n(*value, options.svd_instants);
    let mean: Vec<f64> = series.iter().flat_map(spread).chain(extras.iter().copied()).collect();
    let direction = |j: usize| (0..mean.len()).map(|c| ((c * 7 + j * 13) % 11) as f64 / 256.0 - 0.02).collect();
    let directions = (0..7).map(direction).collect();
    let weights = vec![0.5; mean.len()];
    let mean = mean.iter().map(|value| value * 0.5).collect();
    let basis = SvdBasis { weights, mean, singular_values: Vec::new(), directions, rows: 8 };
    Reduction::from_parts(category, basis, options).unwrap()
}

/// Two scenarios of every category with every parameterization.
fn study(profile: &Profile) -> LanePlan {
    let options = ParameterizationOptions::default();
    let held: Vec<Scenario> = Category::ALL.iter().flat_map(|of| (0..2).map(|number| scenario(*of, number))).collect();
    let reductions = Category::ALL.map(|of| (of, reduction(of, &options)));
    let headways = vec![Headway::ThwS(1.2), Headway::ThwS(0.4), Headway::GapM(9.0)];
    let options = StudyOptions { models: models(), headways, parameterization: options, ..StudyOptions::default() };
    plan_of_parts(profile, &options, &reductions, &held).unwrap()
}

fn lanes(digests: &mut [Sha256; 2], plan: &LanePlan) -> usize {
    let (narrow, wide) = (CpuBackend::scalar(), CpuBackend::reference());
    let backends: [&dyn Backend; 2] = [&narrow, &wide];
    for backend in backends {
        swept(plan, backend, Wanted::Outcomes).outcomes.iter().for_each(|outcome| add(digests, outcome));
    }
    plan.lane_count() as usize
}

/// Points of generators of every category, and the lanes of their cases.
fn samples(digests: &mut [Sha256; 2], profile: &Profile) {
    let options = ParameterizationOptions::default();
    for (category, key) in
        [(Category::CutIn, "2"), (Category::CutOut, "a"), (Category::Lvd, "ii"), (Category::CutIn, "6")]
    {
        let id = Parameterization::find(category, key).unwrap();
        let reduction = id.coefficients().is_some().then(|| reduction(category, &options));
        let space = ParameterSpace::new(id, &options, reduction.as_ref(), false).unwrap();
        let d = space.dimensions();
        let mean = |k: usize| (0..d).map(|at| 1.0 + ((at * 5 + k * 3) % 7) as f64).collect::<Vec<f64>>();
        let bandwidth = Bandwidth {
            value: 1.0,
            rule: BandwidthRule::Reduction,
            silverman: 1.0,
            end: SearchEnd::Inside,
            likelihood: None,
        };
        let kde = Kde::from_parts((0..3).map(mean).collect(), vec![0.75; d], bandwidth).unwrap();
        let sizes = Sizes::of(&scenario(Category::CutOut, 0));
        let stream = Stream { seed: 157, purpose: SAMPLE_PURPOSE };
        let generator = generator_of(&space, &kde, &sizes, profile, stream).unwrap();
        let constants = Constants::<f32>::resolve(profile, category);
        for index in 0..64 {
            let drawn = generator.draw(index);
            digests[0].update(drawn.tries.to_le_bytes());
            drawn.values.iter().for_each(|value| digests[0].update(value.to_bits().to_le_bytes()));
            let mut tables = Tables::default();
            let case = generator.case(index, &mut tables);
            for model in models() {
                let outcome = run_lane(&constants, model, (&case, &tables), Start::Headway(0.8), &mut |_| ());
                add(digests, &outcome.widen());
            }
        }
    }
}

#[test]
fn the_bits_of_lanes_are_those_of_the_engine_version() {
    let mut digests = [Sha256::new(), Sha256::new()];
    let mut count = 0;
    for name in Profile::names() {
        for dt_s in [0.04, 0.1] {
            let profile = Profile::load(name).unwrap().with_dt(dt_s).unwrap();
            let of = |size| SetOptions { size, models: models(), ..SetOptions::default() };
            count += lanes(&mut digests, &random_plan(&profile, &of(80)).unwrap());
            count += lanes(&mut digests, &threshold_plan(&profile, &of(1)).unwrap());
            count += lanes(&mut digests, &study(&profile));
            if name != "jrc-2021" {
                samples(&mut digests, &profile);
            }
        }
    }
    assert!(count > 10_000, "{count}");
    let found = digests.map(|digest| hex(&digest.finalize()));
    assert_eq!(
        (ENGINE_VERSION, found.each_ref().map(String::as_str)),
        PINNED_LANES,
        "\nLanes have other bits than those of engine {}. If that is meant: raise ENGINE_VERSION in \
         src/engine/version.rs, set PINNED_LANES here to the new version and the digest above, and say so in CHANGELOG.md",
        PINNED_LANES.0,
    );
}
