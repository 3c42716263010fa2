//! Sampling runs: the same counts and the same failing lanes however a run is cut up.

use crate::common::mined::{density_of, write_cut_in_density};
use crate::common::program::{json, ran, refused, table};
use crate::common::{self, Folder, folder, program};

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use lanesweep::engine::{Backend, SampleTally};
use lanesweep::model::driver::MODELS;
use lanesweep::prelude::*;
use lanesweep::run::sampling::{Estimator, plan_samples};
use lanesweep::scenario::Driven;
use lanesweep::stats::density::{Bandwidth, Exposure, Kde};
use lanesweep::stats::estimate::Search;

fn density(category: Category, key: &str) -> DensityModel {
    density_of(24, category, key, false)
}

fn furnished() -> Folder {
    let dir = folder();
    write_cut_in_density(&dir.join("density.json"));
    dir
}

/// The first `limit` failing rows of each model and criterion, as lines of the table, without the weights: those are known after
/// the last row.
fn first_failing(table: &str, limit: usize) -> String {
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &str| header.iter().position(|column| *column == name).unwrap();
    let (model, weight, criteria) = (at("model"), at("weight"), ["collision", "ttc", "btn"].map(at));
    let mut found = std::collections::HashMap::new();
    let mut chosen = String::new();
    for line in lines {
        let mut cells: Vec<&str> = line.split(',').collect();
        let mut is_first = false;
        for criterion in criteria.into_iter().filter(|criterion| cells[*criterion] == "1") {
            let count = found.entry((cells[model].to_owned(), criterion)).or_insert(0);
            *count += 1;
            is_first |= *count <= limit;
        }
        if is_first {
            cells.remove(weight);
            chosen += &(cells.join(",") + "\n");
        }
    }
    chosen
}

#[test]
fn a_run_in_parts_is_the_run_in_one_and_its_failing_lanes_are_the_first_of_all_rows() {
    let dir = &*furnished();
    let base = "-q sample density.json --samples 20000 --thw 0.6,0.3 --seed 9 --backend cpu";
    let whole = ran(dir, &format!("{base} --out whole --rows rows.csv --failures first.csv"));
    let _ = ["1/2", "0/2"].map(|shard| ran(dir, &format!("{base} --out joined --shard {shard}")));
    assert_eq!(ran(dir, "-q merge joined --failures joined.csv"), whole);
    ran(dir, "-q merge joined --failures seven.csv --config sample.failures_limit=7");
    if common::device::software_backend().is_some() {
        let counted = base.replace("cpu", "gpu --device llvmpipe");
        ran(dir, &format!("{counted} --failures counted.csv --out counted --config sample.failures_limit=7"));
    } else {
        std::fs::copy(dir.join("seven.csv"), dir.join("counted.csv")).unwrap();
    }
    super::parts::same(&dir.join("whole"), &dir.join("joined"));
    assert!(dir.join("joined/tables/convergence.csv").exists());
    let read = |path: &str| std::fs::read_to_string(dir.join(path)).unwrap();
    let rows = read("rows.csv");
    assert_eq!(rows.lines().count(), 1 + 20_000 * 2 * MODELS);
    let weight = rows.lines().next().unwrap().split(',').position(|name| name == "weight").unwrap();
    assert!(rows.lines().skip(1).all(|row| row.split(',').nth(weight) == Some("")));
    let course = table(&dir.join("whole/tables/convergence.csv"));
    let after: BTreeSet<u64> = course.iter().map(|row| row["samples"].parse().unwrap()).collect();
    assert_eq!(Vec::from_iter(after), [4096, 8192, 16_384, 20_000]);
    let (all, seven) = (first_failing(&rows, 1000), first_failing(&rows, 7));
    assert!(all.lines().count() > 1000 && (7..=7 * 3 * MODELS).contains(&seven.lines().count()));
    let listed = |path: &str| first_failing(&read(path), usize::MAX);
    assert!(listed("first.csv") == all && read("joined.csv") == read("first.csv"), "the first thousand");
    assert!(listed("seven.csv") == seven && read("counted.csv") == read("seven.csv"), "the first seven");
    let of = density(Category::CutIn, "2");
    // A row says how to run its lane again, and it is the same lane.
    for row in table(&dir.join("seven.csv")).iter().step_by(9) {
        let key = format!("#{}/{}/{}/{}", row["sample"], row["variant"], row["headway"], row["model"]);
        let kernel: usize = row["kernel"].parse().unwrap();
        assert_eq!((&*row["scenario"], &*row["source"]), (&*of.scenarios[kernel].id, "density"), "{key}");
        // It lies around its kernel.
        for ((parameter, middle), spread) in
            of.space.parameters().iter().zip(&of.kde.points()[kernel]).zip(of.kde.spread())
        {
            let value: f64 = row[&parameter.name].parse().unwrap();
            assert!((value - middle).abs() < 6.0 * spread, "{key}: {} is {value}", parameter.name);
        }
        let (code, trace, summary) = program::lanesweep(dir, &["simulate", "--from", "whole", "--lane", &key]);
        assert!(code == 0 && trace.starts_with("t_s,"), "{summary}");
        for (name, column) in [("Collision", "collision"), ("TTC", "ttc"), ("BTN", "btn")] {
            let word = if row[column] == "1" { "FAIL" } else { "pass" };
            assert!(summary.contains(&format!("{name} {word}")), "{key}: {summary}");
        }
    }
    refused(dir, &format!("{base} --shard 0/2 --failures x.csv"), 2, "--failures");
}

