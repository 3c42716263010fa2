//! `exact_div` of `shaders/shared/exact.wgsl` gives the correctly rounded quotient, whatever the device's own one is
//! worth: compared with the quotient of Rust, which IEEE 754 defines, on the software Vulkan.
//!
//! Its domain: normal operands of either sign, and zero numerators; a quotient below 2⁻¹²⁶ becomes 0 with its sign, one that
//! overflows is infinite. A subnormal numerator counts as 0; what other operands give means nothing, and no lane asks.

use crate::device::kernel::{Kernel, Path, WORKGROUP};
use bytemuck::{Pod, Zeroable};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

const EXACT: &str = include_str!("../../shaders/shared/exact.wgsl");
const KERNEL: &str = "
struct Question {
    a_bits: u32,
    b_bits: u32,
    guesses: array<u32, 7>,
}

@group(0) @binding(1) var<storage, read> questions: array<Question>;
// The quotient from the device's own guess, then one from each guess of the host.
@group(0) @binding(0) var<storage, read_write> answers: array<array<u32, 8>>;

@compute @workgroup_size(64)
fn lanes(@builtin(global_invocation_id) id: vec3<u32>) {
    let a_bits = questions[id.x].a_bits;
    let b_bits = questions[id.x].b_bits;
    answers[id.x][0] = bitcast<u32>(exact_div(bitcast<f32>(a_bits), bitcast<f32>(b_bits)));
    for (var k = 0u; k < 7u; k++) {
        let guess = bitcast<f32>(questions[id.x].guesses[k]);
        answers[id.x][k + 1u] = bitcast<u32>(exact_div_from(guess, a_bits, b_bits));
    }
}
";
const BATCH: usize = 1 << 18;
const MANTISSA: u32 = 0x007f_ffff;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Question {
    a_bits: u32,
    b_bits: u32,
    guesses: [u32; 7],
}

/// Pairs to divide, the same in every run.
struct Pairs(ChaCha8Rng);

impl Pairs {
    fn new() -> Pairs {
        Pairs(ChaCha8Rng::seed_from_u64(157))
    }

    fn below(&mut self, below: u32) -> u32 {
        ((u64::from(self.0.next_u32()) * u64::from(below)) >> 32) as u32
    }

    fn question(&mut self) -> Question {
        let (a_mantissa, b_mantissa) = self.mantissas();
        let (a_exponent, b_exponent) = self.exponents();
        let signs = self.0.next_u32();
        let mut a_bits = (signs & 0x8000_0000) | (a_exponent << 23) | (a_mantissa & MANTISSA);
        let b_bits = ((signs << 1) & 0x8000_0000) | (b_exponent << 23) | (b_mantissa & MANTISSA);
        match self.below(256) {
            // Zero and subnormal numerators.
            0 => a_bits &= 0x8000_0000,
            1 => a_bits &= 0x807f_ffff,
            _ => {}
        }
        Question { a_bits, b_bits, guesses: guesses(a_bits, b_bits) }
    }

    fn mantissas(&mut self) -> (u32, u32) {
        let any = |pairs: &mut Pairs| 0x0080_0000 | (pairs.0.next_u32() & MANTISSA);
        match self.below(4) {
            0 => (any(self), any(self)),
            1 => self.mantissas_next_to_a_boundary(),
            2 => {
                // Powers of two, all ones, one bit, and their neighbours.
                let edge = |pairs: &mut Pairs| {
                    let bit = pairs.below(23);
                    let near = [0, MANTISSA, 1 << bit, MANTISSA ^ (1 << bit)][pairs.below(4) as usize];
                    0x0080_0000 | (near.wrapping_add(pairs.below(5)).wrapping_sub(2) & MANTISSA)
                };
                (edge(self), edge(self))
            }
            _ => {
                // Quotients near 1, equal mantissas among them.
                let a = any(self);
                (a, 0x0080_0000 | (a.wrapping_add(self.below(9)).wrapping_sub(4) & MANTISSA))
            }
        }
    }

    /// Mantissas whose integer quotient leaves a remainder next to a half of the divisor, where it is rounded one way
    /// or the other, or next to none, where the guess is cut one way or the other.
    fn mantissas_next_to_a_boundary(&mut self) -> (u32, u32) {
        loop {
            // Odd, so that 2 has an inverse.
            let b = 0x0080_0001 | (self.0.next_u32() & MANTISSA);
            let off = self.below(8);
            let mut a = [b / 2 - off, b / 2 + 1 + off, off, b - 1 - off][self.below(4) as usize];
            let shift = 23 + self.below(2);
            // a·2^shift ≡ remainder (mod b)
            for _ in 0..shift {
                a = if a.is_multiple_of(2) { a / 2 } else { (a + b) / 2 };
            }
            // Smaller mantissas are divided with 24 bits more, larger ones with 23.
            let a = if shift == 24 { a } else { a + b };
            if (0x0080_0000..0x0100_0000).contains(&a) {
                return (a, b);
            }
        }
    }

