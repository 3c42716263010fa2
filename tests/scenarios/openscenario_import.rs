//! Distributions of an OpenSCENARIO file as maps and samples: the same draws whatever computes them, and one message
//! with line and element for everything that is not understood.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use lanesweep::engine::{Backend, CpuBackend, Executor, Headway, Wanted};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::report::openscenario::{
    DistributionSamples, Names, Rename, parse_distribution, read_distribution, variations,
};
use lanesweep::run::sampling::{Estimator, SampleHeadways, SampleOptions, SampleTally};
use lanesweep::scenario::Category;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/examples").join(name)
}

fn renames() -> Vec<Rename> {
    ["Ego_Speed_kph=ego_speed_kmh", "Other_Speed_kph=other_speed_mps*0.2777777777777778"]
        .map(|text| text.parse().unwrap())
        .to_vec()
}

fn cut_ins() -> DistributionSamples {
    let path = example("cut-in-stochastic.xosc");
    let file = read_distribution(&path).unwrap();
    let names = Names { category: Category::CutIn, renames: &renames(), path: &path };
    DistributionSamples::of(&file, &names, Vec::new()).unwrap()
}

#[test]
fn draws_keep_their_ranges_their_units_and_their_moments() {
    let samples = cut_ins();
    assert_eq!((samples.runs, samples.seed), (20_000, Some(157)));
    let profile = Profile::load("paper").unwrap();
    let n = 20_000;
    let points: Vec<Vec<f64>> = (0..n).map(|index| samples.draw(157, index, &profile).unwrap().values).collect();
    let mean = |at: usize| points.iter().map(|p| p[at]).sum::<f64>() / n as f64;
    for p in &points {
        assert!((60.0..=130.0).contains(&p[0]));
        // 50 to 90 km/h in m/s.
        assert!((50.0 / 3.6..=90.0 / 3.6).contains(&p[1]));
        assert!((5.0..=40.0).contains(&p[2]));
        assert!([0.5, 1.0, 1.5].contains(&p[3]));
        assert!(p[4].fract() == 0.0 && (0.0..=6.0).contains(&p[4]));
    }
    // Normal of 100 and 15 cut at 60 and 130: 100 + 15 (φ(−8/3) − φ(2))/(Φ(2) − Φ(−8/3)).
    assert!((mean(0) - 99.34).abs() < 0.5, "{}", mean(0));
    assert!((mean(1) - 70.0 / 3.6).abs() < 0.12);
    assert!((mean(2) - (0.2 * 10.0 + 0.8 * 27.5)).abs() < 0.3);
    assert!((mean(3) - (0.3 * 0.5 + 0.5 + 0.2 * 1.5)).abs() < 0.01);
    assert!((mean(4) - 0.5).abs() < 0.03);
}

#[test]
fn a_sample_is_a_function_of_seed_and_index_and_parts_count_what_the_whole_counts() {
    let samples = cut_ins();
    let profile = Profile::load("paper").unwrap();
    let draw = |seed, index| samples.draw(seed, index, &profile).unwrap();
    assert_eq!(draw(157, 7), draw(157, 7));
    assert_ne!(draw(157, 7), draw(157, 8));
    assert_ne!(draw(157, 7), draw(158, 7));
    let (plan, tries) = samples.plan((600, 157), &profile, &ModelId::ALL, &[]).unwrap();
    assert_eq!(tries, 600);
    let defaults = SampleOptions::new(Estimator::CRUDE, 600, SampleHeadways::Sampled);
    let counting = SampleOptions { worst: 5, ..defaults };
    let tally = |units: std::ops::Range<u64>, backend: &dyn Backend| {
        let mut tally = SampleTally::empty(&plan, &counting);
        Executor::new(backend)
            .sweep(&plan, units, Wanted::Outcomes, |chunk| {
                tally = tally.clone().merge(SampleTally::of_chunk(&plan, &chunk, &counting)?)?;
                Ok(())
            })
            .unwrap();
        tally
    };
    let (batches, scalar) = (CpuBackend::lane_arithmetic(), CpuBackend::scalar());
    let whole = tally(0..600, &batches);
    assert!(whole.failures.iter().sum::<u64>() > 0 && whole.voids == 0);
    assert_eq!(tally(0..600, &scalar), whole);
    let parts = tally(417..600, &batches).merge(tally(0..1, &scalar)).unwrap();
    assert_eq!(parts.merge(tally(1..417, &batches)).unwrap(), whole);
    // A longer run begins with the same samples.
    let (longer, _) = samples.plan((900, 157), &profile, &ModelId::ALL, &[]).unwrap();
    assert!((0..600).all(|unit| longer.case(0, unit, 0) == plan.case(0, unit, 0)));
}

