//! Bad highD files: every one is refused with a message that says where, what was expected and what to do.

use std::fs;

use crate::common::small::{self, Texts, edit_line, with_field, with_repeated_line, without_column, without_line};
use lanesweep::Error;
use lanesweep::model::plausibility::Implausible;
use lanesweep::traffic::trajectory::Track;
use lanesweep::traffic::trajectory::highd;

/// The message has all of these and comes with advice.
#[track_caller]
fn assert_says(error: &Error, parts: &[&str]) {
    let message = error.to_string();
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    let help = error.help().unwrap_or_default();
    assert!(help.len() > 10, "no advice with: {message}");
    assert!(message.len() < 1000 && !message.contains('\n'), "too long or several lines: {message}");
}

/// Spoils the small recording; the reader refuses it with a message that has all of these parts.
#[track_caller]
fn refused(spoil: impl Fn(&mut Texts), parts: &[&str]) -> Error {
    let mut texts = Texts::small();
    spoil(&mut texts);
    match texts.read() {
        Ok(loaded) => panic!("accepted: {:?}", loaded.notes),
        Err(error) => {
            assert_says(&error, parts);
            error
        }
    }
}

/// One of the three texts by the name of its file.
fn text_of<'t>(texts: &'t mut Texts, name: &str) -> &'t mut String {
    match name {
        "tracks" => &mut texts.tracks,
        "tracksMeta" => &mut texts.tracks_meta,
        _ => &mut texts.recording_meta,
    }
}

/// Changes one of the three files; the message names it and has these parts.
#[track_caller]
fn edited(name: &str, edit: impl Fn(&str) -> String, says: &[&str]) -> Error {
    let file = format!("01_{name}.csv");
    let spoil = |texts: &mut Texts| {
        let text = text_of(texts, name);
        *text = edit(text);
    };
    refused(spoil, &[&[file.as_str()], says].concat())
}

/// Spoils one field; the message names file, line and column and has these parts.
#[track_caller]
fn field(name: &str, line: usize, column: &str, value: &str, says: &[&str]) -> Error {
    let place = [format!("line {line}"), format!("column `{column}`")];
    let place = place.each_ref().map(String::as_str);
    edited(name, |text| with_field(text, line, column, value), &[&place, says].concat())
}

#[test]
fn a_recording_with_one_file_missing_is_a_problem_and_the_others_are_used() {
    for missing in ["_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv"] {
        let dir = tempfile::tempdir().unwrap();
        for id in ["02", "01", "03"] {
            for suffix in ["_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv"] {
                fs::write(dir.path().join(format!("{id}{suffix}")), "").unwrap();
            }
        }
        fs::write(dir.path().join("notes.txt"), "").unwrap();
        fs::write(dir.path().join("._01_tracks.csv"), "").unwrap();
        fs::remove_file(dir.path().join(format!("02{missing}"))).unwrap();
        let inventory = highd::inventory(dir.path()).unwrap();
        let ids: Vec<&str> = inventory.recordings.iter().map(|files| files.id.as_str()).collect();
        assert_eq!(ids, ["01", "03"]);
        assert_eq!(inventory.problems.len(), 1);
        assert_says(&inventory.problems[0], &["recording `02`", &format!("02{missing} is missing")]);
    }
}

#[test]
fn folders_without_a_whole_recording_are_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    let inventory = |path: &std::path::Path| highd::inventory(path).unwrap_err();
    assert_says(&inventory(dir.path()), &["no recording", "NN_tracks.csv", "NN_tracksMeta.csv"]);
    assert_says(&inventory(&dir.path().join("absent")), &["absent", "cannot read the folder"]);
    let inner = dir.path().join("data");
    fs::create_dir(&inner).unwrap();
    fs::write(inner.join("01_tracks.csv"), "").unwrap();
    assert!(inventory(dir.path()).help().unwrap().contains(&inner.display().to_string()));
    assert_says(&inventory(&inner), &["recording `01`", "01_tracksMeta.csv and 01_recordingMeta.csv are missing"]);
    assert_says(&inventory(&inner.join("01_tracks.csv")), &["this is a file; expected a folder"]);
    fs::write(inner.join("02_tracks.csv"), "").unwrap();
    assert_says(&inventory(&inner), &["none of the 2 recordings is complete", "01_tracksMeta.csv"]);
}

