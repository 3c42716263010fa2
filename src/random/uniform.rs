//! Converts random words to a uniform number, a uniform choice, or a weighted choice.

use super::philox::wide_product;
use crate::{Error, Place, Result};

/// A uniform number in (0, 1): the middle of one of 2²³ equal parts, so that neither end is reached and the conversion
/// is exact. The lowest nine bits do not count.
#[inline]
pub fn unit_uniform(word: u32) -> f32 {
    (2 * (word >> 9) + 1) as f32 * (1.0 / 16_777_216.0)
}

/// One of 0 … `count` − 1; 0 where `count` is 0. The high word of a product: each has probability 1/`count` to within
/// 2⁻³², which is a relative bias of at most `count`/2³².
#[inline]
pub fn choose(word: u32, count: u32) -> u32 {
    wide_product(word, count)[0]
}

/// Components by their weights in constant time (Walker's alias method; construction after Vose, IEEE Transactions on
/// Software Engineering 17, 1991, but in integers): one word chooses a column, another the column's own component or
/// its alias.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AliasTable {
    columns: Vec<[u32; 2]>,
}

/// The whole of a column, in units of 2⁻³².
const WHOLE: u64 = 1 << 32;
/// Limit for exact sums of quotas in f64.
const MAX_WEIGHTS: usize = 1 << 20;

impl AliasTable {
    /// A table for weights; only their ratios matter. Deterministic: the same weights give the same table.
    ///
    /// Each weight, relative to the sum, is rounded down to a multiple of 2⁻³²/n, for n components; the largest (the
    /// first of equals) takes what is left over, less than 2⁻³². So in the distribution that
    /// [`pick`](AliasTable::pick) samples, with the bias of [`choose`] added, the total variation from the weights is
    /// below (n + 2)·2⁻³². A component of weight 0 is never picked.
    ///
    /// # Errors
    /// [`Error::Usage`] where there is no weight or more than 2²⁰, one is negative or not finite, or their sum is
    /// not positive and finite.
    pub fn new(weights: &[f64]) -> Result<AliasTable> {
        let wrong = |problem: String| {
            Err(Error::usage(Place::item("weights"), problem, "give 1 to 1048576 finite weights, one of them positive"))
        };
        let n = weights.len();
        if n == 0 || n > MAX_WEIGHTS {
            return wrong(format!("there are {n} of them"));
        }
        if let Some(at) = weights.iter().position(|w| !w.is_finite() || *w < 0.0) {
            return wrong(format!("number {} is {}", at + 1, weights[at]));
        }
        let total: f64 = weights.iter().sum();
        if !(total.is_normal() && total > 0.0) {
            return wrong(format!("their sum is {total}"));
        }
        let all = n as u64 * WHOLE;
        let mut quotas: Vec<u64> = weights.iter().map(|w| (w / total * all as f64) as u64).collect();
        let largest = (0..n).rev().max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(0);
        // Rounding in f64 may also put the sum slightly above.
        quotas[largest] = (quotas[largest] + all).saturating_sub(quotas.iter().sum());
        Ok(AliasTable { columns: columns(quotas) })
    }

    /// The table for a device: for every column its threshold, below which the second word selects the column itself,
    /// and its alias.
    pub fn table(&self) -> &[[u32; 2]] {
        &self.columns
    }

    /// Number of components.
    pub fn count(&self) -> u32 {
        self.columns.len() as u32
    }

    /// The component that two independent words select.
    #[inline]
    pub fn pick(&self, word_a: u32, word_b: u32) -> u32 {
        let column = choose(word_a, self.count());
        let [threshold, alias] = self.columns[column as usize];
        if word_b < threshold { column } else { alias }
    }
}

