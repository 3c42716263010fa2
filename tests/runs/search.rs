//! Searches: folds, families, journals, winners, and that nothing is gained where nothing is to be found.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::OnceLock;

use lanesweep::engine::{CpuBackend, Executor, Headway};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::parts::Shard;
use lanesweep::run::score::ScoreOptions;
use lanesweep::run::search::{Objective, Search, SearchLimits, SearchOptions, SearchResult, folds};
use lanesweep::scenario::parameterization::{
    EMPHASIS_KNOTS, Feature, FunctionKind, LinearFamily, LinearSpec, Parameterization, ParameterizationOptions,
    Reduction, Signal, SvdLateral,
};
use lanesweep::scenario::{Category, Scenario, read_scenario_file};
use lanesweep::support::plausibility::Implausible;
use lanesweep::traffic::mining::{MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

use crate::common::program::lanesweep;

fn mined(seed: u64) -> Vec<Scenario> {
    let options = GeneratorOptions { recordings: 6, seed, ..GeneratorOptions::default() };
    mine_generated(&options, &MiningOptions::default(), || Ok(())).unwrap().scenarios
}

fn scenarios() -> &'static [Scenario] {
    static MINED: OnceLock<Vec<Scenario>> = OnceLock::new();
    MINED.get_or_init(|| mined(1))
}

fn kept(category: Category) -> Vec<&'static Scenario> {
    scenarios().iter().filter(|s| s.kept && s.category == category).collect()
}

fn svd(coefficients: usize, signal: Signal, emphasis: Vec<f64>) -> LinearFamily {
    LinearFamily::Svd { coefficients, signal, emphasis }
}

/// One of every family, for a category.
fn families(category: Category) -> Vec<LinearSpec> {
    let series = match category {
        Category::CutIn => 2,
        Category::CutOut => 3,
        Category::Lvd => 1,
    };
    let functions = |kind| LinearFamily::Functions { kind, sizes: vec![2; series] };
    let emphasis = (0..LinearSpec::emphasis_count(category)).map(|k| 0.3 * (k % EMPHASIS_KNOTS) as f64).collect();
    let mut families: Vec<LinearFamily> = vec![
        svd(4, Signal::Values, Vec::new()),
        svd(3, Signal::Changes, Vec::new()),
        svd(3, Signal::Values, emphasis),
        LinearFamily::Features(Feature::of_category(category).take(4).collect()),
    ];
    let kinds = [FunctionKind::Polynomial, FunctionKind::Cosine, FunctionKind::BSpline, FunctionKind::Lines];
    families.extend(kinds.map(functions));
    let both = |family: LinearFamily| {
        [false, true].map(|registered| LinearSpec { family: family.clone(), mirrored: true, registered })
    };
    families.into_iter().flat_map(both).collect()
}

fn fitted(spec: &LinearSpec, category: Category) -> Reduction {
    spec.fit(category, &kept(category), &ParameterizationOptions::default()).unwrap()
}

#[test]
fn scenarios_of_a_recording_stay_together() {
    let all = kept(Category::Lvd);
    let of = folds(&all, 3).unwrap();
    let mut by_recording: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
    for (scenario, fold) in all.iter().zip(&of) {
        by_recording.entry(&scenario.recording).or_default().insert(*fold);
    }
    assert!(by_recording.len() >= 3 && by_recording.values().all(|folds| folds.len() == 1), "{by_recording:?}");
    assert_eq!(of.iter().collect::<BTreeSet<_>>().len(), 3, "no fold is empty");
    // One recording is cut into stretches of time.
    let one: Vec<&Scenario> = all.iter().filter(|s| s.recording == all[0].recording).copied().collect();
    let mut in_time: Vec<(i64, usize)> = one.iter().map(|s| s.frame0).zip(folds(&one, 2).unwrap()).collect();
    in_time.sort_unstable();
    assert!(in_time.windows(2).all(|pair| pair[0].1 <= pair[1].1), "{in_time:?}");
    assert!(folds(&one, 1).is_err() && folds(&one[..1], 2).is_err());
}

#[test]
fn the_papers_decomposition_is_one_of_the_family() {
    for category in Category::ALL {
        let options = ParameterizationOptions { svd_lateral: SvdLateral::Signed, ..ParameterizationOptions::default() };
        let paper = Reduction::fit(category, &kept(category), &options).unwrap();
        let spec = LinearSpec { family: svd(3, Signal::Values, Vec::new()), mirrored: false, registered: false };
        let ours = spec.fit(category, &kept(category), &options).unwrap();
        for scenario in kept(category) {
            assert_eq!(ours.reduce(scenario, 3).unwrap(), paper.reduce(scenario, 3).unwrap(), "{}", scenario.id);
        }
    }
}

