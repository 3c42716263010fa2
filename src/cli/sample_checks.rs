//! What the flags of `lanesweep sample` must fulfil whatever the density is.

use std::path::{Path, PathBuf};

use super::sample::{EstimatorFlag, PointsFlag, Sample};
use super::source::file_of;
use crate::run::sampling::MAX_HELD;
use crate::support::repeats::refuse_repeats;
use crate::support::table::TableFormat;
use crate::{Error, Place, Result};

/// Samples of a run that can be split and resumed, at most: as of `compare`.
const MAX_SPLIT: u64 = (1 << 48) - 1;

/// The complaint about a flag that the weighing estimators do not have.
pub(super) fn only_crude(flag: &str) -> Error {
    let problem = "this belongs to crude Monte Carlo";
    Error::usage(Place::item(flag), problem, "use --estimator mc, or leave it out")
}

impl Sample {
    /// What no density is needed for.
    pub(super) fn check(&self) -> Result<()> {
        let share = |name: &str, value: f64, from_zero: bool| {
            let fits = value < 1.0 && (value > 0.0 || (from_zero && value == 0.0));
            if fits {
                return Ok(());
            }
            let range = if from_zero { "from 0 to below 1" } else { "between 0 and 1" };
            Err(Error::usage(Place::item(name), format!("{value} is out of range"), format!("give a number {range}")))
        };
        share("--level", self.level, false)?;
        share("--elite-fraction", self.elite_fraction, false)?;
        share("--defensive-weight", self.defensive_weight, true)?;
        share("--broad-weight", self.broad_weight, true)?;
        if self.half_width.is_some_and(|u| !(u > 0.0 && u.is_finite())) {
            return Err(Error::usage(
                Place::item("--half-width"),
                "no half-width",
                "give a number above 0, such as 0.05",
            ));
        }
        if self.time_limit.is_some_and(|t| !(t > 0.0 && t < 1e9)) {
            return Err(Error::usage(Place::item("--time-limit"), "no time", "give seconds above 0"));
        }
        if self.samples == Some(0) {
            let help = "give 1000000, for instance";
            return Err(Error::usage(Place::item("--samples"), "0 samples give no estimate", help));
        }
        if self.samples.is_some_and(|n| n >= 1 << 63) {
            let problem = "the number of samples must be below 2^63";
            return Err(Error::usage(Place::item("--samples"), problem, "give fewer"));
        }
        let is_crude = self.is_crude();
        let belongs_to_crude = [
            ("--rows", self.rows.is_some()),
            ("--map", self.map.is_some()),
            ("--given", !self.given.is_empty()),
            ("--points sobol", self.points == PointsFlag::Sobol),
        ];
        if let Some((flag, _)) = belongs_to_crude.iter().find(|(_, given)| *given && !is_crude) {
            return Err(only_crude(flag));
        }
        let least = |flag: &str, value: u64, least: u64, most: u64| {
            if (least..=most).contains(&value) {
                return Ok(());
            }
            let help = format!("give at least {least} and at most {most}");
            Err(Error::usage(Place::item(flag), format!("{value} is out of range"), help))
        };
        match self.estimator {
            EstimatorFlag::Is if self.is_weighted() => {
                least("--samples", self.samples.unwrap_or(100_000), 1, MAX_SPLIT)?
            }
            EstimatorFlag::Is => {
                least("--samples", self.samples.unwrap_or(100_000), 100, 10 * MAX_HELD)?;
                least("--pilot", self.pilot, 500, MAX_HELD)?;
            }
            EstimatorFlag::Subset => least("--samples", self.samples.unwrap_or(2000), 100, MAX_HELD)?,
            EstimatorFlag::Ce => least("--samples", self.samples.unwrap_or(100_000), 100, 10 * MAX_HELD)?,
            _ => (),
        }
        let is_split = self.shards.is_part() || self.shards.plan_only;
        if is_split && !is_crude && !self.is_weighted() {
            let problem = "the adaptive estimators are sequential and cannot be split";
            let help = "use --estimator mc, or --estimator is with one given --proposal";
            return Err(Error::usage(Place::item("--shard"), problem, help));
        }
        if is_split && (self.half_width.is_some() || self.time_limit.is_some()) {
            let problem = "a part of a run cannot evaluate a stop rule of the whole run";
            return Err(Error::usage(Place::item("--shard"), problem, "leave out the stop rules, or --shard"));
        }
        if !self.proposal.is_empty() && self.estimator != EstimatorFlag::Is {
            return Err(Error::usage(
                Place::item("--proposal"),
                "a given proposal is sampled by importance sampling",
                "add --estimator is",
            ));
        }
        refuse_repeats(|| Place::item("--proposal"), self.proposal.iter().map(|path| (file_of(path), path.display())))?;
        Ok(())
    }
}

/// The rows must replace neither an input nor another result.
pub(super) fn guard<'a>(rows: &Path, out: &Path, inputs: impl Iterator<Item = &'a PathBuf>) -> Result<()> {
    let results = ["estimate.json", "estimates.csv", "worst.csv", "convergence.csv", "density.json"];
    let others: Vec<PathBuf> = results.iter().map(|name| out.join(name)).chain(inputs.cloned()).collect();
    super::source::refuse_overwriting(rows, &others, "--rows")?;
    TableFormat::of(rows, &TableFormat::EVERY, "--rows").map(drop)
}
