// From a random word to a uniform number, one of several things, or one of several weighted things, as
// src/stats/random/uniform.rs; needs shared/philox.wgsl. Reads `alias_table: array<vec2<u32>>`, which whoever includes this
// declares and fills with `AliasTable::table`, several tables one after the other if need be.

// A uniform number in (0, 1), in the middle of one of 2^23 parts.
fn unit_uniform(word: u32) -> f32 {
    return f32(2u * (word >> 9u) + 1u) * 0x1p-24f;
}

// One of 0 … count - 1; 0 where `count` is 0.
fn choose(word: u32, count: u32) -> u32 {
    return wide_product(word, count).x;
}

// The component that two words pick from the table of `count` columns that begins at column `first`.
fn alias_pick(first: u32, count: u32, word_a: u32, word_b: u32) -> u32 {
    let column = choose(word_a, count);
    let entry = alias_table[first + column];
    return select(entry.y, column, word_b < entry.x);
}