/// The vehicle that cuts out drives through the one ahead where it is still in its path when their gap is used up. Of the density's
/// draws these are counted apart; nothing has a rate per hour, as the headway is imposed.
#[test]
fn draws_of_cut_outs_that_no_traffic_has_are_counted_apart_and_imposed_headways_have_no_rate() {
    let dir = &*crate::common::folder();
    let mut density = density(Category::CutOut, "a");
    density.exposure = Some(Exposure::new(40, Driven { hours: Some(10.0), kilometres: Some(800.0) }));
    write_density(&dir.join("d.json"), &density).unwrap();
    let text = ran(dir, "-q sample d.json --samples 20000 --thw 0.6 --models FSM --rows rows.csv --backend cpu");
    let sizes = &density.sizes;
    let widths = sizes.target.width_m + sizes.lead.unwrap().width_m;
    let rows = table(&dir.join("rows.csv"));
    let mut count = [[0.0_f64; 2]; 2];
    for row in &rows {
        let [target, lead, across, gap] = ["v_target_mps", "v_lead_mps", "lateral_speed_mps", "gap_lead_m"]
            .map(|name| row[name].parse::<f64>().unwrap());
        let is_possible = gap - (target - lead) * (widths / 2.0 / across) >= 0.0;
        count[usize::from(is_possible)][usize::from(row["collision"] == "1")] += 1.0;
    }
    let [fraction, possible] =
        [(count[0][0] + count[0][1]) / rows.len() as f64, count[1][1] / (count[1][0] + count[1][1])];
    let record = json(&dir.join("lanesweep-sample/estimate.json"))["estimates"][0].clone();
    let near = |key: &str, ours: f64| {
        let theirs = record["no_traffic"][key].as_f64().unwrap();
        assert!((theirs - ours).abs() < 0.01 && ours > 0.0, "{key}: {theirs} beside {ours}");
    };
    near("fraction", fraction);
    near("possible_probability", possible);
    let page = std::fs::read_to_string(dir.join("lanesweep-sample/report.html")).unwrap();
    for of in [text, page] {
        let has_rates = of.contains("per 1000 km</th") || of.contains("per hour |");
        assert!(of.contains("P possible") && !has_rates, "{of}");
    }
    let csv = table(&dir.join("lanesweep-sample/estimates.csv"));
    assert!(csv.iter().all(|row| row["risk_per_hour"].is_empty()) && record["risk"]["per_hour"].is_null());
}

fn estimates(dir: &Path, folder: &str) -> String {
    std::fs::read_to_string(dir.join(folder).join("estimates.csv")).unwrap()
}

