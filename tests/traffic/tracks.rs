//! Tracks in other formats: the same traffic gives the same scenarios; files that contradict themselves are refused.

use std::collections::BTreeMap;
use std::path::Path;

use lanesweep::model::plausibility::Implausible;
use lanesweep::prelude::*;
use lanesweep::traffic::Source;
use lanesweep::traffic::mining::mine;
use lanesweep::traffic::trajectory::generator::generate_one;
use lanesweep::traffic::trajectory::tracks::{
    self, HeadingOrigin, Preset, Reference, RoadSource, Role, Side, TrackFile, Understanding,
};
use lanesweep::traffic::trajectory::{Carriageway, Inputs, Loaded, NO_LANE, Track, VehicleClass, highd};

use crate::common::exid::{self, Plain};
use crate::common::mined::recordings;
use crate::common::quintic;

pub fn generated() -> Recording {
    Recording::clone(recordings(1)[0])
}

/// Two minutes of it.
pub fn shorter() -> Recording {
    generate_one(&GeneratorOptions { recordings: 1, duration_s: 120.0, ..GeneratorOptions::default() }, 0).unwrap()
}

/// The recordings of a file or folder, none of which is in doubt.
pub fn load(path: &Path) -> lanesweep::Result<Vec<Loaded>> {
    let (files, problems) = Inputs::of(path, None)?.files();
    assert!(problems.is_empty(), "{problems:?}");
    let read: lanesweep::Result<Vec<_>> = files.iter().map(|file| file.read(Implausible::Refused)).collect();
    Ok(read?.into_iter().flatten().collect())
}

/// The scenarios of a file, or of the recordings of a file or folder.
pub fn load_collection(path: &Path) -> Collection {
    let path = path.to_owned();
    let source = match path.extension() {
        Some(ending) if ending == "jsonl" => Source::Scenarios { path, filter: false },
        _ => Source::Recordings { path, preset: None },
    };
    source.load(&MiningOptions::default(), Implausible::Refused, || Ok(())).unwrap()
}

fn load_exid(dir: &Path) -> Loaded {
    let detected = Inputs::of(dir, None).unwrap().preset.map(|preset| preset.name);
    assert_eq!(detected.as_deref(), Some("exid"));
    load(dir).unwrap().remove(0)
}

/// Number of scenarios, of those that another reading has within some frames, and of those whose `kept` is equal.
fn matched(ours: &Recording, theirs: &Recording, shift: i64, frames: i64) -> [usize; 3] {
    let [ours, theirs] = [ours, theirs].map(|of| mine(of, &MiningOptions::default()).scenarios);
    let mut counts = [ours.len(), 0, 0];
    let who = |of: &Scenario| (of.category, of.ego_id, of.target_id);
    for scenario in ours {
        let is_near = |other: &Scenario| (other.frame0 + shift - scenario.frame0).abs() <= frames;
        let near = theirs.iter().find(|other| who(other) == who(&scenario) && is_near(other));
        counts[1] += usize::from(near.is_some());
        counts[2] += usize::from(near.is_some_and(|other| other.kept == scenario.kept));
    }
    counts
}

#[test]
fn exid_files_of_a_curved_road_have_the_scenarios_of_the_straight_one() {
    let recording = generated();
    for radius_m in [f64::INFINITY, 2500.0] {
        let dir = tempfile::tempdir().unwrap();
        exid::write(dir.path(), &recording, radius_m);
        let loaded = load_exid(dir.path());
        let read = &loaded.recording;
        assert_eq!(read.tracks.len(), recording.tracks.len(), "{:?}", loaded.notes);
        // Frames begin at 0 instead of 1.
        let [all, near, _] = matched(&recording, read, 1, 1);
        let [of_read, ..] = matched(read, &recording, -1, 1);
        let [_, found, kept] = matched(&recording, read, 1, 30);
        // On the bend, gaps differ by up to 5 m / 2,500 m: headways reach 2 s some frames earlier or later.
        let least = if radius_m.is_finite() { 92 } else { 99 };
        assert!(all > 200 && near * 100 >= all * least, "{radius_m}: {near} of {all}");
        assert!(found * 100 >= all * 99 && kept * 100 >= all * 98, "{radius_m}: {found}, {kept} of {all}");
        assert!(of_read * 100 <= all * 101, "{radius_m}: {of_read} of {all}");
    }
}

