//! Searches for a parameterization: which description of a scenario keeps the outcomes with the fewest parameters?
//!
//! Candidates are the paper's parameterizations and [linear descriptions](LinearSpec) of many families and sizes. Each is
//! fitted and judged by cross-validation (`folds`, `evaluation`), in an order that the results decide (`candidates`).
//! Results are journalled (`results`). The best of each size form fronts, which are judged again on data that the search
//! has not read (`front`). Scores come from [`crate::run::score`].

mod candidates;
mod cma_es;
mod evaluation;
mod folds;
mod front;
mod results;

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use cma_es::CmaEs;
pub use folds::folds;
pub(crate) use folds::is_by_recording;
pub use front::{Front, FrontPoint, Judged, RmseAgainstScore, Scored, SearchResult, Unkept};

use candidates::Task;
use evaluation::{Evaluator, Training};
use results::{Results, Tried};

use crate::engine::version::Canonical;
use crate::engine::{Confusion, Executor, Headway};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::parts::Shard;
use crate::run::score::{ScenarioRate, ScoreOptions, f1, recall};
use crate::scenario::parameterization::{LinearSpec, Parameterization, ParameterizationOptions};
use crate::scenario::{Category, Scenario};
use crate::support::ranges;
use crate::{Error, Place, Result, settings};

/// What is searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Objective {
    /// F1 of S' against S.
    F1,
    /// Recall: the fraction of failures of S that S' has too.
    Recall,
    /// The ratio of the failure rates of S' and S, or its inverse, whichever is below 1.
    Risk,
}

impl Objective {
    /// Name in text.
    pub fn name(self) -> &'static str {
        match self {
            Objective::F1 => "F1",
            Objective::Recall => "recall",
            Objective::Risk => "agreement of failure rates",
        }
    }

    /// The value, 1 is best; `None` if S never fails.
    pub(crate) fn of(self, counts: &Confusion) -> Option<f64> {
        match self {
            Objective::F1 => f1(counts),
            Objective::Recall => recall(counts),
            Objective::Risk => {
                let (s, s_prime) = ((counts.tp + counts.fn_) as f64, (counts.tp + counts.fp) as f64);
                (s > 0.0).then(|| s.min(s_prime) / s.max(s_prime))
            }
        }
    }

    /// The rate over scenarios whose interval is known; `None` for the risk ratio.
    fn rate(self, units: &[Confusion<u32>]) -> Option<ScenarioRate> {
        match self {
            Objective::F1 => Some(ScenarioRate::f1(units.iter())),
            Objective::Recall => {
                let (runs, hits) = units.iter().map(|c| (u64::from(c.tp + c.fn_), u64::from(c.tp))).unzip();
                Some(ScenarioRate::new(runs, hits))
            }
            Objective::Risk => None,
        }
    }
}

settings! {
    /// Options of a search, and of a cross-validation.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, default)]
    pub struct SearchLimits {
        /// Folds of the cross-validation, also of `study` (5).
        #[schemars(range(min = 2, max = 100))]
        pub folds: usize = 5,
        /// Maximum number of parameters, the duration T counted (8).
        #[schemars(range(min = 2, max = 12))]
        pub max_parameters: usize = 8,
        /// Studies for the optimiser of the weights (8000).
        #[schemars(range(min = 0, max = 10_000_000))]
        pub studies: usize = 8000,
        /// Non-inferiority margin: the winner's score is shown to be at most this much below the best (0.05).
        #[schemars(range(min = 0.0, max = 1.0))]
        pub margin: f64 = 0.05,
        /// Seed of the optimiser.
        pub seed: u64 = 157,
    }
}

impl SearchLimits {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(crate) fn validate(&self) -> Result<()> {
        ranges::check("search", self)
    }

    /// Studies that the optimiser needs at least: one generation for each size.
    pub fn min_studies(&self) -> usize {
        candidates::POPULATION * (self.max_parameters - 1)
    }
}

/// Everything that decides the results of a search, besides the scenarios and the profile.
#[derive(Debug, Clone)]
pub struct SearchOptions {
    /// Kind of scenario.
    pub category: Category,
    /// Driver models that the description must suit.
    pub models: Vec<ModelId>,
    /// Criterion.
    pub criterion: Criterion,
    /// Objective.
    pub objective: Objective,
    /// Headways.
    pub headways: Vec<Headway>,
    /// Sizes, budget, seed.
    pub limits: SearchLimits,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
    /// Options of the intervals.
    pub score: ScoreOptions,
    /// Gives every scenario the outcomes of another one: then nothing can be gained on data that was not searched.
    pub shuffled: bool,
}

