//! The samples of a vehicle, column by column: a file of gigabytes has to fit in memory, and most of its columns are empty,
//! constant or decimals of a few digits. Every number is returned with the bits that it came with.

use super::raw::{NO_LABEL, RawSample};

/// Columns of a sample.
const COLUMNS: usize = 20;
const LANE: usize = 13;
const LANE_OFFSET: usize = 14;
const OTHER_CLOCK: usize = 15;
const FACTS: usize = 16;
/// Maximum number of decimals of a column of [`Column::Decimals`].
const MAX_DECIMALS: usize = 6;
const POWERS: [f64; MAX_DECIMALS + 1] = [1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6];
/// NaN among decimals.
const NAN: i32 = i32::MIN;

/// Samples of one vehicle, in less memory than a list of [`RawSample`].
#[derive(Debug, Clone, Default)]
pub(super) struct Samples {
    len: usize,
    columns: [Column; COLUMNS],
}

#[derive(Debug, Clone)]
enum Column {
    /// All values are this one.
    Same(f64),
    /// Whole numbers that, divided by this power of ten, give the values.
    Decimals(u8, Vec<i32>),
    Real(Vec<f64>),
}

impl Default for Column {
    fn default() -> Self {
        Column::Same(f64::NAN)
    }
}

impl Samples {
    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len == 0
    }

    pub(super) fn push(&mut self, sample: &RawSample) {
        let len = self.len;
        self.columns.iter_mut().zip(values(sample)).for_each(|(column, value)| column.push(value, len));
        self.len += 1;
    }

    /// Sample `k`, below [`Samples::len`].
    pub(super) fn get(&self, k: usize) -> RawSample {
        of_values(std::array::from_fn(|column| self.columns[column].get(k)))
    }

    /// Frame number or time of sample `k`.
    pub(super) fn at(&self, k: usize) -> f64 {
        self.columns[0].get(k)
    }

    /// Position of sample `k`, m.
    pub(super) fn xy_m(&self, k: usize) -> [f64; 2] {
        [self.columns[1].get(k), self.columns[2].get(k)]
    }

    /// Index of the name of the lane of sample `k`, or `NO_LABEL`.
    pub(super) fn lane(&self, k: usize) -> u32 {
        self.columns[LANE].get(k) as i32 as u32
    }

    /// The time of sample `k` where `at` counts frames, else its frame.
    pub(super) fn other_clock(&self, k: usize) -> f64 {
        self.columns[OTHER_CLOCK].get(k)
    }

    /// One of the facts of sample `k`.
    pub(super) fn fact(&self, fact: usize, k: usize) -> u16 {
        self.columns[FACTS + fact].get(k) as u16
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = RawSample> {
        (0..self.len).map(|k| self.get(k))
    }

    /// All of them.
    pub(super) fn to_vec(&self) -> Vec<RawSample> {
        self.iter().collect()
    }

    /// The times from sample to sample.
    pub(super) fn steps(&self) -> impl Iterator<Item = f64> {
        (1..self.len).map(|k| self.at(k) - self.at(k - 1))
    }

    /// Gives back the memory that no value needs.
    pub(super) fn shrink(&mut self) {
        for column in &mut self.columns {
            match column {
                Column::Same(_) => {}
                Column::Decimals(_, values) => values.shrink_to_fit(),
                Column::Real(values) => values.shrink_to_fit(),
            }
        }
    }
}

impl<'a> FromIterator<&'a RawSample> for Samples {
    fn from_iter<I: IntoIterator<Item = &'a RawSample>>(list: I) -> Self {
        let mut samples = Samples::default();
        list.into_iter().for_each(|sample| samples.push(sample));
        samples.shrink();
        samples
    }
}

fn values(of: &RawSample) -> [f64; COLUMNS] {
    [
        of.at,
        of.xy_m[0],
        of.xy_m[1],
        of.heading[0],
        of.heading[1],
        of.speed_mps,
        of.velocity_mps[0],
        of.velocity_mps[1],
        of.along_mps[0],
        of.along_mps[1],
        of.acceleration_mps2,
        of.acceleration_xy_mps2[0],
        of.acceleration_xy_mps2[1],
        // `NO_LABEL` becomes −1.
        f64::from(of.lane as i32),
        of.lane_offset_m,
        of.other_clock,
        f64::from(of.facts[0]),
        f64::from(of.facts[1]),
        f64::from(of.facts[2]),
        f64::from(of.facts[3]),
    ]
}

/// The inverse of [`values`].
fn of_values(values: [f64; COLUMNS]) -> RawSample {
    let [at, x, y, heading_x, heading_y, speed, vx, vy, forward, leftward, a, ax, ay, lane, offset, clock, facts @ ..] =
        values;
    RawSample {
        at,
        xy_m: [x, y],
        heading: [heading_x, heading_y],
        speed_mps: speed,
        velocity_mps: [vx, vy],
        along_mps: [forward, leftward],
        acceleration_mps2: a,
        acceleration_xy_mps2: [ax, ay],
        lane: lane as i32 as u32,
        lane_offset_m: offset,
        other_clock: clock,
        facts: facts.map(|fact| fact as u16),
    }
}

impl RawSample {
    /// A sample of which the file says nothing.
    pub(super) fn unknown() -> RawSample {
        RawSample { lane: NO_LABEL, ..of_values([f64::NAN; COLUMNS]) }
    }

