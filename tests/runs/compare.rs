//! `lanesweep compare`: rates of failure of S, S' and densities.

use std::collections::HashMap;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use lanesweep::engine::{CpuBackend, Executor, Headway, LanePlan, Partial, Wanted};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{
    Estimator, SampleHeadways, SampleOptions, ScenarioCounts, kernel_scenarios, plan_points, plan_samples,
    sample_by_scenario,
};
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::scenario::Category;
use lanesweep::scenario::DataProvenance;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::stats::density::{DensityModel, FitOptions, Kde};
use lanesweep::traffic::mining::{MiningOptions, mine_generated};
use lanesweep::traffic::trajectory::generator::GeneratorOptions;

const SMALL: [&str; 4] = ["--synth-recordings", "3", "--config", "generator.duration_s=200"];

fn lanesweep(args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lanesweep"));
    command.env("NO_COLOR", "1").args(args).output().unwrap()
}

fn stderr(output: &Output) -> String {
    // The drawing breaks long lines.
    String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ")
}

fn succeeds(args: &[&str]) -> String {
    let output = lanesweep(args);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Rows of a CSV file, each by the names of its columns.
fn rows(path: &Path) -> Vec<HashMap<String, String>> {
    csv::Reader::from_path(path).unwrap().deserialize().map(|row| row.unwrap()).collect()
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("`{column}` is `{}`", row[column]))
}

#[test]
fn rates_are_those_of_study_and_of_fit_and_sample() {
    let dir = tempfile::tempdir().unwrap();
    let [compared, study, fit, sample] = ["compared", "study", "fit.json", "sample"].map(|n| dir.path().join(n));
    let wanted = ["--parameterizations", "1,6,i", "--samples", "800", "--backend", "cpu"];
    let args = [&["-q", "compare", "--out", text(&compared)], &wanted[..], &SMALL[..]].concat();
    let printed = succeeds(&args);
    // S' is replayed as densities are made.
    let mirrored = ["--config", "parameterization.svd_lateral=mirrored"];
    succeeds(&[&["-q", "study", "--backend", "cpu", "--out", text(&study)], &mirrored[..], &SMALL[..]].concat());
    let failures = rows(&study.join("failures.csv"));
    let scores = rows(&study.join("f1.csv"));
    let cells = rows(&compared.join("compare.csv"));
    assert_eq!(cells.len(), 3 * 3 * lanesweep::model::driver::MODELS);
    let share = |cell: &HashMap<String, String>, variant: &str| {
        let is_cell = |row: &&HashMap<String, String>| {
            ["category", "model", "criterion"].iter().all(|c| row[*c] == cell[*c]) && row["variant"] == variant
        };
        let row = failures.iter().find(is_cell).unwrap();
        number(row, "failures") / number(row, "simulations")
    };
    for cell in &cells {
        let key = &cell["parameterization"];
        assert_eq!(number(cell, "s_rate"), share(cell, "S"), "{cell:?}");
        assert_eq!(number(cell, "s_prime_rate"), share(cell, key), "{cell:?}");
        let same = |row: &&HashMap<String, String>| {
            ["category", "parameterization", "model", "criterion"].iter().all(|c| row[*c] == cell[*c])
        };
        assert_eq!(cell["f1"], scores.iter().find(same).unwrap()["f1"]);
        assert!(number(cell, "s_low") <= number(cell, "s_rate") && number(cell, "s_rate") <= number(cell, "s_high"));
        assert!(number(cell, "s_per_1000_km") >= 0.0 && cell["data"].contains("SYNTHETIC"));
    }
    succeeds(&[&["-q", "fit", "--parameterizations", "i", "--out", text(&fit)], &SMALL[..]].concat());
    succeeds(&["-q", "sample", text(&fit), "--samples", "800", "--backend", "cpu", "--out", text(&sample)]);
    let estimates = rows(&sample.join("estimates.csv"));
    for cell in cells.iter().filter(|cell| cell["parameterization"] == "i") {
        let is_cell = |row: &&HashMap<String, String>| {
            row["headway"] == "all" && ["model", "criterion"].iter().all(|c| row[*c] == cell[*c])
        };
        let estimate = estimates.iter().find(is_cell).unwrap();
        for (ours, theirs) in [
            ("density_rate", "probability"),
            ("density_low", "draws_low"),
            ("density_high", "draws_high"),
            ("density_per_hour", "risk_per_hour"),
        ] {
            assert_eq!(cell[ours], estimate[theirs], "{ours}");
        }
    }
    assert_eq!(printed, std::fs::read_to_string(compared.join("compare.txt")).unwrap());
    assert!(printed.starts_with("SYNTHETIC DATA") && printed.contains("no number above is a statement"));
    for line in printed.lines() {
        assert!(line.chars().count() <= 120, "{} columns: {line}", line.chars().count());
    }
}