#[test]
fn deterministic_distributions_are_axes_and_panels() {
    let path = example("cut-in-deterministic.xosc");
    let file = read_distribution(&path).unwrap();
    let found = variations(&file, &Names { category: Category::CutIn, renames: &renames(), path: &path }).unwrap();
    let keys: Vec<&str> = found.axes.iter().map(|a| a.parameter.key).collect();
    assert_eq!(keys, ["gap_m", "lateral_speed_mps"]);
    assert_eq!(found.axes[0].values, (1..=12).map(|k| 5.0 * f64::from(k)).collect::<Vec<_>>());
    let keys: Vec<&str> = found.set_axes.iter().map(|a| a.parameter.key).collect();
    assert_eq!(keys, ["ego_speed_kmh", "other_speed_mps"]);
    assert_eq!(found.set_rows, [vec![60.0, 8.333333333], vec![120.0, 22.222222222]]);
}

fn lanesweep(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lanesweep")).current_dir(dir).args(args).output().unwrap()
}

fn good(dir: &Path, args: &[&str]) -> String {
    let output = lanesweep(dir, args);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What a refused command says, on one line.
fn said(dir: &Path, args: &[&str]) -> String {
    let output = lanesweep(dir, args);
    assert!(matches!(output.status.code(), Some(2 | 3)), "{args:?}: {:?}", output.status);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

const RENAME: [&str; 4] = ["--rename", "Ego_Speed_kph=ego_speed_kmh", "--rename", "Other_Speed_kph=other_speed_kmh"];

#[test]
fn a_stochastic_file_becomes_estimates_and_its_lanes_run_again() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    let file = example("cut-in-stochastic.xosc");
    let file = file.to_str().unwrap();
    let sample = |out: &str, more: &[&str]| {
        let fixed = ["sample", "--distribution", file, "--category", "cut-in", "--backend", "cpu", "--out", out];
        good(root, &[&fixed[..], &RENAME, more].concat())
    };
    let text = sample("a", &["--samples", "3000", "--threads", "1"]);
    assert!(text.contains("cut-in distribution: distributions of ego_speed_kmh"), "{text}");
    assert!(!text.contains("kernels"), "{text}");
    sample("b", &["--samples", "3000", "--threads", "2"]);
    for name in ["estimates.csv", "worst.csv", "convergence.csv", "distribution.json"] {
        let read = |folder: &str| std::fs::read(root.join(folder).join(name)).unwrap();
        assert_eq!(read("a"), read("b"), "{name}");
    }
    // The file's own number and seed are the defaults.
    sample("c", &["--models", "FSM"]);
    let record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(root.join("c/estimate.json")).unwrap()).unwrap();
    assert_eq!((record["samples"].as_u64(), record["seed"].as_u64()), (Some(20_000), Some(157)));
    // The worst lane of the table is the lane that runs again.
    let worst = std::fs::read_to_string(root.join("a/worst.csv")).unwrap();
    let mut rows = csv::Reader::from_reader(worst.as_bytes());
    let header = rows.headers().unwrap().clone();
    let row = rows.records().next().unwrap().unwrap();
    let value = |name: &str| row.get(header.iter().position(|h| h == name).unwrap()).unwrap().to_owned();
    let series = good(root, &["simulate", "--from", "a", "--lane", &value("lane")]);
    let first = series.lines().nth(1).unwrap();
    let speed: f64 = first.split(',').nth(2).unwrap().parse().unwrap();
    assert!((speed - value("ego_speed_kmh").parse::<f64>().unwrap() / 3.6).abs() < 1e-5);
    let listed = good(root, &["export", "xosc", "--from", "a", "--worst", "1", "--models", "FSM", "--out", "x"]);
    assert_eq!(listed.lines().count(), 1);
    // Headways by flag where the file has no distance, other values by --set.
    let text = std::fs::read_to_string(file).unwrap();
    let (before, after) = text.split_once("      <StochasticDistribution parameterName=\"gap_m\">").unwrap();
    let after = after.split_once("</StochasticDistribution>\n").unwrap().1;
    std::fs::write(root.join("no-gap.xosc"), format!("{before}{after}")).unwrap();
    let more = ["--samples", "500", "--thw", "1.2,0.4", "--set", "width_m=2.2", "--out", "d", "--backend", "cpu"];
    let args = [&["sample", "--distribution", "no-gap.xosc", "--category", "cut-in"][..], &RENAME, &more].concat();
    assert!(good(root, &args).contains("P is the mean over 1.2s, 0.4s"));
}

