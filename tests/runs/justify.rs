//! The dossier: its numbers are the study's, and its conclusion follows from its rules.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use lanesweep::engine::{CpuBackend, Executor, Headway};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::compare::CompareOptions;
use lanesweep::run::justify::{Conclusion, Dossier, JustifyOptions, Rules, justify};
use lanesweep::run::parts::Job;
use lanesweep::run::score::ScoreOptions;
use lanesweep::run::study::{Study, StudyOptions};
use lanesweep::scenario::Category;
use lanesweep::scenario::DataProvenance;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::stats::density::{DensityModel, FitOptions};
use lanesweep::stats::estimate::{Clusters, Enough, RatioMethod, RatioVerdict, paired_ratio};
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;
use serde_json::Value;

use crate::common::program;

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
    let data = recordings(2);
    let found = dossier(&data, (Category::CutIn, "1"), ModelId::Reg157, Criterion::Collision);
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
            says_only_what_its_intervals_show(&found);
            let ratio = found.compared.as_ref().unwrap().replayed.ratio;
            assert!(is_enough || ratio.method == RatioMethod::Separate, "{model:?} {criterion:?}");
        }
    }
    assert!(seen[0] > 0 && seen[1] > 0, "{seen:?}");
}

/// A rule passes with its whole interval inside the limits, fails with the whole interval outside, and is undecided else.
fn says_only_what_its_intervals_show(found: &Dossier) {
    let Rules { min_recall, min_precision, .. } = Rules::default();
    let margin = Enough::default().margin;
    for finding in &found.findings {
        let (lower, upper) = match finding.quantity {
            "recall" => (min_recall, 1.0),
            "precision" => (min_precision, 1.0),
            "risk ratio P/S" => (1.0 / margin, margin),
            _ => continue,
        };
        let is_inside = finding.interval.is_some_and(|(low, high)| lower <= low && high <= upper);
        let is_outside = finding.interval.is_some_and(|(low, high)| high < lower || upper < low);
        match finding.conclusion {
            Conclusion::Appropriate => assert!(is_inside, "{finding:?}"),
            Conclusion::NotAppropriate => assert!(is_outside, "{finding:?}"),
            // Precision with an interval stays undecided where S fails in too few scenarios.
            Conclusion::Undecided => assert!(!is_outside || found.scored.failing_scenarios < 10, "{finding:?}"),
        }
    }
}

/// Mining drops many scenarios, so a full coverage of the kept ones is little of what was found.
#[test]
fn coverage_is_told_of_the_kept_and_of_the_found_scenarios() {
    let data = recordings(4);
    let found = dossier(&data, (Category::CutIn, "2"), ModelId::Fsm, Criterion::Collision);
    let of_category = || data.scenarios.iter().filter(|scenario| scenario.category == Category::CutIn);
    let (all, kept) = (of_category().count() as u64, of_category().filter(|scenario| scenario.kept).count() as u64);
    assert!(kept < all && (found.found, found.scenarios) == (all, kept));
    let coverage = found.coverage.unwrap();
    assert_eq!(coverage.of_kept(), Some(coverage.points as f64 / kept as f64));
    assert_eq!(coverage.of_found(), Some(coverage.points as f64 / all as f64));
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

/// `justify` with few recordings; what it prints. Its exit status has to be that of its conclusion.
fn lanesweep(args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_lanesweep")).env("NO_COLOR", "1").args(args).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let answer = text.lines().find(|line| line.starts_with("Under profile")).unwrap_or_default();
    let expected = match answer {
        line if line.contains(" is APPROPRIATE ") => 0,
        line if line.contains(" is NOT APPROPRIATE ") => 11,
        line if line.contains(" is UNDECIDED ") => 8,
        _ => panic!("{args:?}: {}", String::from_utf8_lossy(&output.stderr)),
    };
    assert_eq!(output.status.code(), Some(expected), "{answer}");
    text
}

#[test]
fn each_conclusion_has_an_exit_status_of_its_own() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    for (recordings, parameterization, model, criterion, conclusion) in [
        ("12", "iii", "Reg157", "collision", " is APPROPRIATE for Reg157"),
        ("2", "1", "Reg157", "collision", " is NOT APPROPRIATE for Reg157"),
        ("1", "2", "FSM", "collision", " is UNDECIDED for FSM"),
    ] {
        let of = ["--parameterization", parameterization, "--models", model, "--criterion", criterion];
        let args = ["-q", "justify", "--synth-recordings", recordings, "--out", out.to_str().unwrap()];
        let text = lanesweep(&[&args[..], &of].concat());
        assert!(text.contains(conclusion), "{text}");
    }
}

