// The records that host and device share, field by field the `repr(C)` types of the host:
// Motion (src/model/motion.rs), LaneOther and LaneCase (src/engine/lane_case.rs), Start, Launch and
// OutcomeRecord (src/engine/gpu/records.rs). A test compares every size and offset. MODELS comes from the registry.

struct Motion {
    kind: u32,
    speed_offset: u32,
    speed_len: u32,
    lateral_offset: u32,
    lateral_len: u32,
    speed_until: u32,
    lateral_until: u32,
    speed_initial: f32,
    speed_per_step: f32,
    speed_end: f32,
    lateral_initial: f32,
    lateral_per_step: f32,
    lateral_end: f32,
    lateral_towards: f32,
    reserved: array<u32, 2>,
}

struct LaneOther {
    motion: Motion,
    half_lengths: f32,
    half_widths: f32,
    gap_offset: f32,
    present_from: u32,
    present_until: u32,
    attend_from: array<u32, MODELS>,
    used: u32,
    judged: u32,
}

struct LaneCase {
    others: array<LaneOther, 2>,
    ego_speed: f32,
    ego_width: f32,
    lane_width: f32,
    horizon: u32,
    pair: u32,
}

// The headway of a lane: a time headway, s, a gap, m, or the minimum following distance.
struct Start {
    kind: u32,
    value: f32,
}

// One dispatch: the lanes of one model over an interval of cases.
struct Launch {
    // Lanes of this dispatch.
    lanes: u32,
    // Headways per case, at least 1.
    headways: u32,
    // First case in the buffer of cases, and from one to the next.
    first_case: u32,
    case_step: u32,
    // Place of the first lane in the results of this dispatch's model, and lanes of other dispatches between two cases.
    first_lane: u32,
    lanes_between: u32,
    // First word of this dispatch in the verdicts.
    first_word: u32,
    // First record of this dispatch in the outcomes.
    first_outcome: u32,
    // Word with the number of finished lanes of this dispatch.
    finished_word: u32,
    // Lanes of a workgroup, at least WORKGROUP.
    lanes_per_group: u32,
    // A burst begins at this step of the longest one. No compiler knows it, so that none unrolls a burst.
    burst_from: u32,
}

// Result of a finished lane. Infinite minima are bits, because WGSL has no infinite literal.
struct OutcomeRecord {
    // Bits 0–3 verdicts (collision, TTC, BTN, capped), 4–5 contact, 6 vehicle of the contact, 8–10 end.
    word: u32,
    reaction_step: u32,
    end_step: u32,
    impact_speed: f32,
    impact_closing_speed: f32,
    min_ttc_bits: u32,
    btn_numerator: f32,
    btn_denominator: f32,
    min_gap_bits: u32,
    min_thw_bits: u32,
    max_drac_bits: u32,
    tet_steps: u32,
    tit: f32,
    // NO_STEP if there is none.
    pet_bits: u32,
}

// Maximum number of draws of a sample. With more it is void.
const ATTEMPTS: u32 = 64u;

// What is counted of a sample besides its lanes.
struct DrawnRecord {
    // Draws; ATTEMPTS + 1 if all were invalid.
    tries: u32,
    // Component of the mixture.
    component: u32,
}
