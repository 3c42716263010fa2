//! Values of `--backend` and `--device`. Also parsed and checked in programs built without a GPU.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use lanesweep_support::{Error, Place, Result, option};

/// A device as a user names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DeviceName {
    /// Position in the list of `lanesweep devices`.
    Index(usize),
    /// Place on the PCI bus, as `pci_bus_id` writes it.
    Pci(String),
    /// A part of the device's name, in any case.
    Name(String),
}

impl FromStr for DeviceName {
    type Err = Error;

    /// # Errors
    /// [`Error::Usage`] for an empty text, or for `pci:` without a bus id.
    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        let help = "write the index, a part of the name or pci:BUS of a device; `lanesweep devices` lists them";
        if text.is_empty() {
            return Err(Error::usage(Place::option("device"), "no device is named", help));
        }
        if text.bytes().all(|b| b.is_ascii_digit()) {
            let index = text.parse().map_err(|_| {
                Error::usage(Place::option("device"), format!("`{text}` is larger than any index"), help)
            })?;
            return Ok(DeviceName::Index(index));
        }
        if text.get(..4).is_some_and(|prefix| prefix.eq_ignore_ascii_case("pci:")) {
            let bus = pci_bus_id(text).ok_or_else(|| {
                let problem = format!("`{text}` is no PCI bus id such as pci:0000:65:00.0");
                Error::usage(Place::option("device"), problem, help)
            })?;
            return Ok(DeviceName::Pci(bus));
        }
        Ok(DeviceName::Name(text.to_owned()))
    }
}

impl fmt::Display for DeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DeviceName::Index(index) => write!(f, "{index}"),
            DeviceName::Pci(bus) => write!(f, "pci:{bus}"),
            DeviceName::Name(name) => f.write_str(name),
        }
    }
}

/// What is to compute the lanes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BackendChoice {
    /// The first GPU; the processor where there is none.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// A GPU, or an error where there is none.
    Gpu,
}

impl FromStr for BackendChoice {
    type Err = Error;

    /// # Errors
    /// [`Error::Usage`] for any word except `auto`, `cpu` and `gpu`.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(BackendChoice::Auto),
            "cpu" => Ok(BackendChoice::Cpu),
            "gpu" => Ok(BackendChoice::Gpu),
            _ => {
                let or = format!("; a certain device: {}, see `lanesweep devices`", option("device"));
                Err(Error::unknown(Place::option("backend"), "backend", text, ["auto", "cpu", "gpu"], &or))
            }
        }
    }
}

impl BackendChoice {
    /// Refuses a device name together with the processor.
    ///
    /// # Errors
    /// [`Error::Usage`] with the name of the device.
    pub fn check(self, device: Option<&DeviceName>) -> Result<()> {
        match (self, device) {
            (BackendChoice::Cpu, Some(device)) => Err(Error::usage(
                Place::option("device"),
                format!("`{device}` is named, but {} uses no device", option("backend = cpu")),
                "leave out one of the two",
            )),
            _ => Ok(()),
        }
    }
}

/// The canonical form of a PCI bus id: `dddd:bb:dd.f`, hexadecimal, lower case.
///
/// Accepts what tools print: `65:00.0`, `0000:65:00.0`, `00000000:65:00.0`, with or without `pci:` and the function.
/// `None` if the text is not a PCI bus id.
pub(super) fn pci_bus_id(text: &str) -> Option<String> {
    let text = text.trim();
    let text = match text.get(..4) {
        Some(prefix) if prefix.eq_ignore_ascii_case("pci:") => &text[4..],
        _ => text,
    };
    let hex = |digits: &str, max: u32| {
        let plain = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_hexdigit());
        plain.then(|| u32::from_str_radix(digits, 16).ok()).flatten().filter(|&n| n <= max)
    };
    let parts: Vec<&str> = text.split(':').collect();
    let (domain, bus, rest) = match parts[..] {
        [domain, bus, rest] => (hex(domain, u32::MAX)?, bus, rest),
        [bus, rest] => (0, bus, rest),
        _ => return None,
    };
    let (device, function) = rest.split_once('.').unwrap_or((rest, "0"));
    let (bus, device, function) = (hex(bus, 0xff)?, hex(device, 0x1f)?, hex(function, 7)?);
    Some(format!("{domain:04x}:{bus:02x}:{device:02x}.{function:x}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> DeviceName {
        text.parse().unwrap()
    }

    #[test]
    fn a_bus_id_has_one_form_however_a_tool_prints_it() {
        for text in ["65:00.0", "0000:65:00.0", "00000000:65:00.0", "pci:0:65:0", "PCI:0000:65:00", " 0000:65:00.0\n"] {
            assert_eq!(pci_bus_id(text).as_deref(), Some("0000:65:00.0"), "{text}");
        }
        assert_eq!(pci_bus_id("10000:E1:1F.7").as_deref(), Some("10000:e1:1f.7"));
    }

    #[test]
    fn what_is_no_bus_id_gives_none() {
        for text in ["", "65", "0000:65:00.8", "0000:100:00.0", "0000:65:20.0", "x:65:00.0", "1:2:3:4", "+1:00.0", ":"]
        {
            assert_eq!(pci_bus_id(text), None, "{text}");
        }
    }

    #[test]
    fn a_backend_is_one_of_three_words() {
        let parsed = ["auto", "cpu", "gpu"].map(|word| word.parse::<BackendChoice>().unwrap());
        assert_eq!(parsed, [BackendChoice::Auto, BackendChoice::Cpu, BackendChoice::Gpu]);
        assert!("cuda".parse::<BackendChoice>().unwrap_err().help().unwrap().contains("auto, cpu, gpu"));
    }

    #[test]
    fn a_device_is_named_by_index_bus_id_or_part_of_its_name() {
        assert_eq!(name(" 12 "), DeviceName::Index(12));
        assert_eq!(name("PCI:65:00.0"), DeviceName::Pci("0000:65:00.0".to_owned()));
        assert_eq!(name("Radeon RX 7900"), DeviceName::Name("Radeon RX 7900".to_owned()));
        for device in ["12", "pci:0000:65:00.0", "Radeon"] {
            assert_eq!(name(device).to_string(), device);
        }
        for wrong in ["", "  ", "pci:", "pci:65", "99999999999999999999999"] {
            assert!(matches!(wrong.parse::<DeviceName>(), Err(Error::Usage { .. })), "{wrong:?}");
        }
    }
}
