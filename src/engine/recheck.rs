//! Recomputes one in a thousand lanes of a device, or of batches that skip steps, on the CPU with every step. A
//! difference stops the run.

use std::ops::Range;

use rayon::prelude::*;

use super::backend::{Chunk, RecheckBy};
use super::cpu::runner::LaneRunner;
use super::cpu::simd::Instructions;
use super::outcome::{Outcome, Verdicts};
use super::plan::{LaneKey, LanePlan};
use lanesweep_support::{Error, Result, option};

/// Default sampling rate: one lane in 1000 is rechecked.
const ONE_IN: u64 = 1000;

/// One in this many of the lanes of CPU batches that are rechecked in batches is also rechecked as a single lane. A
/// single lane costs about forty times a lane of batches that skip steps, and four to ten times a lane of other batches.
const SINGLE_ONE_IN: u64 = 4;
/// The same for lanes of a device, which share no code with either.
const SINGLE_ONE_IN_OF_DEVICE: u64 = 16;

/// Lanes of one task.
const TASK: usize = 1024;

/// A seeded sample of a plan's lanes: one of each `one_in` consecutive lanes. The selection depends only on seed and
/// lane, not on chunks.
pub(super) struct Recheck<'p> {
    plan: &'p LanePlan,
    recompute: Box<dyn Recompute + 'p>,
    options: RecheckOptions,
}

/// Which lanes are recomputed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecheckOptions {
    /// Selects the lanes.
    pub seed: u64,
    /// One lane in this many, at least 1.
    pub one_in: u64,
}

impl RecheckOptions {
    /// One lane in `ONE_IN`.
    pub(crate) fn of_seed(seed: u64) -> Self {
        RecheckOptions { seed, one_in: ONE_IN }
    }

    /// The selected lanes of an interval, ascending.
    fn chosen(self, lanes: Range<u64>) -> impl Iterator<Item = u64> {
        let (seed, one_in) = (self.seed, self.one_in.max(1));
        (lanes.start / one_in..lanes.end.div_ceil(one_in))
            .map(move |stratum| stratum * one_in + mixed(seed, stratum) % one_in)
            .filter(move |lane| lanes.contains(lane))
    }
}

/// Recomputes lanes with every step.
trait Recompute: Sync {
    /// Outcome of a single lane.
    fn single(&self, key: &LaneKey) -> Outcome<f32>;
    /// Verdicts of lanes of one block and model in batches; `each` receives the position in `keys` and the verdicts.
    fn batched(&self, keys: &[LaneKey], each: &mut dyn FnMut(usize, Verdicts));
}

impl Recompute for LaneRunner<'_, f32> {
    fn single(&self, key: &LaneKey) -> Outcome<f32> {
        self.run(key)
    }

    fn batched(&self, keys: &[LaneKey], each: &mut dyn FnMut(usize, Verdicts)) {
        self.run_keys(Instructions::best(), keys, each);
    }
}

impl<'p> Recheck<'p> {
    pub(super) fn new(plan: &'p LanePlan, options: RecheckOptions) -> Self {
        Recheck { plan, recompute: Box::new(LaneRunner::of_few(plan)), options }
    }

    /// Recomputes the selected lanes of a chunk and compares every word that the chunk has. Returns their number.
    /// `backend` describes what computed the chunk.
    ///
    /// # Errors
    /// [`Error::Verification`] with the first lane that differs.
    pub(super) fn check(&self, chunk: &Chunk, backend: &str, by: RecheckBy) -> Result<u64> {
        let end = self.plan.first_lane_of(chunk.units.end);
        if end == chunk.first_lane || by == RecheckBy::Nothing {
            return Ok(0);
        }
        let mut keys: Vec<LaneKey> =
            self.options.chosen(chunk.first_lane..end).filter_map(|lane| self.plan.key(lane)).collect();
        // There is no second implementation of a driver outside the registry.
        keys.retain(|key| self.plan.models[key.model].foreign().is_none());
        keys.sort_by_key(|key| (key.block, key.model));
        let groups = keys.chunk_by(|a, b| (a.block, a.model) == (b.block, b.model));
        let tasks: Vec<&[LaneKey]> = groups.flat_map(|group| group.chunks(TASK)).collect();
        let differing = tasks.into_par_iter().filter_map(|keys| self.first_differing(chunk, by, keys));
        match differing.min() {
            Some(lane) => Err(self.mismatch(chunk, lane, backend, by)),
            None => Ok(keys.len() as u64),
        }
    }