#[test]
fn results_do_not_depend_on_threads_and_do_on_the_seed() {
    let dir = tempfile::tempdir().unwrap();
    let run = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let args = ["-q", "compare", "--parameterizations", "2,7", "--samples", "3000", "--backend", "cpu"];
        let narrow = ["--models", "FSM,CCHDM", "--thw", "1.2,0.4", "--out", text(&out)];
        succeeds(&[&args, &narrow[..], &SMALL[..], more].concat());
        let json = std::fs::read_to_string(out.join("compare.json")).unwrap();
        let mut json: serde_json::Value = serde_json::from_str(&json).unwrap();
        for of_command in ["host", "settings"] {
            json.as_object_mut().unwrap().remove(of_command).unwrap();
        }
        (std::fs::read_to_string(out.join("compare.csv")).unwrap(), json)
    };
    let one = run("one", &["--threads", "1"]);
    let three = run("three", &["--threads", "3"]);
    assert!(one == three);
    let other = run("other", &["--seed", "158"]);
    assert!(other.0 != one.0 && other.1["scenarios_sha256"] == one.1["scenarios_sha256"]);
}

/// Verdicts of every unit of a plan of one variant, as failures per cell and unit.
fn failures(plan: &LanePlan) -> Vec<Vec<u64>> {
    let (models, per_unit) = (plan.models.len(), plan.headways.len() * plan.models.len());
    let mut counted = vec![Vec::new(); models * Criterion::ALL.len()];
    let cpu = CpuBackend::lane_arithmetic();
    Executor::new(&cpu)
        .sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
            for lanes in chunk.verdicts.chunks_exact(per_unit) {
                for (cell, list) in counted.iter_mut().enumerate() {
                    let (model, criterion) = (cell / Criterion::ALL.len(), Criterion::ALL[cell % Criterion::ALL.len()]);
                    let failed = |at: &usize| at % models == model && lanes[*at].failed(criterion);
                    list.push((0..per_unit).filter(failed).count() as u64);
                }
            }
            Ok(())
        })
        .unwrap();
    counted
}

