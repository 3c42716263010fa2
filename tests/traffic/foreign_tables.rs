//! Tables and folders of others: every file is read or named, and no preset takes a table that it would read in part.

use std::collections::BTreeMap;
use std::fs;

use lanesweep::model::plausibility::Implausible;
use lanesweep::traffic::mining::{MiningOptions, mine, mine_folder};
use lanesweep::traffic::trajectory::generator::{GeneratorOptions, generate_one};
use lanesweep::traffic::trajectory::tracks::Understanding;
use lanesweep::traffic::trajectory::{Inputs, Recording, Track, VehicleClass};

use crate::common::exid::{self, Plain};
use crate::traffic::tracks::{fact, generated, load, read, says, understood};

fn table() -> Plain {
    Plain::of(&generated(), 5)
}

fn table_of(seed: u64) -> Plain {
    let options = GeneratorOptions { seed, recordings: 1, ..GeneratorOptions::default() };
    Plain::of(&generate_one(&options, 0).unwrap(), 5)
}

fn grave(about: &Understanding) -> &str {
    about.findings.iter().find(|finding| finding.is_grave).map_or("", |finding| &finding.text)
}

#[test]
fn every_file_of_a_folder_is_read_or_named() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    let text = table().text();
    write("a.csv", &text);
    write("b.csv", &text.replacen(",x,", ",ort,", 1));
    write("c.csv.gz", "not packed");
    write("d.csv.zip", "packed");
    // What is no table of tracks is not named.
    write("README.txt", "Traffic of a bridge, in May, by us, with thanks\n");
    write("settings.toml", "a = 1\n");
    write("classes.csv", "class,meaning\n1,car\n");
    let (files, problems) = Inputs::of(dir.path(), None).unwrap().files();
    assert_eq!((files.len(), problems.len()), (1, 3), "{problems:?}");
    for name in ["b.csv", "c.csv.gz", "d.csv.zip"] {
        assert!(problems.iter().any(|problem| problem.to_string().contains(name)), "{name}: {problems:?}");
    }
}

#[test]
fn one_empty_speed_costs_one_track_its_speeds_and_no_other() {
    let mut table = table();
    let vx = table.at("vx");
    table.rows[7][vx] = String::new();
    let about = understood(&table).unwrap();
    let speed = table.without(&["speed"]);
    let without = understood(&speed).unwrap();
    // The speed without direction takes its place where there is one.
    assert!(fact(&about, "speeds").starts_with("0 tracks from positions"), "{:?}", about.facts);
    assert!(fact(&without, "speeds").starts_with("1 tracks from positions, 1 across"), "{:?}", without.facts);
}

/// A plain table whose speeds are only along and across the road.
fn with_speeds() -> Plain {
    table().without(&["heading", "speed"])
}

#[test]
fn one_speed_that_cannot_be_is_refused_by_vehicle_and_frame() {
    for wrong in [0.0, -999.0, 3.0] {
        let mut table = with_speeds();
        let (vx, t) = (table.at("vx"), table.at("t"));
        let forward =
            |row: &&mut Vec<String>| row[vx].parse::<f64>().unwrap() > 20.0 && row[t].parse::<f64>().unwrap() > 9.0;
        let row = table.rows.iter_mut().find(forward).unwrap();
        let (vehicle, frame) = (row[0].clone(), (5.0 * row[t].parse::<f64>().unwrap()).round());
        row[vx] = wrong.to_string();
        let (about, says) = (understood(&table).unwrap(), format!("vehicle {vehicle} at frame {frame}: its speed is"));
        assert!(grave(&about).contains(&format!("{says} {wrong} m/s")), "{:?}", about.findings);
    }
    // A small error of one speed is no contradiction to the positions, but the braking that it tells is none of a vehicle.
    let mut recording = generated();
    recording.tracks.truncate(60);
    let mut table = Plain::of(&recording, 1).without(&["heading", "speed"]);
    let speed = table.number(300, "vx");
    table.shift(&[300], "vx", -4.0 * speed.signum());
    let about = understood(&table).unwrap();
    assert!(grave(&about).contains("beyond what is physical for an acceleration"), "{:?}", about.findings);
}

fn rows_by_vehicle(table: &Plain) -> BTreeMap<u32, Vec<usize>> {
    let mut rows: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    (0..table.rows.len()).for_each(|at| rows.entry(table.rows[at][0].parse().unwrap()).or_default().push(at));
    rows
}

