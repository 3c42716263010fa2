//! The dossier: its numbers are the study's, and its conclusion follows from its rules.

use assert_cmd::Command;
use lanesweep::engine::{CpuBackend, Executor, Headway};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::compare::CompareOptions;
use lanesweep::run::justify::{Conclusion, Dossier, JustifyOptions, Rules, justify};
use lanesweep::run::score::ScoreOptions;
use lanesweep::run::study::{Study, StudyOptions};
use lanesweep::scenario::Category;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::stats::estimate::{Clusters, Enough, RatioMethod, RatioVerdict, paired_ratio};
use lanesweep::traffic::DataProvenance;
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

fn recordings(count: usize) -> Collection {
    let options = GeneratorOptions { recordings: count, ..GeneratorOptions::default() };
    mine_generated(&options, &MiningOptions::default(), || Ok(())).unwrap()
}

fn study_options(category: Category, model: ModelId) -> StudyOptions {
    StudyOptions {
        categories: vec![category],
        models: vec![model],
        headways: Headway::paper(),
        ..StudyOptions::default()
    }
}

fn dossier(data: &Collection, of: (Category, &str), model: ModelId, criterion: Criterion) -> Dossier {
    dossier_under("paper", data, of, model, criterion)
}

fn dossier_under(
    profile: &str,
    data: &Collection,
    (category, key): (Category, &str),
    model: ModelId,
    criterion: Criterion,
) -> Dossier {
    let facts = DataProvenance { data: "test".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let options = JustifyOptions {
        compare: CompareOptions {
            study: study_options(category, model),
            parameterizations: vec![Parameterization::find(category, key).unwrap()],
            samples: 500,
            every_form: false,
            seed: 157,
            enough: Enough::default(),
        },
        criterion,
        score: ScoreOptions::default(),
        rules: Rules::default(),
    };
    let profile = Profile::load(profile).unwrap();
    let backend = CpuBackend::lane_arithmetic();
    justify(&data.scenarios, &facts, &profile, &options, &Executor::new(&backend)).unwrap()
}

#[test]
fn the_counts_of_the_dossier_are_those_of_the_study_for_every_parameterization() {
    let data = recordings(4);
    let (category, model, criterion) = (Category::Lvd, ModelId::Reg157, Criterion::Ttc);
    let found = dossier(&data, (category, "iii"), model, criterion);
    let study = Study::builder(&data, Profile::load("paper").unwrap());
    let study = study.options(study_options(category, model)).plan().unwrap();
    let backend = CpuBackend::lane_arithmetic();
    let table = study.score(&study.run(&Executor::new(&backend)).unwrap().counts).unwrap();
    let scores = &table.categories[0];
    assert_eq!(found.alternatives.len(), 5);
    for (id, scored, _) in &found.alternatives {
        let variant = scores.variant(&id.key).unwrap();
        let cell = &scores.cells[scores.index(variant, model, criterion).unwrap()];
        assert_eq!(scored.counts, cell.counts, "{}", id.key);
        let interval = cell.f1_interval.map(|interval| (interval.low, interval.high));
        assert_eq!(scored.f1.interval, interval, "{}", id.key);
    }
    let by_headway = found.groups.iter().filter(|group| group.by == "headway");
    let sum: u64 = by_headway.map(|group| group.scored.counts.tp).sum();
    assert_eq!(sum, found.scored.counts.tp, "groups part the lanes");
}

#[test]
fn what_hides_failures_is_not_appropriate_and_they_are_named_with_an_example() {
    let data = recordings(12);
    let found = dossier(&data, (Category::CutIn, "5"), ModelId::Fsm, Criterion::Collision);
    let counts = &found.scored.counts;
    assert!(counts.fn_ > 0 && found.hidden.len() as u64 == counts.fn_);
    assert_eq!(found.conclusion, Conclusion::NotAppropriate);
    let severities: Vec<f64> = found.hidden.iter().map(|hidden| hidden.recorded.impact_closing_speed).collect();
    assert!(severities.windows(2).all(|pair| pair[0] >= pair[1]), "the most severe first");
    for hidden in &found.hidden {
        assert!(hidden.recorded.verdicts.failed(Criterion::Collision));
        assert!(!hidden.parameterized.verdicts.failed(Criterion::Collision));
        assert!(hidden.key.starts_with(&hidden.scenario));
    }
    let [recorded, parameterized] = found.example.as_ref().unwrap();
    assert_eq!(recorded.outcome, found.hidden[0].recorded);
    assert_eq!(parameterized.outcome, found.hidden[0].parameterized);
}

#[test]
fn full_agreement_on_enough_data_is_appropriate() {
    let data = recordings(12);
    let found = dossier(&data, (Category::Lvd, "v"), ModelId::Cchdm, Criterion::Ttc);
    assert_eq!(found.conclusion, Conclusion::Appropriate, "{:#?}", found.findings);
    assert!(found.scored.recall.interval.unwrap().0 >= 0.9);
}

#[test]
fn too_little_data_is_undecided_and_says_how_much_more_is_needed() {
    let data = recordings(1);
    let found = dossier(&data, (Category::CutIn, "2"), ModelId::Fsm, Criterion::Collision);
    assert_eq!(found.conclusion, Conclusion::Undecided);
    let needs: Vec<f64> = found.findings.iter().filter_map(|finding| finding.need).map(|need| need.times).collect();
    assert!(!needs.is_empty() && needs.iter().all(|times| *times > 1.0), "{needs:?}");
}

#[test]
fn without_any_failure_nothing_is_concluded() {
    let data = recordings(1);
    let found = dossier(&data, (Category::Lvd, "v"), ModelId::Rss, Criterion::Collision);
    assert_eq!(found.scored.counts.tp + found.scored.counts.fn_, 0);
    assert_eq!(found.conclusion, Conclusion::Undecided);
    assert!(found.hidden.is_empty() && found.example.is_none());
}

#[test]
fn the_density_whose_coverage_is_told_is_the_one_that_was_sampled() {
    let data = recordings(4);
    let found = dossier(&data, (Category::Lvd, "i"), ModelId::Reg157, Criterion::Ttc);
    let facts = DataProvenance { data: "test".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let id = Parameterization::find(Category::Lvd, "i").unwrap();
    let options = FitOptions { parameterization: StudyOptions::default().parameterization, ..FitOptions::default() };
    let fitted = DensityModel::fit(id, &data.scenarios, &facts, &options).unwrap().model;
    assert!(found.coverage.as_ref().unwrap().representativeness.is_some());
    assert_eq!(found.density_sha256, Some(fitted.content_sha256().unwrap()));
}

#[test]
fn recall_under_the_regulation_stands_beside_that_of_another_profile_and_once_under_its_own() {
    let data = recordings(6);
    let (of, model, criterion) = ((Category::CutIn, "2"), ModelId::Cchdm, Criterion::Collision);
    let paper = dossier(&data, of, model, criterion);
    let regulation = dossier_under("un-r157", &data, of, model, criterion);
    assert_eq!(paper.regulation.as_ref(), Some(&regulation.scored));
    assert_ne!(paper.scored, regulation.scored);
    assert_eq!(regulation.regulation, None);
}

/// Nine scenarios in which S fails have no interval, from however many headways; ten have one.
#[test]
fn min_failures_counts_scenarios_in_the_dossier_as_in_the_study_and_the_comparison() {
    let data = recordings(3);
    let mut seen = [0, 0];
    for model in ModelId::ALL {
        for criterion in Criterion::ALL {
            let found = dossier(&data, (Category::CutIn, "2"), model, criterion);
            let is_enough = found.scored.failing_scenarios >= 10;
            seen[usize::from(is_enough)] += 1;
            for share in [found.scored.recall, found.scored.f1] {
                assert_eq!(share.interval.is_some(), is_enough, "{model:?} {criterion:?} {:?}", found.scored);
            }
            let ratio = found.compared.as_ref().unwrap().replayed.ratio;
            assert!(is_enough || ratio.method == RatioMethod::Separate, "{model:?} {criterion:?}");
        }
    }
    assert!(seen[0] > 0 && seen[1] > 0, "{seen:?}");
}

/// P fails and S never does: the ratio is infinite, its lower end is not.
#[test]
fn a_ratio_without_a_value_never_decides_without_a_number() {
    let runs = vec![10; 100];
    let failures = |failing: usize| (0..100).map(|k| if k < failing { 10 } else { 0 }).collect::<Vec<u64>>();
    let (none, some) = (failures(0), failures(40));
    let side = |failures| Clusters { runs: &runs, failures };
    let ratio = paired_ratio(side(&some), side(&none), Enough::default(), 0.95);
    assert_eq!((ratio.ratio, ratio.verdict), (None, RatioVerdict::TooHigh));
    assert!(matches!(ratio.interval(), Some((low, f64::INFINITY)) if low > 1.0), "{ratio:?}");
    assert_eq!(paired_ratio(side(&none), side(&none), Enough::default(), 0.95).interval(), None);
}

fn lanesweep(args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_lanesweep")).env("NO_COLOR", "1").args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_conclusion_names_its_profile_and_the_page_has_limits_credibility_and_room_for_a_signature() {
    let dir = tempfile::tempdir().unwrap();
    let made = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let args = ["-q", "justify", "--models", "Reg157", "--synth-recordings", "2", "--backend", "cpu", "--out"];
        let text = lanesweep(&[&args[..], &[out.to_str().unwrap()], more].concat());
        (text, std::fs::read_to_string(out.join("report.html")).unwrap(), out)
    };
    let (text, page, out) = made("paper", &["--parameterization", "1"]);
    for words in ["Under profile paper, cut-in 1 is", "Recall is ", "under un-r157, the profile of the regulation"] {
        assert!(text.contains(words) && page.contains(words), "{words}: {text}");
    }
    assert!(text.contains("failures of S come from headways below 0.5 s"), "{text}");
    assert!(page.contains("No table of another simulator for cut-in under paper ships with the program"));
    assert!(page.contains("Limits of use") && page.contains("reference driver") && page.contains("<dt>signature</dt>"));
    assert!(page.contains("<dt>date</dt><dd>____"), "a date is never the machine's");
    let again = made("again", &["--parameterization", "1"]).1;
    let is_same = |line: &&str| !line.contains("<dt>command</dt>") && !line.contains("<dt>computed by</dt>");
    let same = |page: &str| page.lines().filter(is_same).map(str::to_owned).collect::<Vec<_>>();
    assert!(same(&page) == same(&again), "the same inputs give the same bytes");
    let json = std::fs::read_to_string(out.join("dossier.json")).unwrap();
    assert!(json.contains("\"date\": null") && json.contains("\"profile\": \"un-r157\""), "{json}");
    let signed =
        ["--parameterization", "i", "--profile", "jrc-2021", "--author", "A. Assessor", "--date", "2026-11-24"];
    let (text, page, _) = made("signed", &signed);
    assert!(text.contains("Under profile jrc-2021, LVD i is"), "{text}");
    assert!(page.contains("<dt>author</dt><dd>A. Assessor</dd>") && page.contains("<dt>date</dt><dd>2026-11-24</dd>"));
    assert!(
        page.contains("Tables of the JRC")
            && page.contains("for LVD under jrc-2021")
            && page.contains("LVD cutin_check")
    );
}
