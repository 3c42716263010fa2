//! Counts of sampled lanes: exact integers and the worst lanes, for any set of sample indices. Tallies of disjoint sets
//! can be merged in any order.

use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::failure_map::{MAP_CELLS, MapAxes, MapCounts};
use super::injuries::InjurySums;
use super::kernel_counts::{KernelCounts, NO_KERNEL, add_counts};
use super::limit_state::limit_state;
use super::sample_options::SampleOptions;
use crate::engine::generated::{ATTEMPTS, DrawnPoint, Generator};
use crate::engine::{CLOSE_HEADWAY_S, Chunk, CountLayout, Counted, Counting, Headway, LanePlan, Verdicts};
use crate::model::criterion::Criterion;
use crate::run::close_following::CloseFollowing;
use crate::run::parts::MergeableCounts;
use crate::scenario::parameterization::Variable;
use crate::{Error, Place, Result};

/// Number of samples of one task.
const TASK: usize = 4096;

/// A lane with its limit state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorstSample {
    /// See [`limit_state`].
    pub value: f64,
    /// Lane index in the plan.
    pub lane: u64,
}

impl WorstSample {
    /// A total order: smaller value first, then the lane.
    pub(crate) fn is_worse_than(&self, other: &WorstSample) -> bool {
        self.value.total_cmp(&other.value).then(self.lane.cmp(&other.lane)).is_lt()
    }

    /// Inserts the lane into the list of the worst ones, in their order, if it is among the first `limit`.
    pub(crate) fn enter(self, worst: &mut Vec<WorstSample>, limit: usize) {
        // Fast path: most lanes are not among the worst.
        if worst.len() >= limit && worst.last().is_some_and(|last| !self.is_worse_than(last)) {
            return;
        }
        worst.insert(worst.partition_point(|known| known.is_worse_than(&self)), self);
        worst.truncate(limit);
    }
}

/// Counts over a set of samples of one plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleTally {
    plan_sha256: String,
    /// Disjoint, ascending, no two touch.
    covered: Vec<Range<u64>>,
    /// Number of indices without a valid point.
    pub voids: u64,
    /// Total number of draws.
    pub tries: u64,
    /// Failed lanes: headway × model × criterion, the last innermost.
    pub failures: Vec<u64>,
    /// Σ over samples of (number of failed headways)²: model × criterion.
    pub squares: Vec<u64>,
    /// Lanes that ended at the time cap: headway × model.
    pub capped: Vec<u64>,
    /// Lanes per model from headways below [`CLOSE_HEADWAY_S`].
    pub close_lanes: u64,
    /// Failed lanes from such headways: model × criterion.
    pub close_failures: Vec<u64>,
    /// The worst lanes of each model, ascending by (value, lane).
    pub worst: Vec<Vec<WorstSample>>,
    worst_limit: usize,
    /// The failure map.
    pub map: Option<MapCounts>,
    /// Samples and failures by kernel; `None` if the points do not come from kernels.
    pub by_kernel: Option<KernelCounts>,
    /// Sums of injury risks: curve × (headways, all) × model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) injuries: Vec<InjurySums>,
}

impl SampleTally {
    /// A tally without samples.
    pub fn empty(plan: &LanePlan, options: &SampleOptions) -> SampleTally {
        let (headways, models, criteria) = (plan.headways.len(), plan.models.len(), Criterion::ALL.len());
        SampleTally {
            plan_sha256: plan.hash().to_owned(),
            covered: Vec::new(),
            voids: 0,
            tries: 0,
            failures: vec![0; headways * models * criteria],
            squares: vec![0; models * criteria],
            capped: vec![0; headways * models],
            close_lanes: 0,
            close_failures: vec![0; models * criteria],
            worst: vec![Vec::new(); models],
            worst_limit: options.worst,
            map: options.map.as_ref().map(|axes| MapCounts::new(axes.clone(), headways * models)),
            by_kernel: KernelCounts::empty(plan),
            injuries: vec![[0; 4]; options.injury_sums(plan)],
        }
    }

    /// What a backend must count beside the lanes, for tallies of a plan with these options.
    pub fn counting(plan: &LanePlan, options: &SampleOptions) -> Counting {
        Counting {
            criterion: options.criterion,
            map: options.map.as_ref().map(MapAxes::counted),
            groups: KernelCounts::empty(plan).map_or(0, |counts| counts.shape()[0]),
        }
    }

