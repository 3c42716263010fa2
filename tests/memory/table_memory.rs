//! What writing a table, or reading and planning a small file of scenarios, holds in memory.
use crate::common::made;
use crate::memory;

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, StringArray};
use lanesweep::model::plausibility::Implausible;
use lanesweep::model::profile::Profile;
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::scenario::read_scenario_file;
use parquet::basic::Compression;

use lanesweep::report::lanes::columns;
use lanesweep::support::table::{Cell, ColumnKind, TableFormat, TableMetadata, TableWriter};
use lanesweep::traffic::trajectory::highd;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

/// Writes lanes that hardly repeat; the most bytes held at once.
fn write(path: &Path, rows: u64) -> u64 {
    let columns = columns(ColumnKind::Binary32);
    memory::begin(rows);
    let mut table =
        TableWriter::create(path, TableFormat::Parquet, columns.clone(), &TableMetadata::default()).unwrap();
    let mut word = 157_u64;
    for row in 0..rows {
        let cells: Vec<Cell> = columns
            .iter()
            .map(|column| {
                word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                match column.kind {
                    ColumnKind::Text => Cell::text(format!("{:02}_cut_in_{}", word >> 59, row / 360)),
                    ColumnKind::Name => Cell::text(["S", "1", "2", "3"][(word >> 62) as usize]),
                    ColumnKind::Flag => Cell::Flag(word >> 63 == 1),
                    ColumnKind::Whole => Cell::Whole((word >> 62) as i64),
                    _ => Cell::Number((word >> 40) as f64 / 1024.0),
                }
            })
            .collect();
        table.row(&cells).unwrap();
    }
    table.finish().unwrap();
    memory::end()
}

#[test]
fn half_a_million_lanes_take_no_more_memory_than_two_hundred_thousand() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("lanes.parquet");
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let few = write(&path, 200_000);
    let many = write(&path, 500_000);
    println!("200,000 lanes: {:.1} MiB; 500,000 lanes: {:.1} MiB", mib(few), mib(many));
    assert!(mib(many) < 1.04 * mib(few) && mib(many) < 56.0, "{few}, {many}");
    let file = ParquetRecordBatchReaderBuilder::try_new(File::open(&path).unwrap()).unwrap();
    let groups: Vec<i64> = file.metadata().row_groups().iter().map(|group| group.num_rows()).collect();
    assert_eq!(groups, [131_072, 131_072, 131_072, 106_784]);
}

/// Reads a file of scenarios, accepts what is implausible, and plans the study: what was wrong, and the most bytes held
/// at once.
fn study_of(path: &Path, pool: &rayon::ThreadPool) -> (Option<String>, u64) {
    let profile = Profile::load("paper").unwrap();
    memory::begin(0);
    let planned = pool.install(|| {
        let file = read_scenario_file(path, Implausible::Accepted)?;
        plan_study(&file.scenarios, &profile, &StudyOptions::default()).map(drop)
    });
    (planned.err().map(|error| error.to_string()), memory::end())
}

/// Lines of scenarios with `samples` samples each, up to a size of the file.
fn lines(path: &Path, category: &str, samples: usize, fps: &str, bytes: usize) {
    let series = vec!["9"; samples].join(",");
    let mut text = String::new();
    for id in 0.. {
        if text.len() >= bytes {
            break;
        }
        text.push_str(&format!(
            "{{\"id\":\"{id}\",\"category\":\"{category}\",\"fps\":{fps},\"side\":\"left\",\"ego\":{{\"v0\":9,\
             \"length\":4,\"width\":2}},\"target\":{{\"length\":4,\"width\":2,\"v\":[{series}],\"y\":[{series}]}}}}\n"
        ));
    }
    std::fs::write(path, text).unwrap();
}