    /// The sample between two others, by linear interpolation; names and facts are those of the nearer one.
    pub(super) fn between(before: &RawSample, after: &RawSample, part: f64) -> RawSample {
        let (before, after) = (values(before), values(after));
        of_values(std::array::from_fn(|column| {
            let (a, b) = (before[column], after[column]);
            let is_of_nearer = matches!(column, LANE | LANE_OFFSET | FACTS..);
            if part == 0.0 || (is_of_nearer && part < 0.5) {
                a
            } else if part == 1.0 || is_of_nearer {
                b
            } else {
                a + part * (b - a)
            }
        }))
    }
}

fn is_same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

/// The whole number that, divided by a power of ten, has the bits of the value.
fn decimal(value: f64, decimals: usize) -> Option<i32> {
    if value.is_nan() {
        return Some(NAN);
    }
    let whole = (value * POWERS[decimals]).round();
    // Minus zero and numbers of more digits are others.
    (whole.abs() <= f64::from(i32::MAX) && is_same(number(whole as i32, decimals as u8), value)).then_some(whole as i32)
}

fn number(whole: i32, decimals: u8) -> f64 {
    if whole == NAN { f64::NAN } else { f64::from(whole) / POWERS[usize::from(decimals)] }
}

impl Column {
    fn get(&self, k: usize) -> f64 {
        match self {
            Column::Same(value) => *value,
            Column::Decimals(decimals, values) => number(values[k], *decimals),
            Column::Real(values) => values[k],
        }
    }

    /// Appends a value to the `len` ones.
    #[inline]
    fn push(&mut self, value: f64, len: usize) {
        match self {
            Column::Same(same) if len == 0 => *same = value,
            Column::Same(same) if is_same(*same, value) => {}
            Column::Real(values) => values.push(value),
            Column::Decimals(decimals, values) if let Some(whole) = decimal(value, usize::from(*decimals)) => {
                values.push(whole);
            }
            _ => self.widen(value, len),
        }
    }

    /// Appends a value that the column cannot hold as it is.
    #[cold]
    fn widen(&mut self, value: f64, len: usize) {
        let least = if let Column::Decimals(decimals, _) = self { usize::from(*decimals) + 1 } else { 0 };
        let with = |decimals: usize| -> Option<Vec<i32>> {
            let mut values = Vec::with_capacity((len + 1).next_power_of_two());
            match &*self {
                Column::Same(same) => values.resize(len, decimal(*same, decimals)?),
                Column::Decimals(..) | Column::Real(_) => {
                    for k in 0..len {
                        values.push(decimal(self.get(k), decimals)?);
                    }
                }
            }
            values.push(decimal(value, decimals)?);
            Some(values)
        };
        *self = match (least..=MAX_DECIMALS).find_map(|decimals| Some((decimals, with(decimals)?))) {
            Some((decimals, values)) => Column::Decimals(decimals as u8, values),
            None => Column::Real((0..len).map(|k| self.get(k)).chain([value]).collect()),
        };
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sample(value: f64, other: f64, lane: u32) -> RawSample {
        RawSample {
            at: value,
            xy_m: [other, -value],
            heading: [f64::NAN; 2],
            speed_mps: 0.0 * value,
            velocity_mps: [value * other, other],
            along_mps: [7.25; 2],
            acceleration_mps2: if lane == 0 { f64::NAN } else { other },
            acceleration_xy_mps2: [other, value],
            lane,
            lane_offset_m: f64::from(lane),
            other_clock: value / 25.0,
            facts: [lane as u16, 1, 0, u16::MAX],
        }
    }

    proptest! {
        #[test]
        fn every_number_of_a_file_keeps_its_bits(
            wholes in prop::collection::vec((-3_000_000_000i64..3_000_000_000, 0i32..9, any::<f64>(), 0u32..4), 0..60)
        ) {
            let samples: Vec<RawSample> = wholes
                .iter()
                .map(|(whole, decimals, any, lane)| {
                    let other = if lane % 2 == 0 { *whole as f64 / 1000.0 } else { *any };
                    sample(*whole as f64 / 10f64.powi(*decimals), other, if *lane == 3 { NO_LABEL } else { *lane })
                })
                .collect();
            let stored: Samples = samples.iter().collect();
            prop_assert_eq!(stored.len(), samples.len());
            for (stored, sample) in stored.iter().zip(&samples) {
                let bits = |of: &RawSample| values(of).map(|value| if value.is_nan() { 1 } else { value.to_bits() });
                prop_assert_eq!(bits(&stored), bits(sample));
                prop_assert_eq!(stored.lane, sample.lane);
            }
        }
    }

    #[test]
    fn decimals_take_four_bytes_and_equal_values_none() {
        let samples: Vec<RawSample> = (0..1000)
            .map(|k| RawSample { velocity_mps: [30.0; 2], ..sample(f64::from(k) / 25.0, f64::from(k) / 1000.0, 2) })
            .collect();
        let stored: Samples = samples.iter().collect();
        assert!(
            matches!(&stored.columns[0], Column::Decimals(2, _))
                && matches!(&stored.columns[1], Column::Decimals(3, _))
        );
        assert!(matches!(stored.columns[6], Column::Same(30.0)), "{:?}", stored.columns[6]);
    }
}