    /// Counts a chunk that a backend has counted once more, from its verdicts.
    ///
    /// # Errors
    /// [`Error::Verification`] if the backend's counts are others; as [`SampleTally::of_chunk`].
    pub(crate) fn check_counted(plan: &LanePlan, chunk: &Chunk, options: &SampleOptions, backend: &str) -> Result<()> {
        if chunk.counted.is_none() {
            return Ok(());
        }
        let counted = SampleTally::of_chunk(plan, chunk, options)?;
        let lanes = (plan.first_lane_of(chunk.units.end) - chunk.first_lane) as usize;
        let own = |at: usize| match chunk.valued_lane(chunk.first_lane + at as u64) {
            Some(outcome) => outcome.verdicts,
            None => chunk.verdicts_of(at),
        };
        let verdicts = (0..lanes).into_par_iter().map(own).collect();
        let again = SampleTally::of_chunk(plan, &Chunk { verdicts, counted: None, ..chunk.clone() }, options)?;
        if counted == again {
            return Ok(());
        }
        Err(Error::Verification(format!(
            "{backend} counted samples {} to {} otherwise than the CPU counts their verdicts; use option `backend = cpu`",
            chunk.units.start,
            chunk.units.end - 1
        )))
    }

    /// Counts that a backend has made. The samples that it left are counted here.
    fn of_counted(plan: &LanePlan, chunk: &Chunk, counted: &Counted, options: &SampleOptions) -> SampleTally {
        let (layout, all) = (&counted.layout, &counted.counts);
        let mut tally = SampleTally {
            voids: all[CountLayout::VOIDS],
            tries: all[CountLayout::TRIES],
            close_lanes: all[CountLayout::CLOSE_LANES],
            failures: all[layout.failures()].to_vec(),
            squares: all[layout.squares()].to_vec(),
            capped: all[layout.capped()].to_vec(),
            close_failures: all[layout.close_failures()].to_vec(),
            ..SampleTally::empty(plan, options)
        };
        if let Some(map) = &mut tally.map {
            map.samples = all[layout.map_samples()].to_vec();
            let by_lane = all[layout.map_failures()].chunks(MAP_CELLS * MAP_CELLS);
            map.failures = by_lane.map(<[u64]>::to_vec).collect();
        }
        if let Some(counts) = &mut tally.by_kernel {
            *counts = KernelCounts::counted(&all[layout.kernel_samples()], &all[layout.kernel_failures()]);
        }
        let lanes = plan.headways.len() * plan.models.len();
        for &unit in &counted.left {
            let first = (unit - chunk.units.start) as usize * lanes;
            let verdicts = |at: usize| match chunk.valued_lane(chunk.first_lane + at as u64) {
                Some(outcome) => outcome.verdicts,
                None => chunk.verdicts_of(at),
            };
            let of_sample: Vec<Verdicts> = (first..first + lanes).map(verdicts).collect();
            let kernel = tally.count(plan, plan.generator(), (chunk, &of_sample), options, unit);
            if let Some(counts) = &mut tally.by_kernel {
                counts.count_sample(kernel, &of_sample);
            }
        }
        tally
    }

    /// Counts a chunk of a plan whose units are samples. If the plan holds the cases, every sample is valid at the
    /// first draw, and there is no map.
    ///
    /// # Errors
    /// [`Error::Internal`] for a chunk of another plan, without lanes, or without the outcomes that worst lanes need.
    pub fn of_chunk(plan: &LanePlan, chunk: &Chunk, options: &SampleOptions) -> Result<SampleTally> {
        let generator = plan.generator();
        if generator.is_none() && options.map.is_some() {
            return Err(Error::Internal("a plan that holds its cases has no points to map".to_owned()));
        }
        chunk.check(plan)?;
        let has_values = !chunk.outcomes.is_empty() || chunk.valued.is_some();
        let has_lanes = chunk.counted.is_some() || !chunk.verdicts.is_empty();
        let has_outcomes = chunk.outcomes.len() == chunk.verdicts.len();
        if !has_lanes || (options.worst > 0 && !has_values) || (options.injury.is_some() && !has_outcomes) {
            return Err(Error::Internal("a chunk does not have the lanes that are to be counted".to_owned()));
        }
        let units = chunk.units.clone();
        let mut tally = match &chunk.counted {
            Some(counted) => SampleTally::of_counted(plan, chunk, counted, options),
            None => SampleTally::of_verdicts(plan, chunk, options),
        };
        if options.worst > 0 {
            for (lane, outcome) in chunk.valued.iter().flatten() {
                let value = limit_state(&plan.profile, options.criterion, outcome);
                WorstSample { value, lane: *lane }.enter(&mut tally.worst[plan.model_of(*lane)], options.worst);
            }
        }
        tally.covered = vec![units];
        Ok(tally)
    }

