//! What `src/random` makes of (seed, index), `shaders/shared/{philox,normal}.wgsl` make bit for bit on the software Vulkan.

use crate::device::kernel::{Kernel, Path, WORKGROUP};
use lanesweep::engine::gpu::shader::RANDOM;
use lanesweep::stats::random::{Stream, choose, normal_table, standard_normal};

const BINDINGS: &str = "
@group(0) @binding(0) var<storage, read_write> answers: array<u32>;
@group(0) @binding(1) var<storage, read> questions: array<u32>;
@group(0) @binding(2) var<storage, read> normal_table: array<vec4<f32>>;
";

/// Per index and dimension: the word, its normal deviate, and a choice.
const OF_INDICES: &str = "
@compute @workgroup_size(64)
fn lanes(@builtin(global_invocation_id) id: vec3<u32>) {
    let seed = vec2<u32>(questions[0], questions[1]);
    let low = questions[3] + id.x;
    let index = vec2<u32>(low, questions[4] + select(0u, 1u, low < id.x));
    for (var dimension = 0u; dimension < 8u; dimension++) {
        let four = stream_words(seed, questions[2], index, dimension / 4u);
        let random = four[dimension % 4u];
        let at = (id.x * 8u + dimension) * 3u;
        answers[at] = random;
        answers[at + 1u] = bitcast<u32>(standard_normal(random));
        answers[at + 2u] = choose(random, questions[5] + dimension);
    }
}
";
const ANSWERS: [&str; 3] = ["Philox word", "normal of it", "choice"];

const OF_WORDS: &str = "
@compute @workgroup_size(64)
fn lanes(@builtin(global_invocation_id) id: vec3<u32>) {
    answers[id.x] = bitcast<u32>(standard_normal(questions[id.x]));
}
";

const DIMENSIONS: u32 = 8;
const BATCH: u32 = 1 << 16;

fn source(kernel: &str) -> String {
    let fragments = RANDOM.iter().map(|(_, text)| *text);
    [BINDINGS].into_iter().chain(fragments).chain([kernel]).collect::<Vec<_>>().join("\n")
}

fn run(kernel: &Kernel, questions: &[u32], workgroups: u32, words: usize) -> Vec<u32> {
    let normal: Vec<u32> = normal_table().iter().flatten().map(|c| c.to_bits()).collect();
    kernel.run(&[questions, &normal], workgroups, words)
}

fn expected(stream: Stream, index: u64, dimension: u32) -> [u32; 3] {
    let random = stream.words(index, dimension / 4)[(dimension % 4) as usize];
    [random, standard_normal(random).to_bits(), choose(random, CHOICES + dimension)]
}

const CHOICES: u32 = 3;
const SEED: u64 = 0xFEDC_BA98_7654_3210;

fn differing(kernel: &Kernel, first_indices: &[u64]) -> ([usize; 3], Option<String>) {
    let stream = Stream { seed: SEED, purpose: 7 };
    let (mut wrong, mut first) = ([0; 3], None);
    for &start in first_indices {
        let questions = [
            [SEED as u32, (SEED >> 32) as u32, stream.purpose, start as u32, (start >> 32) as u32],
            [CHOICES, 0, 0, 0, 0],
        ]
        .concat();
        let words = (BATCH * DIMENSIONS) as usize * ANSWERS.len();
        let answers = run(kernel, &questions, BATCH / WORKGROUP, words);
        let mut found = answers.chunks_exact(ANSWERS.len());
        for k in 0..BATCH {
            for dimension in 0..DIMENSIONS {
                let index = start + u64::from(k);
                let wanted = expected(stream, index, dimension);
                let found = found.next().unwrap();
                for kind in (0..ANSWERS.len()).filter(|&kind| found[kind] != wanted[kind]) {
                    wrong[kind] += 1;
                    first.get_or_insert_with(|| {
                        let kind_name = ANSWERS[kind];
                        let (found, wanted) = (found[kind], wanted[kind]);
                        format!("{kind_name} of {index:#x} in dimension {dimension}: {found:08x} for {wanted:08x}")
                    });
                }
            }
        }
    }
    (wrong, first)
}