#[test]
fn a_searched_proposal_can_be_sampled_again_and_in_shards_with_its_failing_draws() {
    let dir = &*furnished();
    let base = "-q sample density.json --thw 0.3 --models FSM --backend cpu";
    let merged = |folder: &str| {
        ran(dir, &format!("-q merge {folder} --failures {folder}.csv"));
        estimates(dir, folder)
    };
    ran(dir, &format!("{base} --samples 60000 --out mc"));
    ran(dir, &format!("{base} --estimator is --out is --failures is.csv"));
    // Every shard finds the same proposal, or reads it in the plan of another.
    let searched = |shard| ran(dir, &format!("{base} --estimator is --out searched --shard {shard}"));
    let _ = ["1/2", "0/2"].map(searched);
    assert_eq!(merged("searched"), estimates(dir, "is"));
    // The estimate after growing numbers of draws of the proposal, the same from shards; the last is that of all.
    let course = |folder: &str| table(&dir.join(folder).join("tables/convergence.csv"));
    assert_eq!(course("searched"), course("is"));
    let (all, course) = (table(&dir.join("is/estimates.csv")).remove(0), course("is"));
    assert!(course.len() > 6 && course[0]["samples"] == "64" && course[1]["samples"] == "128", "{course:?}");
    for (column, of_all) in
        [("headway", "headway"), ("probability", "probability"), ("low", "draws_low"), ("high", "draws_high")]
    {
        assert_eq!(course.last().unwrap()[column], all[of_all], "{column}");
    }
    let given = format!("{base} --estimator is --proposal is/proposal.json --samples 20000");
    ran(dir, &format!("{given} --out again --failures again.csv"));
    let _ = ["1/2", "0/2"].map(|shard| ran(dir, &format!("{given} --out given --shard {shard}")));
    assert_eq!(merged("given"), estimates(dir, "again"));
    for (whole, parts) in [("is.csv", "searched.csv"), ("again.csv", "given.csv")] {
        let rows = table(&dir.join(whole));
        assert!(rows == table(&dir.join(parts)), "{whole}");
        assert!(rows.len() == 1000 && rows.iter().all(|row| row["collision"] == "1"), "{whole}: {}", rows.len());
        assert!(rows.iter().all(|row| !row["scenario"].is_empty()), "{whole}");
    }
    let estimate = |folder: &str| json(&dir.join(folder).join("estimate.json"))["estimates"][0]["estimate"].clone();
    let truth = estimate("mc")["probability"].as_f64().unwrap();
    for folder in ["is", "again"] {
        let found = estimate(folder);
        let p = found["probability"].as_f64().unwrap();
        let error = found["coefficient_of_variation"].as_f64().unwrap();
        assert!((p / truth - 1.0).abs() < 5.0 * error + 0.05, "{folder}: {p} beside {truth}");
    }
}

#[test]
fn the_weights_of_all_failing_lanes_add_up_to_p_and_those_of_the_density_to_its_part() {
    let dir = &*furnished();
    for (out, how) in [("mc", "--samples 4000"), ("is", "--estimator is --half-width 0.3")] {
        let base = "-q sample density.json --thw 0.8,0.4 --models FSM,RSS --config sample.failures_limit=1000000";
        ran(dir, &format!("{base} {how} --failures {out}.csv --out {out} --backend cpu"));
        let rows = table(&dir.join(out).with_extension("csv"));
        let number = |row: &BTreeMap<String, String>, column: &str| row[column].parse::<f64>().unwrap();
        let course = table(&dir.join(out).join("tables/convergence.csv"));
        for estimate in table(&dir.join(out).join("estimates.csv")).iter().filter(|row| row["headway"] != "all") {
            let is_same =
                |row: &BTreeMap<String, String>| ["headway", "model"].iter().all(|of| row[*of] == estimate[*of]);
            let is_its = |row: &&BTreeMap<String, String>| is_same(row) && row["criterion"] == estimate["criterion"];
            let last = course.iter().rfind(is_its);
            assert_eq!(last.map(|row| &row["probability"]), (out == "is").then_some(&estimate["probability"]));
            let failing = rows.iter().filter(|row| is_same(row) && row[&estimate["criterion"]] == "1");
            let (mut p, mut of_density) = (0.0, 0.0);
            for row in failing {
                p += number(row, "weight");
                of_density += if row["source"] == "density" { number(row, "weight") } else { 0.0 };
            }
            assert!((p / number(estimate, "probability") - 1.0).abs() < 1e-9, "{p}: {estimate:?}");
            let fraction = if out == "is" { number(estimate, "crude_fraction") } else { 1.0 };
            assert!(fraction > 0.0 && (of_density / p - fraction).abs() < 1e-9, "{of_density}: {estimate:?}");
        }
    }
}