    /// Counts the verdicts of a chunk.
    fn of_verdicts(plan: &LanePlan, chunk: &Chunk, options: &SampleOptions) -> SampleTally {
        let generator = plan.generator();
        let empty = || SampleTally { by_kernel: None, ..SampleTally::empty(plan, options) };
        let units = chunk.units.clone();
        let lanes = plan.headways.len() * plan.models.len();
        let mut kernels = vec![NO_KERNEL; (units.end - units.start) as usize];
        let tasks = kernels.par_chunks_mut(TASK).enumerate();
        let counted = tasks.fold(empty, |mut tally, (task, kernels)| {
            for (unit, kernel) in (units.start + (task * TASK) as u64..).zip(kernels) {
                let first = (unit - units.start) as usize * lanes;
                let of_sample = &chunk.verdicts[first..first + lanes];
                *kernel = tally.count(plan, generator, (chunk, of_sample), options, unit);
            }
            tally
        });
        // Integers and a total order, so the order of merging has no effect.
        let mut tally = counted.reduce(empty, |mut a, b| {
            a.add(b);
            a
        });
        tally.by_kernel = KernelCounts::empty(plan);
        if let Some(counts) = &mut tally.by_kernel {
            counts.count(plan, chunk, &kernels);
        }
        tally
    }

    /// Counts the lanes of one sample of a chunk; returns its kernel. Twin: `shaders/tally.wgsl`.
    fn count(
        &mut self,
        plan: &LanePlan,
        generator: Option<&Generator>,
        (chunk, lanes): (&Chunk, &[Verdicts]),
        options: &SampleOptions,
        unit: u64,
    ) -> u32 {
        let drawn = generator.map(|generator| generator.draw(unit));
        if drawn.as_ref().is_some_and(DrawnPoint::is_void) {
            self.voids += 1;
            self.tries += u64::from(ATTEMPTS);
            return NO_KERNEL;
        }
        self.tries += drawn.as_ref().map_or(1, |drawn| u64::from(drawn.tries));
        let (headways, models, criteria) = (plan.headways.len(), plan.models.len(), Criterion::ALL.len());
        let first = (unit - chunk.units.start) as usize * headways * models;
        let is_close = |headway: usize| is_close(plan, drawn.as_ref(), unit, headway);
        self.close_lanes += (0..headways).filter(|at| is_close(*at)).count() as u64;
        let cell = self.map.as_ref().zip(drawn.as_ref()).and_then(|(map, drawn)| map.axes.cell(&drawn.values));
        for model in 0..models {
            let mut failed = [0_u64; Criterion::ALL.len()];
            for headway in 0..headways {
                let at = headway * models + model;
                let verdicts = lanes[at];
                self.capped[at] += u64::from(verdicts.capped());
                for criterion in Criterion::ALL {
                    let fails = u64::from(verdicts.failed(criterion));
                    self.failures[at * criteria + criterion.index()] += fails;
                    failed[criterion.index()] += fails;
                    if fails > 0 && is_close(headway) {
                        self.close_failures[model * criteria + criterion.index()] += 1;
                    }
                }
                if self.worst_limit > 0
                    && let Some(outcome) = chunk.outcomes.get(first + at)
                {
                    let value = limit_state(&plan.profile, options.criterion, outcome);
                    let lane = chunk.first_lane + (first + at) as u64;
                    WorstSample { value, lane }.enter(&mut self.worst[model], self.worst_limit);
                }
            }
            for (square, k) in self.squares[model * criteria..].iter_mut().zip(failed) {
                *square += k * k;
            }
        }
        if let Some(injury) = &options.injury {
            injury.count(&mut self.injuries, &chunk.outcomes[first..first + headways * models], models);
        }
        if let (Some(map), Some(cell)) = (&mut self.map, cell) {
            map.samples[cell] += 1;
            for (failures, verdicts) in map.failures.iter_mut().zip(lanes) {
                failures[cell] += u64::from(verdicts.failed(options.criterion));
            }
        }
        let kernel = generator.zip(drawn).and_then(|(generator, drawn)| generator.points.component(unit, drawn.tries));
        kernel.unwrap_or(NO_KERNEL)
    }

    /// Adds counts of other samples; the caller joins the covered intervals.
    fn add(&mut self, other: SampleTally) {
        self.voids = self.voids.saturating_add(other.voids);
        self.tries = self.tries.saturating_add(other.tries);
        add_counts(&mut self.failures, &other.failures);
        add_counts(&mut self.squares, &other.squares);
        add_counts(&mut self.capped, &other.capped);
        self.close_lanes = self.close_lanes.saturating_add(other.close_lanes);
        add_counts(&mut self.close_failures, &other.close_failures);
        for (worst, lanes) in self.worst.iter_mut().zip(other.worst) {
            lanes.into_iter().for_each(|lane| lane.enter(worst, self.worst_limit));
        }
        if let (Some(ours), Some(theirs)) = (&mut self.map, &other.map) {
            ours.add(theirs);
        }
        if let (Some(ours), Some(theirs)) = (&mut self.by_kernel, &other.by_kernel) {
            ours.add(theirs);
        }
        self.injuries.iter_mut().zip(&other.injuries).for_each(|(ours, theirs)| add_counts(ours, theirs));
    }