/// A vehicle on the right lane of a bend, and one that merges in front of it from an acceleration lane.
fn merging() -> Recording {
    let lanes = Carriageway { name: "2".to_owned(), lane_lines_m: vec![0.0, -3.75, -7.5, -11.25] };
    let mut tracks = Vec::new();
    let frames = 500;
    let mut add = |id: u32, s_m: f64, speed: f64, d: &dyn Fn(f64) -> f64| {
        let s: Vec<f64> = (0..frames).map(|k| s_m + speed * f64::from(k) / 25.0).collect();
        let d_m: Vec<f64> = s.iter().map(|s| d(*s)).collect();
        let ends = |k: usize| (k.saturating_sub(1), (k + 1).min(frames as usize - 1));
        let across = |(a, b): (usize, usize)| (d_m[b] - d_m[a]) * 25.0 / (b - a) as f64;
        let v_d_mps: Vec<f64> = (0..frames as usize).map(ends).map(across).collect();
        tracks.push(Track {
            id,
            class: VehicleClass::Car,
            length_m: 4.5,
            width_m: 1.8,
            carriageway: 0,
            first_frame: 1,
            d_m,
            v_s_mps: vec![speed; s.len()],
            v_d_mps,
            a_s_mps2: vec![0.0; s.len()],
            lane: s.iter().map(|s| lanes.lane_at(d(*s)).map_or(NO_LANE, |lane| lane as u16)).collect(),
            s_m: s,
        });
    };
    for vehicle in 0..6 {
        add(1 + vehicle, 60.0 * f64::from(vehicle), 32.0, &|_| -1.875);
        add(11 + vehicle, -35.0 - 90.0 * f64::from(vehicle), 28.0, &|_| -5.625);
    }
    // From a ramp onto the acceleration lane, along it, and into the right lane.
    add(30, 25.0, 24.0, &|s| {
        let step = |from: f64, to: f64| quintic((s - from) / (to - from));
        -17.0 + 7.625 * step(0.0, 120.0) + 3.75 * step(220.0, 320.0)
    });
    Recording { id: "ramp".to_owned(), frame_rate_hz: 25.0, carriageways: vec![lanes], tracks, synthetic: true }
}

#[test]
fn merging_from_an_on_ramp_of_a_curved_road_is_a_cut_in() {
    let dir = tempfile::tempdir().unwrap();
    exid::write(dir.path(), &merging(), 900.0);
    let loaded = load_exid(dir.path());
    let lines = &loaded.recording.carriageways[0].lane_lines_m;
    assert_eq!(lines.len(), 4, "{lines:?}");
    let mined = mine(&loaded.recording, &MiningOptions::default());
    let cut_in = mined.scenarios.iter().find(|s| s.category == Category::CutIn && s.target_id == 30);
    assert_eq!(cut_in.map(|s| s.ego_id), Some(11), "{:?}", mined.scenarios.iter().map(|s| &s.id).collect::<Vec<_>>());
}

/// What is understood of a table under the generic preset.
pub fn understood(table: &Plain) -> lanesweep::Result<Understanding> {
    read(table).map(|read| read.understanding)
}

pub fn read(table: &Plain) -> lanesweep::Result<Loaded> {
    read_by(table, &|_| ())
}

pub fn fact<'a>(about: &'a Understanding, name: &str) -> &'a str {
    about.facts.iter().find(|(of, _)| *of == name).map_or("", |(_, text)| text)
}

pub fn says(about: &Understanding, words: &str) -> bool {
    about.findings.iter().any(|finding| finding.text.contains(words))
}

