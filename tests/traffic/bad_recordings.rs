//! Bad highD files: every one is refused with a message that says where, what was expected and what to do.

use std::fs;
use std::path::Path;

use crate::common::small::{self, Texts, edit_line, with_field, with_repeated_line, without_column, without_line};
use lanesweep::Error;
use lanesweep::support::plausibility::Implausible;
use lanesweep::traffic::trajectory::Track;
use lanesweep::traffic::trajectory::highd::{self, HighdFiles};
use proptest::prelude::*;

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
fn a_folder_whose_only_recording_lacks_a_file_names_that_file() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("01_tracks.csv"), "").unwrap();
    let error = highd::inventory(dir.path()).unwrap_err();
    assert_says(&error, &["recording `01`", "01_tracksMeta.csv and 01_recordingMeta.csv are missing"]);
    fs::write(dir.path().join("02_tracks.csv"), "").unwrap();
    let error = highd::inventory(dir.path()).unwrap_err();
    assert_says(&error, &["none of the 2 recordings is complete", "01_tracksMeta.csv"]);
}

#[test]
fn an_empty_folder_a_file_and_a_path_that_is_not_there_are_told_apart() {
    let dir = tempfile::tempdir().unwrap();
    let name = dir.path().display().to_string();
    let error = highd::inventory(dir.path()).unwrap_err();
    assert_says(&error, &[&name, "no recording", "NN_tracks.csv", "NN_tracksMeta.csv", "NN_recordingMeta.csv"]);

    let file = dir.path().join("01_tracks.csv");
    fs::write(&file, "").unwrap();
    assert_says(&highd::inventory(&file).unwrap_err(), &["01_tracks.csv", "this is a file; expected a folder"]);

    let absent = dir.path().join("absent");
    assert_says(&highd::inventory(&absent).unwrap_err(), &["absent", "cannot read the folder"]);
}

#[test]
fn the_folder_around_the_recordings_points_to_the_one_inside() {
    let dir = tempfile::tempdir().unwrap();
    let inner = dir.path().join("data");
    fs::create_dir(&inner).unwrap();
    fs::write(inner.join("01_tracks.csv"), "").unwrap();
    let error = highd::inventory(dir.path()).unwrap_err();
    assert!(error.help().unwrap().contains(&inner.display().to_string()), "{:?}", error.help());
}

#[test]
#[cfg(unix)]
fn a_folder_or_file_without_permission_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let forbid = |path: &Path| fs::set_permissions(path, fs::Permissions::from_mode(0o000)).unwrap();
    let allow = |path: &Path| fs::set_permissions(path, fs::Permissions::from_mode(0o700)).unwrap();
    let dir = tempfile::tempdir().unwrap();
    highd::write(dir.path(), &small::recording()).unwrap();
    let files = HighdFiles::named(dir.path(), "01");
    forbid(&files.tracks);
    let from_file = fs::read(&files.tracks).is_err().then(|| highd::read(&files));
    allow(&files.tracks);
    forbid(dir.path());
    let from_folder = fs::read_dir(dir.path()).is_err().then(|| highd::inventory(dir.path()));
    allow(dir.path());
    let (Some(from_file), Some(from_folder)) = (from_file, from_folder) else {
        eprintln!("SKIPPED: needs a user whom file permissions stop; this one reads everything (root?)");
        return;
    };
    assert_says(&from_file.unwrap_err(), &["01_tracks.csv", "cannot read"]);
    assert_says(&from_folder.unwrap_err(), &[&dir.path().display().to_string(), "cannot read the folder"]);
}