/// A description of a description is the description: encoding loses nothing that decoding gave.
#[test]
fn what_a_description_keeps_it_keeps_twice() {
    for category in Category::ALL {
        for spec in families(category) {
            let LinearFamily::Features(_) = spec.family else {
                let ours = fitted(&spec, category);
                let d = spec.parameter_count(category);
                for scenario in kept(category).into_iter().take(5) {
                    let c = ours.coefficients(scenario, d).unwrap();
                    // The vector of the reconstruction, before it is limited to what is possible.
                    let z = ours.basis.reconstruct(&c);
                    let again = ours.encode_vector(&z, d).unwrap();
                    for (a, b) in c.iter().zip(&again) {
                        assert!((a - b).abs() < 1e-6 * a.abs().max(1.0), "{spec:?} {}: {a} {b}", scenario.id);
                    }
                }
                continue;
            };
        }
    }
}

#[test]
fn more_parameters_never_describe_the_fitted_scenarios_worse() {
    let category = Category::CutIn;
    let error = |spec: &LinearSpec| {
        let ours = fitted(spec, category);
        let d = spec.parameter_count(category);
        let of = |scenario: &&Scenario| {
            let z = ours.vector(scenario).unwrap();
            let back = ours.basis.reconstruct(&ours.coefficients(scenario, d).unwrap());
            z.iter().zip(&back).zip(&ours.basis.weights).map(|((a, b), w)| ((a - b) * w).powi(2)).sum::<f64>()
        };
        kept(category).iter().map(of).sum::<f64>()
    };
    let features: Vec<Feature> = Feature::of_category(category).collect();
    for size in 1..5 {
        let of = |family| LinearSpec { family, mirrored: true, registered: false };
        let pairs = [
            [svd(size, Signal::Values, Vec::new()), svd(size + 1, Signal::Values, Vec::new())],
            [LinearFamily::Features(features[..size].to_vec()), LinearFamily::Features(features[..=size].to_vec())],
            [size, size + 1].map(|k| LinearFamily::Functions { kind: FunctionKind::Polynomial, sizes: vec![k, 1] }),
        ];
        for [less, more] in pairs.map(|pair| pair.map(|family| error(&of(family)))) {
            assert!(more <= less * (1.0 + 1e-5), "{size}: {less} {more}");
        }
    }
}

#[test]
fn a_file_gives_the_description_back_and_a_changed_one_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("found.json");
    for spec in families(Category::CutOut) {
        let id = Parameterization::linear("found", fitted(&spec, Category::CutOut));
        let text = String::from_utf8(id.to_json("synthetic").unwrap()).unwrap();
        std::fs::write(&path, &text).unwrap();
        assert_eq!(Parameterization::read(&path).unwrap(), id);
        std::fs::write(&path, text.replacen("\"rows\": ", "\"rows\": 1", 1)).unwrap();
        let error = Parameterization::read(&path).unwrap_err();
        assert!(error.to_string().contains("checksum mismatch"), "{error}");
    }
}

fn options(shuffled: bool) -> SearchOptions {
    SearchOptions {
        category: Category::CutIn,
        models: ModelId::ALL.to_vec(),
        criterion: Criterion::Ttc,
        objective: Objective::F1,
        headways: Headway::paper(),
        limits: SearchLimits { folds: 3, max_parameters: 4, studies: 72, ..SearchLimits::default() },
        parameterization: ParameterizationOptions::default(),
        score: ScoreOptions::default(),
        shuffled,
    }
}

fn search(folder: Option<&Path>, shard: Option<Shard>, shuffled: bool) -> Option<SearchResult> {
    static UNREAD: OnceLock<Vec<Scenario>> = OnceLock::new();
    let unread = UNREAD.get_or_init(|| mined(2));
    let backend = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&backend);
    let profile = Profile::load("paper").unwrap();
    let search = Search::plan(scenarios(), &profile, options(shuffled)).unwrap();
    search.run(Some(unread), (folder, shard), &executor, &|_| ()).unwrap()
}

#[test]
fn shards_and_a_resumed_search_find_what_one_process_finds() {
    let whole = search(None, None, false).unwrap();
    let dir = tempfile::tempdir().unwrap();
    for index in [1, 0] {
        assert!(search(Some(dir.path()), Some(Shard { index, of: 2 }), false).is_none());
    }
    // Half a line, as a killed process leaves it.
    let journal = dir.path().join("search-0-of-2.journal");
    let bytes = std::fs::read(&journal).unwrap();
    std::fs::write(&journal, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let concluded = search(Some(dir.path()), None, false).unwrap();
    assert_eq!(concluded.evaluated, whole.evaluated);
    assert_eq!(concluded.fronts, whole.fronts);
    assert_eq!(concluded.winner, whole.winner);
    // Journals of another search are refused.
    let backend = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&backend);
    let profile = Profile::load("paper").unwrap();
    let other = SearchOptions { criterion: Criterion::Btn, ..options(false) };
    let other = Search::plan(scenarios(), &profile, other).unwrap();
    let error = other.run(None, (Some(dir.path()), None), &executor, &|_| ()).unwrap_err();
    assert!(error.to_string().contains("another run"), "{error}");
}

