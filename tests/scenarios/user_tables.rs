//! Tables of scenarios and cases that users make: what is read of them, and what is said of those that cannot be read.
#![cfg(feature = "parquet")]

use crate::common::program::{json, ran, refused, said};
use crate::common::tables::made;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Date32Array, Float64Array, Int32Array, StringArray};
use lanesweep::scenario::{Category, Scenario, Side, read_scenario_file, read_scenarios};
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

/// Headers of the formats, each as its writer has it.
#[test]
fn a_table_of_tracks_is_recognised_where_scenarios_are_expected() {
    let highd = "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,frontSightDistance,laneId\n\
                 1,1,10,8,4,2,30,0,0,0,100,2\n";
    let exid = "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length\n0,0,0,0,1,2,3,4,5\n";
    let sumo =
        "timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed\n0.00;a;1;2;90;car;30\n";
    let mitra = "Vehicle_ID,Vehicle_type,Time [s],x [m],y [m],Speed [km/h]\n1,car,0,1,2,90\n";
    let ngsim = "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,v_Vel\n1,1,9,0,1,2,30\n";
    for (text, columns) in [
        (highd, ["`id`", "`frame`", "`x`", "`y`"]),
        (exid, ["`trackId`", "`frame`", "`xCenter`", "`yCenter`"]),
        (sumo, ["`vehicle_id`", "`timestep_time`", "`vehicle_x`", "`vehicle_y`"]),
        (mitra, ["`Vehicle_ID`", "`Time [s]`", "`x [m]`", "`y [m]`"]),
        (ngsim, ["`Vehicle_ID`", "`Frame_ID`", "`Local_X`", "`Local_Y`"]),
    ] {
        let error = of("01_tracks.csv", text).unwrap_err();
        let said = error.to_string();
        assert!(said.contains("this is a table of tracks, not of scenarios"), "{said}");
        assert!(columns.iter().all(|column| said.contains(column)) && said.contains("01_tracks.csv"), "{said}");
        let help = error.help().unwrap();
        assert!(help.contains("`mine`") && help.contains("folder of the recording"), "{help}");
    }
    let dir = tempfile::tempdir().unwrap();
    file(dir.path(), "01_tracks.csv", highd);
    refused(dir.path(), "study --scenarios 01_tracks.csv", 3, "this is a table of tracks");
    // Places beside the series of a scenario make no recording of it.
    let lines = INSTANTS.lines().zip(["x,y", "1,2", "1,2", "1,2", "1,2", "1,2"]);
    let with_places: String = lines.map(|(line, places)| format!("{line},{places}\n")).collect();
    if let Err(error) = of("s.csv", &with_places) {
        assert!(!error.to_string().contains("tracks"), "{error}");
    }
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
}

#[test]
fn a_cut_in_that_moves_away_or_stands_on_the_other_side_is_told_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let notes = |content: &str| {
        let read = read_scenario_file(&file(dir.path(), "s.csv", content), Default::default()).unwrap();
        read.notes.join("; ")
    };
    let away = notes(&INSTANTS.replace("72,3.5", "72,2.75").replace("72,3.4", "72,3.1").replace("90,3.3", "90,3.4"));
    assert!(away.contains("move away from the ego's lane") && away.contains("the first is scenario a"), "{away}");
    let other_side = notes(&INSTANTS.replace("72,3.", "72,-3.").replace("90,3.", "90,-3."));
    assert!(other_side.contains("against their `side`, the first is scenario a"), "{other_side}");
    assert!(!notes(INSTANTS).contains("lane change(s)"));
}

