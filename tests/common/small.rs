//! A small valid recording, and its three files as texts that a test can spoil.

use std::fs;
use std::path::Path;

use super::exid::Plain;
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

    pub fn read(&self) -> Result<Loaded> {
        self.read_checked(Implausible::Accepted)
    }

    pub fn read_checked(&self, implausible: Implausible) -> Result<Loaded> {
        let dir = tempfile::tempdir().unwrap();
        let files = HighdFiles::named(dir.path(), "01");
        fs::write(&files.tracks, &self.tracks).unwrap();
        fs::write(&files.tracks_meta, &self.tracks_meta).unwrap();
        fs::write(&files.recording_meta, &self.recording_meta).unwrap();
        InputFile::Highd(files).read(implausible).map(|mut all| all.remove(0))
    }
}

/// The table with one field replaced; lines are counted from 1 and include the header.
pub fn with_field(table: &str, line: usize, column: &str, value: &str) -> String {
    let mut table = Plain::of_text(table);
    let at = table.at(column);
    value.clone_into(&mut table.rows[line - 2][at]);
    table.text()
}
