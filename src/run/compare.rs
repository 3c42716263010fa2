//! Compares failure rates of recorded scenarios (S), of their parameterized replays (S') and of densities fitted on the
//! same scenarios.

use crate::engine::{Block, Chunk, Executor, Headway, LanePlan, Partial, SweepSummary, Wanted};
use crate::model::profile::Profile;
use crate::run::close_following::{CloseFollowing, close_units};
use crate::run::sampling::{
    CategoryComparison, ComparedForm, ComparedParameterization, Estimator, SampleHeadways, SampleOptions,
    ScenarioCounts, Uncertainty, compare_cells, kernel_scenarios, plan_samples, recorded_cells, sample_by_scenario,
    sample_crude,
};
use crate::run::study::{StudyOptions, plan_study};
use crate::scenario::DataProvenance;
use crate::scenario::Scenario;
use crate::scenario::parameterization::Parameterization;
use crate::stats::density::{BandwidthRule, DensityKind, DensityModel, Exposure, FitOptions, Fitted};
use crate::stats::estimate::Enough;
use crate::support::error::push_once;
use crate::traffic::mining::{counts, counts_text};
use crate::{Error, Place, Result};

/// Options of a comparison.
#[derive(Debug, Clone)]
pub struct CompareOptions {
    /// Categories, models, headways, options of the parameterizations.
    pub study: StudyOptions,
    /// Parameterizations that densities are fitted for.
    pub parameterizations: Vec<Parameterization>,
    /// Samples of each density; every sample runs from every headway.
    pub samples: u64,
    /// Also sample the densities of every other form: what does the choice of the density change?
    pub every_form: bool,
    /// Seed of the draws.
    pub seed: u64,
    /// Required number of failures, and margin of agreement around 1.
    pub enough: Enough,
}

/// A planned comparison.
///
/// ```
/// use lanesweep::engine::{CpuBackend, Executor, Headway};
/// use lanesweep::model::profile::Profile;
/// use lanesweep::run::compare::{Compare, CompareOptions};
/// use lanesweep::run::study::StudyOptions;
/// use lanesweep::scenario::Category;
/// use lanesweep::scenario::parameterization::Parameterization;
/// # use lanesweep::scenario::DataProvenance;
/// # use lanesweep::stats::estimate::Enough;
/// # use lanesweep::traffic::mining::{MiningOptions, mine_generated};
/// # use lanesweep::traffic::trajectory::generator::GeneratorOptions;
///
/// # fn main() -> lanesweep::Result<()> {
/// # let recordings = GeneratorOptions { recordings: 2, ..GeneratorOptions::default() };
/// # let scenarios = mine_generated(&recordings, &MiningOptions::default(), || Ok(()))?.scenarios;
/// # let facts = DataProvenance { data: "synthetic".into(), synthetic: true, scenarios_sha256: String::new(), driven: None };
/// let options = CompareOptions {
///     study: StudyOptions { headways: vec![Headway::ThwS(0.6)], ..StudyOptions::default() },
///     parameterizations: Parameterization::find(Category::CutIn, "2").into_iter().collect(),
///     samples: 1000,
///     every_form: false,
///     seed: 157,
///     enough: Enough::default(),
/// };
/// let compare = Compare::plan(&scenarios, &facts, Profile::load("paper")?, options)?;
/// let result = compare.run(&Executor::new(&CpuBackend::lane_arithmetic()))?;
/// assert_eq!(result.categories[0].parameterizations[0].key, "2");
/// # Ok(())
/// # }
/// ```
pub struct Compare<'a> {
    scenarios: &'a [Scenario],
    facts: &'a DataProvenance,
    profile: Profile,
    options: CompareOptions,
    plan: LanePlan,
}

/// Result of a comparison.
#[derive(Debug, Default)]
pub struct CompareResult {
    /// The rates, category by category.
    pub categories: Vec<CategoryComparison>,
    /// Scenarios that a density excludes, with the reason.
    pub left_out: Vec<Error>,
    /// Parameterizations without a density, with the reason.
    pub failed: Vec<Error>,
    /// Summary of the sweeps.
    pub summary: SweepSummary,
}

impl<'a> Compare<'a> {
    /// Nominal level of every interval.
    pub const LEVEL: f64 = 0.95;

