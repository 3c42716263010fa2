//! Selects the device of `--backend auto|cpu|gpu` and `--device INDEX|pci:BUS|NAME`.
//!
//! A software rasterizer runs on the same cores as the CPU backend, but slower, so it must be named.

use super::adapters::{AdapterCard, DeviceKind};
use crate::device_choice::BackendChoice;
use lanesweep_support::{Error, Place, Result, option};

/// The index of the device to use, or `None` for the CPU.
///
/// `cards` have the order of [`super::Adapters`]. The order of preference is discrete, virtual, integrated. Software
/// rasterizers and devices of unknown kind must be named.
///
/// # Errors
/// [`Error::Usage`]: a device together with `Cpu`; a name of no device or of several. [`Error::Device`]: `Gpu`
/// without a GPU.
pub fn choose(cards: &[AdapterCard], backend: BackendChoice, device: Option<&str>) -> Result<Option<usize>> {
    match (backend, device) {
        (BackendChoice::Cpu, _) => backend.check(device).map(|()| None),
        (_, Some(device)) => named(cards, device).map(|card| Some(card.index)),
        (BackendChoice::Auto, None) => Ok(first_real(cards).map(|card| card.index)),
        (BackendChoice::Gpu, None) => first_real(cards).map(|card| Some(card.index)).ok_or_else(|| no_gpu(cards)),
    }
}

fn first_real(cards: &[AdapterCard]) -> Option<&AdapterCard> {
    let rank = |card: &AdapterCard| match card.kind {
        DeviceKind::Discrete => 0,
        DeviceKind::Virtual => 1,
        _ => 2,
    };
    // The first of equals: `cards` has the preferred interface first.
    cards.iter().filter(|card| card.is_real()).min_by_key(|card| rank(card))
}

fn named<'a>(cards: &'a [AdapterCard], device: &str) -> Result<&'a AdapterCard> {
    let all = matching(cards, device);
    let Some(&first) = all.first() else {
        let problem = format!("no device of this machine matches `{device}`");
        return Err(Error::usage(Place::option("device"), problem, list(cards.iter())));
    };
    if all.iter().any(|card| !same_device(first, card)) {
        let problem = format!("`{device}` matches more than one device");
        return Err(Error::usage(Place::option("device"), problem, list(all.into_iter())));
    }
    Ok(first)
}

/// All matching cards, the preferred interface first: by their position, by the PCI bus id with or without its
/// domain (`nvidia-smi` writes `00000000:65:00.0`), or by a part of the name. A complete name has priority: `NVIDIA L4` does not
/// match `NVIDIA L40`.
fn matching<'a>(cards: &'a [AdapterCard], device: &str) -> Vec<&'a AdapterCard> {
    let device = device.trim().to_lowercase();
    let such = |test: &dyn Fn(&AdapterCard) -> bool| cards.iter().filter(|card| test(card)).collect::<Vec<_>>();
    if let Ok(index) = device.parse::<usize>() {
        return such(&|card| card.index == index);
    }
    if let Some(bus) = device.strip_prefix("pci:") {
        // The domain may be missing, or have more zeros.
        let is_at = |own: &String| {
            let is_same = bus.trim_start_matches('0') == own.trim_start_matches('0');
            bus.contains(':') && (is_same || own.ends_with(&format!(":{bus}")))
        };
        return such(&|card| card.pci_bus_id.as_ref().is_some_and(is_at));
    }
    let complete = such(&|card| card.name.to_lowercase() == device);
    let is_part = |card: &AdapterCard| !device.is_empty() && card.name.to_lowercase().contains(&device);
    if complete.is_empty() { such(&is_part) } else { complete }
}

/// Whether two cards are one physical device. The bus id decides; without it, the same name under another interface.
fn same_device(a: &AdapterCard, b: &AdapterCard) -> bool {
    match (&a.pci_bus_id, &b.pci_bus_id) {
        _ if a.index == b.index => true,
        (Some(a), Some(b)) => a == b,
        _ => a.api != b.api && a.name == b.name,
    }
}

fn list<'a>(cards: impl Iterator<Item = &'a AdapterCard>) -> String {
    let lines: Vec<String> = cards.map(AdapterCard::one_line).collect();
    if lines.is_empty() {
        return "this machine has none; `lanesweep devices` says what to install".to_owned();
    }
    format!("name one by its index or PCI bus id:\n{}", lines.join("\n"))
}

