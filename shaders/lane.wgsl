// Entry point: bindings, and the lane of an invocation. All other functions are pure.
//
// Lanes are ordered by unit, variant, headway: neighbours in a warp share the case and its motion.

@group(0) @binding(0) var<uniform> launch: Launch;
@group(0) @binding(1) var<storage, read> cases: array<LaneCase>;
@group(0) @binding(2) var<storage, read> starts: array<Start>;
@group(0) @binding(3) var<storage, read> speed_table: array<f32>;
@group(0) @binding(4) var<storage, read> lateral_table: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> verdicts: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> outcomes: array<OutcomeRecord>;
@group(0) @binding(7) var<storage, read_write> counts: array<atomic<u32>>;

const WORKGROUP: u32 = 64u;

@compute @workgroup_size(WORKGROUP)
fn lanes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) inside: u32,
) {
    // Two dimensions, because one dimension is limited to 65,535 workgroups.
    let lane = (group.y * groups.x + group.x) * WORKGROUP + inside;
    if lane >= launch.lanes {
        return;
    }
    let at = lane / launch.headways;
    let record = run_lane(cases[launch.first_case + at], starts[lane - at * launch.headways]);
    // The host checks this counter: the device must compute every lane to its end.
    if (record.word >> 8u) != END_NOT_YET {
        atomicAdd(&counts[launch.done_word], 1u);
    }
    if launch.wanted == WANTED_COUNTS {
        count_lane(launch, at % launch.variants, record);
    } else {
        pack_verdicts(launch, lane, record.word);
    }
    if launch.wanted == WANTED_OUTCOMES {
        outcomes[launch.first_outcome + lane] = record;
    }
}
