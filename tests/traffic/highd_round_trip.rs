//! Claims about reading and writing highD files.

use crate::common;

use std::fs;

use crate::common::dice::{Dice, cases};
use crate::common::exid::Plain;
use crate::common::small;
use lanesweep::traffic::trajectory::highd;
use lanesweep::traffic::trajectory::{Carriageway, Loaded, NO_LANE, Recording, Track, VehicleClass};

fn read_back(recording: &Recording) -> Loaded {
    let dir = tempfile::tempdir().unwrap();
    highd::write(dir.path(), recording).unwrap();
    let names = fs::read_dir(dir.path()).unwrap().count();
    assert_eq!(names, 3, "nothing but the three files is left in the folder");
    let inventory = highd::inventory(dir.path()).unwrap();
    assert!(inventory.problems.is_empty());
    let loaded = highd::read(&inventory.recordings[0]).unwrap();
    assert_eq!(loaded.recording.synthetic, recording.synthetic);
    loaded
}

/// Every number of a recording, bit for bit: `==` would let 0 pass for −0.
fn bits(recording: &Recording) -> Vec<u64> {
    let lines = recording.carriageways.iter().flat_map(|carriageway| &carriageway.lane_lines_m);
    let tracks = recording.tracks.iter().flat_map(|t| {
        let series = [&t.s_m, &t.d_m, &t.v_s_mps, &t.v_d_mps, &t.a_s_mps2];
        series.into_iter().flatten().chain([&t.length_m, &t.width_m]).copied().collect::<Vec<_>>()
    });
    lines.copied().chain(tracks).map(f64::to_bits).collect()
}

fn track(dice: &mut Dice, id: u32, carriageway: usize) -> Track {
    let samples = 1 + dice.below(11);
    let mut series = |min: f64, max: f64| (0..samples).map(|_| dice.between(min, max)).collect::<Vec<f64>>();
    let (s_m, d_m, v_s_mps) = (series(-500.0, 500.0), series(-60.0, 60.0), series(0.0, 50.0));
    let (v_d_mps, a_s_mps2) = (series(-3.0, 3.0), series(-9.0, 9.0));
    Track {
        id,
        class: dice.one_of(&[VehicleClass::Truck, VehicleClass::Car]),
        length_m: dice.between(0.5, 25.0),
        width_m: dice.between(0.5, 3.0),
        carriageway,
        first_frame: dice.below(2005) as i64 - 5,
        lane: (0..samples).map(|_| dice.one_of(&[0, 1, 2, 9, NO_LANE])).collect(),
        s_m,
        d_m,
        v_s_mps,
        v_d_mps,
        a_s_mps2,
    }
}

fn recording(dice: &mut Dice) -> Recording {
    let shift = dice.between(-0.5, 0.5);
    let upper = Carriageway { name: "1".to_owned(), lane_lines_m: vec![12.0 + shift, 8.3 + shift, 4.4] };
    let lower = Carriageway { name: "2".to_owned(), lane_lines_m: vec![-16.0 + shift, -19.3, -23.4, -27.1 + shift] };
    let carriageways = dice.one_of(&[vec![upper.clone(), lower.clone()], vec![upper], vec![lower]]);
    let vehicles = 1 + dice.below(5) as u32;
    let tracks = (0..vehicles).map(|at| {
        let carriageway = dice.below(carriageways.len());
        track(dice, 3 * at + 1, carriageway)
    });
    let tracks = tracks.collect();
    let rate = dice.one_of(&[25.0, 20.0, 10.0, 12.5, 29.97, 1.0 / 0.04]);
    Recording { id: "07".to_owned(), frame_rate_hz: rate, carriageways, tracks, synthetic: rate < 20.0 }
}

#[test]
fn a_recording_survives_its_own_files_quantized_and_a_quantized_one_bit_for_bit() {
    cases(96, |dice| {
        let recording = recording(dice);
        let mut quantized = recording.clone();
        highd::quantize(&mut quantized).unwrap();
        let read = read_back(&quantized).recording;
        assert_eq!(read, quantized);
        assert_eq!(bits(&read), bits(&quantized));
        let mut again = quantized.clone();
        highd::quantize(&mut again).unwrap();
        assert_eq!(bits(&again), bits(&quantized), "quantizing twice changes nothing more");
        let read = read_back(&recording).recording;
        assert_eq!(bits(&read), bits(&quantized));
        // Position and half a size are each off by half a hundredth and a quarter of one, at most.
        for (a, b) in read.tracks.iter().zip(&recording.tracks) {
            for (a, b) in a.s_m.iter().zip(&b.s_m).chain(a.d_m.iter().zip(&b.d_m)) {
                assert!((a - b).abs() < 0.0076, "{a} {b}");
            }
        }
    });
}

