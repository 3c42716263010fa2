//! What a study prints fits in the terminal: the answer in 24 lines of 80 columns, every table in its width, however many
//! variants there are.

use std::path::Path;

use crate::common::golden;
use crate::common::plans::{chunk, mixed, plan};
use assert_cmd::Command;
use lanesweep::engine::{Partial, Verdicts};
use lanesweep::report::tables;
use lanesweep::run::score::{ClaimVerdict, ScoreOptions, check_claims, score};
use lanesweep::scenario::Category;

fn assert_fits(text: &str, width: usize) {
    for line in text.lines() {
        assert!(line.chars().count() <= width, "{} columns: {line}", line.chars().count());
        assert_eq!(line.matches('[').count(), line.matches(']').count(), "an interval on two lines: {line}");
    }
}

/// stdout and stderr.
fn study(dir: &Path, columns: &str, args: &[&str]) -> (String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lanesweep"));
    let command = command.current_dir(dir).env("NO_COLOR", "1").env("COLUMNS", columns);
    let output = command.arg("study").args(["--backend", "cpu"]).args(args).output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{err}");
    (out, err)
}

const GENERATED: [&str; 4] = ["--synth-recordings", "2", "--config", "generator.duration_s=120"];

#[test]
fn seven_variants_with_intervals_and_large_counts_fit() {
    let variants = ["1", "2", "3", "4", "5", "6", "7"];
    let letters = ["a", "b", "c", "d", "e", "f", "g"];
    let plan = plan(&[
        (Category::CutIn, 1200, &variants),
        (Category::CutOut, 40, &letters),
        (Category::Lvd, 40, &["i", "ii", "iii", "iv", "v"]),
    ]);
    let lane = |lane: u64| (Verdicts((mixed(3, lane) & 0xf) as u8), 1.0);
    let partial = Partial::from_chunk(&plan, &chunk(&plan, 0..plan.unit_count(), &lane, false)).unwrap();
    let table = score(&plan, &partial, &ScoreOptions::default()).unwrap();
    let claims = check_claims(&table, &plan, &partial);
    assert!(claims.iter().any(|c| c.verdict != ClaimVerdict::NotRun));
    for width in [60, 80, 100, 120] {
        for published in [false, true] {
            assert_fits(&tables::failures(&table, published, width), width);
            for category in &table.categories {
                let text = tables::f1_table(category, published, width);
                assert_fits(&text, width);
                assert!(category.variants.iter().all(|name| text.contains(&format!(" {name} "))), "{text}");
            }
        }
        let text = tables::claims(&claims, width);
        assert_fits(&text, width);
        assert!(claims.iter().all(|c| text.contains(c.claim.id)), "no claim is cut short: {text}");
    }
}

#[test]
fn the_tables_of_a_study_take_the_width_of_the_terminal() {
    let dir = tempfile::tempdir().unwrap();
    for (columns, width) in [("80", 80), ("120", 120), ("", 120)] {
        let (out, _) = study(dir.path(), columns, &[&GENERATED[..], &["--tables", "--published"]].concat());
        assert_fits(&out, width);
        assert!(out.contains("F1 of S' against S") && out.contains("published, %"));
    }
    let file = std::fs::read_to_string(dir.path().join("lanesweep-out/report.txt")).unwrap();
    assert_eq!(study(dir.path(), "120", &[&GENERATED[..], &["--tables"]].concat()).0, file, "120 columns in the file");
}

#[test]
fn a_study_answers_on_one_screen() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(golden("paper_sumo_01_02_scenarios.jsonl"), dir.path().join("recorded.jsonl")).unwrap();
    let recorded = ["--scenarios", "recorded.jsonl"];
    let one = ["--categories", "cut-in", "--models", "FSM"];
    for args in [&GENERATED[..], &recorded[..], &[&GENERATED[..], &one[..]].concat()] {
        let (out, err) = study(dir.path(), "80", args);
        assert_fits(&out, 80);
        let on_screen = |text: &str| text.lines().filter(|line| !line.starts_with(" WARN")).count();
        assert!(on_screen(&out) + on_screen(&err) <= 24, "{err}{out}");
        for said in ["hides", "not told apart", "needs", "--tables", "FSM"] {
            assert!(out.contains(said), "{said}: {out}");
        }
        assert!(err.contains("report.html"), "where the page is: {err}");
    }
    assert_fits(&study(dir.path(), "50", &GENERATED).0, 50);
}

#[test]
fn a_study_of_one_category_or_model_prints_no_claims_that_it_could_not_compute() {
    let dir = tempfile::tempdir().unwrap();
    let tables = |args: &[&str]| study(dir.path(), "120", &[&GENERATED[..], &["--tables"], args].concat()).0;
    let page = || std::fs::read_to_string(dir.path().join("lanesweep-out/report.html")).unwrap();
    let of_one_model = tables(&["--models", "FSM"]);
    assert!(!of_one_model.contains("claim") && !page().contains("claims on this data"), "{of_one_model}");
    let of_one_category = tables(&["--categories", "lvd"]);
    assert!(of_one_category.contains("LVD failures") && !of_one_category.contains("cut-in"), "{of_one_category}");
    for text in [of_one_model, of_one_category, page()] {
        assert!(!text.contains("not computed"), "{text}");
    }
}
