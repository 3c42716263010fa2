//! Transformations between highD's image (corner of the box, y down, `laneId` ascending with y) and the internal frame
//! (centre, forward and left, lane 0 leftmost). The reader and the writer use them.

use crate::trajectory::NO_LANE;

/// Half of the image in which a vehicle drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    /// `drivingDirection` 1: the upper lanes, towards −x.
    Upper,
    /// `drivingDirection` 2: the lower lanes, towards +x.
    Lower,
}

impl Direction {
    /// Both, in the order of their numbers.
    pub(super) const BOTH: [Direction; 2] = [Direction::Upper, Direction::Lower];

    /// As `drivingDirection` and as the carriageway's name.
    pub(super) fn name(self) -> &'static str {
        ["1", "2"][self as usize]
    }

    /// Column of `recordingMeta` that holds this half's lane lines.
    pub(super) fn markings_column(self) -> &'static str {
        ["upperLaneMarkings", "lowerLaneMarkings"][self as usize]
    }

    /// +1 where forward is +x.
    fn sign(self) -> f64 {
        [-1.0, 1.0][self as usize]
    }

    /// Forward component of a velocity or acceleration along x.
    pub(super) fn forward(self, along_x: f64) -> f64 {
        self.sign() * along_x
    }

    /// Leftward component of a velocity or acceleration along y; also the lateral position of a lane line.
    pub(super) fn leftward(self, along_y: f64) -> f64 {
        -self.sign() * along_y
    }

    /// Centre along the road from the left edge of the box, m.
    pub(super) fn s_of(self, x: f64, length_m: f64) -> f64 {
        self.forward(x + length_m / 2.0)
    }

    /// Centre across the road from the upper edge of the box, m.
    pub(super) fn d_of(self, y: f64, width_m: f64) -> f64 {
        self.leftward(y + width_m / 2.0)
    }

    /// Left edge of the box, m: the inverse of [`Direction::s_of`] up to rounding.
    pub(super) fn x_of(self, s_m: f64, length_m: f64) -> f64 {
        self.forward(s_m) - length_m / 2.0
    }

    /// Upper edge of the box, m: the inverse of [`Direction::d_of`] up to rounding.
    pub(super) fn y_of(self, d_m: f64, width_m: f64) -> f64 {
        self.leftward(d_m) - width_m / 2.0
    }
}

/// Converts `laneId` (1 + number of lane lines above) for one recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LaneNumbers {
    /// Number of upper lane lines: n bound n − 1 lanes, with the ids 2..=n. Then that of the lower ones; their lanes follow
    /// the median, with the ids upper + 2..=upper + lower.
    pub lines: [usize; 2],
}

impl LaneNumbers {
    /// Lane of the carriageway, 0 leftmost; [`NO_LANE`] where the id is none of its lanes.
    pub(super) fn lane_of(self, direction: Direction, lane_id: i64) -> u16 {
        let lane = match direction {
            // Driving towards −x with y down, the left is the greater y.
            Direction::Upper => (self.lines[0] as i64).saturating_sub(lane_id),
            Direction::Lower => lane_id.saturating_sub(self.lines[0] as i64 + 2),
        };
        let lanes = self.lines[direction as usize].saturating_sub(1) as i64;
        if (0..lanes).contains(&lane) { lane as u16 } else { NO_LANE }
    }

    /// The id of a lane; `None` if the carriageway has no such lane.
    pub(super) fn id_of(self, direction: Direction, lane: u16) -> Option<i64> {
        let lanes = self.lines[direction as usize].saturating_sub(1);
        (usize::from(lane) < lanes).then(|| match direction {
            Direction::Upper => self.lines[0] as i64 - i64::from(lane),
            Direction::Lower => self.lines[0] as i64 + 2 + i64::from(lane),
        })
    }
}
