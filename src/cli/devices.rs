//! `lanesweep devices`: the compute devices of this machine.

use clap::Args;

use super::Output;
use super::format::FormatFlag;
use lanesweep_support::Result;

/// List the compute devices and the one that is used
///
/// Each device of each driver, by name, interface and PCI bus id, and whether it has the exact path; then what `--backend
/// auto` selects: the first GPU, discrete before virtual before integrated, never software.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep devices --format json")]
pub(super) struct Devices {
    #[command(flatten)]
    format: FormatFlag,
}

impl Devices {
    #[cfg(feature = "gpu")]
    pub(super) fn run(&self) -> Result<Output> {
        use lanesweep_engine::BackendChoice;
        use lanesweep_engine::gpu::{Adapters, choose};
        let adapters = Adapters::enumerate();
        let cards = adapters.cards();
        let auto = choose(cards, BackendChoice::Auto, None)?;
        let text = || {
            let path = |is_exact: bool| if is_exact { "exact path" } else { "plain path" };
            let mut text: String =
                cards.iter().map(|card| format!("{}, {}\n", card.one_line(), path(card.exact_path))).collect();
            if cards.is_empty() {
                text += NOTHING;
            }
            text + &match auto {
                Some(index) => format!("{} selects device {index}.\n", lanesweep_support::option("backend = auto")),
                None => format!("{} selects the CPU: there is no GPU.\n", lanesweep_support::option("backend = auto")),
            }
        };
        let json = || lanesweep_report::records::document(&serde_json::json!({"devices": cards, "auto": auto}));
        self.format.output(super::Exit::Ok, text, json)
    }

    #[cfg(not(feature = "gpu"))]
    pub(super) fn run(&self) -> Result<Output> {
        Err(lanesweep_engine::no_gpu("lanesweep devices"))
    }
}

#[cfg(feature = "gpu")]
const NOTHING: &str = "No compute device: no driver of Vulkan, Metal or Direct3D 12 shows one.
A GPU needs its vendor's driver with Vulkan (on Debian for AMD and Intel: libvulkan1 mesa-vulkan-drivers).
Software, for tests: libvulkan1 mesa-vulkan-drivers (Debian), which brings llvmpipe.
In a container the GPU and its graphics driver must be passed in (NVIDIA_DRIVER_CAPABILITIES=all).
";
