//! Requirements of the format on a recording, and the values that it preserves.

use super::format::{FRAME_LIMIT, FRAME_RATES_HZ, LANE_LINES_LIMIT};
use super::frame::{Direction, LaneNumbers};
use crate::trajectory::number::{REAL_LIMIT, rounded};
use crate::trajectory::{NO_LANE, Recording, Track};
use lanesweep_support::{Error, Place, Result};

/// Rounds a recording to the values that its own files hold: writing the quantized recording with
/// `write` and reading it gives the same bits.
///
/// Every value is transformed, rounded to hundredths and transformed back until it no longer changes.
///
/// # Errors
/// If the format cannot hold the recording, see `write`.
pub fn quantize(recording: &mut Recording) -> Result<()> {
    let layout = ImageLayout::of(recording)?;
    let settle = |values: &mut [f64], to_file: &dyn Fn(f64) -> f64, from_file: &dyn Fn(f64) -> f64| {
        for value in values {
            // Twice is enough: fl(fl(a + h) − h) is a fixed point of its own repetition (Knuth, The Art of
            // Computer Programming 2, theorem 4.2.2 D).
            for _ in 0..3 {
                *value = from_file(rounded(to_file(*value)));
            }
        }
    };
    for (carriageway, &direction) in recording.carriageways.iter_mut().zip(&layout.directions) {
        let turn = |v| direction.leftward(v);
        settle(&mut carriageway.lane_lines_m, &turn, &turn);
    }
    for track in &mut recording.tracks {
        let direction = layout.directions[track.carriageway];
        let (forward, leftward) = (|v| direction.forward(v), |v| direction.leftward(v));
        let (length_m, width_m) = (rounded(track.length_m), rounded(track.width_m));
        (track.length_m, track.width_m) = (length_m, width_m);
        settle(&mut track.s_m, &|s| direction.x_of(s, length_m), &|x| direction.s_of(x, length_m));
        settle(&mut track.d_m, &|d| direction.y_of(d, width_m), &|y| direction.d_of(y, width_m));
        settle(&mut track.v_s_mps, &forward, &forward);
        settle(&mut track.v_d_mps, &leftward, &leftward);
        settle(&mut track.a_s_mps2, &forward, &forward);
        for lane in &mut track.lane {
            if layout.lane_numbers.id_of(direction, *lane).is_none() {
                *lane = NO_LANE;
            }
        }
    }
    Ok(())
}

/// The image of a recording: the half of each carriageway, and its lane lines from top to bottom.
pub(super) struct ImageLayout {
    /// By index of the carriageway.
    pub directions: Vec<Direction>,
    /// y of the upper and of the lower lane lines, rounded, ascending; empty without that carriageway.
    pub lines_y: [Vec<f64>; 2],
    /// The numbers of the lanes.
    pub lane_numbers: LaneNumbers,
}