#[test]
fn p_at_both_ends_of_the_bandwidths_interval_is_that_of_the_density_there_by_either_estimator() {
    let (profile, cpu) = (Profile::load("paper").unwrap(), CpuBackend::lane_arithmetic());
    let row = |density: DensityModel, thw_s, estimator, samples| {
        let headways = SampleHeadways::Each(vec![Headway::ThwS(thw_s)]);
        let options = SampleOptions { models: vec![ModelId::Fsm], ..SampleOptions::new(estimator, samples, headways) };
        let rows = Sample::plan(density, &profile, &options).unwrap().run(&Executor::new(&cpu)).unwrap().rows;
        rows.into_iter().find(|row| row.criterion == Criterion::Collision).unwrap()
    };
    let density = density(Category::CutIn, "3");
    let likelihood = density.kde.bandwidth().likelihood.unwrap();
    let search = Estimator::Search(Search { crude: 1 << 20, ..Search::default() });
    let rows = [row(density.clone(), 1.2, Estimator::Crude, 200_000), row(density.clone(), 1.2, search, 10_000)];
    for (end, value) in [likelihood.low, likelihood.high].into_iter().enumerate() {
        let direct = row(density.at_bandwidth(value).unwrap(), 1.2, Estimator::Crude, 1_000_000);
        assert_eq!(direct.at_bandwidths, [None; 2]);
        for row in &rows {
            let at = row.at_bandwidths[end].unwrap();
            assert!(at.low < direct.draws[1] && at.high > direct.draws[0], "{at:?} {direct:?}");
            assert!((at.factor * density.kde.bandwidth().value / value - 1.0).abs() < 1e-12, "{at:?}");
        }
    }
    // A bandwidth that is far too wide for the likelihood is told where no kernel's middle fails.
    let of = *density.kde.bandwidth();
    let kde = Kde::from_parts(
        density.kde.points().to_vec(),
        density.kde.scale().to_vec(),
        Bandwidth { value: 2.0 * of.value, ..of },
    );
    let mut wide = density;
    wide.kde = kde.unwrap();
    let wide = row(wide, 2.0, Estimator::Crude, 200_000);
    assert_eq!(wide.estimate.trust.usable(), "bandwidth decides", "{wide:?}");
    // Where most lanes fail, they do so at any bandwidth.
    let dir = furnished();
    let said = ran(&dir, "-q sample density.json --thw 0.2 --models Reg157 --samples 3000 --backend cpu");
    assert!(said.contains("The bandwidth decides no row"), "{said}");
    for row in table(&dir.join("lanesweep-sample/estimates.csv")) {
        assert!(["probability_narrow", "probability_wide"].iter().all(|column| !row[*column].is_empty()), "{row:?}");
    }
}

/// The density over the first scenarios only, scale and bandwidth held.
fn of_few(density: &DensityModel, scenarios: usize) -> DensityModel {
    let kde = &density.kde;
    let points = kde.points()[..scenarios].to_vec();
    let kde = Kde::from_parts(points, kde.scale().to_vec(), *kde.bandwidth()).unwrap();
    let mut few = density.clone();
    (few.kde, few.scenarios) = (kde, density.scenarios[..scenarios].to_vec());
    few
}

/// A folder with the density over nine scenarios and that over all.
fn few_and_all() -> Folder {
    let dir = folder();
    write_density(&dir.join("nine.json"), &of_few(&density(Category::CutIn, "2"), 9)).unwrap();
    write_cut_in_density(&dir.join("all.json"));
    dir
}

/// The record of a run of Reg157, and what it printed.
fn estimated(dir: &Path, density: &str, more: &str) -> (serde_json::Value, String) {
    let text = ran(dir, &format!("-q sample {density} --models Reg157 --backend cpu {more}"));
    (json(&dir.join("lanesweep-sample/estimate.json")), text)
}

fn interval(row: &serde_json::Value) -> [f64; 2] {
    ["low", "high"].map(|end| row["estimate"]["interval"][end].as_f64().unwrap())
}