/// Fills columns of 2³² from quotas that sum to as many: small ones are topped up from large ones.
fn columns(mut quotas: Vec<u64>) -> Vec<[u32; 2]> {
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..quotas.len()).partition(|&k| quotas[k] < WHOLE);
    // A full column: its alias is itself, whatever the threshold.
    let mut columns: Vec<[u32; 2]> = (0..quotas.len() as u32).map(|k| [u32::MAX, k]).collect();
    while let (Some(&donor), Some(needy)) = (large.last(), small.pop()) {
        columns[needy] = [quotas[needy] as u32, donor as u32];
        quotas[donor] -= WHOLE - quotas[needy];
        if quotas[donor] < WHOLE {
            large.pop();
            small.push(donor);
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use proptest::prelude::*;

    /// Probability of every component in units of 2⁻³²/n, if columns were chosen without bias.
    fn exact(table: &AliasTable) -> Vec<u64> {
        let mut parts = vec![0; table.table().len()];
        for (column, [threshold, alias]) in table.table().iter().enumerate() {
            parts[column] += u64::from(*threshold);
            parts[*alias as usize] += WHOLE - u64::from(*threshold);
        }
        parts
    }

    #[test]
    fn uniform_numbers_stay_inside_and_keep_order() {
        assert_eq!(unit_uniform(0), 0.5_f32.powi(24));
        assert_eq!(unit_uniform(u32::MAX), 1.0 - 0.5_f32.powi(24));
        assert!((0..u32::MAX - 512).step_by(4099).all(|word| unit_uniform(word) < unit_uniform(word + 512)));
        assert!(
            (0..=u32::MAX)
                .step_by(4099)
                .all(|w| (f64::from(unit_uniform(w)) - f64::from(w) / 2f64.powi(32)).abs() < 1.2e-7)
        );
    }

    #[test]
    fn choices_are_in_range_and_even() {
        for count in [1, 2, 3, 7, 1000, u32::MAX] {
            assert_eq!(choose(0, count), 0);
            assert_eq!(choose(u32::MAX, count), count - 1);
        }
        assert_eq!(choose(u32::MAX, 0), 0);
        // The words that give k are those in [k·2³²/count, (k + 1)·2³²/count): their number differs by one at most.
        let mut held = [0; 7];
        (0..=u32::MAX).step_by(1 << 12).for_each(|word| held[choose(word, 7) as usize] += 1);
        assert!(held.iter().all(|n| (149_796..=149_797).contains(n)), "{held:?}");
    }

    #[test]
    fn a_weight_of_zero_is_never_picked_and_one_component_always() {
        let table = AliasTable::new(&[0.0, 3.0, 0.0, 1.0]).unwrap();
        assert_eq!(exact(&table), [0, 3 * WHOLE, 0, WHOLE]);
        let one = AliasTable::new(&[0.25]).unwrap();
        assert!([0, 1, u32::MAX].iter().all(|&word| one.pick(word, word) == 0));
    }

    #[test]
    fn what_is_no_distribution_is_refused() {
        for weights in [&[][..], &[0.0, 0.0], &[1.0, -1.0], &[f64::NAN], &[f64::INFINITY], &[f64::MAX, f64::MAX]] {
            assert!(AliasTable::new(weights).is_err(), "{weights:?}");
        }
    }

    proptest! {
        #[test]
        fn the_table_holds_every_weight_to_its_rounding(
            weights in prop::collection::vec(prop_oneof![Just(0.0), 1e-12..1.0, 1.0..1e6], 1..200),
        ) {
            prop_assume!(weights.iter().any(|w| *w > 0.0));
            let table = AliasTable::new(&weights).unwrap();
            let total: f64 = weights.iter().sum();
            let all = weights.len() as f64 * WHOLE as f64;
            for (weight, part) in weights.iter().zip(exact(&table)) {
                let off = (part as f64 - weight / total * all).abs();
                prop_assert!(off <= weights.len() as f64 + 1.0, "{off} units of {all}");
                prop_assert!(*weight > 0.0 || part == 0);
            }
        }
    }

    #[test]
    fn picks_come_as_often_as_the_weights_say() {
        let weights = [0.5, 0.0, 7.0, 2.5, 1e-3, 11.0];
        let table = AliasTable::new(&weights).unwrap();
        let stream = Stream { seed: 157, purpose: 2 };
        let n = 1_000_000;
        let mut held = [0_u32; 6];
        for index in 0..n {
            let words = stream.words(index, 0);
            held[table.pick(words[0], words[1]) as usize] += 1;
        }
        let total: f64 = weights.iter().sum();
        for (weight, count) in weights.iter().zip(held) {
            let p = weight / total;
            let deviation = (n as f64 * p * (1.0 - p)).sqrt();
            assert!((f64::from(count) - n as f64 * p).abs() <= 4.5 * deviation, "{held:?}");
        }
    }
}