/// The vehicles meet beside each other: infinity would read as "never near".
#[test]
fn a_hidden_contact_without_an_approach_has_no_ttc_instead_of_an_infinite_one() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let args = ["-q", "justify", "--synth-recordings", "4", "--parameterization", "5", "--models", "CCHDM"];
    let text = lanesweep(&[&args[..], &["--out", out.to_str().unwrap()]].concat());
    let rows = std::fs::read_to_string(out.join("hidden.csv")).unwrap();
    let mut lines = rows.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let of = |row: &[&str], name: &str| row[header.iter().position(|column| *column == name).unwrap()].to_owned();
    let contacts: Vec<_> = lines.filter(|row| !of(row, "s_contact").is_empty()).collect();
    let is_beside = |row: &Vec<&str>| of(row, "s_contact") == "side" && of(row, "s_min_ttc_s").is_empty();
    assert!(contacts.iter().any(is_beside) && contacts.iter().all(|row| of(row, "s_min_ttc_s") != "inf"), "{rows}");
    assert!(text.contains("| side ") && text.contains("TTC –: the vehicles met beside each other"), "{text}");
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
    for words in [
        "Under profile paper, cut-in 1 is",
        " found scenarios, ",
        "Recall is ",
        "under un-r157, a reading of UN R157",
        " kept scenarios are points of the parameter space (coverage ",
        "Where the interval contains a limit, neither is shown: undecided.",
    ] {
        assert!(text.contains(words) && page.contains(words), "{words}: {text}");
    }
    assert!(
        text.contains(
            "a default is a convention of this program, not of a standard: justify.min_recall = 0.9 (default)"
        )
    );
    let limit =
        "<td class=\"text\">justify.min_recall</td><td class=\"text\">default</td><td class=\"text\">a hidden failure";
    assert!(page.contains(limit) && page.contains("MISSING") && page.contains("Known discrepancies"));
    assert!(text.contains("failures of S come from headways below 0.5 s"), "{text}");
    assert!(page.contains("Limits of use") && page.contains("reference driver") && page.contains("<dt>signature</dt>"));
    assert!(page.contains("<dt>date</dt><dd>____"), "a date is never the machine's");
    let again = made("again", &["--parameterization", "1"]).1;
    let is_same = |line: &&str| !line.contains(">command</td>") && !line.contains("<dt>computed by</dt>");
    let same = |page: &str| page.lines().filter(is_same).map(str::to_owned).collect::<Vec<_>>();
    assert!(same(&page) == same(&again), "the same inputs give the same bytes");
    let json = std::fs::read_to_string(out.join("dossier.json")).unwrap();
    assert!(json.contains("\"date\": null") && json.contains("\"profile\": \"un-r157\""), "{json}");
    let signed =
        ["--parameterization", "i", "--profile", "jrc-2021", "--author", "A. Assessor", "--date", "2026-11-24"];
    let (text, page, _) = made("signed", &signed);
    assert!(text.contains("Under profile jrc-2021, LVD i is"), "{text}");
    assert!(page.contains("<dt>author</dt><dd>A. Assessor</dd>") && page.contains("<dt>date</dt><dd>2026-11-24</dd>"));
}