    /// The first lane of one block and model that differs.
    fn first_differing(&self, chunk: &Chunk, by: RecheckBy, keys: &[LaneKey]) -> Option<u64> {
        let mut first: Option<u64> = None;
        let mut compare = |key: &LaneKey, is_same: &dyn Fn(usize) -> bool| {
            let lane = self.plan.lane(key);
            if !is_same((lane - chunk.first_lane) as usize) {
                first = Some(first.map_or(lane, |first| first.min(lane)));
            }
        };
        let is_batched = chunk.outcomes.is_empty();
        let one_in = if by == RecheckBy::Batches { SINGLE_ONE_IN } else { SINGLE_ONE_IN_OF_DEVICE };
        for key in keys.iter().filter(|key| !is_batched || self.is_single(key, one_in)) {
            let ours = self.recompute.single(key);
            compare(key, &|at| match chunk.outcomes.get(at) {
                Some(theirs) => same_words(&ours.widen(), theirs),
                None => chunk.verdicts_of(at) == ours.verdicts,
            });
        }
        if is_batched {
            self.recompute.batched(keys, &mut |at, ours| compare(&keys[at], &|at| chunk.verdicts_of(at) == ours));
        }
        first
    }

    /// Whether a lane that is rechecked in a batch is also rechecked as a single lane.
    fn is_single(&self, key: &LaneKey, one_in: u64) -> bool {
        mixed(!self.options.seed, self.plan.lane(key)).is_multiple_of(one_in)
    }

    fn mismatch(&self, chunk: &Chunk, lane: u64, backend: &str, by: RecheckBy) -> Error {
        let Some(key) = self.plan.key(lane) else {
            return Error::Internal(format!("lane {lane} was checked and is beyond the plan"));
        };
        let (at, ours) = ((lane - chunk.first_lane) as usize, self.recompute.single(&key));
        let verdict_bits = |verdicts: Verdicts| format!("verdict bits {:#06b}", verdicts.0);
        let (found, expected) = match chunk.outcomes.get(at) {
            Some(theirs) => (format!("{theirs:?}"), format!("{:?}", ours.widen())),
            None => (verdict_bits(chunk.verdicts_of(at)), verdict_bits(ours.verdicts)),
        };
        let lane = self.plan.key_text(&key);
        let model = self.plan.models[key.model].name();
        Error::Verification(match by {
            RecheckBy::Batches => format!(
                "lane {lane}: {backend} says {found} where steps are left out, a single lane with every step made \
                 {expected}. Nothing that was computed here can be trusted: a promise by which {model} lets steps be \
                 left out (`safe_gap`, `ignores`, `steady_gap`, `check_steady`, `SEES_…`, `KEEPS_…`) does not hold. \
                 Correct it, or take it out of the model"
            ),
            RecheckBy::Nothing | RecheckBy::Lanes => format!(
                "lane {lane}: {backend} says {found}, the CPU {expected}. Nothing that this device computed can be \
                 trusted; `lanesweep verify` tells how often it errs, {} computes without it",
                option("backend = cpu")
            ),
        })
    }
}

/// Whether all words are equal, bit for bit: NaN equals itself, 0 does not equal −0.
pub fn same_words(a: &Outcome<f64>, b: &Outcome<f64>) -> bool {
    words(a) == words(b)
}