    /// Biased exponents of normal numbers: most quotients normal, some next to the ends of the range.
    fn exponents(&mut self) -> (u32, u32) {
        let difference = match self.below(8) {
            0 => 124 + self.below(8) as i32,
            1 => -130 + self.below(8) as i32,
            _ => -125 + self.below(252) as i32,
        };
        let (lowest, highest) = (1.max(1 - difference), 254.min(254 - difference));
        let b = lowest + self.below((highest - lowest + 1) as u32) as i32;
        ((b + difference) as u32, b as u32)
    }
}

/// The quotient of the mantissas, rounded, and moved by −3 … 3 units in its last place: Vulkan allows 2.5.
fn guesses(a_bits: u32, b_bits: u32) -> [u32; 7] {
    let in_one_to_two = |bits: u32| f32::from_bits((bits & MANTISSA) | 0x3f80_0000);
    let (a, b) = (in_one_to_two(a_bits), in_one_to_two(b_bits));
    let unit = if a < b { 2.0_f64.powi(-24) } else { 2.0_f64.powi(-23) };
    std::array::from_fn(|k| (f64::from(a / b) + (k as f64 - 3.0) * unit) as f32).map(f32::to_bits)
}

/// What [`exact_div`] promises: Rust's quotient, but 0 for what is too small.
fn promised(a_bits: u32, b_bits: u32) -> u32 {
    let (a, b) = (f32::from_bits(a_bits), f32::from_bits(b_bits));
    // In f64 this is never rounded to the bound: quotients of two mantissas of 24 bits lie farther apart.
    let is_small = a.is_subnormal() || (f64::from(a) / f64::from(b)).abs() < f64::from(f32::MIN_POSITIVE);
    if is_small { (a_bits ^ b_bits) & 0x8000_0000 } else { (a / b).to_bits() }
}

#[derive(Debug, Default)]
struct Seen {
    pairs: usize,
    infinite: usize,
    zero: usize,
    /// By way: the device's own guess, then −3 … 3.
    wrong: [usize; 8],
    first: Option<String>,
}

fn compare(divider: &Kernel, batches: usize) -> Seen {
    let mut pairs = Pairs::new();
    let mut seen = Seen::default();
    for _ in 0..batches {
        let questions: Vec<Question> = (0..BATCH).map(|_| pairs.question()).collect();
        let answers = divider.run(&[bytemuck::cast_slice(&questions)], BATCH as u32 / WORKGROUP, 8 * BATCH);
        for (question, answers) in questions.iter().zip(answers.chunks_exact(8)) {
            let expected = promised(question.a_bits, question.b_bits);
            seen.infinite += usize::from(expected & 0x7fff_ffff == f32::INFINITY.to_bits());
            seen.zero += usize::from(expected & 0x7fff_ffff == 0);
            for (way, &answer) in answers.iter().enumerate() {
                if answer != expected {
                    seen.wrong[way] += 1;
                    seen.first.get_or_insert_with(|| {
                        let Question { a_bits, b_bits, .. } = question;
                        format!("{a_bits:08x}/{b_bits:08x}: {answer:08x} for {expected:08x}, way {way}")
                    });
                }
            }
        }
        seen.pairs += BATCH;
    }
    println!("{seen:?}");
    seen
}

fn assert_correct(path: Path, pairs: usize) {
    let Some(divider) = Kernel::new(&format!("{EXACT}{KERNEL}"), 1, path) else { return };
    let seen = compare(&divider, pairs.div_ceil(BATCH));
    assert_eq!(seen.wrong, [0; 8], "{:?}", seen.first);
    // The ends of the range were reached.
    assert!(seen.infinite > seen.pairs / 100 && seen.zero > seen.pairs / 100, "{seen:?}");
}

#[test]
fn the_quotient_is_correctly_rounded_on_the_path_of_the_sweeps_and_as_plain_wgsl() {
    assert_correct(Path::Exact, 1_000_000);
    assert_correct(Path::Plain, 250_000);
}

/// The number of the specification: `cargo test --release --test commands exact_division:: -- --ignored --nocapture`.
#[test]
#[ignore = "a longer run of the same"]
fn twenty_million_quotients_are_correctly_rounded_from_every_guess() {
    assert_correct(Path::Exact, 20_000_000);
}

#[test]
fn a_defect_of_the_correction_is_seen() {
    for (right, wrong) in [
        // Too few steps (three are enough, because the last one rounds), a tie moved, the exponent of quotients below
        // 1, both ends of the range.
        ("k < 4u", "k < 2u"),
        ("remainder + remainder > divisor", "remainder + remainder > divisor + 1"),
        ("select(127, 126, below_one)", "127"),
        ("exponent <= 0", "exponent <= 1"),
        ("(exponent >= 255) | (magnitude >= INFINITY_BITS)", "false"),
    ] {
        assert!(EXACT.contains(right), "{right}");
        let source = format!("{}{KERNEL}", EXACT.replace(right, wrong));
        let Some(divider) = Kernel::new(&source, 1, Path::Exact) else { return };
        let seen = compare(&divider, 1);
        assert!(seen.wrong.iter().sum::<usize>() > 0, "{right} became {wrong}, and nothing was seen");
    }
}
