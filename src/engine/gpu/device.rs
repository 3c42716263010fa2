//! The open device: pipelines, shared tables and errors. Only its owner's thread uses it.

// `create_shader_module_passthrough` passes SPIR-V to the driver unchecked; it is naga's output for shaders of this
// crate, with decorations added.
#![allow(unsafe_code)]

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rayon::prelude::*;

use super::adapters::{AdapterCard, DeviceKind};
use super::pacing::{Sharing, Tuner};
use super::shader::{self, BURST, COUNT, ENTRY, GENERATE, WORKGROUP};
use super::spirv::exact_spirv;
use lanesweep_model::driver::ModelId;
use lanesweep_support::{Error, Result, option};

/// Options of a device.
#[derive(Debug, Clone)]
pub struct GpuOptions {
    /// Timeout of a dispatch; after it the device counts as lost.
    pub timeout: Duration,
    /// Lanes per model of the first job; later jobs follow the device's speed.
    pub first_lanes: u64,
    /// Average number of lanes per invocation, at least 1. `None` times a few of each pipeline and keeps the fastest; on a
    /// software device it is 1.
    pub lanes_per_invocation: Option<u32>,
    /// Whether the variants of a scenario get a dispatch each if they have different scenes. `None`: not on a software
    /// device, which compiles slowly.
    pub split_scenes: Option<bool>,
}

impl Default for GpuOptions {
    fn default() -> Self {
        GpuOptions {
            timeout: Duration::from_secs(60),
            first_lanes: 1 << 14,
            lanes_per_invocation: None,
            split_scenes: None,
        }
    }
}

/// Faults that a test injects into a device; none by default.
#[derive(Clone, Default)]
pub struct Tampering {
    /// Uses the plain path instead of the exact one.
    pub plain: bool,
    /// Replaces text of the shaders before compilation.
    pub shader_patch: Option<(String, String)>,
    /// Called before each job with its index since the device was opened. The job returns its error.
    pub before_job: Option<BeforeJob>,
}

/// A callback before a job.
pub type BeforeJob = Arc<dyn Fn(u64, &wgpu::Device) -> std::result::Result<(), &'static str> + Send + Sync>;

/// Key of a model's pipeline.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PipelineSpec {
    pub model: ModelId,
    pub constants: Vec<(&'static str, f64)>,
}

/// A model's pipeline.
struct Compiled {
    spec: PipelineSpec,
    pipeline: wgpu::ComputePipeline,
    tuner: Tuner,
}

