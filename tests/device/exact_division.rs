//! `exact_div` of `shaders/shared/exact.wgsl` gives the correctly rounded quotient, whatever the device's own one is
//! worth: compared with the quotient of Rust, which IEEE 754 defines, on the software Vulkan.
//!
//! Its domain: normal operands of either sign, and zero numerators. Inside it every quotient whose magnitude is at
//! least 2⁻¹²⁶ has the bits of Rust's `/`; one that overflows is infinite, with its sign. What lies outside:
//!
//! - A quotient smaller in magnitude than 2⁻¹²⁶ becomes 0 with its sign, where IEEE 754 has a subnormal number, or
//!   2⁻¹²⁶ where that rounds up to it. Tested here as said: many devices flush subnormal numbers anyway.
//! - A subnormal numerator counts as 0. Tested here.
//! - A divisor that is zero or subnormal, an infinite operand or a NaN: the result means nothing. No lane asks.
//!
//! The guess may lie up to three units in the last place of the true quotient of the mantissas off: Vulkan allows
//! 2.5. Units below 1 are 2⁻²⁴ and above 2⁻²³; a guess is moved by the unit of the true quotient, also across 1.

// SPIR-V is handed to the driver unseen, as src/engine/gpu/device.rs does with the shaders of this crate.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks)]

use crate::common::device::software_device;
use bytemuck::{Pod, Zeroable};
use lanesweep::engine::gpu::{exact_spirv, shader::ENTRY};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

const EXACT: &str = include_str!("../../shaders/shared/exact.wgsl");
const KERNEL: &str = "
struct Question {
    a_bits: u32,
    b_bits: u32,
    guesses: array<u32, 7>,
}

@group(0) @binding(0) var<storage, read> questions: array<Question>;
// The quotient from the device's own guess, then one from each guess of the host.
@group(0) @binding(1) var<storage, read_write> answers: array<array<u32, 8>>;

@compute @workgroup_size(64)
fn lanes(@builtin(global_invocation_id) id: vec3<u32>) {
    let a_bits = questions[id.x].a_bits;
    let b_bits = questions[id.x].b_bits;
    answers[id.x][0] = bitcast<u32>(exact_div(bitcast<f32>(a_bits), bitcast<f32>(b_bits)));
    for (var k = 0u; k < 7u; k++) {
        let guess = bitcast<f32>(questions[id.x].guesses[k]);
        answers[id.x][k + 1u] = bitcast<u32>(exact_div_from(guess, a_bits, b_bits));
    }
}
";
const WORKGROUP: u32 = 64;
/// Pairs of one dispatch.
const BATCH: usize = 1 << 18;
const MANTISSA: u32 = 0x007f_ffff;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Question {
    a_bits: u32,
    b_bits: u32,
    guesses: [u32; 7],
}

/// How the kernel reaches the driver.
#[derive(Clone, Copy)]
enum Path {
    /// As SPIR-V without contraction: the way of the sweeps.
    Exact,
    /// As WGSL, translated by wgpu: the way on other interfaces.
    Plain,
}

/// The kernel on the software Vulkan.
struct Divider {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    questions: wgpu::Buffer,
    answers: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl Divider {
    fn new(source: &str, path: Path) -> Option<Divider> {
        let (adapters, index) = software_device()?;
        let adapter = adapters.take(index).unwrap();
        let is_exact = matches!(path, Path::Exact);
        assert!(adapters.cards()[index].exact_path || !is_exact, "the software Vulkan has no exact path");
        let mut required_features = wgpu::Features::empty();
        required_features.set(wgpu::Features::PASSTHROUGH_SHADERS, is_exact);
        let descriptor =
            wgpu::DeviceDescriptor { required_features, required_limits: adapter.limits(), ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
        let module = match path {
            Path::Exact => {
                let words = exact_spirv(source, ENTRY, &[], false).unwrap();
                let entry = wgpu::PassthroughShaderEntryPoint { name: ENTRY.into(), workgroup_size: (WORKGROUP, 1, 1) };
                // SAFETY: valid SPIR-V of naga, whose bindings are those of `layout`.
                unsafe {
                    device.create_shader_module_passthrough(wgpu::ShaderModuleDescriptorPassthrough {
                        label: None,
                        entry_points: vec![entry].into(),
                        spirv: Some(words.into()),
                        ..Default::default()
                    })
                }
            }
            Path::Plain => device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: None,
                source: wgpu::ShaderSource::Wgsl(source.into()),
            }),
        };
        let entries = [(0, true), (1, false)].map(|(binding, read_only)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        });
        let layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(ENTRY),
            compilation_options: Default::default(),
            cache: None,
        });
        let buffer = |words: usize, usage| {
            let size = (BATCH * words * 4) as u64;
            device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        use wgpu::BufferUsages as Usage;
        let questions = buffer(9, Usage::STORAGE | Usage::COPY_DST);
        let answers = buffer(8, Usage::STORAGE | Usage::COPY_SRC);
        let readback = buffer(8, Usage::MAP_READ | Usage::COPY_DST);
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: questions.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: answers.as_entire_binding() },
            ],
        });
        Some(Divider { device, queue, pipeline, group, questions, answers, readback })
    }

    /// Answers of one whole batch.
    fn divide(&self, questions: &[Question]) -> Vec<[u32; 8]> {
        assert_eq!(questions.len(), BATCH);
        self.queue.write_buffer(&self.questions, 0, bytemuck::cast_slice(questions));
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            pass.dispatch_workgroups(BATCH as u32 / WORKGROUP, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&self.answers, 0, &self.readback, 0, self.readback.size());
        self.queue.submit([encoder.finish()]);
        self.readback.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let answers = bytemuck::pod_collect_to_vec(&self.readback.get_mapped_range(..).unwrap());
        self.readback.unmap();
        answers
    }
}