    /// Merges the counts of other samples of the same plan: associative and commutative.
    ///
    /// # Errors
    /// [`Error::Input`] if the plans or the kinds of counts differ, or a sample is in both.
    pub fn merge(mut self, other: SampleTally) -> Result<SampleTally> {
        let place = || Place::item("part of a sampling run");
        if self.plan_sha256 != other.plan_sha256 {
            let problem = format!("it belongs to plan {}, not to {}", other.plan_sha256, self.plan_sha256);
            return Err(Error::input(place(), problem, "join only parts of one run: same density, flags and seed"));
        }
        let axes = |tally: &SampleTally| tally.map.as_ref().map(|map| map.axes.clone());
        if self.shape() != other.shape() {
            return Err(Error::input(place(), "the parts have other models or headways", "make the part again"));
        }
        if self.worst_limit != other.worst_limit || axes(&self) != axes(&other) {
            let help = "make all parts with the same option `worst`, option `criterion` and option `map`";
            return Err(Error::input(place(), "the parts counted different things", help));
        }
        let mut covered = std::mem::take(&mut self.covered);
        covered.extend(other.covered.iter().cloned());
        covered.sort_by_key(|range| range.start);
        let mut joined: Vec<Range<u64>> = Vec::new();
        for range in covered {
            match joined.last_mut() {
                Some(last) if last.end > range.start => {
                    let problem = format!("samples {} to {} are in both", range.start, last.end.min(range.end) - 1);
                    return Err(Error::input(place(), problem, "give every part once"));
                }
                Some(last) if last.end == range.start => last.end = range.end,
                _ => joined.push(range),
            }
        }
        self.covered = joined;
        self.add(other);
        Ok(self)
    }

    /// Sizes of the lists of counts, which follow from models, headways and criteria.
    fn shape(&self) -> [usize; 8] {
        let [groups, counts] = self.by_kernel.as_ref().map_or([0, 0], KernelCounts::shape);
        let close = self.close_failures.len();
        [
            self.failures.len(),
            self.squares.len(),
            self.capped.len(),
            self.worst.len(),
            groups,
            counts,
            close,
            self.injuries.len(),
        ]
    }

    /// Lanes and failures, in total and from short headways.
    pub fn close_following(&self) -> CloseFollowing {
        let cells = self.close_failures.len().max(1);
        let all = |at: usize| self.failures.iter().skip(at).step_by(cells).sum();
        let lanes = self.valid() * (self.failures.len() / cells) as u64;
        let failures = self.close_failures.iter().enumerate().map(|(at, close)| [*close, all(at)]);
        CloseFollowing { close_lanes: self.close_lanes, lanes, failures: failures.collect() }
    }

    /// Worst lanes kept per model.
    pub fn worst_limit(&self) -> usize {
        self.worst_limit
    }

    /// The samples counted, as disjoint intervals, ascending.
    pub fn covered(&self) -> &[Range<u64>] {
        &self.covered
    }

    /// Number of samples counted, void ones included.
    pub fn samples(&self) -> u64 {
        self.covered.iter().map(|r| r.end - r.start).sum()
    }

    /// Number of samples with a valid point.
    pub fn valid(&self) -> u64 {
        self.samples() - self.voids
    }
}

impl MergeableCounts for SampleTally {
    fn covered(&self) -> Vec<Range<u64>> {
        self.covered.clone()
    }

    fn join(self, other: Self) -> Result<Self> {
        self.merge(other)
    }
}

/// Whether the lane of a sample starts below [`CLOSE_HEADWAY_S`]. A drawn headway is in the point; if the plan holds
/// the cases, the headway follows from the gap of the case.
fn is_close(plan: &LanePlan, drawn: Option<&DrawnPoint>, unit: u64, headway: usize) -> bool {
    let start = match (plan.headways[headway], plan.generator().zip(drawn)) {
        (Headway::ThwS(thw_s), _) => return thw_s < CLOSE_HEADWAY_S,
        (_, Some((generator, drawn))) => {
            let slot = generator.recipe.slots[Variable::TimeHeadway as usize] as usize;
            return drawn.values.get(slot).is_some_and(|thw_s| f64::from(*thw_s) < CLOSE_HEADWAY_S);
        }
        (headway, None) => headway.start::<f64>(),
    };
    let case = plan.case(0, unit, 0);
    start.gap(case.ego_speed) + case.others[0].gap_offset < CLOSE_HEADWAY_S * case.ego_speed
}
