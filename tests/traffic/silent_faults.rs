//! Faulty recordings of which every number is plausible: what was wrong with them is said, and nothing is said of good ones.

use lanesweep::model::plausibility::Implausible;
use lanesweep::traffic::trajectory::highd;
use lanesweep::traffic::trajectory::tracks::Understanding;
use lanesweep::traffic::trajectory::{InputFile, Recording, Track, VehicleClass};

use crate::common::exid::Plain;
use crate::common::small::Texts;
use crate::traffic::tracks::{generated, load_collection, says, understood};

fn highd_understood(recording: &Recording) -> Understanding {
    let (dir, mut recording) = (tempfile::tempdir().unwrap(), recording.clone());
    highd::quantize(&mut recording).unwrap();
    highd::write(dir.path(), &recording).unwrap();
    let files = highd::HighdFiles::named(dir.path(), &recording.id);
    InputFile::Highd(files).understand(Implausible::Accepted).unwrap().remove(0).understanding
}

fn with(change: impl Fn(&mut Recording)) -> Recording {
    let mut recording = generated();
    change(&mut recording);
    recording
}

fn each_track(change: impl Fn(&mut Track)) -> Recording {
    with(|recording| recording.tracks.iter_mut().for_each(&change))
}

/// What good recordings must not be told.
const WORDS: [&str; 14] = [
    "half extents",
    "none is longer",
    "have another unit or scale",
    "s late against positions",
    "is usual): check the scale",
    "half widths",
    "lane marking at y",
    "times as far as their speeds",
    "were clipped",
    "are multiples of",
    "no vehicle drives between",
    "less than 1 m apart",
    "are swapped",
    "drive elsewhere across the road",
];

fn each(values: &mut [f64], change: impl Fn(&mut f64)) {
    values.iter_mut().for_each(change);
}

/// A lorry as a tractor of 6 m and its trailer.
fn split_a_lorry(recording: &mut Recording) {
    let is_long = |of: &&Track| of.class == VehicleClass::Truck && of.length_m > 10.0;
    let whole = recording.tracks.iter().filter(is_long).max_by_key(|of| of.len()).unwrap().clone();
    let trailer_m = whole.length_m - 6.0;
    let part = |id: u32, length_m: f64, ahead_m: f64| {
        let s_m = whole.s_m.iter().map(|s_m| s_m + ahead_m).collect();
        Track { id, length_m, s_m, ..whole.clone() }
    };
    let last = recording.tracks.last().unwrap().id;
    *recording.tracks.iter_mut().find(|of| of.id == whole.id).unwrap() = part(whole.id, 6.0, trailer_m / 2.0);
    recording.tracks.push(part(last + 1, trailer_m, -3.0));
}

/// What is said (`-`: not said) of a recording whose tracks are changed, and whether it is used, where that is sure.
#[test]
fn faults_of_a_recording_are_told() {
    type Change<'a> = &'a dyn Fn(&mut Track);
    // The corner of the box in place of its middle, in one direction.
    let corner = |of: &mut Track| {
        let half_m = if of.carriageway == 0 { of.width_m / 2.0 } else { 0.0 };
        each(&mut of.d_m, |d_m| *d_m -= half_m);
    };
    // A filter delays positions across the road by a second; the speeds come from elsewhere.
    let late = |of: &mut Track| of.d_m = (0..of.len()).map(|k| of.d_m[k.saturating_sub(25)]).collect();
    let faster = |of: &mut Track, is: bool| each(&mut of.v_s_mps, |v| *v *= if is { 1.1 } else { 1.0 });
    let tracks: [(Change, Option<bool>, &[&str]); 8] = [
        (&corner, Some(false), &["half widths to the right", "-forward: half"]),
        (
            &|of| each(&mut of.a_s_mps2, |a| *a = a.clamp(-2.0, 2.0)),
            None,
            &["no acceleration is below -2.0", "clipped"],
        ),
        (&|of| each(&mut of.a_s_mps2, |a| *a = a.min(0.5)), None, &["no acceleration is above 0.50", "clipped"]),
        (&late, None, &["lateral speeds are -0."]),
        (&|of| (of.length_m, of.width_m) = (of.length_m / 2.0, of.width_m / 2.0), None, &["are these half extents?"]),
        (&|of| (of.length_m, of.width_m) = (of.width_m, of.length_m.min(9.9)), Some(false), &["are swapped"]),
        (&|of| of.length_m = of.length_m.min(7.5), None, &["most lorries are 7.50 m long, and none is longer"]),
        (&|of| faster(of, of.class == VehicleClass::Truck), None, &["lorries: vehicles move 0.909 times"]),
    ];
    type Whole<'a> = (&'a dyn Fn(&mut Recording), &'a [&'a str]);
    let all: [Whole; 3] = [
        (&|of| of.frame_rate_hz = 25.9, &["vehicles move 1.036", "frame rate: 25.0 Hz would fit", "-s late"]),
        (&|of| of.frame_rate_hz = 24.0, &["vehicles move 0.96", "frame rate: 25.0 Hz would fit", "-s late"]),
        (&split_a_lorry, &["1 pair(s) of vehicles drive less than 1 m apart"]),
    ];
    let tracks = tracks.map(|(change, is_usable, told)| (each_track(change), is_usable, told));
    for (recording, is_usable, told) in
        tracks.into_iter().chain(all.map(|(change, told)| (with(change), Some(true), told)))
    {
        let about = highd_understood(&recording);
        for words in told {
            let (is_told, words) = words.strip_prefix('-').map_or((true, *words), |words| (false, words));
            assert_eq!(says(&about, words), is_told, "{words}: {:?}", about.findings);
        }
        assert!(is_usable.is_none_or(|is| is == about.is_usable()), "{told:?}: {:?}", about.findings);
    }
    for (carriageway, way) in [(0, "backward"), (1, "forward")] {
        let about = highd_understood(&each_track(|of| faster(of, of.carriageway == carriageway)));
        let is_told = says(&about, &format!("{way}: vehicles move 0.909 times"));
        assert!(is_told || !about.is_usable(), "{way}: {:?}", about.findings);
    }
    // Good recordings are told none of it.
    for about in [highd_understood(&generated()), understood(&Plain::of(&generated(), 5)).unwrap()] {
        assert!(WORDS.iter().all(|words| !says(&about, words)), "{:?}", about.findings);
    }
}

