//! What only some programs write: SUMO's front bumpers, persons and lane changes of one step, and NGSIM's periods in one table.

use std::fmt::Write as _;
use std::fs;

use lanesweep::model::plausibility::Implausible;
use lanesweep::scenario::{Category, read_scenario_file, write_scenarios};
use lanesweep::traffic::mining::{Collection, MiningOptions, mine_folder, mine_inputs};
use lanesweep::traffic::trajectory::{Inputs, Track, VehicleClass};

use crate::common::text_of;
use crate::traffic::tracks::load;

const LANE_WIDTH_M: f64 = 3.5;
const RATE_HZ: f64 = 10.0;

/// A vehicle: name, type, lane from the right, front bumper at 0 s, m, speed, m/s, and the time of its change to lane 1, s.
type Driven = (&'static str, &'static str, usize, f64, f64, Option<f64>);

/// An ego, a vehicle that cuts in, and others that mark the lanes.
const CUT_IN: [Driven; 6] = [
    ("f.1", "car", 1, 62.0, 30.0, None),
    ("f.2", "car", 0, 112.0, 25.0, Some(4.0)),
    ("f.3", "car", 2, 122.0, 34.0, None),
    ("f.4", "car", 2, 80.0, 34.0, None),
    ("f.5", "lorry", 0, 40.0, 22.0, None),
    ("f.6", "lorry", 0, 180.0, 23.0, None),
];

/// Front bumper, m, distance to the left, m, and lane at a time; a lane change takes some seconds.
fn place((_, _, lane, front_m, speed, change): Driven, time_s: f64, change_s: f64) -> (f64, f64, usize) {
    let part = change.map_or(0.0, |begin| ((time_s - begin + 1e-9) / change_s).clamp(0.0, 1.0));
    let part = part - libm::sin(2.0 * std::f64::consts::PI * part) / (2.0 * std::f64::consts::PI);
    let y_m = (lane as f64 + 0.5 + part * (1.0 - lane as f64)) * LANE_WIDTH_M;
    (front_m + speed * time_s, y_m, (y_m / LANE_WIDTH_M) as usize)
}

struct Sample {
    frame: usize,
    time: f64,
    at: usize,
    vehicle: Driven,
    x: f64,
    y: f64,
    lane: usize,
}

fn samples(vehicles: &[Driven], seconds: usize, change_s: f64) -> Vec<Sample> {
    let of_time = |(frame, time): (usize, f64)| {
        vehicles.iter().enumerate().map(move |(at, &vehicle)| {
            let (x, y, lane) = place(vehicle, time, change_s);
            Sample { frame, time, at, vehicle, x, y, lane }
        })
    };
    times(seconds).enumerate().flat_map(of_time).collect()
}

fn times(seconds: usize) -> impl Iterator<Item = f64> {
    (0..seconds * RATE_HZ as usize).map(|k| k as f64 / RATE_HZ)
}

/// SUMO's table, with the sizes of the types: 4.3 × 1.8 m, and of a lorry 7.1 × 2.4 m.
fn fcd(vehicles: &[Driven], change_s: f64) -> String {
    let header = "timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed;vehicle_lane;\
                  vehicle_length;vehicle_width";
    // Tables of time steps have a row for a step without vehicles.
    let row = |sample: &Sample| {
        let Sample { time, x, y, lane, vehicle: (name, kind, .., speed, _), .. } = sample;
        let size = if *kind == "lorry" { "7.1;2.4" } else { "4.3;1.8" };
        format!("{time:.2};{name};{x:.2};{y:.2};90.00;{kind};{speed:.2};E0_{lane};{size}\n")
    };
    format!("{header}\n0.00;;;;;;;;;\n") + &samples(vehicles, 14, change_s).iter().map(row).collect::<String>()
}

#[test]
fn the_gap_behind_a_truck_of_sumo_is_measured_from_its_front_bumper() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fcd.csv");
    let vehicles: [Driven; 2] = [("t", "lorry", 0, 143.0, 24.0, None), ("c", "car", 0, 100.0, 24.0, None)];
    fs::write(&path, fcd(&vehicles, 4.0)).unwrap();
    let recording = load(&path).unwrap().remove(0).recording;
    let [truck, car] = &recording.tracks[..] else { panic!("{:?}", recording.tracks.len()) };
    assert_eq!(truck.class, VehicleClass::Truck);
    let gap_m = truck.s_m[0] - car.s_m[0] - 0.5 * (car.length_m + truck.length_m);
    assert!((gap_m - 35.9).abs() < 1e-9, "{gap_m}");
}

