//! What writing a table holds in memory does not grow with its rows.
#![cfg(feature = "parquet")]

#[allow(dead_code)]
#[path = "mutated_inputs/memory.rs"]
mod memory;

use std::fs::File;
use std::path::Path;

use lanesweep::report::lanes::{Digits, columns};
use lanesweep::table::{Cell, Kind, TableFacts, TableFormat, TableWriter};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

#[global_allocator]
static COUNTING: memory::Counting = memory::Counting;

/// Writes lanes that hardly repeat; the most bytes held at once.
fn write(path: &Path, rows: u64) -> u64 {
    let columns = columns(Digits::Binary32);
    memory::begin(rows);
    let mut table = TableWriter::create(path, TableFormat::Parquet, columns.clone(), &TableFacts::default()).unwrap();
    let mut word = 157_u64;
    for row in 0..rows {
        let cells: Vec<Cell> = columns
            .iter()
            .map(|column| {
                word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                match column.kind {
                    Kind::Text => Cell::text(format!("{:02}_cut_in_{}", word >> 59, row / 360)),
                    Kind::Name => Cell::text(["S", "1", "2", "3"][(word >> 62) as usize]),
                    Kind::Flag => Cell::Flag(word >> 63 == 1),
                    Kind::Whole => Cell::Whole((word >> 62) as i64),
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
fn a_million_lanes_take_no_more_memory_than_two_hundred_thousand() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("lanes.parquet");
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let few = write(&path, 200_000);
    let many = write(&path, 1_000_000);
    println!("200,000 lanes: {:.1} MiB; 1,000,000 lanes: {:.1} MiB", mib(few), mib(many));
    assert!(mib(many) < 1.1 * mib(few) && mib(many) < 48.0, "{few}, {many}");
    let file = ParquetRecordBatchReaderBuilder::try_new(File::open(&path).unwrap()).unwrap();
    let groups: Vec<i64> = file.metadata().row_groups().iter().map(|group| group.num_rows()).collect();
    assert_eq!(groups, [131_072, 131_072, 131_072, 131_072, 131_072, 131_072, 131_072, 82_496]);
}
