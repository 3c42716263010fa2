//! A recording turned by 180° is the same traffic: the frame of the image leaves no trace in the model.

use crate::common;

use std::fs;

use crate::common::exid::Plain;
use crate::common::small::Texts;
use lanesweep::traffic::mining::{MiningOptions, mine};
use lanesweep::traffic::trajectory::{Carriageway, Recording, Track};

/// Length of the road, hundredths of a metre.
const ROAD: i64 = 42_000;

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
    let mut meta = Plain::of_text(&texts.recording_meta);
    let [upper, lower] = ["upperLaneMarkings", "lowerLaneMarkings"].map(|name| meta.at(name));
    let row = &mut meta.rows[0];
    let lines = (row[upper].split(';').count() + row[lower].split(';').count()) as i64;
    let mirrored = |cell: &str| -> String {
        cell.split(';').rev().map(|line| decimal(-hundredths(line))).collect::<Vec<_>>().join(";")
    };
    (row[upper], row[lower]) = (mirrored(&row[lower]), mirrored(&row[upper]));
    let mut tracks_meta = Plain::of_text(&texts.tracks_meta);
    let direction = tracks_meta.at("drivingDirection");
    for row in &mut tracks_meta.rows {
        row[direction] = if row[direction] == "1" { "2" } else { "1" }.to_owned();
    }
    let mut tracks = Plain::of_text(&texts.tracks);
    let [x, y, length, width, lane] = ["x", "y", "width", "height", "laneId"].map(|name| tracks.at(name));
    let reversed = ["xVelocity", "yVelocity", "xAcceleration", "yAcceleration"].map(|name| tracks.at(name));
    for row in &mut tracks.rows {
        row[x] = decimal(ROAD - hundredths(&row[x]) - hundredths(&row[length]));
        row[y] = decimal(-hundredths(&row[y]) - hundredths(&row[width]));
        reversed.iter().for_each(|&at| row[at] = decimal(-hundredths(&row[at])));
        row[lane] = (lines + 2 - row[lane].parse::<i64>().unwrap()).to_string();
    }
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
        let fixed = |t: &Track| (t.id, t.class, t.first_frame, t.length_m, t.width_m, t.len());
        assert_eq!(fixed(&a), fixed(&b));
        assert_eq!(a.carriageway, 1 - b.carriageway);
        assert_eq!((a.lane, a.v_s_mps, a.v_d_mps, a.a_s_mps2), (b.lane, b.v_s_mps, b.v_d_mps, b.a_s_mps2));
        // Forward positions start from the other end of the road: s for +x is road + s of the turned one.
        let shift_m = if a.carriageway == 1 { ROAD as f64 / 100.0 } else { -ROAD as f64 / 100.0 };
        assert!(a.s_m.iter().zip(&b.s_m).all(|(a, b)| (a - b - shift_m).abs() < 1e-9), "{}", a.id);
        assert!(a.d_m.iter().zip(&b.d_m).all(|(a, b)| (a - b).abs() < 1e-9), "{}", a.id);
    }
}

/// Recording 04 has an on-ramp, so its carriageways have unequal lane counts.
#[test]
fn recordings_turned_by_180_degrees_are_the_same_traffic_with_the_same_scenarios() {
    let texts = Texts::small();
    assert_same_traffic(&texts.read().unwrap().recording, &turned(&texts).read().unwrap().recording);
    let Some(dir) = common::sumo_recordings() else { return };
    for id in ["01", "02", "03", "04"] {
        let text = |name: &str| fs::read_to_string(dir.join(format!("{id}_{name}.csv"))).unwrap();
        let [tracks, tracks_meta, recording_meta] = ["tracks", "tracksMeta", "recordingMeta"].map(text);
        let texts = Texts { tracks, tracks_meta, recording_meta };
        let [there, back] = [&texts, &turned(&texts)].map(|texts| texts.read().unwrap().recording);
        assert_same_traffic(&there, &back);
        let [there, back] = [there, back].map(|recording| mine(&recording, &MiningOptions::default()));
        assert!(!there.scenarios.is_empty());
        assert_eq!((there.data_sets, there.scenarios), (back.data_sets, back.scenarios), "recording {id}");
    }
}
