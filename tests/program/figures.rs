//! The figures of a study show the numbers of their tables, and these are the ones that were looked at.
//!
//! `LANESWEEP_RENEW_FIGURES=1 cargo test --release --test commands figures::` writes the tables again, after a change that
//! is meant.

use std::fs;
use std::path::Path;

use crate::common::program::{ran, table as csv};

/// The figures of cut-ins whose tables are kept.
const KEPT: [&str; 3] = ["f1", "radar", "headways"];

#[derive(serde::Deserialize)]
struct Row {
    panel: String,
    row: String,
    series: String,
    x: f64,
    y: Option<f64>,
}

fn study() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    ran(dir.path(), "-q study --synth-recordings 12 --categories cut-in --thw 0.4,1.2 --backend cpu --out .");
    dir
}

fn rows(csv: &str) -> Vec<Row> {
    csv::Reader::from_reader(csv.as_bytes()).deserialize().map(Result::unwrap).collect()
}

fn number(tag: &str, key: &str) -> f64 {
    tag.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
}

/// The middles of the markers of a figure's values, px; a marker is the last shape of its group.
fn markers(svg: &str) -> Vec<f64> {
    let groups = svg.split("class=\"value\"").skip(1).map(|group| group.split("</g>").next().unwrap());
    let middle = |group: &str| {
        let shape = group.rsplit("  <").next().unwrap();
        if shape.starts_with("circle") {
            return number(shape, "cx");
        }
        let d = shape.split(" d=\"").nth(1).unwrap().split('"').next().unwrap();
        let corners = d.trim_end_matches('Z').split(['M', 'L']).map(str::trim).filter(|corner| !corner.is_empty());
        let xs: Vec<f64> = corners.map(|corner| corner.split(',').next().unwrap().parse().unwrap()).collect();
        (xs.iter().copied().fold(f64::MAX, f64::min) + xs.iter().copied().fold(f64::MIN, f64::max)) / 2.0
    };
    groups.map(middle).collect()
}

#[test]
fn every_f1_has_a_mark_at_its_value() {
    let dir = study();
    let read = |name: &str| fs::read_to_string(dir.path().join(name)).unwrap();
    let (svg, table) = (read("figures/f1-cut-in.svg"), rows(&read("tables/f1-cut-in.csv")));
    let frame = svg.split("class=\"frame\"").nth(1).unwrap();
    let (left, width) = (number(frame, "x"), number(frame, "width"));
    let drawn = markers(&svg);
    assert_eq!(drawn.len(), table.len());
    assert!(table.len() > 60);
    for (row, x) in table.iter().zip(drawn) {
        let is_there = (left + (row.x + 0.02) / 1.04 * width - x).abs() < 0.02;
        assert!(is_there, "{} {}: {} is drawn at {x}", row.row, row.series, row.x);
        assert!(row.y.is_none() && !row.row.is_empty() && row.panel.is_empty());
    }
    // The same scores as in the table of the study.
    let results = csv(&dir.path().join("results.csv"));
    let judged = results.iter().filter(|row| row["fit"] != "in sample");
    let mut all: Vec<f64> = judged.filter_map(|row| row["f1"].parse().ok()).collect();
    let mut shown: Vec<f64> = table.iter().map(|row| row.x).collect();
    all.sort_by(f64::total_cmp);
    shown.sort_by(f64::total_cmp);
    assert!(all.len() == shown.len() && all.iter().zip(&shown).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn the_tables_of_the_figures_are_those_that_were_looked_at() {
    let dir = study();
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/figures");
    for figure in KEPT {
        let name = format!("{figure}-cut-in.csv");
        let now = fs::read_to_string(dir.path().join("tables").join(&name)).unwrap();
        if std::env::var_os("LANESWEEP_RENEW_FIGURES").is_some() {
            fs::write(kept.join(&name), &now).unwrap();
        }
        let known = fs::read_to_string(kept.join(&name)).unwrap();
        let line = known.lines().zip(now.lines()).position(|(a, b)| a != b);
        assert!(known == now, "{name} differs first in line {:?}", line.map(|line| line + 1));
    }
}