/// Scenarios with series of so many equal values and texts of so many bytes.
fn parquet(path: &Path, rows: usize, values: usize, text: usize) {
    let numbers = |value: f64| -> ArrayRef { Arc::new(Float64Array::from(vec![value; rows])) };
    let texts = |text: String| -> ArrayRef { Arc::new(StringArray::from(vec![text; rows])) };
    let ids: Vec<String> = (0..rows).map(|row| row.to_string()).collect();
    let columns = vec![
        ("id", Arc::new(StringArray::from(ids)) as ArrayRef),
        ("category", texts("cut_in".to_owned())),
        ("recording", texts("x".repeat(text))),
        ("side", texts("left".to_owned())),
        ("fps", numbers(0.1)),
        ("ego_v0", numbers(9.0)),
        ("ego_length", numbers(4.0)),
        ("ego_width", numbers(2.0)),
        ("target_length", numbers(4.0)),
        ("target_width", numbers(2.0)),
        ("target_v", made::series(&vec![vec![9.0; values]; rows])),
        ("target_y", made::series(&vec![vec![1.0; values]; rows])),
    ];
    made::write(path, columns, Compression::ZSTD(Default::default()));
}

#[test]
fn no_small_file_of_scenarios_takes_more_than_200_mb() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    lines(&path("sparse.jsonl"), "cut_in", 13, "0.1", 2_100_000);
    lines(&path("sparse-lvd.jsonl"), "lvd", 13, "0.1", 2_100_000);
    lines(&path("slow.jsonl"), "cut_in", 121, "1", 2_100_000);
    lines(&path("few.jsonl"), "cut_in", 260_000, "0.1", 2_100_000);
    lines(&path("dense.jsonl"), "cut_in", 1300, "10", 2_100_000);
    let cases = |header: &str, row: &str, rows: usize| format!("{header}\n{}", format!("{row}\n").repeat(rows));
    let cut_ins =
        cases("category,ego_speed_mps,speed_mps,lateral_speed,duration_s,rate_hz", "cut-in,30,20,1,120,1000", 139);
    std::fs::write(path("fine.csv"), cut_ins).unwrap();
    let header = "category,ego_speed_mps,speed_mps,lateral_speed,ahead_gap,duration_s";
    std::fs::write(path("long.csv"), cases(header, "cut-out,30,20,1,30,120", 5000)).unwrap();
    parquet(&path("half-a-million.parquet"), 1, 500_000, 1);
    parquet(&path("texts.parquet"), 64, 2, 100 << 10);
    // The allocator counts one thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
    let said = |name: &str| {
        let size = std::fs::metadata(path(name)).unwrap().len();
        let (error, bytes) = study_of(&path(name), &pool);
        println!("{name}: {size} bytes, {:.1} MB, {}", bytes as f64 / 1e6, error.as_deref().unwrap_or("planned"));
        assert!(bytes < 200_000_000, "{name}: {bytes}");
        error
    };
    let (sparse, fine) = (["were recorded"; 2], ["too many for this number of rows", "column `duration_s`"]);
    for (name, hints) in [
        ("sparse.jsonl", sparse),
        ("sparse-lvd.jsonl", sparse),
        ("slow.jsonl", sparse),
        ("fine.csv", fine),
        ("long.csv", fine),
        ("texts.parquet", ["a text has 102400 bytes"; 2]),
    ] {
        let error = said(name).expect(name);
        assert!(hints.iter().all(|hint| error.contains(hint)), "{name}: {error}");
    }
    // Series end at the time cap, so long ones are no reason to refuse a file.
    for name in ["few.jsonl", "dense.jsonl", "half-a-million.parquet"] {
        let error = said(name);
        assert!(error.is_none(), "{name}: {error:?}");
    }
}

#[test]
fn a_recording_that_announces_many_samples_takes_memory_for_those_that_it_has() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).unwrap();
    write("01_recordingMeta.csv", "frameRate,upperLaneMarkings,lowerLaneMarkings\n25,8;12;16,\n".to_owned());
    let vehicles: String = (0..70_000).map(|id| format!("{id},4,2,Car,1,4096\n")).collect();
    write("01_tracksMeta.csv", format!("id,width,height,class,drivingDirection,numFrames\n{vehicles}"));
    write("01_tracks.csv", "frame,id,x,y,xVelocity,yVelocity,xAcceleration\n1,1,0,9,-20,0,0\n".to_owned());
    memory::begin(0);
    let error = highd::read(&highd::HighdFiles::named(dir.path(), "01")).unwrap_err().to_string();
    let bytes = memory::end();
    println!("{:.1} MB: {error}", bytes as f64 / 1e6);
    assert!(bytes < 100_000_000 && error.contains("69999 more vehicles"), "{bytes}, {error}");
}