/// A table under the generic preset, changed.
pub fn read_by(table: &Plain, change: &dyn Fn(&mut Preset)) -> lanesweep::Result<Loaded> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("own.csv");
    std::fs::write(&path, table.text()).unwrap();
    let mut preset = Preset::load("generic").unwrap();
    change(&mut preset);
    let mut all = tracks::read_tracks(&TrackFile { path, id: "own".to_owned() }, &preset)?;
    Ok(all.remove(0))
}

#[test]
fn a_plain_table_is_understood_and_nothing_is_wrong_with_it() {
    let table = Plain::of(&generated(), 5);
    let about = understood(&table).unwrap();
    assert!(about.is_usable(), "{:?}", about.findings);
    assert_eq!(fact(&about, "rate"), "5 Hz, from the times");
    assert!(fact(&about, "road").starts_with("straight"));
    let lanes = about.facts.iter().filter(|(name, text)| *name == "lanes" && text.contains(": 3 lanes of"));
    assert_eq!(lanes.count(), 2, "{:?}", about.facts);
    assert!(fact(&about, "speeds").starts_with("0 tracks from positions, 0 across"), "{:?}", about.facts);
    // Without speeds, headings and sizes too, but it is said.
    let bare = table.without(&["heading", "speed", "vx", "vy", "length", "width", "class"]);
    let about = understood(&bare).unwrap();
    assert!(about.is_usable() && !fact(&about, "speeds").starts_with("0 "), "{:?}", about.findings);
    assert!(says(&about, "have no size"));
}

/// The corner of the box in place of its middle.
fn of_corners(mut table: Plain) -> Plain {
    for (axis, size) in [("x", "length"), ("y", "width")] {
        let at = table.at(size);
        table.map(axis, |v, row| v - 0.5 * row[at].parse::<f64>().unwrap());
    }
    table
}

#[test]
fn wrong_units_axes_and_reference_points_are_found() {
    let table = Plain::of(&generated(), 5);
    let bare = || table.clone().without(&["heading", "vx", "vy"]);
    let with = |mut table: Plain, change: &dyn Fn(&mut Plain)| {
        change(&mut table);
        table
    };
    let foot = 1.0 / 0.3048;
    let cases: Vec<(&str, Plain, &str)> = vec![
        ("speeds in km/h", with(bare(), &|t| t.map("speed", |v, _| 3.6 * v)), "km/h"),
        ("positions in feet", with(bare(), &|t| ["x", "y"].iter().for_each(|c| t.map(c, |v, _| foot * v))), "feet"),
        ("y flipped, with lateral speeds", with(table.clone(), &|t| t.map("y", |v, _| -v)), "mirrored"),
        ("y flipped, two directions", with(bare(), &|t| t.map("y", |v, _| -v)), "mirrored"),
        ("radians for degrees", with(table.clone(), &|t| t.map("heading", |v, _| v.to_radians())), "heading"),
        ("north for x", with(table.clone(), &|t| t.map("heading", |v, _| 90.0 - v)), "heading"),
        ("a corner for the centre", of_corners(bare()), ""),
        ("a wrong time unit", with(bare(), &|t| t.map("t", |v, _| 1000.0 * v)), ""),
    ];
    for (name, table, expected) in cases {
        let words = match understood(&table) {
            Err(error) => format!("{error} {}", error.help().unwrap_or_default()),
            Ok(about) => {
                assert!(!about.is_usable(), "{name} was not found: {:?}", about.findings);
                about.findings.iter().filter(|f| f.is_grave).map(|f| f.text.clone()).collect::<Vec<_>>().join("; ")
            }
        };
        assert!(words.contains(expected), "{name}: {words}");
    }
    // One direction, no lateral speed, no lorry: nothing can tell, and this is said.
    let mut one_way = bare();
    let x = one_way.at("x");
    let place = |row: &Vec<String>| (row[0].clone(), row[x].parse::<f64>().unwrap());
    let first: BTreeMap<_, _> = one_way.rows.iter().rev().map(place).collect();
    let last: BTreeMap<_, _> = one_way.rows.iter().map(place).collect();
    one_way.rows.retain(|row| last[&row[0]] > first[&row[0]]);
    let class = one_way.at("class");
    one_way.rows.iter_mut().for_each(|row| "car".clone_into(&mut row[class]));
    one_way.map("length", |_, _| 4.5);
    one_way.map("y", |v, _| -v);
    let about = understood(&one_way).unwrap();
    assert!(about.findings.iter().any(|finding| finding.text.contains("mirrored")), "{:?}", about.findings);
}