#[test]
fn few_scenarios_are_said_once_and_their_interval_is_that_of_other_data_too() {
    let dir = few_and_all();
    let ends = |value: &serde_json::Value| [0, 1].map(|end| value[end].as_f64().unwrap());
    for (density, is_sound) in [("nine.json", false), ("all.json", true)] {
        let (file, text) = estimated(&dir, density, "--samples 6000 --thw 1,0.4");
        for row in (0..3).map(|at| &file["estimates"][3 * at]) {
            assert_eq!(row["headway"], "all");
            let ([low, high], draws) = (interval(row), ends(&row["draws"]));
            // Scenarios tell much less than draws.
            assert!(high - low > 2.0 * (draws[1] - draws[0]), "{row}");
            let warnings = row["estimate"]["trust"]["warnings"].as_array().unwrap();
            assert_eq!(warnings.iter().all(|w| w["warning"] != "few_scenarios"), is_sound, "{row}");
        }
        assert!(text.contains("all 2") && text.contains("P is the mean over 1s, 0.4s"), "{text}");
        assert_eq!(text.contains("carried by"), !is_sound, "{text}");
        let said = text.matches("with fewer than 10, other recordings").count();
        assert_eq!(said, usize::from(!is_sound), "{text}");
    }
}

#[test]
fn draws_of_a_proposal_tell_their_scenarios_by_the_kernels_that_explain_them() {
    let dir = few_and_all();
    let crude = estimated(&dir, "all.json", "--thw 0.4 --samples 6000").0["estimates"][0].clone();
    let how = "--thw 0.4 --estimator is --samples 12000";
    let (file, text) = estimated(&dir, "all.json", how);
    let rows = file["estimates"].as_array().unwrap();
    let is_costlier = rows.iter().any(|row| row["estimate"]["variance_reduction"].as_f64().is_some_and(|r| r < 1.0));
    assert_eq!(text.contains("times the lanes that crude Monte Carlo"), is_costlier, "{text}");
    let [a, b] = [&crude, &rows[0]].map(|row| row["failing_scenarios"].as_f64().unwrap());
    assert!((0.6..1.7).contains(&(b / a)), "{b} failing scenarios beside {a}");
    let width = |row| libm::log(interval(row)[1] / interval(row)[0]);
    let ratio = width(&rows[0]) / width(&crude);
    assert!((0.6..1.7).contains(&ratio), "{ratio}");
    // The scenario that carries most is among the three that both name.
    let carriers =
        |row: &serde_json::Value| [0, 1, 2].map(|at| row["carriers"][at]["scenario"].as_str().unwrap().to_owned());
    assert!(carriers(&crude).contains(&carriers(&rows[0])[0]), "{crude} {}", rows[0]);
    let few = estimated(&dir, "nine.json", how).0["estimates"][0].clone();
    assert!(few["estimate"]["trust"]["warnings"].to_string().contains("few_scenarios"), "{few}");
}

#[test]
fn counts_join_in_any_order_and_never_twice_and_threads_do_not_change_them() {
    let headways = SampleHeadways::Each(vec![Headway::ThwS(1.0), Headway::ThwS(0.4)]);
    let profile = Profile::load("paper").unwrap();
    let plan_of = |samples| {
        let options = SampleOptions { seed: 5, ..SampleOptions::new(Estimator::Crude, samples, headways.clone()) };
        plan_samples(&density(Category::CutIn, "2"), &profile, &options).unwrap()
    };
    let (plan, other, cpu) = (plan_of(900), plan_of(901), CpuBackend::lane_arithmetic());
    let of = |plan, range: std::ops::Range<u64>| {
        SampleTally::of_chunk(plan, &cpu.prepare(plan).unwrap().run(range, Wanted::Counts).unwrap()).unwrap()
    };
    let whole = of(&plan, 0..900);
    assert!(whole.failures.iter().sum::<u64>() > 0);
    assert!(of(&plan, 700..900).merge(of(&plan, 0..1)).unwrap().merge(of(&plan, 1..700)).unwrap() == whole);
    assert!(common::with_threads(1, || of(&plan, 0..900)) == whole, "one thread");
    assert!(of(&plan, 0..100).merge(of(&other, 100..200)).is_err(), "two runs");
    let error = of(&plan, 0..100).merge(of(&plan, 99..200)).unwrap_err().to_string();
    assert!(error.contains("samples 99 to 99 are in both"), "{error}");
}
