//! Conversion of scenarios to vectors and back: cut-in 5–7 (y, v; v^e_0, T), cut-out e–g (y, v^c, v^l; v^e_0, D, T),
//! LVD iii–v (v; T). Mode shapes show the meaning of the directions of a decomposition.

use serde::{Deserialize, Serialize};

use super::Parameterization;
use super::options::{ParameterizationOptions, SvdLateral};
use super::parameter::{MIN_DURATION_S, Variable};
use super::series::{SeriesCase, TimeGrid, at};
use super::sizes::{Sizes, vehicle_ahead};
use super::svd::{SvdBasis, fit_svd};
use crate::scenario::{Case, Category, Scenario};
use lanesweep_support::{Error, Result};

/// A series in the vector of a decomposition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReducedSeries {
    /// Lateral position of the target, m.
    Lateral,
    /// Speed of the target, m/s.
    TargetSpeed,
    /// Speed of the vehicle ahead, m/s.
    LeadSpeed,
}

/// The layout of a category's vector: its series one after another, then single numbers, T last.
fn layout(category: Category) -> (&'static [ReducedSeries], &'static [Variable]) {
    use Variable::{Duration, EgoSpeed, LeadGap};
    match category {
        Category::CutIn => (&[ReducedSeries::Lateral, ReducedSeries::TargetSpeed], &[EgoSpeed, Duration]),
        Category::CutOut => (
            &[ReducedSeries::Lateral, ReducedSeries::TargetSpeed, ReducedSeries::LeadSpeed],
            &[EgoSpeed, LeadGap, Duration],
        ),
        Category::Lvd => (&[ReducedSeries::TargetSpeed], &[Duration]),
    }
}

/// A decomposition of one category's scenarios.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduction {
    /// Kind of scenario.
    pub category: Category,
    /// Weights, mean, directions.
    pub basis: SvdBasis,
    options: ParameterizationOptions,
}

/// A scenario reconstructed from few coefficients; within its physical range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedScenario {
    /// Lateral position of the target, m, > 0 on its side; empty in LVD.
    pub y: Vec<f64>,
    /// Speed of the target, m/s.
    pub v: Vec<f64>,
    /// Cut-out: speed of the vehicle ahead, m/s.
    pub v_lead: Vec<f64>,
    /// Initial speed of the ego, m/s.
    pub v_ego: f64,
    /// Cut-out: gap to the vehicle ahead, m.
    pub lead_gap_m: f64,
    /// Duration T, s.
    pub duration_s: f64,
}

impl Reduction {
    /// Fits the decomposition to scenarios of one category. Their number must exceed the maximum number of
    /// coefficients.
    pub fn fit(category: Category, scenarios: &[&Scenario], options: &ParameterizationOptions) -> Result<Reduction> {
        let rows = scenarios.iter().map(|s| vector(s, options)).collect::<Result<Vec<_>>>()?;
        let needed = Parameterization::max_coefficients(category);
        let name = format!("{} scenarios", category.label());
        let series = layout(category).0;
        let lateral = series.contains(&ReducedSeries::Lateral).then_some(options.svd_lateral);
        let of = (series.len(), lateral);
        let basis = fit_svd(&rows, of, options.svd_instants, needed, options.series_scale, &name)?;
        Ok(Reduction { category, basis, options: options.clone() })
    }

    /// A previously fitted decomposition, as a density file holds it.
    ///
    /// # Errors
    /// [`Error::Input`] if lengths do not match the category and the number of instants, a number is not finite, or a
    /// weight is not above 0.
    pub fn from_parts(category: Category, basis: SvdBasis, options: &ParameterizationOptions) -> Result<Reduction> {
        let (series, extras) = layout(category);
        let p = series.len() * options.svd_instants + extras.len();
        let wrong =
            |problem: String| Err(Error::input(lanesweep_support::Place::item("basis"), problem, "fit it again"));
        let lengths = [basis.weights.len(), basis.mean.len()].into_iter().chain(basis.directions.iter().map(Vec::len));
        if let Some(other) = lengths.into_iter().find(|&length| length != p) {
            return wrong(format!("a row of {other} numbers, where {} has {p}", category.label()));
        }
        let mut numbers = basis.mean.iter().chain(basis.directions.iter().flatten()).chain(&basis.singular_values);
        if numbers.any(|v| !v.is_finite()) || basis.weights.iter().any(|w| !(w.is_finite() && *w > 0.0)) {
            return wrong("a number is not finite or a weight is not above 0".to_owned());
        }
        Ok(Reduction { category, basis, options: options.clone() })
    }

    /// A mined scenario as the vector z: series at n_t equidistant points over [0, T], then the extras.
    pub fn vector(&self, scenario: &Scenario) -> Result<Vec<f64>> {
        vector(scenario, &self.options)
    }

    /// The first `d` coefficients of a mined scenario.
    pub fn coefficients(&self, scenario: &Scenario, d: usize) -> Result<Vec<f64>> {
        Ok(self.basis.coefficients(&self.vector(scenario)?, d))
    }

    /// The scenario reconstructed from its first `d` coefficients.
    pub(crate) fn reduce(&self, scenario: &Scenario, d: usize) -> Result<ReducedScenario> {
        Ok(self.rebuild(&self.coefficients(scenario, d)?, scenario.side.sign()))
    }

