//! The list of `lanesweep verify devices`: every card, and the selected one.

use std::fmt::Write;

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table, presets};
use serde_json::json;

use super::format::FormatFlag;
use super::{Exit, Output};
use crate::Result;
use crate::engine::BackendChoice;
use crate::engine::gpu::{AdapterCard, Adapters, GpuBackend, GpuOptions, choose, visible_here};
use crate::engine::verify::self_check;
use crate::report::records::document;
use crate::report::tables::{WIDTH, wrap};

/// The list.
///
/// # Errors
/// If the environment cannot be parsed.
pub(super) fn list(format: &FormatFlag, no_self_check: bool) -> Result<Output> {
    let adapters = Adapters::enumerate();
    let seen = Seen::new(adapters.cards(), visible_here());
    let self_check = |index: usize| if no_self_check { "-".to_owned() } else { check(&adapters, index) };
    let output = format.output(Exit::Ok, || seen.text(&self_check), || seen.json(&self_check))?;
    // The list helps to correct the environment, so it is printed first.
    seen.visible.map(|_| output)
}

/// Checks some thousand lanes on the device against the CPU; returns the result in a word.
fn check(adapters: &Adapters, index: usize) -> String {
    let opened = GpuBackend::open(adapters, index, GpuOptions::default());
    match opened.and_then(|gpu| self_check(&gpu)) {
        Ok(check) if check.differing == 0 => format!("{} lanes equal", check.lanes),
        Ok(check) => format!("{} of {} differ", check.differing, check.lanes),
        Err(error) => format!("failed: {error}"),
    }
}

/// The devices, with the environment's restrictions.
struct Seen<'a> {
    cards: &'a [AdapterCard],
    /// PCI bus ids that the environment allows; `None` if it sets no restriction.
    visible: Result<Option<Vec<String>>>,
    /// The device that `--backend auto` selects; `None` is the CPU.
    auto: Option<usize>,
}

impl<'a> Seen<'a> {
    fn new(cards: &'a [AdapterCard], visible: Result<Option<Vec<String>>>) -> Self {
        let auto = match &visible {
            // `auto` can only fail if a device is named.
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
        let verdict: String = self.verdict().lines().map(|line| wrap(line, WIDTH) + "\n").collect();
        let mut text = format!("{table}\n{verdict}");
        if !self.cards.is_empty() {
            text += LEGEND;
        }
        text
    }

    fn table(&self, self_check: &dyn Fn(usize) -> String) -> String {
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH as u16);
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
        // Names and drivers may wrap; a bus id must stay whole for copying.
        for at in [0, 2, 3, 5, 6, 7, 8] {
            if let Some(column) = table.column_mut(at) {
                column.set_constraint(ColumnConstraint::ContentWidth);
            }
        }
        if let Some(column) = table.column_mut(0) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        format!("{table}\n")
    }

    /// Which device `--backend auto` selects, and why; which devices the environment hides.
    fn verdict(&self) -> String {
        let visible = match &self.visible {
            Ok(visible) => visible.as_deref(),
            Err(_) => {
                return "--backend auto selects no device: the environment is invalid (see the error).".to_owned();
            }
        };
        let real = self.cards.iter().filter(|card| card.is_real()).count();
        let hidden = self.cards.iter().filter(|card| card.is_real() && self.hides(card)).count();
        let mut text = match self.auto.and_then(|index| self.cards.get(index)) {
            Some(card) => {
                let why = match (visible, real - hidden) {
                    (_, 1) => "the only GPU",
                    (Some(_), _) => "the first one that the environment allows",
                    (None, _) => "the first GPU, discrete before virtual before integrated",
                };
                format!("--backend auto selects {}: {why}.", card.one_line())
            }
            None => {
                let why = match (real, hidden, self.cards.first()) {
                    (0, _, None) => "there is no device",
                    (0, _, Some(_)) => "no GPU; other devices are used only when --device names one",
                    _ => "the environment hides every GPU",
                };
                format!("--backend auto selects the CPU: {why}.")
            }
        };
        if let Some(visible) = visible {
            let allowed = match visible {
                [] => "no GPU".to_owned(),
                some => format!("pci:{}", some.join(", pci:")),
            };
            let _ = write!(
                text,
                "\nThe environment (CUDA_VISIBLE_DEVICES or Slurm's GPU list) allows {allowed}; hidden: {hidden} of \
                 {real} GPUs."
            );
            let shown = |bus: &String| self.cards.iter().any(|card| card.pci_bus_id.as_ref() == Some(bus));
            for bus in visible.iter().filter(|bus| !shown(bus)) {
                let _ = write!(text, "\nNo driver shows pci:{bus} here: a CUDA driver alone does not include Vulkan.");
            }
        }
        text
    }

    fn json(&self, self_check: &dyn Fn(usize) -> String) -> Result<String> {
        let mut devices = Vec::new();
        for card in self.cards {
            let mut device = json!(card);
            device["hidden"] = self.hides(card).into();
            device["self_check"] = self_check(card.index).into();
            devices.push(device);
        }
        document(&json!({
            "devices": devices,
            "auto": self.auto,
            "auto_reason": self.verdict(),
            "visible": self.visible.as_ref().ok(),
        }))
    }
}

const LEGEND: &str = "limits: maximum buffer; maximum buffer binding; workgroups along an axis; lanes in a workgroup.
exact: no float operation may be contracted or reordered, so results equal the CPU's bit for bit;
elsewhere the self-check decides. self-check: random lanes and lanes on thresholds, word for word.
timing: the device can time its own work.
";

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