#[test]
fn a_deterministic_file_becomes_the_map_of_the_same_flags() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    let file = example("cut-in-deterministic.xosc");
    let by_file = ["map", "cut-in", "--distribution", file.to_str().unwrap(), "--backend", "cpu", "--out", "a"];
    good(root, &[&by_file[..], &RENAME].concat());
    let by_flags = |panel: [&'static str; 4], out: &'static str| {
        let fixed = ["map", "cut-in", "--x", "gap_m=5..60/5", "--y", "lateral_speed_mps=0.5,1,1.5", "--backend", "cpu"];
        good(root, &[&fixed[..], &panel, &["--out", out]].concat());
        let cells = std::fs::read_to_string(root.join(out).join("cells.csv")).unwrap();
        cells.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    let first = by_flags(["--set", "ego_speed_kmh=60", "--set", "other_speed_kmh=30"], "b");
    let second = by_flags(["--set", "ego_speed_kmh=120", "--set", "other_speed_kmh=80"], "c");
    let cells = std::fs::read_to_string(root.join("a/cells.csv")).unwrap();
    let cells: Vec<&str> = cells.lines().skip(1).collect();
    assert_eq!(cells.len(), first.len() + second.len());
    // The verdicts are at the end of a row, whatever stands before.
    let end = |line: &str| line.rsplitn(4, ',').take(3).map(str::to_owned).collect::<Vec<_>>();
    let mut theirs: Vec<_> = cells.iter().map(|l| end(l)).collect();
    let mut ours: Vec<_> = first.iter().chain(&second).map(|l| end(l)).collect();
    theirs.sort();
    ours.sort();
    assert_eq!(theirs, ours);
    let x = ["--x", "lateral_speed_mps", "--y", "gap_m", "--models", "RSS"];
    good(root, &[&by_file[..], &RENAME, &x].concat());
    let says = said(root, &[&by_file[..], &RENAME, &["--x", "thw_s"]].concat());
    assert!(says.contains("the file has no separate distribution of `thw_s`"), "{says}");
}

#[test]
fn what_is_not_understood_is_named_with_line_and_element() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    let good_text = std::fs::read_to_string(example("cut-in-stochastic.xosc")).unwrap();
    let sample = ["sample", "--distribution", "f.xosc", "--category", "cut-in", "--samples", "100", "--out", "o"];
    let changed = |old: &str, new: &str, line: &str, says: &str| {
        assert!(good_text.contains(old), "{old}");
        std::fs::write(root.join("f.xosc"), good_text.replace(old, new)).unwrap();
        let message = said(root, &[&sample[..], &RENAME].concat());
        assert!(message.contains(says) && message.contains(line), "{new}: {message}");
    };
    changed("NormalDistribution", "NormalDistributon", "line 8", "did you mean");
    changed("variance=", "sigma=", "line 8", "there is no attribute `sigma`");
    changed(" variance=\"225\"", "", "line 8", "the attribute `variance` is missing");
    changed("\"225\"", "\"-225\"", "line 8", "at least 0");
    changed("\"225\"", "\"$v\"", "line 8", "parameters and expressions are not evaluated");
    changed("lowerLimit=\"60\"", "lowerLimit=\"160\"", "line 9", "above the upper limit");
    changed("lowerLimit=\"15\"", "lowerLimit=\"12\"", "line 22", "begins before the one above it ends");
    changed("weight=\"0.3\"", "weight=\"many\"", "line 29", "write a number");
    changed("\"Other_Speed_kph\"", "\"Ego_Speed_kph\"", "line 12", "has a distribution already, in line 7");
    changed("numberOfTestRuns=\"20000\"", "numberOfTestRuns=\"0\"", "line 6", "whole number of at least 1");
    changed("randomSeed=\"157\"", "randomSeed=\"often\"", "line 6", "write a number");
    changed("revMinor=\"2\"", "revMinor=\"9\"", "line 3", "revision 1.9");
    changed("revMajor=\"1\"", "revMajor=\"2\"", "line 3", "revision 2.2");
    changed(
        "PoissonDistribution expectedValue=\"0.5\"",
        "PoissonDistribution expectedValue=\"1e9\"",
        "line 35",
        "at most",
    );
    changed("</ParameterValueDistribution>", "", "line", "not well-formed");
    changed("<OpenSCENARIO>", "<!DOCTYPE a [<!ENTITY b \"c\">]>\n<OpenSCENARIO>", "line 2", "document type");
    changed("Ego_Speed_kph\"", "&b;\"", "line 7", "unknown entity reference 'b'");
    let foreign = |value: &str| format!("<NormalDistribution xmlns:o=\"o\" {value}=\"9\" expectedValue");
    changed(
        "<NormalDistribution expectedValue",
        &foreign("o:variance"),
        "line 8",
        "there is no attribute `o:variance`",
    );
    changed("<NormalDistribution expectedValue", &foreign("p:variance"), "line 8", "unknown namespace prefix 'p'");
    let says = |args: &[&str], says: &str| {
        let message = said(root, args);
        assert!(message.contains(says), "{args:?}: {message}");
    };
    std::fs::write(root.join("f.xosc"), &good_text).unwrap();
    says(&sample, "--rename Ego_Speed_kph=OURS");
    says(&[&sample[..], &RENAME, &["--rename", "nobody=gap_m"]].concat(), "the file has no parameter `nobody`");
    says(&[&sample[..], &RENAME, &["--set", "thw_s=1"]].concat(), "given twice");
    says(&[&sample[..], &RENAME, &["--set", "gap_m=1"]].concat(), "say the same twice");
    says(&[&sample[..], &RENAME, &["--thw", "1"]].concat(), "the initial distance is a parameter already");
    says(&[&sample[..], &RENAME, &["--estimator", "is"]].concat(), "crude Monte Carlo");
    says(&["map", "cut-in", "--distribution", "f.xosc"], "draw from them by `sample`, with --distribution");
    let cut_out = ["sample", "--distribution", "f.xosc", "--category", "cut-out", "--out", "o"];
    says(&[&cut_out[..], &RENAME].concat(), "give it a distribution, or a value by --set ahead_gap_m=50");
    let grid = example("cut-in-deterministic.xosc");
    says(
        &["sample", "--distribution", grid.to_str().unwrap(), "--category", "cut-in"],
        "map them by `map`, with --distribution",
    );
}

