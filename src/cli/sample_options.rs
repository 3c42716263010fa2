//! What the flags of `lanesweep sample` ask for, as options of the library.

use std::path::PathBuf;
use std::time::Duration;

use super::sample::Sample;
use crate::cli::settings::{EstimatorKind, IntervalKind, PointKind};
use crate::run::sampling::{Estimator, MapAxes, SampleHeadways, SampleOptions, SampleSource, read_proposal};
use crate::stats::density::DensityModel;
use crate::stats::estimate::{BinomialInterval, Checkpoints, Pilot, StopRule};
use crate::support::plausibility::{Doubts, HELP};
use crate::{Error, Place, Result};

impl Sample {
    /// When to end.
    pub(super) fn stop(&self, samples: u64) -> StopRule {
        StopRule {
            samples,
            relative_half_width: self.settings.half_width,
            time_limit: self.settings.time_limit_s.map(Duration::from_secs_f64),
            checkpoints: Checkpoints::Doubling,
        }
    }

    /// Everything that a run over a density is asked for.
    pub(super) fn options(&self, density: &DensityModel) -> Result<SampleOptions> {
        let samples = self.settings.samples.unwrap_or(match self.settings.estimator {
            EstimatorKind::Subset => 2000,
            _ => 100_000,
        });
        self.check_given(density)?;
        let headways = self.headways(density)?;
        if let SampleHeadways::Each(list) = &headways
            && list.len() != 1
            && !self.is_crude()
        {
            return Err(Error::usage(
                Place::item("--thw"),
                format!("--estimator {} follows one headway at a time", self.settings.estimator.key()),
                "give one, such as --thw 0.6, or a density fitted with --with-thw",
            ));
        }
        Ok(SampleOptions {
            models: self.models()?,
            criterion: self.settings.criterion,
            seed: self.settings.seed,
            level: self.settings.level,
            stop: self.stop(samples),
            given: self.given.clone(),
            worst: self.settings.worst,
            source: match self.settings.points {
                PointKind::Random => SampleSource::Random,
                PointKind::Sobol => SampleSource::Sobol,
            },
            map: if self.is_crude() { self.map_axes(density)? } else { None },
            ..SampleOptions::new(self.estimator(density)?, samples, headways)
        })
    }

    /// Looks at the values of `--given`, and tells what is doubtful.
    fn check_given(&self, density: &DensityModel) -> Result<()> {
        let mut doubts = Doubts::new(self.plausibility.policy());
        for (name, value) in &self.given {
            let parameter = &density.space.parameters()[density.space.index_of(name)?];
            let Some(quantity) = parameter.quantity() else { continue };
            let judged = doubts.check(quantity, *value, || format!("--given {name}"));
            judged.map_err(|problem| Error::usage(Place::item("--given"), format!("`{name}`: {problem}"), HELP))?;
        }
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        Ok(())
    }

    fn estimator(&self, density: &DensityModel) -> Result<Estimator> {
        let settings = &self.settings;
        Ok(match settings.estimator {
            EstimatorKind::Mc => Estimator::Crude { interval: self.interval() },
            EstimatorKind::Is if self.proposal.is_empty() => Estimator::Pilot(Pilot {
                worst: settings.elite_fraction,
                broad: settings.broad_weight,
                defence: settings.defensive_weight,
                ..Pilot::guarded(settings.pilot)
            }),
            EstimatorKind::Is => {
                let read = |path: &PathBuf| read_proposal(path, density);
                let proposals = self.proposal.iter().map(read).collect::<Result<_>>()?;
                Estimator::Given { proposals, defence: settings.defensive_weight }
            }
            EstimatorKind::Ce => Estimator::CrossEntropy { defence: settings.defensive_weight },
            EstimatorKind::Subset => Estimator::Subset,
        })
    }

    /// Kind of interval of crude Monte Carlo.
    pub(super) fn interval(&self) -> BinomialInterval {
        match self.settings.interval {
            IntervalKind::Wilson => BinomialInterval::Wilson,
            IntervalKind::ClopperPearson => BinomialInterval::ClopperPearson,
        }
    }

    fn map_axes(&self, density: &DensityModel) -> Result<Option<MapAxes>> {
        let parameters = density.space.parameters();
        match self.map.as_deref() {
            Some("none") => Ok(None),
            None if parameters.len() < 2 => Ok(None),
            None => MapAxes::of(density, &parameters[0].name, &parameters[1].name).map(Some),
            Some(text) => {
                let (x, y) = text.split_once(',').ok_or_else(|| {
                    let problem = format!("`{text}` does not name two parameters");
                    Error::usage(Place::item("--map"), problem, "give two, separated by a comma, or `none`")
                })?;
                MapAxes::of(density, x.trim(), y.trim()).map(Some)
            }
        }
    }
}