fn no_gpu(cards: &[AdapterCard]) -> Error {
    let named = match cards.first() {
        Some(card) => format!(", or name a device: {}", option(&format!("device = {}", card.index))),
        None => String::new(),
    };
    Error::device(
        option("backend = gpu"),
        "the drivers of this machine show no GPU",
        format!("`lanesweep devices` lists all devices; use {}{named}", option("backend = cpu")),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Api;

    fn card(index: usize, name: &str, kind: DeviceKind, api: Api, bus: Option<&str>) -> AdapterCard {
        AdapterCard {
            index,
            name: name.to_owned(),
            kind,
            api,
            driver: "driver".to_owned(),
            driver_info: String::new(),
            pci_bus_id: bus.map(str::to_owned),
            vendor: 0,
            device: 0,
            timestamps: true,
            exact_path: api == Api::Vulkan,
            float_controls: api == Api::Vulkan,
        }
    }

    const A: &str = "0000:17:00.0";
    const B: &str = "0000:65:00.0";
    const INTEGRATED: &str = "0000:00:02.0";

    /// An integrated GPU, two equal discrete GPUs and llvmpipe; one of the GPUs and llvmpipe also under DX12.
    fn workstation() -> Vec<AdapterCard> {
        vec![
            card(0, "Intel(R) UHD Graphics 770", DeviceKind::Integrated, Api::Vulkan, Some(INTEGRATED)),
            card(1, "NVIDIA L40", DeviceKind::Discrete, Api::Vulkan, Some(A)),
            card(2, "NVIDIA L40", DeviceKind::Discrete, Api::Vulkan, Some(B)),
            card(3, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Software, Api::Vulkan, None),
            card(4, "NVIDIA L40", DeviceKind::Other, Api::Dx12, None),
            card(5, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Software, Api::Dx12, None),
        ]
    }

    fn software_only() -> Vec<AdapterCard> {
        vec![card(0, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Software, Api::Vulkan, None)]
    }

    fn says(error: Error) -> String {
        format!("{error}; {}", error.help().unwrap())
    }

    fn auto(cards: &[AdapterCard]) -> Option<usize> {
        choose(cards, BackendChoice::Auto, None).unwrap()
    }

    #[test]
    fn automatic_choice_prefers_discrete_to_virtual_to_integrated() {
        let mut cards = workstation();
        assert_eq!(auto(&cards), Some(1));
        cards[1].kind = DeviceKind::Virtual;
        assert_eq!(auto(&cards), Some(2));
        cards[2].kind = DeviceKind::Software;
        assert_eq!(auto(&cards), Some(1));
        cards[1].kind = DeviceKind::Other;
        assert_eq!(auto(&cards), Some(0));
    }

    #[test]
    fn the_preferred_interface_of_a_device_is_taken() {
        let twice = [
            card(0, "NVIDIA L4", DeviceKind::Discrete, Api::Vulkan, Some(A)),
            card(1, "NVIDIA L4", DeviceKind::Discrete, Api::Dx12, Some(A)),
        ];
        assert_eq!(auto(&twice), Some(0));
        for device in ["L4", "pci:17:00.0", "PCI:00000000:17:00.0"] {
            assert_eq!(choose(&twice, BackendChoice::Gpu, Some(device)).unwrap(), Some(0), "{device}");
        }
        assert_eq!(choose(&twice, BackendChoice::Gpu, Some("1")).unwrap(), Some(1));
    }

    #[test]
    fn software_and_unknown_kinds_are_never_taken_unnamed() {
        let unknown = [card(0, "something", DeviceKind::Other, Api::Dx12, None)];
        for cards in [&software_only()[..], &unknown, &[]] {
            assert_eq!(auto(cards), None);
            let error = choose(cards, BackendChoice::Gpu, None).unwrap_err();
            assert!(matches!(error, Error::Device { .. }), "{error}");
            assert!(says(error).contains("this machine show no GPU"));
        }
        let software = software_only();
        for device in ["0", "llvmpipe", "LLVMPIPE (llvm"] {
            for backend in [BackendChoice::Auto, BackendChoice::Gpu] {
                assert_eq!(choose(&software, backend, Some(device)).unwrap(), Some(0), "{device}");
            }
        }
    }

    #[test]
    fn the_processor_takes_no_device() {
        let cards = workstation();
        assert_eq!(choose(&cards, BackendChoice::Cpu, None).unwrap(), None);
        let error = choose(&cards, BackendChoice::Cpu, Some("L40")).unwrap_err();
        assert!(matches!(error, Error::Usage { .. }) && says(error).contains("leave out one of the two"));
    }

    #[test]
    fn a_name_of_several_devices_is_an_error_that_tells_them_apart() {
        let cards = workstation();
        let error = choose(&cards, BackendChoice::Auto, Some("l40")).unwrap_err();
        assert!(matches!(error, Error::Usage { .. }));
        let text = says(error);
        for part in ["more than one", "1: NVIDIA L40", "pci:0000:17:00.0", "2: NVIDIA L40", "pci:0000:65:00.0"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!text.contains("llvmpipe"), "{text}");
        assert_eq!(choose(&cards, BackendChoice::Auto, Some("pci:65:00.0")).unwrap(), Some(2));
        assert_eq!(choose(&cards, BackendChoice::Auto, Some("uhd")).unwrap(), Some(0));
    }

    #[test]
    fn the_same_device_under_another_interface_is_no_second_device() {
        let mut cards = workstation();
        assert_eq!(choose(&cards, BackendChoice::Gpu, Some("llvmpipe")).unwrap(), Some(3));
        cards.remove(2);
        assert_eq!(choose(&cards, BackendChoice::Gpu, Some("NVIDIA")).unwrap(), Some(1));
    }

    #[test]
    fn a_complete_name_means_no_longer_one() {
        let cards = [
            card(0, "NVIDIA L4", DeviceKind::Discrete, Api::Vulkan, Some(B)),
            card(1, "NVIDIA L40", DeviceKind::Discrete, Api::Vulkan, Some(A)),
        ];
        assert_eq!(choose(&cards, BackendChoice::Auto, Some("nvidia l4")).unwrap(), Some(0));
        assert!(choose(&cards, BackendChoice::Auto, Some("L4")).is_err());
    }

    #[test]
    fn a_name_of_nothing_lists_the_devices() {
        for device in ["radeon", "6", "pci:aa:00.0", "pci:5:00.0", "pci:00.0", "pci:0", "pci:", ""] {
            let error = choose(&workstation(), BackendChoice::Auto, Some(device)).unwrap_err();
            assert!(matches!(error, Error::Usage { .. }));
            let text = says(error);
            assert!(text.contains(&format!("`{}`", device)) && text.contains("3: llvmpipe"), "{text}");
        }
        let error = choose(&[], BackendChoice::Gpu, Some("0")).unwrap_err();
        assert!(says(error).contains("this machine has none"));
    }
}
