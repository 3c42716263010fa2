//! The density of one category under one parameterization, with everything that sampling needs: valid region, P_valid,
//! sizes, exposure, and provenance.
//!
//! Exposure is the frequency of scenarios: events per driven hour and kilometre, with the Poisson interval.
//!
//! The driven time and distance are those of all egos: every vehicle is an ego once, from its first sample to the end
//! of its data set. Events are the kept scenarios of the category.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Gamma};

use super::bandwidth::BandwidthRule;
use super::kde::Kde;
use super::parameters::ParameterSpace;
use super::valid::{VALID_FRACTION_DRAWS, ValidFraction};
use lanesweep_model::scenario::parameterization::{
    Parameterization, ParameterizationOptions, Reduction, Sizes, SvdFit,
};
use lanesweep_model::scenario::{Category, DataProvenance, Driven, Scenario};
use lanesweep_support::{Error, Place, Result, option};

/// Provenance of a density.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Program and version that fitted it.
    pub program: String,
    /// The data in one line; states if the data is synthetic.
    pub data: String,
    /// No part of the data was measured on real traffic.
    pub synthetic: bool,
    /// SHA-256 of the scenarios as a scenario file, in hexadecimal.
    pub scenarios_sha256: String,
    /// Number of scenarios of the category that were found.
    pub found: u64,
    /// Number that the filters kept.
    pub kept: u64,
    /// Number of kept scenarios that were skipped because they are not points of the parameter space.
    pub left_out: u64,
}

/// Options of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// Options of the parameterization.
    pub parameterization: ParameterizationOptions,
    /// The observed headway is the last parameter.
    pub with_thw: bool,
    /// Interval of the bandwidth.
    pub rule: BandwidthRule,
    /// Number of draws for P_valid.
    pub valid_draws: u64,
    /// Seed of P_valid.
    pub seed: u64,
}

impl Default for FitOptions {
    fn default() -> Self {
        FitOptions {
            parameterization: ParameterizationOptions::of_densities(),
            with_thw: false,
            rule: BandwidthRule::Reduction,
            valid_draws: VALID_FRACTION_DRAWS,
            seed: 157,
        }
    }
}

/// A fitted density.
#[derive(Debug, Clone, PartialEq)]
pub struct DensityModel {
    /// Parameters, valid region, point → case.
    pub space: ParameterSpace,
    /// f̂ before truncation to the valid region: kernels around the recorded points.
    pub kde: Kde,
    /// Fraction of f̂ inside the valid region.
    pub valid: ValidFraction,
    /// Mean sizes of the scenarios that it was fitted on, because sizes are not parameters.
    pub sizes: Sizes,
    /// Events per hour and kilometre, if time or distance is known.
    pub exposure: Option<Exposure>,
    /// Where it comes from.
    pub provenance: Provenance,
    /// The scenarios in the order of the kernels; empty if the density does not contain them.
    pub scenarios: Vec<Scenario>,
}

/// A density, and the scenarios that it excludes.
pub struct Fitted {
    /// The density.
    pub model: DensityModel,
    /// One error per kept scenario that is not a point of the space.
    pub left_out: Vec<Error>,
}

