//! Sobol's sequence with nested uniform scrambling (Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995).
//! The points fill the unit cube evenly, and each single point is uniformly distributed. A point is computed from its
//! index.
//!
//! Scrambling goes through the binary digits of a coordinate from the highest to the lowest. A random bit, the digit's
//! coin, decides whether the digit is flipped. The coin depends only on the digits above: coordinates that agree in
//! these use the same coin. So scrambling maps elementary intervals to elementary intervals, and a net remains a net.
//!
//! One hash of the digits above gives the coins of four levels, a binary tree of 15 bits. Hashes that permute all 32
//! digits at once (Laine and Karras; Burley, JCGT 2020) are cheaper, but their coins depend on each other from the
//! third level on. The tests find no such dependence in the coins here.
//!
//! Indices are not shuffled: points k·2^m … (k + 1)·2^m − 1 form a net for every k and m.

use std::sync::LazyLock;

use super::directions::POLYNOMIALS;
use super::philox::Stream;
use crate::{Error, Place, Result};

/// Number of available dimensions.
const SOBOL_DIMENSIONS: u32 = 32;
/// Number of available points; indices are smaller.
pub const SOBOL_POINTS: u64 = 1 << 32;
/// Number of words of a dimension in the device's table.
pub const SOBOL_ROW: usize = DIGITS + 2;

/// Binary digits of a coordinate.
const DIGITS: usize = 32;
/// Number of digit levels whose coins come from one hash.
const LEVELS: u32 = 4;
/// Purpose of the Philox stream that gives the seeds of the dimensions.
const SCRAMBLING: u32 = 0x534f_424c;

/// A scrambled sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sobol {
    rows: Vec<[u32; SOBOL_ROW]>,
}

impl Sobol {
    /// The first `dimensions` coordinates of the sequence under a seed.
    ///
    /// # Errors
    /// [`Error::Usage`] for more than `SOBOL_DIMENSIONS`.
    pub fn new(seed: u64, dimensions: u32) -> Result<Sobol> {
        if dimensions > SOBOL_DIMENSIONS {
            return Err(Error::usage(
                Place::item("Sobol points"),
                format!("{dimensions} dimensions are asked for, {SOBOL_DIMENSIONS} there are"),
                "sample fewer parameters, or use independent random points",
            ));
        }
        let stream = Stream { seed, purpose: SCRAMBLING };
        let rows = directions().iter().take(dimensions as usize).enumerate().map(|(dimension, directions)| {
            let mut row = [0; SOBOL_ROW];
            row[..DIGITS].copy_from_slice(directions);
            row[DIGITS..].copy_from_slice(&stream.words(dimension as u64, 0)[..2]);
            row
        });
        Ok(Sobol { rows: rows.collect() })
    }

    /// The table for a device. One row per dimension: the direction words of the index's bits from the lowest to the
    /// highest, then two words that seed the scrambling.
    pub fn table(&self) -> &[[u32; SOBOL_ROW]] {
        &self.rows
    }

    /// Coordinate `dimension` (from 0) of point `index`, as a fraction of 2³². `None` beyond [`SOBOL_POINTS`] or the
    /// requested dimensions.
    #[inline]
    pub fn word(&self, index: u64, dimension: u32) -> Option<u32> {
        let row = self.rows.get(dimension as usize)?;
        Some(sobol_word(row, u32::try_from(index).ok()?))
    }
}

/// The coordinate that a row of the table gives.
#[inline]
fn sobol_word(row: &[u32; SOBOL_ROW], index: u32) -> u32 {
    owen_scramble(sobol_point(row, index), [row[DIGITS], row[DIGITS + 1]])
}

/// Returns the coordinate before scrambling: the bitwise XOR of the direction words of the index's set bits.
#[inline]
fn sobol_point(row: &[u32; SOBOL_ROW], index: u32) -> u32 {
    let mut word = 0;
    for (bit, direction) in row[..DIGITS].iter().enumerate() {
        word ^= direction & 0_u32.wrapping_sub((index >> bit) & 1);
    }
    word
}

/// Nested uniform scrambling of a word.
#[inline]
fn owen_scramble(word: u32, seed: [u32; 2]) -> u32 {
    let mut scrambled = 0;
    for chunk in 0..DIGITS as u32 / LEVELS {
        // Two shifts, because a shift by 32 bits is not possible.
        let above = (word >> 1) >> (31 - LEVELS * chunk);
        let coins =
            avalanche(avalanche(above.wrapping_add(seed[0])) ^ seed[1].wrapping_add(chunk.wrapping_mul(0x9E37_79B9)));
        let mut node = 1;
        for level in 0..LEVELS {
            let digit = (word >> (31 - LEVELS * chunk - level)) & 1;
            scrambled = (scrambled << 1) | (digit ^ ((coins >> node) & 1));
            node = 2 * node + digit;
        }
    }
    scrambled
}

