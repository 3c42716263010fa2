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