/// A number: sign, one or two digits, up to 17 decimals, an exponent.
fn number(dice: &mut Dice) -> String {
    let mut digits = |[min, max]: [usize; 2]| dice.list([min, max], |dice| (b'0' + dice.below(10) as u8) as char);
    let [whole, decimals] = [digits([1, 2]), digits([0, 17])].map(|digits| digits.into_iter().collect::<String>());
    let point = if dice.below(4) > 0 { format!(".{decimals}") } else { String::new() };
    format!("{}{whole}{point}{}", dice.one_of(&["", "-"]), dice.one_of(&["", "", "", "e0", "e1", "e2", "e-1", "e-2"]))
}

/// The reader has its own way through the digits of a short number.
#[test]
fn numbers_have_the_bits_that_the_standard_library_reads() {
    let small = small::Texts::small();
    cases(256, |dice| {
        let texts = dice.list([8, 8], number);
        let mut tables = small.clone();
        let line = tables.tracks.lines().position(|line| line.split(',').nth(1) == Some("5")).unwrap() + 1;
        for (at, text) in texts.iter().enumerate() {
            tables.tracks = small::with_field(&tables.tracks, line + at, "xAcceleration", text);
        }
        // Vehicle 5 drives along the file's x axis.
        let read = tables.read().unwrap().recording;
        let track = read.tracks.iter().find(|track| track.id == 5).unwrap();
        for (text, value) in texts.iter().zip(&track.a_s_mps2) {
            assert_eq!(value.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{text}");
        }
    });
}

#[test]
fn the_checksum_is_the_sha_256_of_the_whole_file() {
    // Expected value from `sha256sum` (GNU coreutils) of these bytes.
    let mut texts = small::Texts::small();
    texts.recording_meta =
        "id,frameRate,upperLaneMarkings,lowerLaneMarkings\r\n1,25,8.00;11.75;15.50;19.25,24.00;27.50;31.25\r\n"
            .to_owned();
    let loaded = texts.read().unwrap();
    assert_eq!(loaded.checksum_sha256[2].sha256, "88e3d2e2d572562aa604405e09046eb88c878d2f92c2f2f68623bcb201c383b0");
}

/// Columns may come in any order, and only the needed ones need to be there.
#[test]
fn line_ends_a_byte_order_mark_blank_lines_and_the_order_of_columns_change_nothing() {
    let texts = small::Texts::small();
    let plain = texts.read().unwrap();
    let windows = |text: &str| text.replace('\n', "\r\n");
    let marked = |text: &str| format!("\u{feff}{text}");
    let spaced = |text: &str| text.replace('\n', "\n\n");
    let quoted = |text: &str| {
        let quote =
            |line: &str| line.split(',').map(|field| format!("\"{field}\"")).collect::<Vec<_>>().join(",") + "\n";
        text.lines().map(quote).collect::<String>()
    };
    let open = |text: &str| text.trim_end().to_owned();
    let edits: [&dyn Fn(&str) -> String; 6] =
        [&windows, &marked, &spaced, &quoted, &open, &|text: &str| marked(&windows(text))];
    for edit in edits {
        let edited = small::Texts {
            tracks: edit(&texts.tracks),
            tracks_meta: edit(&texts.tracks_meta),
            recording_meta: edit(&texts.recording_meta),
        };
        let loaded = edited.read().unwrap();
        assert_eq!(loaded.recording, plain.recording);
        assert_eq!(bits(&loaded.recording), bits(&plain.recording));
        assert_eq!(loaded.notes, plain.notes);
    }
    let without = |columns: &[&str]| Plain::of_text(&texts.tracks).without(columns);
    let read = |tracks: Plain| small::Texts { tracks: tracks.text(), ..texts.clone() }.read().unwrap();
    let unneeded = ["width", "height", "yAcceleration", "dhw", "thw", "ttc", "precedingId", "leftAlongsideId"];
    let mut backwards = without(&unneeded);
    std::iter::once(&mut backwards.header).chain(&mut backwards.rows).for_each(|row| row.reverse());
    assert_eq!(read(backwards).recording, plain.recording);
    // Without lane ids the geometry tells the lanes, and a note says so.
    let loaded = read(without(&["laneId"]));
    assert_eq!(loaded.recording, plain.recording);
    assert!(loaded.notes[0].contains("laneId"), "{:?}", loaded.notes);
}

#[test]
fn a_recording_with_one_carriageway_needs_lane_lines_only_there() {
    let mut recording = small::recording();
    recording.carriageways.remove(0);
    recording.tracks.retain(|track| track.carriageway == 1);
    recording.tracks.iter_mut().for_each(|track| track.carriageway = 0);
    let texts = small::Texts::of(&recording);
    assert!(texts.recording_meta.contains(",,24.00;27.50;31.25"), "{}", texts.recording_meta);
    assert!(texts.tracks.lines().nth(1).unwrap().ends_with(",2"), "without upper lines the first lane has the id 2");
    assert_eq!(texts.read().unwrap().recording, recording);
}

#[test]
fn a_lane_id_outside_the_vehicles_carriageway_is_no_lane() {
    let texts = small::Texts::small();
    // Vehicle 1 drives in the upper lanes, 2 to 4; 5 is the median, 6 the first lower lane.
    for (id, lane) in [("2", 2), ("4", 0), ("1", NO_LANE), ("5", NO_LANE), ("6", NO_LANE), ("-3", NO_LANE)] {
        let edited = small::Texts { tracks: small::with_field(&texts.tracks, 2, "laneId", id), ..texts.clone() };
        assert_eq!(edited.read().unwrap().recording.tracks[0].lane[0], lane, "laneId {id}");
    }
}

#[test]
fn announced_vehicles_without_frames_are_left_out_and_strange_ones_are_noted() {
    let mut texts = small::Texts::small();
    texts.tracks_meta += "9,4.00,1.80,0,0,0,Car,2,0.00,0.00,0.00,0.00,-1.00,-1.00,-1.00,0\n";
    assert_eq!(texts.read().unwrap().recording, small::recording());
    // All of vehicle 5 with the direction of the other half: its positions go backwards, and it is in no lane.
    for line in 15..=22 {
        texts.tracks = small::with_field(&texts.tracks, line, "xVelocity", "-25.00");
    }
    texts.tracks_meta = small::with_field(&texts.tracks_meta, 4, "drivingDirection", "1");
    let notes = texts.read().unwrap().notes;
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes.iter().all(|note| note.contains("vehicle 5")), "{notes:?}");
}

