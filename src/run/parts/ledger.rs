//! The counts of a running part: in memory and, periodically, in its journal.

use std::ops::Range;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::journal::{Journal, Records};
use lanesweep_engine::Partial;
use lanesweep_support::{Error, Result};

/// Counts over a set of units of one plan that can be merged in any order.
pub trait MergeableCounts: Sized + Clone + Serialize + DeserializeOwned {
    /// The units counted, as disjoint intervals, ascending.
    fn covered(&self) -> Vec<Range<u64>>;
    /// Merges the counts of both sets.
    ///
    /// # Errors
    /// If a unit is in both. Only counts of one run are joined: journal and part hold its hash.
    fn join(self, other: Self) -> Result<Self>;
}

/// A record of a journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counted<T> {
    /// Counts of some units.
    pub counts: T,
    /// Number of lanes computed by the fallback, and of lanes rechecked.
    pub redone_and_rechecked: [u64; 2],
}

/// The journal of a ledger.
type CountsJournal<T> = Journal<Counted<T>>;

/// Finished counts of an interval of units. If the interval has cuts (the checkpoints of a sampling run), counts on the
/// two sides of a cut are kept apart.
pub struct Ledger<T> {
    units: Range<u64>,
    /// Ends of the segments, ascending; the last one is the end of the interval.
    ends: Vec<u64>,
    /// Counts per segment.
    segments: Vec<Option<T>>,
    /// Lanes of the segments: those computed by the fallback, and those rechecked.
    redone_and_rechecked: [u64; 2],
    /// The newest counts, all of one segment.
    pending: Option<Counted<T>>,
    /// Counts of segments that are not in the journal yet.
    unwritten: Vec<Counted<T>>,
    journal: Option<CountsJournal<T>>,
}

impl<T: MergeableCounts> Ledger<T> {
    /// A ledger without counts, cut at these units. Without a journal the counts are lost when the process ends.
    pub fn new(units: Range<u64>, cuts: &[u64]) -> Ledger<T> {
        let inside = cuts.iter().copied().filter(|cut| units.start < *cut && *cut < units.end);
        let mut ends: Vec<u64> = inside.chain([units.end]).collect();
        ends.sort_unstable();
        ends.dedup();
        let segments = ends.iter().map(|_| None).collect();
        let (pending, unwritten, journal) = (None, Vec::new(), None);
        Ledger { units, ends, segments, redone_and_rechecked: [0; 2], pending, unwritten, journal }
    }

    /// Takes over the records of a journal and continues it. Returns the number of units that need not be computed.
    ///
    /// # Errors
    /// [`Error::Internal`] for units outside of the interval.
    pub fn resume(&mut self, journal: CountsJournal<T>, found: Records<Counted<T>>) -> Result<u64> {
        if found.torn {
            tracing::warn!("{}: the last record is not whole; it is computed again", journal.path().display());
        }
        found.records.into_iter().try_for_each(|record| self.place(record))?;
        self.journal = Some(journal);
        Ok(self.done())
    }

    fn segment_of(&self, unit: u64) -> usize {
        self.ends.partition_point(|end| *end <= unit)
    }

    fn place(&mut self, Counted { counts, redone_and_rechecked }: Counted<T>) -> Result<()> {
        let Some(first) = counts.covered().first().map(|covered| covered.start) else { return Ok(()) };
        let segment = self.segment_of(first);
        let outside = || Error::Internal(format!("unit {first} is not one of {:?}", self.units));
        let slot = self.segments.get_mut(segment).ok_or_else(outside)?;
        *slot = Some(match slot.take() {
            Some(before) => before.join(counts)?,
            None => counts,
        });
        add(&mut self.redone_and_rechecked, redone_and_rechecked);
        Ok(())
    }

    /// Adds the counts of a chunk, which must not cross a cut, with
    /// [`Chunk::redone_and_rechecked`](lanesweep_engine::Chunk). Writes to the journal periodically.
    ///
    /// # Errors
    /// [`Error::Io`] of the journal.
    pub fn add(&mut self, counts: T, redone_and_rechecked: [u64; 2]) -> Result<()> {
        let start = |counts: &T| counts.covered().first().map(|range| range.start);
        let is_same = match (self.pending.as_ref().and_then(|pending| start(&pending.counts)), start(&counts)) {
            (Some(a), Some(b)) => self.segment_of(a) == self.segment_of(b),
            _ => true,
        };
        if !is_same {
            self.settle()?;
        }
        self.pending = Some(match self.pending.take() {
            Some(mut before) => {
                add(&mut before.redone_and_rechecked, redone_and_rechecked);
                Counted { counts: before.counts.join(counts)?, ..before }
            }
            None => Counted { counts, redone_and_rechecked },
        });
        if self.journal.as_ref().is_some_and(Journal::is_due) {
            self.flush()?;
        }
        Ok(())
    }