/// What is understood of one recording as a folder in highD's format, and as a table.
fn by_both_readers(recording: &Recording) -> [Understanding; 2] {
    let dir = tempfile::tempdir().unwrap();
    let (folder, table) = (dir.path().join("highd"), dir.path().join("own.csv"));
    std::fs::create_dir(&folder).unwrap();
    highd::write(&folder, recording).unwrap();
    std::fs::write(&table, Plain::of(recording, 1).text()).unwrap();
    [folder, table].map(|path| {
        let (files, _) = Inputs::of(&path, None).unwrap().files();
        files[0].understand(Implausible::Accepted).unwrap().remove(0).understanding
    })
}

#[test]
fn lorries_beside_the_middle_of_their_lanes_are_no_edge_for_either_reader() {
    let plain = generated();
    let moved = |by_m: &dyn Fn(&Track) -> f64| {
        let mut recording = plain.clone();
        for track in &mut recording.tracks {
            let by_m = by_m(track);
            track.d_m.iter_mut().for_each(|d_m| *d_m += by_m);
        }
        highd::quantize(&mut recording).unwrap();
        by_both_readers(&recording)
    };
    let is_forward = |track: &Track| plain.carriageways[track.carriageway].name == "2";
    // Lorries keep 0.24 m to the right in one direction.
    let is_such = |track: &Track| track.class == VehicleClass::Truck && is_forward(track);
    for about in moved(&|track| if is_such(track) { -0.24 } else { 0.0 }) {
        assert!(about.is_usable(), "{:?}", about.findings);
        for (way, expected) in [("forward: ", -0.24), ("backward: ", 0.0)] {
            let text = about.facts.iter().find(|(name, text)| *name == "offsets" && text.starts_with(way)).unwrap();
            let (mean, error) = text.1.split_once("; lorries ").unwrap().1.split_once(" ± ").unwrap();
            let [mean, error] = [mean, error.split(' ').next().unwrap()].map(|number| number.parse::<f64>().unwrap());
            assert!((mean - expected).abs() < 3.0 * error && error < 0.05, "{text:?}");
        }
    }
    // The upper edge of the box in the image.
    let sign = |track: &Track| if is_forward(track) { 1.0 } else { -1.0 };
    for about in moved(&|track| sign(track) * track.width_m / 2.0) {
        assert!(!about.is_usable() && says(&about, "an edge or a corner of the box gives 1"), "{:?}", about.findings);
    }
    let [folder, table] = moved(&|_| 0.0).map(|about| about.findings);
    assert_eq!(folder, table);
}

#[test]
fn columns_that_contradict_each_other_in_part_are_noted() {
    type Change<'a> = &'a dyn Fn(usize, &mut Track);
    let cases: [(Change, &str); 5] = [
        (&|at, track| track.a_s_mps2.iter_mut().for_each(|a| *a *= (at % 2) as f64), "times the changes of speed"),
        (&|_, track| track.a_s_mps2.iter_mut().for_each(|a| *a = a.max(0.0)), "times the changes of speed"),
        (&|_, track| track.v_d_mps.iter_mut().for_each(|v| *v /= 1.3), "as far across the road"),
        (&|_, track| (10..track.len()).rev().for_each(|k| track.v_s_mps[k] = track.v_s_mps[k - 10]), "s late against"),
        (&|_, track| track.length_m = 4.5, "are not longer than cars"),
    ];
    for (change, expected) in cases {
        let mut recording = shorter();
        recording.tracks.iter_mut().enumerate().for_each(|(at, track)| change(at, track));
        highd::quantize(&mut recording).unwrap();
        let [folder, table] = by_both_readers(&recording);
        assert!(folder.is_usable() && says(&folder, expected), "{expected}: {:?}", folder.findings);
        // The table has no accelerations.
        assert!(table.is_usable() && (expected.starts_with("times") || says(&table, expected)), "{:?}", table.findings);
    }
    let kinds = ["times the changes", "late against", "across the road", "not longer than cars"];
    let plain = by_both_readers(&shorter());
    assert!(plain.iter().all(|about| kinds.iter().all(|kind| !says(about, kind))), "{plain:?}");
}

