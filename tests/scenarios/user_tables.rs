//! Tables of scenarios and cases that users make: what is read of them (what is refused: `tests/messages/tables.md`).
#![cfg(feature = "parquet")]

use crate::common::program::{ran, said};
use crate::common::{CASES, made, near};

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Date32Array, Float64Array, Int32Array, StringArray};
use lanesweep::scenario::{Category, Scenario, Side, read_scenarios};
use parquet::basic::Compression;

fn file(dir: &Path, name: &str, content: &str) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn of(name: &str, content: &str) -> lanesweep::Result<Vec<Scenario>> {
    let dir = tempfile::tempdir().unwrap();
    read_scenarios(&file(dir.path(), name, content))
}

const INSTANTS: &str = "\u{feff}id,category,time_s,ego_speed_kmh,ego_length_m,ego_width_m,side,target_length_m,\
target_width_m,target_speed_kmh,target_lateral_m,weather
a,cut-in,10.00,108,4.5,1.8,left,4.2,1.9,72,3.5,rain
a,cut-in,10.04,107,4.5,1.8,left,4.2,1.9,72,3.4,rain
a,cut-in,10.08,106,4.5,1.8,left,4.2,1.9,90,3.3,sun
b,lvd,0,90,4.5,1.8,Right,4.2,1.9,90,0,
b,,0.1,,,,,,,36,0.1,
";