#[test]
fn with_the_bandwidth_a_density_tends_to_the_replays_of_its_scenarios() {
    let generator = GeneratorOptions { recordings: 8, duration_s: 200.0, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios;
    let profile = Profile::load("paper").unwrap();
    let headways = vec![Headway::ThwS(1.4), Headway::ThwS(0.8), Headway::ThwS(0.4)];
    let options = StudyOptions { headways: headways.clone(), ..StudyOptions::default() };
    let study = plan_study(&scenarios, &profile, &options).unwrap();
    let cpu = CpuBackend::lane_arithmetic();
    let mut partial = Partial::empty(&study);
    Executor::new(&cpu)
        .sweep(&study, 0..study.unit_count(), Wanted::Verdicts, |chunk| {
            let before = std::mem::replace(&mut partial, Partial::empty(&study));
            partial = before.merge(Partial::from_chunk(&study, &chunk)?)?;
            Ok(())
        })
        .unwrap();
    for (category, key) in [(Category::CutIn, "2"), (Category::CutIn, "6"), (Category::Lvd, "i")] {
        let id = Parameterization::find(category, key).unwrap();
        let facts = DataProvenance {
            data: "synthetic".to_owned(),
            synthetic: true,
            scenarios_sha256: String::new(),
            driven: None,
        };
        let fit = FitOptions { representativeness: false, valid_draws: 1000, ..FitOptions::default() };
        let density = DensityModel::fit(id, &scenarios, &facts, &fit).unwrap().model;
        let kernels = kernel_scenarios(&density, &scenarios).unwrap();
        let block = study.blocks.iter().position(|b| b.category == category).unwrap();
        let variant = study.blocks[block].variants.iter().position(|v| v == key).unwrap();
        let replayed = ScenarioCounts::of_variant(&study, &partial, block, variant).unwrap();
        let each = SampleHeadways::Each(headways.clone());

        // The same points with mean sizes: what the limit is, lane for lane.
        let points = density.kde.points().to_vec();
        let centres = failures(&plan_points(&density, &points, &profile, &ModelId::ALL, &each).unwrap());
        let (mut different, mut lanes) = (0, 0);
        for (cell, list) in centres.iter().enumerate() {
            for (kernel, &scenario) in kernels.iter().enumerate() {
                different += list[kernel].abs_diff(replayed.failures[cell][scenario]);
                lanes += headways.len() as u64;
            }
        }
        // Sizes alone part them: few lanes stand so near a threshold.
        println!("{key}: {different} of {lanes} verdicts differ between own and mean sizes");
        assert!(different * 50 < lanes, "{key}: {different} of {lanes}");

        let distance = |factor: f64| {
            let mut bandwidth = *density.kde.bandwidth();
            bandwidth.value *= factor;
            let kde = Kde::from_parts(points.clone(), density.kde.scale().to_vec(), bandwidth).unwrap();
            let narrow = DensityModel { kde, ..density.clone() };
            let options = SampleOptions { seed: 7, ..SampleOptions::new(Estimator::CRUDE, 4000, each.clone()) };
            let plan = plan_samples(&narrow, &narrow.mixture().unwrap(), &profile, &options).unwrap();
            let executor = Executor::new(&cpu);
            let units = replayed.lanes.len();
            let sampled = sample_by_scenario(&plan, &kernels, units, &executor, None, 0.95).unwrap();
            // Samples by scenario add up to the estimate.
            for (cell, row) in sampled.rows.iter().enumerate() {
                assert_eq!(sampled.counts.cell(cell).rate(), row.estimate.probability);
                assert_eq!(sampled.counts.cell(cell).failed(), row.estimate.failures);
            }
            let mut sum = 0.0;
            for (cell, list) in centres.iter().enumerate() {
                for (kernel, &scenario) in kernels.iter().enumerate() {
                    let drawn = sampled.counts.lanes[scenario];
                    let failed = sampled.counts.failures[cell][scenario];
                    if drawn > 0 {
                        let share = failed as f64 / drawn as f64;
                        sum += (share - list[kernel] as f64 / headways.len() as f64).abs();
                    }
                }
            }
            sum
        };
        let [wide, narrow, narrower, none] = [1.0, 0.1, 1e-2, 1e-9].map(distance);
        println!("{key}: distances {wide} {narrow} {narrower} {none}");
        assert!(wide > narrow && narrow > narrower, "{key}: {wide} {narrow} {narrower}");
        assert_eq!(none, 0.0, "{key}: every sample is its scenario");
    }
}

#[test]
fn wrong_words_and_sets_that_tell_nothing_are_answered_with_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    let [none, input, out] = ["none.jsonl", "compare.csv", "out"].map(|n| dir.path().join(n));
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/paper_sumo_01_02_scenarios.jsonl");
    let mut scenarios = lanesweep::scenario::read_scenarios(&golden).unwrap();
    scenarios.iter_mut().for_each(|s| s.kept = false);
    lanesweep::scenario::write_scenarios(&none, &scenarios).unwrap();
    std::fs::copy(&golden, &input).unwrap();
    let cases: [(&[&str], i32, &str); 8] = [
        (&["--parameterizations", "9"], 2, "there is no parameterization `9`"),
        (&["--categories", "lvd", "--parameterizations", "2"], 2, "of LVD"),
        (&["--categories", "lane-change"], 2, "use cut-in, cut-out, lvd"),
        (&["--samples", "0"], 2, "--samples: `0` cannot be used"),
        (&["--models", "Nobody"], 2, "there is no driver model `Nobody`"),
        (&["--thw", "sampled"], 2, "with commas, `r157`, `paper` or `observed`"),
        (&["--scenarios", text(&none)], 3, "no scenario to simulate"),
        (&["--scenarios", text(&input), "--out", text(dir.path())], 2, "would be overwritten"),
    ];
    for (args, code, hint) in cases {
        // A case with an --out of its own keeps it.
        let into: &[&str] = if args.contains(&"--out") { &[] } else { &["--out", text(&out)] };
        let output = lanesweep(&[&["compare", "--backend", "cpu"], args, into].concat());
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(hint) && !said.contains("panicked"), "{args:?} should say `{hint}`: {said}");
        assert!(output.stdout.is_empty() && !out.exists(), "{args:?}: nothing may be written");
    }
    // Too few for a decomposition: the rest is compared, and the exit status says that something is missing.
    let few = dir.path().join("few.jsonl");
    scenarios.retain(|s| s.category == Category::Lvd);
    scenarios.iter_mut().for_each(|s| s.kept = true);
    lanesweep::scenario::write_scenarios(&few, &scenarios).unwrap();
    let args = ["compare", "--backend", "cpu", "--scenarios", text(&few), "--samples", "200", "--out", text(&out)];
    let some = lanesweep(&[&args, &["--parameterizations", "i,v"][..]].concat());
    assert_eq!(some.status.code(), Some(4), "{}", stderr(&some));
    assert!(stderr(&some).contains("too few for a decomposition"), "{}", stderr(&some));
    let printed = String::from_utf8(some.stdout).unwrap();
    assert!(printed.contains("| i density") && printed.contains("left out:"), "{printed}");
    assert!(!printed.contains("S /h   "), "what was driven is unknown: {printed}");
    let help = succeeds(&["compare", "--help"]);
    assert!(help.starts_with("Which parameterizations give the right risk") && help.contains("Examples:"), "{help}");
}

