// Sobol's sequence with nested uniform scrambling, as src/random/sobol.rs. Reads `sobol_table: array<u32>`,
// which the including kernel declares and the host fills with `Sobol::table`.

const SOBOL_DIGITS: u32 = 32u;
const SOBOL_ROW: u32 = 34u;
// Binary digits are processed in chunks of SOBOL_LEVELS; one hash gives the random bits of a chunk.
const SOBOL_LEVELS: u32 = 4u;
const SOBOL_CHUNKS: u32 = 8u;

// Coordinate `dimension` of point `index`, as a fraction of 2^32.
fn sobol_word(dimension: u32, index: u32) -> u32 {
    let seed = dimension * SOBOL_ROW + SOBOL_DIGITS;
    return owen_scramble(sobol_point(dimension, index), vec2<u32>(sobol_table[seed], sobol_table[seed + 1u]));
}

// The coordinate before scrambling.
fn sobol_point(dimension: u32, index: u32) -> u32 {
    var word = 0u;
    for (var bit = 0u; bit < SOBOL_DIGITS; bit++) {
        word = word ^ (sobol_table[dimension * SOBOL_ROW + bit] & (0u - ((index >> bit) & 1u)));
    }
    return word;
}

// Nested uniform scrambling of a word.
fn owen_scramble(word: u32, seed: vec2<u32>) -> u32 {
    var scrambled = 0u;
    for (var chunk = 0u; chunk < SOBOL_CHUNKS; chunk++) {
        // Two shifts, because a shift by 32 does nothing.
        let above = (word >> 1u) >> (31u - SOBOL_LEVELS * chunk);
        let coins = avalanche(avalanche(above + seed.x) ^ (seed.y + chunk * 0x9E3779B9u));
        var node = 1u;
        for (var level = 0u; level < SOBOL_LEVELS; level++) {
            let digit = (word >> (31u - SOBOL_LEVELS * chunk - level)) & 1u;
            scrambled = (scrambled << 1u) | (digit ^ ((coins >> node) & 1u));
            node = 2u * node + digit;
        }
    }
    return scrambled;
}

// A permutation of the words in which every bit depends on every other.
fn avalanche(word: u32) -> u32 {
    var x = word ^ (word >> 16u);
    x = x * 0x7FEB352Du;
    x = x ^ (x >> 15u);
    x = x * 0x846CA68Bu;
    return x ^ (x >> 16u);
}