#[test]
fn the_number_of_samples_and_what_cannot_be_a_case_have_limits() {
    let profile = Profile::load("paper").unwrap();
    let samples = cut_ins();
    let plan = |n| samples.plan((n, 1), &profile, &[ModelId::Fsm], &[Headway::ThwS(1.0)]).map(|_| ());
    assert!(plan(0).is_err());
    assert!(plan(1_000_001).unwrap_err().help().unwrap().contains("1000000"));
    // A deceleration never ends above the speed that it starts from.
    let text = r#"<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/><ParameterValueDistribution><ScenarioFile filepath=""/>
        <Stochastic numberOfTestRuns="5"><StochasticDistribution parameterName="ego_speed_mps"><UniformDistribution>
        <Range lowerLimit="10" upperLimit="20"/></UniformDistribution></StochasticDistribution><StochasticDistribution
        parameterName="end_speed_mps"><UniformDistribution><Range lowerLimit="LOW" upperLimit="30"/></UniformDistribution>
        </StochasticDistribution><StochasticDistribution parameterName="deceleration_mps2"><NormalDistribution
        expectedValue="3" variance="0"/></StochasticDistribution></Stochastic></ParameterValueDistribution></OpenSCENARIO>"#;
    let of = |low: &str| {
        let path = Path::new("x.xosc");
        let file = parse_distribution(&text.replace("LOW", low), path).unwrap();
        DistributionSamples::of(&file, &Names { category: Category::Lvd, renames: &[], path }, Vec::new()).unwrap()
    };
    let some = of("0");
    let tries: u32 = (0..2000).map(|index| some.draw(1, index, &profile).unwrap().tries).sum();
    // Half of the unit square's pairs are cases: one in two draws.
    assert!((3700..4300).contains(&tries), "{tries}");
    let error = of("25").draw(1, 0, &profile).unwrap_err();
    assert!(error.to_string().contains("none of 64 draws is a case"), "{error}");
}

