//! What the flags of `lanesweep sample` must fulfil whatever the density is.

use std::path::{Path, PathBuf};

use super::sample::Sample;
use super::source::file_of;
use crate::cli::settings::{EstimatorKind, PointKind};
use crate::report::lanes::table_format;
use crate::run::forecast::MAX_HELD;
use crate::support::ranges::refuse_repeats;
use crate::{Error, Place, Result};

/// Samples of a run that can be split and resumed, at most: as of `compare`.
const MAX_SPLIT: u64 = (1 << 48) - 1;

/// The complaint about a flag that the weighing estimators do not have.
pub(super) fn only_crude(flag: &str) -> Error {
    let problem = "this belongs to crude Monte Carlo";
    Error::usage(Place::item(flag), problem, "use --estimator mc, or leave it out")
}

impl Sample {
    /// Checks what needs no density.
    pub(super) fn check(&self) -> Result<()> {
        let settings = &self.settings;
        let is_crude = self.is_crude();
        let belongs_to_crude = [
            ("--rows", self.rows.is_some()),
            ("--map", self.map.is_some()),
            ("--given", !self.given.is_empty()),
            ("--points sobol", settings.points == PointKind::Sobol),
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
        match settings.estimator {
            EstimatorKind::Is if self.is_weighted() => {
                least("--samples", settings.samples.unwrap_or(100_000), 1, MAX_SPLIT)?
            }
            EstimatorKind::Subset => least("--samples", settings.samples.unwrap_or(2000), 100, MAX_HELD)?,
            EstimatorKind::Is | EstimatorKind::Ce => {
                least("--samples", settings.samples.unwrap_or(100_000), 100, 10 * MAX_HELD)?
            }
            _ => (),
        }
        let is_split = self.shards.is_part() || self.shards.plan_only;
        if is_split && !is_crude && !self.is_weighted() {
            let problem = "the adaptive estimators are sequential and cannot be split";
            let help = "use --estimator mc, or --estimator is with one given --proposal";
            return Err(Error::usage(Place::item("--shard"), problem, help));
        }
        if is_split && (settings.half_width.is_some() || settings.time_limit_s.is_some()) {
            let problem = "a part of a run cannot evaluate a stop rule of the whole run";
            return Err(Error::usage(Place::item("--shard"), problem, "leave out the stop rules, or --shard"));
        }
        if !self.proposal.is_empty() && settings.estimator != EstimatorKind::Is {
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
    table_format(rows).map(drop)
}
