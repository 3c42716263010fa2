// Entry point of lanes whose steps are drawn: every invocation runs one lane to its end and writes its outcome; the first
// lane also writes its steps. Twin of src/engine/trace.rs. Only the page of `map` has this pipeline.

// One other vehicle at one step; TTC and BTN whether or not the criteria evaluate it there.
struct TracedVehicle {
    speed: f32,
    gap: f32,
    lateral: f32,
    lateral_gap: f32,
    ttc_bits: u32,
    btn_numerator: f32,
    btn_denominator: f32,
    // Bit 0: present for the ego, bit 1: evaluated.
    seen: u32,
}

struct TracedStep {
    v_ego: f32,
    a_ego: f32,
    is_unsafe: u32,
    others: array<TracedVehicle, 2>,
}

@group(0) @binding(0) var<uniform> launch: Launch;
@group(0) @binding(1) var<storage, read> cases: array<LaneCase>;
@group(0) @binding(2) var<storage, read> starts: array<Start>;
@group(0) @binding(3) var<storage, read> speed_table: array<f32>;
@group(0) @binding(4) var<storage, read> lateral_table: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> steps: array<TracedStep>;
@group(0) @binding(6) var<storage, read_write> outcomes: array<OutcomeRecord>;

const WORKGROUP: u32 = 64u;

@compute @workgroup_size(WORKGROUP)
fn trace(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let lane = invocation.x;
    if lane >= launch.lanes {
        return;
    }
    let at = lane / launch.headways;
    let lane_case = cases[launch.first_case + at * launch.case_step];
    var state = start_lane(lane_case, starts[lane - at * launch.headways]);
    for (var step = 0u; step < frame_step_cap; step++) {
        let moment = observe(state, lane_case);
        if (lane == 0u) & (step < arrayLength(&steps)) {
            let a_ego = (state.v_ego - state.v_before) * frame_inverse_dt;
            let others = array<TracedVehicle, 2>(
                traced(moment.first, state.other_0.lateral.position),
                traced(moment.second, state.other_1.lateral.position),
            );
            steps[step] = TracedStep(state.v_ego, a_ego, select(0u, 1u, moment.is_unsafe), others);
        }
        state.record = moment.record;
        if moment.ends {
            state = ended(state, moment);
            break;
        }
        state = advance(state, moment, lane_case);
    }
    outcomes[launch.first_outcome + lane] = outcome(state, lane_case);
}

fn traced(seen: Seen, lateral: f32) -> TracedVehicle {
    let view = seen.view;
    let ttc = ttc_update(ttc_nothing(), true, view.gap, closing(view));
    let btn = btn_update(btn_nothing(), true, view.gap, closing(view));
    let bits = select(0u, 1u, seen.present) | select(0u, 2u, seen.judged);
    return TracedVehicle(view.v_other, view.gap, lateral, view.lateral_gap, ttc_value_bits(ttc), btn.numerator,
        btn.denominator, bits);
}

fn lateral_sample(at: u32) -> vec2<f32> {
    return lateral_table[at];
}
