//! Comparison of the lane arithmetic with the f64 reference, lane by lane: which verdicts differ, and how close each is
//! to the threshold.

use super::{StudyCases, WINDOW};
use lanesweep_engine::{Backend, Chunk, CpuBackend, LanePlan, Outcome, Wanted, chunks};
use lanesweep_model::criterion::Criterion;
use lanesweep_support::Result;

/// A verdict that differs between f32 and f64.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Key of the lane.
    pub lane: String,
    /// Criterion.
    pub criterion: Criterion,
    /// Whether it failed in f32; in f64 the verdict is the opposite.
    pub failed_in_f32: bool,
    /// Distance of the f64 value from the threshold: TTC in s, BTN, for a collision the minimum gap in m.
    pub distance: f64,
}

/// Result of a comparison.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReferenceComparison {
    /// Lanes compared.
    pub lanes: u64,
    /// Verdicts that differ.
    pub differences: Vec<Difference>,
    /// Lanes in which only one arithmetic reached the time cap; information, not a verdict.
    pub cap_differs: u64,
}

impl ReferenceComparison {
    /// Runs every lane of a study in f32 and in f64, chunk by chunk.
    ///
    /// # Errors
    /// Errors of the lanes.
    pub fn of_study(study: &StudyCases) -> Result<ReferenceComparison> {
        let (narrow, wide) = (CpuBackend::lane_arithmetic(), CpuBackend::reference());
        let mut comparison = ReferenceComparison::default();
        study.in_windows(0..study.outline().unit_count(), WINDOW, |plan, window| {
            let (mut narrow, mut wide) = (narrow.prepare(plan)?, wide.prepare(plan)?);
            for units in chunks(plan, window) {
                let reference = wide.run(units.clone(), Wanted::Outcomes)?;
                comparison.add(plan, &narrow.run(units, Wanted::Outcomes)?, &reference);
            }
            Ok(())
        })?;
        Ok(comparison)
    }

    /// Adds two chunks of the same units.
    pub(crate) fn add(&mut self, plan: &LanePlan, narrow: &Chunk, wide: &Chunk) {
        let thresholds = (plan.profile.criteria.ttc_threshold_s, plan.profile.criteria.btn_threshold);
        for (at, (f32, f64)) in narrow.outcomes.iter().zip(&wide.outcomes).enumerate() {
            self.lanes += 1;
            self.cap_differs += u64::from(f32.verdicts.capped() != f64.verdicts.capped());
            for criterion in Criterion::ALL {
                let failed = f32.verdicts.failed(criterion);
                if failed == f64.verdicts.failed(criterion) {
                    continue;
                }
                let lane = plan.key(narrow.first_lane + at as u64).map_or(String::new(), |k| plan.key_text(&k));
                let distance = distance(criterion, f64, f32, thresholds);
                self.differences.push(Difference { lane, criterion, failed_in_f32: failed, distance });
            }
        }
    }
}

/// Distance of the value nearest to the threshold. A contact makes the value of its side infinite or 0, so the other
/// side's is used.
fn distance(criterion: Criterion, a: &Outcome<f64>, b: &Outcome<f64>, (ttc, btn): (f64, f64)) -> f64 {
    let of = |o: &Outcome<f64>| match criterion {
        Criterion::Collision => o.min_gap.abs(),
        Criterion::Ttc => (o.min_ttc - ttc).abs(),
        Criterion::Btn => (o.max_btn - btn).abs(),
    };
    of(a).min(of(b))
}
