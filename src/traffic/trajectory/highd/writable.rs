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
        check_frame(recording)?;
        let mut layout = ImageLayout {
            directions: Vec::new(),
            lines_y: [Vec::new(), Vec::new()],
            lane_numbers: LaneNumbers { lines: [0; 2] },
        };
        for carriageway in &recording.carriageways {
            let bad = |problem: &str, help: &str| {
                let item = format!("recording {}, carriageway `{}`", recording.id, carriageway.name);
                Error::input(Place::item(item), format!("{problem}; highD files cannot represent it"), help)
            };
            let direction = Direction::BOTH
                .into_iter()
                .find(|direction| direction.name() == carriageway.name && !layout.directions.contains(direction))
                .filter(|direction| *direction == Direction::Lower || layout.directions.is_empty())
                .ok_or_else(|| {
                    bad("unknown, repeated or out of order", "name them `1` (upper lanes) and `2` (lower lanes)")
                })?;
            let mut lines: Vec<f64> =
                carriageway.lane_lines_m.iter().map(|&d| rounded(direction.leftward(d))).collect();
            if direction == Direction::Upper {
                lines.reverse();
            }
            if !carriageway.lane_lines_m.iter().all(|d| in_range(*d))
                || !(2..=LANE_LINES_LIMIT).contains(&lines.len())
                || lines.array_windows().any(|[above, below]| above >= below)
            {
                return Err(bad(
                    "its lane lines are not at least two values that fall from left to right",
                    "give the lines from left to right, at least a hundredth of a metre apart",
                ));
            }
            layout.lines_y[direction as usize] = lines;
            layout.directions.push(direction);
        }
        if let [Some(last_upper), Some(first_lower)] = [layout.lines_y[0].last(), layout.lines_y[1].first()]
            && last_upper > first_lower
        {
            return Err(Error::input(
                Place::item(format!("recording {}", recording.id)),
                "carriageway `1` does not lie above carriageway `2` (y = d for `1`, y = −d for `2`)",
                "shift one of them sideways",
            ));
        }
        layout.lane_numbers.lines = [0, 1].map(|half| layout.lines_y[half].len());
        check_tracks(recording)?;
        Ok(layout)
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

fn check_frame(recording: &Recording) -> Result<()> {
    let bad = |problem: &str, help: &str| {
        Err(Error::input(Place::item(format!("recording `{}`", recording.id)), problem, help))
    };
    if recording.id.is_empty() || recording.id.starts_with('.') || recording.id.contains(['/', '\\', '\0']) {
        return bad("the name cannot begin a file name", "use a short name such as `01`");
    }
    if !FRAME_RATES_HZ.contains(&recording.frame_rate_hz) {
        return bad("the frame rate is out of range", "use a rate between 0.01 and 10000 frames per second");
    }
    if recording.carriageways.is_empty() || recording.tracks.is_empty() {
        return bad("no carriageway or no vehicle; highD files cannot represent it", "add at least one of each");
    }
    if recording.tracks.array_windows().any(|[a, b]| a.id >= b.id) {
        return bad("the vehicles are not sorted by id, or two have the same", "sort them, each with its own id");
    }
    Ok(())
}

fn check_tracks(recording: &Recording) -> Result<()> {
    for track in &recording.tracks {
        if let Some(problem) = track_problem(track, recording) {
            let place = Place::item(format!("recording {}, vehicle {}", recording.id, track.id));
            let problem = format!("{problem}; highD files cannot represent it");
            return Err(Error::input(place, problem, "correct the recording"));
        }
    }
    Ok(())
}

fn track_problem(track: &Track, recording: &Recording) -> Option<&'static str> {
    let series = [&track.s_m, &track.d_m, &track.v_s_mps, &track.v_d_mps, &track.a_s_mps2];
    let size_is_good = |size: f64| in_range(size) && rounded(size) > 0.0;
    if track.carriageway >= recording.carriageways.len() {
        Some("it drives on a carriageway that does not exist")
    } else if !size_is_good(track.length_m) || !size_is_good(track.width_m) {
        Some("its size is not above zero")
    } else if track.is_empty() || track.lane.len() != track.len() || series.iter().any(|s| s.len() != track.len()) {
        Some("its series are empty or of different lengths")
    } else if !series.iter().all(|series| series.iter().all(|&value| in_range(value))) {
        Some("a value is not finite or out of range")
    } else if !(-FRAME_LIMIT..=FRAME_LIMIT).contains(&track.first_frame) {
        Some("its first frame is out of range")
    } else {
        None
    }
}
