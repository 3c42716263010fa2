//! Values of `--backend`. Also parsed and checked in programs built without a GPU.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use lanesweep_support::{Error, Place, Result, option};

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
    pub fn check(self, device: Option<&str>) -> Result<()> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_backend_is_one_of_three_words() {
        let parsed = ["auto", "cpu", "gpu"].map(|word| word.parse::<BackendChoice>().unwrap());
        assert_eq!(parsed, [BackendChoice::Auto, BackendChoice::Cpu, BackendChoice::Gpu]);
        assert!("cuda".parse::<BackendChoice>().unwrap_err().help().unwrap().contains("auto, cpu, gpu"));
    }
}