#[test]
fn a_missing_column_is_named_with_its_file() {
    for (name, columns) in [
        ("tracks", &["frame", "id", "x", "y", "xVelocity", "yVelocity", "xAcceleration"][..]),
        ("tracksMeta", &["id", "width", "height", "class", "drivingDirection"]),
        ("recordingMeta", &["frameRate", "upperLaneMarkings", "lowerLaneMarkings"]),
    ] {
        for column in columns {
            let says = ["line 1", &format!("column `{column}`"), "missing"];
            let error = edited(name, |text| without_column(text, column), &says);
            // Another column of the format is no misspelling of this one.
            assert!(!error.help().unwrap().contains("rename"), "{:?}", error.help());
        }
    }
}

#[test]
fn a_renamed_column_is_recognised() {
    for (name, column, renamed) in [
        ("tracks", "xVelocity", "x_velocity"),
        ("tracks", "xAcceleration", "xAccel"),
        ("tracks", "frame", "Frame"),
        ("tracks", "id", "ID"),
        ("tracks", "laneId", "lane_id"),
        ("tracksMeta", "drivingDirection", "driving_direction"),
    ] {
        let rename = |line: &str| {
            let names = line.split(',').map(|of| if of == column { renamed } else { of });
            names.collect::<Vec<_>>().join(",")
        };
        let says = ["line 1", &format!("column `{column}`"), &format!("`{renamed}`")];
        let error = edited(name, |text| edit_line(text, 1, rename), &says);
        assert!(error.help().unwrap().contains(&format!("rename the column `{renamed}` to `{column}`")));
    }
}

#[test]
fn what_no_field_can_hold_is_named_with_file_line_and_column() {
    for column in ["x", "y", "xVelocity", "yVelocity", "xAcceleration"] {
        for (value, says) in [
            ("abc", "`abc` is not a number"),
            ("", "empty"),
            ("NaN", "`NaN` is not finite"),
            ("-Infinity", "not finite"),
            ("1e999", "not finite"),
            ("1e300", "out of range"),
        ] {
            field("tracks", 5, column, value, &[says]);
        }
    }
    // Lines 2 to 9 of the tracks are vehicle 1, frames 1 to 8.
    for (name, line, column, values, says) in [
        ("tracks", 5, "frame", "2.5", "`2.5` is not a whole number"),
        ("tracks", 5, "frame", "3", "frame 3 of this vehicle occurs twice"),
        ("tracks", 5, "frame", "0", "out of order"),
        ("tracks", 2, "frame", "9e14", "out of range"),
        ("tracksMeta", 3, "width", "-4.50 0.00 nan", ""),
        ("tracksMeta", 3, "height", "-1.80 0", ""),
        ("tracksMeta", 2, "id", "-1 4294967296 x", ""),
        ("tracksMeta", 4, "drivingDirection", "0 3 -1 north", ""),
        ("tracksMeta", 4, "class", "Tram", "`Car` or `Truck`"),
        ("recordingMeta", 2, "frameRate", "0 0.00 -25 NaN inf fast 1e9 1e-9", ""),
        ("recordingMeta", 2, "upperLaneMarkings", " ", "vehicle 1 drives in direction 1"),
        ("recordingMeta", 2, "lowerLaneMarkings", " ", "vehicle 5 drives in direction 2"),
        ("recordingMeta", 2, "upperLaneMarkings", "8.00;15.50;11.75;19.25", "11.75 comes after 15.5"),
        ("recordingMeta", 2, "lowerLaneMarkings", "24.00;24.00;31.25", "do not ascend"),
        ("recordingMeta", 2, "lowerLaneMarkings", "24.00;;31.25", "`` is not a finite number"),
        ("recordingMeta", 2, "lowerLaneMarkings", "24.00", "1 lane line"),
        ("recordingMeta", 2, "lowerLaneMarkings", "4.00;7.50;11.25", "above the last of the upper ones"),
    ] {
        let values = if says.is_empty() { values.split(' ').collect() } else { vec![values] };
        values
            .into_iter()
            .for_each(|value| drop(field(name, line, column, value, &[if says.is_empty() { value } else { says }])));
    }
}