impl DensityModel {
    /// Fits on the kept scenarios of the parameterization's category among `scenarios`.
    ///
    /// # Errors
    /// [`Error::Input`] if there are fewer than parameters + 1 kept scenarios, one parameter is equal in all of them,
    /// or no draw is valid; [`Error::Usage`] for options that give no parameter space.
    pub fn fit(
        id: Parameterization,
        scenarios: &[Scenario],
        facts: &DataProvenance,
        options: &FitOptions,
    ) -> Result<Fitted> {
        let of_category = || scenarios.iter().filter(|s| s.category == id.category);
        let kept: Vec<&Scenario> = of_category().filter(|s| s.kept).collect();
        let name = || id.name();
        if kept.is_empty() {
            // The same message for every parameterization of the category, so that it is reported once.
            let found = match of_category().count() {
                0 => "there is no such scenario".to_owned(),
                count => format!("none of {count} scenarios passed the filters"),
            };
            let others = Category::ALL.map(|c| (c, scenarios.iter().any(|s| s.kept && s.category == c)));
            let others: Vec<String> =
                others.iter().filter(|(_, is_kept)| *is_kept).map(|(c, _)| c.label().to_lowercase()).collect();
            let help = match others.is_empty() {
                true => format!("use more recordings, or relax the filters in the study file ({})", option("config")),
                false => {
                    let others = option(&format!("categories = {}", others.join(",")));
                    format!("use more recordings, or leave it out: {others}")
                }
            };
            return Err(Error::input(Place::item(id.category.label()), found, help));
        }
        let reduction = reduction(&id, scenarios, &kept, options)?;
        let space = ParameterSpace::new(id, &options.parameterization, reduction.as_ref(), options.with_thw)?;
        let (mut used, mut points, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
        for &scenario in &kept {
            let point = space.point(scenario).and_then(|p| match space.check(&p) {
                Ok(()) => Ok(p),
                Err(invalid) => Err(Error::input(
                    Place::item(format!("scenario {}", scenario.id)),
                    format!("no point of {}: {invalid}", name()),
                    "it is left out of the density",
                )),
            });
            match point {
                Ok(point) => {
                    points.push(point);
                    used.push(scenario);
                }
                Err(error @ Error::Input { .. }) => left_out.push(error),
                Err(error) => return Err(error),
            }
        }
        let names: Vec<&str> = space.parameters().iter().map(|p| p.name.as_str()).collect();
        let kde = Kde::fit(points, &names, options.rule).map_err(|error| named(error, &name()))?;
        let valid = ValidFraction::count(&kde, &space, options.valid_draws, options.seed);
        let valid = valid.map_err(|error| named(error, &name()))?;
        let Some(sizes) = Sizes::mean(used.iter().copied()) else {
            return Err(Error::Internal(format!("{}: a density without scenarios", name())));
        };
        let provenance = Provenance {
            program: format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
            data: facts.data.clone(),
            synthetic: facts.synthetic,
            scenarios_sha256: facts.scenarios_sha256.clone(),
            found: of_category().count() as u64,
            kept: kept.len() as u64,
            left_out: left_out.len() as u64,
        };
        let exposure = facts.driven.map(|driven| Exposure::new(kept.len() as u64, driven));
        let scenarios = used.into_iter().cloned().collect();
        let model = DensityModel { space, kde, valid, sizes, exposure, provenance, scenarios };
        Ok(Fitted { model, left_out })
    }

    /// The density with another bandwidth, in units of the scales, without its scenarios.
    ///
    /// # Errors
    /// As [`ValidFraction::count`].
    pub fn at_bandwidth(&self, value: f64) -> Result<DensityModel> {
        let kde = self.kde.at_bandwidth(value);
        let valid = ValidFraction::count(&kde, &self.space, VALID_FRACTION_DRAWS, self.valid.seed)?;
        let (space, sizes, exposure, provenance) =
            (self.space.clone(), self.sizes, self.exposure, self.provenance.clone());
        Ok(DensityModel { space, kde, valid, sizes, exposure, provenance, scenarios: Vec::new() })
    }

    /// Kind of scenario.
    pub fn category(&self) -> Category {
        self.space.id().category
    }
}

/// The decomposition, if the parameterization needs one.
fn reduction(
    id: &Parameterization,
    scenarios: &[Scenario],
    kept: &[&Scenario],
    options: &FitOptions,
) -> Result<Option<Reduction>> {
    if id.coefficients().is_none() {
        return Ok(None);
    }
    let fitted: Vec<&Scenario> = match options.parameterization.svd_fit {
        SvdFit::Kept => kept.to_vec(),
        SvdFit::All => {
            let of_category = scenarios.iter().filter(|s| s.category == id.category);
            of_category.filter(|s| id.category != Category::CutOut || s.lead.is_some()).collect()
        }
    };
    Reduction::fit(id.category, &fitted, &options.parameterization).map(Some)
}

/// The error with the parameterization's name as its place.
fn named(error: Error, name: &str) -> Error {
    match error {
        Error::Input { mut place, problem, help } => {
            place.item = Some(match place.item.take() {
                Some(item) if item != "density" => format!("{name}, {item}"),
                _ => name.to_owned(),
            });
            Error::Input { place, problem, help }
        }
        other => other,
    }
}

/// λ̂ = events per unit, with intervals of 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// Events per unit.
    pub estimate: f64,
    /// √n per unit: the standard deviation of a Poisson count, as published.
    pub standard_deviation: f64,
    /// Lower end of the exact (Garwood) interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Exposure to scenarios of one category.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Scenarios of the category that the filters kept.
    pub events: u64,
    /// Time and distance driven.
    pub driven: Driven,
    /// Per hour, where the hours are known.
    pub per_hour: Option<Rate>,
    /// Per kilometre, where the kilometres are known.
    pub per_kilometre: Option<Rate>,
}

impl Exposure {
    /// Exposure from a count, and the driven time and distance.
    pub fn new(events: u64, driven: Driven) -> Exposure {
        let rate = |units: Option<f64>| units.map(|units| Rate::new(events, units));
        Exposure { events, driven, per_hour: rate(driven.hours), per_kilometre: rate(driven.kilometres) }
    }
}

impl Rate {
    /// Rate of `events` in `units` hours or kilometres, > 0.
    pub(crate) fn new(events: u64, units: f64) -> Rate {
        let [low, high] = garwood(events, 0.95);
        let n = events as f64;
        Rate { estimate: n / units, standard_deviation: n.sqrt() / units, low: low / units, high: high / units }
    }
}

/// Exact interval of a Poisson mean from one count (Garwood 1936): α/2 and 1 − α/2 quantiles of gamma
/// distributions with shapes n and n + 1.
fn garwood(events: u64, level: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - level);
    let quantile = |shape: f64, p: f64| match Gamma::new(shape, 1.0) {
        Ok(gamma) => gamma.inverse_cdf(p),
        Err(_) => f64::NAN,
    };
    let n = events as f64;
    [if events == 0 { 0.0 } else { quantile(n, tail) }, quantile(n + 1.0, 1.0 - tail)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exact_interval_is_that_of_the_tables() {
        // Half of the quantiles of chi-square distributions with 2n and 2n + 2 degrees of freedom.
        for (n, low, high) in [
            (0, 0.0, 3.688_879_454_113_936),
            (1, 0.025_317_807_984_289_876, 5.571_643_390_938_898),
            (10, 4.795_388_696_132_433_5, 18.390_356_042_017_78),
            (100, 81.363_991_250_923_14, 121.626_793_792_426_38),
            (1_000_000, 998_040.983_340_293_9, 1_001_961.911_945_432_2),
        ] {
            let [a, b] = garwood(n, 0.95);
            assert!((a - low).abs() <= 1e-9 * low && (b - high).abs() <= 1e-9 * high, "{n}: {a} {b}");
        }
    }
}