    /// Plans the lanes of S and S'. Skips categories without a selected parameterization.
    ///
    /// # Errors
    /// [`Error::Input`] if no scenario of these categories was kept; as [`plan_study`].
    pub fn plan(
        scenarios: &'a [Scenario],
        facts: &'a DataProvenance,
        profile: Profile,
        mut options: CompareOptions,
    ) -> Result<Compare<'a>> {
        options.study.categories.retain(|c| options.parameterizations.iter().any(|id| id.category == *c));
        let plan = plan_study(scenarios, &profile, &options.study)?;
        if plan.unit_count() == 0 {
            return Err(Error::input(
                Place::item(&facts.data),
                format!("no scenario to simulate ({})", counts_text(&counts(scenarios))),
                "use more recordings, or relax the filters ([mining] in option `config`)",
            ));
        }
        Ok(Compare { scenarios, facts, profile, options, plan })
    }

    /// Provenance of the scenarios.
    pub fn provenance(&self) -> &DataProvenance {
        self.facts
    }

    /// The options.
    pub fn options(&self) -> &CompareOptions {
        &self.options
    }

    /// The lanes of S and S'.
    pub fn lane_plan(&self) -> &LanePlan {
        &self.plan
    }

    /// Runs S and S', then fits and samples every density.
    ///
    /// # Errors
    /// As [`Compare::replay`] and [`Compare::sample`].
    pub fn run(&self, executor: &Executor) -> Result<CompareResult> {
        let (counts, summary) = self.replay(executor)?;
        let mut result = self.sample(&counts, executor)?;
        result.summary.add(&summary);
        Ok(result)
    }

    /// Runs every lane of S and S'.
    ///
    /// # Errors
    /// As [`Executor::sweep`].
    pub fn replay(&self, executor: &Executor) -> Result<(Partial, SweepSummary)> {
        self.replay_each(executor, |_| ())
    }

    /// The same; `each` receives every chunk.
    pub(crate) fn replay_each(
        &self,
        executor: &Executor,
        mut each: impl FnMut(&Chunk),
    ) -> Result<(Partial, SweepSummary)> {
        let (plan, mut parts) = (&self.plan, Vec::new());
        let summary = executor.sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
            each(&chunk);
            parts.push(Partial::from_chunk(plan, &chunk)?);
            Ok(())
        })?;
        Ok((parts.into_iter().try_fold(Partial::empty(plan), Partial::merge)?, summary))
    }

    /// Fits and samples every density and compares its rates with those of the counts of S and S'.
    ///
    /// # Errors
    /// Those of the lanes; those of the densities if none can be fitted.
    pub fn sample(&self, counts: &Partial, executor: &Executor) -> Result<CompareResult> {
        let recorded = (0..self.plan.blocks.len()).map(|block| self.recorded(counts, block));
        let summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
        let mut result =
            CompareResult { categories: recorded.collect::<Result<_>>()?, summary, ..CompareResult::default() };
        for id in &self.options.parameterizations {
            let mut sampled = || -> Result<ComparedParameterization> {
                let every_form = self.options.every_form;
                let Fitted { model, left_out, .. } = self.fit(id, DensityKind::Kernel, every_form)?;
                let mut cells = self.sample_density(&model, counts, executor, &mut result.summary)?;
                for form in DensityKind::ALL.into_iter().filter(|form| every_form && *form != DensityKind::Kernel) {
                    let other = self.fit(id, form, true)?.model;
                    cells.forms.push(self.sample_form(&other, executor, &mut result.summary)?);
                }
                result.left_out.extend(left_out);
                Ok(cells)
            };
            match sampled() {
                Ok(cells) => {
                    let of = result.categories.iter_mut().find(|c| c.category == id.category);
                    of.into_iter().for_each(|c| c.parameterizations.push(cells.clone()));
                }
                // If the profile cannot sample cut-outs, only this category fails with a usage error.
                Err(error @ (Error::Input { .. } | Error::Usage { .. })) => {
                    push_once(&mut result.failed, error);
                }
                Err(error) => return Err(error),
            }
        }
        result
            .categories
            .iter_mut()
            .for_each(|category| category.uncertainty = Uncertainty::of_category(category, Self::LEVEL));
        if result.categories.iter().all(|c| c.parameterizations.is_empty()) && !result.failed.is_empty() {
            return Err(result.failed.swap_remove(0));
        }
        Ok(result)
    }

    /// S of one category.
    fn recorded(&self, counts: &Partial, block: usize) -> Result<CategoryComparison> {
        let of = &self.plan.blocks[block];
        let exposure = self.facts.driven.map(|driven| Exposure::new(of.units.len(), driven));
        let close_units = close_units(self.scenarios.iter().filter(|s| s.kept && s.category == of.category));
        let close_following = CloseFollowing::of_recorded(&self.plan, counts, block, &close_units)?;
        let counts = ScenarioCounts::of_variant(&self.plan, counts, block, 0)?;
        Ok(CategoryComparison {
            category: of.category,
            scenarios: of.units.len(),
            exposure,
            recorded: recorded_cells(&self.plan, &counts, exposure.as_ref(), Self::LEVEL),
            close_following,
            parameterizations: Vec::new(),
            uncertainty: Vec::new(),
        })
    }

    /// Fits the density of a parameterization. If S starts from the recorded gaps, the headway is a parameter.
    ///
    /// # Errors
    /// As [`DensityModel::fit`].
    pub(crate) fn fit(&self, id: &Parameterization, kind: DensityKind, representativeness: bool) -> Result<Fitted> {
        let fit = FitOptions {
            parameterization: self.options.study.parameterization.clone(),
            with_thw: Headway::is_observed(&self.options.study.headways),
            kind,
            rule: BandwidthRule::Reduction,
            representativeness,
            ..FitOptions::default()
        };
        DensityModel::fit(id.clone(), self.scenarios, self.facts, &fit)
    }

    /// Samples a density of [`Compare::fit`].
    ///
    /// # Errors
    /// As [`Executor::sweep`]; [`Error::Usage`] for a density that the profile cannot sample.
    pub(crate) fn sample_density(
        &self,
        density: &DensityModel,
        counts: &Partial,
        executor: &Executor,
        summary: &mut SweepSummary,
    ) -> Result<ComparedParameterization> {
        let (options, id) = (&self.options, density.space.id());
        let find = |(at, block): (usize, &Block)| {
            let variant = block.variants.iter().position(|v| *v == id.key)?;
            (block.category == id.category).then_some((at, variant))
        };
        let Some((block, variant)) = self.plan.blocks.iter().enumerate().find_map(find) else {
            return Err(Error::Internal(format!("{} {} has a density but no lanes", id.category.label(), id.key)));
        };
        let plan = plan_samples(density, &density.mixture()?, &self.profile, &self.sample_options(density))?;
        let kernels = kernel_scenarios(density, self.scenarios)?;
        let scenarios = self.plan.blocks[block].units.len() as usize;
        let exposure = density.exposure.as_ref();
        let sampled = sample_by_scenario(&plan, &kernels, scenarios, executor, exposure, Self::LEVEL)?;
        summary.add(&sampled.summary);
        Ok(ComparedParameterization {
            key: id.key.to_string(),
            parameters: id.parameter_count(),
            density_sha256: density.content_sha256()?,
            kernels: kernels.len(),
            plan_sha256: plan.hash().to_owned(),
            voids: sampled.tally.voids,
            goodness: density.representativeness,
            forms: Vec::new(),
            cells: compare_cells(&self.plan, counts, block, variant, &sampled, options.enough, Self::LEVEL)?,
        })
    }

    /// Options of the samples of a density.
    fn sample_options(&self, density: &DensityModel) -> SampleOptions {
        let headways = match density.space.has_thw() {
            true => SampleHeadways::Sampled,
            false => SampleHeadways::Each(self.options.study.headways.clone()),
        };
        SampleOptions {
            seed: self.options.seed,
            models: self.options.study.models.clone(),
            ..SampleOptions::new(Estimator::CRUDE, self.options.samples, headways)
        }
    }

    /// Samples a density of another form.
    fn sample_form(
        &self,
        density: &DensityModel,
        executor: &Executor,
        summary: &mut SweepSummary,
    ) -> Result<ComparedForm> {
        let options = self.sample_options(density);
        let plan = plan_samples(density, &density.mixture()?, &self.profile, &options)?;
        let run = sample_crude(&plan, 0..plan.unit_count(), executor, &options, None, None)?;
        summary.add(&run.summary);
        ComparedForm::of(density, &run.rows)
    }
}
