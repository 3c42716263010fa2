//! The generator on the device: its inputs, and the dispatch that fills a session's cases and tables.

use super::device::{Device, Kernel, PipelineSpec};
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
    pipeline: PipelineSpec,
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
        let pipeline = PipelineSpec { kernel: Kernel::Generate, constants: generator.shader_constants() };
        GeneratorSetup { generation, recipe: generator.recipe, pipeline, numbers }
    }

    /// Bytes of one sample: case, what is counted, and instants.
    pub(super) fn sample_bytes(&self) -> u64 {
        (size_of::<LaneCase<f32>>() + size_of::<DrawnRecord>()) as u64 + 4 * u64::from(self.generation.stride)
    }

    /// Copies all inputs to the device.
    pub(super) fn upload(&self, device: &mut Device) -> Result<GeneratorInputs> {
        use wgpu::BufferUsages as Use;
        Ok(GeneratorInputs {
            pipeline: device.pipelines(std::iter::once(&self.pipeline))?.swap_remove(0),
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
    let samples = u64::from(count);
    let sizes = [
        (&mut inputs.cases, "cases", size_of::<LaneCase<f32>>() as u64),
        (&mut inputs.speed, "instants", 4 * u64::from(template.stride)),
        (&mut inputs.drawn, "drawn samples", size_of::<DrawnRecord>() as u64),
    ];
    for (buffer, label, bytes) in sizes {
        if buffer.size() < samples * bytes {
            *buffer = device.buffer(label, samples * bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
        }
    }
    let generation = Generation { index_low: first as u32, index_high: (first >> 32) as u32, count, ..template };
    device.queue.write_buffer(&made.generation, 0, bytemuck::bytes_of(&generation));
    let others = [&made.recipe, &made.numbers, &made.normal, &inputs.cases, &inputs.speed, &inputs.drawn];
    let group = device.bind(Kernel::Generate, made.generation.as_entire_binding(), &others);
    let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    device.dispatch(&mut encoder, &made.pipeline, (&group, &[]), count.div_ceil(WORKGROUP), None);
    device.queue.submit([encoder.finish()]);
    device.untroubled()
}
