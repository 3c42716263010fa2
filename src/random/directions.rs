//! Direction numbers of Sobol's sequence: the first dimensions of `new-joe-kuo-6.21201` by Stephen Joe and Frances Y.
//! Kuo ("Constructing Sobol sequences with better two-dimensional projections", SIAM J. Sci. Comput. 30, 2008,
//! 2635-2654), the search criterion D(6). The numbers come under the notice below.

// Copyright (c) 2008, Frances Y. Kuo and Stephen Joe
// All rights reserved.
//
// Redistribution and use in source and binary forms, with or without
// modification, are permitted provided that the following conditions are
// met:
//
//   * Redistributions of source code must retain the above copyright
//     notice, this list of conditions and the following disclaimer.
//
//   * Redistributions in binary form must reproduce the above copyright
//     notice, this list of conditions and the following disclaimer in the
//     documentation and/or other materials provided with the
//     distribution.
//
//   * Neither the names of the copyright holders nor the names of the
//     University of New South Wales and the University of Waikato
//     and its contributors may be used to endorse or promote products
//     derived from this software without specific prior written
//     permission.
//
// THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS ``AS IS'' AND ANY
// EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED TO, THE
// IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR
// PURPOSE ARE DISCLAIMED. IN NO EVENT SHALL THE COPYRIGHT HOLDERS BE
// LIABLE FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR
// CONSEQUENTIAL DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF
// SUBSTITUTE GOODS OR SERVICES; LOSS OF USE, DATA, OR PROFITS; OR
// BUSINESS INTERRUPTION) HOWEVER CAUSED AND ON ANY THEORY OF LIABILITY,
// WHETHER IN CONTRACT, STRICT LIABILITY, OR TORT (INCLUDING NEGLIGENCE
// OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE OF THIS SOFTWARE, EVEN
// IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE.

/// One line of their file: x^s + a₁x^(s−1) + … + a_(s−1)x + 1 over the integers mod 2, and m₁ … m_s.
#[derive(Debug)]
pub(super) struct Polynomial {
    /// s
    pub degree: usize,
    /// a₁ … a_(s−1) as the digits of a binary number.
    pub coefficients: u32,
    /// m₁ … m_s, odd, m_k < 2^k.
    pub initial: &'static [u32],
}

/// Dimensions 2, 3, … of the file; its dimension 1 is van der Corput's sequence and has no polynomial.
pub(super) const POLYNOMIALS: [Polynomial; 31] = [
    Polynomial { degree: 1, coefficients: 0, initial: &[1] },
    Polynomial { degree: 2, coefficients: 1, initial: &[1, 3] },
    Polynomial { degree: 3, coefficients: 1, initial: &[1, 3, 1] },
    Polynomial { degree: 3, coefficients: 2, initial: &[1, 1, 1] },
    Polynomial { degree: 4, coefficients: 1, initial: &[1, 1, 3, 3] },
    Polynomial { degree: 4, coefficients: 4, initial: &[1, 3, 5, 13] },
    Polynomial { degree: 5, coefficients: 2, initial: &[1, 1, 5, 5, 17] },
    Polynomial { degree: 5, coefficients: 4, initial: &[1, 1, 5, 5, 5] },
    Polynomial { degree: 5, coefficients: 7, initial: &[1, 1, 7, 11, 19] },
    Polynomial { degree: 5, coefficients: 11, initial: &[1, 1, 5, 1, 1] },
    Polynomial { degree: 5, coefficients: 13, initial: &[1, 1, 1, 3, 11] },
    Polynomial { degree: 5, coefficients: 14, initial: &[1, 3, 5, 5, 31] },
    Polynomial { degree: 6, coefficients: 1, initial: &[1, 3, 3, 9, 7, 49] },
    Polynomial { degree: 6, coefficients: 13, initial: &[1, 1, 1, 15, 21, 21] },
    Polynomial { degree: 6, coefficients: 16, initial: &[1, 3, 1, 13, 27, 49] },
    Polynomial { degree: 6, coefficients: 19, initial: &[1, 1, 1, 15, 7, 5] },
    Polynomial { degree: 6, coefficients: 22, initial: &[1, 3, 1, 15, 13, 25] },
    Polynomial { degree: 6, coefficients: 25, initial: &[1, 1, 5, 5, 19, 61] },
    Polynomial { degree: 7, coefficients: 1, initial: &[1, 3, 7, 11, 23, 15, 103] },
    Polynomial { degree: 7, coefficients: 4, initial: &[1, 3, 7, 13, 13, 15, 69] },
    Polynomial { degree: 7, coefficients: 7, initial: &[1, 1, 3, 13, 7, 35, 63] },
    Polynomial { degree: 7, coefficients: 8, initial: &[1, 3, 5, 9, 1, 25, 53] },
    Polynomial { degree: 7, coefficients: 14, initial: &[1, 3, 1, 13, 9, 35, 107] },
    Polynomial { degree: 7, coefficients: 19, initial: &[1, 3, 1, 5, 27, 61, 31] },
    Polynomial { degree: 7, coefficients: 21, initial: &[1, 1, 5, 11, 19, 41, 61] },
    Polynomial { degree: 7, coefficients: 28, initial: &[1, 3, 5, 3, 3, 13, 69] },
    Polynomial { degree: 7, coefficients: 31, initial: &[1, 1, 7, 13, 1, 19, 1] },
    Polynomial { degree: 7, coefficients: 32, initial: &[1, 3, 7, 5, 13, 19, 59] },
    Polynomial { degree: 7, coefficients: 37, initial: &[1, 1, 3, 9, 25, 29, 41] },
    Polynomial { degree: 7, coefficients: 41, initial: &[1, 3, 5, 13, 23, 1, 55] },
    Polynomial { degree: 7, coefficients: 42, initial: &[1, 3, 7, 3, 13, 59, 17] },
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Exponent e > 0 with the least x^e = 1 modulo the polynomial.
    fn order(polynomial: &Polynomial) -> u32 {
        let modulus = 1 << polynomial.degree | polynomial.coefficients << 1 | 1;
        let (mut power, mut exponent) = (1, 0);
        loop {
            power <<= 1;
            power ^= if power >> polynomial.degree == 1 { modulus } else { 0 };
            exponent += 1;
            if power == 1 {
                return exponent;
            }
        }
    }

    #[test]
    fn the_polynomials_are_primitive_and_differ_and_the_numbers_are_admissible() {
        let mut seen = BTreeSet::new();
        for p in &POLYNOMIALS {
            assert_eq!(order(p), (1 << p.degree) - 1, "{p:?}");
            assert!(seen.insert((p.degree, p.coefficients)), "{p:?} twice");
            assert_eq!(p.initial.len(), p.degree);
            assert!(p.initial.iter().enumerate().all(|(k, m)| m % 2 == 1 && *m < 2 << k), "{p:?}");
        }
    }
}
