//! Evaluates descriptions: each is fitted on some scenarios and judged on others, lane by lane.

use std::sync::Arc;

use rayon::prelude::*;

use super::{Candidate, Objective, Scope, SearchOptions};
use crate::engine::lane_case::LaneCase;
use crate::engine::{Block, CaseTable, Confusion, Executor, LanePlan, Units, Verdicts, Wanted};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::random::Stream;
use crate::run::motion_error::{MotionError, MotionSpread};
use crate::scenario::parameterization::{
    LinearFamily, LinearSpec, Parameterization, ParameterizationOptions, Reduction, Signal, SvdLateral, TimeGrid,
    recorded_case,
};
use crate::scenario::{Case, Category, Lateral, Scenario, Speed, Tables};
use crate::stats::density::Draws;
use crate::{Error, Result};

/// Purpose of the random stream that shuffles the outcomes.
const SHUFFLE_PURPOSE: u32 = 0x5345_4152;
/// Candidates that are swept together.
const BATCH: usize = 32;

/// Motions beyond these limits are no motions of vehicles, and the description none of scenarios: m/s, m.
const MAX_SPEED_MPS: f64 = 120.0;
const MAX_LATERAL_M: f64 = 30.0;

/// What a description is fitted on.
pub(super) enum Training<'a> {
    /// For each scenario those of the other folds.
    Folds(Vec<usize>, usize),
    /// Other scenarios.
    On(&'a [&'a Scenario]),
    /// The same scenarios.
    InSample,
}

/// How a description did.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Evaluation {
    /// Counts per scenario: model-major, criterion-minor.
    pub units: Vec<Vec<Confusion<u32>>>,
    /// Root mean square error of the motions, in standard deviations of each series.
    pub rmse: f64,
}

impl Evaluation {
    /// The counts of a model and criterion over all scenarios.
    pub(super) fn totals(&self) -> Vec<Confusion> {
        let mut totals = vec![Confusion::default(); self.units.first().map_or(0, Vec::len)];
        self.units.iter().for_each(|unit| totals.iter_mut().zip(unit).for_each(|(total, cell)| total.add(cell)));
        totals
    }
}

/// Scenarios of one category with the verdicts of S.
pub(super) struct Evaluator<'a> {
    pub category: Category,
    pub scenarios: Vec<&'a Scenario>,
    profile: &'a Profile,
    options: &'a SearchOptions,
    executor: &'a Executor<'a>,
    /// S: scenario, headway, model.
    recorded: Vec<Verdicts>,
    motions: Vec<LaneCase<f64>>,
    tables: Tables<f64>,
    spread: MotionSpread,
}

