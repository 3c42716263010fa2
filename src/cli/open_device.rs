//! The device that `--backend` and `--device` mean, open. A program without the feature `gpu` has none, and says so.

use crate::engine::{Backend, BackendChoice, DeviceName};
use crate::report::run_record::DeviceRecord;
use crate::{Error, Result};

#[cfg(feature = "gpu")]
pub use with_gpu::{nothing_to_verify, open_checked, open_device};

/// A device that is open.
pub struct OpenDevice {
    pub backend: Box<dyn Backend>,
    pub record: DeviceRecord,
}

#[cfg(feature = "gpu")]
mod with_gpu {
    use super::*;
    use crate::engine::gpu::{Adapters, GpuBackend, GpuOptions, choose, visible_here};
    use crate::engine::verify::self_check;

    /// Opens a device; `None` where the processor is to compute.
    ///
    /// # Errors
    /// [`Error::Usage`] for a device that does not exist or contradicts the backend, [`Error::Device`] where a GPU is
    /// asked for and there is none.
    pub fn open_device(backend: BackendChoice, device: Option<&DeviceName>) -> Result<Option<OpenDevice>> {
        let Some((adapters, index)) = chosen(backend, device)? else { return Ok(None) };
        open(&adapters, index).map(|gpu| Some(gpu.into()))
    }

    /// The same; where equality is not promised, the self-check decides.
    ///
    /// # Errors
    /// Also [`Error::Device`] where the device does not compute as the CPU does.
    pub fn open_checked(backend: BackendChoice, device: Option<&DeviceName>) -> Result<Option<OpenDevice>> {
        let Some((adapters, index)) = chosen(backend, device)? else { return Ok(None) };
        match open(&adapters, index).and_then(checked) {
            Ok(gpu) => Ok(Some(gpu.into())),
            // Nobody named it: the CPU computes the same.
            Err(error) if backend == BackendChoice::Auto && device.is_none() => {
                tracing::warn!("{error}; the CPU computes instead");
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// What `verify` says where no device is named and there is no GPU.
    pub fn nothing_to_verify() -> Error {
        let problem = "it compares a device with the CPU, and there is no GPU that it may use";
        let help = "name a device with --device (`lanesweep verify devices` lists them), such as --device llvmpipe; \
                    --backend cpu compares the CPU's vector instructions with its scalar code";
        Error::device("lanesweep verify", problem, help)
    }

    fn chosen(backend: BackendChoice, device: Option<&DeviceName>) -> Result<Option<(Adapters, usize)>> {
        let adapters = Adapters::enumerate();
        let visible = visible_here()?;
        let index = choose(adapters.cards(), backend, device, visible.as_deref())?;
        Ok(index.map(|index| (adapters, index)))
    }

    fn open(adapters: &Adapters, index: usize) -> Result<GpuBackend> {
        GpuBackend::open(adapters, index, GpuOptions::default())
    }

    fn checked(gpu: GpuBackend) -> Result<GpuBackend> {
        if !gpu.is_exact() {
            let check = self_check(&gpu)?;
            if check.differing > 0 {
                let problem =
                    format!("{} of {} lanes of the self-check differ from the CPU's", check.differing, check.lanes);
                return Err(Error::device(
                    &gpu.card().name,
                    problem,
                    "use --backend cpu, or the device through Vulkan",
                ));
            }
        }
        Ok(gpu)
    }

    impl From<GpuBackend> for OpenDevice {
        fn from(gpu: GpuBackend) -> OpenDevice {
            let card = gpu.card();
            let record = DeviceRecord {
                name: card.name.clone(),
                api: card.api.label(),
                driver: [&card.driver[..], &card.driver_info].join(" ").trim().to_owned(),
                pci_bus_id: card.pci_bus_id.clone(),
                exact_path: gpu.is_exact(),
            };
            OpenDevice { backend: Box::new(gpu), record }
        }
    }
}

/// The processor where nothing else is asked for.
///
/// # Errors
/// [`Error::Usage`] for a device beside `cpu`, [`Error::Device`] for a GPU or a device.
#[cfg(not(feature = "gpu"))]
pub fn open_checked(backend: BackendChoice, device: Option<&DeviceName>) -> Result<Option<OpenDevice>> {
    backend.check(device)?;
    match (backend, device) {
        (BackendChoice::Gpu, _) => Err(no_gpu("--backend gpu")),
        (_, Some(device)) => Err(no_gpu(&format!("--device {device}"))),
        (_, None) => Ok(None),
    }
}

#[cfg(not(feature = "gpu"))]
pub use open_checked as open_device;

/// What `verify` says where no device is named.
#[cfg(not(feature = "gpu"))]
pub fn nothing_to_verify() -> Error {
    no_gpu("lanesweep verify")
}

/// What a program without GPUs says where one is asked for.
#[cfg(not(feature = "gpu"))]
pub fn no_gpu(asked: &str) -> Error {
    let help = "use --backend cpu, or build it with the feature `gpu` (`cargo build --release`)";
    Error::device(asked, "this program was built without the feature `gpu`", help)
}
