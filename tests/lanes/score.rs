//! What the score says about chosen verdicts, and that threads and chunks do not change a bit of it.

use crate::common;
use crate::common::plans;

use crate::common::plans::{chunk, mixed, plan};
use lanesweep::engine::{Confusion, LaneKey, LanePlan, Partial, Verdicts};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::{MODELS, ModelId};
use lanesweep::run::score::{
    ScoreOptions, ScoreTable, best_parameterizations, check_claims, f1, precision, recall, score,
};
use lanesweep::scenario::Category;

const LVD: &[&str] = &["i", "ii", "iii", "iv", "v"];

fn part(plan: &LanePlan, units: std::ops::Range<u64>, lane: &dyn Fn(u64) -> Verdicts) -> Partial {
    Partial::from_chunk(plan, &chunk(plan, units, &|l| (lane(l), 1.0), false)).unwrap()
}

fn table(plan: &LanePlan, lane: &dyn Fn(u64) -> Verdicts) -> ScoreTable {
    score(plan, &part(plan, 0..plan.unit_count(), lane), &ScoreOptions::default()).unwrap()
}

/// S fails at random; each variant repeats S but for a share (per mille) of lanes, where it is turned round.
fn noisy<'p>(plan: &'p LanePlan, wrong: &'p [u64]) -> impl Fn(u64) -> Verdicts + 'p {
    move |lane| {
        let key = plan.key(lane).unwrap();
        let recorded = plan.lane(&LaneKey { variant: 0, ..key });
        let fails = mixed(5, recorded) % 10 < 3;
        let turned = key.variant > 0 && mixed(7, lane) % 1000 < wrong[key.variant - 1];
        Verdicts(if fails != turned { 0b111 } else { 0 })
    }
}

#[test]
fn a_study_that_never_fails_has_no_score() {
    let plan = plan(&[(Category::Lvd, 3, LVD)]);
    let table = table(&plan, &|_| Verdicts(0));
    let scores = &table.categories[0];
    for cell in &scores.cells {
        let values = (recall(&cell.counts), precision(&cell.counts), f1(&cell.counts));
        assert_eq!(values, (None, None, None));
        assert_eq!((cell.f1_interval, cell.failing_scenarios, cell.counts.tn), (None, 0, 30));
    }
}

#[test]
fn f1_of_few_failing_scenarios_has_no_interval() {
    let cell = |units: usize, failing: u64| {
        let plan = plan(&[(Category::Lvd, units, LVD)]);
        let table = table(&plan, &|lane| Verdicts(u8::from(plan.key(lane).unwrap().unit < failing)));
        let scores = &table.categories[0];
        scores.cells[scores.index(1, ModelId::Fsm, Criterion::Collision).unwrap()].clone()
    };
    // Nine scenarios that fail from ten headways: no interval. Ten never make [1, 1].
    let (nine, ten) = (cell(20, 9), cell(20, 10));
    assert_eq!((f1(&nine.counts), nine.counts.tp, nine.failing_scenarios, nine.f1_interval), (Some(1.0), 90, 9, None));
    let interval = ten.f1_interval.unwrap();
    assert!(ten.failing_scenarios == 10 && interval.high == 1.0 && interval.low < 0.9, "{interval:?}");
}

#[test]
fn the_interval_covers_the_value_and_shrinks_with_the_number_of_scenarios() {
    let width = |units| {
        let plan = plan(&[(Category::Lvd, units, LVD)]);
        let table = table(&plan, &noisy(&plan, &[100, 100, 100, 100, 100]));
        let scores = &table.categories[0];
        let cell = &scores.cells[scores.index(2, ModelId::Rss, Criterion::Btn).unwrap()];
        let (value, interval) = (f1(&cell.counts).unwrap(), cell.f1_interval.unwrap());
        assert!(interval.low < value && value < interval.high, "{value} {interval:?}");
        interval.high - interval.low
    };
    let (few, many) = (width(14), width(90));
    assert!(many < 0.6 * few, "{few} to {many}");
}

#[test]
fn the_best_of_equals_is_the_first_and_no_data_tells_it_from_the_others() {
    // iii, iv and v repeat each other's lanes.
    let plan = plan(&[(Category::Lvd, 60, LVD)]);
    let twins = |lane: u64| {
        let key = plan.key(lane).unwrap();
        let variant = key.variant.min(3);
        noisy(&plan, &[400, 400, 50, 50, 50])(plan.lane(&LaneKey { variant, ..key }))
    };
    let counts = part(&plan, 0..60, &twins);
    let table = score(&plan, &counts, &ScoreOptions::default()).unwrap();
    for best in best_parameterizations(&table, &plan, &counts, Criterion::Ttc) {
        let score = best.score.unwrap();
        assert_eq!((score.variant.as_str(), &score.rivals[..]), ("iii", &["iv".to_owned(), "v".to_owned()][..]));
        assert!(score.more_data.is_infinite() && score.interval.low < score.f1);
    }
}