/// With the outcomes of other scenarios, no description may be better on unread data than an S' that knows the headway only.
#[test]
fn shuffled_outcomes_give_no_gain_on_unread_data() {
    let found = |shuffled: bool| {
        let result = search(None, None, shuffled).unwrap();
        let front = &result.fronts[0];
        let best = front.points.iter().map(|point| point.judged.held_out.unwrap());
        let best = best.max_by(|a, b| a.value.unwrap().total_cmp(&b.value.unwrap())).unwrap();
        (best.value.unwrap(), best.interval.unwrap(), front.headway_only[1].unwrap())
    };
    let (value, interval, headway) = found(true);
    assert!(interval.low <= headway, "{value} {interval:?} against {headway}");
    let (value, interval, headway) = found(false);
    assert!(interval.low > headway, "{value} {interval:?} against {headway}: the true outcomes are found");
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_winner_is_studied_fitted_and_sampled_and_external_s_prime_is_judged() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name);
    let run = |args: &[&str]| {
        let (code, out, error) = lanesweep(dir.path(), args);
        assert_eq!(code, 0, "{args:?}: {error}");
        out
    };
    run(&["-q", "synth", "recordings", "--synth-recordings", "6"]);
    run(&["-q", "mine", "recordings", "--out", "scenarios.jsonl"]);
    let data = ["--scenarios", "scenarios.jsonl"];
    let limits = ["--studies", "24", "--max-parameters", "4", "--criterion", "ttc"];
    run(&[&["-q", "search", "--category", "cut-in", "--out", "found"], &data[..], &limits[..]].concat());
    for name in ["report.html", "fronts.csv", "candidates.csv", "winner.json", "front.svg", "error.svg", "search.json"]
    {
        assert!(of("found").join(name).exists(), "{name}");
    }
    // S itself as S' of another program, in a file whose name is no key.
    std::fs::copy(of("scenarios.jsonl"), of("my same.v2.jsonl")).unwrap();
    let external = ["--cross-validate", "--external", "my same.v2.jsonl", "--external", "found/winner.json"];
    run(&[&["-q", "study", "--categories", "cut-in", "--out", "study"], &data[..], &external[..]].concat());
    let variants = std::fs::read_to_string(of("study/variants.csv")).unwrap();
    let row = |name: &str| variants.lines().find(|line| line.starts_with(&format!("cut-in,{name},"))).unwrap();
    assert_eq!(row("my-same-v2"), "cut-in,my-same-v2,0,1,1,1", "{variants}");
    for name in ["5-cv", "winner", "winner-cv"] {
        row(name);
    }
    assert_eq!(std::fs::read_to_string(of("study/folds.csv")).unwrap().lines().next(), Some("scenario,fold"));
    run(&[&["-q", "fit", "--parameterizations", "found/winner.json", "--out", "density.json"], &data[..]].concat());
    run(&["-q", "sample", "density.json", "--samples", "200", "--out", "sampled"]);
    #[cfg(feature = "parquet")]
    {
        run(&["-q", "mine", "recordings", "--out", "as-parquet.parquet"]);
        run(&[&["-q", "study", "--external", "as-parquet.parquet", "--out", "parquet"], &data[..]].concat());
        let variants = std::fs::read_to_string(of("parquet/variants.csv")).unwrap();
        assert!(variants.contains("LVD,as-parquet,0,1,1,1"), "{variants}");
    }
    // What is wrong is said.
    let scenarios = read_scenario_file(&of("scenarios.jsonl"), Implausible::Refused).unwrap().scenarios;
    let id = &scenarios.iter().find(|s| s.kept && s.category == Category::CutIn).unwrap().id;
    let lines = std::fs::read_to_string(of("scenarios.jsonl")).unwrap();
    let of_id = format!("\"id\":\"{id}\"");
    let without: Vec<&str> = lines.lines().filter(|line| !line.contains(&of_id)).collect();
    let renamed = lines.replace(&of_id, "\"id\":\"nobody\"");
    for (name, content, says) in [
        ("missing.jsonl", without.join("\n"), "is missing"),
        ("renamed.jsonl", renamed, "nobody"),
        ("5.jsonl", lines.clone(), "cannot name"),
        ("cut.jsonl", lines[..lines.len() / 2].to_owned(), "cut.jsonl"),
    ] {
        std::fs::write(of(name), content).unwrap();
        let args = [&["-q", "study", "--external", name, "--out", "bad"], &data[..]].concat();
        let (code, _, error) = lanesweep(dir.path(), &args);
        assert!(code == 2 || code == 3, "{name}: {code} {error}");
        assert!(error.split_whitespace().collect::<Vec<_>>().join(" ").contains(says), "{name}: {error}");
    }
    assert!(text(&of("found")).ends_with("found"));
}