#[test]
fn sumos_table_without_sizes_is_refused_and_its_persons_and_empty_steps_are_no_vehicles() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fcd.csv");
    let with = fcd(&CUT_IN, 4.0);
    let without: String = with.lines().map(|line| line.rsplitn(3, ';').last().unwrap().to_owned() + "\n").collect();
    fs::write(&path, without).unwrap();
    let error = load(&path).unwrap_err();
    assert!(error.to_string().contains("sumo-fcd takes `length` from the column `vehicle_length`"), "{error}");
    assert!(error.help().unwrap().contains("from lanesweep.tracks import sumo"), "{error:?}");
    // So is one in which some vehicles have none.
    let some = |line: &str| if line.contains(";f.2;") { line.replace("4.3;1.8", ";") } else { line.to_owned() };
    fs::write(&path, with.lines().map(some).collect::<Vec<_>>().join("\n")).unwrap();
    let error = load(&path).unwrap_err();
    assert!(error.to_string().contains("1 vehicles have no size"), "{error}");
    // Persons and steps without vehicles are no vehicles.
    let mut text = with;
    for time in times(12) {
        let _ = writeln!(text, "{time:.2};p0;{:.2};-2.88;90.00;DEFAULT_PEDTYPE;1.30;;;", 1.3 * time);
    }
    fs::write(&path, &text).unwrap();
    assert_eq!(load(&path).unwrap()[0].recording.tracks.len(), CUT_IN.len());
    // A vehicle without a name is no empty step.
    fs::write(&path, text.replacen("f.1;", ";", 1)).unwrap();
    assert!(load(&path).unwrap_err().to_string().contains("there is no value"));
}

#[test]
fn a_lane_change_of_one_step_is_refused_from_recordings_and_from_files_alike() {
    let dir = tempfile::tempdir().unwrap();
    let mined = |change_s: f64, implausible| -> Collection {
        fs::write(dir.path().join("fcd.csv"), fcd(&CUT_IN, change_s)).unwrap();
        mine_folder(dir.path(), &MiningOptions::default(), implausible, || Ok(())).unwrap()
    };
    let cut_ins = |of: &Collection| of.scenarios.iter().filter(|s| s.category == Category::CutIn).count();
    let slow = mined(4.0, Implausible::Refused);
    assert_eq!((cut_ins(&slow), slow.problems.len()), (1, 0), "{:?}", slow.problems);
    let instant = mined(0.05, Implausible::Refused);
    assert_eq!((cut_ins(&instant), instant.problems.len()), (0, 1), "{:?}", instant.notes);
    assert!(instant.problems[0].to_string().contains("lateral jump"), "{:?}", instant.problems);
    // The file of the same scenario is refused for the same reason.
    let accepted = mined(0.05, Implausible::Accepted);
    assert_eq!(cut_ins(&accepted), 1);
    let file = dir.path().join("mined.jsonl");
    write_scenarios(&file, &accepted.scenarios).unwrap();
    assert!(read_scenario_file(&file, Implausible::Refused).unwrap_err().to_string().contains("lateral jump"));
}

/// Rows of NGSIM's table in three periods: frames and vehicles begin again at 1, and vehicle 5 is a lorry in the second period only.
fn three_periods() -> Vec<String> {
    let foot = 0.3048;
    let row = |period: u64, Sample { frame, at, vehicle, x, y, lane, .. }: Sample| {
        let is_lorry = vehicle.1 == "lorry" && (at != 4 || period == 1);
        let size = if is_lorry { "54.1,8.2,3" } else { "15.1,5.9,2" };
        let time_ms = 1_118_846_979_700 + 900_000 * period + 100 * frame as u64;
        // No period is a copy of another.
        let (x, y, speed, lane) = (x / foot + period as f64, -y / foot, vehicle.4 / foot, 3 - lane);
        format!("{},{},{time_ms},{y:.3},{x:.3},{size},{speed:.3},0,{lane},us-101", at + 1, frame + 1)
    };
    (0..3).flat_map(|period| samples(&CUT_IN, 14, 4.0).into_iter().map(move |of| row(period, of))).collect()
}

#[test]
fn frames_that_begin_again_at_another_time_are_those_of_another_recording() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("us-101.csv");
    let mined = |rows: &[String]| -> Collection {
        let header =
            "Vehicle_ID,Frame_ID,Global_Time,Local_X,Local_Y,v_length,v_Width,v_Class,v_Vel,v_Acc,Lane_ID,Location";
        fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
        mine_folder(&path, &MiningOptions::default(), Implausible::Refused, || Ok(())).unwrap()
    };
    let mut rows = three_periods();
    let by_time = mined(&rows);
    let ids: Vec<&str> = by_time.recordings.iter().map(|of| of.id.as_str()).collect();
    assert_eq!(ids, ["us-101-us-101-1", "us-101-us-101-2", "us-101-us-101-3"]);
    assert_eq!(by_time.recordings.iter().map(|of| of.vehicles).collect::<Vec<_>>(), [6, 6, 6]);
    let cut_ins: Vec<&str> =
        by_time.scenarios.iter().filter(|s| s.category == Category::CutIn).map(|s| s.id.as_str()).collect();
    assert_eq!(cut_ins.len(), 3, "{cut_ins:?}");
    // Vehicles keep their numbers and sizes.
    for (loaded, lorries) in load(&path).unwrap().iter().zip([1, 2, 1]) {
        let tracks = &loaded.recording.tracks;
        assert_eq!(tracks.iter().map(|track| track.id).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6]);
        assert_eq!(tracks.iter().filter(|track| track.class == VehicleClass::Truck).count(), lorries);
        assert!((tracks[4].length_m > 10.0) == (lorries == 2), "{}", tracks[4].length_m);
    }
    // The order of the rows does not matter: here by vehicle, with the periods side by side.
    rows.sort();
    assert_eq!(mined(&rows).scenarios, by_time.scenarios);
    // One wrong time makes no recording of its own.
    rows[5] = rows[5].replacen(",1118", ",2118", 1);
    let stray = mined(&rows);
    assert_eq!(stray.recordings.len(), 3);
    assert!(stray.notes.iter().any(|note| note.contains("1 rows have a time that does not fit")), "{:?}", stray.notes);
    // Times of another unit do not decide where frames begin again.
    let with_times = |row: &String| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        cells[2] = format!("{}000", 100 * cells[1].parse::<u64>().unwrap());
        cells.join(",")
    };
    let first: Vec<String> = three_periods().iter().take(14 * 60).map(with_times).collect();
    let microseconds = mined(&first);
    assert_eq!((microseconds.recordings.len(), microseconds.recordings[0].vehicles), (1, 6));
    let contradicts =
        |note: &String| note.contains("frames and times contradict one another: 10 frames per second, 0.0100");
    assert!(microseconds.notes.iter().any(contradicts), "{:?}", microseconds.notes);
}

