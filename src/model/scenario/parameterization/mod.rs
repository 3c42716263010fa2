//! Parameterizations: from a mined scenario to a point, and from a scenario or a point to the simulated case.
//!
//! This module holds S (the scenario as recorded), the kinematic parameterizations and the reduction by singular value
//! decomposition. It knows nothing about headways, models or verdicts. Scenarios come from [`crate::scenario`]; cases
//! go to the engine.
//!
//! A [`Parameterization`] is data: its parameters, description, encoding and decoding follow from its category and its
//! [`Family`]. To add one of an existing family: a line in [`Parameterization::ALL`].

mod kinematic;
mod options;
mod parameter;
mod reduction;
mod series;
mod sizes;
mod svd;

pub use kinematic::{Kinematic, LaneChange, SpeedProfile};
pub use options::{AfterDuration, LateralStart, ParameterizationOptions, SeriesScale, SvdFit, SvdLateral};
pub use parameter::{MAX_DURATION_S, MIN_DURATION_S, Parameter, Variable};
pub use reduction::{ReducedScenario, ReducedSeries, Reduction};
pub use series::steps_of;
pub use series::{TimeGrid, recorded_case};
pub(crate) use sizes::default_lane_width_m;
pub use sizes::vehicle_ahead;
pub use sizes::{Sizes, VehicleSize};
pub use svd::{SvdBasis, fit_svd};

use crate::scenario::{Case, Category, Scenario};
use lanesweep_support::{Error, Result};

/// How a parameterization represents a scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// By physical variables.
    Kinematic(Kinematic),
    /// By this many coefficients of a singular value decomposition.
    Svd(usize),
}

impl Family {
    /// `kinematic` or `SVD`.
    pub fn name(self) -> &'static str {
        match self {
            Family::Kinematic(_) => "kinematic",
            Family::Svd(_) => "SVD",
        }
    }
}

/// The specification of one parameterization.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Parameterization {
    /// Kind of scenario.
    pub category: Category,
    /// Name, unique in its category; in the paper `1`…`7`, `a`…`g`, `i`…`v`.
    pub key: &'static str,
    /// How it represents a scenario.
    pub family: Family,
}

const fn kinematic(
    category: Category,
    key: &'static str,
    speed: SpeedProfile,
    lane_change: LaneChange,
) -> Parameterization {
    let family = Family::Kinematic(Kinematic { speed, lane_change });
    Parameterization { category, key, family }
}

const fn svd(category: Category, key: &'static str, coefficients: usize) -> Parameterization {
    Parameterization { category, key, family: Family::Svd(coefficients) }
}

impl Parameterization {
    /// The paper's 19 parameterizations, in the order of every table.
    pub const ALL: [Parameterization; 19] = {
        use Category::{CutIn, CutOut, Lvd};
        use LaneChange::{Gradual, Instantaneous, None};
        use SpeedProfile::{Constant, ConstantAcceleration, Sinusoidal};
        [
            kinematic(CutIn, "1", Constant, Gradual),
            kinematic(CutIn, "2", ConstantAcceleration, Gradual),
            kinematic(CutIn, "3", Constant, Instantaneous),
            kinematic(CutIn, "4", ConstantAcceleration, Instantaneous),
            svd(CutIn, "5", 3),
            svd(CutIn, "6", 4),
            svd(CutIn, "7", 5),
            kinematic(CutOut, "a", Constant, Gradual),
            kinematic(CutOut, "b", ConstantAcceleration, Gradual),
            kinematic(CutOut, "c", Constant, Instantaneous),
            kinematic(CutOut, "d", ConstantAcceleration, Instantaneous),
            svd(CutOut, "e", 3),
            svd(CutOut, "f", 5),
            svd(CutOut, "g", 7),
            kinematic(Lvd, "i", ConstantAcceleration, None),
            kinematic(Lvd, "ii", Sinusoidal, None),
            svd(Lvd, "iii", 3),
            svd(Lvd, "iv", 4),
            svd(Lvd, "v", 5),
        ]
    };

    /// The parameterizations of one category, in order.
    pub fn of(category: Category) -> impl Iterator<Item = Parameterization> {
        Self::ALL.into_iter().filter(move |p| p.category == category)
    }

    /// Finds one by category and name.
    pub fn find(category: Category, key: &str) -> Option<Parameterization> {
        Self::of(category).find(|p| p.key == key)
    }

    /// Maximum number of SVD coefficients in a category.
    pub fn max_coefficients(category: Category) -> usize {
        Self::of(category).filter_map(|id| id.coefficients()).max().unwrap_or(0)
    }

    /// `cut-in 2`.
    pub fn name(&self) -> String {
        format!("{} {}", self.category.label(), self.key)
    }

    /// The kept features in one line.
    pub fn description(&self) -> String {
        match self.family {
            Family::Kinematic(features) => features.description(self.category),
            Family::Svd(coefficients) => format!("SVD, {coefficients} coefficients"),
        }
    }

    /// Number of SVD coefficients; `None` for a kinematic one, which needs no fit.
    pub fn coefficients(&self) -> Option<usize> {
        match self.family {
            Family::Kinematic(_) => None,
            Family::Svd(coefficients) => Some(coefficients),
        }
    }

    /// Features; `None` for SVD.
    pub fn features(&self) -> Option<Kinematic> {
        match self.family {
            Family::Kinematic(features) => Some(features),
            Family::Svd(_) => None,
        }
    }

