//! Selects the device of `--backend auto|cpu|gpu` and `--device INDEX|pci:BUS|NAME`.
//!
//! A software rasterizer runs on the same cores as the CPU backend, but slower, so it must be named.

use super::adapters::{AdapterCard, DeviceKind};
use crate::engine::device_choice::{BackendChoice, DeviceName};
use crate::{Error, Place, Result};

/// The index of the device to use, or `None` for the CPU.
///
/// `cards` have the order of [`super::Adapters`]. `visible` has the PCI bus ids that the environment allows
/// (`visible()`), in order of preference; it hides every other GPU. Without it the order is discrete,
/// virtual, integrated. Software rasterizers and devices of unknown kind must be named.
///
/// # Errors
/// [`Error::Usage`]: a device together with `Cpu`; a name of no device or of several. [`Error::Device`]: `Gpu`
/// without a usable GPU; a named device that the environment hides.
pub fn choose(
    cards: &[AdapterCard],
    backend: BackendChoice,
    device: Option<&DeviceName>,
    visible: Option<&[String]>,
) -> Result<Option<usize>> {
    match (backend, device) {
        (BackendChoice::Cpu, _) => backend.check(device).map(|()| None),
        (_, Some(device)) => named(cards, device, visible).map(|card| Some(card.index)),
        (BackendChoice::Auto, None) => Ok(first_real(cards, visible).map(|card| card.index)),
        (BackendChoice::Gpu, None) => match first_real(cards, visible) {
            Some(card) => Ok(Some(card.index)),
            None => Err(no_gpu(cards, visible)),
        },
    }
}

fn first_real<'a>(cards: &'a [AdapterCard], visible: Option<&[String]>) -> Option<&'a AdapterCard> {
    let rank = |card: &AdapterCard| match (visible, card.kind) {
        (Some(visible), _) => {
            visible.iter().position(|bus| Some(bus) == card.pci_bus_id.as_ref()).unwrap_or(usize::MAX)
        }
        (None, DeviceKind::Discrete) => 0,
        (None, DeviceKind::Virtual) => 1,
        (None, _) => 2,
    };
    // The first of equals: `cards` has the preferred interface first.
    cards.iter().filter(|card| card.is_real() && !card.is_hidden_by(visible)).min_by_key(|card| rank(card))
}

fn named<'a>(cards: &'a [AdapterCard], device: &DeviceName, visible: Option<&[String]>) -> Result<&'a AdapterCard> {
    let all = matching(cards, device);
    let Some(&any) = all.first() else {
        let problem = format!("no device of this machine matches `{device}`");
        return Err(Error::usage(Place::option("device"), problem, list(cards.iter())));
    };
    let usable: Vec<&AdapterCard> = all.iter().copied().filter(|card| !card.is_hidden_by(visible)).collect();
    let Some(&first) = usable.first() else {
        let allowed = match visible {
            Some(visible) if !visible.is_empty() => format!("allows only pci:{}", visible.join(", pci:")),
            _ => "hides every GPU".to_owned(),
        };
        return Err(Error::device(
            any.one_line(),
            format!("the environment (CUDA_VISIBLE_DEVICES or Slurm's GPU list) hides this device; it {allowed}"),
            "name a device that it allows, or change the variable if the device is yours to use",
        ));
    };
    if usable.iter().any(|card| !same_device(first, card)) {
        let problem = format!("`{device}` matches more than one device");
        return Err(Error::usage(Place::option("device"), problem, list(usable.into_iter())));
    }
    Ok(first)
}