/// A bijective hash of words in which every output bit depends on every input bit: Wellons' `lowbias32`.
#[inline]
fn avalanche(word: u32) -> u32 {
    let mut x = word ^ (word >> 16);
    x = x.wrapping_mul(0x7FEB_352D);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846C_A68B);
    x ^ (x >> 16)
}

/// Direction words of all dimensions, by bit of the index.
fn directions() -> &'static [[u32; DIGITS]] {
    static DIRECTIONS: LazyLock<Vec<[u32; DIGITS]>> = LazyLock::new(|| {
        let van_der_corput = std::array::from_fn(|bit| 1 << (31 - bit));
        std::iter::once(van_der_corput)
            .chain(POLYNOMIALS.iter().map(|polynomial| {
                let s = polynomial.degree;
                let mut v = [0_u32; DIGITS];
                for bit in 0..DIGITS {
                    v[bit] = if bit < s {
                        polynomial.initial[bit] << (31 - bit)
                    } else {
                        // The recurrence of Bratley and Fox, TOMS 14 (1988).
                        (1..s).fold(v[bit - s] ^ (v[bit - s] >> s), |sum, k| {
                            sum ^ (v[bit - k] * ((polynomial.coefficients >> (s - 1 - k)) & 1))
                        })
                    };
                }
                v
            }))
            .collect()
    });
    &DIRECTIONS
}

#[cfg(test)]
mod tests {
    use super::*;
    use sha2::{Digest, Sha256};

    /// The coordinate without scrambling.
    fn plain(index: u32, dimension: usize) -> u32 {
        let mut row = [0; SOBOL_ROW];
        row[..DIGITS].copy_from_slice(&directions()[dimension]);
        sobol_point(&row, index)
    }

    fn unit(word: u32) -> f64 {
        (f64::from(word) + 0.5) / 4_294_967_296.0
    }

    fn words(seed: u64, dimensions: u32, points: u64) -> Vec<Vec<u32>> {
        let sobol = Sobol::new(seed, dimensions).unwrap();
        (0..dimensions).map(|d| (0..points).map(|k| sobol.word(k, d).unwrap()).collect()).collect()
    }

    #[test]
    fn unscrambled_points_are_the_published_ones() {
        // The first points that the program of Joe and Kuo prints, which visits them in Gray code.
        let published = [
            [0.0, 0.0, 0.0],
            [0.5, 0.5, 0.5],
            [0.75, 0.25, 0.25],
            [0.25, 0.75, 0.75],
            [0.375, 0.375, 0.625],
            [0.875, 0.875, 0.125],
            [0.625, 0.125, 0.875],
            [0.125, 0.625, 0.375],
            [0.1875, 0.3125, 0.9375],
            [0.6875, 0.8125, 0.4375],
        ];
        for (k, point) in published.iter().enumerate() {
            let found: [f64; 3] = std::array::from_fn(|d| f64::from(plain((k ^ (k >> 1)) as u32, d)) / 4_294_967_296.0);
            assert_eq!(found, *point, "point {k}");
        }
    }

    #[test]
    fn direction_words_are_those_of_another_implementation() {
        // Digest of what the crate sobol 1.0.2 makes of the same file: 32 dimensions, 32 words each.
        let bytes: Vec<u8> = directions().iter().flatten().flat_map(|word| word.to_le_bytes()).collect();
        let digest: String = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(digest, "974ad69227324e6ef98550540acb8af10d43cb43bc41e2e6be164c5da99471cc");
    }

    #[test]
    fn what_is_not_there_is_refused() {
        assert!(Sobol::new(1, SOBOL_DIMENSIONS + 1).is_err());
        let sobol = Sobol::new(1, 4).unwrap();
        assert_eq!(sobol.word(SOBOL_POINTS, 0), None);
        assert_eq!(sobol.word(0, 4), None);
        assert!(sobol.word(SOBOL_POINTS - 1, 3).is_some());
    }

    #[test]
    fn every_interval_of_every_dimension_holds_one_point_of_every_block() {
        for seed in 0..4 {
            let sobol = Sobol::new(seed, SOBOL_DIMENSIONS).unwrap();
            for (log2, block) in [(1, 5_u64), (4, 3), (8, 0), (12, 77), (12, (1 << 20) - 1)] {
                for dimension in 0..SOBOL_DIMENSIONS {
                    let mut held = vec![0; 1 << log2];
                    for k in 0..1 << log2 {
                        held[(sobol.word((block << log2) + k, dimension).unwrap() >> (32 - log2)) as usize] += 1;
                    }
                    assert!(held.iter().all(|&count| count == 1), "seed {seed}, dimension {dimension}, 2^{log2}");
                }
            }
        }
    }

