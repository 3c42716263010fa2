//! What a sampling run was asked for, for its record.

use crate::engine::Headway;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::sampling::{Kind, Sample, SampleHeadways};

/// What a run was asked for.
#[derive(Debug, Clone)]
pub struct RunFacts {
    /// Estimator: `mc`, `is`, `ce`, `subset`.
    pub estimator: &'static str,
    /// Profile, with its time step.
    pub profile: Profile,
    /// Models.
    pub models: Vec<ModelId>,
    /// Headways of the plan; none where the density draws them.
    pub headways: Vec<Headway>,
    /// Kind of points: `random`, `sobol`.
    pub points: &'static str,
    /// Samples asked for.
    pub samples: u64,
    /// Seed.
    pub seed: u64,
    /// Parameters that were given, with their values.
    pub given: Vec<(String, f64)>,
}

impl RunFacts {
    /// Of a run.
    pub fn of(sample: &Sample) -> RunFacts {
        let random = |estimator, profile: &Profile, models: &[ModelId], headways| RunFacts {
            estimator,
            profile: profile.clone(),
            models: models.to_vec(),
            headways,
            points: "random",
            samples: sample.samples(),
            seed: sample.seed(),
            given: Vec::new(),
        };
        match &sample.0 {
            Kind::Crude(plan, _) => {
                let facts = &plan.facts;
                let headways = facts.headways.clone().unwrap_or_default();
                RunFacts {
                    points: if facts.sobol { "sobol" } else { "random" },
                    given: facts.given.clone(),
                    ..random("mc", &facts.profile, &facts.models, headways)
                }
            }
            Kind::Weighted(plan) | Kind::Pilot(plan, _) => {
                let facts = &plan.facts;
                random("is", &facts.profile, &facts.models, facts.headway.into_iter().collect())
            }
            Kind::Sequential(run) => {
                let headways = match &run.options.headways {
                    SampleHeadways::Each(list) => list.clone(),
                    SampleHeadways::Sampled => Vec::new(),
                };
                random(run.options.estimator.key(), &run.profile, &run.options.models, headways)
            }
        }
    }
}
