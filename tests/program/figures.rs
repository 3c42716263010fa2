//! The figures of a study show the numbers of their tables, and these are the ones that were looked at.
//!
//! `LANESWEEP_RENEW_FIGURES=1 cargo test --release --test program figures::` writes the tables again, after a change that
//! is meant.

use std::fs;
use std::path::Path;

use crate::common::program::ran;

/// The figures of cut-ins whose tables are kept.
const KEPT: [&str; 5] = ["f1", "radar", "recall-precision", "f1-by-parameters", "headways"];

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
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let header = reader.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|column| column == name).unwrap();
    let row = |record: csv::StringRecord| Row {
        panel: record[at("panel")].to_owned(),
        row: record[at("row")].to_owned(),
        series: record[at("series")].to_owned(),
        x: record[at("x")].parse().unwrap(),
        y: record[at("y")].parse().ok(),
    };
    reader.records().map(|record| row(record.unwrap())).collect()
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
    let (svg, table) = (read("f1-cut-in.svg"), rows(&read("f1-cut-in.csv")));
    let frame = svg.split("class=\"frame\"").nth(1).unwrap();
    let (left, width) = (number(frame, "x"), number(frame, "width"));
    let drawn = markers(&svg);
    assert_eq!(drawn.len(), table.len());
    assert!(table.len() > 60);
    for (row, x) in table.iter().zip(drawn) {
        assert!(
            (left + (row.x + 0.02) / 1.04 * width - x).abs() < 0.02,
            "{} {}: {} is drawn at {x}",
            row.row,
            row.series,
            row.x
        );
        assert!(row.y.is_none() && !row.row.is_empty() && row.panel.is_empty());
    }
    // The same scores as in the table of the study.
    let mut scores = csv::Reader::from_path(dir.path().join("f1.csv")).unwrap();
    let header = scores.headers().unwrap().clone();
    let at = header.iter().position(|column| column == "f1").unwrap();
    let mut all: Vec<f64> = scores.records().filter_map(|record| record.unwrap()[at].parse().ok()).collect();
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
        let now = fs::read_to_string(dir.path().join(&name)).unwrap();
        if std::env::var_os("LANESWEEP_RENEW_FIGURES").is_some() {
            fs::write(kept.join(&name), &now).unwrap();
        }
        let known = fs::read_to_string(kept.join(&name)).unwrap();
        let line = known.lines().zip(now.lines()).position(|(a, b)| a != b);
        assert!(known == now, "{name} differs first in line {:?}", line.map(|line| line + 1));
    }
}

/// Also beside variants without a number of parameters, which take part in the choice of cells.
#[test]
fn a_mean_over_cells_is_that_of_the_scores_in_the_table() {
    let dir = tempfile::tempdir().unwrap();
    let study = "-q study --synth-recordings 6 --categories cut-in --cross-validate --backend cpu";
    ran(dir.path(), &format!("{study} --out ."));
    let table = |name: &str| {
        let mut reader = csv::Reader::from_path(dir.path().join(name)).unwrap();
        let header = reader.headers().unwrap().clone();
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        move |row: usize, column: &str| {
            let at = header.iter().position(|name| name == column).unwrap();
            rows.get(row).map(|row| row[at].to_owned())
        }
    };
    let scores = table("f1.csv");
    let mut cells = std::collections::BTreeMap::<(String, String), Vec<(String, Option<f64>)>>::new();
    for row in (0..).take_while(|row| scores(*row, "f1").is_some()) {
        let of = |column: &str| scores(row, column).unwrap();
        let cell = cells.entry((of("model"), of("criterion"))).or_default();
        cell.push((of("parameterization"), of("f1").parse().ok()));
    }
    let shared: Vec<_> = cells.values().filter(|cell| cell.iter().all(|(_, f1)| f1.is_some())).collect();
    let means = table("f1-by-parameters-cut-in.csv");
    let mut compared = 0;
    for row in (0..).take_while(|row| means(*row, "label").is_some()) {
        let of = |column: &str| means(row, column).unwrap();
        if !of("panel").starts_with("all criteria") || of("label").is_empty() {
            continue;
        }
        let own = shared.iter().flat_map(|cell| cell.iter()).filter(|(key, _)| *key == of("label"));
        let own: Vec<f64> = own.filter_map(|(_, f1)| *f1).collect();
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        assert!((mean - of("y").parse::<f64>().unwrap()).abs() < 1e-9, "{}: {mean}", of("label"));
        compared += 1;
    }
    assert_eq!(compared, 7, "the paper's parameterizations");
}