impl<'a> Evaluator<'a> {
    /// Simulates S.
    ///
    /// # Errors
    /// Those of the cases and of the sweep.
    pub(super) fn new(
        category: Category,
        scenarios: Vec<&'a Scenario>,
        profile: &'a Profile,
        options: &'a SearchOptions,
        executor: &'a Executor<'a>,
    ) -> Result<Evaluator<'a>> {
        let grid = TimeGrid::of(profile);
        let cases: Vec<Case> = scenarios.iter().map(|scenario| recorded_case(scenario, grid)).collect::<Result<_>>()?;
        let mut tables = Tables::default();
        let motions: Vec<LaneCase<f64>> =
            cases.iter().map(|case| LaneCase::encode(case, profile, &mut tables)).collect();
        let mut spread = MotionSpread::default();
        motions.iter().for_each(|recorded| spread.add(recorded, &tables));
        let mut evaluator = Evaluator {
            category,
            scenarios,
            profile,
            options,
            executor,
            recorded: Vec::new(),
            motions,
            tables,
            spread,
        };
        let recorded = evaluator.sweep(&cases.iter().map(|case| vec![case]).collect::<Vec<_>>())?;
        evaluator.recorded = recorded.into_iter().flatten().collect();
        if options.shuffled {
            evaluator.shuffle();
        }
        Ok(evaluator)
    }

    /// Gives every scenario the outcomes of another one.
    fn shuffle(&mut self) {
        let width = self.options.headways.len() * ModelId::ALL.len();
        let mut order: Vec<usize> = (0..self.scenarios.len()).collect();
        let mut draws = Draws::new(Stream { seed: self.options.limits.seed, purpose: SHUFFLE_PURPOSE }, 0);
        for last in (1..order.len()).rev() {
            order.swap(last, draws.below(last + 1));
        }
        let of = |from: usize| self.recorded[from * width..(from + 1) * width].to_vec();
        self.recorded = order.into_iter().flat_map(of).collect();
    }

    /// F1 of an S' that fails from the same headways in every scenario, those that suit best; the mean over the models.
    /// `None` for other objectives, and if S never fails.
    pub(super) fn headway_only(&self, scope: Scope, options: &SearchOptions) -> Option<f64> {
        let (models, scenarios) = (ModelId::ALL.len(), self.scenarios.len() as f64);
        let headways = options.headways.len();
        let of_model = |model: ModelId| {
            let at = ModelId::ALL.iter().position(|known| *known == model)?;
            let failures = |headway: usize| {
                let lanes = self.recorded.iter().skip(headway * models + at).step_by(headways * models);
                lanes.filter(|lane| lane.failed(options.criterion)).count() as f64
            };
            let mut counts: Vec<f64> = (0..headways).map(failures).collect();
            counts.sort_by(|a, b| b.total_cmp(a));
            let all: f64 = counts.iter().sum();
            let f1 = |chosen: usize| 2.0 * counts[..chosen].iter().sum::<f64>() / (chosen as f64 * scenarios + all);
            (all > 0.0).then(|| (1..=headways).map(f1).fold(0.0, f64::max))
        };
        let scores = scope.models(options).into_iter().map(of_model).collect::<Option<Vec<f64>>>()?;
        (options.objective == Objective::F1).then(|| scores.iter().sum::<f64>() / scores.len() as f64)
    }

    /// Evaluates candidates; `None` for those that cannot be fitted. One whole study each.
    ///
    /// # Errors
    /// Those of the sweep; [`Error::Interrupted`].
    pub(super) fn evaluate(&self, candidates: &[Candidate], training: &Training) -> Result<Vec<Option<Evaluation>>> {
        let mut all = Vec::with_capacity(candidates.len());
        for batch in candidates.chunks(BATCH) {
            let cases = |candidate| Ok(self.cases(candidate, training)?.filter(|cases| cases.iter().all(is_possible)));
            let cases: Vec<Option<Vec<Case>>> = batch.par_iter().map(cases).collect::<Result<_>>()?;
            let fitted: Vec<&Vec<Case>> = cases.iter().flatten().collect();
            let by_unit: Vec<Vec<&Case>> =
                (0..self.scenarios.len()).map(|unit| fitted.iter().map(|of| &of[unit]).collect()).collect();
            let swept = if fitted.is_empty() { Vec::new() } else { self.sweep(&by_unit)? };
            let mut swept = swept.into_iter();
            let with_verdicts: Vec<_> =
                cases.into_iter().map(|cases| cases.map(|cases| (cases, swept.next().unwrap_or_default()))).collect();
            let evaluation = |(cases, verdicts): (Vec<Case>, Vec<Verdicts>)| Evaluation {
                units: self.agreement(&verdicts),
                rmse: self.rmse(&cases),
            };
            all.extend(with_verdicts.into_par_iter().map(|of| of.map(evaluation)).collect::<Vec<_>>());
        }
        Ok(all)
    }

    /// Number of scenarios in which S fails from some headway.
    pub(super) fn failing_scenarios(&self, model: ModelId, criterion: Criterion) -> u64 {
        let models = ModelId::ALL.len();
        let at = ModelId::ALL.iter().position(|known| *known == model).unwrap_or_default();
        let fails = |unit: &&[Verdicts]| unit.iter().skip(at).step_by(models).any(|lane| lane.failed(criterion));
        self.recorded.chunks(self.options.headways.len() * models).filter(fails).count() as u64
    }

    /// S' of every scenario; `None` if there are too few scenarios for a fit.
    fn cases(&self, candidate: &Candidate, training: &Training) -> Result<Option<Vec<Case>>> {
        let (grid, options) = (TimeGrid::of(self.profile), &self.options.parameterization);
        let spec = match candidate {
            Candidate::Paper(key) => {
                let id = Parameterization::find(self.category, key)
                    .ok_or_else(|| Error::Internal(format!("there is no {key}")))?;
                match id.coefficients() {
                    None => {
                        let cases = self.scenarios.iter().map(|scenario| id.case(scenario, grid, options, None));
                        return cases.collect::<Result<Vec<_>>>().map(Some);
                    }
                    Some(coefficients) => of_paper(coefficients, options),
                }
            }
            Candidate::Linear(spec) => spec.clone(),
        };
        let d = spec.parameter_count(self.category);
        let case = |fitted: &Reduction, scenario: &Scenario| fitted.case(scenario, d, grid);
        let fit = |train: &[&Scenario]| match spec.fit(self.category, train, options) {
            Ok(fitted) => Ok(Some(fitted)),
            Err(Error::Input { .. }) => Ok(None),
            Err(error) => Err(error),
        };
        match training {
            Training::Folds(of, count) => {
                let train = |fold: usize| -> Vec<&Scenario> {
                    self.scenarios.iter().zip(of).filter(|(_, of)| **of != fold).map(|(s, _)| *s).collect()
                };
                let fitted: Vec<Option<Reduction>> =
                    (0..*count).into_par_iter().map(|fold| fit(&train(fold))).collect::<Result<_>>()?;
                let cases =
                    self.scenarios.iter().zip(of).map(|(scenario, fold)| {
                        fitted[*fold].as_ref().map(|fitted| case(fitted, scenario)).transpose()
                    });
                cases.collect()
            }
            Training::On(_) | Training::InSample => {
                let train = if let Training::On(train) = training { train } else { &*self.scenarios };
                let Some(fitted) = fit(train)? else { return Ok(None) };
                self.scenarios.iter().map(|scenario| case(&fitted, scenario)).collect::<Result<Vec<_>>>().map(Some)
            }
        }
    }

    /// The verdicts of cases, by variant: scenario, headway, model.
    fn sweep(&self, by_unit: &[Vec<&Case>]) -> Result<Vec<Vec<Verdicts>>> {
        let variants = by_unit.first().map_or(0, Vec::len);
        let mut source = CaseTable::new([variants]);
        for case in by_unit.iter().flatten() {
            source.blocks[0].cases.push(LaneCase::encode(case, self.profile, &mut source.tables));
        }
        let names = (0..variants).map(|variant| variant.to_string()).collect();
        let block = Block::new(self.category, Units::Numbered(by_unit.len() as u64), names);
        let plan = LanePlan::with_hash(
            "search".to_owned(),
            self.profile.clone(),
            ModelId::ALL.to_vec(),
            self.options.headways.clone(),
            vec![block],
            Arc::new(source),
        )?;
        let width = self.options.headways.len() * ModelId::ALL.len();
        let mut verdicts = vec![Vec::with_capacity(by_unit.len() * width); variants];
        self.executor.sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
            let lanes = chunk.verdicts.chunks(width).enumerate();
            lanes.for_each(|(at, lanes)| verdicts[at % variants].extend_from_slice(lanes));
            Ok(())
        })?;
        Ok(verdicts)
    }

    /// Agreement of S' with S, per scenario.
    fn agreement(&self, verdicts: &[Verdicts]) -> Vec<Vec<Confusion<u32>>> {
        let (models, criteria) = (ModelId::ALL.len(), Criterion::ALL.len());
        let width = self.options.headways.len() * models;
        let of_unit = |(s, s_prime): (&[Verdicts], &[Verdicts])| {
            let mut cells = vec![Confusion::<u32>::default(); models * criteria];
            for (lane, (s, s_prime)) in s.iter().zip(s_prime).enumerate() {
                for criterion in Criterion::ALL {
                    let cell = &mut cells[lane % models * criteria + criterion.index()];
                    cell.count(s.failed(criterion), s_prime.failed(criterion));
                }
            }
            cells
        };
        self.recorded.chunks(width).zip(verdicts.chunks(width)).map(of_unit).collect()
    }

    fn rmse(&self, cases: &[Case]) -> f64 {
        let mut error = MotionError::default();
        for (recorded, case) in self.motions.iter().zip(cases) {
            let mut tables = Tables::default();
            let case = LaneCase::encode(case, self.profile, &mut tables);
            error.add((recorded, &self.tables), (&case, &tables));
        }
        error.root(self.category, &self.spread)
    }
}

/// Whether the motions of a case are those of vehicles.
fn is_possible(case: &Case) -> bool {
    let speed = |speed: &Speed| match speed {
        Speed::Kinematic { .. } => true,
        Speed::Sampled(values) => values.iter().all(|v| *v <= MAX_SPEED_MPS),
    };
    let across = |lateral: &Lateral| match lateral {
        Lateral::Sampled { position_m, .. } => position_m.iter().all(|y| y.abs() <= MAX_LATERAL_M),
        Lateral::Centred | Lateral::Kinematic { .. } => true,
    };
    speed(&case.principal.speed)
        && across(&case.principal.lateral)
        && case.ahead.as_ref().is_none_or(|ahead| speed(&ahead.vehicle.speed))
        && case.ego_speed_mps <= MAX_SPEED_MPS
}

/// The paper's decomposition as a specification.
pub(super) fn of_paper(coefficients: usize, options: &ParameterizationOptions) -> LinearSpec {
    LinearSpec {
        family: LinearFamily::Svd { coefficients, signal: Signal::Values, emphasis: Vec::new() },
        mirrored: options.svd_lateral == SvdLateral::Mirrored,
        registered: false,
    }
}
