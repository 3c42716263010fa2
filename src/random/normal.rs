//! Standard normal deviates from 32-bit words. A table of cubic polynomials approximates the inverse of the normal
//! distribution function. Integer operations select the cubic; it is evaluated in f32.
//!
//! A word w represents the probability (w + ½)/2³². The lower half of the words mirrors the upper half, so the table
//! covers only one tail. A tail word t < 2³¹ has the tail probability m/2³³ with m = 2t + 1; t = 0 is the outermost.
//! The number of leading zeros of m selects the octave. The next four bits after the leading one select the segment,
//! and the remaining bits give the position in the segment. So segments are short where the inverse is steep. The
//! outermost word is at 6.34 standard deviations.
//!
//! The absolute error is below 10⁻⁶ for every word. The cubics contribute at most 1.6·10⁻⁸ and rounding the rest:
//! beyond 4 standard deviations, half a unit in the last place is 2.4·10⁻⁷. The tests below find at most 4.8·10⁻⁷.

use std::sync::LazyLock;

/// Number of bits that select the segment of an octave.
const SEGMENT_BITS: u32 = 4;
/// Octaves of tail probability: 2⁻¹ … 2⁻², 2⁻² … 2⁻³, and so on down to 2⁻³³.
const OCTAVES: usize = 32;
const SEGMENTS: usize = OCTAVES << SEGMENT_BITS;

/// Returns the cubics, in the layout of the device's table.
///
/// The octaves are in order from the centre outwards. Each has 16 segments, in order from its outer end inwards. A row
/// (c₀, c₁, c₂, c₃) gives |z| = c₀ + x(c₁ + x(c₂ + x·c₃)), where x in (0, 1) increases outwards. The table is computed
/// at the first call and has the same bits on every machine.
pub fn normal_table() -> &'static [[f32; 4]] {
    static TABLE: LazyLock<Vec<[f32; 4]>> = LazyLock::new(|| (0..SEGMENTS).map(segment).collect());
    &TABLE
}

/// Returns the standard normal deviate at which the distribution function is (word + ½)/2³².
///
/// The error is below 10⁻⁶. The result is never zero and exactly antisymmetric:
/// `standard_normal(!word) == -standard_normal(word)`. Rounding can make the deviate of the next word smaller by one
/// unit in the last place. In the octave at the centre, eight successive words share one deviate. Words 1024 apart have
/// increasing deviates wherever the tests compare them.
#[inline]
pub fn standard_normal(word: u32) -> f32 {
    let is_lower = word < 0x8000_0000;
    let tail = if is_lower { word } else { !word };
    // An odd number is not zero, so it has at most 31 leading zeros.
    let odd = 2 * tail + 1;
    let octave = odd.leading_zeros();
    // The bits below the leading one.
    let rest = (odd << octave) << 1;
    let segment = (octave << SEGMENT_BITS) | (rest >> (32 - SEGMENT_BITS));
    // x is the distance from the segment's inner end: the middle of one of 2²³ steps. 2·steps + 1 is odd and has at
    // most 24 bits, so its conversion to f32 is exact, x is above 0, and no deviate is zero.
    let steps = !(rest << SEGMENT_BITS) >> 9;
    let x = (2 * steps + 1) as f32 * (1.0 / 16_777_216.0);
    let c = normal_table()[segment as usize];
    let z = ((c[3] * x + c[2]) * x + c[1]) * x + c[0];
    if is_lower { -z } else { z }
}

/// Returns z ≥ 0 with the tail probability Q(z) = `tail`, for 10⁻³⁰⁰ < `tail` ≤ ½. The error is below 10⁻¹⁴·(1 + z).
///
/// It uses Newton's method on ln Q. This function is concave and decreasing, so the iteration converges from every
/// start at or above the solution. The start is there, because Q(z) ≤ ½·exp(−z²/2).
fn inverse_normal_tail(tail: f64) -> f64 {
    const ROOT_TAU: f64 = 2.506_628_274_631_000_7;
    let goal = libm::log(tail);
    let mut z = libm::sqrt(-2.0 * libm::log(2.0 * tail));
    for _ in 0..8 {
        let q = 0.5 * libm::erfc(z * std::f64::consts::FRAC_1_SQRT_2);
        let density = libm::exp(-0.5 * z * z) / ROOT_TAU;
        z += (libm::log(q) - goal) * q / density;
    }
    z
}

