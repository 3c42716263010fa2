//! Recordings as exiD files on a bent road, and as plain tables of tracks.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use lanesweep::traffic::trajectory::{Carriageway, NO_LANE, Recording, Track, VehicleClass};

const TRACKS: &str = "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,\
xAcceleration,yAcceleration,lonVelocity,latVelocity,lonAcceleration,latAcceleration,traveledDistance,latLaneCenterOffset,\
laneWidth,laneletId,laneChange,lonLaneletPos,laneletLength,leadDHW,leadDV,leadTHW,leadTTC,leadId,rearId,leftLeadId,\
leftRearId,leftAlongsideId,rightLeadId,rightRearId,rightAlongsideId,odrRoadId,odrSectionNo,odrLaneId";
const TRACKS_META: &str = "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class";
const RECORDING_META: &str = "recordingId,locationId,frameRate,speedLimit,weekday,startTime,duration,numTracks,\
numVehicles,numVRUs,latLocation,lonLocation,xUtmOrigin,yUtmOrigin,orthoPxToMeter";

/// A vehicle at a sample: position, heading (rad), velocity, acceleration in the plane.
pub struct InPlane {
    pub x: f64,
    pub y: f64,
    pub heading: f64,
    pub velocity: [f64; 2],
    pub acceleration: [f64; 2],
}

/// Where a sample is, if the forward carriageway runs along a circle of this radius to the left; infinite: straight.
pub fn in_plane(recording: &Recording, track: &Track, k: usize, radius_m: f64) -> InPlane {
    let way = if recording.carriageways[track.carriageway].name == "1" { -1.0 } else { 1.0 };
    let (along, left) = (way * track.s_m[k], way * track.d_m[k]);
    let turn = if radius_m.is_finite() { along / radius_m } else { 0.0 };
    // The middle of the road has the radius, so that lengths along it are right within a few thousandths.
    let middle = |carriageway: &Carriageway| {
        carriageway.lane_lines_m.iter().sum::<f64>() / carriageway.lane_lines_m.len() as f64
    };
    let middles = recording.carriageways.iter().map(|c| if c.name == "1" { -middle(c) } else { middle(c) });
    let left_of_middle = left - middles.sum::<f64>() / recording.carriageways.len() as f64;
    let (x, y) = match radius_m.is_finite() {
        true => {
            ((radius_m - left_of_middle) * libm::sin(turn), radius_m - (radius_m - left_of_middle) * libm::cos(turn))
        }
        false => (along, left),
    };
    let heading = if way > 0.0 { turn } else { turn + std::f64::consts::PI };
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    let turned = |forward: f64, leftward: f64| [forward * cos - leftward * sin, forward * sin + leftward * cos];
    InPlane {
        x,
        y,
        heading,
        velocity: turned(track.v_s_mps[k], track.v_d_mps[k]),
        acceleration: turned(track.a_s_mps2[k], 0.0),
    }
}

