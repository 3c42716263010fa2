//! What the counts of a whole study say: scores, claims, and the numbers of its figures.

use rayon::prelude::*;

use super::{Study, StudyCases, WINDOW};
use crate::score::{Best, ClaimResult, HeadwayFailures, ScoreTable, best_parameterizations, check_claims};
use lanesweep_engine::lane_case::LaneCase;
use lanesweep_engine::{Constants, Headway, Partial, Start, UnitCounts, silent};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Tables;
use lanesweep_model::scenario::parameterization::{TimeGrid, recorded_case};
use lanesweep_support::{Error, Result};

/// What the counts of one category say in addition to its scores.
#[derive(Debug, Clone)]
pub struct CategoryNumbers {
    /// Failures by headway.
    pub headways: HeadwayFailures,
    /// Smallest TTC among the runs of S that ended at the time cap, one per model, s; infinite if none approaches. `None`
    /// without such runs, and for drivers outside the registry.
    pub capped_min_ttc_s: Vec<Option<f64>>,
}

/// The evaluation of a whole study.
#[derive(Debug, Clone)]
pub struct StudyEvaluation {
    /// Scores.
    pub scores: ScoreTable,
    /// The paper's claims with their verdicts.
    pub claims: Vec<ClaimResult>,
    /// The best parameterizations for collisions.
    pub best: Vec<Best>,
    /// One per category of the scores.
    pub categories: Vec<CategoryNumbers>,
}

impl Study {
    /// Evaluates the counts of all lanes.
    ///
    /// # Errors
    /// As [`Study::score`].
    pub fn evaluate(&self, counts: &Partial) -> Result<StudyEvaluation> {
        let plan = self.plan();
        let scores = self.score(counts)?;
        let numbers = |(block, capped_min_ttc_s)| {
            Ok(CategoryNumbers { headways: HeadwayFailures::of(plan, counts, block)?, capped_min_ttc_s })
        };
        let categories = self.capped_min_ttc_s(counts)?.into_iter().enumerate().map(numbers).collect::<Result<_>>()?;
        let claims = check_claims(&scores, plan, counts);
        let best = best_parameterizations(&scores, plan, counts, Criterion::Collision);
        Ok(StudyEvaluation { scores, claims, best, categories })
    }

    /// By block. Runs the lanes again in binary64, window by window.
    fn capped_min_ttc_s(&self, counts: &Partial) -> Result<Vec<Vec<Option<f64>>>> {
        let plan = self.plan();
        let mut least: Vec<Vec<Option<f64>>> = plan.blocks.iter().map(|_| vec![None; plan.models.len()]).collect();
        let is_capped = |unit: &&UnitCounts| unit.capped.iter().take(plan.models.len()).any(|lanes| *lanes > 0);
        for window in counts.units().chunks(WINDOW as usize) {
            let capped: Vec<&UnitCounts> = window.iter().filter(is_capped).collect();
            let Some((first, last)) = capped.first().zip(capped.last()) else { continue };
            let units = first.unit..last.unit + 1;
            // A merge holds no scenarios.
            let read = match &self.file {
                Some((path, _)) if self.cases.scenario(first.unit).and(self.cases.scenario(last.unit)).is_none() => {
                    Some(Study::read_units(path, |_| units)?)
                }
                _ => None,
            };
            let cases = read.as_ref().map_or(&self.cases, |study| &study.cases);
            let found: Vec<(usize, Vec<Option<f64>>)> =
                capped.into_par_iter().map(|unit| cases.capped_min_ttc_s(unit)).collect::<Result<_>>()?;
            for (block, of_unit) in found {
                for (least, ttc_s) in least[block].iter_mut().zip(of_unit) {
                    *least = [*least, ttc_s].into_iter().flatten().reduce(f64::min);
                }
            }
        }
        Ok(least)
    }
}

impl StudyCases {
    /// Block of a unit, and by model the smallest TTC among its runs of S that end at the time cap.
    fn capped_min_ttc_s(&self, unit: &UnitCounts) -> Result<(usize, Vec<Option<f64>>)> {
        let plan = self.outline();
        let missing = || Error::Internal(format!("scenario {} of a study is not held", unit.unit));
        let (block, _) = plan.segments(unit.unit..unit.unit + 1).pop().ok_or_else(missing)?;
        let scenario = self.scenario(unit.unit).ok_or_else(missing)?;
        let mut tables = Tables::default();
        let case = recorded_case(scenario, TimeGrid::of(&plan.profile))?;
        let case = LaneCase::encode(&case, &plan.profile, &mut tables).ahead_by(scenario.gap0.unwrap_or(0.0));
        let constants = Constants::<f64>::resolve(&plan.profile, plan.blocks[block].category);
        let least = |(model, capped): (&ModelId, &u32)| {
            let run = |headway: &Headway| {
                let start = Start::Gap(headway.start::<f64>().gap(case.ego_speed));
                constants.run(*model, &case, &tables, start, silent)
            };
            let is_run = *capped > 0 && model.foreign().is_none();
            let headways = plan.headways.iter().filter(|_| is_run);
            headways.map(run).filter(|of| of.verdicts.capped()).map(|of| of.min_ttc).reduce(f64::min)
        };
        Ok((block, plan.models.iter().zip(&unit.capped).map(least).collect()))
    }
}