#[test]
fn what_is_wrong_with_a_row_per_instant_is_told_with_line_scenario_and_column() {
    let cases = [
        ("10.08,106", "10.20,106", "s.csv, line 4, column `time_s`, scenario a", "they must be equal"),
        ("10.04,107,4.5", "10.04,107,4.6", "line 3, column `ego_length_m`, scenario a", "is 4.6, but 4.5"),
        ("72,3.4", "fast,3.4", "line 3, column `target_speed_kmh`, scenario a", "expected a number"),
        ("10.04", "soon", "line 3, column `time_s`", "expected a time in seconds"),
        ("Right,4.2", "up,4.2", "line 5, column `side`, scenario b", "\"left\", \"right\""),
        ("b,,0.1,,,,,,,36,0.1,\n", "", "line 5, column `time_s`, scenario b", "one instant"),
        ("side,", "sied,", "s.csv, line 1, column `sied`", "no such column"),
        ("target_lateral_m", "target_lateral_ft", "column `target_lateral_ft`", "feet"),
        ("ego_speed_kmh", "ego_speed_mph", "column `ego_speed_mph`", "miles per hour"),
        ("weather", "target_v", "column `target_v`", "holds the same as the column `target_speed_kmh`"),
        ("target_width_m,", "target_wide,", "column `target_wide`", "no such column"),
        (",weather", "", "line 2", "12 fields, but the header has 11"),
        ("72,3.4,rain", "-72,3.4,rain", "line 3, column `target_speed_kmh`", "at least 0"),
        ("b,,0.1,", "b,,100,", "line 5, column `time_s`, scenario b", "a number of at least 0.1"),
    ];
    for (old, new, place, problem) in cases {
        assert!(INSTANTS.contains(old), "{old}");
        let error = of("s.csv", &INSTANTS.replacen(old, new, 1)).expect_err(new);
        let text = error.to_string();
        assert!(text.contains(place) && text.contains(problem), "{new}: {text}");
        let windows = of("s.csv", &INSTANTS.replacen(old, new, 1).replace('\n', "\r\n")).expect_err(new);
        assert!(windows.to_string().contains(place), "{windows}");
        assert!(error.help().is_some_and(|help| !help.is_empty()), "{text}");
    }
    let rows: Vec<&str> = INSTANTS.lines().collect();
    let again = of("s.csv", &format!("{INSTANTS}{}\n{}\n", rows[1], rows[2])).unwrap_err().to_string();
    assert!(again.contains("line 7, column `id`, scenario a: this id belongs to line 2 too"), "{again}");
    let near = of("s.csv", &INSTANTS.replace("side,", "sied,")).unwrap_err().help().unwrap();
    assert!(near.contains("did you mean `side`?"), "{near}");
    let kmh = of("s.csv", &INSTANTS.replace("ego_speed_kmh", "ego_speed_mph")).unwrap_err().help().unwrap();
    assert!(kmh.contains("`ego_speed_mps`") && kmh.contains("`ego_speed_kmh`"), "{kmh}");
    let missing = of("s.csv", "id,category,time_s,target_v\n").unwrap_err().to_string();
    assert!(missing.contains("no column `ego_v0`, `ego_length`, `ego_width`, `side`"), "{missing}");
    // As a spreadsheet writes it: semicolons, decimal commas, a column of its own, empty rows below.
    let sheet = INSTANTS.replace('.', "!").replace(',', ";").replace('!', ",");
    let sheet = sheet.replace('\n', ";mine\n").replacen(";mine", ";remark", 1);
    let sheet = format!("{sheet}{}\n", ";".repeat(sheet.lines().next().unwrap().matches(';').count()));
    let [plain, sheet] = [INSTANTS, &sheet].map(|text| format!("{:?}", of("s.csv", text).unwrap()));
    assert_eq!(plain, sheet);
    assert!(of("s.csv", "").is_err() && of("s.csv", "id,category\n").is_err());
}

const CASES: &str =
    "id,category,models,ego_speed_kmh,speed_mps,thw,gap,lateral_speed,acceleration,end_speed,ahead_gap,\
ahead_speed_kmh,duration_s,rate_hz
a,cut-in,FSM,108,20,1.2,,1.0,,,,,,
,lvd,RSS,108,30,,30,,-6,0,,,,10
c,cut-out,FSM,108,,1.2,,1.0,,,40,36,4,
";

/// The numbers of a series but for its last row.
fn before_end(series: &str) -> Vec<f64> {
    let steps: Vec<&str> = series.lines().skip(1).collect();
    let before_end = &steps[..steps.len() - 1];
    before_end.iter().flat_map(|line| line.split(',')).filter_map(|field| field.parse().ok()).collect()
}

