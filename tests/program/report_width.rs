//! Every line of a study's tables fits in a terminal of 120 columns, however many variants there are.

use crate::common::plans::{chunk, mixed, plan};
use assert_cmd::Command;
use lanesweep::engine::{Partial, Verdicts};
use lanesweep::report::tables;
use lanesweep::run::score::{ScoreOptions, judge_claims, score};
use lanesweep::scenario::Category;

fn assert_fits(text: &str) {
    for line in text.lines() {
        assert!(line.chars().count() <= 120, "{} columns: {line}", line.chars().count());
    }
}

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
    let options = ScoreOptions { bootstrap_draws: 40, ..ScoreOptions::default() };
    let table = score(&plan, &partial, &options).unwrap();
    for published in [false, true] {
        assert_fits(&tables::failures(&table, published));
        for category in &table.categories {
            let text = tables::f1_table(category, published);
            assert_fits(&text);
            assert!(category.variants.iter().all(|name| text.contains(&format!(" {name} "))), "{text}");
        }
    }
    let claims = judge_claims(&table);
    let text = tables::claims(&claims);
    assert_fits(&text);
    assert!(claims.iter().all(|c| text.contains(c.claim.id)), "no claim is cut short: {text}");
}

#[test]
fn the_small_synthetic_study_fits() {
    for published in [&[][..], &["--published"]] {
        let out = tempfile::tempdir().unwrap();
        let study = ["-q", "study", "--synth-recordings", "2", "--synth-duration", "120", "--out"];
        let mut command = Command::new(env!("CARGO_BIN_EXE_lanesweep"));
        let output = command.env("NO_COLOR", "1").args(study).arg(out.path()).args(published).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_fits(&String::from_utf8(output.stdout).unwrap());
    }
}
