// Entry point: bindings, and the lanes of an invocation. Other functions read their arguments, constants
// and the launch only; those of shared/verdicts.wgsl also write results.
//
// Lanes are ordered by unit, variant, headway: neighbours in a warp share the case and its motion. The number of steps
// differs greatly between lanes. An invocation whose lane has ended takes the next lane of its workgroup, so that a
// warp does not wait for its longest lane.

@group(0) @binding(0) var<uniform> launch: Launch;
@group(0) @binding(1) var<storage, read> cases: array<LaneCase>;
@group(0) @binding(2) var<storage, read> starts: array<Start>;
@group(0) @binding(3) var<storage, read> speed_table: array<f32>;
@group(0) @binding(4) var<storage, read> lateral_table: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> verdicts: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> outcomes: array<OutcomeRecord>;
@group(0) @binding(7) var<storage, read_write> finished: array<atomic<u32>>;

const WORKGROUP: u32 = 64u;
// Larger than the number of turns of any dispatch.
const MAX_TURNS: u32 = 0x7fffffffu;

// First lane of the workgroup that no invocation has taken.
var<workgroup> next_lane: atomic<u32>;

@compute @workgroup_size(WORKGROUP)
fn lanes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) inside: u32,
) {
    // Two dimensions, because one dimension is limited to 65,535 workgroups.
    let begin = (group.y * groups.x + group.x) * launch.lanes_per_group;
    let end = select(launch.lanes, begin + launch.lanes_per_group, begin + launch.lanes_per_group < launch.lanes);
    if frame_queue {
        if inside == 0u {
            atomicStore(&next_lane, begin + WORKGROUP);
        }
        workgroupBarrier();
    }
    var lane = begin + inside;
    if lane >= end {
        return;
    }
    var at = lane / launch.headways;
    var lane_case = cases[launch.first_case + at * launch.case_step];
    var state = start_lane(lane_case, starts[lane - at * launch.headways]);
    var done = 0u;
    // Each turn is a burst of steps. All lanes of a warp that have ended in it are replaced together.
    for (var turn = 0u; turn < MAX_TURNS; turn++) {
        for (var step = launch.burst_from; step < frame_longest_burst; step++) {
            let moment = observe(state, lane_case);
            state.record = moment.record;
            if moment.ends {
                state = ended(state, moment);
                break;
            }
            state = advance(state, moment, lane_case);
        }
        if frame_skip & (state.end == END_NOT_YET) & (state.index >= state.look_from) {
            state = skip_quiescent(state, lane_case);
        }
        if state.end != END_NOT_YET {
            write_outcome(at, lane, outcome(state, lane_case));
            done = done + 1u;
            if !frame_queue {
                break;
            }
            lane = atomicAdd(&next_lane, 1u);
            if lane >= end {
                break;
            }
            at = lane / launch.headways;
            lane_case = cases[launch.first_case + at * launch.case_step];
            state = start_lane(lane_case, starts[lane - at * launch.headways]);
        }
    }
    // The host checks this counter: the device must compute every lane to its end.
    atomicAdd(&finished[launch.finished_word], done);
}

// Results are in the order of all cases, also those of other dispatches.
fn write_outcome(at: u32, lane: u32, record: OutcomeRecord) {
    let place = launch.first_lane + lane + at * launch.lanes_between;
    pack_verdicts(launch, place, record);
    if frame_values {
        outcomes[launch.first_outcome + place] = record;
    }
}

fn lateral_sample(at: u32) -> vec2<f32> {
    return lateral_table[at];
}
