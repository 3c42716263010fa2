//! Who computes fails: a worker panics, a device is lost. What is missing is computed by whoever comes next.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Duration;

use crate::common::lane_sets::random;
use lanesweep::engine::{Backend, Chunk, LanePlan, Partial, Session};
use lanesweep::prelude::*;
use lanesweep::run::parts::{Journal, Ledger};

#[derive(Debug, Clone, Copy, PartialEq)]
enum Failure {
    /// In a task of the thread pool, as a defect in a lane would.
    Panic,
    DeviceLost,
}

/// Computes so many chunks as the CPU does, then fails.
struct Failing {
    after: usize,
    how: Failure,
}

struct FailingSession<'p> {
    inner: Box<dyn Session + 'p>,
    left: usize,
    how: Failure,
    chunk_lanes: u64,
}

impl Backend for Failing {
    fn describe(&self) -> String {
        "a backend that fails".to_owned()
    }

    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
        let inner = CpuBackend::lane_arithmetic().prepare(plan)?;
        Ok(Box::new(FailingSession { inner, left: self.after, how: self.how, chunk_lanes: plan.lane_count() / 6 }))
    }
}

impl Session for FailingSession<'_> {
    fn run(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk> {
        if self.left > 0 {
            self.left -= 1;
            // Long enough for the next record to be due.
            std::thread::sleep(Duration::from_millis(300));
            return self.inner.run(units, wanted);
        }
        if self.how == Failure::Panic {
            rayon::join(|| panic!("shader_patch"), || ());
        }
        Err(Error::device("shader_patch", "the device is lost", ""))
    }

    fn chunk_lanes(&self, _: Wanted) -> u64 {
        self.chunk_lanes
    }
}

const RUN: &str = "0123456789abcdef";

/// Computes what a journal does not hold yet; how many units were there before, and all counts.
fn journalled(plan: &LanePlan, backend: &dyn Backend, path: &Path) -> Result<(u64, Partial)> {
    let units = 0..plan.unit_count();
    let mut ledger = Ledger::<Partial>::new(units.clone(), &[]);
    let (journal, found) = Journal::open(path, RUN, units.clone())?;
    let before = ledger.resume(journal, found)?;
    for range in ledger.missing(units.clone())? {
        Executor::new(backend).sweep(plan, range, Wanted::Verdicts, |chunk| {
            ledger.add(Partial::from_chunk(plan, &chunk)?, chunk.redone_and_rechecked)
        })?;
    }
    let counts = ledger.counts(units)?;
    Ok((before, counts.ok_or_else(|| Error::Internal("nothing is counted".to_owned()))?))
}

#[test]
fn after_a_panic_in_a_worker_or_a_lost_device_the_journal_is_whole_and_another_backend_ends_the_run() {
    let plan = random(&Profile::load("paper").unwrap(), 800);
    let dir = tempfile::tempdir().unwrap();
    let cpu = CpuBackend::lane_arithmetic();
    let (_, undisturbed) = journalled(&plan, &cpu, &dir.path().join("undisturbed")).unwrap();
    for how in [Failure::Panic, Failure::DeviceLost] {
        for after in [0, 1, 3] {
            let path = dir.path().join(format!("{how:?}-{after}"));
            let failing = Failing { after, how };
            let ended = catch_unwind(AssertUnwindSafe(|| journalled(&plan, &failing, &path)));
            match (how, ended) {
                (Failure::Panic, Err(_)) => {}
                (Failure::DeviceLost, Ok(Err(error))) => assert!(error.to_string().contains("lost"), "{error}"),
                (_, ended) => panic!("{how:?} after {after} chunks: {:?}", ended.map(|run| run.map(|(n, _)| n))),
            }
            let (before, counts) = journalled(&plan, &cpu, &path).unwrap();
            assert!(before < plan.unit_count() && (before > 0) == (after > 0), "{how:?} after {after}: {before}");
            assert_eq!(counts, undisturbed, "{how:?} after {after} chunks");
        }
    }
}