#[test]
fn the_preset_says_what_a_wrong_file_means() {
    let table = Plain::of(&generated(), 5);
    let [mut wrong, mut front] = [(); 2].map(|()| table.clone());
    ["y", "vy", "heading"].iter().for_each(|column| wrong.map(column, |v, _| -v));
    assert!(!understood(&wrong).unwrap().is_usable());
    let [length, heading] = ["length", "heading"].map(|name| table.at(name));
    let number = |row: &[String], at: usize| row[at].parse::<f64>().unwrap();
    front.map("x", |v, row| v + 0.5 * libm::cos(number(row, heading).to_radians()) * number(row, length));
    type Change = fn(&mut Preset);
    let says: [(Plain, Change); 3] = [
        (wrong, |preset| preset.axes.y = Side::Right),
        (of_corners(table), |preset| preset.reference = Reference::Corner),
        (front, |preset| preset.reference = Reference::Front),
    ];
    for (table, change) in says {
        let about = read_by(&table, &change).unwrap().understanding;
        assert!(about.is_usable(), "{:?}", about.findings);
    }
}

/// What a newcomer's mistakes in a preset did in silence.
#[test]
fn mistakes_in_a_preset_are_not_silent() {
    let table = Plain::of(&generated(), 5);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("own.csv");
    let with = |columns: &str, more: &str| {
        std::fs::write(&path, table.text()).unwrap();
        let own = dir.path().join("own.toml");
        let text = format!(
            "name = \"own\"\ntitle = \"own\"\nformat = \"csv\"\n{more}\n[columns]\nvehicle = \"track_id\"\ntime = \"t\"\nx = \"x\"\ny = \"y\"\n{columns}"
        );
        std::fs::write(&own, text).unwrap();
        let preset = Preset::load(&own.to_string_lossy())?;
        let file = TrackFile { path: path.clone(), id: "own".to_owned() };
        tracks::read_tracks(&file, &preset).map(|mut all| all.remove(0).understanding)
    };
    let error = with("speed = \"sped\"", "").unwrap_err().to_string();
    assert!(error.contains("`speed`") && error.contains("did you mean `speed`"), "{error}");
    let error = with("speed = \"speed\"", "smoothing_s = 25.0").unwrap_err().to_string();
    assert!(error.contains("smoothing_s: 25 is out of range"), "{error}");
    assert!(!with("speed = \"speed\"\ndirection = \"length\"", "").unwrap().is_usable());
    assert!(!with("speed = \"speed\"", "frame_rate_hz = 50.0").unwrap().is_usable());
    assert!(!with("lane = \"class\"", "").unwrap().is_usable());
    let about =
        with("class = \"class\"\nlength = \"length\"\nwidth = \"width\"", "classes = { truck = [\"lorry\"] }").unwrap();
    assert!(fact(&about, "vehicles").contains(" 0 lorries"), "{:?}", about.facts);
}