/// Positions in whole metres, and a road in Web Mercator at 51 degrees: without speeds nothing else tells the scale.
#[test]
fn coarse_positions_and_stretched_roads_are_told() {
    for (raster_m, is_coarse) in [(1.0, true), (0.1, false)] {
        let mut table = Plain::of(&generated(), 1);
        table.map("x", |x, _| (x / raster_m).round() * raster_m);
        let about = understood(&table).unwrap();
        assert_eq!(says(&about, "are multiples of 1.00 m"), is_coarse, "{raster_m}: {:?}", about.findings);
    }
    let mut table = Plain::of(&generated(), 5).without(&["speed", "vx", "vy"]);
    ["x", "y"].iter().for_each(|axis| table.map(axis, |m, _| 1.589 * m));
    let about = understood(&table).unwrap();
    assert!(says(&about, "m wide (median; 2.7 to 4.6 is usual)"), "{:?}", about.findings);
}

#[test]
fn lane_markings_beside_the_lanes_are_found_in_each_direction() {
    // All lane markings lie too low in the image.
    let shifted = |by_m: f64| {
        highd_understood(&with(|recording| {
            for of in &mut recording.carriageways {
                let sign = if of.name == "2" { -1.0 } else { 1.0 };
                of.lane_lines_m.iter_mut().for_each(|line_m| *line_m += sign * by_m);
            }
        }))
    };
    for way in ["forward", "backward"] {
        let is_told = |about: &Understanding| {
            [": half of the vehicles", ": the lane marking"].iter().any(|words| says(about, &format!("{way}{words}")))
        };
        assert!(is_told(&shifted(0.63)) && !is_told(&shifted(0.2)), "{:?}", shifted(0.63).findings);
    }
    // One marking is mistyped.
    for by_m in [0.6_f64, -1.0] {
        let recording = with(|recording| recording.carriageways[0].lane_lines_m[1] += by_m);
        let about = highd_understood(&recording);
        let told = format!("backward: the lane marking at y = {:.2} m is ", recording.carriageways[0].lane_lines_m[1]);
        let lines: Vec<&str> = about.findings.iter().filter_map(|finding| finding.text.strip_prefix(&told)).collect();
        let [off] = lines[..] else { panic!("{told}: {:?}", about.findings) };
        let off_m: f64 = off.split(' ').next().unwrap().parse().unwrap();
        assert!(about.is_usable() && (off_m - by_m.abs()).abs() < 0.05, "{off}");
    }
}

#[test]
fn two_places_in_one_table_are_told_or_parted() {
    let (mut table, there) = (Plain::of(&generated(), 5), Plain::of(&generated(), 5));
    table.header.push("site".to_owned());
    table.rows.iter_mut().for_each(|row| row.push("north".to_owned()));
    for mut row in there.rows {
        row[0] = format!("{}", 100_000 + row[0].parse::<u32>().unwrap());
        row[2] = format!("{:.4}", 2000.0 + row[2].parse::<f64>().unwrap());
        row.push("south".to_owned());
        table.rows.push(row);
    }
    let about = understood(&table).unwrap();
    assert!(about.recording == "own-north" && !says(&about, "no vehicle drives between"), "{:?}", about.findings);
    let about = understood(&table.without(&["site"])).unwrap();
    assert!(says(&about, "no vehicle drives between"), "{:?}", about.findings);
    // One after the other.
    let recording = generated();
    let middle = recording.tracks.iter().map(|of| of.first_frame).max().unwrap() / 2;
    let late = recording.tracks.iter().filter(|of| of.first_frame > middle).map(|of| of.id.to_string());
    let late: Vec<String> = late.collect();
    for (by_m, is_told) in [(1.5, true), (6.0, true), (0.1, false)] {
        let mut table = Plain::of(&recording, 5);
        table.map("y", |y, row| if late.contains(&row[0]) { y + by_m } else { y });
        let about = understood(&table).unwrap();
        assert_eq!(says(&about, "drive elsewhere across the road"), is_told, "{by_m}: {:?}", about.findings);
    }
}