/// Simulators change lanes in one step.
#[test]
fn a_step_that_no_vehicle_makes_gives_two_tracks_and_is_said_but_a_lane_change_in_one_step_does_not() {
    let mut table = with_speeds();
    let rows = rows_by_vehicle(&table);
    table.shift(&rows.values().find(|rows| rows.len() > 60).unwrap()[30..], "y", 3.5);
    assert!(!says(&understood(&table).unwrap(), "no vehicle makes"));
    for by_m in [8.0, -60.0] {
        let mut table = with_speeds();
        let tracks = read(&table).unwrap().recording.tracks.len();
        let rows = rows_by_vehicle(&table);
        let (vehicle, own) = rows.iter().find(|(_, rows)| rows.len() > 60).unwrap();
        table.shift(&own[30..], "x", by_m);
        let read = read(&table).unwrap();
        assert_eq!(read.recording.tracks.len(), tracks + 1, "{by_m}");
        assert!(says(&read.understanding, "1 step(s) that no vehicle makes"), "{by_m}");
        let said = says(&read.understanding, &format!("split tracks, the first is that of vehicle {vehicle} "));
        assert!(said, "{by_m}: {:?}", read.understanding.findings);
    }
}

#[test]
fn a_number_used_again_within_a_gap_that_is_filled_is_another_vehicle_with_its_own_size_and_class() {
    let mut table = with_speeds();
    let all = read(&table).unwrap().recording.tracks.len();
    let class = table.at("class");
    let rows = rows_by_vehicle(&table);
    let follows = |(a, b): &(&Vec<usize>, &Vec<usize>)| {
        let gap_s = table.number(b[0], "t") - table.number(a[a.len() - 1], "t");
        gap_s > 0.1 && gap_s < 0.3 && table.rows[a[0]][class] != table.rows[b[0]][class]
    };
    let pairs = rows.values().flat_map(|a| rows.values().map(move |b| (a, b)));
    let (first, second) = pairs.into_iter().find(follows).unwrap();
    let vehicles = [first[0], second[0]].map(|row| {
        let class = if table.rows[row][class] == "truck" { VehicleClass::Truck } else { VehicleClass::Car };
        Some((table.number(row, "length"), class))
    });
    let key = table.rows[first[0]][0].clone();
    second.iter().for_each(|at| table.rows[*at][0].clone_from(&key));
    let read = read(&table).unwrap();
    let tracks = &read.recording.tracks;
    assert!(says(&read.understanding, "1 step(s) that no vehicle makes") && tracks.len() == all);
    let facts = |track: &Track| (track.length_m, track.class);
    let of_first = tracks.iter().find(|track| track.id.to_string() == key).map(facts);
    assert_eq!([of_first, tracks.last().map(facts)], vehicles);
    let mined = mine(&read.recording, &MiningOptions::default());
    assert!(mined.scenarios.iter().filter(|found| found.kept).all(|found| found.gap0 > Some(0.0)));
}

/// A table whose column of accelerations is the change of speed along x, times a factor, plus an offset.
fn with_accelerations(factor: f64, offset_mps2: f64) -> Plain {
    let mut table = with_speeds();
    let rows = rows_by_vehicle(&table);
    table.header.push("acceleration".to_owned());
    for own in rows.values() {
        let told = |k: usize| {
            let (a, b) = (own[k.saturating_sub(1)], own[(k + 1).min(own.len() - 1)]);
            let change = table.number(b, "vx").abs() - table.number(a, "vx").abs();
            change / (table.number(b, "t") - table.number(a, "t")).max(1e-3)
        };
        let accelerations: Vec<f64> = (0..own.len()).map(|k| factor * told(k) + offset_mps2).collect();
        own.iter().zip(accelerations).for_each(|(row, a)| table.rows[*row].push(format!("{a:.4}")));
    }
    table
}

#[test]
fn numbers_that_fit_one_another_badly_are_told() {
    let scaled = |columns: &[&str], factor: f64| {
        let mut table = with_speeds();
        columns.iter().for_each(|column| table.map(column, |value, _| factor * value));
        table
    };
    for (table, name, told) in [
        (scaled(&["vx", "vy"], 1.04), "distance", "0.9615 times as far"),
        (scaled(&["length"], 0.5), "vehicles", "cars of 2."),
        (scaled(&["y", "vy"], 0.7), "lanes", "3 lanes of 2.4"),
        (with_accelerations(0.6, 0.0), "peaks", "0.60 times the changes of speed"),
        (with_accelerations(1.0, -0.4), "peaks", "-0.40 m/s² off"),
    ] {
        let about = understood(&table).unwrap();
        assert!(fact(&about, name).contains(told), "{told}: {:?}", about.facts);
    }
    let good = understood(&with_accelerations(1.0, 0.0)).unwrap();
    assert!(fact(&good, "distance").starts_with("1.000 times"), "{:?}", good.facts);
    assert!(fact(&good, "peaks").starts_with("accelerations are 0.99 times"), "{:?}", good.facts);
}