/// All matching cards, the preferred interface first. A complete name has priority: `NVIDIA L4` does not match
/// `NVIDIA L40`.
fn matching<'a>(cards: &'a [AdapterCard], device: &DeviceName) -> Vec<&'a AdapterCard> {
    match device {
        DeviceName::Index(index) => cards.iter().filter(|card| card.index == *index).collect(),
        DeviceName::Pci(bus) => cards.iter().filter(|card| card.pci_bus_id.as_ref() == Some(bus)).collect(),
        DeviceName::Name(name) => {
            let name = name.to_lowercase();
            let such = |test: &dyn Fn(&str) -> bool| -> Vec<&AdapterCard> {
                cards.iter().filter(|card| test(&card.name.to_lowercase())).collect()
            };
            let complete = such(&|n| n == name);
            if complete.is_empty() { such(&|n| n.contains(&name)) } else { complete }
        }
    }
}

/// Whether two cards are one physical device. The bus id decides; without it, the same name under another interface
/// (OpenGL appends to it: `NVIDIA L4/PCIe/SSE2`).
fn same_device(a: &AdapterCard, b: &AdapterCard) -> bool {
    match (&a.pci_bus_id, &b.pci_bus_id) {
        _ if a.index == b.index => true,
        (Some(a), Some(b)) => a == b,
        _ => a.api != b.api && (a.name.starts_with(&b.name) || b.name.starts_with(&a.name)),
    }
}

fn list<'a>(cards: impl Iterator<Item = &'a AdapterCard>) -> String {
    let lines: Vec<String> = cards.map(AdapterCard::one_line).collect();
    if lines.is_empty() {
        return "this machine has none; `lanesweep verify devices` says what to install".to_owned();
    }
    format!("name one by its index or PCI bus id:\n{}", lines.join("\n"))
}

