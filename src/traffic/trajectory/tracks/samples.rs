//! The samples of a vehicle, column by column: a file of gigabytes has to fit in memory, and many of its columns are empty or
//! constant.

/// Numbers of one sample, by column; NaN: not in the file.
pub(super) type Sample = [f64; COLUMNS];

/// Number of columns.
const COLUMNS: usize = 20;
/// Frame number, or time in s.
pub(super) const AT: usize = 0;
/// Position of the reference point, m; y to the left of x.
pub(super) const X: usize = 1;
pub(super) const Y: usize = 2;
/// Direction of the vehicle's front.
pub(super) const HEADING_X: usize = 3;
pub(super) const HEADING_Y: usize = 4;
/// Magnitude of the velocity, m/s.
pub(super) const SPEED: usize = 5;
/// Velocity in the axes of the file, m/s.
pub(super) const X_SPEED: usize = 6;
pub(super) const Y_SPEED: usize = 7;
/// Velocity forward and to the left along the road, m/s.
pub(super) const FORWARD_SPEED: usize = 8;
pub(super) const LEFTWARD_SPEED: usize = 9;
/// Acceleration forward, m/s².
pub(super) const ACCELERATION: usize = 10;
/// Acceleration in the axes of the file, m/s².
pub(super) const X_ACCELERATION: usize = 11;
pub(super) const Y_ACCELERATION: usize = 12;
/// The time, s, where [`AT`] counts frames; the frame where it is a time.
pub(super) const OTHER_CLOCK: usize = 13;
/// Number of the lane's name.
pub(super) const LANE: usize = 14;
/// Distance from the middle of the lane, m.
pub(super) const LANE_OFFSET: usize = 15;
/// Length and width in this row, m.
pub(super) const LENGTH: usize = 16;
pub(super) const WIDTH: usize = 17;
/// Number of the class's name.
pub(super) const CLASS: usize = 18;
/// Sign of the travel along the road.
pub(super) const DIRECTION: usize = 19;

/// A sample of which the file says nothing.
pub(super) const UNKNOWN: Sample = [f64::NAN; COLUMNS];

/// Samples of one vehicle, in less memory than a list of [`Sample`].
#[derive(Debug, Clone, Default)]
pub(super) struct Samples {
    len: usize,
    /// A value for each sample, or one for all.
    columns: [Vec<f64>; COLUMNS],
}

impl Samples {
    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn push(&mut self, sample: &Sample) {
        for (column, &value) in self.columns.iter_mut().zip(sample) {
            match column[..] {
                [same] if same.to_bits() == value.to_bits() || (same.is_nan() && value.is_nan()) => continue,
                [same] => column.resize(self.len, same),
                _ => (),
            }
            column.push(value);
        }
        self.len += 1;
    }

    /// A column of sample `k`; NaN without samples.
    pub(super) fn of(&self, column: usize, k: usize) -> f64 {
        let column = &self.columns[column];
        column.get(k).or(column.first()).copied().unwrap_or(f64::NAN)
    }

    pub(super) fn get(&self, k: usize) -> Sample {
        std::array::from_fn(|column| self.of(column, k))
    }

    /// Position of sample `k`, m.
    pub(super) fn xy_m(&self, k: usize) -> [f64; 2] {
        [self.of(X, k), self.of(Y, k)]
    }

    /// Direction of the front at sample `k`.
    pub(super) fn heading(&self, k: usize) -> [f64; 2] {
        [self.of(HEADING_X, k), self.of(HEADING_Y, k)]
    }

    /// Number of the name of the lane of sample `k`.
    pub(super) fn lane(&self, k: usize) -> Option<u32> {
        number(self.of(LANE, k))
    }

    /// All of them.
    pub(super) fn to_vec(&self) -> Vec<Sample> {
        (0..self.len).map(|k| self.get(k)).collect()
    }

    /// The times from sample to sample.
    pub(super) fn steps(&self) -> impl Iterator<Item = f64> {
        (1..self.len).map(|k| self.of(AT, k) - self.of(AT, k - 1))
    }

    /// The known values of a column; of equal ones that follow one another, the first.
    pub(super) fn changes(&self, column: usize) -> Vec<f64> {
        let mut values: Vec<f64> = self.columns[column].iter().copied().filter(|value| !value.is_nan()).collect();
        values.dedup();
        values
    }

    /// Whether a column has a known value.
    pub(super) fn has(&self, column: usize) -> bool {
        self.columns[column].iter().any(|value| !value.is_nan())
    }

    /// Gives a column without known values this one everywhere.
    pub(super) fn fill(&mut self, column: usize, value: f64) {
        if !self.has(column) {
            self.columns[column] = vec![value];
        }
    }

    /// The name of the class of the first sample.
    pub(super) fn class<'a>(&self, classes: &'a [String]) -> Option<&'a String> {
        classes.get(number(self.of(CLASS, 0))? as usize)
    }

    /// Gives back the memory that no value needs.
    pub(super) fn shrink(&mut self) {
        self.columns.iter_mut().for_each(Vec::shrink_to_fit);
    }
}

impl<'a> FromIterator<&'a Sample> for Samples {
    fn from_iter<I: IntoIterator<Item = &'a Sample>>(list: I) -> Self {
        let mut samples = Samples::default();
        list.into_iter().for_each(|sample| samples.push(sample));
        samples.shrink();
        samples
    }
}

/// The number of a name, as a column has it.
pub(super) fn number(value: f64) -> Option<u32> {
    (!value.is_nan()).then_some(value as u32)
}

/// The sample between two others, by linear interpolation; names, sizes and offsets in the lane are those of the nearer one.
pub(super) fn between(before: &Sample, after: &Sample, part: f64) -> Sample {
    std::array::from_fn(|column| {
        let (a, b) = (before[column], after[column]);
        // Lanes and classes have no value between two.
        let part = if column >= LANE { part.round() } else { part };
        match part {
            0.0 => a,
            1.0 => b,
            part => a + part * (b - a),
        }
    })
}
