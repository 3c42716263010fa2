//! The limit state of a lane: one number that is ≤ 0 exactly if a criterion failed, and decreases towards failure. Also
//! evaluates points as lanes for the estimators.

use std::ops::Range;

use super::plan::{plan_draws, plan_points};
use super::sample_options::{Question, SampleHeadways};
use lanesweep_engine::{Executor, Outcome, Wanted};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_random::Stream;
use lanesweep_stats::density::{DensityModel, Mixture};
use lanesweep_stats::estimate::{Density, Failure, KernelShares, LimitState, Truncated, kernel_shares};
use lanesweep_support::Result;

/// Value far from any failure: the ego never closed in.
const FAR: f64 = 1e3;
/// Larger Brake Threat Numbers count as this one: an infinite value says only that no braking helps.
const MAX_BTN: f64 = 10.0;
/// Minimum value of a lane that did not fail, against rounding to the wrong side.
const MIN_UNFAILED: f64 = 1e-12;

/// Limit state of a lane. The verdict decides the sign.
///
/// | criterion | before failure | after |
/// |---|---|---|
/// | collision | smallest TTC, s | −(closing speed at the contact), m/s |
/// | TTC | smallest TTC − threshold, s | the same |
/// | BTN | threshold − largest BTN | the same, −(10 − threshold) at least |
///
/// The minimum TTC of a near miss goes to 0 with the remaining gap (braking ends √(2·gap/deceleration) before it). The
/// closing speed of a contact goes to 0 towards the near miss. So the value is continuous at the collision limit,
/// except for a side contact with a vehicle that is being passed.
pub fn limit_state(profile: &Profile, criterion: Criterion, outcome: &Outcome<f64>) -> f64 {
    let failed = outcome.verdicts.failed(criterion);
    let ttc = outcome.min_ttc.min(FAR);
    let value = match criterion {
        Criterion::Collision if failed => -outcome.impact_closing_speed.abs(),
        Criterion::Collision => ttc,
        Criterion::Ttc => ttc - profile.criteria.ttc_threshold_s,
        Criterion::Btn => profile.criteria.btn_threshold - outcome.max_btn.min(MAX_BTN),
    };
    if failed { value.min(0.0) } else { value.max(MIN_UNFAILED) }
}

/// Lanes as a limit state with several questions, over the points of a density. Each has three guides: the [limit
/// state](limit_state()), the smallest gap, and the reciprocal of the largest BTN. A creeping approach has a small TTC
/// without danger; the others tell.
pub struct LaneLimitState<'a> {
    density: &'a DensityModel,
    profile: &'a Profile,
    models: Vec<ModelId>,
    headways: SampleHeadways,
    /// Lane of a point and criterion.
    questions: Vec<(usize, Criterion)>,
    executor: Executor<'a>,
}

impl<'a> LaneLimitState<'a> {
    /// The lanes of some questions; `headways` are those of the run. The lanes are not rechecked.
    pub fn new(
        density: &'a DensityModel,
        profile: &'a Profile,
        headways: &SampleHeadways,
        questions: &[Question],
        executor: Executor<'a>,
    ) -> LaneLimitState<'a> {
        let (mut models, mut asked) = (Vec::new(), Vec::new());
        let places: Vec<(usize, usize)> =
            questions.iter().map(|of| (place(&mut models, of.model), place(&mut asked, of.headway))).collect();
        let lane =
            |((model, headway), of): (&(usize, usize), &Question)| (headway * models.len() + model, of.criterion);
        let questions = places.iter().zip(questions).map(lane).collect();
        let headways = match headways {
            SampleHeadways::Each(list) => SampleHeadways::Each(asked.iter().map(|at| list[*at]).collect()),
            SampleHeadways::Sampled => SampleHeadways::Sampled,
        };
        let executor = Executor { recheck: None, ..executor };
        LaneLimitState { density, profile, models, headways, questions, executor }
    }
}

/// The place of a value in a list, to which it is added if it is new.
pub(super) fn place<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    list.iter().position(|known| *known == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

impl LimitState for LaneLimitState<'_> {
    fn questions(&self) -> usize {
        self.questions.len()
    }

    fn guides(&self) -> usize {
        3
    }

    fn evaluate(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        let plan = plan_points(self.density, points, self.profile, &self.models, &self.headways)?;
        let lanes = self.models.len() * plan.headways.len();
        let mut values = Vec::with_capacity(3 * points.len() * self.questions.len());
        self.executor.sweep(&plan, 0..plan.unit_count(), Wanted::Outcomes, |chunk| {
            for outcomes in chunk.outcomes.chunks(lanes) {
                for (lane, criterion) in &self.questions {
                    let outcome = &outcomes[*lane];
                    let value = limit_state(self.profile, *criterion, outcome);
                    let guide = |guide: f64| if value <= 0.0 { value } else { guide.clamp(MIN_UNFAILED, FAR) };
                    values.extend([value, guide(outcome.min_gap), guide(1.0 / outcome.max_btn)]);
                }
            }
            Ok(())
        })?;
        Ok(values)
    }

    /// Draws where the lanes run, and computes verdicts alone.
    fn failures(&self, _density: &dyn Density, stream: Stream, indices: Range<u64>) -> Result<Vec<Failure>> {
        let plan = plan_draws(self.density, stream, self.profile, indices.end, &self.models, &self.headways)?;
        let lanes = self.models.len() * plan.headways.len();
        let Some(generator) = plan.generator() else { return Ok(Vec::new()) };
        let mut failures = Vec::new();
        self.executor.sweep(&plan, indices, Wanted::Verdicts, |chunk| {
            for (index, verdicts) in chunk.units.clone().zip(chunk.verdicts.chunks(lanes)) {
                let failed = |(lane, criterion): &(usize, Criterion)| verdicts[*lane].failed(*criterion);
                if !self.questions.iter().any(failed) {
                    continue;
                }
                let Some(point) = generator.point(index) else { continue };
                failures.push(Failure { index, point, fails: self.questions.iter().map(failed).collect() });
            }
            Ok(())
        })?;
        Ok(failures)
    }
}

/// The density of a density file, truncated to its valid region.
///
/// # Errors
/// As [`Truncated::with_validity`].
pub fn truncated(density: &DensityModel) -> Result<Truncated<impl Fn(&[f64]) -> bool + Sync + '_>> {
    Truncated::with_validity(density.kde.mixture()?, |point| density.space.is_valid(point), density.valid.estimate)
}

/// Determines which scenarios failures come from, by draws of a proposal and about `crude` draws of the density. `None`
/// for a question without failing draws.
///
/// # Errors
/// Those of the lanes.
pub(crate) fn scenario_shares(
    lanes: &LaneLimitState,
    proposal: &Mixture,
    (seed, crude): (u64, u64),
) -> Result<Vec<Option<KernelShares>>> {
    let nominal = truncated(lanes.density)?;
    kernel_shares(nominal.kernels(), &nominal, proposal, lanes, (seed, crude))
}
