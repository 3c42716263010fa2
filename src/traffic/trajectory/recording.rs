//! The internal model of a trajectory file. Every reader ends here and nothing downstream knows the
//! format a recording came from.
//!
//! Frame (ISO 8855, per carriageway): `s` forward along the direction of travel, `d` to the **left** of
//! it, both in metres, of the vehicle's geometric centre; uniform time base.

/// One recording: a stretch of road over a period of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Short stable name (`01` for `01_tracks.csv`): the first part of every scenario key.
    pub id: String,
    /// Samples per second; > 0, finite.
    pub frame_rate_hz: f64,
    /// The road, by direction of travel; at least one.
    pub carriageways: Vec<Carriageway>,
    /// Every vehicle, ascending by [`Track::id`].
    pub tracks: Vec<Track>,
    /// Made up by the program: nothing that follows from it is a statement about real traffic.
    pub synthetic: bool,
}

/// One direction of travel with its lanes.
#[derive(Debug, Clone, PartialEq)]
pub struct Carriageway {
    /// How the file calls it (highD: `1` upper lanes, `2` lower lanes).
    pub name: String,
    /// Lateral positions `d` of the lane lines in metres, from the **leftmost to the rightmost**
    /// (strictly falling). `n + 1` lines bound `n` lanes; lane 0 is the leftmost.
    pub lane_lines_m: Vec<f64>,
}

impl Carriageway {
    /// Number of lanes.
    pub fn lane_count(&self) -> usize {
        self.lane_lines_m.len().saturating_sub(1)
    }

    /// Left and right line of a lane; `None` beyond the carriageway.
    pub fn lane(&self, lane: usize) -> Option<Lane> {
        let left_m = *self.lane_lines_m.get(lane)?;
        let right_m = *self.lane_lines_m.get(lane + 1)?;
        Some(Lane { left_m, right_m })
    }

    /// Lane that holds the lateral position `d_m`; `None` off the carriageway.
    pub fn lane_at(&self, d_m: f64) -> Option<usize> {
        (0..self.lane_count()).find(|&l| self.lane_lines_m[l] >= d_m && d_m >= self.lane_lines_m[l + 1])
    }
}

/// The two lines of one lane, as lateral positions in metres (`left_m > right_m`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lane {
    /// Left line.
    pub left_m: f64,
    /// Right line.
    pub right_m: f64,
}

impl Lane {
    /// Lateral position of the middle.
    pub fn centre_m(&self) -> f64 {
        0.5 * (self.left_m + self.right_m)
    }

    /// Width, > 0.
    pub fn width_m(&self) -> f64 {
        self.left_m - self.right_m
    }
}

/// Kind of vehicle, as far as the data says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VehicleClass {
    /// Passenger car, van, motorcycle.
    Car,
    /// Lorry or bus.
    Truck,
}

/// One vehicle's way through the recording, without gaps: sample `k` belongs to frame
/// `first_frame + k`. All series have the same length, at least 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Number of the vehicle in its recording.
    pub id: u32,
    /// Kind of vehicle.
    pub class: VehicleClass,
    /// Length along the direction of travel, m, > 0.
    pub length_m: f64,
    /// Width, m, > 0.
    pub width_m: f64,
    /// Index into [`Recording::carriageways`].
    pub carriageway: usize,
    /// Frame number of sample 0.
    pub first_frame: i64,
    /// Centre along the road, m, forward.
    pub s_m: Vec<f64>,
    /// Centre across the road, m, to the left.
    pub d_m: Vec<f64>,
    /// Speed along the road, m/s, forward.
    pub v_s_mps: Vec<f64>,
    /// Speed across the road, m/s, to the left.
    pub v_d_mps: Vec<f64>,
    /// Acceleration along the road, m/s², forward.
    pub a_s_mps2: Vec<f64>,
    /// Lane of each sample, 0 the leftmost of the carriageway; [`NO_LANE`] where the vehicle is off it.
    pub lane: Vec<u16>,
}

/// Value of [`Track::lane`] for a sample that is in no lane of its carriageway.
pub const NO_LANE: u16 = u16::MAX;

impl Track {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.s_m.len()
    }

    /// True for a track without samples (no reader makes one).
    pub fn is_empty(&self) -> bool {
        self.s_m.is_empty()
    }

    /// Frame number of the last sample.
    pub fn last_frame(&self) -> i64 {
        self.first_frame + self.len() as i64 - 1
    }

    /// Index of the sample at `frame`; `None` where the vehicle is not in view.
    pub fn index_of(&self, frame: i64) -> Option<usize> {
        let k = frame - self.first_frame;
        (k >= 0 && (k as usize) < self.len()).then_some(k as usize)
    }
}

impl Recording {
    /// The vehicle with this number.
    pub fn track(&self, id: u32) -> Option<&Track> {
        self.tracks.binary_search_by_key(&id, |t| t.id).ok().map(|i| &self.tracks[i])
    }

    /// Time between two samples, s.
    pub fn sample_time_s(&self) -> f64 {
        1.0 / self.frame_rate_hz
    }
}
