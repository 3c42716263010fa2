// Exact arithmetic, as src/model/scalar.rs: binary32, rounded to nearest even, in the written order. No fma, no root,
// no transcendental function. `%`, min, max and clamp are not used, because devices differ on them.

const INFINITY_BITS: u32 = 0x7f800000u;
// Represents +∞ until the end of a lane: larger than every number that a lane computes.
const UNBOUNDED: f32 = 0x1.fffffep+127f;

// The larger of two; the second if they are equal.
fn larger(a: f32, b: f32) -> f32 {
    return select(b, a, a > b);
}

// The smaller of two; the second if they are equal.
fn smaller(a: f32, b: f32) -> f32 {
    return select(b, a, a < b);
}

// The bits of a number that may represent +∞.
fn bounded_bits(value: f32) -> u32 {
    return select(bitcast<u32>(value), INFINITY_BITS, value == UNBOUNDED);
}

// Correctly rounded a/b. A device's quotient may have an error of 2.5 units in the last place (Vulkan); the
// remainder, exact in wrapping 32-bit integers, corrects it. Operands are normal, or a is 0; b is never 0. A quotient
// below the normal range becomes 0, above it infinite.
fn exact_div(a: f32, b: f32) -> f32 {
    let a_bits = bitcast<u32>(a);
    let b_bits = bitcast<u32>(b);
    // Mantissas as numbers in [1, 2), so that the guess is in (1/2, 2).
    let guess = bitcast<f32>((a_bits & 0x007fffffu) | 0x3f800000u) / bitcast<f32>((b_bits & 0x007fffffu) | 0x3f800000u);
    return exact_div_from(guess, a_bits, b_bits);
}

// The correction: `guess` is the quotient of the mantissas, at most 3 units in the last place off.
fn exact_div_from(guess: f32, a_bits: u32, b_bits: u32) -> f32 {
    let sign = (a_bits ^ b_bits) & 0x80000000u;
    let a_mantissa = (a_bits & 0x007fffffu) | 0x00800000u;
    let b_mantissa = (b_bits & 0x007fffffu) | 0x00800000u;
    // The integer quotient a·2^shift/b has 24 bits.
    let below_one = a_mantissa < b_mantissa;
    let shift = select(23u, 24u, below_one);
    var quotient = u32(guess * select(8388608.0, 16777216.0, below_one));
    // |remainder| is below 2^28, so its low 32 bits are sufficient; the dividend has 48.
    var remainder = bitcast<i32>((a_mantissa << shift) - quotient * b_mantissa);
    let divisor = bitcast<i32>(b_mantissa);
    for (var k = 0u; k < 4u; k++) {
        let step = select(select(0, 1, remainder >= divisor), -1, remainder < 0);
        quotient = quotient + bitcast<u32>(step);
        remainder = remainder - step * divisor;
    }
    // A quotient of two 24-bit mantissas never lies half-way.
    quotient = quotient + select(0u, 1u, remainder + remainder > divisor);
    let exponent = i32((a_bits >> 23u) & 0xffu) - i32((b_bits >> 23u) & 0xffu) + select(127, 126, below_one);
    let is_zero = ((a_bits & 0x7f800000u) == 0u) | (exponent <= 0);
    // If rounding overflows the mantissa, the addition carries into the exponent.
    let magnitude = (bitcast<u32>(exponent) << 23u) + (quotient - 0x00800000u);
    let is_infinite = (exponent >= 255) | (magnitude >= INFINITY_BITS);
    let bits = select(select(magnitude, INFINITY_BITS, is_infinite), 0u, is_zero);
    return bitcast<f32>(sign | bits);
}
