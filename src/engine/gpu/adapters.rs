//! The compute devices of this machine and their properties.

use std::fmt;

use serde::Serialize;

use lanesweep_support::{Error, Result};

/// Kind of device, as its driver reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the CPU's memory.
    Integrated,
    /// A GPU behind a hypervisor, whole or in part.
    Virtual,
    /// A rasterizer that runs on the CPU: llvmpipe, WARP.
    Software,
    /// The driver does not report it.
    Other,
}

impl DeviceKind {
    /// Name in tables.
    pub fn label(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

impl From<wgpu::DeviceType> for DeviceKind {
    fn from(kind: wgpu::DeviceType) -> Self {
        match kind {
            wgpu::DeviceType::DiscreteGpu => DeviceKind::Discrete,
            wgpu::DeviceType::IntegratedGpu => DeviceKind::Integrated,
            wgpu::DeviceType::VirtualGpu => DeviceKind::Virtual,
            wgpu::DeviceType::Cpu => DeviceKind::Software,
            wgpu::DeviceType::Other => DeviceKind::Other,
        }
    }
}

/// Interface to a device, in order of preference: Vulkan first, because only there equality with the CPU is
/// guaranteed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum Api {
    /// Vulkan.
    Vulkan,
    /// Metal (macOS).
    Metal,
    /// Direct3D 12 (Windows).
    #[serde(rename = "DX12")]
    Dx12,
}

impl Api {
    /// Name in tables.
    pub fn label(self) -> &'static str {
        match self {
            Api::Vulkan => "Vulkan",
            Api::Metal => "Metal",
            Api::Dx12 => "DX12",
        }
    }

    fn of(backend: wgpu::Backend) -> Option<Api> {
        match backend {
            wgpu::Backend::Vulkan => Some(Api::Vulkan),
            wgpu::Backend::Metal => Some(Api::Metal),
            wgpu::Backend::Dx12 => Some(Api::Dx12),
            wgpu::Backend::Gl | wgpu::Backend::Noop | wgpu::Backend::BrowserWebGpu => None,
        }
    }
}

impl fmt::Display for Api {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.label())
    }
}

/// One device under one interface, described without the interface's types.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AdapterCard {
    /// Position in [`Adapters::cards`]; the index of `--device INDEX`.
    pub index: usize,
    /// The device's name from its driver.
    pub name: String,
    /// Kind of device.
    pub kind: DeviceKind,
    /// Interface to the device.
    pub api: Api,
    /// Driver; empty if unknown.
    pub driver: String,
    /// Version text of the driver; may be empty.
    pub driver_info: String,
    /// Place on the PCI bus as `dddd:bb:dd.f`, lower case; `None` if unknown or not on a bus.
    pub pci_bus_id: Option<String>,
    /// Vendor, as a PCI id where the vendor has one.
    pub vendor: u32,
    /// Model number of the vendor; 0 if unknown.
    pub device: u32,
    /// The device supports timestamps.
    pub timestamps: bool,
    /// The device accepts SPIR-V with `NoContraction`, so that results equal the CPU's (Vulkan with shader
    /// passthrough). Elsewhere equality is not guaranteed.
    pub exact_path: bool,
    /// The driver can be told to keep signed zeros, infinities and NaN of binary32 (Vulkan's float controls). Lanes do
    /// not depend on them, but a driver that is not told may assume that there are none.
    pub float_controls: bool,
}

/// Whether a Vulkan device can be told to keep signed zeros, infinities and NaN of binary32.
#[cfg(any(windows, target_os = "linux", target_os = "freebsd", target_os = "android"))]
// wgpu does not tell; the handles are its own.
#[allow(unsafe_code)]
fn has_float_controls(adapter: &wgpu::Adapter) -> bool {
    use ash::vk;
    // SAFETY: the handles live as long as the adapter; both structures are those that the call fills.
    unsafe {
        let Some(adapter) = adapter.as_hal::<wgpu::hal::api::Vulkan>() else { return false };
        let (mut core, mut controls) =
            (vk::PhysicalDeviceProperties2::default(), vk::PhysicalDeviceFloatControlsProperties::default());
        let instance = adapter.shared_instance();
        let device = adapter.raw_physical_device();
        // Both are part of Vulkan 1.2.
        let version = instance.raw_instance().get_physical_device_properties(device).api_version;
        if version.min(instance.instance_api_version()) < vk::API_VERSION_1_2 {
            return false;
        }
        core = core.push_next(&mut controls);
        instance.raw_instance().get_physical_device_properties2(device, &mut core);
        controls.shader_signed_zero_inf_nan_preserve_float32 == vk::TRUE
    }
}