#[test]
fn a_best_parameterization_needs_ten_failing_scenarios() {
    let plan = plan(&[(Category::Lvd, 60, LVD)]);
    let best = |failing: u64| {
        let lane = |lane: u64| Verdicts(if plan.key(lane).unwrap().unit < failing { 7 } else { 0 });
        let counts = part(&plan, 0..60, &lane);
        let table = score(&plan, &counts, &ScoreOptions::default()).unwrap();
        let best = best_parameterizations(&table, &plan, &counts, Criterion::Collision).swap_remove(0);
        (best.failures, best.failing_scenarios, best.score.is_some())
    };
    assert_eq!((best(9), best(10)), ((90, 9, false), (100, 10, true)));
}

#[test]
fn threads_and_chunks_do_not_change_a_bit() {
    let plan = plan(&[(Category::CutIn, 20, &["1", "2"]), (Category::Lvd, 15, LVD)]);
    let lane = noisy(&plan, &[100, 200, 300, 50, 10]);
    let whole = part(&plan, 0..35, &lane);
    let parts = part(&plan, 21..35, &lane).merge(part(&plan, 0..3, &lane)).unwrap();
    let parts = parts.merge(part(&plan, 3..21, &lane)).unwrap();
    assert_eq!(whole, parts);
    let with_threads = |threads: usize, partial: &Partial| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| score(&plan, partial, &ScoreOptions::default()).unwrap())
    };
    let (one, two) = (with_threads(1, &whole), with_threads(2, &parts));
    assert_eq!(one, two);
    assert_eq!(check_claims(&one, &plan, &whole), check_claims(&two, &plan, &parts));
}

#[test]
fn an_incomplete_or_foreign_sweep_is_not_scored() {
    let plan = plan(&[(Category::Lvd, 6, LVD)]);
    let some = part(&plan, 2..4, &|_| Verdicts(0));
    let error = score(&plan, &some, &ScoreOptions::default()).unwrap_err().to_string();
    assert!(error.contains("2 of 6 units"), "{error}");
    let whole = part(&plan, 0..6, &|_| Verdicts(0));
    let other = plans::plan(&[(Category::Lvd, 6, &["i"])]);
    assert!(score(&other, &whole, &ScoreOptions::default()).is_err(), "as many units, but of another plan");
}

#[test]
fn the_papers_lvd_f1_follow_from_their_integer_counts() {
    let golden = std::fs::read_to_string(common::golden("paper_lvd_f1.json")).unwrap();
    let golden: serde_json::Value = serde_json::from_str(&golden).unwrap();
    let mut checked = 0;
    for cell in golden["lvd"].as_object().unwrap().values().flat_map(|v| v.as_object().unwrap()) {
        let (name, cell) = cell;
        let expected = cell["F1"].as_f64().unwrap();
        for candidate in cell["TP_FN_FP_candidates"].as_array().unwrap() {
            let [both, fn_, fp] = [0, 1, 2].map(|k| candidate[k].as_u64().unwrap());
            let ours = Confusion { tp: both, fn_, fp, tn: 4820 - both - fn_ - fp };
            assert_eq!(both + fn_, cell["baseline_fails"].as_u64().unwrap(), "{name}");
            assert!((f1(&ours).unwrap() - expected).abs() < 1e-9, "{name}: {:?} {expected}", f1(&ours));
            checked += 1;
        }
    }
    assert!(checked >= 60, "{checked}");
}

/// The packed counts of the units as numbers, which are read as well: a character per count, as in base 64.
fn unpack(partial: &mut serde_json::Value) {
    let digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for unit in partial["units"].as_array_mut().unwrap() {
        let text = unit["cells"].as_str().unwrap().to_owned();
        let counts: Vec<usize> = text.chars().map(|digit| digits.find(digit).unwrap()).collect();
        unit["cells"] = counts.chunks(4).map(<[usize]>::to_vec).collect();
    }
}

/// A partial as a file could hold it: the counts changed, the form kept.
fn crafted(partial: &Partial, change: impl FnOnce(&mut serde_json::Value)) -> Partial {
    let mut value = serde_json::to_value(partial).unwrap();
    unpack(&mut value);
    change(&mut value);
    serde_json::from_value(value).unwrap()
}

type Change = fn(&mut serde_json::Value);