#[test]
fn hostile_xml_is_refused_at_once() {
    let path = Path::new("x.xosc");
    let refused = |text: &str, says: &str| {
        let error = parse_distribution(text, path).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
        assert!(error.help().is_some_and(|help| !help.is_empty()));
    };
    refused(&"<a>".repeat(400_000), "never closed");
    refused(&format!("{}{}", "<a>".repeat(400_000), "</a>".repeat(400_000)), "is not `OpenSCENARIO`");
    refused(&"<a>".repeat(1_000_000), "more than 500000 elements");
    refused(&format!("<a>{}</a>", "<b/>".repeat(600_000)), "more than 500000 elements");
    refused("", "does not have a root node");
    refused("<a/><b/>", "line 1: not well-formed XML: unknown token");
    refused("<a x=\"1\" x=\"2\"/>", "attribute 'x' at 1:10 is already defined");
    refused("<a x=1/>", "expected a quote");
    refused("<a x=\"&lol;\"/>", "unknown entity reference 'lol'");
    refused("<a><b></a>", "expected 'b' tag, not 'a'");
    refused("<a>", "never closed");
    refused("<a/>text", "unknown token");
    refused("\u{feff}<a/>", "the root element is not `OpenSCENARIO`");
    refused("<OpenSCENARIO><Storyboard/></OpenSCENARIO>", "this is a scenario or a catalog");
    // Entities of its own would be declared here.
    let bomb = "<!DOCTYPE l [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]><OpenSCENARIO x=\"&b;\"/>";
    refused(bomb, "document type");
}

/// A deterministic file with the values of each parameter: numbers or texts.
fn deterministic(parameters: &[(&str, &str)]) -> String {
    let set = |(name, values): &(&str, &str)| {
        let values: String = values.split(',').map(|value| format!("<Element value=\"{value}\"/>")).collect();
        format!(
            "<DeterministicSingleParameterDistribution parameterName=\"{name}\"><DistributionSet>{values}\
             </DistributionSet></DeterministicSingleParameterDistribution>\n"
        )
    };
    in_file(&format!("<Deterministic>\n{}</Deterministic>", parameters.iter().map(set).collect::<String>()))
}

