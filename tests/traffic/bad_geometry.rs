//! Recordings whose numbers are plausible one by one, but not beside one another.

use crate::common::exid::Plain;
use crate::common::small::{self, Texts, cruising};

use lanesweep::model::plausibility::Implausible;
use lanesweep::prelude::*;
use lanesweep::traffic::trajectory::{Track, highd};

/// Ten vehicles in five lanes of both directions, 2.4 s; each sways across its lane.
fn traffic() -> Recording {
    let mut recording = small::recording();
    let lanes = [(0, 0), (1, 0), (0, 1), (1, 1), (0, 2)];
    let tracks = (1..=10).map(|id| {
        let (carriageway, lane) = lanes[id as usize % lanes.len()];
        let mut track = cruising(id, carriageway, lane, 1, 60, &recording);
        for (k, (d_m, v_d_mps)) in track.d_m.iter_mut().zip(&mut track.v_d_mps).enumerate() {
            let phase = k as f64 / 25.0 * 2.0;
            (*d_m, *v_d_mps) = (*d_m + 0.1 * phase.sin(), 0.2 * phase.cos());
        }
        track
    });
    recording.tracks = tracks.collect();
    highd::quantize(&mut recording).unwrap();
    recording
}

/// The recording with a column of `tracks` made anew from its value and the height of the box.
fn changed(texts: &Texts, column: &str, change: impl Fn(f64, f64) -> f64) -> Texts {
    let mut tracks = Plain::of_text(&texts.tracks);
    let height = tracks.at("height");
    tracks.map(column, |value, row| change(value, row[height].parse().unwrap()));
    Texts { tracks: tracks.text(), ..texts.clone() }
}

#[test]
fn a_mirrored_axis_and_a_wrong_reference_point_are_refused_and_good_geometry_says_nothing() {
    let texts = Texts::of(&traffic());
    assert_eq!(texts.read_checked(Implausible::Refused).unwrap().notes, [""; 0]);
    let y_with = |part: f64| changed(&texts, "y", |y, height| y + part * height);
    let cases: [(&str, Texts, &[&str]); 7] = [
        ("upside down", changed(&texts, "y", |y, _| -y), &["mirrored"]),
        ("upside down, corner", changed(&texts, "y", |y, height| -y - height), &["mirrored"]),
        ("from the other side", changed(&texts, "y", |y, height| 8.0 + 31.25 - y - height), &["mirrored"]),
        ("centre", y_with(0.5), &["half of the vehicles are at least 1.0 half widths", "cross lane lines"]),
        ("lower edge", y_with(1.0), &["cross lane lines"]),
        ("lateral speed", changed(&texts, "yVelocity", |v, _| -v), &["lateral speed", "mirrored"]),
        (
            "a lane beside",
            changed(&texts, "y", |y, _| y + 3.6),
            &["100 % of the samples", "vehicle 1 at frame 1", "`laneId`"],
        ),
    ];
    for (what, texts, says) in cases {
        let error: Error = texts.read_checked(Implausible::Refused).expect_err(what);
        let text = error.to_string().replace('`', "");
        for words in says {
            assert!(text.contains(&words.replace('`', "")), "{what}: `{words}` is not in: {text}");
        }
        assert!(text.contains("01_tracks.csv"), "{what}: {text}");
        let help = error.help().unwrap();
        let advice = ["it points down", "lane markings", "option `accept_implausible`"];
        assert!(advice.iter().all(|words| help.contains(words)), "{what}: {help}");
        let notes = texts.read_checked(Implausible::Accepted).unwrap().notes;
        assert!(!notes.is_empty(), "{what}: accepted without a word");
    }
}

/// One vehicle out of place is told, and the recording is used.
#[test]
fn a_single_vehicle_outside_its_lane_and_boxes_that_overlap_are_warnings() {
    let mut recording = traffic();
    // Vehicles 1 and 6 drive in one lane.
    let ahead_m = recording.tracks[0].s_m.clone();
    recording.tracks[5].s_m = ahead_m.iter().map(|s_m| s_m + 3.0).collect();
    recording.tracks[5].v_s_mps = recording.tracks[0].v_s_mps.clone();
    recording.tracks[1].d_m.iter_mut().for_each(|d_m| *d_m -= 5.0);
    let notes = Texts::of(&recording).read_checked(Implausible::Refused).unwrap().notes;
    let has = |words: &[&str]| notes.iter().any(|note| words.iter().all(|word| note.contains(word)));
    assert!(has(&["10 % of the samples", "vehicle 2 at frame 1", "laneId"]), "{notes:?}");
    assert!(has(&["1 pair(s) of vehicles overlap", "vehicles 1 and 6 at frame 25"]), "{notes:?}");
}

/// Readers of tracks do the same: `foreign_tables.rs`.
#[test]
fn a_speed_that_contradicts_the_positions_and_a_jump_are_refused_unless_accepted() {
    let mut recording = small::recording();
    recording.tracks = vec![small::cruising(1, 1, 0, 1, 300, &recording)];
    recording.tracks[0].v_s_mps[0] += 0.1;
    highd::quantize(&mut recording).unwrap();
    let spoilt: [fn(&mut Track); 2] =
        [|track| track.v_s_mps[30] = 0.0, |track| track.s_m[30..].iter_mut().for_each(|s| *s += 8.0)];
    for spoil in spoilt {
        let mut wrong = recording.clone();
        spoil(&mut wrong.tracks[0]);
        let texts = Texts::of(&wrong);
        let error = texts.read_checked(Implausible::Refused).unwrap_err();
        let said = error.to_string();
        let parts = ["01_tracks.csv", "vehicle 1 at frame", "its speed is", "but it moves by"];
        assert!(parts.iter().all(|part| said.contains(part)) && error.help().is_some(), "{said}");
        let accepted = texts.read().unwrap();
        assert!(accepted.notes.iter().any(|note| note.contains("its speed is")), "{:?}", accepted.notes);
    }
    // A small jump is said.
    recording.tracks[0].s_m[30..].iter_mut().for_each(|s| *s += 3.0);
    let loaded = Texts::of(&recording).read().unwrap();
    assert!(loaded.notes.iter().any(|note| note.contains("jump by more than 2 m")), "{:?}", loaded.notes);
}
