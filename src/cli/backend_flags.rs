//! Which backend computes the lanes: `--backend` and `--device`, from what is configured to what is open.

use super::configured::Configured;
use super::signals::CANCEL;
use crate::engine::{BackendChoice, DeviceName, OpenBackend};
use crate::{Error, Place, Result};

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
    /// As [`Configured::backend`] and [`OpenBackend::open`].
    pub fn open(&self) -> Result<OpenBackend> {
        let (backend, device) = self.backend()?;
        Ok(OpenBackend::open(backend, device.as_ref())?.with_cancel(CANCEL.clone()))
    }

    /// Opens what is to be verified.
    ///
    /// # Errors
    /// As [`Configured::backend`] and [`OpenBackend::open_to_verify`].
    pub fn open_to_verify(&self) -> Result<OpenBackend> {
        let (backend, device) = self.backend()?;
        OpenBackend::open_to_verify(backend, device.as_ref())
    }

    /// The processor in binary64, for `--reference`, which leaves no choice.
    ///
    /// # Errors
    /// [`Error::Usage`] where another backend or a device is asked for.
    pub fn open_reference(&self) -> Result<OpenBackend> {
        let run = &self.settings.run;
        if run.backend == BackendChoice::Gpu || run.device.is_some() {
            let problem = "it computes in binary64 on the CPU; a device computes in binary32".to_owned();
            return Err(Error::usage(Place::item("--reference"), problem, "leave out --backend and --device"));
        }
        Ok(OpenBackend::reference().with_cancel(CANCEL.clone()))
    }
}
