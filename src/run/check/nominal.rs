//! The computed answers of many cases, by lanes of a backend. No change of an input or of the time step is examined.

use std::sync::Arc;

use super::annex;
use super::subject::Subject;
use super::verdict::{CaseVerdicts, RunEnd};
use crate::cases::{CaseRows, by_row};
use crate::grid::without_reaction;
use lanesweep_engine::{Executor, Headway, LanePlan, Verdicts, Wanted};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::{MODELS, ModelId};
use lanesweep_model::profile::Profile;
use lanesweep_support::{Error, Result};

/// Returns how the lanes of every case end, in the arithmetic of the executor's backend, or why it cannot run; smallest
/// gaps are NaN. A lane of an ego that never reacts and reaches the time cap is open, as in a map.
///
/// # Errors
/// Those of the backend.
pub fn nominal_verdicts(
    subjects: &[Subject],
    profile: &Profile,
    executor: &Executor,
) -> Result<Vec<Result<CaseVerdicts>>> {
    let mut cases = CaseRows::default();
    let encoded: Vec<Result<()>> = subjects
        .iter()
        .map(|subject| cases.push(|tables| Ok((subject.category(), subject.encode(profile, tables)?))))
        .collect();
    let (blocks, source, rows) = cases.planned();
    if rows.is_empty() {
        return Ok(encoded.into_iter().filter_map(Result::err).map(Err).collect());
    }
    let ends = |profile: Profile, models: &[ModelId]| {
        // Nothing resumes the plan: it needs no hash.
        let (models, source, headways) = (models.to_vec(), Arc::clone(&source), vec![Headway::Observed]);
        let plan = LanePlan::with_hash(String::new(), profile, models, headways, blocks.clone(), source)?;
        by_row(&plan, &rows, executor, Wanted::Verdicts, |chunk| &chunk.verdicts)
    };
    let (drivers, unreacting) =
        (ends(profile.clone(), &ModelId::ALL)?, ends(without_reaction(profile), &[ModelId::Reg157])?);
    let mut lanes = drivers.chunks(MODELS).zip(&unreacting);
    let collides = |verdicts: &Verdicts| verdicts.failed(Criterion::Collision);
    let of = |(subject, encoded): (&Subject, Result<()>)| {
        encoded?;
        let (drivers, unreacting) = lanes.next().ok_or_else(|| Error::Internal("a case has no verdicts".to_owned()))?;
        Ok(CaseVerdicts {
            collide: std::array::from_fn(|model| collides(&drivers[model])),
            min_gap_m: [f64::NAN; MODELS],
            unreacting: match (collides(unreacting), unreacting.capped() && profile.frame.end_when_settled) {
                (true, _) => RunEnd::Contact,
                (false, true) => RunEnd::Open,
                (false, false) => RunEnd::Clear,
            },
            is_outside_annex: annex::outside(profile, subject.category(), subject.point()).is_some(),
            reference_drivers: profile.reference_drivers.clone(),
        })
    };
    Ok(subjects.iter().zip(encoded).map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::super::{Answer, Check};
    use super::*;
    use lanesweep_engine::CpuBackend;
    use lanesweep_model::scenario::{Category, PlainCase};

    /// Cases far from every boundary: the lanes of a batch answer as the check of one case does.
    #[test]
    fn the_lanes_of_a_batch_answer_as_the_check_of_one_case() {
        let profile = Profile::load("un-r157").unwrap();
        let case = |category, speed_mps, acceleration_mps2, lateral_speed_mps| PlainCase {
            category,
            ego_speed_mps: 20.0,
            speed_mps,
            acceleration_mps2,
            end_speed_mps: None,
            lateral_speed_mps,
            lateral_distance_m: 3.5,
            ahead_speed_mps: 0.0,
            ahead_gap_m: 60.0,
            length_m: 4.3,
            width_m: 1.9,
            ego_length_m: 4.3,
            ego_width_m: 1.9,
            lane_width_m: 3.5,
            duration_s: None,
        };
        let cases = [
            (case(Category::CutIn, 10.0, 0.0, 1.0), 8.0),
            (case(Category::Lvd, 20.0, -6.0, 0.0), 30.0),
            (case(Category::CutIn, 10.0, 0.0, 1.0), 60.0),
            (case(Category::CutIn, 25.0, 0.0, 1.0), 40.0),
            (case(Category::CutOut, 20.0, 0.0, 1.5), 30.0),
        ];
        let subjects: Vec<Subject> =
            cases.iter().map(|(case, gap_m)| Subject::plain(case, Headway::GapM(*gap_m))).collect();
        let executor = Executor::new(CpuBackend::lane_arithmetic());
        let found: Vec<Answer> = nominal_verdicts(&subjects, &profile, &executor)
            .unwrap()
            .iter()
            .map(|of| of.as_ref().unwrap().answer())
            .collect();
        let one = |subject: &Subject| {
            let check =
                Check { subject: subject.clone(), profiles: vec![profile.clone()], models: ModelId::ALL.to_vec() };
            check.run_without_boundaries().unwrap()[0].verdicts.answer()
        };
        assert_eq!(found, subjects.iter().map(one).collect::<Vec<_>>());
        assert!(found.contains(&Answer::Preventable) && found.contains(&Answer::NotPreventable), "{found:?}");
    }
}