#[test]
fn missing_values_gaps_and_repeated_rows_are_said() {
    let mut table = Plain::of(&generated(), 5);
    let (x, t) = (table.at("x"), table.at("t"));
    let rows_of = |id: &String| table.rows.iter().filter(|row| row[0] == *id).count();
    let id = table.rows.iter().map(|row| row[0].clone()).find(|id| rows_of(id) > 40).unwrap();
    let own: Vec<usize> = (0..table.rows.len()).filter(|at| table.rows[*at][0] == id).collect();
    table.rows[own[2]][x] = "NaN".to_owned();
    let copy = table.rows[own[4]].clone();
    table.rows.push(copy.clone());
    let mut elsewhere = copy;
    elsewhere[x] = "1.0".to_owned();
    table.rows.push(elsewhere);
    // A hole of two seconds: two tracks.
    let hole: Vec<usize> = own[10..20].to_vec();
    table.rows = table.rows.into_iter().enumerate().filter(|(at, _)| !hole.contains(at)).map(|(_, row)| row).collect();
    let loaded = read(&table).unwrap();
    let about = &loaded.understanding;
    assert!(!loaded.vehicle_names.is_empty());
    for words in ["1 rows have no position", "2 rows repeat", "1 of these rows name another", "were interpolated"] {
        assert!(says(about, words), "{words}: {:?}", about.findings);
    }
    // What is no number is refused with its place.
    let mut bad = table.clone();
    bad.rows[3][t] = "soon".to_owned();
    let error = understood(&bad).unwrap_err().to_string();
    assert!(error.contains("line 5") && error.contains("`t`") && error.contains("soon"), "{error}");
}

/// The headers of the formats, as their publishers describe them. SUMO writes no sizes, so a table with the usual names of
/// sizes is that of another program.
#[test]
fn every_format_is_detected_by_its_header() {
    let headers = "\
exid|07_tracks.csv|recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,xAcceleration,yAcceleration,lonVelocity,latVelocity,lonAcceleration,latAcceleration
sumo-fcd|fcd.csv|timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed;vehicle_pos;vehicle_lane;vehicle_edge;vehicle_slope
mitra|T1_D1.csv|Vehicle_ID,Vehicle_type,Time [s],x [m],y [m],Speed [km/h],Lon. Acc. [ms-2],Lat. Acc. [ms-2],Angle [rad],Vehicle_length [m],Vehicle_width [m],Lane,Leader_ID,Follower_ID,Left_Leader_ID,Left_Follower_ID,Right_Leader_ID,Right_Follower_ID
tgsim|i294.csv|id,time,xloc-kf,yloc-kf,lane-kf,speed-kf,acceleration-kf,length-smoothed,width-smoothed,type-most-common,av,run-index
ngsim|us101.csv|Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,Global_X,Global_Y,v_length,v_Width,v_Class,v_Vel,v_Acc,Lane_ID,Preceding,Following,Space_Headway,Time_Headway,Location
citysim|free.csv|frameNum,carId,carCenterX,carCenterY,headX,headY,tailX,tailY,carCenterXft,carCenterYft,speed,course,heading,laneId
generic|x.csv|track_id,t,x,y,class
sumo-fcd|table.csv|id,time,x,y,speed,lane,angle,type
generic|table.csv|id,time,x,y,speed,lane,length,width,class
generic|table.csv|id,time,x,y,speed,lane,angle,type,length,width
";
    let dir = tempfile::tempdir().unwrap();
    for line in headers.lines() {
        let [name, file, header] = line.split('|').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let path = dir.path().join(file);
        std::fs::write(&path, format!("{header}\n")).unwrap();
        let found = tracks::detect(&path).unwrap();
        assert_eq!(found.map(|preset| preset.name).as_deref(), Some(name), "{header}");
    }
    let path = dir.path().join("unknown.csv");
    std::fs::write(&path, "Zeit,Fahrzeug,Ort,Spur\n").unwrap();
    assert_eq!(tracks::detect(&path).unwrap(), None);
    let error = Inputs::of(&path, None).unwrap_err();
    assert!(error.to_string().contains("`Fahrzeug`") && error.help().unwrap().contains("`generic`"), "{error}");
}

/// A mistake in SI units: role, value, sample → value.
type Mistake<'a> = &'a dyn Fn(Role, f64, &Track) -> f64;

