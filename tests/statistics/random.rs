//! Random words and normal deviates: known answers, errors against another method, distribution.

use lanesweep::stats::density::normal_quantile;
use lanesweep::stats::random::{Stream, choose, normal_table, philox4x32_10, standard_normal};
use sha2::{Digest, Sha256};

/// The deviate in f64 by another method than the table's: Newton's method on Q itself, from the result under test.
fn error(word: u32) -> f64 {
    let found = f64::from(standard_normal(word));
    let tail = if word < 0x8000_0000 { word } else { !word };
    let p = (f64::from(tail) + 0.5) / 4_294_967_296.0;
    let mut z = found.abs();
    for _ in 0..3 {
        let density = libm::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt();
        z += (0.5 * libm::erfc(z / std::f64::consts::SQRT_2) - p) / density;
    }
    let error = (found - if word < 0x8000_0000 { -z } else { z }).abs();
    assert!(error.is_finite(), "{word:08x}");
    error
}

/// The tail words at the ends of all segments, with their neighbours.
fn edges() -> impl Iterator<Item = u32> {
    let segments = (0..32_u32).flat_map(|octave| (0..16_u64).map(move |step| ((16 + step) << 28) >> (octave + 1)));
    segments.flat_map(|odd| (-2..=2).map(move |k| ((odd / 2) as i64 + k).clamp(0, 0x7fff_ffff) as u32))
}

#[test]
fn the_known_answers_of_random123() {
    // From Random123's file of known answers: philox4x32 with 10 rounds.
    let pi = ([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]);
    for ((counter, key), words) in [
        (([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
        (([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
        (pi, [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]),
    ] {
        assert_eq!(philox4x32_10(counter, key), words);
    }
    // Both halves of seed and index count.
    let stream = Stream { seed: 0x5_0000_0002, purpose: 7 };
    assert_eq!(stream.words(0x4_0000_0003, 1), philox4x32_10([3, 4, 1, 7], [2, 5]));
}

#[test]
fn choices_are_in_range_and_even() {
    for count in [1, 2, 3, 7, 1000, u32::MAX] {
        assert_eq!([choose(0, count), choose(u32::MAX, count)], [0, count - 1]);
    }
    assert_eq!(choose(u32::MAX, 0), 0);
    // The words that give k are those in [k·2³²/count, (k + 1)·2³²/count): their number differs by one at most.
    let mut held = [0; 7];
    (0..=u32::MAX).step_by(1 << 12).for_each(|word| held[choose(word, 7) as usize] += 1);
    assert!(held.iter().all(|n| (149_796..=149_797).contains(n)), "{held:?}");
}

#[test]
fn the_table_has_the_same_bits_everywhere_and_leads_to_no_subnormal_number() {
    let table = normal_table();
    let bytes: Vec<u8> = table.iter().flatten().flat_map(|c| c.to_bits().to_le_bytes()).collect();
    let digest: String = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!(digest, "1666aed62e56702623c30fc35cc128d08c4c163567042020963ab2dbf09f5042");
    // x is at least 2⁻²⁴.
    assert!(table.iter().flatten().all(|c| *c == 0.0 || (1e-9..8.0).contains(&c.abs())));
}

#[test]
fn errors_stay_below_a_millionth_and_the_lower_half_mirrors_the_upper() {
    let spread = (0..2_000_000_u32).map(|k| k.wrapping_mul(0x9E37_79B1));
    // The same number of words in every octave, so that the far tail is covered too.
    let in_octave =
        |octave: u32| (0..20_000_u32).map(move |k| (1 << 31 | k.wrapping_mul(0x9E37_79B1) >> 1) >> octave >> 1);
    for word in edges().chain((0..32).flat_map(in_octave)).chain(spread) {
        assert!(error(word) < 1e-6, "{word:08x}");
        assert_eq!(standard_normal(!word).to_bits(), (-standard_normal(word)).to_bits());
    }
    assert!((normal_quantile(0.975) - 1.959_963_984_540_054).abs() < 1e-9);
}

/// `cargo test --release --test library random:: -- --ignored`
#[test]
#[ignore = "sixty-seven million words"]
fn errors_stay_below_a_millionth_on_a_dense_sweep() {
    // Every 64th word, and every word of the outer tail.
    let words = (0..1_u32 << 26).map(|k| 64 * k + (k % 64)).chain(0..1 << 20);
    words.for_each(|word| assert!(error(word) < 1e-6, "{word:08x}"));
}

#[test]
fn a_larger_word_gives_no_smaller_deviate() {
    for word in (0..u32::MAX - 1024).step_by(1021) {
        assert!(standard_normal(word) < standard_normal(word + 1024), "{word:08x}");
    }
}

#[test]
fn deviates_of_random_words_pass_kolmogorov_and_smirnov() {
    let stream = Stream { seed: 157, purpose: 1 };
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
