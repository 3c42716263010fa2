//! Sample index → point: equal Gaussian kernels drawn with counter-based random words, or a table of given points. Twin: `shaders/shared/points.wgsl`.

use lanesweep_random::{Stream, choose, standard_normal};

/// Maximum number of parameters of a point.
pub const MAX_PARAMETERS: usize = 14;

/// Maximum number of draws of a sample index. If all are invalid, the sample is void.
pub const ATTEMPTS: u32 = 64;

/// Blocks of four words per draw.
const BLOCKS: u32 = 4;

/// Source of a sample's random words.
#[derive(Debug, Clone, PartialEq)]
pub enum PointSource {
    /// Philox: independent draws; an invalid point is redrawn.
    Random(Stream),
    /// Point `i` is mean `i`.
    Given,
}

/// A sample's point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnPoint {
    /// One value per parameter, then zeros. Undefined if the sample is void.
    pub values: [f32; MAX_PARAMETERS],
    /// Number of draws; [`ATTEMPTS`] + 1 if all were invalid.
    pub tries: u32,
}

impl DrawnPoint {
    /// Whether no draw was valid: the sample has no case.
    pub fn is_void(&self) -> bool {
        self.tries > ATTEMPTS
    }
}

/// How points are drawn, in the number format of every backend.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// Source of random words.
    pub source: PointSource,
    /// Parameters of a point, 1 to [`MAX_PARAMETERS`].
    pub dimensions: usize,
    /// Means, `dimensions` per component.
    pub means: Vec<f32>,
    /// Standard deviation of every component, one per parameter.
    pub deviations: Vec<f32>,
}

impl Points {
    /// Number of components.
    pub fn components(&self) -> u32 {
        (self.means.len() / self.dimensions) as u32
    }

    /// Number of points; `None` if every index has one. A [plan](crate::LanePlan) holds no sample beyond.
    pub(crate) fn count(&self) -> Option<u64> {
        match &self.source {
            PointSource::Random(_) => None,
            PointSource::Given => Some(u64::from(self.components())),
        }
    }

    /// The first valid draw of an index.
    ///
    /// # Panics
    /// For an index beyond [`Points::count`], because no such point exists.
    #[inline]
    pub(crate) fn draw(&self, index: u64, is_valid: impl Fn(&[f32]) -> bool) -> DrawnPoint {
        let attempts = if matches!(self.source, PointSource::Random(_)) { ATTEMPTS } else { 1 };
        for attempt in 0..attempts {
            let values = self.attempt(index, attempt);
            if is_valid(&values[..self.dimensions]) {
                return DrawnPoint { values, tries: attempt + 1 };
            }
        }
        DrawnPoint { values: [0.0; MAX_PARAMETERS], tries: ATTEMPTS + 1 }
    }

    /// Lowest and highest value of a parameter over all draws, valid or not: no normal deviate exceeds that of the last
    /// word.
    pub(crate) fn range(&self, parameter: usize) -> [f64; 2] {
        let d = self.dimensions;
        let largest = f64::from(standard_normal(u32::MAX));
        let spread = match self.source {
            PointSource::Given => 0.0,
            PointSource::Random(_) => largest * f64::from(self.deviations[parameter]),
        };
        let means = self.means.iter().skip(parameter).step_by(d).map(|mean| f64::from(*mean));
        means.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], mean| {
            [low.min(mean - spread), high.max(mean + spread)]
        })
    }

    /// The kernel of draw `tries` (from 1) of an index. `None` for given points.
    pub fn component(&self, index: u64, tries: u32) -> Option<u32> {
        let word = match &self.source {
            PointSource::Random(stream) => stream.words(index, tries.checked_sub(1)? * BLOCKS)[0],
            PointSource::Given => return None,
        };
        Some(choose(word, self.components()))
    }

    /// Draw `attempt` of an index, valid or not. Word 0 selects the component, word 1 is unused, the others are normal
    /// deviates.
    #[inline]
    pub(crate) fn attempt(&self, index: u64, attempt: u32) -> [f32; MAX_PARAMETERS] {
        let d = self.dimensions;
        let mut words = [0_u32; 4 * BLOCKS as usize];
        match &self.source {
            PointSource::Random(stream) => {
                let blocks = (2 + d).div_ceil(4);
                for (block, four) in words.chunks_exact_mut(4).take(blocks).enumerate() {
                    four.copy_from_slice(&stream.words(index, attempt * BLOCKS + block as u32));
                }
            }
            PointSource::Given => {
                let mut values = [0.0; MAX_PARAMETERS];
                let first = index as usize * d;
                values[..d].copy_from_slice(&self.means[first..first + d]);
                return values;
            }
        }
        let mean = &self.means[choose(words[0], self.components()) as usize * d..][..d];
        let mut values = [0.0; MAX_PARAMETERS];
        for j in 0..d {
            values[j] = mean[j] + self.deviations[j] * standard_normal(words[2 + j]);
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(source: PointSource) -> Points {
        Points { source, dimensions: 1, means: vec![1.0, 2.0, 3.0], deviations: vec![1.0] }
    }

    #[test]
    fn every_point_that_is_counted_can_be_drawn() {
        let given = points(PointSource::Given);
        let values = (0..given.count().unwrap()).map(|index| given.draw(index, |_| true).values[0]);
        assert_eq!(values.collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
        assert_eq!(points(PointSource::Random(Stream { seed: 7, purpose: 0 })).count(), None);
    }

    #[test]
    fn no_draw_leaves_the_range_of_its_parameter() {
        let stream = PointSource::Random(Stream { seed: 7, purpose: 0 });
        let points =
            Points { dimensions: 2, means: vec![1.0, -2.0, 3.0, 5.0], deviations: vec![0.5, 2.0], ..points(stream) };
        let ranges = [points.range(0), points.range(1)];
        let largest = f64::from(standard_normal(u32::MAX));
        assert_eq!(ranges, [(1.0, 3.0, 0.5), (-2.0, 5.0, 2.0)].map(|(a, b, by)| [a - by * largest, b + by * largest]));
        for index in 0..20_000 {
            let values = points.attempt(index, 0);
            for (value, [low, high]) in values.iter().zip(ranges) {
                assert!(f64::from(*value) >= low - 1e-5 && f64::from(*value) <= high + 1e-5, "{values:?}");
            }
        }
    }

    #[test]
    #[should_panic(expected = "out of range")]
    fn no_given_point_stands_in_for_one_that_was_not_given() {
        points(PointSource::Given).draw(3, |_| true);
    }
}