#[test]
fn tables_that_are_not_whole_are_refused_with_what_is_missing() {
    let header = |table: &str| table.lines().next().unwrap().to_owned() + "\n";
    let swapped = |text: &str| {
        let mut lines: Vec<&str> = text.lines().collect();
        lines.swap(4, 5);
        lines.join("\n")
    };
    let neither = |text: &str| with_field(&with_field(text, 2, "upperLaneMarkings", ""), 2, "lowerLaneMarkings", "");
    type Edit<'a> = &'a dyn Fn(&str) -> String;
    let edits: [(&str, Edit, &[&str]); 18] = [
        ("tracks", &|text| text.replacen("yAcceleration", "x", 1), &["line 1", "column `x`", "twice"]),
        ("tracks", &|text| with_field(text, 5, "x", "1,5"), &["line 5", "26 fields"]),
        ("tracks", &|text| without_line(text, 5), &["line 5", "column `frame`", "vehicle 1", "gap"]),
        ("tracks", &|text| with_repeated_line(text, 4), &["line 28", "vehicle 1", "twice"]),
        ("tracks", &swapped, &["line 5", "out of order"]),
        ("tracksMeta", &|text| with_repeated_line(text, 2), &["line 6", "vehicle 1", "same id"]),
        ("tracks", &header, &["vehicle 1", "has 0 frames", "3 more vehicles"]),
        ("tracks", &|_| String::new(), &["empty", "header"]),
        ("tracksMeta", &|_| "\r\n\r\n".to_owned(), &["empty"]),
        ("recordingMeta", &|text| without_line(text, 2), &["no line after the header"]),
        ("recordingMeta", &|text| with_repeated_line(text, 2), &["line 3", "second line"]),
        ("recordingMeta", &neither, &["line 2", "lane lines are missing"]),
        ("tracks", &|text| edit_line(text, 6, |line| line[..20].to_owned()), &["line 6", "expected 25"]),
        ("tracks", &|text| edit_line(text, 6, |line| line.replacen(',', ",\"", 1)), &["line 6", "quotation mark"]),
        ("tracksMeta", &|text| edit_line(text, 3, |line| format!("{line},")), &["line 3", "17 fields"]),
        ("tracks", &|text| text.replace(',', ";"), &["line 1", "';'", "expected commas"]),
        ("tracks", &|text| text.lines().take(22).collect::<Vec<_>>().join("\n"), &["vehicle 7", "truncated?"]),
        ("tracks", &|text| text[..text.trim_end().rfind(',').unwrap() + 1].to_owned(), &["`laneId`", "empty"]),
    ];
    edits.into_iter().for_each(|(name, edit, says)| drop(edited(name, edit, says)));
    // Wherever the last line is cut, except inside the very last number: nothing tells 12 from 1 there.
    let whole = Texts::small().tracks;
    let (last_line, last_field) =
        [('\n', 1), (',', 0)].map(|(c, more)| whole.trim_end().rfind(c).unwrap() + more).into();
    for cut in last_line..last_field {
        edited("tracks", |text| text[..cut].to_owned(), &["truncated"]);
    }
    let lost = ["01_tracks.csv", "line 10", "column `id`", "vehicle 2 is not in the tracksMeta file"];
    refused(|t| t.tracks_meta = without_line(&t.tracks_meta, 3), &lost);
    // The last takes no memory.
    for count in ["6", "999999999999999999"] {
        let spoil = |t: &mut Texts| t.tracks_meta = with_field(&t.tracks_meta, 2, "numFrames", count);
        refused(spoil, &["vehicle 1", "has 8 frames", &format!("claims {count}")]);
    }
    let shifted = |t: &mut Texts| t.tracks_meta = with_field(&t.tracks_meta, 3, "initialFrame", "77");
    refused(shifted, &["vehicle 2", "begins at frame", "says 77, unlike for the first vehicle"]);
    // Without numFrames, first and last frame say how many there must be.
    let uncounted = |t: &Texts| (without_column(&t.tracks_meta, "numFrames"), without_line(&t.tracks, 27));
    refused(|t| (t.tracks_meta, t.tracks) = uncounted(t), &["vehicle 7", "has 4 frames", "claims 5"]);
}

