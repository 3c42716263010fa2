// Results of a dispatch. Only integer atomics, so that the order of the lanes has no effect.

// Lanes per verdict word: four bits each.
const LANES_PER_WORD: u32 = 8u;
// Words per cell of the counts: lanes, collisions, TTC, BTN, capped, smallest TTC, smallest gap, unused.
const CELL_WORDS: u32 = 8u;

// Writes a lane's four verdict bits into the word that it shares with seven neighbours. A contact that a watch marks
// has the bit of the time cap too, which no other contact has.
fn pack_verdicts(launch: Launch, lane: u32, record: OutcomeRecord) {
    let collided = (record.word & 1u) != 0u;
    let is_marked = collided & (abs(record.impact_closing_speed) >= launch.marks_contacts_from);
    let bits = ((record.word & 0xfu) | select(0u, 8u, is_marked)) << ((lane % LANES_PER_WORD) * 4u);
    if bits != 0u {
        atomicOr(&verdicts[launch.first_word + lane / LANES_PER_WORD], bits);
    }
}

// Failures and smallest values of the lanes of one variant.
fn count_lane(launch: Launch, variant: u32, record: OutcomeRecord) {
    let cell = launch.first_cell_word + variant * CELL_WORDS;
    atomicAdd(&counts[cell], 1u);
    for (var bit = 0u; bit < 4u; bit++) {
        if (record.word & (1u << bit)) != 0u {
            atomicAdd(&counts[cell + 1u + bit], 1u);
        }
    }
    atomicMin(&counts[cell + 5u], ordered(record.min_ttc_bits));
    atomicMin(&counts[cell + 6u], ordered(record.min_gap_bits));
}

// An integer with the same order as the number that has these bits.
fn ordered(bits: u32) -> u32 {
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}