#[test]
fn a_row_per_instant_makes_scenarios_with_converted_units_and_the_rate_of_their_times() {
    let read = of("s.csv", INSTANTS).unwrap();
    assert_eq!(read.iter().map(|s| s.id.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    let [a, b] = &read[..] else { panic!("two scenarios") };
    assert_eq!((a.category, a.side, a.fps, a.ego.v0), (Category::CutIn, Side::Left, 25.0, 30.0));
    assert_eq!((&a.target.v[..], &a.target.y[..]), (&[20.0, 20.0, 25.0][..], &[3.5, 3.4, 3.3][..]));
    assert!(a.kept && a.lead.is_none() && a.lane_width == 3.5 && a.thw0.is_none());
    assert_eq!((b.category, b.side, b.fps, &b.target.v[..]), (Category::Lvd, Side::Right, 10.0, &[25.0, 10.0][..]));
    // As a spreadsheet writes it: semicolons, decimal commas, a column of its own, an empty row below.
    let sheet = INSTANTS.replace('.', "!").replace(',', ";").replace('!', ",");
    let sheet = sheet.replace('\n', ";mine\n").replacen(";mine", ";remark", 1);
    let sheet = format!("{sheet}{}\n", ";".repeat(sheet.lines().next().unwrap().matches(';').count()));
    assert_eq!(format!("{read:?}"), format!("{:?}", of("s.csv", &sheet).unwrap()));
}

fn before_end(series: &str) -> Vec<f64> {
    let steps: Vec<&str> = series.lines().skip(1).collect();
    let before_end = &steps[..steps.len() - 1];
    before_end.iter().flat_map(|line| line.split(',')).filter_map(|field| field.parse().ok()).collect()
}

#[test]
fn parameters_make_the_scenarios_that_simulate_runs() {
    let read = of("p.csv", CASES).unwrap();
    let [a, b, c] = &read[..] else { panic!("three scenarios") };
    assert_eq!((a.id.as_str(), a.fps, a.target.v.len(), a.ego.v0), ("a", 25.0, 89, 30.0));
    assert_eq!((a.target.y[0], a.target.y[25], a.target.y[88]), (3.5, 2.5, 0.0));
    assert_eq!((a.thw0, a.gap0), (Some(1.2), Some(36.0)));
    assert_eq!((b.id.as_str(), b.fps, b.target.v.len()), ("row-2", 10.0, 51));
    assert_eq!((b.target.v[0], b.target.v[10], b.target.v[50], b.gap0), (30.0, 24.0, 0.0, Some(30.0)));
    assert_eq!((c.lead_gap, c.lead.as_ref().unwrap().v[7], c.target.y[25]), (Some(40.0), 10.0, 1.0));
    assert_eq!((c.target.v.len(), c.target.v[3]), (101, 30.0));

    let dir = tempfile::tempdir().unwrap();
    file(dir.path(), "p.csv", CASES);
    // The run of a scenario's recorded variant is the run of its row.
    for (row, lane) in [("1", "a/S/1.2s/FSM"), ("2", "row-2/S/30m/RSS"), ("3", "c/S/1.2s/FSM")] {
        let by_row = ran(dir.path(), &format!("simulate --table p.csv --row {row}"));
        let by_lane = ran(dir.path(), &format!("simulate --scenarios p.csv --lane {lane}"));
        assert!(by_row.lines().count() > 20);
        let (x, y) = (before_end(&by_row), before_end(&by_lane));
        let lines = x.len().min(y.len());
        assert!(
            lines > 200 && x.iter().zip(&y).take(lines).all(|(a, b)| near(*a, *b, 1e-6)),
            "{lane}:\n{by_row}\n{by_lane}"
        );
    }
    let study = ran(dir.path(), "-q study --scenarios p.csv --out out --backend cpu");
    assert!(study.contains("cut-in"), "{study}");
}

#[test]
fn a_row_is_the_same_case_in_every_verb_and_ends_its_motions_after_its_duration() {
    let dir = tempfile::tempdir().unwrap();
    let header = "id,category,ego_speed_mps,speed_mps,thw,lateral_speed_mps,acceleration_mps2,duration_s\n";
    let braking = |duration: &str| file(dir.path(), "a.csv", &format!("{header}a,lvd,30,30,0.6,,-8,{duration}\n"));
    let (row, lane) = ("simulate --table a.csv --models FSM", "simulate --scenarios a.csv --lane");
    for (duration, collides) in [("0.5", false), ("", true)] {
        braking(duration);
        let (code, text) = said(dir.path(), "check a.csv --profiles paper");
        assert_eq!(code, i32::from(collides), "{text}");
        let of = |line: &str| said(dir.path(), line).1.contains("Collision FAIL");
        assert_eq!([of(&format!("{lane} a/S/0.6s/FSM")), of(row)], [collides; 2], "duration {duration:?}");
    }
    // A lane change that ends half way: the series of the row is that of its scenario, up to the step at which the motions
    // end. There the row's lateral speed is 0 already, and a scenario's is that of its last sample.
    file(dir.path(), "a.csv", &format!("{header}a,cut-in,30,20,1.2,1,-2,1.2\n"));
    let of = |line: &str| before_end(&ran(dir.path(), line));
    let (row, lane) = (of(row), of(&format!("{lane} a/S/1.2s/FSM")));
    assert!(row.len() > 200, "{}", row.len());
    assert_eq!(row.len(), lane.len());
    assert!(row.iter().zip(&lane).all(|(a, b)| near(*a, *b, 1e-6)));
}

fn texts(values: &[&str]) -> ArrayRef {
    Arc::new(StringArray::from(values.to_vec()))
}

fn numbers(values: &[f64]) -> ArrayRef {
    Arc::new(Float64Array::from(values.to_vec()))
}

fn required_columns() -> Vec<(&'static str, ArrayRef)> {
    vec![
        ("id", texts(&["a", "b"])),
        ("category", texts(&["cut_in", "lvd"])),
        ("fps", Arc::new(Int32Array::from(vec![25, 10]))),
        ("ego_v0_kmh", numbers(&[108.0, 90.0])),
        ("ego_length", numbers(&[4.5, 4.5])),
        ("ego_width", numbers(&[1.8, 1.8])),
        ("side", texts(&["left", "right"])),
        ("target_length", numbers(&[4.2, 4.2])),
        ("target_width", numbers(&[1.9, 1.9])),
        ("target_v", made::series(&[vec![20.0, 20.0, 25.0], vec![25.0, 10.0]])),
        ("target_y", made::series(&[vec![3.5, 3.4, 3.3], vec![0.0, 0.1]])),
        ("kept", Arc::new(BooleanArray::from(vec![Some(true), None]))),
        ("lead_id", numbers(&[f64::NAN, 12.0])),
        ("__index_level_0__", numbers(&[0.0, 1.0])),
    ]
}

fn through(columns: Vec<(&str, ArrayRef)>, compression: Compression) -> lanesweep::Result<Vec<Scenario>> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.parquet");
    made::write(&path, columns, compression);
    read_scenarios(&path)
}

#[test]
fn a_table_of_series_is_read_whatever_program_wrote_it_or_what_is_wrong_is_told_with_row_scenario_and_column() {
    for compression in [Compression::UNCOMPRESSED, Compression::SNAPPY] {
        let read = through(required_columns(), compression).unwrap();
        let [a, b] = &read[..] else { panic!("two scenarios") };
        assert_eq!((a.ego.v0, a.fps, &a.target.y[..], a.lead_id), (30.0, 25.0, &[3.5, 3.4, 3.3][..], None));
        assert_eq!((b.category, b.kept, b.lead_id), (Category::Lvd, true, Some(12)));
        assert_eq!(b.target.v, [25.0, 10.0]);
    }
    let with = |name: &'static str, array: ArrayRef| {
        let mut columns = required_columns();
        match columns.iter_mut().find(|(known, _)| *known == name) {
            Some(column) => column.1 = array,
            None => columns.push((name, array)),
        }
        through(columns, Compression::UNCOMPRESSED).unwrap_err().to_string()
    };
    let short = with("target_y", made::series(&[vec![3.5, 3.4, 3.3], vec![0.0]]));
    assert!(short.contains("column `target_y`, row 2, scenario b: 1 samples, but `target.v` has 2"), "{short}");
    let nan = with("target_v", made::series(&[vec![20.0, f64::NAN, 25.0], vec![1.0, 1.0]]));
    assert!(nan.contains("column `target_v[1]`, row 1, scenario a: is null; expected a number"), "{nan}");
    let text = with("fps", texts(&["25", "fast"]));
    assert!(text.contains("column `fps`, row 2, scenario b: is \"fast\"; expected a number"), "{text}");
    let near = with("lane_widht", numbers(&[3.5, 3.5]));
    assert!(near.contains("column `lane_widht`"), "{near}");
    let date = with("gap0", Arc::new(Date32Array::from(vec![1, 2])));
    assert!(date.contains("column `gap0`: holds values of the type Date32"), "{date}");
}

#[test]
fn a_truncated_parquet_file_is_told_as_one_and_no_panic_is_printed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.parquet");
    made::write(&path, required_columns(), Compression::SNAPPY);
    let whole = std::fs::read(&path).unwrap();
    // The last has only the name of one.
    let text = b"{\"parameterization\": 2}\n";
    for content in [b"", &whole[..3], &whole[..whole.len() / 2], &whole[..whole.len() - 1], text] {
        std::fs::write(&path, content).unwrap();
        let (code, text) = said(dir.path(), "study --scenarios s.parquet");
        assert!(code == 3 && text.contains("s.parquet: not a Parquet file that can be read"), "{text}");
        assert!(
            text.contains("help: write the file again, with compression=\"zstd\", or use JSON Lines or CSV"),
            "{text}"
        );
        assert!(!text.contains("panicked"), "{text}");
    }
}