/// Except inside the very last number: nothing tells 12 from 1 there.
#[test]
fn wherever_the_last_line_is_cut_the_file_is_called_truncated() {
    let texts = small::Texts::small();
    for cut in 3..=texts.tracks.lines().last().unwrap().len() {
        let tracks = texts.tracks[..texts.tracks.len() - cut].to_owned();
        let error = small::Texts { tracks, ..texts.clone() }.read().unwrap_err();
        assert!(format!("{error} {:?}", error.help()).contains("trunc"), "{cut}: {error}");
    }
}

#[test]
fn a_recording_that_the_format_cannot_hold_is_refused_and_nothing_is_written() {
    type Spoil<'a> = &'a dyn Fn(&mut Recording);
    let spoiled: [(&str, Spoil); 8] = [
        ("carriageway `north`", &|r| r.carriageways[1].name = "north".to_owned()),
        ("carriageway `2`", &|r| r.carriageways[1].lane_lines_m = vec![-24.0]),
        ("carriageway `1`", &|r| r.carriageways[0].lane_lines_m.reverse()),
        ("above carriageway `2`", &|r| r.carriageways[1].lane_lines_m.iter_mut().for_each(|line| *line += 20.0)),
        ("vehicle 2", &|r| r.tracks[1].s_m[2] = f64::NAN),
        ("vehicle 2", &|r| r.tracks[1].length_m = 0.004),
        ("sorted by id", &|r| r.tracks.swap(0, 1)),
        ("file name", &|r| r.id = "../01".to_owned()),
    ];
    for (expected, spoil) in spoiled {
        let mut recording = small::recording();
        spoil(&mut recording);
        let dir = tempfile::tempdir().unwrap();
        let error = highd::write(dir.path(), &recording).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert!(error.help().is_some());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        assert!(highd::quantize(&mut recording).is_err());
    }
}

#[test]
fn every_sumo_recording_reads_and_its_written_form_reads_alike() {
    let Some(dir) = common::sumo_recordings() else { return };
    let inventory = highd::inventory(&dir).unwrap();
    let ids: Vec<&str> = inventory.recordings.iter().map(|files| files.id.as_str()).collect();
    assert_eq!(ids, ["01", "02", "03", "04"]);
    // Numbers from recordingMeta: vehicles, lanes above, lanes below.
    let expected = [(349, 3, 3), (222, 2, 2), (439, 3, 3), (376, 3, 4)];
    for (files, (vehicles, upper, lower)) in inventory.recordings.iter().zip(expected) {
        let loaded = highd::read(files).unwrap();
        let recording = &loaded.recording;
        assert!(loaded.notes.iter().all(|note| note.contains("is taken as 0, 47 times")), "{:?}", loaded.notes);
        assert_eq!(recording.tracks.len(), vehicles);
        assert_eq!(recording.carriageways.iter().map(Carriageway::lane_count).collect::<Vec<_>>(), [upper, lower]);
        let samples: usize = recording.tracks.iter().map(Track::len).sum();
        let is_inside = |t: &Track, lane: u16, d: f64| {
            let lines = recording.carriageways[t.carriageway].lane(lane.into());
            lines.is_some_and(|lines| lines.left_m + 0.02 >= d && d >= lines.right_m - 0.02)
        };
        let in_lane = |t: &Track| t.lane.iter().zip(&t.d_m).filter(|&(&lane, &d)| is_inside(t, lane, d)).count();
        let agreeing: usize = recording.tracks.iter().map(in_lane).sum();
        assert!(agreeing as f64 > 0.999 * samples as f64, "laneId and geometry agree: {agreeing} of {samples}");
        assert_eq!(read_back(recording).recording, *recording);
    }
}
