//! Named options where the paper is silent or leaves a choice; defaults are the specification's.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use lanesweep_support::{Result, config_tables, ranges};

/// What a constant acceleration does after the scenario's duration T.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AfterDuration {
    /// The speed is held: only this reproduces the paper's ordering.
    Hold,
    /// The acceleration goes on.
    Unlimited,
}

/// Which lateral speed a constant one stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum LateralSpeed {
    /// |y(0) − y(T)|/T: higher F1 on real cut-ins.
    Mean,
    /// Mean of the first 0.4 s.
    Initial,
}

/// Where a cut-in with constant lateral speed starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LateralStart {
    /// At 3.5 m (the paper).
    LaneWidth,
    /// Where the recorded one started.
    Recorded,
}

/// Weight of a series in the decomposition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SeriesScale {
    /// 1/(n_t σ̄), as published.
    PerInstant,
    /// 1/(sqrt(n_t) σ̄): a series counts as much as an extra.
    PerSeries,
}

/// Sign of the lateral series in the decomposition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SvdLateral {
    /// Left positive, as published; the reconstruction is mirrored by the recorded side.
    Signed,
    /// Positive on the side the target comes from or leaves to; the series' unit is its root mean square distance from
    /// the lane's centre, which is the spread of as many left as right ones.
    Mirrored,
}

/// Which scenarios the decomposition is fitted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SvdFit {
    /// Those that passed the filters.
    Kept,
    /// All mined ones that can be simulated.
    All,
}

config_tables! {
    /// Options of all parameterizations.
    pub struct ParameterizationOptions {
        /// Constant acceleration after T (2, 4, b, d).
        pub after_duration: AfterDuration = AfterDuration::Hold,
        /// Constant lateral speed (1, 2, a, b).
        pub lateral_speed: LateralSpeed = LateralSpeed::Mean,
        /// Start of 1 and 2.
        pub lateral_start: LateralStart = LateralStart::LaneWidth,
        /// Lateral distance of a lane change, m (3.5).
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        pub lane_change_m: f64 = 3.5,
        /// Minimum lateral speed, m/s (1e-3).
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        #[serde(alias = "least_lateral_speed_mps")] // in density files of earlier builds
        pub min_lateral_speed_mps: f64 = 1e-3,
        /// LVD ii: 0 samples the sinusoid itself at every step; n > 0 joins n + 1 points of it by lines, as an
        /// independent implementation does with 200 (largest effect on a speed: Δ·π²/(16 n²)).
        #[schemars(range(max = 1_000_000))]
        pub sinusoid_intervals: usize = 0,
        /// n_t: instants of a series in the decomposition (50).
        #[schemars(range(min = 2, max = 10_000))]
        pub svd_instants: usize = 50,
        /// Weight of a series.
        pub series_scale: SeriesScale = SeriesScale::PerInstant,
        /// Sign of the lateral series.
        pub svd_lateral: SvdLateral = SvdLateral::Signed,
        /// Scenarios the decomposition is fitted on.
        pub svd_fit: SvdFit = SvdFit::Kept,
    }
}

impl ParameterizationOptions {
    /// Defaults for densities: `svd_lateral` is [`SvdLateral::Mirrored`]. With left-positive series, kernels around
    /// left and right scenarios would reach into the ego's lane between them.
    pub fn of_densities() -> ParameterizationOptions {
        ParameterizationOptions { svd_lateral: SvdLateral::Mirrored, ..ParameterizationOptions::default() }
    }

    /// Checks the ranges.
    pub fn validate(&self) -> Result<()> {
        ranges::check("parameterization", self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn density_files_of_earlier_builds_keep_their_least_lateral_speed() {
        let options: ParameterizationOptions = serde_json::from_str(r#"{"least_lateral_speed_mps": 0.25}"#).unwrap();
        assert_eq!(options.min_lateral_speed_mps, 0.25);
    }
}
