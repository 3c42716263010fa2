// Entry point of the counting: one invocation counts the lanes of one sample. Twin of `count` in
// src/run/sampling/tally.rs. Integer atomics only, so that the order of the samples has no effect.

struct Tally {
    // Samples of this job.
    samples: u32,
    // The first of them among the drawn ones.
    first_drawn: u32,
    // Verdict words of each model.
    words: u32,
    // Samples that the list of those left to the host holds.
    max_left: u32,
    // Bit of each headway below the limit of close following, and of each that the sample draws.
    close_headways: u32,
    drawn_headways: u32,
    // MARKS_… of each model, two bits.
    marks: u32,
}

@group(0) @binding(0) var<uniform> tally: Tally;
@group(0) @binding(1) var<storage, read> drawn: array<DrawnRecord>;
@group(0) @binding(2) var<storage, read> verdicts: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
// Their number, then the samples.
@group(0) @binding(4) var<storage, read_write> left: array<atomic<u32>>;

const WORKGROUP: u32 = 64u;

override tally_headways: u32;
override tally_models: u32;
// Groups of kernels; 0 if points do not come from kernels.
override tally_groups: u32;
// Cells of the map; 0 without one.
override tally_cells: u32;
// Criterion of the map.
override tally_criterion: u32;

const CRITERIA: u32 = 3u;
const LANES_PER_WORD: u32 = 8u;
const CAPPED: u32 = 8u;
// A contact that is marked: collision, and the bit of the time cap.
const MARKED_CONTACT: u32 = 9u;

const MARKS_CONTACTS: u32 = 1u;
const MARKS_TTC: u32 = 2u;
const MARKS_BTN: u32 = 3u;

// Places of the counts, as in src/engine/counting.rs.
const VOIDS: u32 = 0u;
const TRIES: u32 = 1u;
const CLOSE_LANES: u32 = 2u;
const FAILURES: u32 = 3u;

// Counts that a workgroup gathers before it adds them to those of the device.
const GATHERED: u32 = 1024u;
var<workgroup> gathered: array<atomic<u32>, GATHERED>;

fn squares() -> u32 {
    return FAILURES + tally_headways * tally_models * CRITERIA;
}

fn capped() -> u32 {
    return squares() + tally_models * CRITERIA;
}

fn close_failures() -> u32 {
    return capped() + tally_headways * tally_models;
}

fn map_samples() -> u32 {
    return close_failures() + tally_models * CRITERIA;
}

fn map_failures() -> u32 {
    return map_samples() + tally_cells;
}

fn kernel_samples() -> u32 {
    return map_failures() + tally_headways * tally_models * tally_cells;
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

// Whether a watch marks a lane with these verdicts: twin of `Watch::marks`.
fn is_marked(model: u32, bits: u32) -> bool {
    let marks = (tally.marks >> (2u * model)) & 3u;
    return ((marks == MARKS_CONTACTS) & ((bits & MARKED_CONTACT) == MARKED_CONTACT))
        | ((marks == MARKS_TTC) & ((bits & 3u) != 0u))
        | ((marks == MARKS_BTN) & ((bits & 4u) != 0u));
}

// A sample with a marked lane is left to the host, which values the lane.
fn is_left(sample: u32) -> bool {
    if tally.marks == 0u {
        return false;
    }
    for (var model = 0u; model < tally_models; model++) {
        for (var headway = 0u; headway < tally_headways; headway++) {
            if is_marked(model, verdict(sample, headway, model)) {
                return true;
            }
        }
    }
    return false;
}

// Counts the lanes of one sample.
fn count(sample: u32) {
    let point = drawn[tally.first_drawn + sample];
    if point.tries > ATTEMPTS {
        atomicAdd(&gathered[VOIDS], 1u);
        atomicAdd(&gathered[TRIES], ATTEMPTS);
        return;
    }
    if is_left(sample) {
        let place = atomicAdd(&left[0], 1u);
        if place < tally.max_left {
            atomicStore(&left[1u + place], sample);
        }
        return;
    }
    atomicAdd(&gathered[TRIES], point.tries);
    let close = tally.close_headways | select(0u, tally.drawn_headways, point.is_close != 0u);
    if close != 0u {
        atomicAdd(&gathered[CLOSE_LANES], countOneBits(close));
    }
    for (var model = 0u; model < tally_models; model++) {
        var failed = vec3<u32>(0u, 0u, 0u);
        for (var headway = 0u; headway < tally_headways; headway++) {
            let bits = verdict(sample, headway, model);
            if bits != 0u {
                let lane = headway * tally_models + model;
                // No contact reaches the time cap: there the bit is a mark.
                if (bits & MARKED_CONTACT) == CAPPED {
                    atomicAdd(&gathered[capped() + lane], 1u);
                }
                let is_close = ((close >> headway) & 1u) != 0u;
                failed.x = failed.x + count_failure(point, lane, model, bits, 0u, is_close);
                failed.y = failed.y + count_failure(point, lane, model, bits, 1u, is_close);
                failed.z = failed.z + count_failure(point, lane, model, bits, 2u, is_close);
            }
        }
        count_square(model * CRITERIA, failed.x);
        count_square(model * CRITERIA + 1u, failed.y);
        count_square(model * CRITERIA + 2u, failed.z);
    }
    if (tally_cells > 0u) & (point.cell < tally_cells) {
        atomicAdd(&counts[map_samples() + point.cell], 1u);
    }
    if tally_groups > 0u {
        atomicAdd(&counts[kernel_samples() + point.component % tally_groups], 1u);
    }
}

// Counts whether a lane fails a criterion, and returns it.
fn count_failure(point: DrawnRecord, lane: u32, model: u32, bits: u32, criterion: u32, is_close: bool) -> u32 {
    let fails = (bits >> criterion) & 1u;
    if fails != 0u {
        let cell = lane * CRITERIA + criterion;
        atomicAdd(&gathered[FAILURES + cell], 1u);
        if is_close {
            atomicAdd(&gathered[close_failures() + model * CRITERIA + criterion], 1u);
        }
        if (criterion == tally_criterion) & (point.cell < tally_cells) {
            atomicAdd(&counts[map_failures() + lane * tally_cells + point.cell], 1u);
        }
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