/// The recording as a table in a preset's format, with a row per `stride`-th sample.
fn in_format_of(preset: &Preset, recording: &Recording, stride: usize, mistake: Mistake) -> String {
    let y_sign = if preset.axes.y == Side::Right { -1.0 } else { 1.0 };
    let value = |role: Role, track: &Track, k: usize| -> String {
        let at = exid::in_plane(recording, track, k, f64::INFINITY);
        let (cos, sin) = (libm::cos(at.heading), libm::sin(at.heading));
        let shift = match preset.reference {
            Reference::Front => 0.5 * track.length_m,
            Reference::Rear => -0.5 * track.length_m,
            _ => 0.0,
        };
        let (x, y) = (at.x + shift * cos, at.y + shift * sin);
        // A road along y: the same plane turned, so that left of travel stays left.
        let (x, y) = if preset.road == RoadSource::Y { (-y, x) } else { (x, y) };
        let frame = track.first_frame + k as i64;
        let heading = match preset.axes.heading {
            HeadingOrigin::FromX => y_sign * at.heading,
            HeadingOrigin::FromNorth => std::f64::consts::FRAC_PI_2 - at.heading,
        };
        let si = match role {
            Role::Vehicle => return track.id.to_string(),
            Role::Recording => return "r1".to_owned(),
            Role::Class => return String::new(),
            Role::Lane => return format!("{}", 1 + 10 * track.carriageway + usize::from(track.lane[k])),
            Role::Frame => return (frame / stride as i64).to_string(),
            Role::Direction => return if at.velocity[0] > 0.0 { "1".to_owned() } else { "-1".to_owned() },
            Role::Time if preset.name == "dlr-ht" => {
                let seconds = frame as f64 / recording.frame_rate_hz;
                return format!("2024-10-07 06:{:02}:{:09.6}+00:00", (seconds / 60.0) as u32, seconds % 60.0);
            }
            Role::Time => frame as f64 / recording.frame_rate_hz,
            Role::X => x,
            Role::Y => y_sign * y,
            Role::Heading => heading,
            Role::Speed | Role::ForwardSpeed => track.v_s_mps[k],
            Role::LeftwardSpeed => track.v_d_mps[k],
            Role::XSpeed => at.velocity[0],
            Role::YSpeed => y_sign * at.velocity[1],
            Role::Acceleration => track.a_s_mps2[k],
            Role::XAcceleration => at.acceleration[0],
            Role::YAcceleration => y_sign * at.acceleration[1],
            Role::Length => track.length_m,
            Role::Width => track.width_m,
            Role::LaneOffset => {
                let lane = recording.carriageways[track.carriageway].lane(track.lane[k].into());
                lane.map_or(0.0, |lane| track.d_m[k] - lane.centre_m())
            }
            Role::FrameRate => return String::new(),
        };
        let factor = preset.columns[&role].factor(role).unwrap();
        format!("{:.6}", mistake(role, si, track) / factor)
    };
    let columns: Vec<(Role, &str)> =
        preset.columns.iter().map(|(role, column)| (*role, column.names[0].as_str())).collect();
    let mut text = columns.iter().map(|(_, name)| *name).collect::<Vec<_>>().join(",") + "\n";
    for track in &recording.tracks {
        for k in (0..track.len()).filter(|k| (track.first_frame + *k as i64) % stride as i64 == 0) {
            text += &(columns.iter().map(|(role, _)| value(*role, track, k)).collect::<Vec<_>>().join(",") + "\n");
        }
    }
    text
}

/// The columns of a table: whole numbers where they are named, numbers where the first row has one, else texts.
#[cfg(feature = "parquet")]
pub fn columns(text: &str, whole: &[&str]) -> Vec<(String, arrow_array::ArrayRef)> {
    use arrow_array::{ArrayRef, Float64Array, Int64Array, StringArray};
    let table = Plain::of_text(text);
    let column = |(at, name): (usize, &String)| -> (String, ArrayRef) {
        let texts = || table.rows.iter().map(move |row| row[at].as_str());
        let numbers = || texts().map(|text| text.parse::<f64>().unwrap());
        let array: ArrayRef = match table.rows[0][at].parse::<f64>() {
            _ if whole.contains(&&**name) => {
                std::sync::Arc::new(Int64Array::from_iter_values(numbers().map(|n| n as i64)))
            }
            Err(_) => std::sync::Arc::new(StringArray::from_iter_values(texts())),
            Ok(_) => std::sync::Arc::new(Float64Array::from_iter_values(numbers())),
        };
        (name.clone(), array)
    };
    table.header.iter().enumerate().map(column).collect()
}