/// The open device.
pub(super) struct Device {
    pub name: String,
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Float operations reach the driver unchanged.
    pub exact: bool,
    pub timestamps: bool,
    /// Shaders may require that signed zeros, infinities and NaN are kept.
    float_controls: bool,
    /// Maximum size of the samples that the device makes at a time, bytes.
    pub max_made_bytes: u64,
    pub layout: wgpu::BindGroupLayout,
    pub options: GpuOptions,
    pub tampering: Tampering,
    /// Bindings of the generator.
    pub generator_layout: wgpu::BindGroupLayout,
    /// Bindings of the counting.
    pub tally_layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    pipelines: Vec<Compiled>,
    generator: Option<(Vec<(&'static str, f64)>, wgpu::ComputePipeline)>,
    tally: Option<(Vec<(&'static str, f64)>, wgpu::ComputePipeline)>,
    trouble: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Opens a device with all its features and limits.
    ///
    /// # Errors
    /// [`Error::Device`] where the driver refuses.
    pub(super) fn open(
        adapter: &wgpu::Adapter,
        card: &AdapterCard,
        options: GpuOptions,
        tampering: Tampering,
    ) -> Result<Device> {
        let exact = card.exact_path && !tampering.plain;
        let mut features = wgpu::Features::empty();
        features.set(wgpu::Features::TIMESTAMP_QUERY, card.timestamps);
        features.set(wgpu::Features::PASSTHROUGH_SHADERS, exact);
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("lanesweep"),
            required_features: features,
            // The device's own limits, not the portable 128 MiB.
            required_limits: adapter.limits(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        });
        let (device, queue) = pollster::block_on(request).map_err(|e| {
            Error::device(
                &card.name,
                format!("it cannot be opened: {e}"),
                format!("choose another device, or {}", option("backend = cpu")),
            )
        })?;
        // Without these handlers a device error would panic.
        let trouble = Arc::new(Mutex::new(None));
        let note = |trouble: &Arc<Mutex<Option<String>>>| {
            let trouble = Arc::clone(trouble);
            move |what: String| {
                let mut first = trouble.lock().unwrap_or_else(PoisonError::into_inner);
                first.get_or_insert(what);
            }
        };
        let (uncaptured, lost) = (note(&trouble), note(&trouble));
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| uncaptured(error.to_string())));
        device.set_device_lost_callback(move |reason, message| lost(format!("it was lost ({reason:?}): {message}")));
        let layout = device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("lane"), entries: &entries() });
        let generator_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("generator"),
            entries: &generator_entries(),
        });
        let tally_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("tally"),
            entries: &tally_entries(),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("lane"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let timestamps = card.timestamps;
        let name = card.name.clone();
        let pipelines = Vec::new();
        let opened = Device {
            name,
            device,
            queue,
            exact,
            timestamps,
            float_controls: card.float_controls,
            max_made_bytes: if card.kind == DeviceKind::Discrete { 1 << 30 } else { 256 << 20 },
            layout,
            generator_layout,
            options,
            tampering,
            pipeline_layout,
            pipelines,
            generator: None,
            tally: None,
            tally_layout,
            trouble,
        };
        opened.untroubled()?;
        Ok(opened)
    }

    /// The pipelines of models with their constants. Each is compiled once; those that are missing are compiled side by
    /// side.
    ///
    /// # Errors
    /// [`Error::Internal`] for a shader that does not compile, [`Error::Device`] where the driver refuses it.
    pub(super) fn pipelines<'a>(
        &mut self,
        specs: impl Iterator<Item = &'a PipelineSpec> + Clone,
    ) -> Result<Vec<wgpu::ComputePipeline>> {
        let mut missing: Vec<&PipelineSpec> = Vec::new();
        for spec in specs.clone() {
            if !missing.contains(&spec) && !self.pipelines.iter().any(|known| known.spec == *spec) {
                missing.push(spec);
            }
        }
        let compile = |spec: &&PipelineSpec| {
            let source = shader::assemble(spec.model);
            self.compile(spec.model.name(), source, ENTRY, &spec.constants, &self.pipeline_layout)
        };
        let compiled = missing.par_iter().map(compile).collect::<Result<Vec<_>>>()?;
        let compiled = missing.into_iter().cloned().zip(compiled);
        let new = compiled.map(|(spec, pipeline)| Compiled { spec, pipeline, tuner: Tuner::default() });
        self.pipelines.extend(new);
        let of = |spec: &PipelineSpec| {
            let found = self.pipelines.iter().find(|known| known.spec == *spec);
            found.map(|known| known.pipeline.clone()).ok_or_else(|| self.failed("a pipeline is missing"))
        };
        specs.map(of).collect()
    }

    /// The pipeline of a generator with its constants; the last one is kept.
    ///
    /// # Errors
    /// As [`Device::pipelines`].
    pub(super) fn generator(&mut self, constants: &[(&'static str, f64)]) -> Result<wgpu::ComputePipeline> {
        if let Some((known, pipeline)) = &self.generator
            && known == constants
        {
            return Ok(pipeline.clone());
        }
        let layout = self.layout_of("generator", &self.generator_layout);
        let pipeline = self.compile("generator", shader::assemble_generator(), GENERATE, constants, &layout)?;
        self.generator = Some((constants.to_vec(), pipeline.clone()));
        Ok(pipeline)
    }

    /// The pipeline that counts, with its constants; the last one is kept.
    ///
    /// # Errors
    /// As [`Device::pipelines`].
    pub(super) fn tally(&mut self, constants: &[(&'static str, f64)]) -> Result<wgpu::ComputePipeline> {
        if let Some((known, pipeline)) = &self.tally
            && known == constants
        {
            return Ok(pipeline.clone());
        }
        let layout = self.layout_of("tally", &self.tally_layout);
        let pipeline = self.compile("tally", shader::assemble_tally(), COUNT, constants, &layout)?;
        self.tally = Some((constants.to_vec(), pipeline.clone()));
        Ok(pipeline)
    }

    fn layout_of(&self, label: &str, bindings: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
        self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &[Some(bindings)],
            immediate_size: 0,
        })
    }

    fn compile(
        &self,
        label: &str,
        mut source: String,
        entry: &str,
        values: &[(&'static str, f64)],
        layout: &wgpu::PipelineLayout,
    ) -> Result<wgpu::ComputePipeline> {
        if let Some((from, to)) = &self.tampering.shader_patch {
            source = source.replace(from, to);
        }
        let label = Some(label);
        let module = if self.exact {
            let words = exact_spirv(&source, entry, values, self.float_controls)?;
            let entry =
                wgpu::PassthroughShaderEntryPoint { name: entry.to_owned().into(), workgroup_size: (WORKGROUP, 1, 1) };
            // SAFETY: valid SPIR-V from naga, with the bindings of `entries` and decorations added.
            unsafe {
                self.device.create_shader_module_passthrough(wgpu::ShaderModuleDescriptorPassthrough {
                    label,
                    entry_points: vec![entry].into(),
                    spirv: Some(words.into()),
                    ..Default::default()
                })
            }
        } else {
            let source = wgpu::ShaderSource::Wgsl(source.into());
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source })
        };
        // A passed-through module takes no constants; they are already resolved.
        let constants: &[(&str, f64)] = if self.exact { &[] } else { values };
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
            cache: None,
        });
        self.untroubled()?;
        Ok(pipeline)
    }

    /// A buffer of at least one element.
    pub(super) fn buffer(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let size = bytes.max(64).next_multiple_of(4);
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    /// A storage buffer with the given content.
    pub(super) fn upload<T: bytemuck::Pod>(&self, label: &str, content: &[T]) -> Result<wgpu::Buffer> {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        let limits = self.device.limits();
        let max_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes.len() as u64 > max_bytes {
            let problem = format!("the {label} take {} bytes, but the device holds at most {max_bytes}", bytes.len());
            return Err(Error::device(
                &self.name,
                problem,
                format!("use {}, or split the data", option("backend = cpu")),
            ));
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = self.buffer(label, bytes.len() as u64, usage);
        self.queue.write_buffer(&buffer, 0, bytes);
        self.untroubled()?;
        Ok(buffer)
    }

    /// Maximum number of lanes per model of a job, limited by the size of the result buffers.
    pub(super) fn max_lanes(&self, models: u64, bytes_per_lane: f64) -> u64 {
        let limits = self.device.limits();
        // The read-back buffer also holds counts and times.
        let room = limits.max_buffer_size.saturating_sub(SMALL_RESULT_BYTES);
        let max_bytes = limits.max_storage_buffer_binding_size.min(room).min(MAX_RESULT_BYTES);
        ((max_bytes as f64 / (models as f64 * bytes_per_lane)) as u64).min(MAX_LANES)
    }

    /// Workgroups of a dispatch in two dimensions, because one dimension is limited to 65,535.
    pub(super) fn grid(&self, groups: u32) -> (u32, u32) {
        let groups = groups.max(1);
        let max_groups = self.device.limits().max_compute_workgroups_per_dimension.max(1);
        let rows = groups.div_ceil(max_groups);
        (groups.div_ceil(rows), rows)
    }

    /// How the invocations of a dispatch share its lanes.
    pub(super) fn sharing(&self, spec: &PipelineSpec, lanes: u32) -> Sharing {
        let busy = (lanes / (WORKGROUP * BUSY_WORKGROUPS)).clamp(1, MAX_LANES_PER_INVOCATION);
        let fixed = |lanes| Sharing { lanes, burst: BURST };
        let tuned = || self.pipelines.iter().find(|known| known.spec == *spec)?.tuner.choice();
        self.options.lanes_per_invocation.map(fixed).or_else(tuned).unwrap_or(fixed(busy))
    }

    /// Takes the time of a dispatch into account.
    pub(super) fn observe(&mut self, spec: &PipelineSpec, lanes: u32, sharing: Sharing, seconds: f64) {
        if let Some(known) = self.pipelines.iter_mut().find(|known| known.spec == *spec)
            && self.options.lanes_per_invocation.is_none()
            && let Some(found) = known.tuner.observe(lanes, sharing, seconds)
        {
            let (model, Sharing { lanes, burst }) = (spec.model.name(), found);
            tracing::debug!("{model}: {lanes} lanes per invocation, bursts of {burst} steps");
        }
    }

    /// # Errors
    /// [`Error::Device`] if an error occurred since the last call.
    pub(super) fn untroubled(&self) -> Result<()> {
        let trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone();
        match trouble {
            None => Ok(()),
            Some(what) => Err(self.failed(what)),
        }
    }

    /// The error of this device.
    pub(super) fn failed(&self, what: impl Into<String>) -> Error {
        Error::device(&self.name, what, format!("the CPU backend computes the same: {}", option("backend = cpu")))
    }
}

/// Maximum size of the results of one job, bytes.
const MAX_RESULT_BYTES: u64 = 256 << 20;
/// Reserve for counts, times and rounding, bytes.
const SMALL_RESULT_BYTES: u64 = 4 << 20;
/// Maximum number of lanes per model of one job, so that every index into their results stays far below 2³².
const MAX_LANES: u64 = 1 << 27;
/// Workgroups that keep the largest devices of today busy: 132 multiprocessors of 32 workgroups each.
const BUSY_WORKGROUPS: u32 = 4224;
/// A larger value hardly increases the use of a warp's lanes, and lengthens the end of a dispatch.
const MAX_LANES_PER_INVOCATION: u32 = 32;

/// The bindings of `shaders/lane.wgsl`, in their order: launch, four inputs, three results.
fn entries() -> Vec<wgpu::BindGroupLayoutEntry> {
    buffer_entries(4, 3, true)
}

/// The bindings of `shaders/generate.wgsl`, in their order: generation, four inputs, cases, instants and
/// what is counted of samples.
fn generator_entries() -> Vec<wgpu::BindGroupLayoutEntry> {
    buffer_entries(3, 3, false)
}

/// The bindings of `shaders/tally.wgsl`, in their order: tally, samples and verdicts, counts and samples left.
fn tally_entries() -> Vec<wgpu::BindGroupLayoutEntry> {
    buffer_entries(2, 1, false)
}

/// A uniform buffer, inputs, results.
fn buffer_entries(inputs: usize, results: usize, dynamic: bool) -> Vec<wgpu::BindGroupLayoutEntry> {
    let kinds = std::iter::once(wgpu::BufferBindingType::Uniform)
        .chain(std::iter::repeat_n(wgpu::BufferBindingType::Storage { read_only: true }, inputs))
        .chain(std::iter::repeat_n(wgpu::BufferBindingType::Storage { read_only: false }, results));
    let entry = |(binding, ty)| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: dynamic && binding == 0, min_binding_size: None },
        count: None,
    };
    kinds.enumerate().map(entry).collect()
}