/// What is described.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Candidate {
    /// A parameterization of the paper.
    Paper(String),
    /// A linear description.
    Linear(LinearSpec),
}

impl Candidate {
    /// Number of parameters that a point has; the duration counts where it is needed.
    fn parameter_count(&self, category: Category) -> usize {
        match self {
            Candidate::Paper(key) => Parameterization::find(category, key)
                .map_or(0, |id| id.coefficients().unwrap_or_else(|| id.variables().len())),
            Candidate::Linear(spec) => spec.parameter_count(category),
        }
    }

    /// The description in one line.
    pub fn describe(&self, category: Category) -> String {
        match self {
            Candidate::Paper(key) => {
                let found = Parameterization::find(category, key);
                format!("{key}: {}", found.map_or(String::new(), |id| id.description()))
            }
            Candidate::Linear(spec) => spec.describe(category),
        }
    }

    /// The family.
    pub fn family(&self) -> String {
        match self {
            Candidate::Paper(_) => "paper".to_owned(),
            Candidate::Linear(spec) => spec.family_name(),
        }
    }
}

/// The cross-validated result of a candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evaluated {
    /// The candidate.
    pub candidate: Candidate,
    /// Its number of parameters.
    pub parameters: usize,
    /// Counts over lanes: model-major, criterion-minor.
    pub cells: Vec<Confusion>,
    /// Error of the motions, in standard deviations.
    pub rmse: f64,
}

/// The models that a score is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// The mean over all models of the search.
    All,
    /// One model.
    Model(ModelId),
}

impl Scope {
    fn all(options: &SearchOptions) -> Vec<Scope> {
        let each = options.models.iter().map(|model| Scope::Model(*model));
        // One model is all models.
        let each: Vec<Scope> = if options.models.len() > 1 { each.collect() } else { Vec::new() };
        std::iter::once(Scope::All).chain(each).collect()
    }

    fn models(self, options: &SearchOptions) -> Vec<ModelId> {
        match self {
            Scope::All => options.models.clone(),
            Scope::Model(model) => vec![model],
        }
    }

    /// `all models`, or the name.
    pub fn name(self) -> String {
        match self {
            Scope::All => "all models".to_owned(),
            Scope::Model(model) => model.name().to_owned(),
        }
    }
}

/// Index of a cell.
fn cell_of(model: ModelId, criterion: Criterion) -> usize {
    let model = ModelId::ALL.iter().position(|known| *known == model).unwrap_or_default();
    model * Criterion::ALL.len() + criterion.index()
}

impl Evaluated {
    /// The mean of the objective over the models; `None` if it is undefined for one.
    pub fn score(&self, scope: Scope, options: &SearchOptions) -> Option<f64> {
        let models = scope.models(options);
        let of = |model: &ModelId| options.objective.of(&self.cells[cell_of(*model, options.criterion)]);
        let scores = models.iter().map(of).collect::<Option<Vec<f64>>>()?;
        Some(scores.iter().sum::<f64>() / scores.len() as f64)
    }
}

/// Data and options of a search.
pub struct Search<'a> {
    scenarios: Vec<&'a Scenario>,
    profile: &'a Profile,
    options: SearchOptions,
    /// Models left out, with the number of scenarios in which S fails.
    left_out: Vec<(ModelId, u64)>,
    /// Names data, options and engine.
    sha256: String,
}

