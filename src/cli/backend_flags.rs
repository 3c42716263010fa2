//! Which backend computes the lanes: `--backend` and `--device`.

use clap::Args;

use super::signals::CANCEL;
use crate::engine::{BackendChoice, DeviceName, OpenBackend};
use crate::{Error, Place, Result};

/// Flags of every verb that sweeps.
#[derive(Debug, Clone, Args)]
pub struct BackendFlags {
    /// Backend; auto: a GPU if there is one
    #[arg(long, value_name = "auto|cpu|gpu")]
    backend: BackendChoice,
    /// Device, by a part of its name, its PCI bus id or its index
    ///
    /// `lanesweep verify devices` lists the devices.
    #[arg(long, value_name = "NAME|pci:BUS|INDEX")]
    device: Option<DeviceName>,
}

impl BackendFlags {
    /// Opens what the flags and the environment say.
    ///
    /// # Errors
    /// As [`OpenBackend::open`].
    pub fn open(&self) -> Result<OpenBackend> {
        Ok(OpenBackend::open(self.backend, self.device.as_ref())?.with_cancel(CANCEL.clone()))
    }

    /// Opens what is to be verified.
    ///
    /// # Errors
    /// As [`OpenBackend::open_to_verify`].
    pub fn open_to_verify(&self) -> Result<OpenBackend> {
        OpenBackend::open_to_verify(self.backend, self.device.as_ref())
    }

    /// The processor in binary64, for `--reference`, which leaves no choice.
    ///
    /// # Errors
    /// [`Error::Usage`] where another backend or a device is asked for.
    pub fn reference(&self) -> Result<OpenBackend> {
        if self.backend == BackendChoice::Gpu || self.device.is_some() {
            let problem = "it computes in binary64 on the CPU; a device computes in binary32".to_owned();
            return Err(Error::usage(Place::item("--reference"), problem, "leave out --backend and --device"));
        }
        Ok(OpenBackend::reference().with_cancel(CANCEL.clone()))
    }
}