#[cfg(not(any(windows, target_os = "linux", target_os = "freebsd", target_os = "android")))]
fn has_float_controls(_adapter: &wgpu::Adapter) -> bool {
    false
}

impl AdapterCard {
    fn of(adapter: &wgpu::Adapter) -> Option<AdapterCard> {
        let info = adapter.get_info();
        let api = Api::of(info.backend)?;
        let features = adapter.features();
        Some(AdapterCard {
            index: 0,
            name: info.name.trim().to_owned(),
            kind: info.device_type.into(),
            api,
            driver: info.driver,
            driver_info: info.driver_info,
            pci_bus_id: Some(info.device_pci_bus_id.to_lowercase()).filter(|bus| !bus.is_empty()),
            vendor: info.vendor,
            device: info.device,
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            exact_path: api == Api::Vulkan && features.contains(wgpu::Features::PASSTHROUGH_SHADERS),
            float_controls: api == Api::Vulkan && has_float_controls(adapter),
        })
    }

    /// Whether the driver reports a GPU. `Other` counts as none.
    pub fn is_real(&self) -> bool {
        matches!(self.kind, DeviceKind::Discrete | DeviceKind::Virtual | DeviceKind::Integrated)
    }

    /// Index, name, interface and PCI bus id, for messages.
    pub fn one_line(&self) -> String {
        let bus = self.pci_bus_id.as_ref().map(|bus| format!(", pci:{bus}")).unwrap_or_default();
        format!("{}: {} ({}, {}{bus})", self.index, self.name, self.kind.label(), self.api)
    }
}

/// The devices of this machine, in a reproducible order.
#[derive(Debug, Clone)]
pub struct Adapters {
    cards: Vec<AdapterCard>,
    adapters: Vec<wgpu::Adapter>,
}

impl Adapters {
    /// Lists the devices of all drivers. A machine without devices gives an empty list, never an error.
    ///
    /// Nothing is written to stdout. Without `XDG_RUNTIME_DIR` and display, Mesa's device-select layer warns twice on
    /// stderr; the program sets `NODEVICE_SELECT=1` to silence it.
    pub fn enumerate() -> Adapters {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        // The same flags in every build: validation layers are slow and write messages.
        descriptor.flags = wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
        let backends = descriptor.backends;
        let adapters = pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends));
        let described = adapters.into_iter().filter_map(|adapter| Some((AdapterCard::of(&adapter)?, adapter)));
        let mut found: Vec<(AdapterCard, wgpu::Adapter)> = described.collect();
        found.sort_by(|(a, _), (b, _)| order(a).cmp(&order(b)));
        let (mut cards, adapters): (Vec<AdapterCard>, Vec<wgpu::Adapter>) = found.into_iter().unzip();
        for (index, card) in cards.iter_mut().enumerate() {
            card.index = index;
        }
        Adapters { cards, adapters }
    }

    /// All devices: by interface, real before software, by PCI bus id, by name.
    pub fn cards(&self) -> &[AdapterCard] {
        &self.cards
    }

    /// The adapter of a card, with which the device is opened.
    ///
    /// # Errors
    /// [`Error::Internal`] if there is no card with this index.
    pub fn take(&self, index: usize) -> Result<wgpu::Adapter> {
        let adapter = self.adapters.get(index).cloned();
        adapter.ok_or_else(|| Error::Internal(format!("device {index} of {} was requested", self.adapters.len())))
    }
}

/// Sort key of the list. Model numbers last, for equal devices without a bus id.
fn order(card: &AdapterCard) -> impl Ord {
    let software = card.kind == DeviceKind::Software;
    let bus = card.pci_bus_id.clone();
    (card.api, software, bus.is_none(), bus.map(|b| (b.len(), b)), card.name.clone(), card.vendor, card.device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_ordered_numbered_and_the_same_twice() {
        let (first, second) = (Adapters::enumerate(), Adapters::enumerate());
        assert_eq!(first.cards(), second.cards());
        assert!(first.cards().is_sorted_by(|a, b| order(a) <= order(b)));
        for (at, card) in first.cards().iter().enumerate() {
            assert_eq!(card.index, at);
            let info = first.take(at).unwrap().get_info();
            assert_eq!((info.name.trim(), Api::of(info.backend)), (&card.name[..], Some(card.api)));
        }
        assert!(matches!(first.take(first.cards().len()), Err(Error::Internal(_))));
    }
}
