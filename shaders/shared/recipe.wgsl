// Meaning of a point's numbers: twin of src/engine/generated/recipe.rs. A test compares sizes and offsets.

const MAX_PARAMETERS: u32 = 14u;
const QUANTITIES: u32 = 11u;
const MAX_BOUNDS: u32 = 8u;
const NO_SLOT: u32 = 0xffffffffu;

const TARGET_SPEED: u32 = 0u;
const LATERAL_SPEED: u32 = 1u;
const EGO_SPEED: u32 = 2u;
const TARGET_ACCELERATION: u32 = 3u;
const LEAD_SPEED: u32 = 4u;
const LEAD_ACCELERATION: u32 = 5u;
const LEAD_GAP: u32 = 6u;
const DURATION: u32 = 7u;
const FINAL_SPEED: u32 = 8u;
const MEAN_DECELERATION: u32 = 9u;
const TIME_HEADWAY: u32 = 10u;

const PATH_KINEMATIC: u32 = 0u;
const PATH_SINUSOID: u32 = 1u;
const PATH_REDUCED: u32 = 2u;

const LATERAL_CENTRED: u32 = 0u;
const LATERAL_ENTERING: u32 = 1u;
const LATERAL_LEAVING: u32 = 2u;
const LATERAL_GONE: u32 = 3u;

// What is the same for all samples of a density and decides what the generator does: constants of its pipeline.
override recipe_path: u32;
override recipe_lateral: u32;
// Parameters of a point.
override recipe_dimensions: u32;
// Coefficients of a reduction; else 0.
override recipe_coefficients: u32;
// Instants of a reduced series, at least 2.
override recipe_instants: u32;
// Bounded columns.
override recipe_bounded: u32;
override recipe_pair: bool;
// A reduction has a lateral series.
override recipe_changes_lane: bool;
override recipe_decelerates: bool;
override recipe_unlimited: bool;
// Index of the parameter that gives a quantity, or NO_SLOT.
override slot_target_speed: u32;
override slot_lateral_speed: u32;
override slot_ego_speed: u32;
override slot_target_acceleration: u32;
override slot_lead_speed: u32;
override slot_lead_acceleration: u32;
override slot_lead_gap: u32;
override slot_duration: u32;
override slot_final_speed: u32;
override slot_mean_deceleration: u32;
override slot_time_headway: u32;

fn slot_of(which: u32) -> u32 {
    switch which {
        case TARGET_SPEED: { return slot_target_speed; }
        case LATERAL_SPEED: { return slot_lateral_speed; }
        case EGO_SPEED: { return slot_ego_speed; }
        case TARGET_ACCELERATION: { return slot_target_acceleration; }
        case LEAD_SPEED: { return slot_lead_speed; }
        case LEAD_ACCELERATION: { return slot_lead_acceleration; }
        case LEAD_GAP: { return slot_lead_gap; }
        case DURATION: { return slot_duration; }
        case FINAL_SPEED: { return slot_final_speed; }
        case MEAN_DECELERATION: { return slot_mean_deceleration; }
        case TIME_HEADWAY: { return slot_time_headway; }
        default: { return NO_SLOT; }
    }
}

// Columns of a reduction's vector.
struct ReducedColumns {
    width: u32,
    instants: u32,
    coefficients: u32,
    lateral: u32,
    speed: u32,
    lead_speed: u32,
    ego_speed: u32,
    lead_gap: u32,
    duration: u32,
}

// A column of a reconstruction that makes a draw invalid if it is out of range.
struct ColumnBound {
    column: u32,
    is_distance: u32,
    lower: f32,
    upper: f32,
}

struct Recipe {
    path: u32,
    lateral: u32,
    dimensions: u32,
    pair: u32,
    decelerates: u32,
    unlimited: u32,
    judged: u32,
    step_cap: u32,
    slots: array<u32, QUANTITIES>,
    columns: ReducedColumns,
    lower: array<f32, MAX_PARAMETERS>,
    upper: array<f32, MAX_PARAMETERS>,
    bounded: u32,
    bounds: array<ColumnBound, MAX_BOUNDS>,
    // s
    min_duration: f32,
    // s
    longest_duration: f32,
    // s
    dt: f32,
    // 1/s
    inverse_dt: f32,
    // m
    lane_change: f32,
    // m
    half_lengths: array<f32, 2>,
    // m
    half_widths: array<f32, 2>,
    // m
    principal_length: f32,
    // m
    ego_width: f32,
    // m
    lane_width: f32,
    attention: array<AttentionRule, MODELS>,
}

// The case of a void sample: no vehicle is present, and the ego stands.
fn void_case() -> LaneCase {
    var nobody: LaneOther;
    nobody.half_lengths = recipe.half_lengths[0];
    nobody.half_widths = recipe.half_widths[0];
    var lane: LaneCase;
    lane.others[0] = nobody;
    lane.others[1] = nobody;
    lane.ego_width = recipe.ego_width;
    lane.lane_width = recipe.lane_width;
    return lane;
}
