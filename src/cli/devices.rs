//! `lanesweep verify devices`: the compute devices of this machine.

use clap::Args;

use super::Output;
use super::format::FormatFlag;
use crate::Result;

/// List the compute devices and the one that is used
///
/// Every device of every driver, with its limits, and the one that `--backend auto` selects. CUDA_VISIBLE_DEVICES and
/// Slurm's GPU list are respected.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep verify devices --format json")]
pub(super) struct Devices {
    #[command(flatten)]
    format: FormatFlag,
    /// Leave out the self-check, which opens every device
    #[arg(long, help_heading = "Run")]
    no_self_check: bool,
}

impl Devices {
    #[cfg(feature = "gpu")]
    pub(super) fn run(&self) -> Result<Output> {
        super::device_list::list(&self.format, self.no_self_check)
    }

    #[cfg(not(feature = "gpu"))]
    pub(crate) fn run(&self) -> Result<Output> {
        Err(crate::engine::no_gpu("lanesweep verify devices"))
    }
}
