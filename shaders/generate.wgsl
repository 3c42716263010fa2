// Entry point of the generator: one invocation makes the case of one sample, with the instants of its series, for all
// later lanes of that sample.

struct Generation {
    // First sample index of this dispatch.
    index_low: u32,
    index_high: u32,
    // Samples of this dispatch.
    count: u32,
    seed_low: u32,
    seed_high: u32,
    purpose: u32,
    // Components of the mixture, or number of given points.
    components: u32,
    // Offsets in `numbers`; the basis of a reduction begins at 0.
    first_mean: u32,
    first_deviation: u32,
    // Entries of each sample in the table of instants.
    stride: u32,
}

@group(0) @binding(0) var<uniform> generation: Generation;
@group(0) @binding(1) var<storage, read> recipe: Recipe;
@group(0) @binding(2) var<storage, read> numbers: array<u32>;
@group(0) @binding(3) var<storage, read> normal_table: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> cases: array<LaneCase>;
@group(0) @binding(5) var<storage, read_write> speed_table: array<f32>;
@group(0) @binding(6) var<storage, read_write> drawn_records: array<DrawnRecord>;

const WORKGROUP: u32 = 64u;

@compute @workgroup_size(WORKGROUP)
fn generate(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) inside: u32,
) {
    let at = (group.y * groups.x + group.x) * WORKGROUP + inside;
    if at >= generation.count {
        return;
    }
    let low = generation.index_low + at;
    let index = vec2<u32>(low, generation.index_high + select(0u, 1u, low < at));
    let drawn = draw_point(index);
    if drawn.tries > ATTEMPTS {
        cases[at] = void_case();
        drawn_records[at] = DrawnRecord(drawn.tries, 0u);
    } else {
        drawn_records[at] = DrawnRecord(drawn.tries, drawn.component);
        cases[at] = decode_case(drawn.values, at * generation.stride);
    }
}

// A sample has no such table.
fn lateral_sample(at: u32) -> vec2<f32> {
    return vec2<f32>(0.0, 0.0);
}
