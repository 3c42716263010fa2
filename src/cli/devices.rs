//! `lanesweep devices`: what this machine can compute on.

use std::fmt::Write;

use clap::Args;
use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

use super::{Exit, console};
use crate::gpu::{AdapterCard, Adapters, BackendChoice, choose, visible_here};
use crate::{Error, Result};

/// Columns of a terminal that the table fits in.
const WIDTH: u16 = 120;

/// List the compute devices and tell which one is used
///
/// Every device of every driver, with its limits, and the one that `--backend auto` takes. CUDA_VISIBLE_DEVICES
/// and Slurm's GPU list are honoured.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep devices --json")]
pub struct Devices {
    /// Write JSON instead of a table
    #[arg(long)]
    json: bool,
}

impl Devices {
    pub fn run(&self) -> Result<Exit> {
        let adapters = Adapters::enumerate();
        let seen = Seen::new(adapters.cards(), visible_here());
        let self_check = |_: usize| "-".to_owned();
        console::print(&if self.json { seen.json(&self_check)? } else { seen.text(&self_check) })?;
        // The list helps to correct the environment, so it comes first.
        seen.visible.map(|_| Exit::Ok)
    }
}

/// The devices in the light of the environment.
struct Seen<'a> {
    cards: &'a [AdapterCard],
    /// PCI bus ids that the environment allows; `None` where it says nothing.
    visible: Result<Option<Vec<String>>>,
    /// What `--backend auto` takes; `None` is the processor.
    auto: Option<usize>,
}

impl<'a> Seen<'a> {
    fn new(cards: &'a [AdapterCard], visible: Result<Option<Vec<String>>>) -> Self {
        let auto = match &visible {
            // Without a device named there is nothing that `auto` could refuse.
            Ok(visible) => choose(cards, BackendChoice::Auto, None, visible.as_deref()).unwrap_or(None),
            Err(_) => None,
        };
        Seen { cards, visible, auto }
    }

    /// Whether the environment hides the card.
    fn hides(&self, card: &AdapterCard) -> bool {
        self.visible.as_ref().is_ok_and(|visible| card.is_hidden_by(visible.as_deref()))
    }

    fn text(&self, self_check: &dyn Fn(usize) -> String) -> String {
        let table = if self.cards.is_empty() { NOTHING.to_owned() } else { self.table(self_check) };
        let mut text = format!("{table}\n{}\n", self.verdict());
        if self.cards.iter().any(|card| !card.exact_path) {
            text += "exact: the device computes with the processor's rounding, so results can be equal bit for bit; \
                     without it the\nself-check decides.\n";
        }
        text
    }

    fn table(&self, self_check: &dyn Fn(usize) -> String) -> String {
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
        table.set_header([
            "",
            "name",
            "kind",
            "API",
            "driver",
            "PCI bus id",
            "limits",
            "exact",
            "timing",
            "self-check",
        ]);
        let yes = |it: bool| if it { "yes" } else { "no" }.to_owned();
        for card in self.cards {
            let mut kind = card.kind.label().to_owned();
            if self.hides(card) {
                kind += "\nhidden";
            }
            table.add_row([
                card.index.to_string(),
                card.name.clone(),
                kind,
                card.api.label().to_owned(),
                [&card.driver[..], &card.driver_info].join("\n").trim().to_owned(),
                card.pci_bus_id.clone().unwrap_or_else(|| "-".to_owned()),
                limits(card),
                yes(card.exact_path),
                yes(card.timestamps),
                self_check(card.index),
            ]);
        }
        if let Some(column) = table.column_mut(0) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        format!("{table}\n")
    }

    /// Which device `--backend auto` takes, and why; what the environment hides.
    fn verdict(&self) -> String {
        let visible = match &self.visible {
            Ok(visible) => visible.as_deref(),
            Err(_) => return "--backend auto takes nothing: the environment cannot be understood (below).".to_owned(),
        };
        let real = self.cards.iter().filter(|card| card.is_real()).count();
        let hidden = self.cards.iter().filter(|card| card.is_real() && self.hides(card)).count();
        let mut text = match self.auto.and_then(|index| self.cards.get(index)) {
            Some(card) => {
                let why = match (visible, real - hidden) {
                    (_, 1) => "the only GPU",
                    (Some(_), _) => "the first that the environment allows",
                    (None, _) => "the first GPU, discrete before virtual before integrated",
                };
                format!("--backend auto takes {}: {why}.", card.one_line())
            }
            None => {
                let why = match (real, hidden, self.cards.first()) {
                    (0, _, None) => "there is no device",
                    (0, _, Some(_)) => {
                        "there is no GPU; software and unknown devices are used only when --device names one"
                    }
                    _ => "the environment hides every GPU",
                };
                format!("--backend auto takes the processor: {why}.")
            }
        };
        if let Some(visible) = visible {
            let allowed = match visible {
                [] => "no GPU".to_owned(),
                some => format!("pci:{}", some.join(", pci:")),
            };
            let _ = write!(
                text,
                "\nThe environment (CUDA_VISIBLE_DEVICES or Slurm's GPU list) allows {allowed} and hides {hidden} of {real} \
                 GPUs."
            );
        }
        text
    }

    fn json(&self, self_check: &dyn Fn(usize) -> String) -> Result<String> {
        let not_written = |e| Error::Internal(format!("the devices cannot be written: {e}"));
        let mut devices = Vec::new();
        for card in self.cards {
            let mut device = serde_json::to_value(card).map_err(not_written)?;
            device["hidden"] = self.hides(card).into();
            device["self_check"] = self_check(card.index).into();
            devices.push(device);
        }
        let seen = serde_json::json!({
            "devices": devices,
            "auto": self.auto,
            "auto_reason": self.verdict(),
            "visible": self.visible.as_ref().ok(),
        });
        serde_json::to_string_pretty(&seen).map(|text| text + "\n").map_err(not_written)
    }
}

const NOTHING: &str = "No compute device: no driver of Vulkan, Metal, Direct3D 12 or OpenGL shows one.
A GPU needs its vendor's driver with Vulkan (on Debian for AMD and Intel: libvulkan1 mesa-vulkan-drivers).
Software, for tests: libvulkan1 mesa-vulkan-drivers (Debian), which brings llvmpipe.
In a container the GPU and its graphics driver must be passed in (NVIDIA_DRIVER_CAPABILITIES=all).
";

fn limits(card: &AdapterCard) -> String {
    let l = &card.limits;
    format!(
        "buffer {}\nbinding {}\n{} groups\nof {}",
        bytes(l.max_buffer_size),
        bytes(l.max_storage_buffer_binding_size),
        l.max_compute_workgroups_per_dimension,
        l.max_compute_invocations_per_workgroup
    )
}

/// A size in the largest binary unit that leaves at least 1; drivers name sizes just below a power of two, so whole
/// numbers are rounded.
fn bytes(size: u64) -> String {
    const UNITS: [&str; 7] = ["B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"];
    let mut unit = 0;
    let mut value = size as f64;
    while value.round() >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.0} {}", UNITS[unit])
}