/// UTF-16, and Latin-1 in a number and in the class.
#[test]
fn another_encoding_is_recognised() {
    let t = Texts::small();
    let recording = t.recording_meta.as_bytes();
    let wide: Vec<u8> = t.tracks.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let latin = |text: String| -> Vec<u8> { text.bytes().map(|b| if b == b'?' { 0xfc } else { b }).collect() };
    let (y, class) = (latin(with_field(&t.tracks, 4, "y", "1?")), latin(with_field(&t.tracks_meta, 4, "class", "C?r")));
    let [tracks, meta] = [t.tracks.as_bytes(), t.tracks_meta.as_bytes()];
    for (files, says) in [
        ([&wide[..], meta, recording], ["01_tracks.csv", "line 1", "UTF-8"]),
        ([&y, meta, recording], ["01_tracks.csv", "line 4", "column `y`"]),
        ([tracks, &class, recording], ["01_tracksMeta.csv", "column `class`", "UTF-8"]),
    ] {
        assert_says(&small::read_bytes(files).unwrap_err(), &says);
    }
}

#[test]
fn small_speeds_backwards_are_noise_that_is_counted_and_larger_ones_an_error() {
    // Line 5 is vehicle 1 in the upper lanes, which drive towards -x; line 20 vehicle 5 in the lower ones.
    for (line, sign) in [(5, 1.0), (20, -1.0)] {
        let with = |speed: f64| {
            let mut texts = Texts::small();
            texts.tracks = with_field(&texts.tracks, line, "xVelocity", &(sign * speed).to_string());
            texts
        };
        let loaded = with(0.49).read().unwrap();
        let noise: Vec<&String> = loaded.notes.iter().filter(|note| note.contains("is taken as 0, once")).collect();
        let place = format!("line {line}, column `xVelocity`");
        assert!(noise.len() == 1 && noise[0].contains(&place), "{:?}", loaded.notes);
        assert!(loaded.recording.tracks.iter().flat_map(|track| &track.v_s_mps).all(|v| *v >= 0.0));
        for speed in [0.5, 20.0] {
            let says = ["01_tracks.csv", &format!("line {line}"), "column `xVelocity`", "drives backwards"];
            assert_says(&with(speed).read().unwrap_err(), &says);
        }
    }
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
        assert_says(&error, &["01_tracks.csv", "vehicle 1 at frame", "its speed is", "but it moves by"]);
        let accepted = texts.read().unwrap();
        assert!(accepted.notes.iter().any(|note| note.contains("its speed is")), "{:?}", accepted.notes);
    }
    // A small jump is said.
    recording.tracks[0].s_m[30..].iter_mut().for_each(|s| *s += 3.0);
    let loaded = Texts::of(&recording).read().unwrap();
    assert!(loaded.notes.iter().any(|note| note.contains("jump by more than 2 m")), "{:?}", loaded.notes);
}

#[test]
fn what_no_road_has_is_refused_unless_accepted_and_then_told() {
    let lines = "-350.00;11.75;15.50;19.25";
    for (name, line, column, value, says) in [
        ("tracks", 5, "xVelocity", "-108", "km/h: 30 m/s"),
        ("tracks", 5, "y", "12.6", "lateral speed"),
        ("tracks", 5, "yVelocity", "11", "column `yVelocity`"),
        ("tracksMeta", 3, "width", "430", "cm: 4.3 m"),
        ("tracksMeta", 3, "height", "0.05", "column `height`"),
        ("recordingMeta", 2, "upperLaneMarkings", lines, "lane width"),
    ] {
        let mut texts = Texts::small();
        let text = text_of(&mut texts, name);
        *text = with_field(text, line, column, value);
        let says = [&format!("line {line}"), says];
        let error = texts.read_checked(Implausible::Refused).expect_err(column);
        assert_says(&error, &says);
        assert!(error.help().unwrap().contains("option `accept_implausible`"), "{column}");
        let notes = texts.read().unwrap().notes;
        assert!(notes.iter().any(|note| says.iter().all(|said| note.contains(said))), "{column}: {notes:?}");
    }
}

#[test]
fn line_numbers_count_the_header_and_hold_with_windows_line_ends_and_blank_lines() {
    let spoiled = |text: &str| with_field(text, 5, "x", "?");
    let last = |text: &str| with_field(text, 27, "x", "?");
    edited("tracks", spoiled, &["line 5", "column `x`"]);
    edited("tracks", |text| spoiled(text).replace('\n', "\r\n"), &["line 5", "column `x`"]);
    edited("tracks", |text| format!("\u{feff}{}", spoiled(text)), &["line 5", "column `x`"]);
    edited("tracks", |text| spoiled(text).replacen('\n', "\n\n\n", 1), &["line 7", "column `x`"]);
    edited("tracks", last, &["line 27", "column `x`"]);
    edited("tracks", |text| last(text).trim_end().to_owned(), &["line 27", "column `x`"]);
}
