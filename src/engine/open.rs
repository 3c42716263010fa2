//! What computes the lanes of a run, open: the processor, or the device that a user means. The one place that chooses,
//! opens and checks a device, and falls back to the processor where nobody named one.

use serde::Serialize;

use super::backend::Backend;
use super::cpu::backend::CpuBackend;
use super::device_choice::{BackendChoice, DeviceName};
use super::executor::Executor;
use crate::support::cancel::Cancel;
use crate::{Error, Result};

/// A device that computes lanes.
#[derive(Debug, Clone, Serialize)]
pub struct DeviceRecord {
    /// Name.
    pub name: String,
    /// Interface: Vulkan, Metal, DX12, GL.
    pub api: &'static str,
    /// Driver and its version.
    pub driver: String,
    /// Place on the PCI bus, where it is known.
    pub pci_bus_id: Option<String>,
    /// Float operations reached the driver as written.
    pub exact_path: bool,
}

impl DeviceRecord {
    /// In one line, as pages show it.
    pub(crate) fn line(&self) -> String {
        let path = if self.exact_path { "exact path" } else { "plain path" };
        let at = self.pci_bus_id.as_ref().map_or(String::new(), |id| format!(", PCI {id}"));
        format!("{} ({}, {}{at}, {path})", self.name, self.api, self.driver)
    }
}

/// What computes the lanes, open.
pub struct OpenBackend {
    /// The processor in the lane arithmetic stands in for a device.
    executor: Executor<'static>,
    device: Option<DeviceRecord>,
}

impl OpenBackend {
    /// The processor in binary64.
    pub fn reference() -> OpenBackend {
        OpenBackend { executor: Executor::new(CpuBackend::reference()), device: None }
    }

    /// Opens what computes as the processor does: where a device does not promise it, the self-check decides.
    ///
    /// # Errors
    /// [`Error::Usage`] for a device that does not exist or contradicts the backend, [`Error::Device`] where a GPU is
    /// asked for and there is none, or where it does not compute as the processor does.
    pub fn open(choice: BackendChoice, device: Option<&DeviceName>) -> Result<OpenBackend> {
        let cpu = || OpenBackend { executor: Executor::new(CpuBackend::lane_arithmetic()), device: None };
        if choice == BackendChoice::Cpu && device.is_none() {
            return Ok(cpu());
        }
        Ok(open_device(choice, device, true)?.unwrap_or_else(cpu))
    }

    /// Opens what is to be verified: no check before the check, and no silent processor.
    ///
    /// # Errors
    /// As [`OpenBackend::open`]; [`Error::Device`] also where nothing was asked for and there is no GPU.
    pub fn open_to_verify(choice: BackendChoice, device: Option<&DeviceName>) -> Result<OpenBackend> {
        if choice == BackendChoice::Cpu && device.is_none() {
            return OpenBackend::open(choice, None);
        }
        open_device(choice, device, false)?.ok_or_else(nothing_to_verify)
    }

    /// What computes.
    pub fn backend(&self) -> &dyn Backend {
        &*self.executor.backend
    }

    /// The device, where one computes.
    pub fn device(&self) -> Option<&DeviceRecord> {
        self.device.as_ref()
    }

    /// What computes, with what stands in for a device.
    pub fn executor(&self) -> Executor<'static> {
        self.executor.clone()
    }

    /// The same, whose runs end by this token.
    pub fn with_cancel(self, cancel: Cancel) -> Self {
        OpenBackend { executor: self.executor.with_cancel(cancel), ..self }
    }
}

/// Opens a device; `None` where the processor is to compute.
#[cfg(feature = "gpu")]
fn open_device(choice: BackendChoice, device: Option<&DeviceName>, is_checked: bool) -> Result<Option<OpenBackend>> {
    use super::gpu::{Adapters, GpuBackend, GpuOptions, choose, visible_here};
    let adapters = Adapters::enumerate();
    let visible = visible_here()?;
    let Some(index) = choose(adapters.cards(), choice, device, visible.as_deref())? else { return Ok(None) };
    let opened = GpuBackend::open(&adapters, index, GpuOptions::default());
    match opened.and_then(|gpu| if is_checked { checked(gpu) } else { Ok(gpu) }) {
        Ok(gpu) => {
            let device = Some(gpu.record());
            let executor = Executor::new(gpu).with_fallback(CpuBackend::lane_arithmetic());
            Ok(Some(OpenBackend { executor, device }))
        }
        // Nobody named it: the CPU computes the same.
        Err(error) if is_checked && choice == BackendChoice::Auto && device.is_none() => {
            tracing::warn!("{error}; the CPU computes instead");
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

#[cfg(feature = "gpu")]
fn checked(gpu: super::gpu::GpuBackend) -> Result<super::gpu::GpuBackend> {
    if !gpu.is_exact() {
        let check = super::verify::self_check(&gpu)?;
        if check.differing > 0 {
            let problem =
                format!("{} of {} lanes of the self-check differ from the CPU's", check.differing, check.lanes);
            let help = "use option `backend = cpu`, or the device through Vulkan";
            return Err(Error::device(&gpu.card().name, problem, help));
        }
    }
    Ok(gpu)
}

#[cfg(feature = "gpu")]
fn nothing_to_verify() -> Error {
    let problem = "it compares a device with the CPU, and there is no GPU that it may use";
    let help = "name a device with option `device` (`lanesweep verify devices` lists them), such as option `device = \
                llvmpipe`; option `backend = cpu` compares the CPU's vector instructions with its scalar code";
    Error::device("lanesweep verify", problem, help)
}

#[cfg(not(feature = "gpu"))]
fn open_device(choice: BackendChoice, device: Option<&DeviceName>, _: bool) -> Result<Option<OpenBackend>> {
    choice.check(device)?;
    match (choice, device) {
        (BackendChoice::Gpu, _) => Err(no_gpu("option `backend = gpu`")),
        (_, Some(device)) => Err(no_gpu(&format!("option `device = {device}`"))),
        (_, None) => Ok(None),
    }
}

#[cfg(not(feature = "gpu"))]
fn nothing_to_verify() -> Error {
    no_gpu("lanesweep verify")
}

/// What a program without GPUs says where one is asked for.
#[cfg(not(feature = "gpu"))]
pub(crate) fn no_gpu(asked: &str) -> Error {
    let help = "use option `backend = cpu`, or build it with the feature `gpu`";
    Error::device(asked, "this program was built without the feature `gpu`", help)
}