/// In five seconds, or of eight vehicles, where they keep in their lanes and how their headings turn says little.
#[test]
fn recordings_that_are_short_or_have_few_vehicles_are_not_refused_for_that() {
    for seed in [GeneratorOptions::default().seed, 7] {
        let whole = table_of(seed);
        let is_usable = |what: &str, keep: &dyn Fn(&Vec<String>) -> bool| {
            let rows = whole.rows.iter().filter(|row| keep(row)).cloned().collect();
            let about = understood(&Plain { rows, header: whole.header.clone() }).unwrap();
            let refused = about.findings.iter().find(|finding| finding.is_grave);
            assert!(refused.is_none(), "seed {seed}, {what}: {refused:?}");
        };
        let t = whole.at("t");
        for start in (1..240).step_by(if seed == 7 { 8 } else { 3 }) {
            let inside = |row: &Vec<String>| (start..start + 5).contains(&(row[t].parse::<f64>().unwrap() as i32));
            is_usable(&format!("{start} s"), &inside);
        }
        for first in (1..400).step_by(8) {
            is_usable(&format!("vehicle {first}"), &|row| (first..first + 8).contains(&row[0].parse::<i32>().unwrap()));
        }
    }
}

#[test]
fn a_meta_file_names_a_vehicle_as_a_number_however_it_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = generated();
    recording.tracks.truncate(60);
    exid::write(dir.path(), &recording, f64::INFINITY);
    let file = dir.path().join(format!("{}_tracksMeta.csv", recording.id));
    let meta = fs::read_to_string(&file).unwrap();
    let of_lorries = |of: &Recording| of.tracks.iter().filter(|track| track.class == VehicleClass::Truck).count();
    let lorries = of_lorries(&recording);
    assert!(lorries > 0);
    let read = |meta: &str| {
        fs::write(&file, meta).unwrap();
        let loaded = load(dir.path()).unwrap().remove(0);
        (of_lorries(&loaded.recording), loaded.notes.into_iter().find(|note| note.contains("tracksMeta")))
    };
    assert_eq!(read(&meta), (lorries, None));
    assert_eq!(read(&meta.replace("\n0,", "\n0,0000")), (lorries, None));
    let (_, note) = read(&meta.lines().take(31).collect::<Vec<_>>().join("\n"));
    assert!(note.unwrap().starts_with("30 vehicles have no row in"));
    fs::remove_file(&file).unwrap();
    let (files, _) = Inputs::of(dir.path(), None).unwrap().files();
    let error = files[0].read(Implausible::Refused).unwrap_err();
    assert!(error.to_string().contains("tracksMeta.csv: preset exid names this file, which is not there"), "{error}");
}

#[test]
fn a_second_recording_of_one_name_is_left_out_and_named() {
    let dir = tempfile::tempdir().unwrap();
    let text = table().text();
    fs::write(dir.path().join("a.csv"), &text).unwrap();
    fs::write(dir.path().join("a.txt"), &text).unwrap();
    let mined = || mine_folder(dir.path(), &MiningOptions::default(), Implausible::Refused, || Ok(())).unwrap();
    let (recordings, problems) = (mined().recordings, mined().problems);
    assert_eq!((recordings.len(), problems.len()), (1, 1));
    assert!(problems[0].to_string().contains("recording a: another file has a recording of this name"), "{problems:?}");
    // A text beside the tracks takes no name from them.
    fs::write(dir.path().join("a.txt"), "Traffic of a bridge, in May, by us\n").unwrap();
    assert_eq!((mined().recordings.len(), mined().problems.len()), (1, 0));
    let mut names = table();
    names.header.push("recording".to_owned());
    let half = names.rows.len() / 2;
    for (at, row) in names.rows.iter_mut().enumerate() {
        row.push(["x y", "z"][usize::from(at >= half)].to_owned());
    }
    let path = dir.path().join("b.csv");
    fs::write(&path, names.text()).unwrap();
    assert_eq!(load(&path).unwrap().into_iter().map(|of| of.recording.id).collect::<Vec<_>>(), ["b-x-y", "b-z"]);
}
