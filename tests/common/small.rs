//! A small valid recording, and its three files as texts that a test can spoil.

use std::fs;
use std::path::Path;

use lanesweep::Result;
use lanesweep::model::plausibility::Implausible;
use lanesweep::traffic::trajectory::highd::{self, HighdFiles};
use lanesweep::traffic::trajectory::{Carriageway, InputFile, Loaded, Recording, Track, VehicleClass};

/// A vehicle at constant speed in the middle of a lane, at 25 samples per second.
pub fn cruising(
    id: u32,
    carriageway: usize,
    lane: u16,
    first_frame: i64,
    samples: usize,
    recording: &Recording,
) -> Track {
    let speed_mps = 20.0 + f64::from(id);
    let at = recording.carriageways[carriageway].lane(lane.into()).unwrap();
    Track {
        id,
        class: if id.is_multiple_of(2) { VehicleClass::Truck } else { VehicleClass::Car },
        length_m: 4.0 + f64::from(id),
        width_m: 1.8,
        carriageway,
        first_frame,
        s_m: (0..samples).map(|k| 50.0 * f64::from(id) + speed_mps * k as f64 / 25.0).collect(),
        d_m: vec![at.centre_m(); samples],
        v_s_mps: vec![speed_mps; samples],
        v_d_mps: vec![0.1; samples],
        a_s_mps2: vec![-0.25; samples],
        lane: vec![lane; samples],
    }
}

/// Three upper and two lower lanes, four vehicles with 5 to 8 samples.
pub fn recording() -> Recording {
    let mut recording = Recording {
        id: "01".to_owned(),
        frame_rate_hz: 25.0,
        carriageways: vec![
            Carriageway { name: "1".to_owned(), lane_lines_m: vec![19.25, 15.5, 11.75, 8.0] },
            Carriageway { name: "2".to_owned(), lane_lines_m: vec![-24.0, -27.5, -31.25] },
        ],
        tracks: Vec::new(),
        synthetic: false,
    };
    let tracks = [(1, 0, 0, 1, 8), (2, 0, 2, 3, 5), (5, 1, 0, 1, 8), (7, 1, 1, 4, 5)];
    recording.tracks = tracks
        .map(|(id, carriageway, lane, from, samples)| cruising(id, carriageway, lane, from, samples, &recording))
        .into();
    highd::quantize(&mut recording).unwrap();
    recording
}

/// The three files of a recording.
#[derive(Debug, Clone)]
pub struct Texts {
    pub tracks: String,
    pub tracks_meta: String,
    pub recording_meta: String,
}

impl Texts {
    /// Those of [`recording`].
    pub fn small() -> Self {
        Texts::of(&recording())
    }

    pub fn of(recording: &Recording) -> Self {
        let dir = tempfile::tempdir().unwrap();
        highd::write(dir.path(), recording).unwrap();
        let files = HighdFiles::named(dir.path(), &recording.id);
        let text = |path: &Path| fs::read_to_string(path).unwrap();
        Texts {
            tracks: text(&files.tracks),
            tracks_meta: text(&files.tracks_meta),
            recording_meta: text(&files.recording_meta),
        }
    }

    /// Reads them as the recording `01`.
    pub fn read(&self) -> Result<Loaded> {
        self.read_checked(Implausible::Accepted)
    }

    pub fn read_checked(&self, implausible: Implausible) -> Result<Loaded> {
        read_checked([&self.tracks, &self.tracks_meta, &self.recording_meta].map(|text| text.as_bytes()), implausible)
    }
}

/// Reads three files of these contents (tracks, tracksMeta, recordingMeta) as the recording `01`.
pub fn read_bytes(contents: [&[u8]; 3]) -> Result<Loaded> {
    read_checked(contents, Implausible::Accepted)
}

fn read_checked(contents: [&[u8]; 3], implausible: Implausible) -> Result<Loaded> {
    let dir = tempfile::tempdir().unwrap();
    let files = HighdFiles::named(dir.path(), "01");
    for (path, content) in [&files.tracks, &files.tracks_meta, &files.recording_meta].into_iter().zip(contents) {
        fs::write(path, content).unwrap();
    }
    InputFile::Highd(files).read(implausible).map(|mut all| all.remove(0))
}

/// The table with one field replaced; lines are counted from 1 and include the header.
pub fn with_field(table: &str, line: usize, column: &str, value: &str) -> String {
    let at = table.lines().next().unwrap().split(',').position(|name| name == column).expect("a column of the table");
    edit_line(table, line, |text| {
        let mut fields: Vec<&str> = text.split(',').collect();
        fields[at] = value;
        fields.join(",")
    })
}

/// The table with one line changed.
pub fn edit_line(table: &str, line: usize, edit: impl Fn(&str) -> String) -> String {
    let edited = table.lines().enumerate().map(|(at, text)| if at + 1 == line { edit(text) } else { text.to_owned() });
    edited.collect::<Vec<_>>().join("\n") + "\n"
}

/// The table with one of its lines again at the end.
pub fn with_repeated_line(table: &str, line: usize) -> String {
    format!("{table}{}\n", table.lines().nth(line - 1).unwrap())
}

/// The table without one line.
pub fn without_line(table: &str, line: usize) -> String {
    table.lines().enumerate().filter(|(at, _)| at + 1 != line).map(|(_, text)| format!("{text}\n")).collect()
}

/// The table without one column.
pub fn without_column(table: &str, column: &str) -> String {
    let at = table.lines().next().unwrap().split(',').position(|name| name == column).expect("a column of the table");
    let short = |text: &str| {
        let fields = text.split(',').enumerate().filter(|(index, _)| *index != at).map(|(_, field)| field);
        fields.collect::<Vec<_>>().join(",") + "\n"
    };
    table.lines().map(short).collect()
}