/// What counts can say that no lanes can have done, and what the error says of it. The first unit's cells: S, then
/// one variant after the other, each with all models and criteria.
const CONTRADICTIONS: [(&str, Change); 14] = [
    ("0 of 6 units", |p| p["units"] = serde_json::json!([])),
    ("5 of 6 units", |p| drop(p["units"].as_array_mut().unwrap().pop())),
    ("it belongs to plan", |p| p["plan_hash"] = "another".into()),
    ("unit 0 stands where unit 1", |p| p["units"][1] = p["units"][0].clone()),
    ("unit 1 stands where unit 0", |p| p["units"].as_array_mut().unwrap().swap(0, 1)),
    ("unit 9223372036854775807 stands", |p| p["units"][5]["unit"] = (u64::MAX >> 1).into()),
    ("other variants", |p| p["units"][2]["cells"] = serde_json::json!([])),
    ("other variants", |p| drop(p["units"][2]["cells"].as_array_mut().unwrap().pop())),
    ("other variants", |p| p["units"][2]["capped"].as_array_mut().unwrap().push(0.into())),
    ("unit 3: 11 lanes of 10 headways", |p| p["units"][3]["cells"][0] = serde_json::json!([0, 0, 0, 11])),
    ("lanes of 10 headways", |p| p["units"][3]["cells"][20] = serde_json::json!([u32::MAX, u32::MAX, 1, 10])),
    ("S does not agree with itself", |p| p["units"][0]["cells"][2] = serde_json::json!([0, 4, 6, 0])),
    ("S fails 0 times by itself and 4 times", |p| {
        p["units"][4]["cells"][3 * MODELS + 1] = serde_json::json!([4, 0, 0, 6])
    }),
    ("4294967295 of 10 lanes ended", |p| p["units"][1]["capped"][3] = u32::MAX.into()),
];

#[test]
fn counts_that_contradict_themselves_are_an_error_and_no_score() {
    let plan = plan(&[(Category::Lvd, 6, LVD)]);
    let good = part(&plan, 0..6, &|_| Verdicts(0));
    let scored = |partial: &Partial| score(&plan, partial, &ScoreOptions::default());
    assert!(scored(&crafted(&good, |_| ())).is_ok());
    for (said, change) in CONTRADICTIONS {
        let error = scored(&crafted(&good, change)).unwrap_err();
        assert!(matches!(error, lanesweep::Error::Input { .. }), "{error}");
        assert!(error.to_string().contains(said), "should say `{said}`: {error}");
        assert!(error.help().is_some());
    }
}

#[test]
fn a_plan_without_variants_or_with_one_scenario_scores_without_a_panic() {
    for blocks in [&[(Category::Lvd, 1, LVD)][..], &[(Category::CutIn, 1, &[])], &[(Category::Lvd, 0, LVD)]] {
        let plan = plan(blocks);
        let counts = part(&plan, 0..plan.unit_count(), &|lane| Verdicts((lane % 8) as u8));
        check_claims(&score(&plan, &counts, &ScoreOptions::default()).unwrap(), &plan, &counts);
    }
}

/// Through the program: a part whose counts were changed and whose checksums were put right again.
#[test]
fn a_part_that_was_changed_and_sealed_again_is_refused_by_merge() {
    let dir = tempfile::tempdir().unwrap();
    let lanesweep = |args: &[&str]| {
        let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_lanesweep"));
        let output = command.current_dir(dir.path()).env("NO_COLOR", "1").args(args).output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr).replace('│', " ");
        (output.status.code().unwrap(), words.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let study = ["-q", "study", "--backend", "cpu", "--out", "run", "--shard", "0/1", "--scenarios"];
    assert_eq!(lanesweep(&[&study[..], &[scenarios.to_str().unwrap()]].concat()).0, 0);
    let path = dir.path().join("run/part-00000-of-00001.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let sealed: serde_json::Value = serde_json::from_str(&text).unwrap();
    let changes: [(&str, Change); 3] = [
        ("lanes of 10 headways", |p| p["units"][0]["cells"][0] = serde_json::json!([7, 0, 0, 7])),
        ("S does not agree with itself", |p| p["units"][1]["cells"][0] = serde_json::json!([0, 5, 5, 0])),
        ("do not fit the units", |p| p["units"][0]["cells"] = serde_json::json!([])),
    ];
    for (said, change) in changes {
        let mut content = sealed["content"].clone();
        unpack(&mut content["segments"][0]);
        change(&mut content["segments"][0]);
        std::fs::write(&path, lanesweep::run::parts::seal("part", &content).unwrap().0).unwrap();
        let (code, err) = lanesweep(&["cluster", "merge", "run"]);
        assert_eq!(code, 3, "{err}");
        assert!(err.contains(said), "should say `{said}`: {err}");
    }
}
