// Uniform numbers, and uniform or weighted choices, as src/random/uniform.rs; needs shared/philox.wgsl. Reads
// `alias_table: array<vec2<u32>>`, which the including kernel declares and the host fills with `AliasTable::table`.
// It may hold several tables in sequence.

// A uniform number in (0, 1): the midpoint of one of 2^23 intervals.
fn unit_uniform(word: u32) -> f32 {
    return f32(2u * (word >> 9u) + 1u) * 0x1p-24f;
}

// One of 0 … count - 1; 0 if `count` is 0.
fn choose(word: u32, count: u32) -> u32 {
    return wide_product(word, count).x;
}

// The component that two words select from the table of `count` columns that begins at column `first`.
fn alias_pick(first: u32, count: u32, word_a: u32, word_b: u32) -> u32 {
    let column = choose(word_a, count);
    let entry = alias_table[first + column];
    return select(entry.y, column, word_b < entry.x);
}
