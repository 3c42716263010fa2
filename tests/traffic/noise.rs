//! Noise decides nothing in silence: rounded positions, rounded speeds and one speed per vehicle are said, and good tracks are not doubted.

use std::sync::OnceLock;

use lanesweep::model::plausibility::Implausible;
use lanesweep::prelude::*;
use lanesweep::traffic::mining::{count, mine, mine_loaded};

use crate::common::exid::Plain;
use crate::traffic::tracks::{read_by, shorter, understood};

/// Generated traffic, whose positions are the integrals of its speeds.
fn recording() -> Recording {
    let made = || {
        let mut recording = shorter();
        for track in &mut recording.tracks {
            for k in 1..track.len() {
                track.s_m[k] = track.s_m[k - 1] + 0.5 * (track.v_s_mps[k - 1] + track.v_s_mps[k]) / 25.0;
            }
        }
        recording
    };
    static MADE: OnceLock<Recording> = OnceLock::new();
    MADE.get_or_init(made).clone()
}

fn without_speeds(radius_m: f64) -> Plain {
    Plain::on_bend(&recording(), 1, radius_m).without(&["heading", "speed", "vx", "vy"])
}

fn rounded(mut table: Plain, columns: &[&str], step: f64) -> Plain {
    columns.iter().for_each(|column| table.map(column, |value, _| (value / step).round() * step));
    table
}

/// Kept leader decelerations of a table, and the notes on noise.
fn mined(table: &Plain, smoothing_s: Option<f64>) -> (u64, Vec<String>) {
    let read = read_by(table, &|preset| preset.smoothing_s = smoothing_s).unwrap();
    let graves: Vec<_> = read.understanding.findings.iter().filter(|finding| finding.is_grave).collect();
    assert!(graves.is_empty(), "{graves:?}");
    let (_, mut found) = mine_loaded(&read, &MiningOptions::default(), Implausible::Refused);
    found.notes.retain(|note| note.contains("noise can decide"));
    (count(&found.scenarios, Category::Lvd).kept, found.notes)
}

/// Kept leader decelerations by the exact speeds.
fn right() -> u64 {
    let kept = count(&mine(&recording(), &MiningOptions::default()).scenarios, Category::Lvd).kept;
    assert!(kept > 3);
    kept
}

#[test]
fn good_tracks_have_no_note_of_noise_on_a_straight_road_or_a_bend() {
    let with_speeds = Plain::of(&recording(), 1).without(&["heading", "speed"]);
    for table in [rounded(with_speeds, &["x", "y", "vx", "vy"], 0.01), without_speeds(f64::INFINITY)] {
        assert_eq!(mined(&table, None), (right(), Vec::new()));
    }
    for smoothing_s in [None, Some(1.0)] {
        let (kept, notes) = mined(&without_speeds(600.0), smoothing_s);
        assert!(notes.is_empty(), "{notes:?}");
        assert!(kept.abs_diff(right()) <= 1, "{smoothing_s:?}: {kept} of {}", right());
    }
}

#[test]
fn rounded_values_that_decide_are_said_and_smoothing_repairs_them() {
    let positions = ["x", "y"];
    let with_speed = || Plain::of(&recording(), 1).without(&["heading", "vx", "vy"]);
    for (what, table, smoothing_s) in [
        ("positions in cm", rounded(without_speeds(f64::INFINITY), &positions, 0.01), 1.0),
        ("positions in dm", rounded(without_speeds(f64::INFINITY), &positions, 0.1), 1.5),
        ("whole km/h", rounded(with_speed(), &["speed"], 1.0 / 3.6), 1.0),
    ] {
        let (kept, notes) = mined(&table, None);
        assert!(kept > 2 * right(), "{what}: {kept}");
        let [note] = &notes[..] else { panic!("{what}: {notes:?}") };
        assert!(note.contains("noise can decide") && note.contains("`smoothing_s`"), "{what}: {note}");
        let (kept, notes) = mined(&table, Some(smoothing_s));
        assert!(notes.is_empty() && kept.abs_diff(right()) <= 2, "{what}: {kept} of {}, {notes:?}", right());
    }
}

#[test]
fn one_speed_per_vehicle_is_refused() {
    let mut recording = recording();
    for track in &mut recording.tracks {
        let mean = track.v_s_mps.iter().sum::<f64>() / track.len() as f64;
        track.v_s_mps.fill(mean);
        track.v_d_mps.fill(0.0);
    }
    let table = Plain::of(&recording, 5).without(&["heading", "vx", "vy"]);
    let found = understood(&table).unwrap().findings;
    assert!(found.iter().any(|of| of.is_grave && of.text.contains("one speed per vehicle")), "{found:?}");
}
