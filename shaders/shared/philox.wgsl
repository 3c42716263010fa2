// Philox4x32-10, as src/random/philox.rs. Pairs of words hold 64 bits with the low word first, except for
// products.

const PHILOX_MULTIPLIER_0: u32 = 0xD2511F53u;
const PHILOX_MULTIPLIER_1: u32 = 0xCD9E8D57u;
const PHILOX_KEY_STEPS: vec2<u32> = vec2<u32>(0x9E3779B9u, 0xBB67AE85u);
const PHILOX_ROUNDS: u32 = 10u;

// High and low word of a product, from products of half-words.
fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let a_low = a & 0xffffu;
    let a_high = a >> 16u;
    let b_low = b & 0xffffu;
    let b_high = b >> 16u;
    let outer = a_low * b_high;
    let inner = a_high * b_low;
    // At most 3·0xffff.
    let carried = ((a_low * b_low) >> 16u) + (outer & 0xffffu) + (inner & 0xffffu);
    return vec2<u32>(a_high * b_high + (outer >> 16u) + (inner >> 16u) + (carried >> 16u), a * b);
}

// Four random words of a counter under a key.
fn philox4x32_10(counter: vec4<u32>, key: vec2<u32>) -> vec4<u32> {
    var c = counter;
    var k = key;
    for (var round = 0u; round < PHILOX_ROUNDS; round++) {
        let first = wide_product(PHILOX_MULTIPLIER_0, c.x);
        let second = wide_product(PHILOX_MULTIPLIER_1, c.z);
        c = vec4<u32>(second.x ^ c.y ^ k.x, second.y, first.x ^ c.w ^ k.y, first.y);
        k = k + PHILOX_KEY_STEPS;
    }
    return c;
}

// Four words of an index of a stream; `block` counts the fours.
fn stream_words(seed: vec2<u32>, purpose: u32, index: vec2<u32>, block: u32) -> vec4<u32> {
    return philox4x32_10(vec4<u32>(index.x, index.y, block, purpose), seed);
}

// One of 0 … count - 1; 0 if `count` is 0.
fn choose(word: u32, count: u32) -> u32 {
    return wide_product(word, count).x;
}
