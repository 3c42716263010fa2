//! Bootstrap over scenarios: the headways of one scenario are not independent and stay together. One
//! resample serves all cells of a category, so differences between cells are paired.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::engine::{Confusion, UnitCounts};
use crate::scenario::Category;
use crate::{Error, Place, Result};

/// How scores are made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScoreOptions {
    /// Number of resamples (1000).
    #[schemars(range(min = 20, max = 100_000))]
    pub bootstrap_draws: usize,
    /// Seed of the resamples.
    pub seed: u64,
    /// Coverage of the intervals (0.95).
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub confidence: f64,
    /// Where S fails in fewer scenarios, a claim or a ratio is not judged and F1 has no interval (10).
    #[schemars(range(min = 0, max = 4_294_967_295_u32))]
    pub least_failures: u32,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        ScoreOptions { bootstrap_draws: 1000, seed: 157, confidence: 0.95, least_failures: 10 }
    }
}

impl ScoreOptions {
    /// Checks the ranges; the error names the option.
    pub fn validate(&self) -> Result<()> {
        let bad = |key: &str, problem: String, help: &str| Err(Error::usage(Place::item(key), problem, help));
        // Every draw's counts are kept, about 3 kB each.
        if !(20..=100_000).contains(&self.bootstrap_draws) {
            return bad("score.bootstrap_draws", format!("{} draws", self.bootstrap_draws), "use 20 to 100000");
        }
        if !(self.confidence > 0.0 && self.confidence < 1.0) {
            return bad("score.confidence", format!("{}", self.confidence), "use a number between 0 and 1, like 0.95");
        }
        Ok(())
    }
}

/// An interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BootstrapInterval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Counts of every cell in every resample. A draw depends on the seed, the category and its own number
/// only: not on threads, nor on the other categories.
pub(super) fn bootstrap_draws(
    units: &[UnitCounts],
    width: usize,
    category: Category,
    options: &ScoreOptions,
) -> Vec<Vec<Confusion>> {
    if units.is_empty() {
        return Vec::new();
    }
    // Sums of 32 bits are twice as fast. They are added to the totals before one could overflow.
    let largest = units.iter().flat_map(|unit| &unit.cells).map(Confusion::largest).max().unwrap_or(0);
    let picks_per_sum = (u32::MAX / largest.max(1)) as usize;
    let stream = |draw: usize| ((category as u64) << 32) | draw as u64;
    (0..options.bootstrap_draws)
        .into_par_iter()
        .map(|draw| {
            let mut random = ChaCha8Rng::seed_from_u64(options.seed);
            random.set_stream(stream(draw));
            let mut totals = vec![Confusion::default(); width];
            let mut sums = vec![Confusion::<u32>::default(); width];
            let mut left = units.len();
            while left > 0 {
                let picks = left.min(picks_per_sum);
                sums.fill(Confusion::default());
                for _ in 0..picks {
                    let pick = (u128::from(random.next_u64()) * units.len() as u128) >> 64;
                    let cells = &units[pick as usize].cells;
                    sums.iter_mut().zip(cells).for_each(|(sum, cell)| sum.add(cell));
                }
                totals.iter_mut().zip(&sums).for_each(|(total, sum)| total.add(sum));
                left -= picks;
            }
            totals
        })
        .collect()
}

/// Percentile interval, linear between order statistics; `None` without values.
pub(super) fn interval(mut values: Vec<f64>, confidence: f64) -> Option<BootstrapInterval> {
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        let position = q * (values.len() - 1) as f64;
        let below = position.floor() as usize;
        let above = (below + 1).min(values.len() - 1);
        values[below] + (values[above] - values[below]) * (position - below as f64)
    };
    let tail = (1.0 - confidence) / 2.0;
    Some(BootstrapInterval { low: quantile(tail), high: quantile(1.0 - tail) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units() -> Vec<UnitCounts> {
        let cell = |k: u32| Confusion { tp: k % 4, fn_: k % 3, fp: k % 2, tn: 10 };
        (0..23).map(|k| UnitCounts { unit: u64::from(k), cells: vec![cell(k), cell(k)], capped: vec![] }).collect()
    }

    #[test]
    fn draws_do_not_depend_on_the_number_of_threads() {
        let options = ScoreOptions { bootstrap_draws: 50, ..ScoreOptions::default() };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| bootstrap_draws(&units(), 2, Category::Lvd, &options))
        };
        assert_eq!(with(1), with(2));
    }

    #[test]
    fn a_cell_paired_with_its_equal_never_differs() {
        let draws = bootstrap_draws(&units(), 2, Category::CutIn, &ScoreOptions::default());
        assert!(draws.iter().all(|draw| draw[0] == draw[1]));
    }

    #[test]
    fn the_counts_of_a_draw_pass_2_to_the_32() {
        let cell = Confusion { tp: u32::MAX, fn_: 1 << 31, fp: 3, tn: 0 };
        let units: Vec<_> = (0..5).map(|unit| UnitCounts { unit, cells: vec![cell], capped: vec![] }).collect();
        let all = Confusion { tp: 5 * u64::from(u32::MAX), fn_: 5 << 31, fp: 15, tn: 0 };
        let draws = bootstrap_draws(&units, 1, Category::Lvd, &ScoreOptions::default());
        assert!(draws.iter().all(|draw| draw[0] == all), "every draw has five units");
    }

    #[test]
    fn the_interval_of_the_integers_to_100_leaves_out_the_tails() {
        let interval = interval((0..=100).map(f64::from).collect(), 0.95).unwrap();
        assert!((interval.low - 2.5).abs() < 1e-9 && (interval.high - 97.5).abs() < 1e-9);
    }
}