#[test]
fn a_missing_column_is_named_with_its_file() {
    for column in ["frame", "id", "x", "y", "xVelocity", "yVelocity", "xAcceleration"] {
        let name = format!("column `{column}`");
        let error =
            refused(|t| t.tracks = without_column(&t.tracks, column), &["01_tracks.csv", "line 1", &name, "missing"]);
        // Another column of the format is no misspelling of this one.
        assert!(!error.help().unwrap().contains("rename"), "{:?}", error.help());
    }
    for column in ["id", "width", "height", "class", "drivingDirection"] {
        let name = format!("column `{column}`");
        refused(
            |t| t.tracks_meta = without_column(&t.tracks_meta, column),
            &["01_tracksMeta.csv", "line 1", &name, "missing"],
        );
    }
    for column in ["frameRate", "upperLaneMarkings", "lowerLaneMarkings"] {
        let name = format!("column `{column}`");
        refused(
            |t| t.recording_meta = without_column(&t.recording_meta, column),
            &["01_recordingMeta.csv", "line 1", &name, "missing"],
        );
    }
}

#[test]
fn a_renamed_column_is_recognised() {
    for (column, renamed) in [
        ("xVelocity", "x_velocity"),
        ("xAcceleration", "xAccel"),
        ("frame", "Frame"),
        ("id", "ID"),
        ("laneId", "lane_id"),
    ] {
        let error = refused(
            |t| {
                t.tracks = edit_line(&t.tracks, 1, |line| {
                    format!(",{line},")
                        .replace(&format!(",{column},"), &format!(",{renamed},"))
                        .trim_matches(',')
                        .to_owned()
                })
            },
            &["01_tracks.csv", "line 1", &format!("column `{column}`"), &format!("`{renamed}`")],
        );
        assert!(error.help().unwrap().contains(&format!("rename the column `{renamed}` to `{column}`")));
    }
    refused(
        |t| t.tracks_meta = t.tracks_meta.replace("drivingDirection", "driving_direction"),
        &["01_tracksMeta.csv", "column `drivingDirection`", "`driving_direction`"],
    );
}

#[test]
fn a_column_that_is_there_twice_is_refused() {
    refused(
        |t| t.tracks = t.tracks.replacen("yAcceleration", "x", 1),
        &["01_tracks.csv", "line 1", "column `x`", "twice"],
    );
}

