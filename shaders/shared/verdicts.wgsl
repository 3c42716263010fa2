// Verdict bits of a dispatch. Only integer atomics, so that the order of the lanes has no effect.

// Lanes per verdict word: four bits each.
const LANES_PER_WORD: u32 = 8u;

// Writes a lane's four verdict bits into the word that it shares with seven neighbours.
fn pack_verdicts(launch: Launch, lane: u32, record: OutcomeRecord) {
    let bits = (record.word & 0xfu) << ((lane % LANES_PER_WORD) * 4u);
    if bits != 0u {
        atomicOr(&verdicts[launch.first_word + lane / LANES_PER_WORD], bits);
    }
}