/// The fields of an outcome as words with their names, in order; values as the bits of their exact widening.
pub fn words(outcome: &Outcome<f64>) -> [(&'static str, u64); 17] {
    // Destructures every field, so that a new field must be compared.
    macro_rules! words {
        ($($field:ident: $word:expr;)+) => {{
            let &Outcome { $($field),+ } = outcome;
            [$((stringify!($field), $word)),+]
        }};
    }
    words! {
        verdicts: verdicts.0.into();
        contact: contact.code().into();
        contact_with: contact_with.into();
        end: end as u64;
        reaction_step: reaction_step.into();
        contact_step: contact_step.into();
        end_step: end_step.into();
        impact_speed: impact_speed.to_bits();
        impact_closing_speed: impact_closing_speed.to_bits();
        min_ttc: min_ttc.to_bits();
        max_btn: max_btn.to_bits();
        min_gap: min_gap.to_bits();
        min_thw: min_thw.to_bits();
        max_drac: max_drac.to_bits();
        tet_steps: tet_steps.into();
        tit: tit.to_bits();
        // No value has these bits.
        pet: pet.map_or(u64::MAX, f64::to_bits);
    }
}

/// A pseudorandom number for each seed and index (SplitMix64).
fn mixed(seed: u64, index: u64) -> u64 {
    let mut z = seed.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::lane_stream::run_stream;
    use crate::cpu::pending_lanes::Lanes;
    use crate::cpu::series::Series;
    use crate::drivers::Constants;
    use crate::frame::Simulation;
    use crate::lane::{run_lane, silent};
    use crate::scene::{Scene, fastest_in, may_cross};
    use crate::verify::{SetOptions, random_plan};
    use crate::{Backend, Executor, LaneCase, Session, SweepSummary, Wanted};
    use lanesweep_model::driver::{DriverModel, DriverState, Fsm, Hazard, ModelId, View};
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scalar::{Flag, Real};
    use lanesweep_model::scenario::{Category, Tables};

    #[derive(Debug, Clone, Copy, PartialEq)]
    enum FalsePromise {
        /// A safe distance of 0, where the driver brakes from 40 m down to 20 m.
        SafeGap,
        /// Every vehicle beside the lane is ignored, where the driver brakes for them.
        Ignores,
        /// The driver follows steadily at every gap, and `check_steady` never reacts.
        Ease,
    }

    /// A driver model that makes a false promise: one, because each is compiled into all loops.
    #[derive(Debug, Clone, Copy)]
    struct Promising(Fsm<f32>, FalsePromise);

    impl DriverModel<f32> for Promising {
        const SEES_LATERAL_SPEED: bool = <Fsm<f32> as DriverModel<f32>>::SEES_LATERAL_SPEED;
        const SEES_OWN_ACCELERATION: bool = <Fsm<f32> as DriverModel<f32>>::SEES_OWN_ACCELERATION;
        const KEEPS_DECELERATION: bool = <Fsm<f32> as DriverModel<f32>>::KEEPS_DECELERATION;
        const KNOWS_STEADY_FOLLOWING: bool = <Fsm<f32> as DriverModel<f32>>::KNOWS_STEADY_FOLLOWING;

        fn safe_gap(&self, v_ego: f32, v_other: f32) -> f32 {
            if self.1 == FalsePromise::SafeGap { 0.0 } else { self.0.safe_gap(v_ego, v_other) }
        }

        fn ignores(&self, lateral_gap: f32, lateral_towards: f32, marking_gap: f32) -> Flag {
            Flag::of(self.1 == FalsePromise::Ignores) | self.0.ignores(lateral_gap, lateral_towards, marking_gap)
        }

        fn steady_gap(&self, v_ego: f32, v_other: f32) -> f32 {
            if self.1 == FalsePromise::Ease { 0.0 } else { self.0.steady_gap(v_ego, v_other) }
        }

        fn check_steady(&self, view: &View<f32>) -> Hazard<f32> {
            let hazard = self.0.check_steady(view);
            Hazard { is_unsafe: hazard.is_unsafe & !Flag::of(self.1 == FalsePromise::Ease), ..hazard }
        }

        fn initial(&self) -> DriverState<f32> {
            self.0.initial()
        }

        fn check(&self, view: &View<f32>) -> Hazard<f32> {
            let hazard = self.0.check(view);
            let is_unsafe = match self.1 {
                FalsePromise::SafeGap => Flag::of(view.gap > 20.0 && view.gap < 40.0) & view.lateral_gap.is_negative(),
                FalsePromise::Ignores => {
                    hazard.is_unsafe | (Flag::of(view.gap < 40.0) & !view.lateral_gap.is_negative())
                }
                FalsePromise::Ease => hazard.is_unsafe,
            };
            Hazard { is_unsafe, ..hazard }
        }

        fn shader_constants(&self) -> Vec<(&'static str, f64)> {
            self.0.shader_constants()
        }

        fn react(&self, state: DriverState<f32>, hazard: &Hazard<f32>, v_ego: f32) -> (DriverState<f32>, f32) {
            self.0.react(state, hazard, v_ego)
        }
    }

    /// The lanes of a plan of one block and model, with this model in its place.
    #[derive(Clone, Copy)]
    struct Instead<'p> {
        plan: &'p LanePlan,
        model: Promising,
        every_step: bool,
    }

    impl Instead<'_> {
        /// Runs the lanes of one case at a time, so that they share their properties.
        fn run(&self, keys: &[LaneKey], every_step: bool, mut each: impl FnMut(usize, Verdicts)) {
            let mut from = 0;
            for lanes in keys.chunk_by(|a, b| (a.unit, a.variant) == (b.unit, b.variant)) {
                self.run_case(lanes, every_step, |at, of| each(from + at, of));
                from += lanes.len();
            }
        }

        fn run_case(&self, keys: &[LaneKey], every_step: bool, each: impl FnMut(usize, Verdicts)) {
            let plan = self.plan;
            let constants = Constants::<f32>::resolve(&plan.profile, plan.blocks[0].category);
            let tables: Tables<f32> = plan.tables().cast();
            let case = |key: &LaneKey| plan.case(0, key.unit, key.variant).cast();
            let cases: Vec<LaneCase<f32>> = keys.iter().map(case).collect();
            let starts: Vec<_> = keys.iter().map(|key| plan.headways[key.headway].start()).collect();
            let (mut series, cap) = (Series::default(), plan.profile.step_cap());
            let tracks: Vec<_> = cases.iter().map(|case| series.unroll(case, &tables, cap)).collect();
            let may_cross =
                cases.iter().any(|case| may_cross(case, fastest_in(&tables), plan.profile.frame.dt_s as f32));
            let scene = Scene::of(&cases, ModelId::Fsm.index(), may_cross);
            let (cases, tracks, starts) = (&cases[..], &tracks[..], &starts[..]);
            let stream = Lanes { cases, tracks, starts, one_start_each: true, every_step, may_cross };
            let (frame, criteria) = (&constants.frames[ModelId::Fsm.index()], &constants.criteria);
            let simulation =
                Simulation { frame, criteria, model: &self.model, model_index: ModelId::Fsm.index(), scene };
            run_stream(&simulation, Instructions::best(), &stream, series.entries(), each);
        }
    }

    impl Recompute for Instead<'_> {
        fn single(&self, key: &LaneKey) -> Outcome<f32> {
            let constants = Constants::<f32>::resolve(&self.plan.profile, self.plan.blocks[0].category);
            let (frame, criteria) = (&constants.frames[ModelId::Fsm.index()], &constants.criteria);
            let case = self.plan.case(0, key.unit, key.variant).cast();
            let (model_index, scene) = (ModelId::Fsm.index(), Scene::unknown(case.pair != 0));
            let simulation = Simulation { frame, criteria, model: &self.model, model_index, scene };
            let start = self.plan.headways[key.headway].start();
            run_lane(&simulation, &case, &self.plan.tables().cast(), start, silent)
        }

        fn batched(&self, keys: &[LaneKey], each: &mut dyn FnMut(usize, Verdicts)) {
            self.run(keys, true, each);
        }
    }

    impl Backend for Instead<'_> {
        fn rechecked_by(&self, _: Wanted) -> RecheckBy {
            RecheckBy::Batches
        }

        fn describe(&self) -> String {
            "CPU, a user's own model".to_owned()
        }

        fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
            Ok(Box::new(Instead { plan, ..*self }))
        }
    }

    impl Session for Instead<'_> {
        fn chunk_lanes(&self, _: Wanted) -> u64 {
            1 << 12
        }

        fn run(&mut self, units: Range<u64>, _: Wanted) -> Result<Chunk> {
            let lanes = self.plan.first_lane_of(units.start)..self.plan.first_lane_of(units.end);
            let first_lane = lanes.start;
            let keys: Vec<LaneKey> = lanes.map(|lane| self.plan.key(lane).unwrap()).collect();
            let mut verdicts = vec![Verdicts::default(); keys.len()];
            Instead::run(self, &keys, self.every_step, |at, of| verdicts[at] = of);
            let outcomes = Vec::new();
            Ok(Chunk { units, first_lane, verdicts, outcomes, counted: None, redone_and_rechecked: [0; 2] })
        }
    }

    /// Sweeps random lanes of a category whose steps are skipped because of a false promise, and the same lanes with
    /// every step.
    fn swept(category: Category, promise: FalsePromise) -> (Error, SweepSummary) {
        let (profile, models) = (Profile::load("paper").unwrap(), vec![ModelId::Fsm]);
        let options = SetOptions { size: 20_000, categories: vec![category], models, ..Default::default() };
        let plan = random_plan(&profile, &options).unwrap();
        let model = Promising(Constants::resolve(&profile, category).fsm, promise);
        let left_out = Instead { plan: &plan, model, every_step: false };
        let options = RecheckOptions { seed: 157, one_in: 20 };
        let recheck = Recheck { plan: &plan, recompute: Box::new(left_out), options };
        let run = |every_step| {
            let backend = Instead { every_step, ..left_out };
            let (executor, units) = (Executor::new(backend), 0..plan.unit_count());
            executor.sweep_checked(&plan, units, Wanted::Verdicts, Some(&recheck), |_| Ok(()))
        };
        (run(false).expect_err(&format!("{promise:?}")), run(true).unwrap())
    }

    /// One test for each way to skip work: quiescent steps, lanes with the lead only, steady following.
    #[test]
    fn a_false_promise_of_every_kind_stops_the_run_and_names_the_lane() {
        if Instructions::best() == Instructions::Scalar {
            return;
        }
        let found = [
            swept(Category::Lvd, FalsePromise::SafeGap),
            swept(Category::CutOut, FalsePromise::Ignores),
            swept(Category::Lvd, FalsePromise::Ease),
        ];
        for ((error, with_every_step), names) in found.into_iter().zip(["lvd", "cut-out", "lvd"]) {
            let text = error.to_string();
            assert!(matches!(error, Error::Verification(_)), "{text}");
            assert!(text.contains(&format!("lane random-{names}-seed157-")) && text.contains("left out"), "{text}");
            let SweepSummary { lanes, rechecked_lanes, .. } = with_every_step;
            assert_eq!(rechecked_lanes, lanes.div_ceil(20), "without steps left out nothing is wrong");
        }
    }

    /// The same lanes are selected for any division into chunks.
    #[test]
    fn seed_and_lane_alone_choose_what_is_checked() {
        let (options, end) = (RecheckOptions { seed: 7, one_in: 100 }, 123_400);
        let all: Vec<u64> = options.chosen(0..end).collect();
        assert_eq!(all.len(), 1234);
        for cut in [1, 99, 100, 12_345] {
            let parts = (0..end).step_by(cut).flat_map(|from| options.chosen(from..(from + cut as u64).min(end)));
            assert_eq!(parts.collect::<Vec<_>>(), all, "{cut}");
        }
    }
}
