//! Counts of any set of samples of a plan. Tallies of disjoint sets can be merged in any order.

use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::kernel_counts::{KernelCounts, NO_KERNEL, add_counts};
use super::layout::{CountLayout, Counted};
use crate::backend::Chunk;
use crate::generated::{ATTEMPTS, DrawnPoint, Generator};
use crate::outcome::Verdicts;
use crate::plan::LanePlan;
use lanesweep_model::criterion::Criterion;
use lanesweep_support::{Error, Place, Result, option};

/// Number of samples of one task.
const TASK: usize = 4096;

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
    /// Samples and failures by kernel; `None` if the points do not come from kernels.
    pub by_kernel: Option<KernelCounts>,
}

impl SampleTally {
    /// A tally without samples.
    pub fn empty(plan: &LanePlan) -> SampleTally {
        let (headways, models, criteria) = (plan.headways.len(), plan.models.len(), Criterion::ALL.len());
        SampleTally {
            plan_sha256: plan.hash().to_owned(),
            covered: Vec::new(),
            voids: 0,
            tries: 0,
            failures: vec![0; headways * models * criteria],
            squares: vec![0; models * criteria],
            capped: vec![0; headways * models],
            by_kernel: KernelCounts::empty(plan),
        }
    }

    /// Counts a chunk that a backend has counted once more, from its verdicts.
    ///
    /// # Errors
    /// [`Error::Verification`] if the backend's counts are others; as [`SampleTally::of_chunk`].
    pub fn check_counted(plan: &LanePlan, chunk: &Chunk, backend: &str) -> Result<()> {
        if chunk.counted.is_none() {
            return Ok(());
        }
        let lanes = (plan.first_lane_of(chunk.units.end) - chunk.first_lane) as usize;
        let verdicts = (0..lanes).into_par_iter().map(|at| chunk.verdicts_of(at)).collect();
        let again = Chunk { verdicts, counted: None, ..chunk.clone() };
        if SampleTally::of_chunk(plan, chunk)? == SampleTally::of_chunk(plan, &again)? {
            return Ok(());
        }
        Err(Error::Verification(format!(
            "{backend} counted samples {} to {} otherwise than the CPU counts their verdicts; use {}",
            chunk.units.start,
            chunk.units.end - 1,
            option("backend = cpu")
        )))
    }

    /// Counts a chunk of a plan whose units are samples. If the plan holds the cases, every sample is valid at the
    /// first draw.
    ///
    /// # Errors
    /// [`Error::Internal`] for a chunk of another plan, or without lanes.
    pub fn of_chunk(plan: &LanePlan, chunk: &Chunk) -> Result<SampleTally> {
        chunk.check(plan)?;
        if chunk.counted.is_none() && chunk.verdicts.is_empty() {
            return Err(Error::Internal("a chunk does not have the lanes that are to be counted".to_owned()));
        }
        let tally = match &chunk.counted {
            Some(counted) => SampleTally::of_counted(plan, counted),
            None => SampleTally::of_verdicts(plan, chunk),
        };
        Ok(SampleTally { covered: vec![chunk.units.clone()], ..tally })
    }

    /// Counts that a backend has made.
    fn of_counted(plan: &LanePlan, counted: &Counted) -> SampleTally {
        let (layout, all) = (&counted.layout, &counted.counts);
        let mut tally = SampleTally {
            voids: all[CountLayout::VOIDS],
            tries: all[CountLayout::TRIES],
            failures: all[layout.failures()].to_vec(),
            squares: all[layout.squares()].to_vec(),
            capped: all[layout.capped()].to_vec(),
            ..SampleTally::empty(plan)
        };
        if let Some(counts) = &mut tally.by_kernel {
            *counts = KernelCounts::counted(&all[layout.kernel_samples()], &all[layout.kernel_failures()]);
        }
        tally
    }

