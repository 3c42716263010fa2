//! `run.json` of a study: data, program and settings, so that its numbers can be reproduced.

use serde::Serialize;

use super::records::{PROGRAM, document, record};
use super::study::StudyReport;
use crate::Result;
use crate::engine::ENGINE_VERSION;
use crate::run::score::f1;

/// Found and kept scenarios of a category, and counts of their lanes.
#[derive(Serialize)]
pub(super) struct CategoryRecord<'a> {
    /// Kind of scenario.
    pub category: &'static str,
    /// Scenarios mined or read.
    pub found: u64,
    /// Those that passed the filters and were simulated.
    pub kept: u64,
    /// Variants simulated, S first.
    variants: &'a [String],
    /// Lanes.
    pub lanes: u64,
    /// Lanes that ended at the time cap.
    pub capped_lanes: u64,
    /// Cells of the score table whose F1 is 0/0.
    pub undefined_f1: u64,
    /// Cumulative explained variance of the decomposition's first coefficients, if there is one.
    svd_explained: &'a [f64],
    /// Number of folds, with cross-validation.
    #[serde(skip_serializing_if = "Option::is_none")]
    folds: Option<usize>,
}

impl StudyReport<'_> {
    /// `run.json`; `files` are in the same folder.
    pub(super) fn record(&self, files: &[String]) -> Result<String> {
        let (plan, facts) = (self.study.plan(), self.study.facts());
        document(&record! {
            program: PROGRAM,
            // Identifies the bits of the program's lanes.
            engine: ENGINE_VERSION,
            data: &facts.data,
            synthetic: facts.synthetic,
            backend: &self.host.backend,
            device: &self.host.device,
            sweep: &self.sweep,
            // Determines all outcomes.
            plan_sha256: plan.hash(),
            scenario_file_sha256: &facts.scenario_file_sha256,
            recordings: &facts.recordings,
            left_out: &facts.left_out,
            notes: &facts.notes,
            categories: self.categories(),
            lanes: plan.lane_count(),
            profile: &plan.profile,
            mining: &facts.mining,
            parameterization: &facts.parameterization,
            score: &facts.score,
            settings: &self.host.settings,
            files: &files,
            timings: &self.timings,
        })
    }

    /// Found and kept scenarios, and lanes, of each category.
    pub(super) fn categories(&self) -> Vec<CategoryRecord<'_>> {
        let plan = self.study.plan();
        let blocks = plan.blocks.iter().zip(&self.study.facts().categories);
        let records = blocks.map(|(block, of)| {
            let scored = self.evaluation.scores.categories.iter().find(|c| c.category == block.category);
            let cells = || scored.iter().flat_map(|c| &c.cells).filter(|c| c.variant > 0);
            CategoryRecord {
                category: block.category.key(),
                found: of.found,
                kept: of.kept,
                variants: &block.variants,
                lanes: plan.lanes_per_unit(block) * block.units.len(),
                capped_lanes: scored.map_or(0, |c| c.capped.iter().sum()),
                undefined_f1: cells().filter(|c| f1(&c.counts).is_none()).count() as u64,
                svd_explained: &of.svd_explained,
                folds: of.folds.iter().map(|(_, fold)| fold + 1).max(),
            }
        });
        records.collect()
    }
}