    /// Returns the result of a sweep. After an interruption, it first writes all counts to the journal, if there is
    /// one.
    ///
    /// # Errors
    /// Those of the sweep and of the journal.
    pub(crate) fn kept<R>(&mut self, swept: Result<R>) -> Result<R> {
        match swept {
            Err(Error::Interrupted { .. }) if self.journal.is_some() => {
                self.flush()?;
                let done = format!("{} of {} units are done and kept", self.done(), self.units.end - self.units.start);
                Err(Error::Interrupted { done, is_kept: true })
            }
            swept => swept,
        }
    }

    /// Moves the newest counts into their segment.
    fn settle(&mut self) -> Result<()> {
        let Some(counts) = self.pending.take() else { return Ok(()) };
        if self.journal.is_some() {
            self.unwritten.push(counts.clone());
        }
        self.place(counts)
    }

    /// Writes all counts to the journal.
    fn flush(&mut self) -> Result<()> {
        self.settle()?;
        if let Some(journal) = self.journal.as_mut().filter(|_| !self.unwritten.is_empty()) {
            journal.append(&self.unwritten)?;
            self.unwritten.clear();
        }
        Ok(())
    }

    /// Number of counted units, without pending ones.
    fn done(&self) -> u64 {
        self.segments.iter().flatten().flat_map(MergeableCounts::covered).map(|range| range.end - range.start).sum()
    }

    /// Lanes of all counts, of this process and of earlier ones: those computed by the fallback, and those rechecked.
    pub(crate) fn redone_and_rechecked(&self) -> [u64; 2] {
        let mut sum = self.redone_and_rechecked;
        self.pending.iter().for_each(|pending| add(&mut sum, pending.redone_and_rechecked));
        sum
    }

    /// The interval.
    pub fn units(&self) -> Range<u64> {
        self.units.clone()
    }

    /// The intervals of a range that are not counted yet, split at the cuts, ascending.
    ///
    /// # Errors
    /// Those of [`MergeableCounts::join`].
    pub fn missing(&mut self, range: Range<u64>) -> Result<Vec<Range<u64>>> {
        self.settle()?;
        let mut covered: Vec<Range<u64>> = self.segments.iter().flatten().flat_map(MergeableCounts::covered).collect();
        covered.sort_by_key(|range| range.start);
        let mut missing = Vec::new();
        let mut at = range.start;
        let mut gap = |from: u64, to: u64| {
            let cuts = self.ends.iter().copied().filter(|cut| from < *cut && *cut < to);
            let mut start = from;
            for end in cuts.chain([to]) {
                if start < end {
                    missing.push(start..end);
                }
                start = end;
            }
        };
        for done in covered.iter().filter(|done| done.end > range.start && done.start < range.end) {
            gap(at, done.start.max(at));
            at = at.max(done.end);
        }
        gap(at.min(range.end), range.end);
        Ok(missing)
    }

    /// The merged counts of the segments inside a range; `None` if nothing is counted there.
    ///
    /// # Errors
    /// Those of [`MergeableCounts::join`].
    pub fn counts(&mut self, range: Range<u64>) -> Result<Option<T>> {
        self.settle()?;
        let inside = self.segments.iter().flatten().filter(|counts| {
            counts.covered().first().is_some_and(|covered| range.start <= covered.start && covered.start < range.end)
        });
        let mut joined: Option<T> = None;
        for counts in inside {
            joined = Some(match joined {
                Some(before) => before.join(counts.clone())?,
                None => counts.clone(),
            });
        }
        Ok(joined)
    }

    /// Removes and returns all counts, segment by segment, so that no count is held twice.
    ///
    /// # Errors
    /// Those of [`MergeableCounts::join`].
    pub(crate) fn take(&mut self) -> Result<Vec<T>> {
        self.settle()?;
        self.unwritten.clear();
        Ok(self.segments.iter_mut().filter_map(Option::take).collect())
    }

    /// All counts, segment by segment, and the journal, to be deleted after the result is written.
    ///
    /// # Errors
    /// Those of [`MergeableCounts::join`].
    pub fn finish(mut self) -> Result<(Vec<T>, Option<CountsJournal<T>>)> {
        self.settle()?;
        Ok((self.segments.into_iter().flatten().collect(), self.journal))
    }
}

fn add(sum: &mut [u64; 2], more: [u64; 2]) {
    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum = sum.saturating_add(more));
}

impl MergeableCounts for Partial {
    fn covered(&self) -> Vec<Range<u64>> {
        let mut intervals: Vec<Range<u64>> = Vec::new();
        for unit in self.units().iter().map(|of| of.unit) {
            match intervals.last_mut() {
                Some(last) if last.end == unit => last.end = unit + 1,
                _ => intervals.push(unit..unit + 1),
            }
        }
        intervals
    }

    fn join(self, other: Self) -> Result<Self> {
        self.merge(other)
    }
}
