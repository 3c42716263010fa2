//! Opens the backend of a run: the CPU, or the device that a user names. Only this module selects, opens and checks a
//! device, and falls back to the CPU if no device was named.

use serde::Serialize;

use super::backend::Backend;
use super::cpu::backend::CpuBackend;
use super::device_choice::BackendChoice;
use super::executor::Executor;
use lanesweep_support::cancel::Cancel;
use lanesweep_support::{Error, Result, option};

/// A device that computes lanes.
#[derive(Debug, Clone, Serialize)]
pub struct DeviceRecord {
    /// Name.
    pub name: String,
    /// Interface: Vulkan, Metal, DX12.
    pub api: &'static str,
    /// Driver and its version.
    pub driver: String,
    /// Place on the PCI bus; `None` if unknown.
    pub pci_bus_id: Option<String>,
    /// Float operations reach the driver unchanged.
    pub exact_path: bool,
}

impl DeviceRecord {
    /// One line for reports.
    pub fn line(&self) -> String {
        let path = if self.exact_path { "exact path" } else { "plain path" };
        let at = self.pci_bus_id.as_ref().map_or(String::new(), |id| format!(", PCI {id}"));
        format!("{} ({}, {}{at}, {path})", self.name, self.api, self.driver)
    }
}

/// An open backend.
pub struct OpenBackend {
    /// With a device, the CPU in the lane arithmetic is the fallback.
    executor: Executor<'static>,
    device: Option<DeviceRecord>,
}

impl OpenBackend {
    /// The CPU in binary64.
    pub fn reference() -> OpenBackend {
        OpenBackend { executor: Executor::new(CpuBackend::reference()), device: None }
    }

    /// Opens a backend whose results equal the CPU's. If a device does not guarantee this, the self-check decides.
    ///
    /// # Errors
    /// [`Error::Usage`] for a device that does not exist or contradicts the backend. [`Error::Device`] if a GPU is
    /// required and none is available, or if its results differ from the CPU's.
    pub fn open(choice: BackendChoice, device: Option<&str>) -> Result<OpenBackend> {
        let cpu = || OpenBackend { executor: Executor::new(CpuBackend::lane_arithmetic()), device: None };
        if choice == BackendChoice::Cpu && device.is_none() {
            return Ok(cpu());
        }
        Ok(open_device(choice, device, true)?.unwrap_or_else(cpu))
    }

    /// Opens a backend for verification: without the self-check, and without falling back to the CPU.
    ///
    /// # Errors
    /// As [`OpenBackend::open`]; [`Error::Device`] also if nothing was specified and there is no GPU.
    pub fn open_to_verify(choice: BackendChoice, device: Option<&str>) -> Result<OpenBackend> {
        if choice == BackendChoice::Cpu && device.is_none() {
            return OpenBackend::open(choice, None);
        }
        open_device(choice, device, false)?.ok_or_else(nothing_to_verify)
    }

    /// The backend.
    pub fn backend(&self) -> &dyn Backend {
        &*self.executor.backend
    }

    /// The device; `None` on the CPU.
    pub fn device(&self) -> Option<&DeviceRecord> {
        self.device.as_ref()
    }

    /// The executor, with a fallback if a device computes.
    pub fn executor(&self) -> Executor<'static> {
        self.executor.clone()
    }

    /// Sets the cancellation token of the runs.
    pub fn with_cancel(self, cancel: Cancel) -> Self {
        OpenBackend { executor: self.executor.with_cancel(cancel), ..self }
    }
}

/// Opens a device; `None` if the CPU is to compute.
#[cfg(feature = "gpu")]
fn open_device(choice: BackendChoice, device: Option<&str>, is_checked: bool) -> Result<Option<OpenBackend>> {
    use super::gpu::{Adapters, GpuBackend, GpuOptions, choose};
    let adapters = Adapters::enumerate();
    let Some(index) = choose(adapters.cards(), choice, device)? else { return Ok(None) };
    let opened = GpuBackend::open(&adapters, index, GpuOptions::default());
    match opened.and_then(|gpu| if is_checked { checked(gpu) } else { Ok(gpu) }) {
        Ok(gpu) => {
            let device = Some(gpu.record());
            let executor = Executor::new(gpu).with_fallback(CpuBackend::lane_arithmetic());
            Ok(Some(OpenBackend { executor, device }))
        }
        // The device was not named explicitly, and the CPU gives the same results.
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
            let help = format!("use {}, or the device through Vulkan", option("backend = cpu"));
            return Err(Error::device(&gpu.card().name, problem, help));
        }
    }
    Ok(gpu)
}

#[cfg(feature = "gpu")]
fn nothing_to_verify() -> Error {
    let problem = "it compares a device with the CPU, and there is no GPU that it may use";
    let help = format!(
        "name a device with {} (`lanesweep devices` lists them), such as {}; {} compares the CPU's vector instructions with its scalar code",
        option("device"),
        option("device = llvmpipe"),
        option("backend = cpu")
    );
    Error::device("lanesweep verify", problem, help)
}

#[cfg(not(feature = "gpu"))]
fn open_device(choice: BackendChoice, device: Option<&str>, _: bool) -> Result<Option<OpenBackend>> {
    choice.check(device)?;
    match (choice, device) {
        (BackendChoice::Gpu, _) => Err(no_gpu(&option("backend = gpu"))),
        (_, Some(device)) => Err(no_gpu(&option(&format!("device = {device}")))),
        (_, None) => Ok(None),
    }
}

#[cfg(not(feature = "gpu"))]
fn nothing_to_verify() -> Error {
    no_gpu("lanesweep verify")
}

/// The error of a program without GPU support if a GPU is required.
#[cfg(not(feature = "gpu"))]
pub fn no_gpu(requested: &str) -> Error {
    let help = format!("use {}, or build it with the feature `gpu`", option("backend = cpu"));
    Error::device(requested, "this program was built without the feature `gpu`", help)
}