fn no_gpu(cards: &[AdapterCard], visible: Option<&[String]>) -> Error {
    let real: Vec<&AdapterCard> = cards.iter().filter(|card| card.is_real()).collect();
    if real.is_empty() {
        let named = match cards.first() {
            Some(card) => format!(", or name a device: option `device = {}`", card.index),
            None => String::new(),
        };
        return Error::device(
            "option `backend = gpu`",
            "the drivers of this machine show no GPU",
            format!("`lanesweep verify devices` lists all devices; use option `backend = cpu`{named}"),
        );
    }
    Error::device(
        "option `backend = gpu`",
        format!(
            "the environment (CUDA_VISIBLE_DEVICES or Slurm's GPU list) hides {}",
            if real.len() == 1 { "the only GPU" } else { "every GPU" }
        ),
        match visible {
            Some(visible) if !visible.is_empty() => format!(
                "it allows pci:{}, which the graphics driver does not show: see `lanesweep verify devices`, or use \
                 option `backend = cpu`",
                visible.join(", pci:")
            ),
            _ => "ask the cluster for a GPU, or use option `backend = cpu`".to_owned(),
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::gpu::{AdapterLimits, Api};

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
            limits: AdapterLimits {
                max_buffer_size: 1 << 30,
                max_storage_buffer_binding_size: 1 << 27,
                max_compute_workgroups_per_dimension: 65535,
                max_compute_invocations_per_workgroup: 256,
            },
            timestamps: true,
            exact_path: api == Api::Vulkan,
            float_controls: api == Api::Vulkan,
        }
    }

    const A: &str = "0000:17:00.0";
    const B: &str = "0000:65:00.0";
    const INTEGRATED: &str = "0000:00:02.0";

    /// An integrated GPU, two equal discrete GPUs and llvmpipe; one of the GPUs and llvmpipe also under OpenGL.
    fn workstation() -> Vec<AdapterCard> {
        vec![
            card(0, "Intel(R) UHD Graphics 770", DeviceKind::Integrated, Api::Vulkan, Some(INTEGRATED)),
            card(1, "NVIDIA L40", DeviceKind::Discrete, Api::Vulkan, Some(A)),
            card(2, "NVIDIA L40", DeviceKind::Discrete, Api::Vulkan, Some(B)),
            card(3, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Software, Api::Vulkan, None),
            card(4, "NVIDIA L40/PCIe/SSE2", DeviceKind::Other, Api::Gl, None),
            card(5, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Software, Api::Gl, None),
        ]
    }

    fn software_only() -> Vec<AdapterCard> {
        vec![card(0, "llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Software, Api::Vulkan, None)]
    }

    fn ids(buses: &[&str]) -> Vec<String> {
        buses.iter().map(|b| (*b).to_owned()).collect()
    }

    fn name(text: &str) -> DeviceName {
        text.parse().unwrap()
    }

    fn says(error: Error) -> String {
        format!("{error}; {}", error.help().unwrap())
    }

    fn auto(cards: &[AdapterCard], visible: Option<&[String]>) -> Option<usize> {
        choose(cards, BackendChoice::Auto, None, visible).unwrap()
    }

    #[test]
    fn automatic_choice_prefers_discrete_to_virtual_to_integrated() {
        let mut cards = workstation();
        assert_eq!(auto(&cards, None), Some(1));
        cards[1].kind = DeviceKind::Virtual;
        assert_eq!(auto(&cards, None), Some(2));
        cards[2].kind = DeviceKind::Software;
        assert_eq!(auto(&cards, None), Some(1));
        cards[1].kind = DeviceKind::Other;
        assert_eq!(auto(&cards, None), Some(0));
    }

    #[test]
    fn the_preferred_interface_of_a_device_is_taken() {
        let twice = [
            card(0, "NVIDIA L4", DeviceKind::Discrete, Api::Vulkan, Some(A)),
            card(1, "NVIDIA L4", DeviceKind::Discrete, Api::Dx12, Some(A)),
        ];
        assert_eq!(auto(&twice, None), Some(0));
        for device in ["L4", "pci:17:00.0"] {
            assert_eq!(choose(&twice, BackendChoice::Gpu, Some(&name(device)), None).unwrap(), Some(0), "{device}");
        }
        assert_eq!(choose(&twice, BackendChoice::Gpu, Some(&name("1")), None).unwrap(), Some(1));
    }

    #[test]
    fn software_and_unknown_kinds_are_never_taken_unnamed() {
        let unknown = [card(0, "something", DeviceKind::Other, Api::Gl, None)];
        for cards in [&software_only()[..], &unknown, &[]] {
            assert_eq!(auto(cards, None), None);
            assert_eq!(auto(cards, Some(&ids(&[A]))), None);
            let error = choose(cards, BackendChoice::Gpu, None, None).unwrap_err();
            assert!(matches!(error, Error::Device { .. }), "{error}");
            assert!(says(error).contains("this machine show no GPU"));
        }
        let software = software_only();
        for device in ["0", "llvmpipe", "LLVMPIPE (llvm"] {
            for backend in [BackendChoice::Auto, BackendChoice::Gpu] {
                assert_eq!(choose(&software, backend, Some(&name(device)), None).unwrap(), Some(0), "{device}");
            }
        }
    }

    #[test]
    fn the_processor_takes_no_device() {
        let cards = workstation();
        assert_eq!(choose(&cards, BackendChoice::Cpu, None, None).unwrap(), None);
        let error = choose(&cards, BackendChoice::Cpu, Some(&name("L40")), None).unwrap_err();
        assert!(matches!(error, Error::Usage { .. }) && says(error).contains("leave out one of the two"));
    }

    #[test]
    fn a_name_of_several_devices_is_an_error_that_tells_them_apart() {
        let cards = workstation();
        let error = choose(&cards, BackendChoice::Auto, Some(&name("l40")), None).unwrap_err();
        assert!(matches!(error, Error::Usage { .. }));
        let text = says(error);
        for part in ["more than one", "1: NVIDIA L40", "pci:0000:17:00.0", "2: NVIDIA L40", "pci:0000:65:00.0"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!text.contains("llvmpipe"), "{text}");
        assert_eq!(choose(&cards, BackendChoice::Auto, Some(&name("pci:65:00.0")), None).unwrap(), Some(2));
        assert_eq!(choose(&cards, BackendChoice::Auto, Some(&name("uhd")), None).unwrap(), Some(0));
    }

    #[test]
    fn the_same_device_under_another_interface_is_no_second_device() {
        let mut cards = workstation();
        assert_eq!(choose(&cards, BackendChoice::Gpu, Some(&name("llvmpipe")), None).unwrap(), Some(3));
        cards.remove(2);
        assert_eq!(choose(&cards, BackendChoice::Gpu, Some(&name("NVIDIA")), None).unwrap(), Some(1));
    }

    #[test]
    fn a_complete_name_means_no_longer_one() {
        let cards = [
            card(0, "NVIDIA L4", DeviceKind::Discrete, Api::Vulkan, Some(B)),
            card(1, "NVIDIA L40", DeviceKind::Discrete, Api::Vulkan, Some(A)),
        ];
        assert_eq!(choose(&cards, BackendChoice::Auto, Some(&name("nvidia l4")), None).unwrap(), Some(0));
        assert!(choose(&cards, BackendChoice::Auto, Some(&name("L4")), None).is_err());
    }

    #[test]
    fn a_name_of_nothing_lists_the_devices() {
        for device in ["radeon", "6", "pci:aa:00.0"] {
            let error = choose(&workstation(), BackendChoice::Auto, Some(&name(device)), None).unwrap_err();
            assert!(matches!(error, Error::Usage { .. }));
            let text = says(error);
            assert!(text.contains(&format!("`{}`", name(device))) && text.contains("3: llvmpipe"), "{text}");
        }
        let error = choose(&[], BackendChoice::Gpu, Some(&name("0")), None).unwrap_err();
        assert!(says(error).contains("this machine has none"));
    }

    #[test]
    fn the_environment_allows_and_orders() {
        let cards = workstation();
        assert_eq!(auto(&cards, Some(&ids(&[B]))), Some(2));
        assert_eq!(auto(&cards, Some(&ids(&[B, A]))), Some(2));
        assert_eq!(auto(&cards, Some(&ids(&[A, B]))), Some(1));
        assert_eq!(auto(&cards, Some(&ids(&[INTEGRATED, B]))), Some(0), "its order counts, not the kind");
        assert_eq!(auto(&cards, Some(&ids(&["0000:ff:00.0", B]))), Some(2));
        let one = choose(&cards, BackendChoice::Gpu, Some(&name("L40")), Some(&ids(&[B]))).unwrap();
        assert_eq!(one, Some(2), "the other twin is hidden, so the name is clear");
    }

    #[test]
    fn a_hidden_device_is_not_taken_even_when_it_is_named() {
        let cards = workstation();
        for device in ["1", "pci:17:00.0", "4"] {
            let error = choose(&cards, BackendChoice::Auto, Some(&name(device)), Some(&ids(&[B]))).unwrap_err();
            assert!(matches!(error, Error::Device { .. }));
            let text = says(error);
            assert!(text.contains("hides this device; it allows only pci:0000:65:00.0"), "{text}");
        }
        let software = choose(&cards, BackendChoice::Auto, Some(&name("3")), Some(&[])).unwrap();
        assert_eq!(software, Some(3), "the environment speaks of GPUs only");
    }

    #[test]
    fn an_empty_list_hides_every_gpu() {
        let cards = workstation();
        assert_eq!(auto(&cards, Some(&[])), None);
        let error = choose(&cards, BackendChoice::Gpu, None, Some(&[])).unwrap_err();
        assert!(matches!(error, Error::Device { .. }) && says(error).contains("hides every GPU"));
        let error = choose(&cards, BackendChoice::Gpu, None, Some(&ids(&["0000:ff:00.0"]))).unwrap_err();
        assert!(says(error).contains("it allows pci:0000:ff:00.0, which the graphics driver does not show"));
    }
}
