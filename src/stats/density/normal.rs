//! The standard normal distribution in f64 through `libm` alone, so that draws have the same bits everywhere.

use crate::stats::random::Stream;

/// Density at `x`.
pub fn normal_density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt()
}

/// Cumulative probability at `x`, also far in the tails.
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)
}

/// Quantile of `p`, to about 1e-15 relative; algorithm AS 241.
pub fn normal_quantile(p: f64) -> f64 {
    super::standard_normal::quantile(p)
}

/// Random numbers of one index of a stream, two 32-bit words each.
pub(crate) struct Draws {
    stream: Stream,
    index: u64,
    block: u32,
    words: [u32; 4],
    used: usize,
}

impl Draws {
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

    /// In the open interval (0, 1).
    pub fn uniform(&mut self) -> f64 {
        ((self.word64() >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    /// An integer in 0..n, each equally likely up to n/2⁶⁴.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.word64()) * n as u128) >> 64) as usize
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        normal_quantile(self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_inverts_the_cumulative_probability() {
        for k in 1..4000 {
            let x = -8.0 + 0.002 * f64::from(k);
            let p = normal_cdf(x);
            // The slope of the quantile magnifies the rounding of p.
            let rounding = 4.0 * f64::EPSILON * p / normal_density(x);
            assert!((normal_quantile(p) - x).abs() < 1e-14 * (1.0 + x.abs()) + rounding, "{x}");
        }
        assert_eq!(normal_quantile(0.5), 0.0);
        assert!((normal_quantile(0.975) - 1.959_963_984_540_054).abs() < 1e-14);
        assert!((normal_quantile(1e-300) + 37.047_096_299_361_2).abs() < 1e-12);
    }
}