/// Returns the cubic of one segment. In f64 it interpolates the inverse at both ends and at two interior points.
/// Neighbouring segments therefore meet, and the error is near the minimum for cubics with fixed ends.
fn segment(at: usize) -> [f32; 4] {
    let (octave, step) = (at >> SEGMENT_BITS, at & ((1 << SEGMENT_BITS) - 1));
    let steps = (1 << SEGMENT_BITS) as f64;
    // Halving a binary floating-point number is exact.
    let unit = (0..octave + 2).fold(1.0, |unit, _| unit * 0.5) / steps;
    let inner = unit * (steps + step as f64 + 1.0);
    // Expanded Chebyshev nodes: ½(1 ∓ (√2 − 1)) between 0 and 1.
    let nodes = [0.0, 1.0 - std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 1.0];
    let values = nodes.map(|x| inverse_normal_tail(inner - unit * x));
    // Newton's divided differences, then powers of x.
    let mut d = values;
    for order in 1..4 {
        for k in (order..4).rev() {
            d[k] = (d[k] - d[k - 1]) / (nodes[k] - nodes[k - order]);
        }
    }
    let mut powers = [d[3], 0.0, 0.0, 0.0];
    for k in (0..3).rev() {
        // powers · (x − node) + d
        for j in (1..4).rev() {
            powers[j] = powers[j - 1] - nodes[k] * powers[j];
        }
        powers[0] = d[k] - nodes[k] * powers[0];
    }
    powers.map(|c| c as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sha2::{Digest, Sha256};

    /// The deviate in f64 by another method than the table's: Newton's method on Q itself, from the result under test.
    fn reference(word: u32, near: f32) -> f64 {
        let tail = if word < 0x8000_0000 { word } else { !word };
        let p = (f64::from(tail) + 0.5) / 4_294_967_296.0;
        let mut z = f64::from(near).abs();
        for _ in 0..3 {
            let density = libm::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt();
            let step = (0.5 * libm::erfc(z / std::f64::consts::SQRT_2) - p) / density;
            z += step;
            if step.abs() < 1e-13 {
                break;
            }
        }
        if word < 0x8000_0000 { -z } else { z }
    }

    fn error(word: u32) -> f64 {
        let z = standard_normal(word);
        (f64::from(z) - reference(word, z)).abs()
    }

    /// The tail words at the ends of all segments, with their neighbours.
    fn edges() -> Vec<u32> {
        let mut edges = Vec::new();
        for octave in 0..32_u32 {
            for step in 0..16_u64 {
                let odd = ((16 + step) << 28) >> (octave + 1);
                let tail = (odd / 2) as i64;
                edges.extend((-2..=2).map(|k| (tail + k).clamp(0, 0x7fff_ffff) as u32));
            }
        }
        edges
    }

    fn largest_error(words: impl Iterator<Item = u32>) -> f64 {
        let (mut largest, mut at, mut count) = (0.0, 0, 0_u64);
        for word in words {
            count += 1;
            let e = error(word);
            assert!(e.is_finite());
            if e > largest {
                (largest, at) = (e, word);
            }
        }
        println!("largest error of {count} words: {largest:.3e} at {at:08x}, z = {}", standard_normal(at));
        largest
    }

    #[test]
    fn the_inverse_has_the_published_quantiles() {
        // Published quantiles, to the last digit of f64.
        for (tail, z) in [
            (0.5, 0.0),
            (0.25, 0.674_489_750_196_081_7),
            (0.025, 1.959_963_984_540_054),
            (0.001, 3.090_232_306_167_813_6),
            (1e-6, 4.753_424_308_822_899),
            (1e-9, 5.997_807_015_007_686_9),
        ] {
            let found = inverse_normal_tail(tail);
            assert!((found - z).abs() < 1e-14 * (1.0 + z), "{tail}: {found}");
        }
        for exponent in 1..=300 {
            let tail = 10.0_f64.powi(-exponent);
            let back = 0.5 * libm::erfc(inverse_normal_tail(tail) / std::f64::consts::SQRT_2);
            assert!((back / tail - 1.0).abs() < 1e-11, "{tail}: {back}");
        }
    }

    #[test]
    fn the_table_has_the_same_bits_everywhere() {
        let bytes: Vec<u8> = normal_table().iter().flatten().flat_map(|c| c.to_bits().to_le_bytes()).collect();
        assert_eq!(bytes.len(), 512 * 16);
        let digest: String = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(digest, "1666aed62e56702623c30fc35cc128d08c4c163567042020963ab2dbf09f5042");
    }

    #[test]
    fn no_coefficient_leads_to_a_subnormal_number() {
        for (at, row) in normal_table().iter().enumerate() {
            assert!(row[0] >= 0.0 && row[1] > 0.0, "{at}: {row:?}");
            // x is at least 2⁻²⁴.
            assert!(row.iter().all(|c| *c == 0.0 || (1e-9..8.0).contains(&c.abs())), "{at}: {row:?}");
        }
    }

    #[test]
    fn errors_stay_below_a_millionth_on_all_edges_and_two_million_words() {
        let spread = (0..2_000_000_u32).map(|k| k.wrapping_mul(0x9E37_79B1));
        // The same number of words in every octave, so that the far tail is covered too.
        let octaves = (0..32_u32).flat_map(|octave| {
            (0..20_000_u32).map(move |k| ((1 << 31) | (k.wrapping_mul(0x9E37_79B1) >> 1)) >> octave >> 1)
        });
        assert!(largest_error(edges().into_iter().chain(octaves).chain(spread)) < 1e-6);
    }

    /// `cargo test --release --lib random::normal -- --ignored --nocapture`
    #[test]
    #[ignore = "sixty-seven million words"]
    fn errors_stay_below_a_millionth_on_a_dense_sweep() {
        assert!(largest_error((0..1_u32 << 26).map(|k| 64 * k + (k % 64))) < 1e-6);
        // Every word of the outer tail.
        assert!(largest_error(0..1 << 20) < 1e-6);
    }

    #[test]
    fn the_lower_half_mirrors_the_upper() {
        for k in 0..1_000_000_u32 {
            let word = k.wrapping_mul(0x9E37_79B1);
            assert_eq!(standard_normal(!word).to_bits(), (-standard_normal(word)).to_bits());
        }
        assert!(standard_normal(0x7fff_ffff) < 0.0 && standard_normal(0x8000_0000) > 0.0);
    }

    #[test]
    fn a_larger_word_gives_no_smaller_deviate() {
        // Neighbouring words: it falls by at most one unit in the last place.
        let fall = |a: u32, b: u32| f64::from(standard_normal(a)) - f64::from(standard_normal(b));
        let mut falls = 0;
        let starts = edges().into_iter().chain((0..20_000).map(|k: u32| k.wrapping_mul(0x9E37_79B1)));
        for start in starts {
            for word in start..start.saturating_add(64).min(u32::MAX - 1) {
                let z = standard_normal(word).abs();
                let unit = f64::from(f32::from_bits(z.to_bits() + 1)) - f64::from(z);
                assert!(fall(word, word + 1) <= unit, "{word:08x}");
                falls += u32::from(fall(word, word + 1) > 0.0);
            }
        }
        println!("{falls} falls by one unit in the last place");
        // Words 1024 apart: it increases strictly.
        for word in (0..u32::MAX - 1024).step_by(1021) {
            assert!(fall(word, word + 1024) < 0.0, "{word:08x}");
        }
    }

    #[test]
    fn deviates_of_evenly_spread_words_have_the_moments_of_the_normal_distribution() {
        let n = 1_u32 << 22;
        let mut sums = [0.0_f64; 4];
        for k in 0..n {
            // The middle of the k-th of n equal parts.
            let z = f64::from(standard_normal((k << 10) | 512));
            for (power, sum) in sums.iter_mut().enumerate() {
                *sum += z.powi(power as i32 + 1);
            }
        }
        let moments = sums.map(|sum| sum / f64::from(n));
        for (found, (wanted, within)) in moments.iter().zip([(0.0, 1e-6), (1.0, 1e-5), (0.0, 2e-4), (3.0, 1e-3)]) {
            assert!((found - wanted).abs() < within, "{moments:?}");
        }
    }

    #[test]
    fn deviates_of_random_words_pass_kolmogorov_and_smirnov() {
        let stream = crate::Stream { seed: 157, purpose: 1 };
        let mut z: Vec<f32> = (0..50_000).flat_map(|k| stream.words(k, 0)).map(standard_normal).collect();
        z.sort_by(f32::total_cmp);
        let n = z.len() as f64;
        let distance = z.iter().enumerate().fold(0.0_f64, |largest, (k, z)| {
            let p = 0.5 * libm::erfc(-f64::from(*z) / std::f64::consts::SQRT_2);
            largest.max((p - k as f64 / n).abs()).max(((k + 1) as f64 / n - p).abs())
        });
        // A correct sample exceeds 1.95/√n with probability 0.001.
        assert!(distance * n.sqrt() < 1.95, "{}", distance * n.sqrt());
    }
}
