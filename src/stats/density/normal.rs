//! The standard normal distribution in f64, through `libm` only, so that draws have the same bits on every machine.

use lanesweep_random::Stream;

/// Cumulative probability at `x`, accurate also far in the tails.
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)
}

/// The z with Φ(z) = p, to about 1e-16 relative: −∞ at 0, +∞ at 1, NaN outside [0, 1].
///
/// Wichura, "Algorithm AS 241: The percentage points of the normal distribution", Applied Statistics 37 (1988), PPND16.
pub fn normal_quantile(p: f64) -> f64 {
    let from_middle = p - 0.5;
    if from_middle.abs() <= 0.425 {
        return from_middle * ratio(&CENTRE, 0.180_625 - from_middle * from_middle);
    }
    let tail = if from_middle < 0.0 { p } else { 1.0 - p };
    if tail <= 0.0 {
        return if tail < 0.0 { f64::NAN } else { f64::INFINITY.copysign(from_middle) };
    }
    let r = (-libm::log(tail)).sqrt();
    let z = if r <= 5.0 { ratio(&SHOULDER, r - 1.6) } else { ratio(&TAIL, r - 5.0) };
    z.copysign(from_middle)
}

/// A standard normal number from a random word: the quantile of the midpoint of the word's interval of length 2⁻³².
pub(crate) fn normal(word: u32) -> f64 {
    normal_quantile(uniform(word))
}

/// The midpoint of a word's interval in (0, 1).
pub(crate) fn uniform(word: u32) -> f64 {
    (f64::from(word) + 0.5) / 4_294_967_296.0
}

/// Random numbers of one index of a stream, two 32-bit words each.
pub struct Draws {
    stream: Stream,
    index: u64,
    block: u32,
    words: [u32; 4],
    used: usize,
}

impl Draws {
    /// The words of one index.
    pub fn new(stream: Stream, index: u64) -> Draws {
        Draws { stream, index, block: 0, words: stream.words(index, 0), used: 0 }
    }

    fn word64(&mut self) -> u64 {
        if self.used == 4 {
            self.block += 1;
            self.words = self.stream.words(self.index, self.block);
            self.used = 0;
        }
        let word = u64::from(self.words[self.used]) << 32 | u64::from(self.words[self.used + 1]);
        self.used += 2;
        word
    }

    /// Uniform in the open interval (0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        ((self.word64() >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    /// An integer in 0..n; probabilities are equal up to n/2⁶⁴.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.word64()) * n as u128) >> 64) as usize
    }

    /// Standard normal.
    pub(crate) fn normal(&mut self) -> f64 {
        normal_quantile(self.uniform())
    }
}

// Coefficients of AS 241: numerator and denominator.
const CENTRE: ([f64; 8], [f64; 8]) = (
    [
        3.387_132_872_796_366_6,
        1.331_416_678_917_843_8e2,
        1.971_590_950_306_551_3e3,
        1.373_169_376_550_946e4,
        4.592_195_393_154_987e4,
        6.726_577_092_700_87e4,
        3.343_057_558_358_813e4,
        2.509_080_928_730_122_7e3,
    ],
    [
        1.0,
        4.231_333_070_160_091e1,
        6.871_870_074_920_579e2,
        5.394_196_021_424_751e3,
        2.121_379_430_158_659_7e4,
        3.930_789_580_009_271e4,
        2.872_908_573_572_194_3e4,
        5.226_495_278_852_854e3,
    ],
);
const SHOULDER: ([f64; 8], [f64; 8]) = (
    [
        1.423_437_110_749_683_5,
        4.630_337_846_156_546,
        5.769_497_221_460_691,
        3.647_848_324_763_204_5,
        1.270_458_252_452_368_4,
        2.417_807_251_774_506e-1,
        2.272_384_498_926_918_4e-2,
        7.745_450_142_783_414e-4,
    ],
    [
        1.0,
        2.053_191_626_637_759,
        1.676_384_830_183_803_8,
        6.897_673_349_851e-1,
        1.481_039_764_274_800_8e-1,
        1.519_866_656_361_645_7e-2,
        5.475_938_084_995_345e-4,
        1.050_750_071_644_416_9e-9,
    ],
);
const TAIL: ([f64; 8], [f64; 8]) = (
    [
        6.657_904_643_501_103,
        5.463_784_911_164_114,
        1.784_826_539_917_291_3,
        2.965_605_718_285_048_7e-1,
        2.653_218_952_657_612_4e-2,
        1.242_660_947_388_078_4e-3,
        2.711_555_568_743_487_6e-5,
        2.010_334_399_292_288_1e-7,
    ],
    [
        1.0,
        5.998_322_065_558_88e-1,
        1.369_298_809_227_358e-1,
        1.487_536_129_085_061_5e-2,
        7.868_691_311_456_133e-4,
        1.846_318_317_510_054_8e-5,
        1.421_511_758_316_446e-7,
        2.044_263_103_389_939_8e-15,
    ],
);

fn ratio((above, below): &([f64; 8], [f64; 8]), r: f64) -> f64 {
    let polynomial = |c: &[f64; 8]| c.iter().rev().fold(0.0, |sum, c| sum * r + c);
    polynomial(above) / polynomial(below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_inverts_the_cumulative_probability() {
        for k in 1..4000 {
            let x = -8.0 + 0.002 * f64::from(k);
            let p = normal_cdf(x);
            // The slope of the quantile function amplifies the rounding error of p.
            let density = libm::exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
            let rounding = 4.0 * f64::EPSILON * p / density;
            assert!((normal_quantile(p) - x).abs() < 1e-14 * (1.0 + x.abs()) + rounding, "{x}");
        }
        assert_eq!(normal_quantile(0.5), 0.0);
        assert!((normal_quantile(0.975) - 1.959_963_984_540_054).abs() < 1e-14);
        assert!((normal_quantile(1e-300) + 37.047_096_299_361_2).abs() < 1e-12);
        assert_eq!([0.0, 1.0].map(normal_quantile), [f64::NEG_INFINITY, f64::INFINITY]);
        assert!(normal_quantile(-0.1).is_nan() && normal_quantile(1.1).is_nan());
    }

    #[test]
    fn the_quantile_is_exact_far_in_the_tail() {
        for k in -360..=360 {
            let z = f64::from(k) / 10.0;
            // The lower half only, because near p = 1 the distribution function has no digits left.
            let p = 0.5 * libm::erfc(z.abs() / std::f64::consts::SQRT_2);
            let error = normal_quantile(p) + z.abs();
            assert!(error.abs() <= 1e-13 * z.abs().max(1.0), "z = {z}: {error}");
        }
    }

    #[test]
    fn words_mirrored_in_the_range_give_mirrored_normals() {
        for word in [0, 1, 77, 1 << 20, 1 << 31, u32::MAX] {
            assert!((normal(word) + normal(!word)).abs() < 1e-6, "{word}");
            assert!(normal(word).is_finite());
        }
    }
}
