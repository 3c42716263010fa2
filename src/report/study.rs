//! A study as files in the output folder; the last is the record, `run.json`, with data, program and settings, so that its
//! numbers can be reproduced.

use super::host::{Host, SweepRecord, Timings};
use super::html::PageFigure;
use super::plot::Figure;
use super::records::{PROGRAM, document, publish, record};
use super::study_figures::{f1_intervals, radar};
use super::tables;
use lanesweep_engine::{ENGINE_VERSION, Headway, Partial, SweepSummary};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::scenario::Category;
use lanesweep_run::score::{Best, Misfit, f1};
use lanesweep_run::study::{ReferenceComparison, Study, StudyEvaluation, StudyProvenance};
use lanesweep_support::Result;
use lanesweep_support::run_folder::{ResultFiles, Results, TABLES};
use lanesweep_support::table::Table;
use serde::Serialize;
use serde_json::Value;

/// A study's complete report.
pub struct StudyReport<'a> {
    pub(super) study: &'a Study,
    /// What the counts say.
    pub evaluation: StudyEvaluation,
    pub(super) host: Host,
    pub(super) sweep: SweepRecord,
    pub(super) timings: Timings,
    /// f32 against f64, if requested.
    pub(super) comparison: Option<ReferenceComparison>,
}

impl<'a> StudyReport<'a> {
    /// From the counts of all lanes.
    ///
    /// # Errors
    /// As [`Study::score`].
    pub fn of(
        study: &'a Study,
        counts: &Partial,
        comparison: Option<ReferenceComparison>,
        host: Host,
        swept: &SweepSummary,
        timings: Timings,
    ) -> Result<StudyReport<'a>> {
        let started = std::time::Instant::now();
        let evaluation = study.evaluate(counts)?;
        let timings = Timings { score_s: started.elapsed().as_secs_f64(), ..timings };
        let sweep = SweepRecord::of(swept, study.facts().score.seed);
        Ok(StudyReport { study, evaluation, host, sweep, timings, comparison })
    }

    /// What the plan says of the data.
    pub(super) fn facts(&self) -> &'a StudyProvenance {
        self.study.facts()
    }

    pub(super) fn lanes(&self) -> u64 {
        self.study.plan().lane_count()
    }

    /// Start of the scenarios, in a few words.
    pub(super) fn headways_in_words(&self) -> String {
        match self.evaluation.scores.headways.len() {
            _ if Headway::is_observed(&self.evaluation.scores.headways) => "recorded THW".to_owned(),
            1 => "1 imposed THW".to_owned(),
            n => format!("{n} imposed THW"),
        }
    }

    /// Writes CSV tables, figures (plain ones without title and caption), the files already in `results` and `run.json` to
    /// the folder; returns their names without the record's.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Io`].
    pub fn write(&self, mut results: Results, is_plain: bool) -> Result<ResultFiles> {
        let data = if self.facts().synthetic { "synthetic" } else { "recorded" };
        results.add_table("results.csv", tables::result_records(&self.evaluation, data)?)?;
        results.keep_table("best", best_table(&self.evaluation.best, data));
        let mut table = |name: &str, table: Table| results.add_table(&format!("{TABLES}{name}.csv"), table);
        table("claims", tables::claim_records(&self.evaluation.claims, data))?;
        if self.facts().categories.iter().any(|of| !of.folds.is_empty()) {
            let folds = self.facts().categories.iter().flat_map(|of| &of.folds);
            let folds = Table::of(folds).column("id", |(id, _)| id.as_str()).column("fold", |(_, fold)| *fold);
            table("folds", folds.build())?;
        }
        self.comparison.as_ref().map_or(Ok(()), |of| table("reference", tables::reference_table(of)))?;
        let mut figures = Vec::new();
        for (at, scores) in self.evaluation.scores.categories.iter().enumerate() {
            // `radar-cut-in.svg`.
            let category = scores.category.key().replace('_', "-");
            let drawn = self.figures(at).into_iter();
            let add = |(name, figure): (&str, Figure)| {
                PageFigure::add(&mut results, &format!("{name}-{category}"), &figure, is_plain)
            };
            figures.push(drawn.map(add).collect::<Result<Vec<_>>>()?);
        }
        results.add("report.html", self.html(figures).as_bytes())?;
        publish(results, |files| self.json(files))
    }

    /// The figures of a category, with the prefixes of their file names; figures without data are skipped.
    fn figures(&self, at: usize) -> Vec<(&'static str, Figure)> {
        let (scores, data) = (&self.evaluation.scores.categories[at], &self.facts().data);
        if scores.variants.len() < 2 {
            return Vec::new();
        }
        let confidence = self.evaluation.scores.options.confidence;
        vec![("f1", f1_intervals(scores, confidence, data)), ("radar", radar(scores, data))]
    }
}

