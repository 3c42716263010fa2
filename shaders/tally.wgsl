// Entry point of the counting: one invocation counts the lanes of one sample. Twin of `count` in
// src/engine/counting/sample_tally.rs. Integer atomics only, so that the order of the samples has no effect.

struct Tally {
    // Samples of this job.
    samples: u32,
    // The first of them among the drawn ones.
    first_drawn: u32,
    // Verdict words of each model.
    words: u32,
}

@group(0) @binding(0) var<uniform> tally: Tally;
@group(0) @binding(1) var<storage, read> drawn: array<DrawnRecord>;
@group(0) @binding(2) var<storage, read> verdicts: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;

const WORKGROUP: u32 = 64u;

override tally_headways: u32;
override tally_models: u32;
// Groups of kernels; 0 if points do not come from kernels.
override tally_groups: u32;

const CRITERIA: u32 = 3u;
const LANES_PER_WORD: u32 = 8u;
const CAPPED: u32 = 8u;

// Places of the counts, as in src/engine/counting/layout.rs.
const VOIDS: u32 = 0u;
const TRIES: u32 = 1u;
const FAILURES: u32 = 2u;

// Counts that a workgroup gathers before it adds them to those of the device.
const GATHERED: u32 = 1024u;
var<workgroup> gathered: array<atomic<u32>, GATHERED>;

fn squares() -> u32 {
    return FAILURES + tally_headways * tally_models * CRITERIA;
}

fn capped() -> u32 {
    return squares() + tally_models * CRITERIA;
}

fn kernel_samples() -> u32 {
    return capped() + tally_headways * tally_models;
}

fn kernel_failures() -> u32 {
    return kernel_samples() + tally_groups;
}

@compute @workgroup_size(WORKGROUP)
fn count_samples(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) inside: u32,
) {
    let at = (group.y * groups.x + group.x) * WORKGROUP + inside;
    if at < tally.samples {
        count(at);
    }
    workgroupBarrier();
    for (var k = 0u; k < GATHERED / WORKGROUP; k++) {
        let place = k * WORKGROUP + inside;
        let number = atomicLoad(&gathered[place]);
        if number != 0u {
            atomicAdd(&counts[place], number);
        }
    }
}

// Verdict bits of a lane.
fn verdict(sample: u32, headway: u32, model: u32) -> u32 {
    let lane = sample * tally_headways + headway;
    return (verdicts[model * tally.words + lane / LANES_PER_WORD] >> (4u * (lane % LANES_PER_WORD))) & 0xfu;
}

// Counts the lanes of one sample.
fn count(sample: u32) {
    let point = drawn[tally.first_drawn + sample];
    if point.tries > ATTEMPTS {
        atomicAdd(&gathered[VOIDS], 1u);
        atomicAdd(&gathered[TRIES], ATTEMPTS);
        return;
    }
    atomicAdd(&gathered[TRIES], point.tries);
    for (var model = 0u; model < tally_models; model++) {
        var failed = vec3<u32>(0u, 0u, 0u);
        for (var headway = 0u; headway < tally_headways; headway++) {
            let bits = verdict(sample, headway, model);
            if bits != 0u {
                let lane = headway * tally_models + model;
                if (bits & CAPPED) != 0u {
                    atomicAdd(&gathered[capped() + lane], 1u);
                }
                failed.x = failed.x + count_failure(point, lane, bits, 0u);
                failed.y = failed.y + count_failure(point, lane, bits, 1u);
                failed.z = failed.z + count_failure(point, lane, bits, 2u);
            }
        }
        count_square(model * CRITERIA, failed.x);
        count_square(model * CRITERIA + 1u, failed.y);
        count_square(model * CRITERIA + 2u, failed.z);
    }
    if tally_groups > 0u {
        atomicAdd(&counts[kernel_samples() + point.component % tally_groups], 1u);
    }
}

// Counts whether a lane fails a criterion, and returns it.
fn count_failure(point: DrawnRecord, lane: u32, bits: u32, criterion: u32) -> u32 {
    let fails = (bits >> criterion) & 1u;
    if fails != 0u {
        let cell = lane * CRITERIA + criterion;
        atomicAdd(&gathered[FAILURES + cell], 1u);
        if tally_groups > 0u {
            atomicAdd(&counts[kernel_failures() + cell * tally_groups + point.component % tally_groups], 1u);
        }
    }
    return fails;
}

fn count_square(place: u32, failed: u32) {
    if failed != 0u {
        atomicAdd(&gathered[squares() + place], failed * failed);
    }
}
