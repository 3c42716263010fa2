//! A WGSL kernel of a test on the software Vulkan: buffers of words in, one buffer of words out.

// SPIR-V is handed to the driver unseen, as src/engine/gpu/device.rs does with the shaders of this crate.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks)]

use lanesweep::engine::gpu::{exact_spirv, shader::ENTRY};

use crate::common::device::software_device;

/// Invocations per workgroup: what a kernel's `@workgroup_size` must say.
pub const WORKGROUP: u32 = 64;

/// How the kernel reaches the driver.
#[derive(Debug, Clone, Copy)]
pub enum Path {
    /// As SPIR-V without contraction: the way of the sweeps.
    Exact,
    /// As WGSL, translated by wgpu: the way on other interfaces.
    Plain,
}

/// A pipeline whose binding 0 is written and whose bindings 1, 2, … are read.
pub struct Kernel {
    device: wgpu::Device,
    queue: wgpu::Queue,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Kernel {
    /// `None`, loudly, without a software Vulkan.
    pub fn new(source: &str, inputs: u32, path: Path) -> Option<Kernel> {
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
        let entries: Vec<_> = (0..=inputs)
            .map(|binding| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: binding > 0 },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
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
        Some(Kernel { device, queue, layout, pipeline })
    }

    /// `words` words, written by `workgroups` workgroups that read `inputs`.
    pub fn run(&self, inputs: &[&[u32]], workgroups: u32, words: usize) -> Vec<u32> {
        use wgpu::BufferUsages as Usage;
        let buffer = |words: usize, usage| {
            let size = (words * 4) as u64;
            self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let mut buffers = vec![buffer(words, Usage::STORAGE | Usage::COPY_SRC)];
        for input in inputs {
            let made = buffer(input.len(), Usage::STORAGE | Usage::COPY_DST);
            self.queue.write_buffer(&made, 0, bytemuck::cast_slice(input));
            buffers.push(made);
        }
        let readback = buffer(words, Usage::MAP_READ | Usage::COPY_DST);
        let entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layout,
            entries: &entries,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(workgroups, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&buffers[0], 0, &readback, 0, readback.size());
        self.queue.submit([encoder.finish()]);
        readback.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let answers = bytemuck::pod_collect_to_vec(&readback.get_mapped_range(..).unwrap());
        readback.unmap();
        answers
    }
}