/// Runs of S of a driver model that were undecided at the time cap.
#[derive(Serialize)]
pub(super) struct CappedRecord {
    /// Driver model.
    pub model: &'static str,
    /// How many.
    pub runs: u64,
    /// Smallest TTC among them, s; null if none approaches.
    pub min_ttc_s: Option<f64>,
}

/// Found and kept scenarios of a category, and counts of their lanes.
#[derive(Serialize)]
pub(super) struct CategoryRecord<'a> {
    /// Kind of scenario.
    pub category: Category,
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
    /// Those of S, by driver model.
    pub capped_s: Vec<CappedRecord>,
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
    ///
    /// # Errors
    /// None for a record of this program.
    pub fn json(&self, files: &ResultFiles) -> Result<String> {
        let (plan, facts) = (self.study.plan(), self.study.facts());
        document(&record! {
            program: PROGRAM,
            // Identifies the bits of the program's lanes.
            engine: ENGINE_VERSION,
            commit: self.host.commit(),
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
            models: &plan.models,
            best: best_records(&self.evaluation.best),
            // Differences from the paper's numbers, if these are shown.
            published: Misfit::of(&self.evaluation.scores).filter(|_| facts.published),
            // Verdicts that differ between binary32 and binary64, if both were run.
            reference: self.comparison.as_ref().map(|of| record! {
                lanes: of.lanes,
                verdicts: of.lanes * Criterion::ALL.len() as u64,
                differing: of.differences.len(),
            }),
            profile: &plan.profile,
            mining: &facts.mining,
            parameterization: &facts.parameterization,
            score: &facts.score,
            settings: &self.host.settings,
            #[serde(flatten)]
            files: files,
            timings: &self.timings,
        })
    }

    /// Found and kept scenarios, and lanes, of each category.
    pub(super) fn categories(&self) -> Vec<CategoryRecord<'_>> {
        let plan = self.study.plan();
        let blocks = plan.blocks.iter().zip(&self.study.facts().categories).enumerate();
        let records = blocks.map(|(at, (block, of))| {
            let scored = self.evaluation.scores.categories.iter().find(|c| c.category == block.category);
            let cells = scored.iter().flat_map(|c| &c.cells).filter(|c| c.variant > 0);
            let numbers = self.evaluation.categories.get(at);
            let capped = |(model, runs): (usize, u64)| CappedRecord {
                model: plan.models[model].name(),
                runs,
                min_ttc_s: numbers.and_then(|of| of.capped_min_ttc_s[model]).filter(|ttc_s| ttc_s.is_finite()),
            };
            let of_s = scored.iter().flat_map(|c| c.capped.iter().copied().take(plan.models.len()).enumerate());
            CategoryRecord {
                category: block.category,
                found: of.found,
                kept: of.kept,
                variants: &block.variants,
                lanes: plan.lanes_per_unit(block) * block.units.len(),
                capped_lanes: scored.map_or(0, |c| c.capped.iter().sum()),
                capped_s: of_s.map(capped).filter(|of| of.runs > 0).collect(),
                undefined_f1: cells.filter(|c| f1(&c.counts).is_none()).count() as u64,
                svd_explained: &of.svd_explained,
                folds: of.folds.iter().map(|(_, fold)| fold + 1).max(),
            }
        });
        records.collect()
    }
}

/// A row per best parameterization.
fn best_table(best: &[Best], data: &str) -> Table {
    Table::of(best)
        .column("category", |of| of.category.key())
        .column("model", |of| of.model.name())
        .column("criterion", |_| Criterion::Collision.key())
        .column("variant", |of| of.score.as_ref().map(|s| s.variant.to_string()))
        .column("f1", |of| of.score.as_ref().map(|s| s.f1))
        .column("f1_low", |of| of.score.as_ref().map(|s| s.interval.low))
        .column("f1_high", |of| of.score.as_ref().map(|s| s.interval.high))
        .column("missed_collisions", |of| of.score.as_ref().map(|s| s.missed))
        .column("invented_collisions", |of| of.score.as_ref().map(|s| s.invented))
        .column("ties_with", |of| of.score.as_ref().map_or(String::new(), |s| s.rivals.join(" ")))
        .column("data_for_decision", |of| of.data_for_decision)
        .column("failing_scenarios", |of| of.failing_scenarios)
        .column("s_failures", |of| of.failures)
        .column("data", |_| data)
        .build()
}

/// The same for programs; undefined numbers are null.
fn best_records(best: &[Best]) -> Value {
    let mut records = best_table(best, "").records();
    for (record, of) in records.as_array_mut().into_iter().flatten().zip(best) {
        record["ties_with"] = of.score.as_ref().map(|score| &*score.rivals).into();
    }
    records
}