#[test]
fn what_is_no_finite_number_is_named_with_line_and_column() {
    for (value, says) in [
        ("abc", "`abc` is not a number"),
        ("", "empty"),
        ("1,5", "26 fields"),
        ("NaN", "`NaN` is not finite"),
        ("inf", "`inf` is not finite"),
        ("-Infinity", "not finite"),
        ("1e999", "not finite"),
        ("1e300", "out of range"),
        ("1.2.3", "`1.2.3` is not a number"),
    ] {
        for column in ["x", "y", "xVelocity", "yVelocity", "xAcceleration"] {
            let column_says = if value.contains(',') { String::new() } else { format!("column `{column}`") };
            refused(
                |t| t.tracks = with_field(&t.tracks, 5, column, value),
                &["01_tracks.csv", "line 5", &column_says, says],
            );
        }
    }
    for column in ["frame", "id", "laneId"] {
        refused(
            |t| t.tracks = with_field(&t.tracks, 5, column, "2.5"),
            &["01_tracks.csv", "line 5", &format!("column `{column}`"), "`2.5` is not a whole number"],
        );
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
        assert!(
            noise.len() == 1 && noise[0].contains(&format!("line {line}, column `xVelocity`")),
            "{:?}",
            loaded.notes
        );
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
    recording.tracks = vec![small::cruising(1, 1, 0, 1, 60, &recording)];
    highd::quantize(&mut recording).unwrap();
    let spoilt: [fn(&mut Track); 2] =
        [|track| track.v_s_mps[30] = 0.0, |track| track.s_m[30..].iter_mut().for_each(|s| *s += 8.0)];
    for spoil in spoilt {
        let mut wrong = recording.clone();
        spoil(&mut wrong.tracks[0]);
        let dir = tempfile::tempdir().unwrap();
        highd::write(dir.path(), &wrong).unwrap();
        let files = HighdFiles::named(dir.path(), "01");
        let error = highd::read_checked(&files, Implausible::Refused).unwrap_err();
        assert_says(&error, &["01_tracks.csv", "`xVelocity`", "vehicle 1 at frame", "its speed is", "but it moves by"]);
        let accepted = highd::read(&files).unwrap();
        assert!(accepted.notes.iter().any(|note| note.contains("its speed is")), "{:?}", accepted.notes);
    }
    // A small jump is said.
    recording.tracks[0].s_m[30..].iter_mut().for_each(|s| *s += 3.0);
    let loaded = Texts::of(&recording).read().unwrap();
    assert!(loaded.notes.iter().any(|note| note.contains("jump by more than 2 m")), "{:?}", loaded.notes);
}

#[test]
fn what_no_road_has_is_refused_unless_accepted_and_then_told() {
    type Change = fn(&mut Texts);
    let cases: [(&str, Change, &[&str]); 6] = [
        ("speed", |t| t.tracks = with_field(&t.tracks, 5, "xVelocity", "-108"), &["line 5", "km/h: 30 m/s"]),
        ("jump", |t| t.tracks = with_field(&t.tracks, 5, "y", "12.6"), &["line 5", "column `y`", "lateral speed"]),
        ("lateral", |t| t.tracks = with_field(&t.tracks, 5, "yVelocity", "11"), &["line 5", "column `yVelocity`"]),
        ("length", |t| t.tracks_meta = with_field(&t.tracks_meta, 3, "width", "430"), &["line 3", "cm: 4.3 m"]),
        ("width", |t| t.tracks_meta = with_field(&t.tracks_meta, 3, "height", "0.05"), &["line 3", "column `height`"]),
        (
            "lanes",
            |t| t.recording_meta = t.recording_meta.replace("8.00;11.75;", "-350.00;11.75;"),
            &["line 2", "lane width"],
        ),
    ];
    for (what, spoil, says) in cases {
        let dir = tempfile::tempdir().unwrap();
        let mut texts = Texts::small();
        spoil(&mut texts);
        let files = HighdFiles::named(dir.path(), "01");
        for (path, text) in [
            (&files.tracks, &texts.tracks),
            (&files.tracks_meta, &texts.tracks_meta),
            (&files.recording_meta, &texts.recording_meta),
        ] {
            fs::write(path, text).unwrap();
        }
        let error = highd::read_checked(&files, Implausible::Refused).expect_err(what);
        assert_says(&error, says);
        assert!(error.help().unwrap().contains("option `accept_implausible`"), "{what}");
        let loaded = highd::read_checked(&files, Implausible::Accepted).unwrap();
        assert!(
            loaded.notes.iter().any(|note| says.iter().all(|said| note.contains(said))),
            "{what}: {:?}",
            loaded.notes
        );
    }
}

#[test]
fn line_numbers_count_the_header_and_hold_with_windows_line_ends_and_blank_lines() {
    let spoiled = |t: &Texts| with_field(&t.tracks, 5, "x", "?");
    refused(|t| t.tracks = spoiled(t), &["line 5", "column `x`"]);
    refused(|t| t.tracks = spoiled(t).replace('\n', "\r\n"), &["line 5", "column `x`"]);
    refused(|t| t.tracks = format!("\u{feff}{}", spoiled(t)), &["line 5", "column `x`"]);
    refused(|t| t.tracks = spoiled(t).replacen('\n', "\n\n\n", 1), &["line 7", "column `x`"]);
    let last = |t: &Texts| with_field(&t.tracks, 27, "x", "?");
    refused(|t| t.tracks = last(t), &["line 27", "column `x`"]);
    refused(|t| t.tracks = last(t).trim_end().to_owned(), &["line 27", "column `x`"]);
}

#[test]
fn a_size_that_is_zero_or_negative_is_refused() {
    for (column, value) in
        [("width", "-4.50"), ("width", "0.00"), ("height", "-1.80"), ("height", "0"), ("height", "nan")]
    {
        refused(
            |t| t.tracks_meta = with_field(&t.tracks_meta, 3, column, value),
            &["01_tracksMeta.csv", "line 3", &format!("column `{column}`"), value],
        );
    }
}

#[test]
fn duplicates_disorder_and_gaps_in_a_vehicles_frames_are_told_apart() {
    // Lines 2 to 9 are vehicle 1, frames 1 to 8.
    let place = ["01_tracks.csv", "column `frame`", "vehicle 1"];
    let with = |more: [&'static str; 2]| [place.as_slice(), more.as_slice()].concat();
    refused(
        |t| t.tracks = with_field(&t.tracks, 5, "frame", "3"),
        &with(["line 5", "frame 3 of this vehicle occurs twice"]),
    );
    refused(|t| t.tracks = with_field(&t.tracks, 5, "frame", "0"), &with(["line 5", "out of order"]));
    refused(|t| t.tracks = without_line(&t.tracks, 5), &with(["line 5", "gap"]));
    // Two vehicles under one id, one after the other.
    refused(|t| t.tracks = with_repeated_line(&t.tracks, 4), &with(["line 28", "twice"]));
    let swapped = |t: &Texts| {
        let mut lines: Vec<&str> = t.tracks.lines().collect();
        lines.swap(4, 5);
        lines.join("\n")
    };
    refused(|t| t.tracks = swapped(t), &with(["line 5", "out of order"]));
    refused(|t| t.tracks = with_field(&t.tracks, 2, "frame", "9e14"), &["line 2", "column `frame`", "out of range"]);
}

#[test]
fn the_vehicles_of_the_two_files_must_be_the_same() {
    refused(
        |t| t.tracks_meta = without_line(&t.tracks_meta, 3),
        &["01_tracks.csv", "line 10", "column `id`", "vehicle 2 is not in the tracksMeta file"],
    );
    refused(
        |t| t.tracks_meta += "9,4.00,1.80,1,12,12,Car,2,0.00,0.00,0.00,0.00,-1.00,-1.00,-1.00,0\n",
        &["01_tracks.csv", "vehicle 9", "has 0 frames", "claims 12", "truncated?"],
    );
    refused(
        |t| t.tracks_meta = with_repeated_line(&t.tracks_meta, 2),
        &["01_tracksMeta.csv", "line 6", "vehicle 1", "same id"],
    );
    // Without numFrames, first and last frame say how many there must be; without these, at least one.
    let uncounted = |t: &Texts| without_column(&t.tracks_meta, "numFrames");
    let last_line_lost = |t: &Texts| without_line(&t.tracks, 27);
    refused(
        |t| (t.tracks_meta, t.tracks) = (uncounted(t), last_line_lost(t)),
        &["vehicle 7", "has 4 frames", "claims 5"],
    );
    let bare = |t: &Texts| without_column(&uncounted(t), "finalFrame") + "9,4,1.8,1,Car,2,0,0,0,0,-1,-1,-1,0\n";
    refused(|t| t.tracks_meta = bare(t), &["vehicle 9", "has 0 frames", "in the tracksMeta file"]);
    for id in ["-1", "4294967296", "x"] {
        refused(
            |t| t.tracks_meta = with_field(&t.tracks_meta, 2, "id", id),
            &["01_tracksMeta.csv", "line 2", "column `id`", id],
        );
    }
    refused(
        |t| t.tracks_meta = with_field(&t.tracks_meta, 2, "numFrames", "-8"),
        &["line 2", "column `numFrames`", "-8"],
    );
    refused(
        |t| t.tracks_meta = with_field(&t.tracks_meta, 2, "numFrames", "6"),
        &["vehicle 1", "has 8 frames", "claims 6"],
    );
}

#[test]
fn a_recording_without_vehicles_is_refused() {
    let header = |table: &str| table.lines().next().unwrap().to_owned() + "\n";
    refused(
        |t| (t.tracks, t.tracks_meta) = (header(&t.tracks), header(&t.tracks_meta)),
        &["01_tracksMeta.csv", "no vehicle"],
    );
    refused(|t| t.tracks = header(&t.tracks), &["01_tracks.csv", "vehicle 1", "has 0 frames", "3 more vehicles"]);
    refused(
        |t| {
            t.tracks = header(&t.tracks);
            for line in 2..=5 {
                t.tracks_meta = with_field(&t.tracks_meta, line, "numFrames", "0");
            }
        },
        &["01_tracks.csv", "no vehicle"],
    );
}

#[test]
fn an_empty_file_and_a_missing_or_second_line_of_the_recording_are_refused() {
    refused(|t| t.tracks.clear(), &["01_tracks.csv", "empty", "header"]);
    refused(|t| t.tracks_meta = "\r\n\r\n".to_owned(), &["01_tracksMeta.csv", "empty"]);
    refused(|t| t.recording_meta.clear(), &["01_recordingMeta.csv", "empty"]);
    refused(
        |t| t.recording_meta = without_line(&t.recording_meta, 2),
        &["01_recordingMeta.csv", "no line after the header"],
    );
    refused(
        |t| t.recording_meta = with_repeated_line(&t.recording_meta, 2),
        &["01_recordingMeta.csv", "line 3", "second line"],
    );
}

#[test]
fn a_frame_rate_that_is_none_is_refused() {
    for rate in ["0", "0.00", "-25", "NaN", "inf", "", "fast", "1e9", "1e-9"] {
        refused(
            |t| t.recording_meta = with_field(&t.recording_meta, 2, "frameRate", rate),
            &["01_recordingMeta.csv", "line 2", "column `frameRate`", rate],
        );
    }
}

#[test]
fn lane_lines_that_are_missing_disordered_or_no_numbers_are_refused() {
    let spoiled = |column: &'static str, cell: &'static str, says: &[&str]| {
        let place = ["01_recordingMeta.csv", "line 2", &format!("column `{column}`")];
        refused(|t| t.recording_meta = with_field(&t.recording_meta, 2, column, cell), &[&place, says].concat());
    };
    spoiled("upperLaneMarkings", "", &["missing", "vehicle 1 drives in direction 1"]);
    spoiled("lowerLaneMarkings", " ", &["missing", "vehicle 5 drives in direction 2"]);
    spoiled("upperLaneMarkings", "8.00;15.50;11.75;19.25", &["do not ascend", "11.75 comes after 15.5"]);
    spoiled("upperLaneMarkings", "19.25;15.50", &["do not ascend"]);
    spoiled("lowerLaneMarkings", "24.00;24.00;31.25", &["do not ascend"]);
    spoiled("lowerLaneMarkings", "24.00;x;31.25", &["`x` is not a finite number"]);
    spoiled("lowerLaneMarkings", "24.00;;31.25", &["`` is not a finite number"]);
    spoiled("lowerLaneMarkings", "24.00;NaN", &["`NaN` is not a finite number"]);
    spoiled("lowerLaneMarkings", "24.00", &["1 lane line"]);
    spoiled("lowerLaneMarkings", "4.00;7.50;11.25", &["above the last of the upper ones"]);
    refused(
        |t| {
            t.recording_meta = with_field(&t.recording_meta, 2, "upperLaneMarkings", "");
            t.recording_meta = with_field(&t.recording_meta, 2, "lowerLaneMarkings", "");
        },
        &["01_recordingMeta.csv", "line 2", "lane lines are missing"],
    );
}

#[test]
fn a_driving_direction_or_class_that_is_unknown_is_refused() {
    for direction in ["0", "3", "-1", "north", ""] {
        refused(
            |t| t.tracks_meta = with_field(&t.tracks_meta, 4, "drivingDirection", direction),
            &["01_tracksMeta.csv", "line 4", "column `drivingDirection`", direction],
        );
    }
    refused(
        |t| t.tracks_meta = with_field(&t.tracks_meta, 4, "class", "Tram"),
        &["line 4", "column `class`", "`Tram`", "`Car` or `Truck`"],
    );
}

#[test]
fn a_file_that_ends_early_is_called_truncated() {
    // Whatever the place of the cut, except inside the very last number: nothing tells 12 from 1 there.
    let whole = Texts::small();
    let last_line = whole.tracks.trim_end().rfind('\n').unwrap() + 1;
    let last_field = whole.tracks.trim_end().rfind(',').unwrap() + 1;
    for cut in last_line..last_field {
        let mut texts = whole.clone();
        texts.tracks.truncate(cut);
        let error = texts.read().unwrap_err();
        assert_says(&error, &["01_tracks.csv", "truncated"]);
        if cut > last_line {
            assert_says(&error, &["line 27", "expected 25"]);
        }
    }
    refused(|t| t.tracks.truncate(last_field), &["01_tracks.csv", "line 27", "column `laneId`", "empty"]);
    // Cut between two vehicles: no line is short, but vehicle 7 is announced.
    refused(|t| t.tracks = t.tracks.lines().take(22).collect::<Vec<_>>().join("\n"), &["vehicle 7", "truncated?"]);
}

#[test]
fn a_line_with_too_few_or_too_many_fields_is_named() {
    refused(
        |t| t.tracks = edit_line(&t.tracks, 6, |line| format!("{line},7")),
        &["01_tracks.csv", "line 6", "26 fields; expected 25"],
    );
    refused(
        |t| t.tracks = edit_line(&t.tracks, 6, |line| line[..20].to_owned()),
        &["01_tracks.csv", "line 6", "expected 25"],
    );
    refused(
        |t| t.tracks_meta = edit_line(&t.tracks_meta, 3, |line| format!("{line},")),
        &["01_tracksMeta.csv", "line 3", "17 fields"],
    );
    refused(
        |t| t.tracks = edit_line(&t.tracks, 6, |line| line.replacen(',', ",\"", 1)),
        &["01_tracks.csv", "line 6", "quotation mark"],
    );
}

#[test]
fn another_separator_and_another_encoding_are_recognised() {
    let error =
        refused(|t| t.tracks = t.tracks.replace(',', ";"), &["01_tracks.csv", "line 1", "';'", "expected commas"]);
    assert!(error.help().unwrap().contains("commas"));
    let wide = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let t = Texts::small();
    let error =
        small::read_bytes([&wide(&t.tracks), t.tracks_meta.as_bytes(), t.recording_meta.as_bytes()]).unwrap_err();
    assert_says(&error, &["01_tracks.csv", "line 1", "UTF-8"]);
}

#[test]
fn bytes_that_are_no_utf_8_are_refused_where_they_matter() {
    let t = Texts::small();
    // Latin-1 ü in a number, and in the class.
    let spoil =
        |text: String| text.into_bytes().into_iter().map(|b| if b == b'?' { 0xfc } else { b }).collect::<Vec<u8>>();
    let tracks = spoil(with_field(&t.tracks, 4, "y", "1?"));
    let error = small::read_bytes([&tracks, t.tracks_meta.as_bytes(), t.recording_meta.as_bytes()]).unwrap_err();
    assert_says(&error, &["01_tracks.csv", "line 4", "column `y`", "is not a number"]);
    assert!(error.help().unwrap().contains("UTF-8"));
    let meta = spoil(with_field(&t.tracks_meta, 4, "class", "C?r"));
    let error = small::read_bytes([t.tracks.as_bytes(), &meta, t.recording_meta.as_bytes()]).unwrap_err();
    assert_says(&error, &["01_tracksMeta.csv", "line 4", "column `class`", "UTF-8"]);
}

#[test]
fn a_huge_announced_number_of_frames_takes_no_memory() {
    refused(
        |t| t.tracks_meta = with_field(&t.tracks_meta, 2, "numFrames", "999999999999999999"),
        &["vehicle 1", "claims 999999999999999999"],
    );
}

/// One damage to a file: what to do, where (as a part of the length), with what.
type Damage = (u8, f64, f64, Vec<u8>);

fn damaged(text: &str, damages: &[Damage]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for (kind, from, to, insert) in damages {
        let at = |part: f64| ((bytes.len() as f64 * part) as usize).min(bytes.len());
        let (from, to) = (at(from.min(*to)), at(from.max(*to)));
        match kind % 5 {
            0 => drop(bytes.splice(from..from, insert.iter().copied())),
            1 => drop(bytes.splice(from..(from + insert.len()).min(bytes.len()), insert.iter().copied())),
            2 => drop(bytes.drain(from..(from + insert.len()).min(bytes.len()))),
            3 => {
                let copy = bytes[from..to].to_vec();
                drop(bytes.splice(to..to, copy));
            }
            _ => bytes.truncate(to),
        }
    }
    bytes
}

fn damage() -> impl Strategy<Value = Damage> {
    let telling = prop::sample::select(vec![
        "9".repeat(40),
        "-".into(),
        "\"".into(),
        "\n".into(),
        "\r".into(),
        ",".into(),
        ";".into(),
        "NaN".into(),
        "-9223372036854775808".into(),
        "1e308".into(),
        "\u{feff}".into(),
        "0".into(),
        ".".into(),
        "e".into(),
    ]);
    let bytes = prop_oneof![telling.prop_map(String::into_bytes), prop::collection::vec(any::<u8>(), 1..12)];
    (any::<u8>(), 0.0..=1.0f64, 0.0..=1.0f64, bytes)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn no_damage_makes_the_reader_panic_or_give_a_broken_model(
        damages in prop::collection::vec(damage(), 1..4), which in 0usize..3,
    ) {
        static TEXTS: std::sync::LazyLock<Texts> = std::sync::LazyLock::new(Texts::small);
        let texts = [&TEXTS.tracks, &TEXTS.tracks_meta, &TEXTS.recording_meta];
        let mut contents = texts.map(|text| text.clone().into_bytes());
        contents[which] = damaged(texts[which], &damages);
        match small::read_bytes([&contents[0], &contents[1], &contents[2]]) {
            Ok(loaded) => {
                let bytes = loaded.checksum_sha256.iter().map(|file| file.bytes as usize);
                prop_assert!(bytes.eq(contents.iter().map(Vec::len)));
                let recording = loaded.recording;
                prop_assert!(recording.frame_rate_hz > 0.0 && recording.frame_rate_hz.is_finite());
                prop_assert!(!recording.tracks.is_empty());
                prop_assert!(recording.tracks.is_sorted_by(|a, b| a.id < b.id));
                for carriageway in &recording.carriageways {
                    prop_assert!(carriageway.lane_count() > 0);
                    prop_assert!(carriageway.lane_lines_m.is_sorted_by(|a, b| a > b));
                }
                for track in &recording.tracks {
                    prop_assert!(track.length_m > 0.0 && track.width_m > 0.0 && !track.is_empty());
                    let lanes = recording.carriageways[track.carriageway].lane_count();
                    prop_assert!(track.lane.len() == track.len());
                    prop_assert!(track.lane.iter().all(|&lane| lane == u16::MAX || usize::from(lane) < lanes));
                    for series in [&track.s_m, &track.d_m, &track.v_s_mps, &track.v_d_mps, &track.a_s_mps2] {
                        prop_assert!(series.len() == track.len() && series.iter().all(|value| value.is_finite()));
                    }
                }
            }
            Err(error) => {
                let message = error.to_string();
                prop_assert!(message.contains("01_"), "names a file: {}", message);
                prop_assert!(!matches!(error, Error::Internal(_)), "{}", message);
                prop_assert!(error.help().is_some() && message.len() < 1000, "{}", message);
            }
        }
    }
}