    #[test]
    fn every_elementary_box_of_every_pair_holds_its_share() {
        let degree = |d: usize| if d == 0 { 1 } else { POLYNOMIALS[d - 1].degree };
        let log2 = 10;
        for seed in 0..4 {
            let words = words(seed, 8, 1 << log2);
            for i in 0..8 {
                for j in 0..i {
                    // The two make a (t, m, 2)-net with this t (Sobol, 1967).
                    let t = degree(i) + degree(j) - 2;
                    let depth = log2 - t;
                    for a in 0..=depth {
                        let b = depth - a;
                        let mut held = vec![0; 1 << depth];
                        for (x, y) in words[i].iter().zip(&words[j]) {
                            let cell = (u64::from(*x) >> (32 - a) << b) | (u64::from(*y) >> (32 - b));
                            held[cell as usize] += 1;
                        }
                        assert!(held.iter().all(|&count| count == 1 << t), "dimensions {j} and {i}, {a} + {b} digits");
                    }
                }
            }
        }
    }

    #[test]
    fn coins_of_the_first_levels_are_independent() {
        // Over seeds of dimensions as they occur: the joint distribution of all coins of three levels.
        let mut held = [0_u32; 128];
        let mut of_next_chunk = [0_u32; 4];
        let n = 1 << 16;
        for seed in 0..n {
            let words = Stream { seed, purpose: SCRAMBLING }.words(0, 0);
            let scramble = |word| owen_scramble(word, [words[0], words[1]]);
            let (mut cell, mut place) = (0, 0);
            for level in 0..3 {
                for above in 0..1_u32 << level {
                    // With 0 below the digits above, the coin shows as it is.
                    let word = (u64::from(above) << (32 - level)) as u32;
                    cell |= ((scramble(word) >> (31 - level)) & 1) << place;
                    place += 1;
                }
            }
            held[cell as usize] += 1;
            // Two coins of the fifth level.
            let fifth = |word| (scramble(word) >> 27) & 1;
            of_next_chunk[(2 * fifth(0x1000_0000) + fifth(0xF000_0000)) as usize] += 1;
        }
        let chi_square = |held: &[u32]| {
            let expected = n as f64 / held.len() as f64;
            held.iter().map(|&count| (f64::from(count) - expected).powi(2) / expected).sum::<f64>()
        };
        // Passed by chance once in ten thousand.
        assert!(chi_square(&held) < 193.0, "{}", chi_square(&held));
        assert!(chi_square(&of_next_chunk) < 21.1, "{}", chi_square(&of_next_chunk));
    }

    #[test]
    fn scrambled_points_are_uniform_over_seeds() {
        // One point, 1000 seeds: mean ½ and variance 1/12 in every dimension, and the mean of a product of two.
        let seeds = 1000;
        let mut sums = [[0.0; 2]; 8];
        let mut product = 0.0;
        for seed in 0..seeds {
            let sobol = Sobol::new(seed, 8).unwrap();
            let point: [f64; 8] = std::array::from_fn(|d| unit(sobol.word(6, d as u32).unwrap()) - 0.5);
            for (sums, x) in sums.iter_mut().zip(point) {
                sums[0] += x / seeds as f64;
                sums[1] += x * x / seeds as f64;
            }
            product += point[0] * point[1] / seeds as f64;
        }
        let n = (seeds as f64).sqrt();
        for [mean, square] in sums {
            assert!(mean.abs() < 4.0 * (1.0 / 12.0_f64).sqrt() / n, "{sums:?}");
            assert!((square - 1.0 / 12.0).abs() < 4.0 * (1.0 / 180.0_f64).sqrt() / n, "{sums:?}");
        }
        assert!(product.abs() < 4.0 / 12.0 / n, "{product}");
    }

    /// Mean over seeds, and root of the mean square error, of the integral of Π(1 + (x_d − ½)/(d + 1)), which is 1.
    fn integral(points: u64, seeds: u64) -> (f64, f64) {
        let (mut mean, mut square) = (0.0, 0.0);
        for seed in 0..seeds {
            let sobol = Sobol::new(seed, 6).unwrap();
            let sobol = &sobol;
            let value = |k| (0..6).map(move |d| 1.0 + (unit(sobol.word(k, d).unwrap()) - 0.5) / f64::from(d + 1));
            let found = (0..points).map(|k| value(k).product::<f64>()).sum::<f64>() / points as f64;
            mean += found / seeds as f64;
            square += (found - 1.0).powi(2) / seeds as f64;
        }
        (mean, square.sqrt())
    }

    #[test]
    fn integrals_are_unbiased_and_their_error_falls_faster_than_that_of_random_points() {
        let (mean, error) = integral(32, 1000);
        assert!((mean - 1.0).abs() < 4.0 * error / 1000.0_f64.sqrt(), "{mean}");
        let errors = [64, 1024, 16384].map(|points| integral(points, 32).1);
        println!("root mean square errors of 2^6, 2^10, 2^14 points: {errors:?}");
        // 1/√n would quarter the error at every step, 1/n divides it by 16.
        assert!(errors[0] / errors[1] > 12.0 && errors[1] / errors[2] > 12.0, "{errors:?}");
    }
}
