//! Philox4x32-10, the counter-based generator of Salmon, Moraes, Dror and Shaw ("Parallel random numbers: as easy
//! as 1, 2, 3", SC 2011). Integer operations only.

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
/// Increments of the two key words per round: the fractional parts of the golden ratio and of √3, times 2³².
const KEY_STEPS: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;

/// Returns the high and the low word of the 64-bit product.
#[inline]
fn wide_product(a: u32, b: u32) -> [u32; 2] {
    let product = u64::from(a) * u64::from(b);
    [(product >> 32) as u32, product as u32]
}

/// Returns the four random words of a counter under a key.
#[inline]
pub fn philox4x32_10(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    let (mut c, mut k) = (counter, key);
    for _ in 0..ROUNDS {
        let first = wide_product(MULTIPLIERS[0], c[0]);
        let second = wide_product(MULTIPLIERS[1], c[2]);
        c = [second[0] ^ c[1] ^ k[0], second[1], first[0] ^ c[3] ^ k[1], first[1]];
        k = [k[0].wrapping_add(KEY_STEPS[0]), k[1].wrapping_add(KEY_STEPS[1])];
    }
    c
}

/// A stream of independent random words, identified by a seed and a purpose.
///
/// The Philox counter is (low word of the index, high word of the index, block, purpose). The key is the seed (low
/// word, high word).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    /// Seed of the whole run.
    pub seed: u64,
    /// Use of the words. Streams with different purposes are independent.
    pub purpose: u32,
}

impl Stream {
    /// Returns four words of an index; `block` is the number of the group of four.
    #[inline]
    pub fn words(&self, index: u64, block: u32) -> [u32; 4] {
        let key = [self.seed as u32, (self.seed >> 32) as u32];
        philox4x32_10([index as u32, (index >> 32) as u32, block, self.purpose], key)
    }
}

/// One of 0 … `count` − 1; 0 where `count` is 0. The high word of a product: each has probability 1/`count` to within
/// 2⁻³², which is a relative bias of at most `count`/2³².
#[inline]
pub fn choose(word: u32, count: u32) -> u32 {
    wide_product(word, count)[0]
}