/// A stochastic file.
fn stochastic(attributes: &str, parameters: &[(&str, &str)]) -> String {
    let one = |(name, inner): &(&str, &str)| {
        format!("<StochasticDistribution parameterName=\"{name}\">{inner}</StochasticDistribution>\n")
    };
    let all: String = parameters.iter().map(one).collect();
    in_file(&format!("<Stochastic {attributes}>\n{all}</Stochastic>"))
}

fn in_file(content: &str) -> String {
    format!(
        "\u{feff}<OpenSCENARIO><FileHeader revMajor=\"1\" revMinor=\"3\"/><ParameterValueDistribution><ScenarioFile \
         filepath=\"\"/>\n{content}</ParameterValueDistribution></OpenSCENARIO>"
    )
}

fn warned(dir: &Path, args: &[&str]) -> String {
    let output = lanesweep(dir, args);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {text}");
    text
}

fn cells(dir: &Path, out: &str) -> Vec<String> {
    let cells = std::fs::read_to_string(dir.join(out).join("cells.csv")).unwrap();
    cells.lines().skip(1).map(str::to_owned).collect()
}

#[test]
fn texts_that_no_parameter_takes_are_ignored_by_name_and_the_grid_is_that_of_the_numbers() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    let numbers = [("ego_speed_kmh", "20,40,60"), ("deceleration_mps2", "4,6"), ("thw_s", "2")];
    let texts = [("Road", "straight.xodr,left.xodr"), ("Model", "car,1")];
    std::fs::write(root.join("numbers.xosc"), deterministic(&numbers)).unwrap();
    std::fs::write(root.join("texts.xosc"), deterministic(&[&texts[..], &numbers].concat())).unwrap();
    let map = |file, more: &[&str]| {
        let args = ["map", "lvd", "--distribution", file, "--models", "FSM", "--backend", "cpu", "--out", "o"];
        (warned(root, &[&args[..], more].concat()), cells(root, "o"))
    };
    let (quiet, expected) = map("numbers.xosc", &[]);
    assert!(!quiet.contains("ignored") && expected.len() == 6, "{quiet}");
    let (said_of, found) = map("texts.xosc", &[]);
    assert!(said_of.contains("texts.xosc: texts are ignored, and nothing varies with them: Road, Model"), "{said_of}");
    assert_eq!(found, expected);
    // Whoever names them is not told.
    let named = map("texts.xosc", &["--rename", "Road=none", "--rename", "Model=none"]);
    assert!(!named.0.contains("ignored") && named.1 == expected, "{}", named.0);
    // A text in place of a number that a parameter needs is no such text.
    std::fs::write(root.join("wrong.xosc"), deterministic(&[("ego_speed_kmh", "20,fast"), numbers[1], numbers[2]]))
        .unwrap();
    let refused = said(root, &["map", "lvd", "--distribution", "wrong.xosc"]);
    assert!(refused.contains("`fast` is not a number, and `ego_speed_kmh` is one"), "{refused}");
    // Sets that differ in texts alone are one set, and a set of texts is none.
    let path = Path::new("x.xosc");
    let sets = |rows: &[[(&str, &str); 2]]| {
        let assigned =
            |(name, value): &(&str, &str)| format!("<ParameterAssignment parameterRef=\"{name}\" value=\"{value}\"/>");
        let row = |row: &[(&str, &str); 2]| {
            format!("<ParameterValueSet>{}</ParameterValueSet>", row.iter().map(assigned).collect::<String>())
        };
        let text = in_file(&format!(
            "<Deterministic><DeterministicMultiParameterDistribution><ValueSetDistribution>{}</ValueSetDistribution>\
             </DeterministicMultiParameterDistribution></Deterministic>",
            rows.iter().map(row).collect::<String>()
        ));
        let file = parse_distribution(&text, path).unwrap();
        variations(&file, &Names { category: Category::Lvd, renames: &[], path }).unwrap()
    };
    let of_both = sets(&[
        [("Host", "blue"), ("thw_s", "1")],
        [("Host", "red"), ("thw_s", "1")],
        [("Host", "red"), ("thw_s", "2")],
    ]);
    assert_eq!(of_both.set_rows, [[1.0], [2.0]]);
    let of_texts = sets(&[[("Host", "blue"), ("Target", "red")], [("Host", "red"), ("Target", "blue")]]);
    assert!(of_texts.set_axes.is_empty() && of_texts.set_rows == [Vec::<f64>::new()]);
}

