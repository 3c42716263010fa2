//! The dossier: its numbers are the study's, and its conclusion follows from its rules.

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
use lanesweep::stats::density::DataFacts;
use lanesweep::stats::estimate::Enough;
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

fn recordings(count: usize) -> Collection {
    let options = GeneratorOptions { recordings: count, ..GeneratorOptions::default() };
    mine_generated(&options, &MiningOptions::default(), || ()).unwrap()
}

fn study_options(category: Category, model: ModelId) -> StudyOptions {
    StudyOptions {
        categories: vec![category],
        models: vec![model],
        headways: Headway::paper(),
        ..StudyOptions::default()
    }
}

fn dossier(data: &Collection, (category, key): (Category, &str), model: ModelId, criterion: Criterion) -> Dossier {
    let facts = DataFacts { data: "test".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
    let options = JustifyOptions {
        compare: CompareOptions {
            study: study_options(category, model),
            parameterizations: vec![Parameterization::find(category, key).unwrap()],
            samples: 500,
            seed: 157,
            enough: Enough::default(),
        },
        criterion,
        score: ScoreOptions::default(),
        rules: Rules::default(),
    };
    let profile = Profile::load("paper").unwrap();
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
    let found = dossier(&data, (Category::CutOut, "b"), ModelId::Rss, Criterion::Collision);
    assert_eq!(found.scored.counts.tp + found.scored.counts.fn_, 0);
    assert_eq!(found.conclusion, Conclusion::Undecided);
    assert!(found.hidden.is_empty() && found.example.is_none());
}