/// A million indices: from 0, beyond 2¹⁶, across 2³², and where the high word counts.
fn a_million() -> Vec<u64> {
    let half = u64::from(BATCH / 2);
    let near = (0..8).map(|k| k * u64::from(BATCH));
    let far = [(1 << 31) - half, (1 << 32) - half, (1 << 32) + 12_345, 0x9E37_79B9_7F4A_7C15];
    near.chain(far).chain((1..=4).map(|k| k * 0x0123_4567)).collect()
}

#[test]
fn a_million_indices_in_eight_dimensions_have_the_bits_of_rust() {
    let Some(kernel) = Kernel::new(&source(OF_INDICES), 2, Path::Exact) else { return };
    let indices = a_million();
    assert!(indices.len() * BATCH as usize >= 1_000_000);
    let (wrong, first) = differing(&kernel, &indices);
    println!("{} indices, {DIMENSIONS} dimensions: {wrong:?} words differ", indices.len() * BATCH as usize);
    assert_eq!(wrong, [0; 3], "{first:?}");
}

#[test]
fn as_plain_wgsl_the_words_are_the_same_and_deviates_at_most_rounded_apart() {
    let Some(kernel) = Kernel::new(&source(OF_INDICES), 2, Path::Plain) else { return };
    let (wrong, first) = differing(&kernel, &[0]);
    println!("as plain WGSL {wrong:?} words of {} differ", BATCH * DIMENSIONS);
    // Sums and products of integers leave nothing open; those of floats may be contracted.
    assert_eq!([wrong[0], wrong[2]], [0; 2], "{first:?}");
}

#[test]
fn the_ends_of_every_cubic_have_the_bits_of_rust() {
    let Some(kernel) = Kernel::new(&source(OF_WORDS), 2, Path::Exact) else { return };
    let mut words: Vec<u32> = vec![];
    for octave in 0..32_u32 {
        for step in 0..16_u64 {
            // First tail word of a segment, see src/random/normal.rs.
            let tail = ((((16 + step) << 28) >> (octave + 1)) / 2) as u32;
            words.extend((0..64).map(|k| tail.wrapping_add(k).wrapping_sub(32)));
        }
    }
    words.extend(words.clone().iter().map(|word| !word));
    let answers = run(&kernel, &words, words.len() as u32 / WORKGROUP, words.len());
    for (word, found) in words.iter().zip(answers) {
        assert_eq!(found, standard_normal(*word).to_bits(), "{word:08x}");
    }
}

#[test]
fn a_defect_of_a_fragment_is_seen() {
    for (right, wrong, kind) in [
        ("+ (carried >> 16u)", "", 0),
        ("index.x, index.y, block", "index.x, 0u, block", 0),
        ("2u * tail + 1u", "2u * tail", 1),
        ("<< NORMAL_SEGMENT_BITS) >> 9u", "<< NORMAL_SEGMENT_BITS) >> 8u", 1),
        // The order of the sums. (A contraction would not show here: Mesa's software Vulkan rounds `fma` twice. That
        // none is allowed stands in src/engine/gpu/spirv.rs.)
        ("((c.w * x + c.z) * x + c.y) * x + c.x", "(c.w * x + c.z) * (x * x) + (c.y * x + c.x)", 1),
    ] {
        let source = source(OF_INDICES);
        assert_eq!(source.matches(right).count(), 1, "{right}");
        let broken = source.replace(right, wrong);
        let Some(kernel) = Kernel::new(&broken, 2, Path::Exact) else { return };
        let (found, _) = differing(&kernel, &[(1 << 32) - 99]);
        assert!(found[kind] > 0, "{right} is {wrong:?}: {found:?}");
    }
}