#[test]
fn a_relative_speed_gives_the_cases_of_the_other_vehicles_speed() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    let grid = |speed: &str| {
        let axes =
            ["map", "cut-in", "--x", "gap_m=5,10,20", "--y", "lateral_speed_mps=0.5,1", "--set", "ego_speed_kmh=60"];
        warned(root, &[&axes[..], &["--panel", speed, "--backend", "cpu", "--out", "o"]].concat());
        cells(root, "o")
            .iter()
            .map(|row| row.rsplitn(4, ',').take(3).map(str::to_owned).collect::<Vec<_>>())
            .collect::<Vec<_>>()
    };
    assert_eq!(grid("relative_speed_kmh=-40,-20"), grid("other_speed_kmh=20,40"));
    let twice = said(
        root,
        &[
            "map",
            "cut-in",
            "--x",
            "gap_m=5,10",
            "--y",
            "relative_speed_kmh=-20,-10",
            "--set",
            "ego_speed_kmh=60",
            "--set",
            "other_speed_mps=5",
            "--set",
            "lateral_speed_mps=1",
        ],
    );
    assert!(twice.contains("say the same twice"), "{twice}");
    // As in a file of closing speeds, whose panels without a case are left out by name.
    let values =
        [("Ego", "20,40"), ("Closing", "10,30"), ("gap_m", "5,10"), ("lateral_speed_mps", "0.5,1"), ("Lane", "1,-1")];
    std::fs::write(root.join("f.xosc"), deterministic(&values)).unwrap();
    let renames =
        ["--rename", "Ego=ego_speed_kmh", "--rename", "Closing=relative_speed_kmh*-1", "--rename", "Lane=none"];
    let map = ["map", "cut-in", "--distribution", "f.xosc", "--models", "FSM", "--backend", "cpu", "--out", "p"];
    let text = warned(root, &[&map[..], &renames].concat());
    let left = "1 of 4 panels are left out: the other vehicle would drive backwards, first at ego_speed_kmh=20, \
                relative_speed_kmh=-30";
    assert!(text.contains(left), "{text}");
    assert_eq!(cells(root, "p").len(), 3 * 4);
    let as_axes = [&map[..], &renames, &["--x", "ego_speed_kmh", "--y", "relative_speed_kmh"]].concat();
    let refused = said(root, &as_axes);
    assert!(refused.contains("drive backwards") && refused.contains("--x and --y"), "{refused}");
}

#[test]
fn a_seed_is_any_number_and_each_gives_its_own_draws() {
    let path = Path::new("x.xosc");
    let of = |seed: &str| {
        let text = stochastic(
            &format!("numberOfTestRuns=\"3\" randomSeed=\"{seed}\""),
            &[
                ("ego_speed_mps", "<NormalDistribution expectedValue=\"25\" variance=\"9\"/>"),
                ("deceleration_mps2", "<NormalDistribution expectedValue=\"3\" variance=\"0\"/>"),
                (
                    "Model",
                    "<ProbabilityDistributionSet><Element value=\"car\" weight=\"1\"/></ProbabilityDistributionSet>",
                ),
            ],
        );
        let file = parse_distribution(&text, path).unwrap();
        let samples =
            DistributionSamples::of(&file, &Names { category: Category::Lvd, renames: &[], path }, Vec::new());
        let samples = samples.unwrap();
        assert!(samples.ignored_texts.as_ref().unwrap().ends_with(": Model"));
        let seed = samples.seed.unwrap();
        (seed, samples.draw(seed, 0, &Profile::load("paper").unwrap()).unwrap().values)
    };
    assert_eq!(of("157").0, 157);
    assert_eq!(of("0.5").0, 0.5_f64.to_bits());
    let drawn: Vec<Vec<f64>> = ["157", "0.5", "-7", "7", "0"].map(|seed| of(seed).1).to_vec();
    assert!((1..5).all(|at| !drawn[..at].contains(&drawn[at])), "{drawn:?}");
    assert_eq!(of("-7").1, drawn[2]);
}

