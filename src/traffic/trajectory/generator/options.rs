//! Options of the synthetic recordings. The defaults are those of a study without data.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::behaviour::Behaviour;
use crate::support::error::Result;
use crate::support::ranges;

/// Options of the generator. `lanesweep study` without data uses the default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GeneratorOptions {
    /// Seed of every random number. Same seed and options, same bits.
    pub seed: u64,
    /// Number of generated recordings. They are called `01`, `02`, ….
    #[schemars(range(min = 1, max = 99))]
    pub recordings: usize,
    /// Length of each recording, s.
    #[schemars(range(min = 1.0, max = 7200.0))]
    pub duration_s: f64,
    /// Samples per second; the simulation step is the largest fraction of a sample ≤ 0.04 s.
    #[schemars(range(min = 1.0, max = 200.0))]
    pub frame_rate_hz: f64,
    /// Length of road that the camera sees, m.
    #[schemars(range(min = 50.0, max = 5000.0))]
    pub window_m: f64,
    /// Mean flow per direction of travel, vehicles per hour, for roads with the default mix of two and
    /// three lanes (published: 3,350).
    #[schemars(range(min = 60.0, max = 4500.0))]
    pub flow_vehph: f64,
    /// Share of trucks among all vehicles, 0 to 0.5 (published: about 0.2).
    #[schemars(range(min = 0.0, max = 0.5))]
    pub truck_fraction: f64,
    /// Factor on the rates of lane changes and hard braking in the camera's view.
    /// 1 stands for the published rates, which the traffic meets in part (`docs/src/validation.md`). The default gives as
    /// many kept cut-outs as the paper has, more cut-ins and LVDs, in a third of highD's time. A larger one disturbs the
    /// traffic: vehicles brake for lane changes of others.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub event_rate_factor: f64,
    /// How scenarios arise.
    pub behaviour: Behaviour,
}

impl Default for GeneratorOptions {
    fn default() -> Self {
        GeneratorOptions {
            seed: 20_240_901,
            recordings: 84,
            duration_s: 245.0,
            frame_rate_hz: 25.0,
            window_m: 420.0,
            flow_vehph: 3350.0,
            truck_fraction: 0.2,
            event_rate_factor: 3.0,
            behaviour: Behaviour::default(),
        }
    }
}

impl GeneratorOptions {
    /// Checks every option; the error names the first one outside its range.
    pub fn validate(&self) -> Result<()> {
        ranges::check("generator", self)
    }

    /// Simulation steps per sample: the minimum with a step of at most 0.04 s.
    pub(super) fn steps_per_sample(&self) -> usize {
        // The small term keeps 25 Hz at one step although 0.04 is not exact in binary.
        ((25.0 / self.frame_rate_hz - 1e-9).ceil() as usize).max(1)
    }

    /// Samples per recording.
    pub(super) fn samples(&self) -> usize {
        (self.duration_s * self.frame_rate_hz).round() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_valid_and_a_bad_option_is_named() {
        GeneratorOptions::default().validate().unwrap();
        let error = GeneratorOptions { duration_s: f64::NAN, ..GeneratorOptions::default() }.validate().unwrap_err();
        assert!(error.to_string().contains("duration_s"), "{error}");
        let error = GeneratorOptions { recordings: 0, ..GeneratorOptions::default() }.validate().unwrap_err();
        assert!(error.to_string().contains("recordings"), "{error}");
    }

    #[test]
    fn a_sample_is_split_until_the_step_is_short_enough() {
        let steps =
            |frame_rate_hz| GeneratorOptions { frame_rate_hz, ..GeneratorOptions::default() }.steps_per_sample();
        assert_eq!(steps(25.0), 1);
        assert_eq!(steps(10.0), 3);
        assert_eq!(steps(50.0), 1);
        assert_eq!(steps(30.0), 1);
        assert_eq!(steps(1.0), 25);
    }
}