/// A size in the largest binary unit in which it is at least 1, rounded to integers: drivers report sizes just below a
/// power of two.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;
    use crate::engine::gpu::{AdapterLimits, Api, DeviceKind};

    fn card(index: usize, name: &str, kind: DeviceKind, bus: Option<&str>) -> AdapterCard {
        AdapterCard {
            index,
            name: name.to_owned(),
            kind,
            api: Api::Vulkan,
            driver: "a driver with a long name".to_owned(),
            driver_info: "and a version 575.57.08 that is long too (LLVM 15.0.6)".to_owned(),
            pci_bus_id: bus.map(str::to_owned),
            vendor: 0x10de,
            device: 0x2335,
            limits: AdapterLimits {
                max_buffer_size: u64::MAX,
                max_storage_buffer_binding_size: (1 << 31) - 4,
                max_compute_workgroups_per_dimension: 2_147_483_647,
                max_compute_invocations_per_workgroup: 1024,
            },
            timestamps: true,
            exact_path: index == 0,
            float_controls: index == 0,
        }
    }

    const A: &str = "0000:17:00.0";
    const B: &str = "0000:65:00.0";

    fn node() -> Vec<AdapterCard> {
        vec![
            card(0, "NVIDIA H200 NVL with a name that no line of a terminal would hold", DeviceKind::Discrete, Some(A)),
            card(1, "NVIDIA H200", DeviceKind::Discrete, Some(B)),
            card(2, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Software, None),
        ]
    }

    fn text(cards: &[AdapterCard], visible: Result<Option<Vec<String>>>) -> String {
        let text = Seen::new(cards, visible).text(&|index| format!("bit for bit equal, {index} of 3 tables"));
        for line in text.lines() {
            assert!(line.chars().count() <= WIDTH, "{} columns: {line}", line.chars().count());
        }
        text
    }

    fn allowed(buses: &[&str]) -> Result<Option<Vec<String>>> {
        Ok(Some(buses.iter().map(|b| (*b).to_owned()).collect()))
    }

    #[test]
    fn long_names_fit_and_bus_ids_stay_whole() {
        let text = text(&node(), Ok(None));
        assert!(text.contains(A) && text.contains(B), "{text}");
        assert!(text.contains("binding 2 GiB") && text.contains("buffer 16 EiB"), "{text}");
        assert!(text.contains("--backend auto selects 0: NVIDIA H200 NVL"), "{text}");
    }

    #[test]
    fn what_the_environment_hides_is_said() {
        let one = text(&node(), allowed(&[B]));
        assert!(
            one.contains("auto selects 1: NVIDIA H200 (discrete, Vulkan, pci:0000:65:00.0): the only GPU"),
            "{one}"
        );
        assert!(one.contains("allows pci:0000:65:00.0; hidden: 1 of 2 GPUs"), "{one}");
        assert_eq!(one.matches("hidden ").count(), 1, "one row is marked: {one}");
        let none = text(&node(), allowed(&[]));
        assert!(none.contains("selects the CPU: the environment hides every GPU"), "{none}");
        assert!(none.contains("allows no GPU; hidden: 2 of 2 GPUs"), "{none}");
    }

    #[test]
    fn an_allowed_gpu_that_no_driver_shows_is_named() {
        let text = text(&node()[2..], allowed(&[B]));
        assert!(text.contains("No driver shows pci:0000:65:00.0 here"), "{text}");
    }

    #[test]
    fn software_alone_leaves_the_work_to_the_cpu() {
        let text = text(&node()[2..], Ok(None));
        assert!(text.contains("selects the CPU: no GPU; other devices are used only when --device"), "{text}");
    }

    #[test]
    fn an_environment_that_is_not_understood_still_shows_the_devices() {
        let error = || Err(crate::Error::usage(Place::item("CUDA_VISIBLE_DEVICES"), "there is no GPU 9", "unset it"));
        let text = text(&node(), error());
        assert!(text.contains(A) && text.contains("--backend auto selects no device"), "{text}");
        let nodes = node();
        let json = Seen::new(&nodes, error()).json(&|_| "-".to_owned()).unwrap();
        let seen: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!((&seen["auto"], &seen["visible"]), (&serde_json::Value::Null, &serde_json::Value::Null));
    }

    #[test]
    fn json_holds_the_whole_card() {
        let nodes = node();
        let json = Seen::new(&nodes, allowed(&[B])).json(&|index| format!("check {index}")).unwrap();
        let seen: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(seen["auto"], 1);
        assert_eq!(seen["visible"], serde_json::json!([B]));
        let first = &seen["devices"][0];
        assert_eq!((&first["pci_bus_id"], &first["hidden"]), (&A.into(), &true.into()));
        assert_eq!((&first["kind"], &first["api"]), (&"discrete".into(), &"Vulkan".into()));
        assert_eq!(first["limits"]["max_buffer_size"], u64::MAX);
        assert_eq!((&first["exact_path"], &first["self_check"]), (&true.into(), &"check 0".into()));
    }

    #[test]
    fn sizes_are_whole_numbers_of_the_largest_unit() {
        let sizes = [0, 1023, 128 << 20, (1 << 31) - 1, (1 << 40) - 1, u64::MAX];
        assert_eq!(sizes.map(bytes), ["0 B", "1023 B", "128 MiB", "2 GiB", "1 TiB", "16 EiB"]);
    }
}