fn near((a, b): (&f64, &f64)) -> bool {
    a == b || (a - b).abs() <= 1e-6 * (1.0 + a.abs())
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
        assert!(lines > 200 && x.iter().zip(&y).take(lines).all(near), "{lane}:\n{by_row}\n{by_lane}");
    }
    let study = ran(dir.path(), "-q study --scenarios p.csv --out out --backend cpu");
    assert!(study.contains("cut-in"), "{study}");
}

#[test]
fn what_is_wrong_with_parameters_is_told_with_line_and_column() {
    let cases = [
        ("speed_mps,thw", "sped,thw", "line 1, column `sped`", "no such column", "did you mean `speed`?"),
        ("lateral_speed", "lateral_speed_ms", "column `lateral_speed_ms`", "milliseconds", "`lateral_speed_mps`"),
        (
            "cut-in,FSM",
            "cutin,FSM",
            "line 2, column `category`",
            "no category `cutin`",
            "did you mean `cut-in`? There are cut-in, cut-out, LVD",
        ),
        ("FSM,108,20", "FSM,,20", "line 2, column `ego_speed_kmh`", "missing", "such as 60km/h"),
        ("1.2,,1.0", "1.2,8,1.0", "line 2, column `thw`", "both gap and time headway", "leave one of the two empty"),
        ("-6,0", "-6,40m/s", "line 3, column `end_speed`", "cannot be reached", "sign"),
        ("36,4,", "36,2000,", "line 4, column `duration_s`", "2000 cannot be used", "at most 120"),
        ("108,20,", "108,fast,", "line 2, column `speed_mps`", "is \"fast\"", "60km/h"),
    ];
    for (old, new, place, problem, help) in cases {
        assert!(CASES.contains(old), "{old}");
        let error = of("p.csv", &CASES.replacen(old, new, 1)).expect_err(new);
        let text = error.to_string();
        assert!(text.contains(place) && text.contains(problem), "{new}: {text}");
        let windows = of("p.csv", &CASES.replacen(old, new, 1).replace('\n', "\r\n")).expect_err(new);
        assert!(windows.to_string().contains(place), "{windows}");
        assert!(error.help().unwrap().contains(help), "{new}: {:?}", error.help());
    }
    // A column of one's own changes nothing.
    let own = CASES.replacen("id,category", "id,note,category", 1);
    let own = own.replace("\na,", "\na,x,").replace("\n,lvd", "\n,x,lvd").replace("\nc,", "\nc,x,");
    let [plain, own] = [CASES, &own].map(|text| format!("{:?}", of("p.csv", text).unwrap()));
    assert_eq!(plain, own);
    let rows: String = (0..6000).map(|_| "lvd,20,-1,120,1000\n").collect();
    let error = of("p.csv", &format!("category,ego_speed_mps,acceleration,duration_s,rate_hz\n{rows}")).unwrap_err();
    assert!(error.to_string().contains("too many for this number of rows"), "{error}");
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
    assert!(row.iter().zip(&lane).all(near));
    // What is no duration is refused by all of them, with its place.
    for duration in ["0", "-1", "1e9", "nan", "0.01"] {
        braking(duration);
        for verb in ["check", "simulate --table", "study --scenarios"] {
            refused(dir.path(), &format!("{verb} a.csv"), 3, "a.csv, line 2, column `duration_s`");
        }
    }
}

fn texts(values: &[&str]) -> ArrayRef {
    Arc::new(StringArray::from(values.to_vec()))
}

fn numbers(values: &[f64]) -> ArrayRef {
    Arc::new(Float64Array::from(values.to_vec()))
}

/// The least that a table of series has.
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
fn a_table_of_series_with_the_required_columns_is_read_whatever_program_wrote_it() {
    for compression in [Compression::UNCOMPRESSED, Compression::SNAPPY] {
        let read = through(required_columns(), compression).unwrap();
        let [a, b] = &read[..] else { panic!("two scenarios") };
        assert_eq!((a.ego.v0, a.fps, &a.target.y[..], a.lead_id), (30.0, 25.0, &[3.5, 3.4, 3.3][..], None));
        assert_eq!((b.category, b.kept, b.lead_id), (Category::Lvd, true, Some(12)));
        assert_eq!(b.target.v, [25.0, 10.0]);
    }
}

