//! Which backend computes the lanes: `--backend` and `--device`, from what is configured to what is open.

use std::time::Instant;

use super::configured::Configured;
use super::open_device::{OpenDevice, nothing_to_verify, open_checked, open_device};
use crate::engine::{Backend, BackendChoice, CpuBackend, DeviceName, Executor};
use crate::report::run_record::DeviceRecord;
use crate::report::sampling::HostRecord;
use crate::{Error, Place, Result};

/// What computes the lanes, open.
pub struct Opened {
    /// The CPU in the lane arithmetic: the backend, or what stands in for a device that fails.
    cpu: CpuBackend<f32>,
    device: Option<OpenDevice>,
}

impl Configured {
    /// The backend and the device that are asked for.
    ///
    /// # Errors
    /// [`Error::Usage`] for what names no device.
    pub fn backend(&self) -> Result<(BackendChoice, Option<DeviceName>)> {
        let run = &self.settings.run;
        let device = run.device.as_deref().map(str::parse).transpose();
        Ok((run.backend, device.map_err(|error| self.at_origin("run.device", "device", error))?))
    }

    /// Opens what flags, files and the environment say.
    ///
    /// # Errors
    /// [`Error::Usage`] for a device that does not exist or contradicts the backend, [`Error::Device`] where
    /// a GPU is asked for and there is none, or where it does not compute as the CPU does.
    pub fn open(&self) -> Result<Opened> {
        self.open_by(open_checked)
    }

    /// Opens what is to be verified: no check before the check, and no silent CPU.
    ///
    /// # Errors
    /// As [`Configured::open`]; [`Error::Device`] also where nothing was asked for and there is no GPU.
    pub fn open_to_verify(&self) -> Result<Opened> {
        self.open_by(|backend, device| open_device(backend, device)?.ok_or_else(nothing_to_verify).map(Some))
    }

    fn open_by(
        &self,
        open: impl FnOnce(BackendChoice, Option<&DeviceName>) -> Result<Option<OpenDevice>>,
    ) -> Result<Opened> {
        let cpu = CpuBackend::lane_arithmetic();
        Ok(match self.backend()? {
            (BackendChoice::Cpu, None) => Opened { cpu, device: None },
            (backend, device) => Opened { cpu, device: open(backend, device.as_ref())? },
        })
    }

    /// The CPU, for a flag that leaves no choice.
    ///
    /// # Errors
    /// [`Error::Usage`] where another backend or a device is asked for.
    pub fn open_cpu(&self, flag: &str) -> Result<Opened> {
        let run = &self.settings.run;
        if run.backend == BackendChoice::Gpu || run.device.is_some() {
            let problem = "it computes in binary64 on the CPU; a device computes in binary32".to_owned();
            return Err(Error::usage(Place::item(flag), problem, "leave out --backend and --device"));
        }
        Ok(Opened { cpu: CpuBackend::lane_arithmetic(), device: None })
    }
}

impl Opened {
    /// What computes.
    pub fn backend(&self) -> &dyn Backend {
        match &self.device {
            Some(device) => &*device.backend,
            None => &self.cpu,
        }
    }

    /// What stands in for a device.
    pub fn fallback(&self) -> Option<&dyn Backend> {
        self.device.as_ref().map(|_| &self.cpu as &dyn Backend)
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
        self.device.as_ref().map(|device| device.record.clone())
    }
}
