//! The buffers of one session on a device.

use super::records::Generation;

/// The tables of a session.
pub(super) struct Inputs {
    pub starts: wgpu::Buffer,
    pub speed: wgpu::Buffer,
    pub lateral: wgpu::Buffer,
    pub cases: wgpu::Buffer,
    /// Makes cases and tables, if the host does not.
    pub generator: Option<GeneratorInputs>,
}

/// The generator's buffers of one session.
pub(super) struct GeneratorInputs {
    pub template: Generation,
    pub generation: wgpu::Buffer,
    pub recipe: wgpu::Buffer,
    pub numbers: wgpu::Buffer,
    pub aliases: wgpu::Buffer,
    pub sobol: wgpu::Buffer,
    pub normal: wgpu::Buffer,
}