/// Pairs to divide, the same in every run.
struct Pairs(ChaCha8Rng);

impl Pairs {
    fn new() -> Pairs {
        Pairs(ChaCha8Rng::seed_from_u64(157))
    }

    /// A number in 0 … below − 1.
    fn below(&mut self, below: u32) -> u32 {
        ((u64::from(self.0.next_u32()) * u64::from(below)) >> 32) as u32
    }

    fn question(&mut self) -> Question {
        let (a_mantissa, b_mantissa) = self.mantissas();
        let (a_exponent, b_exponent) = self.exponents();
        let signs = self.0.next_u32();
        let mut a_bits = (signs & 0x8000_0000) | (a_exponent << 23) | (a_mantissa & MANTISSA);
        let b_bits = ((signs << 1) & 0x8000_0000) | (b_exponent << 23) | (b_mantissa & MANTISSA);
        match self.below(256) {
            // Zero and subnormal numerators.
            0 => a_bits &= 0x8000_0000,
            1 => a_bits &= 0x807f_ffff,
            _ => {}
        }
        Question { a_bits, b_bits, guesses: guesses(a_bits, b_bits) }
    }

    /// Two integers of 24 bits.
    fn mantissas(&mut self) -> (u32, u32) {
        let any = |pairs: &mut Pairs| 0x0080_0000 | (pairs.0.next_u32() & MANTISSA);
        match self.below(4) {
            0 => (any(self), any(self)),
            1 => self.mantissas_next_to_a_boundary(),
            2 => {
                // Powers of two, all ones, one bit, and their neighbours.
                let edge = |pairs: &mut Pairs| {
                    let bit = pairs.below(23);
                    let near = [0, MANTISSA, 1 << bit, MANTISSA ^ (1 << bit)][pairs.below(4) as usize];
                    0x0080_0000 | (near.wrapping_add(pairs.below(5)).wrapping_sub(2) & MANTISSA)
                };
                (edge(self), edge(self))
            }
            _ => {
                // Quotients near 1, equal mantissas among them.
                let a = any(self);
                (a, 0x0080_0000 | (a.wrapping_add(self.below(9)).wrapping_sub(4) & MANTISSA))
            }
        }
    }

    /// Mantissas whose integer quotient leaves a remainder next to a half of the divisor, where it is rounded one way
    /// or the other, or next to none, where the guess is cut one way or the other.
    fn mantissas_next_to_a_boundary(&mut self) -> (u32, u32) {
        loop {
            // Odd, so that 2 has an inverse.
            let b = 0x0080_0001 | (self.0.next_u32() & MANTISSA);
            let off = self.below(8);
            let mut a = [b / 2 - off, b / 2 + 1 + off, off, b - 1 - off][self.below(4) as usize];
            let shift = 23 + self.below(2);
            // a·2^shift ≡ remainder (mod b)
            for _ in 0..shift {
                a = if a.is_multiple_of(2) { a / 2 } else { (a + b) / 2 };
            }
            // Smaller mantissas are divided with 24 bits more, larger ones with 23.
            let a = if shift == 24 { a } else { a + b };
            if (0x0080_0000..0x0100_0000).contains(&a) {
                return (a, b);
            }
        }
    }

    /// Biased exponents of normal numbers: most quotients normal, some next to the ends of the range.
    fn exponents(&mut self) -> (u32, u32) {
        let difference = match self.below(8) {
            0 => 124 + self.below(8) as i32,
            1 => -130 + self.below(8) as i32,
            _ => -125 + self.below(252) as i32,
        };
        let (lowest, highest) = (1.max(1 - difference), 254.min(254 - difference));
        let b = lowest + self.below((highest - lowest + 1) as u32) as i32;
        ((b + difference) as u32, b as u32)
    }
}

