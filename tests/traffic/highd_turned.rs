//! A recording turned by 180° is the same traffic: the frame of the image leaves no trace in the model.

use crate::common;

use std::fs;

use crate::common::small::Texts;
use lanesweep::traffic::trajectory::{Carriageway, Recording};

/// Length of the road, hundredths of a metre.
const ROAD: i64 = 42_000;

/// A table whose fields can be changed by column.
struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn of(text: &str) -> Self {
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Table { columns: lines.next().unwrap(), rows: lines.collect() }
    }

    fn change(&mut self, change: impl Fn(&mut dyn FnMut(&str) -> usize, &mut Vec<String>)) {
        let columns = &self.columns;
        let mut at = |name: &str| columns.iter().position(|column| column == name).unwrap();
        for row in &mut self.rows {
            change(&mut at, row);
        }
    }

    fn text(&self) -> String {
        let lines = std::iter::once(&self.columns).chain(&self.rows).map(|row| row.join(",") + "\n");
        lines.collect()
    }
}

/// A decimal with two places as an exact number of hundredths.
fn hundredths(text: &str) -> i64 {
    let value: f64 = text.parse().unwrap();
    let count = (value * 100.0).round();
    assert!((value * 100.0 - count).abs() < 1e-6, "{text} has two decimals");
    count as i64
}

fn decimal(hundredths: i64) -> String {
    format!("{}{}.{:02}", if hundredths < 0 { "-" } else { "" }, hundredths.abs() / 100, hundredths.abs() % 100)
}

/// x' = road − x − width and y' = −y − height, exactly; everything else follows.
fn turned(texts: &Texts) -> Texts {
    let mut meta = Table::of(&texts.recording_meta);
    let mirrored = |cell: &str| {
        let lines: Vec<String> = cell.split(';').rev().map(|line| decimal(-hundredths(line))).collect();
        lines.join(";")
    };
    meta.change(|at, row| {
        let (upper, lower) = (at("upperLaneMarkings"), at("lowerLaneMarkings"));
        (row[upper], row[lower]) = (mirrored(&row[lower]), mirrored(&row[upper]));
    });
    let lines: usize = ["upperLaneMarkings", "lowerLaneMarkings"]
        .map(|name| meta.columns.iter().position(|column| column == name).unwrap())
        .map(|at| meta.rows[0][at].split(';').count())
        .iter()
        .sum();
    let mut tracks_meta = Table::of(&texts.tracks_meta);
    tracks_meta.change(|at, row| {
        let direction = at("drivingDirection");
        row[direction] = if row[direction] == "1" { "2" } else { "1" }.to_owned();
    });
    let mut tracks = Table::of(&texts.tracks);
    tracks.change(|at, row| {
        let (length, width) = (hundredths(&row[at("width")]), hundredths(&row[at("height")]));
        let (x, y) = (at("x"), at("y"));
        row[x] = decimal(ROAD - hundredths(&row[x]) - length);
        row[y] = decimal(-hundredths(&row[y]) - width);
        for name in ["xVelocity", "yVelocity", "xAcceleration", "yAcceleration"] {
            let column = at(name);
            row[column] = decimal(-hundredths(&row[column]));
        }
        let lane = at("laneId");
        row[lane] = (lines as i64 + 2 - row[lane].parse::<i64>().unwrap()).to_string();
    });
    Texts { tracks: tracks.text(), tracks_meta: tracks_meta.text(), recording_meta: meta.text() }
}

fn assert_same_traffic(recording: &Recording, turned: &Recording) {
    let lines = |carriageway: &Carriageway| carriageway.lane_lines_m.clone();
    let there: Vec<_> = recording.carriageways.iter().map(lines).collect();
    let back: Vec<_> = turned.carriageways.iter().rev().map(lines).collect();
    assert_eq!(there, back, "lane lines, with the carriageways exchanged");
    assert_eq!(recording.tracks.len(), turned.tracks.len());
    for (a, b) in recording.tracks.iter().zip(&turned.tracks) {
        let (a, b) = (a.clone(), b.clone());
        let fixed =
            |t: &lanesweep::traffic::trajectory::Track| (t.id, t.class, t.first_frame, t.length_m, t.width_m, t.len());
        assert_eq!(fixed(&a), fixed(&b));
        assert_eq!(a.carriageway, 1 - b.carriageway);
        assert_eq!((a.lane, a.v_s_mps, a.v_d_mps, a.a_s_mps2), (b.lane, b.v_s_mps, b.v_d_mps, b.a_s_mps2));
        // Forward positions start from the other end of the road: s for +x is road + s of the turned one.
        let shift_m = if a.carriageway == 1 { ROAD as f64 / 100.0 } else { -ROAD as f64 / 100.0 };
        for (a, b) in a.s_m.iter().zip(&b.s_m) {
            assert!((a - b - shift_m).abs() < 1e-9, "{a} {b}");
        }
        for (a, b) in a.d_m.iter().zip(&b.d_m) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}

#[test]
fn a_recording_turned_by_180_degrees_is_the_same_traffic() {
    let texts = Texts::small();
    assert_same_traffic(&texts.read().unwrap().recording, &turned(&texts).read().unwrap().recording);
}

#[test]
fn a_sumo_recording_with_unequal_lane_counts_turned_by_180_degrees_is_the_same_traffic() {
    let Some(dir) = common::sumo_recordings() else { return };
    let text = |name: &str| fs::read_to_string(dir.join(name)).unwrap();
    let texts = Texts {
        tracks: text("04_tracks.csv"),
        tracks_meta: text("04_tracksMeta.csv"),
        recording_meta: text("04_recordingMeta.csv"),
    };
    assert_same_traffic(&texts.read().unwrap().recording, &turned(&texts).read().unwrap().recording);
}
