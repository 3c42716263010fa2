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