/// Every preset reads traffic in its own format, and finds the usual mistakes in it.
#[test]
fn every_preset_reads_its_own_format_and_finds_mistakes_in_it() {
    let recording = shorter();
    let foot = 1.0 / 0.3048;
    let right: Mistake = &|_, value, _| value;
    let times = |factor: f64, is_wrong: bool, value: f64| if is_wrong { factor * value } else { value };
    let mistakes: [(&str, Mistake); 4] = [
        ("positions times 3.28", &|role, value, _| times(foot, matches!(role, Role::X | Role::Y), value)),
        ("speeds times 3.6", &|role, value, _| {
            times(3.6, matches!(role, Role::Speed | Role::ForwardSpeed | Role::XSpeed), value)
        }),
        ("everything times 3.28", &|role, value, _| times(foot, !matches!(role, Role::Time | Role::Heading), value)),
        ("y flipped", &|role, value, _| times(-1.0, role == Role::Y, value)),
    ];
    let names = Preset::names().filter(|name| *name != tracks::HIGHD);
    let presets = names.map(|name| Preset::load(name).unwrap());
    let mut tried = 0;
    for preset in presets {
        let dir = tempfile::tempdir().unwrap();
        let is_parquet = cfg!(feature = "parquet") && ["frenet", "i24", "omega-prime"].contains(&preset.name.as_str());
        let path = dir.path().join(if is_parquet { "own.parquet" } else { "own.csv" });
        let stride = 4;
        // The rate where only a meta file or the format says it.
        let rate = (!preset.columns.contains_key(&Role::Time)).then_some(recording.frame_rate_hz / stride as f64);
        let preset = Preset { frame_rate_hz: rate, smoothing_s: None, vehicles: None, recording: None, ..preset };
        let understood = |mistake: Mistake| {
            let text = in_format_of(&preset, &recording, stride, mistake);
            match is_parquet {
                #[cfg(feature = "parquet")]
                true => {
                    let columns = columns(&text, &[preset.columns[&Role::Vehicle].names[0].as_str()]);
                    crate::common::made::write(&path, columns, parquet::basic::Compression::SNAPPY);
                }
                _ => std::fs::write(&path, text).unwrap(),
            }
            let file = TrackFile { path: path.clone(), id: "own".to_owned() };
            tracks::read_tracks(&file, &preset).map(|mut all| all.remove(0).understanding)
        };
        let about = understood(right).unwrap();
        assert!(about.is_usable(), "{}: {:?}", preset.name, about.findings);
        let lanes = about.facts.iter().filter(|(name, _)| *name == "lanes");
        let lanes: Vec<&str> = lanes.map(|(_, text)| text.as_str()).collect();
        assert_eq!(lanes.len(), 2, "{}", preset.name);
        // Bands of 12 ft are no lanes of 3.5 m.
        let is_right = lanes.iter().all(|text| text.contains(": 3 lanes"));
        assert!(is_right || preset.lanes.width_m.is_some(), "{}: {lanes:?}", preset.name);
        let has_speed = [Role::Speed, Role::ForwardSpeed, Role::XSpeed].iter().any(|r| preset.columns.contains_key(r));
        for (name, mistake) in mistakes.into_iter().filter(|(name, _)| has_speed || !name.starts_with("speeds")) {
            match understood(mistake) {
                Ok(about) => assert!(!about.is_usable(), "{}, {name}: {:?}", preset.name, about.findings),
                Err(error) => assert!(error.help().is_some(), "{error}"),
            }
        }
        tried += 1;
    }
    assert_eq!(tried, 11);
}

/// Files for readers in Python: `python benches/python/track_readers.py LANESWEEP target/tmp/exid`.
#[test]
#[ignore = "writes files for a comparison with other programs"]
fn an_exid_fixture_is_left_for_other_readers() {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("exid");
    for (id, radius_m) in [("00", 2500.0), ("01", f64::INFINITY)] {
        exid::write(&dir, &Recording { id: id.to_owned(), ..generated() }, radius_m);
    }
}