/// A dossier of few generated recordings in a folder of this name, with more arguments: its status and text.
fn made(dir: &Path, name: &str, more: &[&str]) -> (i32, String) {
    let args =
        ["-q", "justify", "--synth-recordings", "2", "--parameterization", "1", "--models", "Reg157", "--out", name];
    let (code, text, error) = program::lanesweep(dir, &[&args[..], more].concat());
    assert_eq!(code, 11, "{error}");
    (code, text)
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn the_record_has_the_checksum_of_every_table_and_figure_and_the_same_inputs_give_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| {
        made(dir.path(), name, &[]);
        json(&fs::read_to_string(dir.path().join(name).join("dossier.json")).unwrap())["files_sha256"].clone()
    };
    let files = of("a");
    assert_eq!(files, of("b"));
    assert_eq!(files.as_object().unwrap().keys().collect::<Vec<_>>(), ["hidden.csv", "hidden.svg"]);
    for (name, sha256) in files.as_object().unwrap() {
        let found = lanesweep::support::input_file::sha256(&dir.path().join("a").join(name)).unwrap();
        assert_eq!(&found, sha256.as_str().unwrap(), "{name}");
    }
}

#[test]
fn two_dossiers_are_compared_without_their_data_and_a_changed_constant_is_named() {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path(), "a", &[]);
    let compare = |this: &str, other: &str| {
        let (code, text, error) =
            program::lanesweep(dir.path(), &["justify", this, "--against", other, "--format", "json"]);
        assert_eq!(code, 11, "the conclusion of the first: {error}");
        json(&text)
    };
    let same = compare("a", "a/dossier.json");
    assert_eq!(
        (&same["changes"], &same["numbers"]),
        (&Value::from(Vec::<i32>::new()), &Value::from(Vec::<i32>::new()))
    );
    assert!(same["sentences"][1].as_str().unwrap().ends_with("options and numbers are the same."), "{same}");

    let (_, text) = made(dir.path(), "b", &["--profile", "paper-fit", "--against", "a"]);
    let changes = compare("b/dossier.json", "a");
    let keys: Vec<&str> = changes["changes"].as_array().unwrap().iter().map(|of| of["key"].as_str().unwrap()).collect();
    assert_eq!(keys, ["cchdm.delay_s", "frame.time_cap_s"]);
    assert!(changes["changes"].as_array().unwrap().iter().all(|of| of["kind"] == "profile"));
    let record = json(&fs::read_to_string(dir.path().join("b/dossier.json")).unwrap());
    assert_eq!(record["changes"], changes, "the record of a new dossier has the same");
    let page = fs::read_to_string(dir.path().join("b/report.html")).unwrap();
    for shown in [&text, &page] {
        assert!(shown.contains("Changes since the other dossier") && shown.contains("frame.time_cap_s"), "{text}");
    }
    assert_eq!(program::names(dir.path()).len(), 2, "nothing else is written: {:?}", program::names(dir.path()));
}

#[test]
fn a_damaged_dossier_and_one_that_is_alone_are_refused_with_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path(), "a", &[]);
    let refusal = |args: &[&str]| {
        let (code, _, error) = program::lanesweep(dir.path(), &[&["justify"], args].concat());
        (code, program::flat(&error))
    };
    let (code, error) = refusal(&["a"]);
    assert!(code == 2 && error.contains("it is a dossier") && error.contains("--against"), "{code}: {error}");
    let (code, error) = refusal(&["--models", "Reg157"]);
    assert!(code == 2 && error.contains("--parameterization: it is missing"), "{code}: {error}");
    let whole = fs::read(dir.path().join("a/dossier.json")).unwrap();
    fs::write(dir.path().join("cut-dossier.json"), &whole[..whole.len() / 2]).unwrap();
    for args in [["a", "--against", "cut-dossier.json"], ["cut-dossier.json", "--against", "a"]] {
        let (code, error) = refusal(&args);
        assert!(
            code == 3 && error.contains("it is no dossier") && error.contains("its dossier.json"),
            "{code}: {error}"
        );
    }
    let (code, error) = refusal(&["a", "--against", "nowhere"]);
    assert!(code != 0 && error.contains("nowhere"), "{code}: {error}");
}