#[test]
fn a_table_as_long_as_a_spreadsheet_may_be_cut() {
    let text = |lines: usize| {
        let mut text = "id,t,x,y\n".to_owned();
        (1..lines).for_each(|row| text += &format!("{},{},{},0\n", row % 10, row / 10, 10 * (row % 10) + row / 10));
        Plain::of_text(&text)
    };
    for (lines, is_told) in [(65_536, true), (1_048_576, true), (65_535, false)] {
        let about = understood(&text(lines)).unwrap();
        assert_eq!(says(&about, &format!("{lines} lines, as many as a spreadsheet can hold")), is_told);
    }
}

#[test]
fn sizes_of_other_vehicles_are_refused_with_both_files_named() {
    let texts = Texts::of(&generated());
    let meta = Plain::of_text(&texts.tracks_meta);
    let with_sizes_of = |from: &dyn Fn(usize) -> usize| {
        let mut shifted = meta.clone();
        let rows = meta.rows.len();
        (0..rows).for_each(|row| shifted.rows[row][1..3].clone_from_slice(&meta.rows[from(row) % rows][1..3]));
        Texts { tracks_meta: shifted.text(), ..texts.clone() }.read_checked(Implausible::Refused)
    };
    let error = with_sizes_of(&|row| row + 1).unwrap_err().to_string();
    assert!(["01_tracks.csv", "line 2", "in the tracksMeta file"].iter().all(|words| error.contains(words)), "{error}");
    let odd = (0..meta.rows.len() - 1).find(|row| meta.rows[*row][1] != meta.rows[row + 1][1]).unwrap();
    let notes = with_sizes_of(&|row| if row == odd { row + 1 } else { row }).unwrap().notes;
    assert!(notes.iter().any(|note| note.starts_with("1 vehicle(s) have two sizes")), "{notes:?}");
    assert_eq!(with_sizes_of(&|row| row).unwrap().notes, [""; 0]);
}

/// The frames of a recording in an interval, with other numbers of vehicles and frames.
fn clip(recording: &Recording, id: &str, [from, to]: [i64; 2]) -> Recording {
    let part = |track: &Track| {
        let [first, end] = [from, to].map(|frame| (frame - track.first_frame).clamp(0, track.len() as i64) as usize);
        let cut = |series: &[f64]| series[first..end].to_vec();
        (end > first).then(|| Track {
            id: track.id + 500,
            first_frame: track.first_frame + first as i64 - from + 1,
            s_m: cut(&track.s_m),
            d_m: cut(&track.d_m),
            v_s_mps: cut(&track.v_s_mps),
            v_d_mps: cut(&track.v_d_mps),
            a_s_mps2: cut(&track.a_s_mps2),
            lane: track.lane[first..end].to_vec(),
            ..track.clone()
        })
    };
    Recording { id: id.to_owned(), tracks: recording.tracks.iter().filter_map(part).collect(), ..recording.clone() }
}

#[test]
fn a_part_of_a_recording_under_other_numbers_counts_once() {
    let whole = with(|recording| highd::quantize(recording).unwrap());
    let frames = whole.tracks.iter().map(Track::last_frame).max().unwrap();
    let driven = |recordings: &[Recording]| {
        let dir = tempfile::tempdir().unwrap();
        recordings.iter().for_each(|recording| highd::write(dir.path(), recording).unwrap());
        let found = load_collection(dir.path());
        let problems: Vec<String> = found.problems.iter().map(ToString::to_string).collect();
        (found.driven().unwrap(), problems)
    };
    let named = |id: &str| Recording { id: id.to_owned(), ..whole.clone() };
    let (alone, problems) = driven(&[named("01")]);
    assert_eq!(problems, [""; 0]);
    let later = [frames * 3 / 4, frames];
    for (recordings, expected) in [
        (vec![named("01"), clip(&whole, "02", later)], "recording 02: it is recording 01 again"),
        (vec![clip(&whole, "01", later), named("02")], "recording 01: it is recording 02 again"),
    ] {
        let (once, problems) = driven(&recordings);
        assert_eq!(once, alone);
        assert!(problems.len() == 1 && problems[0].contains(expected), "{problems:?}");
    }
    // Two parts that have a third in common.
    let (_, problems) =
        driven(&[clip(&whole, "01", [1, frames * 3 / 5]), clip(&whole, "02", [frames * 2 / 5, frames])]);
    assert!(problems.len() == 1 && problems[0].contains("at 33 % of its instants"), "{problems:?}");
    // Parts that have nothing in common.
    let (_, problems) = driven(&[clip(&whole, "01", [1, frames / 2]), clip(&whole, "02", [frames / 2, frames])]);
    assert_eq!(problems, [""; 0]);
}
