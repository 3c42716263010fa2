// Verdict bits of a dispatch. Only integer atomics, so that the order of the lanes has no effect.

// Lanes per verdict word: four bits each.
const LANES_PER_WORD: u32 = 8u;

// Writes a lane's four verdict bits into the word that it shares with seven neighbours. A contact that a watch marks
// has the bit of the time cap too, which no other contact has.
fn pack_verdicts(launch: Launch, lane: u32, record: OutcomeRecord) {
    let collided = (record.word & 1u) != 0u;
    let is_marked = frame_watched & collided & (abs(record.impact_closing_speed) >= launch.marks_contacts_from);
    let bits = ((record.word & 0xfu) | select(0u, 8u, is_marked)) << ((lane % LANES_PER_WORD) * 4u);
    if bits != 0u {
        atomicOr(&verdicts[launch.first_word + lane / LANES_PER_WORD], bits);
    }
}