#[test]
fn what_is_wrong_with_a_table_of_series_is_told_with_row_scenario_and_column() {
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
        assert!(text.contains("help: write the file again, or use JSON Lines or CSV"), "{text}");
        assert!(!text.contains("panicked"), "{text}");
    }
}

/// Cut-ins, a row per instant; `change` spoils the rows of some.
fn cut_ins(count: usize, change: impl Fn(usize, usize) -> Option<String>) -> String {
    let mut text = "id,category,time_s,ego_speed_mps,ego_length_m,ego_width_m,side,target_length_m,target_width_m,\
                    target_speed_mps,target_lateral_m\n"
        .to_owned();
    for id in 0..count {
        for k in 0..20 {
            let (time_s, y) = (k as f64 / 10.0, 3.5 - 0.1 * k as f64);
            // No scenario is a copy of another.
            let (ego, other) = (28 + id % 3, 20.0 + id as f64 / 64.0);
            let row = format!("s{id},cut-in,{time_s},{ego},4.5,1.8,left,4.2,1.9,{other},{y}\n");
            text.push_str(&change(id, k).unwrap_or(row));
        }
    }
    text
}

/// A row with this speed and lateral position of the target.
fn row(id: usize, k: usize, speed: f64, y: f64) -> Option<String> {
    Some(format!("s{id},cut-in,{},30,4.5,1.8,left,4.2,1.9,{speed},{y}\n", k as f64 / 10.0))
}

