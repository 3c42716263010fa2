//! A study as a job.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use super::Study;
use crate::parts::{Computed, EachChunk, Job, Ledger, PLAN_FILE, Shard, leave_plan};
use lanesweep_engine::{Executor, Partial, SweepSummary, Wanted};
use lanesweep_support::plain_text::sha256;
use lanesweep_support::{Error, Place, Result, input_file};

/// Record of a study.
pub const STUDY_RECORD: &str = "run.json";

/// Result of a whole study.
#[derive(Debug, Clone)]
pub struct StudyResult {
    /// The counts of every unit; [`Study::score`] computes the score table from them.
    pub counts: Partial,
    /// Summary of the sweep.
    pub summary: SweepSummary,
    /// Number of merged parts; 0 for a run in one piece.
    pub parts: usize,
}

impl Study {
    /// The study and the counts of a folder of parts, bit for bit equal to those of the run in one piece. `again` returns
    /// the command that makes a shard.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] with the missing, duplicate, foreign or damaged parts.
    pub fn merge_parts(out: &Path, again: &dyn Fn(Shard) -> String) -> Result<(Study, StudyResult)> {
        // Merging needs only counts and no scenarios.
        let study = Study::read_units(&out.join(PLAN_FILE), |_| 0..0)?;
        let result = study.merge(out, again)?;
        Ok((study, result))
    }
}

impl Job for Study {
    type Counts = Partial;
    type Result = StudyResult;
    const RECORD: &'static str = STUDY_RECORD;

    fn unit_count(&self) -> u64 {
        self.plan().unit_count()
    }

    /// The counts of a run in one piece depend only on plan and arithmetic, so it may be resumed with other score options.
    fn run_sha256(&self, is_part: bool) -> Result<String> {
        match &self.file {
            Some((_, run_sha256)) => Ok(run_sha256.clone()),
            None if is_part => Ok(self.seal()?.1),
            None => Ok(sha256(format!("{} reference {}", self.plan().hash(), self.facts.reference))),
        }
    }

    fn write_plan(&self, out: &Path) -> Result<()> {
        let Some((path, _)) = &self.file else {
            let line = self.seal()?.0;
            return leave_plan(out, &line, |file| self.cases.write_file(&line, file));
        };
        // Copies the file, because a shard holds only its own scenarios and cannot write the plan.
        let mut line = Vec::new();
        BufReader::new(input_file::open(path)?).read_until(b'\n', &mut line).map_err(|e| Error::io(path, "read", e))?;
        leave_plan(out, &line, |file| std::io::copy(&mut File::open(path)?, file).map(drop))
    }

    /// If an earlier process has counted lanes, those that `each` is to receive run again.
    fn compute(
        &self,
        ledger: &mut Ledger<Partial>,
        executor: &Executor,
        mut each: Option<&mut EachChunk>,
    ) -> Result<Computed> {
        let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
        let units = ledger.units();
        let missing = ledger.missing(units.clone())?;
        let is_fresh = missing == [units.clone()];
        let wanted = if each.is_some() && is_fresh { Wanted::Outcomes } else { Wanted::Verdicts };
        for range in missing {
            let part = self.cases.sweep(range, wanted, executor, |plan, chunk| {
                if let Some(each) = each.as_mut().filter(|_| is_fresh) {
                    each(plan, &chunk)?;
                }
                ledger.add(Partial::from_chunk(plan, &chunk)?, chunk.redone_and_rechecked)
            });
            summary.add(&ledger.kept(part)?);
        }
        if let Some(each) = each.filter(|_| !is_fresh) {
            summary.add(&self.cases.sweep(units, Wanted::Outcomes, executor, |plan, chunk| each(plan, &chunk))?);
        }
        // Rechecks of earlier processes are recorded in the journal.
        [summary.redone_lanes, summary.rechecked_lanes] = ledger.redone_and_rechecked();
        Ok(Computed::whole(summary))
    }

    fn result(&self, counts: Vec<Partial>, computed: Computed, place: Place) -> Result<StudyResult> {
        let plan = self.plan();
        let Computed { mut summary, parts, .. } = computed;
        let counts = counts.into_iter().try_fold(Partial::empty(plan), Partial::merge)?;
        if !counts.is_complete(plan) {
            let problem = "the parts do not hold every unit that their names stand for";
            return Err(Error::input(place, problem, "make them again"));
        }
        if parts > 0 {
            summary.lanes = plan.lane_count();
        }
        Ok(StudyResult { counts, summary, parts })
    }
}