#[test]
fn every_form_of_a_density_is_sampled_and_the_parts_of_the_uncertainty_sum_to_one() {
    let dir = tempfile::tempdir().unwrap();
    let [out, alone, density] = ["compared", "sampled", "density.json"].map(|name| dir.path().join(name));
    let wanted =
        ["--parameterizations", "i,iii", "--thw", "0.6", "--models", "FSM", "--samples", "3000", "--backend", "cpu"];
    let printed = succeeds(&[&["-q", "compare", "--forms", "--out", text(&out)], &wanted[..], &SMALL[..]].concat());
    assert!(printed.contains("unseen scenarios") && printed.contains("risk uncertain by"), "{printed}");
    let record: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("compare.json")).unwrap()).unwrap();
    let category = &record["categories"][0];
    let parts = ["draws", "scenarios", "exposure", "form", "parameterization"];
    let known: Vec<_> = category["uncertainty"].as_array().unwrap().iter().filter(|of| !of.is_null()).collect();
    assert!(!known.is_empty());
    for of in known {
        let sum: f64 = parts.iter().map(|part| of[part].as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{of}");
    }
    // The same density, fitted and sampled by the other verbs, has the same rate.
    let fit = ["-q", "fit", "--parameterizations", "i", "--density", "copula", "--out", text(&density)];
    succeeds(&[&fit[..], &SMALL[..]].concat());
    let sample = ["-q", "sample", text(&density), "--models", "FSM", "--thw", "0.6", "--samples", "3000"];
    succeeds(&[&sample[..], &["--backend", "cpu", "--out", text(&alone)]].concat());
    let cells = rows(&out.join("compare.csv"));
    for row in rows(&alone.join("estimates.csv")) {
        let is_same =
            |cell: &&HashMap<String, String>| cell["parameterization"] == "i" && cell["criterion"] == row["criterion"];
        let cell = cells.iter().find(is_same).unwrap();
        assert_eq!(number(cell, "copula_rate"), number(&row, "probability"), "{}", row["criterion"]);
    }
}