    /// What each number of a point stands for; empty for SVD coefficients, which have no single variable.
    pub fn variables(&self) -> Vec<Variable> {
        self.features().map_or(Vec::new(), |features| features.variables(self.category))
    }

    /// Names, units and bounds of a point's numbers, without the headway.
    pub fn parameters(&self, options: &ParameterizationOptions) -> Vec<Parameter> {
        match self.family {
            Family::Svd(coefficients) => (0..coefficients).map(Parameter::coefficient).collect(),
            Family::Kinematic(_) => self.variables().into_iter().map(|v| v.parameter(self.category, options)).collect(),
        }
    }

    /// Number of parameters as the paper counts them: without the headway and without T.
    pub fn parameter_count(&self) -> usize {
        let variables = self.variables();
        self.coefficients().unwrap_or_else(|| variables.iter().filter(|v| **v != Variable::Duration).count())
    }

    /// Whether the cases hold a series per time step rather than a formula.
    pub fn has_series(&self) -> bool {
        self.features().is_none_or(|features| features.speed == SpeedProfile::Sinusoidal)
    }

    /// Encodes a mined scenario as a point; an SVD parameterization needs its decomposition.
    ///
    /// # Errors
    /// [`Error::Input`] for a cut-out without the vehicle ahead; [`Error::Internal`] for a scenario of another category
    /// or a missing decomposition.
    pub fn encode(
        &self,
        scenario: &Scenario,
        options: &ParameterizationOptions,
        reduction: Option<&Reduction>,
    ) -> Result<Vec<f64>> {
        self.check_scenario(scenario)?;
        match self.family {
            Family::Kinematic(_) => self.variables().into_iter().map(|v| v.of(scenario, options)).collect(),
            Family::Svd(coefficients) => self.needed(reduction)?.coefficients(scenario, coefficients),
        }
    }

    /// Decodes a valid point into a case; the caller gives the sizes.
    ///
    /// # Errors
    /// [`Error::Input`] for a cut-out without the size of the vehicle ahead; [`Error::Internal`] for a point of another
    /// length or a missing decomposition.
    pub fn decode(
        &self,
        point: &[f64],
        sizes: &Sizes,
        grid: impl Into<TimeGrid>,
        options: &ParameterizationOptions,
        reduction: Option<&Reduction>,
    ) -> Result<Case> {
        let expected = self.coefficients().unwrap_or_else(|| self.variables().len());
        if point.len() != expected {
            return Err(Error::Internal(format!("{}: {} numbers, expected {expected}", self.name(), point.len())));
        }
        match self.family {
            Family::Kinematic(features) => features.decode(self.category, point, sizes, grid.into(), options),
            // A point has no side, so its lateral series is not mirrored.
            Family::Svd(_) => self.needed(reduction)?.rebuild(point, 1.0).case(self.category, sizes, grid.into()),
        }
    }

    /// The case that replays a mined scenario from its point, with the recorded T, sizes and side.
    ///
    /// # Errors
    /// As [`encode`](Self::encode).
    pub fn case(
        &self,
        scenario: &Scenario,
        grid: impl Into<TimeGrid>,
        options: &ParameterizationOptions,
        reduction: Option<&Reduction>,
    ) -> Result<Case> {
        self.check_scenario(scenario)?;
        match self.family {
            Family::Kinematic(features) => features.replay(scenario, grid.into(), options),
            Family::Svd(coefficients) => self.needed(reduction)?.case(scenario, coefficients, grid),
        }
    }

    fn check_scenario(&self, scenario: &Scenario) -> Result<()> {
        if scenario.category == self.category {
            return Ok(());
        }
        Err(Error::Internal(format!("{} is no {}", scenario.id, self.category.label())))
    }

    /// The given decomposition, which an SVD needs.
    fn needed<'a>(&self, reduction: Option<&'a Reduction>) -> Result<&'a Reduction> {
        reduction.ok_or_else(|| Error::Internal(format!("{} needs a decomposition", self.name())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_names_and_descriptions_follow_from_the_features() {
        let summary = |category, key| {
            let id = Parameterization::find(category, key).unwrap();
            let parameters = id.parameters(&ParameterizationOptions::default());
            let names: Vec<String> = parameters.into_iter().map(|p| p.name).collect();
            format!("{}: {}: {}", id.parameter_count(), id.description(), names.join(" "))
        };
        let accelerations = "constant accelerations, instantaneous lane change";
        for (category, key, expected) in [
            (
                Category::CutIn,
                "2",
                "4: constant acceleration, constant lateral speed: \
                 v_target_mps lateral_speed_mps v_ego_mps acceleration_target_mps2 duration_s",
            ),
            (Category::CutIn, "3", "2: constant speed, instantaneous lane change: v_target_mps v_ego_mps"),
            (Category::CutIn, "5", "3: SVD, 3 coefficients: c1 c2 c3"),
            (
                Category::CutOut,
                "d",
                &format!(
                    "6: {accelerations}: v_target_mps v_ego_mps v_lead_mps gap_lead_m acceleration_target_mps2 \
                     acceleration_lead_mps2 duration_s"
                ),
            ),
            (Category::Lvd, "i", "3: constant deceleration: v0_mps v1_mps mean_deceleration_mps2"),
            (Category::Lvd, "ii", "3: sinusoidal deceleration: v0_mps v1_mps mean_deceleration_mps2"),
        ] {
            assert_eq!(summary(category, key), expected);
        }
    }
}