/// Writes the three exiD files of a recording on a bend. Frames begin at 0.
pub fn write(dir: &Path, recording: &Recording, radius_m: f64) {
    fs::create_dir_all(dir).unwrap();
    let mut tracks = format!("{TRACKS}\n");
    let mut meta = format!("{TRACKS_META}\n");
    for track in &recording.tracks {
        let class = if track.class == VehicleClass::Truck { "truck" } else { "car" };
        let (first, last, frames) = (track.first_frame - 1, track.last_frame() - 1, track.len());
        let (id, width, length) = (track.id, track.width_m, track.length_m);
        let _ = writeln!(meta, "0,{id},{first},{last},{frames},{width:.2},{length:.2},{class}");
        for k in 0..frames {
            let at = in_plane(recording, track, k, radius_m);
            let carriageway = &recording.carriageways[track.carriageway];
            let lane = carriageway.lane(track.lane[k].into());
            let lanelet = if track.lane[k] == NO_LANE {
                -1
            } else {
                1000 * (1 + track.carriageway as i64) + i64::from(track.lane[k])
            };
            let offset = lane.map_or(0.0, |lane| track.d_m[k] - lane.centre_m());
            let lane_width = lane.map_or(3.5, |lane| lane.width_m());
            // Several values are joined: the lanelet's successor follows.
            let joined = if k % 50 == 7 { format!("{lanelet};{}", lanelet + 500) } else { lanelet.to_string() };
            let _ = writeln!(
                tracks,
                "0,{id},{},{k},{:.5},{:.5},{:.5},{width:.2},{length:.2},{:.5},{:.5},{:.5},{:.5},{:.5},{:.5},{:.5},0.0,\
                 {:.3},{offset:.3},{lane_width:.2},{joined},0,{:.2},500.0,-1,-1000,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,0,0,-{}",
                first + k as i64,
                at.x,
                at.y,
                at.heading.to_degrees().rem_euclid(360.0),
                at.velocity[0],
                at.velocity[1],
                at.acceleration[0],
                at.acceleration[1],
                track.v_s_mps[k],
                track.v_d_mps[k],
                track.a_s_mps2[k],
                track.s_m[k] - track.s_m[0],
                track.s_m[k] - track.s_m[0],
                track.lane[k] + 1,
            );
        }
    }
    let vehicles = recording.tracks.len();
    let recording_meta = format!(
        "{RECORDING_META}\n0,0,{},-1,tuesday,09,{},{vehicles},{vehicles},0,50.7,6.1,300000.0,5600000.0,0.1\n",
        recording.frame_rate_hz, 245
    );
    for (name, text) in [("tracks", tracks), ("tracksMeta", meta), ("recordingMeta", recording_meta)] {
        fs::write(dir.join(format!("{}_{name}.csv", recording.id)), text).unwrap();
    }
}

/// A plain table of tracks with usual names, whose values a test can spoil.
#[derive(Clone)]
pub struct Plain {
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Plain {
    /// Every `stride`-th sample of a recording in one plane: track_id, t, x, y, heading, speed, vx, vy, length, width, class.
    pub fn of(recording: &Recording, stride: usize) -> Plain {
        Plain::on_bend(recording, stride, f64::INFINITY)
    }

    pub fn on_bend(recording: &Recording, stride: usize, radius_m: f64) -> Plain {
        let names = ["track_id", "t", "x", "y", "heading", "speed", "vx", "vy", "length", "width", "class"];
        let mut rows = Vec::new();
        for track in &recording.tracks {
            for k in (0..track.len()).filter(|k| (track.first_frame + *k as i64) % stride as i64 == 0) {
                let at = in_plane(recording, track, k, radius_m);
                let time = (track.first_frame + k as i64) as f64 / recording.frame_rate_hz;
                let speed = libm::hypot(at.velocity[0], at.velocity[1]);
                let class = if track.class == VehicleClass::Truck { "truck" } else { "car" };
                let ([vx, vy], heading) = (at.velocity, at.heading.to_degrees());
                let numbers = [time, at.x, at.y, heading, speed, vx, vy, track.length_m, track.width_m];
                let numbers = numbers.iter().map(|number| format!("{number:.4}"));
                rows.push([track.id.to_string()].into_iter().chain(numbers).chain([class.to_owned()]).collect());
            }
        }
        Plain { header: names.map(str::to_owned).to_vec(), rows }
    }

    pub fn of_text(text: &str) -> Plain {
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Plain { header: lines.next().unwrap(), rows: lines.collect() }
    }

    pub fn number(&self, row: usize, name: &str) -> f64 {
        self.rows[row][self.at(name)].parse().unwrap()
    }

    pub fn shift(&mut self, rows: &[usize], name: &str, by: f64) {
        let at = self.at(name);
        rows.iter().for_each(|row| self.rows[*row][at] = (self.number(*row, name) + by).to_string());
    }

    pub fn at(&self, name: &str) -> usize {
        self.header.iter().position(|column| column == name).unwrap()
    }

    pub fn map(&mut self, name: &str, change: impl Fn(f64, &[String]) -> f64) {
        let at = self.at(name);
        for row in &mut self.rows {
            let value = change(row[at].parse().unwrap(), row);
            row[at] = format!("{value:.4}");
        }
    }

    pub fn without(mut self, names: &[&str]) -> Plain {
        for name in names {
            let at = self.at(name);
            self.header.remove(at);
            self.rows.iter_mut().for_each(|row| drop(row.remove(at)));
        }
        self
    }

    pub fn text(&self) -> String {
        let lines = std::iter::once(&self.header).chain(&self.rows).map(|row| row.join(",") + "\n");
        lines.collect()
    }
}
