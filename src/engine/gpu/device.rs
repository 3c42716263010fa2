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

/// A kernel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kernel {
    /// The lanes of a model: `shaders/lane.wgsl`. Launch, four inputs, three results.
    Lanes(ModelId),
    /// `shaders/generate.wgsl`. Generation, three inputs, cases, instants and what is counted of samples.
    Generate,
    /// `shaders/tally.wgsl`. Tally, samples and verdicts, counts.
    Count,
}

impl Kernel {
    /// Its name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Kernel::Lanes(model) => model.name(),
            Kernel::Generate => "generator",
            Kernel::Count => "tally",
        }
    }

    /// Index of its bindings among [`BINDINGS`].
    fn bindings(self) -> usize {
        match self {
            Kernel::Lanes(_) => 0,
            Kernel::Generate => 1,
            Kernel::Count => 2,
        }
    }
}

/// Number of inputs and of results of each kernel, after a uniform buffer.
const BINDINGS: [(usize, usize); 3] = [(4, 3), (3, 3), (2, 1)];

/// Key of a pipeline.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PipelineSpec {
    pub kernel: Kernel,
    pub constants: Vec<(&'static str, f64)>,
}

/// A pipeline.
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
    pub options: GpuOptions,
    pub tampering: Tampering,
    /// One layout per entry of [`BINDINGS`].
    layouts: [wgpu::BindGroupLayout; 3],
    pipelines: Vec<Compiled>,
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
        // The lanes of a job share one buffer of launches.
        let layouts = [0, 1, 2].map(|kernel| bind_group_layout(&device, BINDINGS[kernel], kernel == 0));
        let opened = Device {
            name: card.name.clone(),
            device,
            queue,
            exact,
            timestamps: card.timestamps,
            float_controls: card.float_controls,
            max_made_bytes: if card.kind == DeviceKind::Discrete { 1 << 30 } else { 256 << 20 },
            options,
            tampering,
            layouts,
            pipelines: Vec::new(),
            trouble,
        };
        opened.untroubled()?;
        Ok(opened)
    }

    /// Pipelines with their constants. Each is compiled once; those that are missing are compiled side by
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
        let compiled = missing.par_iter().map(|spec| self.compile(spec)).collect::<Result<Vec<_>>>()?;
        let compiled = missing.into_iter().cloned().zip(compiled);
        let new = compiled.map(|(spec, pipeline)| Compiled { spec, pipeline, tuner: Tuner::default() });
        self.pipelines.extend(new);
        let of = |spec: &PipelineSpec| {
            let found = self.pipelines.iter().find(|known| known.spec == *spec);
            found.map(|known| known.pipeline.clone()).ok_or_else(|| self.failed("a pipeline is missing"))
        };
        specs.map(of).collect()
    }

    fn compile(&self, PipelineSpec { kernel, constants: values }: &PipelineSpec) -> Result<wgpu::ComputePipeline> {
        let (mut source, entry) = match *kernel {
            Kernel::Lanes(model) => (shader::assemble(model), ENTRY),
            Kernel::Generate => (shader::assemble_generator(), GENERATE),
            Kernel::Count => (shader::assemble_tally(), COUNT),
        };
        if let Some((from, to)) = &self.tampering.shader_patch {
            source = source.replace(from, to);
        }
        let label = Some(kernel.name());
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&self.layouts[kernel.bindings()])],
            immediate_size: 0,
        });
        let module = if self.exact {
            let words = exact_spirv(&source, entry, values, self.float_controls)?;
            let entry =
                wgpu::PassthroughShaderEntryPoint { name: entry.to_owned().into(), workgroup_size: (WORKGROUP, 1, 1) };
            // SAFETY: valid SPIR-V from naga, with the kernel's bindings and decorations added.
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
            layout: Some(&layout),
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
        let max_bytes = self.max_binding();
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

    /// Maximum size of a storage buffer, bytes.
    pub(super) fn max_binding(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// Maximum number of lanes per model of a job, limited by the size of the result buffers.
    pub(super) fn max_lanes(&self, models: u64, bytes_per_lane: f64) -> u64 {
        let limits = self.device.limits();
        // The read-back buffer also holds counts and times.
        let room = limits.max_buffer_size.saturating_sub(SMALL_RESULT_BYTES);
        let max_bytes = limits.max_storage_buffer_binding_size.min(room).min(MAX_RESULT_BYTES);
        ((max_bytes as f64 / (models as f64 * bytes_per_lane)) as u64).min(MAX_LANES)
    }

    /// Buffers in the order of a kernel's bindings.
    pub(super) fn bind(
        &self,
        kernel: Kernel,
        first: wgpu::BindingResource,
        others: &[&wgpu::Buffer],
    ) -> wgpu::BindGroup {
        let resources = std::iter::once(first).chain(others.iter().map(|buffer| buffer.as_entire_binding()));
        let entry = |(binding, resource)| wgpu::BindGroupEntry { binding, resource };
        let entries: Vec<wgpu::BindGroupEntry> = (0..).zip(resources).map(entry).collect();
        let (label, layout) = (Some(kernel.name()), &self.layouts[kernel.bindings()]);
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries })
    }

    /// Adds a dispatch to an encoder. Its workgroups are in two dimensions, because one is limited to 65,535.
    pub(super) fn dispatch(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::ComputePipeline,
        (group, offsets): (&wgpu::BindGroup, &[u32]),
        groups: u32,
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites>,
    ) {
        let groups = groups.max(1);
        let max_groups = self.device.limits().max_compute_workgroups_per_dimension.max(1);
        let rows = groups.div_ceil(max_groups);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, offsets);
        pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
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
            let (model, Sharing { lanes, burst }) = (spec.kernel.name(), found);
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

/// A uniform buffer, inputs, results.
fn bind_group_layout(
    device: &wgpu::Device,
    (inputs, results): (usize, usize),
    is_dynamic: bool,
) -> wgpu::BindGroupLayout {
    let kinds = std::iter::once(wgpu::BufferBindingType::Uniform)
        .chain(std::iter::repeat_n(wgpu::BufferBindingType::Storage { read_only: true }, inputs))
        .chain(std::iter::repeat_n(wgpu::BufferBindingType::Storage { read_only: false }, results));
    let entry = |(binding, ty)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: is_dynamic && binding == 0, min_binding_size: None },
        count: None,
    };
    let entries: Vec<wgpu::BindGroupLayoutEntry> = (0..).zip(kinds).map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}