/// The quotient of the mantissas, rounded, and moved by −3 … 3 units in its last place.
fn guesses(a_bits: u32, b_bits: u32) -> [u32; 7] {
    let in_one_to_two = |bits: u32| f32::from_bits((bits & MANTISSA) | 0x3f80_0000);
    let (a, b) = (in_one_to_two(a_bits), in_one_to_two(b_bits));
    let unit = if a < b { 2.0_f64.powi(-24) } else { 2.0_f64.powi(-23) };
    std::array::from_fn(|k| (f64::from(a / b) + (k as f64 - 3.0) * unit) as f32).map(f32::to_bits)
}

/// What [`exact_div`] promises: Rust's quotient, but 0 for what is too small.
fn promised(a_bits: u32, b_bits: u32) -> u32 {
    let (a, b) = (f32::from_bits(a_bits), f32::from_bits(b_bits));
    // In f64 this is never rounded to the bound: quotients of two mantissas of 24 bits lie farther apart.
    let is_small = a.is_subnormal() || (f64::from(a) / f64::from(b)).abs() < f64::from(f32::MIN_POSITIVE);
    if is_small { (a_bits ^ b_bits) & 0x8000_0000 } else { (a / b).to_bits() }
}

/// What a run has seen.
#[derive(Debug, Default)]
struct Seen {
    pairs: usize,
    infinite: usize,
    zero: usize,
    /// By way: the device's own guess, then −3 … 3.
    wrong: [usize; 8],
    first: Option<String>,
}

fn compare(divider: &Divider, batches: usize) -> Seen {
    let mut pairs = Pairs::new();
    let mut seen = Seen::default();
    for _ in 0..batches {
        let questions: Vec<Question> = (0..BATCH).map(|_| pairs.question()).collect();
        for (question, answers) in questions.iter().zip(divider.divide(&questions)) {
            let expected = promised(question.a_bits, question.b_bits);
            seen.infinite += usize::from(expected & 0x7fff_ffff == f32::INFINITY.to_bits());
            seen.zero += usize::from(expected & 0x7fff_ffff == 0);
            for (way, answer) in answers.into_iter().enumerate() {
                if answer != expected {
                    seen.wrong[way] += 1;
                    seen.first.get_or_insert_with(|| {
                        let Question { a_bits, b_bits, .. } = question;
                        format!("{a_bits:08x}/{b_bits:08x}: {answer:08x} for {expected:08x}, way {way}")
                    });
                }
            }
        }
        seen.pairs += BATCH;
    }
    println!("{seen:?}");
    seen
}

fn assert_correct(path: Path, pairs: usize) {
    let Some(divider) = Divider::new(&format!("{EXACT}{KERNEL}"), path) else { return };
    let seen = compare(&divider, pairs.div_ceil(BATCH));
    assert_eq!(seen.wrong, [0; 8], "{:?}", seen.first);
    // The ends of the range were reached.
    assert!(seen.infinite > seen.pairs / 100 && seen.zero > seen.pairs / 100, "{seen:?}");
}

#[test]
fn the_quotient_is_correctly_rounded_on_the_path_of_the_sweeps() {
    assert_correct(Path::Exact, 4_000_000);
}

#[test]
fn the_quotient_is_correctly_rounded_as_plain_wgsl() {
    assert_correct(Path::Plain, 1_000_000);
}

/// The number of the specification: `cargo test --release --test device exact_division:: -- --ignored --nocapture`.
#[test]
#[ignore = "a longer run of the same"]
fn twenty_million_quotients_are_correctly_rounded_from_every_guess() {
    assert_correct(Path::Exact, 20_000_000);
}

#[test]
fn a_defect_of_the_correction_is_seen() {
    for (right, wrong) in [
        // Too few steps (three are enough, because the last one rounds), a tie moved, the exponent of quotients below
        // 1, both ends of the range.
        ("k < 4u", "k < 2u"),
        ("remainder + remainder > divisor", "remainder + remainder > divisor + 1"),
        ("select(127, 126, below_one)", "127"),
        ("exponent <= 0", "exponent <= 1"),
        ("(exponent >= 255) | (magnitude >= INFINITY_BITS)", "false"),
    ] {
        assert!(EXACT.contains(right), "{right}");
        let source = format!("{}{KERNEL}", EXACT.replace(right, wrong));
        let Some(divider) = Divider::new(&source, Path::Exact) else { return };
        let seen = compare(&divider, 1);
        assert!(seen.wrong.iter().sum::<usize>() > 0, "{right} became {wrong}, and nothing was seen");
    }
}
