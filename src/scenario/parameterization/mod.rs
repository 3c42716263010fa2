//! Parameterizations: from a mined scenario to the cases that are simulated.
//!
//! Here live S (the scenario as recorded), the kinematic parameterizations and the reduction by singular
//! value decomposition. Here lives nothing about headways, models or verdicts. Scenarios come from
//! [`crate::scenario`]; cases go to [`crate::engine`].
//!
//! To add a parameterization: a line in [`ParameterizationId::ALL`], its case in the category's file.

mod cut_in;
mod cut_out;
mod lvd;
mod modes;
mod options;
mod recorded;
mod reduction;
mod series;
mod sizes;
mod svd;

pub use cut_in::CutInParameters;
pub use cut_out::CutOutParameters;
pub use lvd::LvdParameters;
pub use modes::ModeShape;
pub use options::{
    AfterDuration, LateralSpeed, LateralStart, ParameterizationOptions, SeriesScale, SvdFit, SvdLateral,
};
pub use recorded::recorded_case;
pub use reduction::{MIN_DURATION_S, ReducedScenario, Reduction};
pub use series::TimeGrid;
pub(crate) use series::steps_of;
pub use sizes::{Sizes, VehicleSize};
pub use svd::{SvdBasis, fit_svd};

use crate::scenario::{Case, Category, Scenario};
use crate::{Error, Place, Result};

/// How a parameterization describes a scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// By physical parameters.
    Kinematic,
    /// By this many coefficients of a singular value decomposition.
    Svd(usize),
}

/// One of the paper's parameterizations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ParameterizationId {
    /// Kind of scenario.
    pub category: Category,
    /// Name in the paper: `1`…`7`, `a`…`g`, `i`…`v`.
    pub key: &'static str,
    /// How it describes a scenario.
    pub kind: Kind,
    /// Number of parameters without the headway.
    pub parameters: usize,
    /// One line: what is kept.
    pub description: &'static str,
}

const fn id(
    category: Category,
    key: &'static str,
    kind: Kind,
    parameters: usize,
    description: &'static str,
) -> ParameterizationId {
    ParameterizationId { category, key, kind, parameters, description }
}

impl ParameterizationId {
    /// The registry: all 19, in the order of every table.
    pub const ALL: [ParameterizationId; 19] = [
        id(Category::CutIn, "1", Kind::Kinematic, 3, "constant speed, constant lateral speed"),
        id(Category::CutIn, "2", Kind::Kinematic, 4, "constant acceleration, constant lateral speed"),
        id(Category::CutIn, "3", Kind::Kinematic, 2, "constant speed, instantaneous lane change"),
        id(Category::CutIn, "4", Kind::Kinematic, 3, "constant acceleration, instantaneous lane change"),
        id(Category::CutIn, "5", Kind::Svd(3), 3, "SVD, 3 coefficients"),
        id(Category::CutIn, "6", Kind::Svd(4), 4, "SVD, 4 coefficients"),
        id(Category::CutIn, "7", Kind::Svd(5), 5, "SVD, 5 coefficients"),
        id(Category::CutOut, "a", Kind::Kinematic, 5, "constant speeds, constant lateral speed"),
        id(Category::CutOut, "b", Kind::Kinematic, 7, "constant accelerations, constant lateral speed"),
        id(Category::CutOut, "c", Kind::Kinematic, 4, "constant speeds, instantaneous lane change"),
        id(Category::CutOut, "d", Kind::Kinematic, 6, "constant accelerations, instantaneous lane change"),
        id(Category::CutOut, "e", Kind::Svd(3), 3, "SVD, 3 coefficients"),
        id(Category::CutOut, "f", Kind::Svd(5), 5, "SVD, 5 coefficients"),
        id(Category::CutOut, "g", Kind::Svd(7), 7, "SVD, 7 coefficients"),
        id(Category::Lvd, "i", Kind::Kinematic, 3, "constant deceleration"),
        id(Category::Lvd, "ii", Kind::Kinematic, 3, "sinusoidal deceleration"),
        id(Category::Lvd, "iii", Kind::Svd(3), 3, "SVD, 3 coefficients"),
        id(Category::Lvd, "iv", Kind::Svd(4), 4, "SVD, 4 coefficients"),
        id(Category::Lvd, "v", Kind::Svd(5), 5, "SVD, 5 coefficients"),
    ];

    /// Those of one category, in order.
    pub fn of(category: Category) -> impl Iterator<Item = ParameterizationId> {
        Self::ALL.into_iter().filter(move |p| p.category == category)
    }

    /// By category and name.
    pub fn find(category: Category, key: &str) -> Option<ParameterizationId> {
        Self::of(category).find(|p| p.key == key)
    }

    /// The case of a scenario under a kinematic parameterization; an error for one that needs a fit.
    pub fn kinematic_case(
        &self,
        scenario: &Scenario,
        grid: impl Into<TimeGrid>,
        options: &ParameterizationOptions,
    ) -> Result<Case> {
        if self.kind != Kind::Kinematic || scenario.category != self.category {
            return Err(Error::Internal(format!(
                "{} is not a kinematic parameterization of {}",
                self.key, scenario.id
            )));
        }
        let sizes = Sizes::of(scenario);
        match self.category {
            Category::CutIn => CutInParameters::of(scenario, options).case(self.key, &sizes, options),
            Category::CutOut => CutOutParameters::of(scenario, options)?.case(self.key, &sizes, options),
            Category::Lvd => LvdParameters::of(scenario).case(self.key, &sizes, grid, options),
        }
    }
}

/// The vehicle ahead of a cut-out and its gap; a scenario without them cannot be simulated.
pub(crate) fn vehicle_ahead(scenario: &Scenario) -> Result<(&crate::scenario::Other, f64)> {
    match (&scenario.lead, scenario.lead_gap) {
        (Some(lead), Some(gap)) => Ok((lead, gap)),
        _ => Err(Error::input(
            Place::item(format!("scenario {}", scenario.id)),
            "a cut-out needs the vehicle ahead of the cutting-out one",
            "give `lead` with its series and `D`, or leave this scenario out (`kept: false`)",
        )),
    }
}

/// The size of the vehicle ahead, which the case of a cut-out cannot do without.
fn lead_size(sizes: &Sizes) -> Result<VehicleSize> {
    sizes.lead.ok_or_else(|| {
        Error::input(
            Place::item("sizes"),
            "a cut-out needs the size of the vehicle ahead of the cutting-out one",
            "give the length and width of `lead`",
        )
    })
}
