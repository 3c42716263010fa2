// The gate and the record of all criteria. Twin of src/model/criterion/mod.rs and of the record in
// src/engine/lane_step.rs.

const GATE_EGO_WIDTH: u32 = 0u;
const GATE_OVERLAP: u32 = 1u;

override criteria_gate: u32;
// A side contact fails BTN too.
override criteria_any_contact: bool;

// Values of the criteria over the steps so far.
struct Record {
    ttc: TtcMinimum,
    btn: BrakeThreatMaximum,
    // UNBOUNDED if no vehicle was seen.
    min_gap: f32,
    measures: Measures,
}

// Whether TTC and BTN evaluate a vehicle here: its centre is in front, and it is close enough laterally. A `centred`
// vehicle always is.
fn criteria_sees(view: View, across: bool, centred: bool, lateral_position: f32, ego_width: f32) -> bool {
    let near = centred | select(across, abs(lateral_position) <= ego_width, criteria_gate == GATE_EGO_WIDTH);
    return (view.gap + view.half_lengths >= 0.0) & near;
}