#[test]
fn a_log_normal_distribution_has_the_moments_of_its_logarithm() {
    let path = Path::new("x.xosc");
    let text = |inner: &str| {
        stochastic(
            "numberOfTestRuns=\"3\"",
            &[
                ("ego_speed_mps", inner),
                ("deceleration_mps2", "<NormalDistribution expectedValue=\"3\" variance=\"0\"/>"),
            ],
        )
    };
    let user = |kind: &str, content: &str| {
        text(&format!("<UserDefinedDistribution type=\"{kind}\">{content}</UserDefinedDistribution>"))
    };
    let file = parse_distribution(&user("log-normal", "\n mu=3.2, sigma=0.3\n"), path).unwrap();
    let samples =
        DistributionSamples::of(&file, &Names { category: Category::Lvd, renames: &[], path }, Vec::new()).unwrap();
    let profile = Profile::load("paper").unwrap();
    let n = 20_000;
    let logs: Vec<f64> = (0..n).map(|index| samples.draw(1, index, &profile).unwrap().values[0].ln()).collect();
    let mean = logs.iter().sum::<f64>() / n as f64;
    let deviation = (logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / n as f64).sqrt();
    assert!((mean - 3.2).abs() < 0.01 && (deviation - 0.3).abs() < 0.01, "{mean} {deviation}");
    for (text, says) in [
        (user("lognormal", "mu=3.2 sigma=0.3"), "type `lognormal` is not known"),
        (user("log-normal", "mu=3.2"), "does not give mu and sigma"),
        (user("log-normal", "mu=3.2 sigma=-1"), "does not give mu and sigma"),
        (user("log-normal", "mu=3.2 sigma=0.3 min=1"), "does not give mu and sigma"),
        (
            text("<LogNormalDistribution expectedValue=\"24\" variance=\"9\"/>"),
            "moments of the value or of its logarithm",
        ),
    ] {
        let error = parse_distribution(&text, path).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
        assert!(error.help().unwrap().contains("mu=3.2 sigma=0.4"));
    }
}

#[test]
fn a_range_that_keeps_nearly_nothing_of_its_distribution_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path();
    let sample = |range: &str| {
        let normal = |inner: &str| {
            format!("<NormalDistribution expectedValue=\"90\" variance=\"25\">{inner}</NormalDistribution>")
        };
        let fixed = "<NormalDistribution expectedValue=\"3\" variance=\"0\"/>";
        let text =
            stochastic("numberOfTestRuns=\"200\"", &[("ego_speed_kmh", &normal(range)), ("deceleration_mps2", fixed)]);
        std::fs::write(root.join("f.xosc"), text).unwrap();
        warned(root, &["sample", "--distribution", "f.xosc", "--category", "lvd", "--models", "FSM", "--thw", "1"])
    };
    // 90 km/h with a range in m/s keeps 10⁻²³.
    let text = sample("<Range lowerLimit=\"20\" upperLimit=\"40\"/>");
    assert!(text.contains("the Range of ego_speed_kmh keeps") && text.contains("check the units"), "{text}");
    for range in ["", "<Range lowerLimit=\"80\" upperLimit=\"130\"/>", "<Range lowerLimit=\"100\" upperLimit=\"130\"/>"]
    {
        let text = sample(range);
        assert!(!text.contains("keeps"), "{text}");
    }
}