#[test]
fn a_number_that_comes_back_after_a_pause_is_another_vehicle() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("t.csv");
    let mut text = "id,time,x,y,speed,length,width,class\n".to_owned();
    for Sample { at, time, x, y, vehicle, .. } in samples(&CUT_IN, 12, 4.0) {
        let _ = writeln!(text, "{at},{time:.2},{x:.2},{y:.2},{},4.5,1.8,car", vehicle.4);
    }
    // Number 2 again, of a lorry.
    for time in times(12) {
        let (x, y, _) = place(CUT_IN[4], time, 4.0);
        let _ = writeln!(text, "2,{:.2},{x:.2},{y:.2},22.0,16.5,2.5,truck", time + 30.0);
    }
    fs::write(&path, text).unwrap();
    let loaded = load(&path).unwrap().remove(0);
    let again: Vec<&Track> = loaded.recording.tracks.iter().filter(|track| track.first_frame > 200).collect();
    let [lorry] = again[..] else { panic!("{} tracks", again.len()) };
    assert_eq!((lorry.length_m, lorry.class), (16.5, VehicleClass::Truck));
    assert_eq!(loaded.vehicle_names.get(&lorry.id).map(String::as_str), Some("2"));
    let first = loaded.recording.tracks.iter().find(|track| track.id == 2).unwrap();
    assert_eq!((first.length_m, first.class), (4.5, VehicleClass::Car));
    assert!(loaded.notes.iter().any(|note| note.contains("comes back")), "{:?}", loaded.notes);
}

/// frame-step: 30 frames per second, of which every third is in the file.
#[test]
fn scenarios_have_the_frames_and_the_names_of_vehicles_of_their_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("t.csv");
    let table = |first: usize, step: usize| {
        let mut text = "id,frame,time,x,y,speed,length,width,class\n".to_owned();
        for Sample { frame, time, x, y, vehicle, .. } in samples(&CUT_IN, 14, 4.0) {
            let (name, frame, speed) = (vehicle.0, first + step * frame, vehicle.4);
            let _ = writeln!(text, "{name},{frame},{time:.2},{x:.2},{y:.2},{speed},4.5,1.8,car");
        }
        text
    };
    let cut_in_by = |preset: Option<&str>| {
        let inputs = Inputs::of(&path, preset).unwrap();
        let mined = mine_inputs(inputs, &MiningOptions::default(), Implausible::Refused, || Ok(())).unwrap();
        mined.scenarios.into_iter().find(|s| s.category == Category::CutIn).unwrap()
    };
    let cut_in = || cut_in_by(None);
    fs::write(&path, table(0, 1)).unwrap();
    let plain = cut_in();
    fs::write(&path, table(1000, 3)).unwrap();
    let stepped = cut_in();
    assert_eq!(stepped.frame0, 1000 + 3 * plain.frame0);
    assert_eq!(stepped.frame1, 1000 + 3 * plain.frame1);
    assert_eq!(stepped.frame_switch, plain.frame_switch.map(|frame| 1000 + 3 * frame));
    assert_eq!(stepped.id, format!("t_cut_in_f.1_f.2_{}", stepped.frame0));
    assert_eq!((stepped.fps, &stepped.target), (plain.fps, &plain.target));
    // The same where the preset has the rate, and no time is needed.
    let own = dir.path().join("own.toml");
    let generic = text_of("configs/presets/generic.toml");
    let with_rate = generic.replacen("[classes]", "frame_rate_hz = 30.0\n\n[classes]", 1);
    fs::write(&own, with_rate).unwrap();
    fs::write(&path, table(1000, 3).replace("id,frame,time", "id,frame,ignored")).unwrap();
    let frames = cut_in_by(own.to_str());
    assert_eq!((frames.id, frames.frame1, frames.fps), (stepped.id, stepped.frame1, stepped.fps));
}
