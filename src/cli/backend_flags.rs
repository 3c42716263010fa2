//! Which backend computes the lanes: `--backend` and `--device`, from what was typed to what is open.

use std::time::Instant;

use clap::Args;

use crate::engine::gpu::{Adapters, BackendChoice, DeviceName, GpuBackend, GpuOptions, choose, visible_here};
use crate::engine::verify::self_check;
use crate::engine::{Backend, CpuBackend, Executor};
use crate::report::run_record::DeviceRecord;
use crate::report::sampling::HostRecord;
use crate::{Error, Place, Result};

/// Flags of every verb that sweeps.
#[derive(Debug, Clone, Args)]
pub struct BackendFlags {
    /// What computes; auto: a GPU where there is one
    #[arg(long, value_name = "auto|cpu|gpu", default_value = "auto")]
    backend: BackendChoice,
    /// Device, by a part of its name, its PCI bus id or its index
    ///
    /// `lanesweep verify devices` lists the devices.
    #[arg(long, value_name = "NAME|pci:BUS|INDEX")]
    device: Option<DeviceName>,
}

/// What computes the lanes, open.
pub struct Opened {
    /// The CPU in the lane arithmetic: the backend, or what stands in for a device that fails.
    cpu: CpuBackend<f32>,
    gpu: Option<GpuBackend>,
}

impl BackendFlags {
    /// Opens what the flags and the environment say.
    ///
    /// # Errors
    /// [`Error::Usage`] for a device that does not exist or contradicts the backend, [`Error::Device`] where
    /// a GPU is asked for and there is none, or where it does not compute as the CPU does.
    pub fn open(&self) -> Result<Opened> {
        let cpu = CpuBackend::lane_arithmetic();
        if self.backend == BackendChoice::Cpu && self.device.is_none() {
            return Ok(Opened { cpu, gpu: None });
        }
        let adapters = Adapters::enumerate();
        let visible = visible_here()?;
        let chosen = choose(adapters.cards(), self.backend, self.device.as_ref(), visible.as_deref())?;
        let Some(index) = chosen else { return Ok(Opened { cpu, gpu: None }) };
        match open_checked(&adapters, index) {
            Ok(gpu) => Ok(Opened { cpu, gpu: Some(gpu) }),
            // Nobody named it: the CPU computes the same.
            Err(error) if self.backend == BackendChoice::Auto && self.device.is_none() => {
                tracing::warn!("{error}; the CPU computes instead");
                Ok(Opened { cpu, gpu: None })
            }
            Err(error) => Err(error),
        }
    }

    /// Opens what is to be verified: no check before the check, and no silent CPU.
    ///
    /// # Errors
    /// As [`BackendFlags::open`]; [`Error::Device`] also where nothing was asked for and there is no GPU.
    pub fn open_to_verify(&self) -> Result<Opened> {
        let cpu = CpuBackend::lane_arithmetic();
        if self.backend == BackendChoice::Cpu && self.device.is_none() {
            return Ok(Opened { cpu, gpu: None });
        }
        let adapters = Adapters::enumerate();
        let visible = visible_here()?;
        let backend = if self.backend == BackendChoice::Cpu { BackendChoice::Cpu } else { BackendChoice::Gpu };
        let chosen = choose(adapters.cards(), backend, self.device.as_ref(), visible.as_deref())?;
        let index = chosen.ok_or_else(|| Error::Internal("a device was asked for and none was chosen".to_owned()))?;
        Ok(Opened { cpu, gpu: Some(GpuBackend::open(&adapters, index, GpuOptions::default())?) })
    }

    /// The CPU, for a flag that leaves no choice.
    ///
    /// # Errors
    /// [`Error::Usage`] where another backend or a device is asked for.
    pub fn none_but(&self, flag: &str) -> Result<Opened> {
        if self.backend == BackendChoice::Gpu || self.device.is_some() {
            let problem = "it computes in binary64 on the CPU; a device computes in binary32".to_owned();
            return Err(Error::usage(Place::item(flag), problem, "leave --backend and --device out"));
        }
        Ok(Opened { cpu: CpuBackend::lane_arithmetic(), gpu: None })
    }
}

/// Opens a device; where equality is not promised, the self-check decides.
fn open_checked(adapters: &Adapters, index: usize) -> Result<GpuBackend> {
    let gpu = GpuBackend::open(adapters, index, GpuOptions::default())?;
    if !gpu.is_exact() {
        let check = self_check(&gpu)?;
        if check.differing > 0 {
            let problem =
                format!("{} of {} lanes of the self-check differ from the CPU's", check.differing, check.lanes);
            return Err(Error::device(&gpu.card().name, problem, "use --backend cpu, or the device through Vulkan"));
        }
    }
    Ok(gpu)
}

impl Opened {
    /// What computes.
    pub fn backend(&self) -> &dyn Backend {
        match &self.gpu {
            Some(gpu) => gpu,
            None => &self.cpu,
        }
    }

    /// What stands in for a device.
    pub fn fallback(&self) -> Option<&dyn Backend> {
        self.gpu.as_ref().map(|_| &self.cpu as &dyn Backend)
    }

    /// Both.
    pub fn executor(&self) -> Executor<'_> {
        Executor::new(self.backend()).with_fallback(self.fallback())
    }

    /// What computed a run that began at this instant, for its record.
    pub fn host(&self, rechecked_lanes: u64, started: Instant) -> HostRecord {
        HostRecord {
            backend: self.backend().describe(),
            device: self.device(),
            rechecked_lanes,
            seconds: started.elapsed().as_secs_f64(),
            threads: rayon::current_num_threads(),
        }
    }

    /// The device, for the record of the run.
    pub fn device(&self) -> Option<DeviceRecord> {
        let gpu = self.gpu.as_ref()?;
        let card = gpu.card();
        Some(DeviceRecord {
            name: card.name.clone(),
            api: card.api.label(),
            driver: [&card.driver[..], &card.driver_info].join(" ").trim().to_owned(),
            pci_bus_id: card.pci_bus_id.clone(),
            exact_path: gpu.is_exact(),
        })
    }
}