    /// Counts the verdicts of a chunk.
    fn of_verdicts(plan: &LanePlan, chunk: &Chunk) -> SampleTally {
        let generator = plan.generator();
        let empty = || SampleTally { by_kernel: None, ..SampleTally::empty(plan) };
        let units = chunk.units.clone();
        let lanes = plan.headways.len() * plan.models.len();
        let mut kernels = vec![NO_KERNEL; (units.end - units.start) as usize];
        let tasks = kernels.par_chunks_mut(TASK).zip(chunk.verdicts.par_chunks(TASK * lanes)).enumerate();
        let counted = tasks.fold(empty, |mut tally, (task, (kernels, verdicts))| {
            let samples = (units.start + (task * TASK) as u64..).zip(verdicts.chunks(lanes));
            for (kernel, (unit, of_sample)) in kernels.iter_mut().zip(samples) {
                *kernel = tally.count(plan, generator, unit, of_sample);
            }
            tally
        });
        // Integers, so the order of merging has no effect.
        let mut tally = counted.reduce(empty, |mut a, b| {
            a.add(&b);
            a
        });
        tally.by_kernel = KernelCounts::empty(plan);
        if let Some(counts) = &mut tally.by_kernel {
            counts.count(plan, chunk, &kernels);
        }
        tally
    }

    /// Counts the lanes of one sample; returns its kernel. Twin: `shaders/tally.wgsl`.
    fn count(&mut self, plan: &LanePlan, generator: Option<&Generator>, unit: u64, lanes: &[Verdicts]) -> u32 {
        let drawn = generator.map(|generator| generator.draw(unit));
        if drawn.as_ref().is_some_and(DrawnPoint::is_void) {
            self.voids += 1;
            self.tries += u64::from(ATTEMPTS);
            return NO_KERNEL;
        }
        self.tries += drawn.as_ref().map_or(1, |drawn| u64::from(drawn.tries));
        let (headways, models, criteria) = (plan.headways.len(), plan.models.len(), Criterion::ALL.len());
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
                }
            }
            for (square, k) in self.squares[model * criteria..].iter_mut().zip(failed) {
                *square += k * k;
            }
        }
        let kernel = generator.zip(drawn).and_then(|(generator, drawn)| generator.points.component(unit, drawn.tries));
        kernel.unwrap_or(NO_KERNEL)
    }

    /// Adds counts of other samples; the caller joins the covered intervals.
    fn add(&mut self, other: &SampleTally) {
        self.voids = self.voids.saturating_add(other.voids);
        self.tries = self.tries.saturating_add(other.tries);
        add_counts(&mut self.failures, &other.failures);
        add_counts(&mut self.squares, &other.squares);
        add_counts(&mut self.capped, &other.capped);
        if let (Some(ours), Some(theirs)) = (&mut self.by_kernel, &other.by_kernel) {
            ours.add(theirs);
        }
    }

    /// Merges the counts of other samples of the same plan: associative and commutative.
    ///
    /// # Errors
    /// [`Error::Input`] if the plans differ, or a sample is in both.
    pub fn merge(mut self, other: SampleTally) -> Result<SampleTally> {
        let place = || Place::item("part of a sampling run");
        if self.plan_sha256 != other.plan_sha256 {
            let problem = format!("it belongs to plan {}, not to {}", other.plan_sha256, self.plan_sha256);
            return Err(Error::input(place(), problem, "join only parts of one run: same density, flags and seed"));
        }
        if self.shape() != other.shape() {
            return Err(Error::input(place(), "the parts have other models or headways", "make the part again"));
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
        self.add(&other);
        Ok(self)
    }

    /// Sizes of the lists of counts, which follow from models, headways and criteria.
    fn shape(&self) -> [usize; 5] {
        let [groups, counts] = self.by_kernel.as_ref().map_or([0, 0], KernelCounts::shape);
        [self.failures.len(), self.squares.len(), self.capped.len(), groups, counts]
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
