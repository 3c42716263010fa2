// Standard normal deviates, as src/random/normal.rs. Reads `normal_table: array<vec4<f32>>`, which the
// including kernel declares and the host fills with `normal_table()`.

const NORMAL_SEGMENT_BITS: u32 = 4u;

// The standard normal deviate whose distribution function is (word + 1/2)/2^32.
fn standard_normal(word: u32) -> f32 {
    let is_lower = word < 0x80000000u;
    let tail = select(~word, word, is_lower);
    let odd = 2u * tail + 1u;
    let octave = countLeadingZeros(odd);
    let rest = (odd << octave) << 1u;
    let segment = (octave << NORMAL_SEGMENT_BITS) | (rest >> (32u - NORMAL_SEGMENT_BITS));
    // An odd integer of 24 bits: the conversion is exact.
    let steps = ~(rest << NORMAL_SEGMENT_BITS) >> 9u;
    let x = f32(2u * steps + 1u) * 0x1p-24f;
    let c = normal_table[segment];
    let z = ((c.w * x + c.z) * x + c.y) * x + c.x;
    return select(z, -z, is_lower);
}