impl<'a> Search<'a> {
    /// Plans a search over the kept scenarios of its category.
    ///
    /// # Errors
    /// [`Error::Usage`] for options out of range; [`Error::Input`] for too few scenarios.
    pub fn plan(scenarios: &'a [Scenario], profile: &'a Profile, options: SearchOptions) -> Result<Search<'a>> {
        options.limits.validate()?;
        options.score.validate()?;
        let of = |scenario: &&Scenario| scenario.kept && scenario.category == options.category;
        let scenarios: Vec<&Scenario> = scenarios.iter().filter(of).collect();
        if scenarios.len() < 10 {
            let problem = format!("{} {} scenarios are too few to search", scenarios.len(), options.category.label());
            return Err(Error::input(Place::item("scenarios"), problem, "use more recordings: 10 scenarios at least"));
        }
        folds(&scenarios, options.limits.folds)?;
        let mut search = Search { scenarios, profile, options, left_out: Vec::new(), sha256: String::new() };
        search.sha256 = search.hash()?;
        Ok(search)
    }

    fn hash(&self) -> Result<String> {
        let SearchOptions { category, criterion, objective, headways, limits, parameterization, shuffled, .. } =
            &self.options;
        let models: Vec<&str> = self.options.models.iter().map(|model| model.name()).collect();
        let mut canonical = Canonical::new("search");
        let limits = (limits.folds, limits.seed);
        let options = (category, criterion, objective, headways, limits, parameterization, shuffled);
        canonical.value(&(self.profile, models, options))?;
        for scenario in &self.scenarios {
            canonical.value(scenario)?;
        }
        Ok(canonical.finish())
    }

    /// Whether the folds are whole recordings.
    fn is_by_recording(&self) -> bool {
        is_by_recording(&self.scenarios, self.options.limits.folds)
    }

    /// Refuses held-out data that the search reads.
    fn refuse_searched(&self, held_out: &[Scenario]) -> Result<()> {
        let bits = |scenario: &Scenario| scenario.target.v.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        let searched: std::collections::HashSet<Vec<u64>> = self.scenarios.iter().map(|s| bits(s)).collect();
        let own = held_out.iter().filter(|s| s.kept && s.category == self.options.category);
        let (all, known) =
            own.fold((0, 0), |(all, known), s| (all + 1, known + usize::from(searched.contains(&bits(s)))));
        if known == 0 {
            return Ok(());
        }
        let problem = format!("{known} of {all} scenarios are searched, too: they are not held out");
        Err(Error::input(Place::item("held-out data"), problem, "hold out other recordings"))
    }

    /// Runs the search: all of it, or the tasks of one shard; `None` for a shard. `folder` holds the journals. `done`
    /// is called with the number of studies so far.
    ///
    /// # Errors
    /// [`Error::Input`] if S fails in too few scenarios for every model; those of the sweep and of the files;
    /// [`Error::Interrupted`].
    pub fn run(
        mut self,
        held_out: Option<&'a [Scenario]>,
        (folder, shard): (Option<&Path>, Option<Shard>),
        executor: &'a Executor<'a>,
        done: &dyn Fn(usize),
    ) -> Result<Option<SearchResult>> {
        let (category, profile) = (self.options.category, self.profile);
        // A signal ends the search after the present sweep; the journal has the rest.
        let _resumable = folder.map(|_| executor.cancel.resumable());
        if let Some(held_out) = held_out {
            self.refuse_searched(held_out)?;
        }
        let all = self.options.clone();
        let evaluator = Evaluator::new(category, self.scenarios.clone(), profile, &all, executor)?;
        let failing = |model: &ModelId| evaluator.failing_scenarios(*model, all.criterion);
        let enough = u64::from(all.score.min_failures.max(2));
        self.left_out =
            all.models.iter().map(|model| (*model, failing(model))).filter(|(_, failing)| *failing < enough).collect();
        self.options.models.retain(|model| failing(model) >= enough);
        if self.options.models.is_empty() {
            let problem =
                format!("S fails in fewer than {enough} scenarios with every model: nothing can be kept or lost");
            return Err(Error::input(Place::item("scenarios"), problem, "use more data, or another criterion"));
        }
        let options = &self.options;
        let of_folds = folds(&self.scenarios, options.limits.folds)?;
        let training = Training::Folds(of_folds, options.limits.folds);
        let mut results = Results::open(folder, shard, &self.sha256)?;
        let mut evaluate = |candidates: &[Candidate]| -> Result<Vec<Option<Evaluated>>> {
            let mut unknown: Vec<Candidate> = Vec::new();
            for candidate in candidates {
                if results.find(candidate)?.is_none() && !unknown.contains(candidate) {
                    unknown.push(candidate.clone());
                }
            }
            let evaluations = evaluator.evaluate(&unknown, &training)?;
            let tried = unknown.into_iter().zip(evaluations).map(|(candidate, evaluation)| {
                let evaluated = evaluation.map(|evaluation| Evaluated {
                    parameters: candidate.parameter_count(category),
                    cells: evaluation.totals(),
                    rmse: evaluation.rmse,
                    candidate: candidate.clone(),
                });
                Tried { candidate, evaluated }
            });
            results.add(tried.collect())?;
            done(results.len());
            candidates.iter().map(|candidate| Ok(results.find(candidate)?.cloned().flatten())).collect()
        };
        let tasks = Task::all(options);
        let budget = options.limits.studies / (options.limits.max_parameters - 1);
        for (at, task) in tasks.iter().enumerate() {
            if shard.is_none_or(|shard| at as u64 % shard.of == shard.index) {
                task.run(category, options, budget, &mut evaluate)?;
            }
        }
        if shard.is_some() {
            return Ok(None);
        }
        front::conclude(&self, &evaluator, &training, results.all(), results.len(), held_out, executor).map(Some)
    }
}