#[test]
fn one_bad_scenario_in_ten_is_left_out_and_told_and_more_are_no_result_with_all_of_them_told() {
    let dir = tempfile::tempdir().unwrap();
    let study = |text: &str, more: &str| {
        file(dir.path(), "s.csv", text);
        said(dir.path(), &format!("study --scenarios s.csv --out out --backend cpu {more}"))
    };
    assert_eq!(study(&cut_ins(30, |_, _| None), "").0, 0);
    // 2.5 m to the side in 0.1 s.
    let jump = |id, k| if (id, k) == (7, 10) { row(7, 10, 20.0, 0.0) } else { None };
    let (code, text) = study(&cut_ins(30, jump), "");
    assert_eq!(code, 4, "{text}");
    assert!(text.contains("line 151, column `target_lateral_m`, scenario s7: lateral jump: -26 m/s"), "{text}");
    let run = json(&dir.path().join("out/run.json"));
    assert_eq!(run["categories"][0]["kept"].as_u64(), Some(29));
    assert!(run["left_out"][0].as_str().unwrap().contains("scenario s7"), "{}", run["left_out"]);
    let (code, text) = study(&cut_ins(30, jump), "--accept-implausible");
    assert!(code == 0 && text.contains("an implausible lateral speed is used as it is, once"), "{text}");
    let run = json(&dir.path().join("out/run.json"));
    assert!(run["notes"][0].as_str().unwrap().contains("lateral speed"), "{}", run["notes"]);
    // Neither of two scenarios of one id is used, and both count.
    let doubled = |times: usize| {
        let first = cut_ins(times, |_, _| None);
        cut_ins(30, |_, _| None) + first.split_once('\n').unwrap().1
    };
    assert_eq!(study(&doubled(1), "").0, 4);
    let (code, text) = study(&doubled(2), "");
    assert!(code == 3 && text.contains("4 of 32 scenarios cannot be used"), "{text}");
    // A table in kilometres per hour.
    let (code, text) = study(&cut_ins(30, |id, k| row(id, k, 108.0, 3.5)), "");
    assert_eq!(code, 3, "{text}");
    assert!(text.contains("30 of 30 scenarios cannot be used") && text.contains("and 10 more"), "{text}");
    assert!(text.contains("scenario s0: 108 m/s") && text.contains("scenario s19: 108 m/s"), "{text}");
    assert!(text.contains("108 looks like km/h: 30 m/s") && text.contains("--accept-implausible"), "{text}");
    // All kinds of errors at once.
    let spoilt = |id, k| match (id, k) {
        (1, 3) => Some("s1,cut-in,soon,30,4.5,1.8,left,4.2,1.9,20,3\n".to_owned()),
        (2, 3) => row(2, 3, -7.0, 3.0),
        (3, 0) => Some("s3,cut-in,0,30,4.5,1.8,up,4.2,1.9,20,3.5\n".to_owned()),
        (4, 19) => row(4, 25, 20.0, 1.6),
        _ => None,
    };
    let (code, text) = study(&cut_ins(30, spoilt), "");
    assert_eq!(code, 3, "{text}");
    for part in ["4 of 30", "is \"soon\"", "is -7; expected", "is \"left\", but \"up\"", "they must be equal"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(study(&cut_ins(50, spoilt), "").0, 4);
}

#[test]
fn small_negative_speeds_are_0_in_every_table_and_flag_and_larger_ones_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let is_still = |name: &str, content: &str| {
        let path = file(dir.path(), name, content);
        let read = read_scenario_file(&path, Default::default()).unwrap();
        let is_told = read.notes[0].contains("between -0.5 and 0 m/s is taken as 0, once");
        assert!(read.problems.is_empty() && is_told, "{name}: {:?}", read.notes);
        assert!(read.scenarios.iter().any(|s| s.target.v.contains(&0.0)), "{name}");
    };
    is_still("i.csv", &INSTANTS.replace("36,0.1", "-0.036,0.1"));
    let error = of("i.csv", &INSTANTS.replace("36,0.1", "-1.8,0.1")).unwrap_err().to_string();
    assert!(error.contains("is -0.5; expected"), "{error}");
    let cases = "category,ego_speed_mps,speed_mps,acceleration\nlvd,20,SPEED,0\n";
    is_still("c.csv", &cases.replace("SPEED", "-0.01"));
    let error = of("c.csv", &cases.replace("SPEED", "-0.5")).unwrap_err().to_string();
    assert!(error.contains("line 2, column `speed_mps`"), "{error}");
    let line = |speed: f64| {
        format!(
            "{{\"id\":\"a\",\"category\":\"lvd\",\"fps\":10,\"side\":\"left\",\"ego\":{{\"v0\":20,\"length\":4,\"width\":2}},\
             \"target\":{{\"length\":4,\"width\":2,\"v\":[1,{speed}],\"y\":[0,0]}}}}\n"
        )
    };
    is_still("s.jsonl", &line(-0.01));
    assert!(of("s.jsonl", &line(-0.5)).unwrap_err().to_string().contains("`target.v[1]`"));
    let of_parquet = |speed: f64| {
        let mut columns = required_columns();
        columns.retain(|(name, _)| *name != "target_v");
        columns.push(("target_v", made::series(&[vec![20.0, 20.0, 25.0], vec![1.0, speed]])));
        through(columns, Compression::UNCOMPRESSED)
    };
    assert_eq!(of_parquet(-0.49).unwrap()[1].target.v, [1.0, 0.0]);
    assert!(of_parquet(-0.5).unwrap_err().to_string().contains("column `target_v[1]`, row 2"));

    let lvd = "simulate --category lvd --models FSM --ego-speed 30m/s --gap 30 --acceleration 0 --speed";
    let (code, text) = said(dir.path(), &format!("{lvd} -0.01m/s"));
    assert!(code == 0 && text.contains("taken as 0, once: speed"), "{text}");
    refused(dir.path(), &format!("{lvd} -0.5m/s"), 2, "");
    let map = "map lvd --x gap_m=10,20 --y ego_speed_mps=10,20 --set deceleration_mps2=1 --out map";
    let (code, text) = said(dir.path(), &format!("{map} --set other_speed_mps=-0.01"));
    assert!(code == 0 && text.contains("taken as 0, once: other_speed_mps = -0.01"), "{text}");
    refused(dir.path(), &format!("{map} --set other_speed_mps=-0.5"), 2, "");
    refused(dir.path(), &format!("{map} --set other_speed_mps=108"), 2, "");
}