    /// The scenario reconstructed from coefficients. `side` is 1 for left and −1 for right: with [`SvdLateral::Signed`]
    /// the lateral series is left-positive and is multiplied by it.
    pub fn rebuild(&self, coefficients: &[f64], side: f64) -> ReducedScenario {
        self.scenario_of(&self.basis.reconstruct(coefficients), side)
    }

    /// One column of the reconstruction from coefficients, in its unit, before clamping; bit-identical to
    /// [`SvdBasis::reconstruct`].
    pub fn rebuilt_column(&self, coefficients: &[f64], column: usize) -> f64 {
        let mut weighted = self.basis.mean[column];
        for (c, direction) in coefficients.iter().zip(&self.basis.directions) {
            weighted += c * direction[column];
        }
        weighted / self.basis.weights[column]
    }

    /// First column of a series; `None` if the category lacks it.
    pub fn series_column(&self, series: ReducedSeries) -> Option<usize> {
        let at = layout(self.category).0.iter().position(|s| *s == series)?;
        Some(at * self.options.svd_instants)
    }

    /// Column of a variable; `None` if the vector lacks it. In LVD the ego starts at the leader's speed.
    pub fn column(&self, variable: Variable) -> Option<usize> {
        let (series, extras) = layout(self.category);
        match extras.iter().position(|v| *v == variable) {
            Some(at) => Some(series.len() * self.options.svd_instants + at),
            None if variable == Variable::EgoSpeed => self.series_column(ReducedSeries::TargetSpeed),
            None => None,
        }
    }

    /// Converts a vector to a scenario: mirrors it back and limits it to the physical range.
    fn scenario_of(&self, z: &[f64], side: f64) -> ReducedScenario {
        let mirror = match self.options.svd_lateral {
            SvdLateral::Signed => side,
            SvdLateral::Mirrored => 1.0,
        };
        let series =
            |series| self.series_column(series).map_or(&[][..], |first| &z[first..first + self.options.svd_instants]);
        let speeds = |of| series(of).iter().map(|v| v.max(0.0)).collect::<Vec<f64>>();
        let number = |variable| self.column(variable).map_or(0.0, |column| z[column]);
        ReducedScenario {
            y: series(ReducedSeries::Lateral).iter().map(|y| y * mirror).collect(),
            v: speeds(ReducedSeries::TargetSpeed),
            v_lead: speeds(ReducedSeries::LeadSpeed),
            v_ego: number(Variable::EgoSpeed).max(0.0),
            lead_gap_m: number(Variable::LeadGap).max(0.0),
            duration_s: number(Variable::Duration).max(MIN_DURATION_S),
        }
    }

    /// The case of a scenario reduced to `d` coefficients, with the scenario's sizes.
    pub(crate) fn case(&self, scenario: &Scenario, d: usize, grid: impl Into<TimeGrid>) -> Result<Case> {
        self.reduce(scenario, d)?.case(self.category, &Sizes::of(scenario), grid.into())
    }
}

impl ReducedScenario {
    /// The case on a time grid: the samples of each series are equidistant over [0, T].
    ///
    /// # Errors
    /// [`Error::Input`] for a cut-out without the size of the vehicle ahead.
    pub fn case(&self, category: Category, sizes: &Sizes, grid: TimeGrid) -> Result<Case> {
        SeriesCase {
            category,
            y: &self.y,
            v: &self.v,
            lead: (category == Category::CutOut).then_some((self.v_lead.as_slice(), self.lead_gap_m)),
            ego_speed_mps: self.v_ego,
            fps: (self.v.len() - 1) as f64 / self.duration_s,
            duration_s: self.duration_s,
        }
        .on(grid, sizes)
    }
}

/// Converts a scenario to a vector: series at n_t equidistant points over [0, T], then the extras.
fn vector(scenario: &Scenario, options: &ParameterizationOptions) -> Result<Vec<f64>> {
    let n = options.svd_instants;
    if n < 2 {
        let (problem, help) = (format!("{n} instants cannot describe a series"), "use 50, as published");
        return Err(Error::usage(lanesweep_support::Place::item("svd_instants"), problem, help));
    }
    let duration_s = scenario.duration_s();
    let sample = |series: &[f64], sign: f64| -> Vec<f64> {
        (0..n).map(|k| sign * at(series, scenario.fps, duration_s * k as f64 / (n - 1) as f64)).collect()
    };
    let sign = match options.svd_lateral {
        SvdLateral::Signed => scenario.side.sign(),
        SvdLateral::Mirrored => 1.0,
    };
    let target = &scenario.target;
    let (series, extras) = layout(scenario.category);
    let mut z = Vec::with_capacity(series.len() * n + extras.len());
    for series in series {
        z.extend(match series {
            ReducedSeries::Lateral => sample(&target.y, sign),
            ReducedSeries::TargetSpeed => sample(&target.v, 1.0),
            ReducedSeries::LeadSpeed => sample(&vehicle_ahead(scenario)?.0.v, 1.0),
        });
    }
    for extra in extras {
        z.push(extra.of(scenario, options)?);
    }
    Ok(z)
}