impl ImageLayout {
    /// The layout of a recording that the format can hold.
    ///
    /// # Errors
    /// The first reason why it cannot.
    pub(super) fn of(recording: &Recording) -> Result<Self> {
        let refuse = |item: String, problem: &str| {
            let place = Place::item(format!("recording `{}`{item}", recording.id));
            Err(Error::input(place, format!("{problem}; highD files cannot represent it"), "correct the recording"))
        };
        if let Some(problem) = problem(recording) {
            return refuse(String::new(), problem);
        }
        let (mut directions, mut lines_y) = (Vec::<Direction>::new(), [Vec::new(), Vec::new()]);
        for of in &recording.carriageways {
            let follows = |direction: &Direction| directions.last().is_none_or(|last| (*last as u8) < *direction as u8);
            let named = Direction::BOTH.into_iter().find(|direction| direction.name() == of.name);
            let item = format!(", carriageway `{}`", of.name);
            let Some(direction) = named.filter(follows) else {
                let problem = "unknown, repeated or out of order: names are `1` (upper lanes) and `2` (lower lanes)";
                return refuse(item, problem);
            };
            let mut lines: Vec<f64> = of.lane_lines_m.iter().map(|&d| rounded(direction.leftward(d))).collect();
            if direction == Direction::Upper {
                lines.reverse();
            }
            if !of.lane_lines_m.iter().all(|d| in_range(*d))
                || !(2..=LANE_LINES_LIMIT).contains(&lines.len())
                || lines.array_windows().any(|[above, below]| above >= below)
            {
                let problem = "its lane lines are not at least two that fall from left to right by 0.01 m and more";
                return refuse(item, problem);
            }
            lines_y[direction as usize] = lines;
            directions.push(direction);
        }
        if let [Some(last_upper), Some(first_lower)] = [lines_y[0].last(), lines_y[1].first()]
            && last_upper > first_lower
        {
            let problem = "carriageway `1` does not lie above carriageway `2` (y = d for `1`, y = −d for `2`)";
            return refuse(String::new(), problem);
        }
        for track in &recording.tracks {
            if let Some(problem) = track_problem(track, recording) {
                return refuse(format!(", vehicle {}", track.id), problem);
            }
        }
        let lane_numbers = LaneNumbers { lines: [lines_y[0].len(), lines_y[1].len()] };
        Ok(ImageLayout { directions, lines_y, lane_numbers })
    }

    /// `laneId` of a lane; for [`NO_LANE`] a number that reads as no lane, if possible the number of lines above.
    pub(super) fn lane_id(&self, direction: Direction, lane: u16, d_m: f64) -> i64 {
        self.lane_numbers.id_of(direction, lane).unwrap_or_else(|| {
            let y = direction.leftward(d_m);
            let above = self.lines_y.iter().flatten().filter(|&&line| line < y).count() as i64;
            let is_none = self.lane_numbers.lane_of(direction, above + 1) == NO_LANE;
            if is_none { above + 1 } else { 0 }
        })
    }
}

fn in_range(value: f64) -> bool {
    // Half of the maximum, so that a position plus half a length stays valid; false for NaN.
    value.abs() <= 0.5 * REAL_LIMIT
}

fn problem(recording: &Recording) -> Option<&'static str> {
    let Recording { id, frame_rate_hz, carriageways, tracks, .. } = recording;
    let is_no_name = id.is_empty() || id.starts_with('.') || id.contains(['/', '\\', '\0']);
    let is_unsorted = tracks.array_windows().any(|[a, b]| a.id >= b.id);
    first_of([
        (is_no_name, "its name cannot begin a file name"),
        (!FRAME_RATES_HZ.contains(frame_rate_hz), "its frame rate is not between 0.1 and 10000 Hz"),
        (carriageways.is_empty() || tracks.is_empty(), "it has no carriageway or no vehicle"),
        (is_unsorted, "its vehicles are not sorted by id, or two have the same"),
    ])
}

/// Returns the first problem whose condition holds.
fn first_of<const N: usize>(problems: [(bool, &'static str); N]) -> Option<&'static str> {
    problems.into_iter().find(|(is_there, _)| *is_there).map(|(_, problem)| problem)
}

fn track_problem(track: &Track, recording: &Recording) -> Option<&'static str> {
    let series = [&track.s_m, &track.d_m, &track.v_s_mps, &track.v_d_mps, &track.a_s_mps2];
    let size_is_good = |size: f64| in_range(size) && rounded(size) > 0.0;
    let is_uneven = series.iter().any(|series| series.len() != track.len()) || track.lane.len() != track.len();
    let is_off_range = series.iter().any(|series| series.iter().any(|&value| !in_range(value)));
    first_of([
        (track.carriageway >= recording.carriageways.len(), "it drives on a carriageway that does not exist"),
        (!size_is_good(track.length_m) || !size_is_good(track.width_m), "its size is not above zero"),
        (track.is_empty() || is_uneven, "its series are empty or of different lengths"),
        (is_off_range, "a value is not finite or out of range"),
        (!(-FRAME_LIMIT..=FRAME_LIMIT).contains(&track.first_frame), "its first frame is out of range"),
    ])
}
