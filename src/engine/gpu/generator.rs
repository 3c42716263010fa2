//! The generator on the device: its inputs, and the dispatch that fills a session's cases and tables.

use super::device::Device;
use super::records::{DrawnRecord, Generation};
use super::shader::WORKGROUP;
use crate::LaneCase;
use crate::generated::{Generator, PointSource, Recipe};
use lanesweep_random::normal_table;
use lanesweep_support::Result;

/// The tables of a session.
pub(super) struct Inputs {
    pub starts: wgpu::Buffer,
    pub speed: wgpu::Buffer,
    pub lateral: wgpu::Buffer,
    pub cases: wgpu::Buffer,
    /// What is counted of each sample besides its lanes.
    pub drawn: wgpu::Buffer,
    /// Makes cases and tables, if the host does not.
    pub generator: Option<GeneratorInputs>,
}

/// The generator's buffers of one session.
pub(super) struct GeneratorInputs {
    pub pipeline: wgpu::ComputePipeline,
    pub template: Generation,
    pub generation: wgpu::Buffer,
    pub recipe: wgpu::Buffer,
    pub numbers: wgpu::Buffer,
    pub normal: wgpu::Buffer,
}

/// Inputs of the generator on a device.
pub(super) struct GeneratorSetup {
    generation: Generation,
    recipe: Recipe,
    constants: Vec<(&'static str, f64)>,
    numbers: Vec<u32>,
}

impl GeneratorSetup {
    pub(super) fn new(generator: &Generator) -> Self {
        let points = &generator.points;
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let mut numbers = bits(&generator.basis);
        let first_mean = numbers.len() as u32;
        numbers.extend(bits(&points.means));
        let first_deviation = numbers.len() as u32;
        numbers.extend(bits(&points.deviations));
        let mut generation = Generation {
            components: points.components(),
            first_mean,
            first_deviation,
            stride: generator.case_instants(),
            ..Generation::default()
        };
        if let PointSource::Random(stream) = &points.source {
            generation.seed_low = stream.seed as u32;
            generation.seed_high = (stream.seed >> 32) as u32;
            generation.purpose = stream.purpose;
        }
        let (recipe, constants) = (generator.recipe, generator.shader_constants());
        GeneratorSetup { generation, recipe, constants, numbers }
    }

    /// Bytes of one sample: case, what is counted, and instants.
    pub(super) fn sample_bytes(&self) -> u64 {
        (size_of::<LaneCase<f32>>() + size_of::<DrawnRecord>()) as u64 + 4 * u64::from(self.generation.stride)
    }

    /// Copies all inputs to the device.
    pub(super) fn upload(&self, device: &mut Device) -> Result<GeneratorInputs> {
        use wgpu::BufferUsages as Use;
        Ok(GeneratorInputs {
            pipeline: device.generator(&self.constants)?,
            template: self.generation,
            generation: device.buffer("generation", size_of::<Generation>() as u64, Use::UNIFORM | Use::COPY_DST),
            recipe: device.upload("recipe", &[self.recipe])?,
            numbers: device.upload("numbers of the density", &self.numbers)?,
            normal: device.upload("normal deviates", normal_table())?,
        })
    }
}

/// Fills cases and tables with the samples from `first` on. Jobs submitted before still read the old ones, because a
/// queue keeps its order.
pub(super) fn generate(device: &mut Device, inputs: &mut Inputs, first: u64, count: u32) -> Result<()> {
    let Some(made) = &inputs.generator else { return Err(device.failed("the session makes no cases")) };
    let template = made.template;
    let room = |bytes: u64, buffer: &wgpu::Buffer| (buffer.size() < bytes).then_some(bytes);
    let samples = u64::from(count);
    let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    if let Some(bytes) = room(samples * size_of::<LaneCase<f32>>() as u64, &inputs.cases) {
        inputs.cases = device.buffer("cases", bytes, storage);
    }
    if let Some(bytes) = room(4 * samples * u64::from(template.stride), &inputs.speed) {
        inputs.speed = device.buffer("instants", bytes, storage);
    }
    if let Some(bytes) = room(samples * size_of::<DrawnRecord>() as u64, &inputs.drawn) {
        inputs.drawn = device.buffer("drawn samples", bytes, storage);
    }
    let generation = Generation { index_low: first as u32, index_high: (first >> 32) as u32, count, ..template };
    device.queue.write_buffer(&made.generation, 0, bytemuck::bytes_of(&generation));
    let buffers =
        [&made.generation, &made.recipe, &made.numbers, &made.normal, &inputs.cases, &inputs.speed, &inputs.drawn];
    let entries: Vec<wgpu::BindGroupEntry> = buffers
        .iter()
        .enumerate()
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding: binding as u32, resource: buffer.as_entire_binding() })
        .collect();
    let group = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("generator"),
        layout: &device.generator_layout,
        entries: &entries,
    });
    let (x, y) = device.grid(count.div_ceil(WORKGROUP));
    let mut encoder =
        device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("generator") });
    {
        let descriptor = wgpu::ComputePassDescriptor { label: Some("generator"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&made.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
    device.queue.submit([encoder.finish()]);
    device.untroubled()
}
