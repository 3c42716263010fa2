//! The lanes of a study: swept, checked, counted; then the report.

use std::path::Path;

use clap::Args;

use super::format::FormatFlag;
use super::{Exit, console};
use crate::Result;
use crate::engine::{Backend, CpuBackend, ENGINE_VERSION, Executor, Partial, SweepSummary, Wanted, chunks};
use crate::model::criterion::Criterion;
use crate::report::lanes::{self, Digits};
use crate::report::reference::ReferenceComparison;
use crate::report::run_record::{CategoryRecord, DeviceRecord, RunRecord, SettingRecord, SweepRecord, Timings};
use crate::report::study::{CategoryPictures, StudyReport};
use crate::report::study_figures::HeadwayFailures;
use crate::report::tables;
use crate::run::close_following::CloseFollowing;
use crate::run::score::{ScoreTable, best_parameterizations, f1, judge_claims};
use crate::run::study::{CategoryFacts, Study, StudyCases, WINDOW};
use crate::support::atomic_file::StagedFile;
use crate::support::files::make_folder;
use crate::support::run_dir::Results;
use crate::support::table::{TableFacts, TableFormat, TableWriter};

/// Every lane in f32 and in f64, chunk by chunk.
pub(super) fn compare_reference(study: &StudyCases) -> Result<ReferenceComparison> {
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

/// One row per lane, chunk by chunk, so that memory does not grow with the lanes. The table gets its name with the
/// study's other results.
pub(super) fn write_lanes(
    path: &Path,
    study: &StudyCases,
    executor: &Executor,
    digits: Digits,
    synthetic: bool,
) -> Result<(SweepSummary, StagedFile)> {
    if let Some(dir) = path.parent().filter(|d| !d.as_os_str().is_empty()) {
        make_folder(dir)?;
    }
    let plan = study.outline();
    let facts = TableFacts {
        table: "lanes",
        profile: Some(plan.profile.name.clone()),
        plan_sha256: Some(plan.hash().to_owned()),
        synthetic,
    };
    let mut table = TableWriter::create(path, lane_format(path)?, lanes::columns(digits), &facts)?;
    let swept = study.sweep(0..plan.unit_count(), Wanted::Outcomes, executor, |plan, chunk| {
        lanes::write_chunk(&mut table, plan, &chunk)
    })?;
    Ok((swept, table.stage()?))
}

/// The format of a table of lanes.
pub(super) fn lane_format(path: &Path) -> Result<TableFormat> {
    TableFormat::of(path, &TableFormat::EVERY, "--rows")
}

/// What belongs to the machine and not to the result.
pub(super) struct Host {
    pub backend: String,
    pub device: Option<DeviceRecord>,
    pub swept: SweepSummary,
    pub timings: Timings,
    /// What was configured.
    pub settings: Vec<SettingRecord>,
}

/// The flag of every verb that ends in a study's report.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct TablesFlag {
    /// Print all tables instead of the answer; they are in report.txt too
    #[arg(long, help_heading = "Data")]
    pub tables: bool,
}

/// Scores, tables, figures and the record, from the counts of all lanes.
pub(super) fn finish_study(
    study: &Study,
    partial: &Partial,
    comparison: Option<ReferenceComparison>,
    mut host: Host,
    results: Results,
    (format, tables): (FormatFlag, bool),
) -> Result<Exit> {
    let (plan, facts) = (study.plan(), study.facts().clone());
    let started = std::time::Instant::now();
    let scores = study.score(partial)?;
    host.timings.score_s = started.elapsed().as_secs_f64();
    let run = RunRecord {
        program: format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
        engine: ENGINE_VERSION,
        data: facts.data,
        synthetic: facts.synthetic,
        backend: host.backend,
        device: host.device,
        sweep: SweepRecord {
            rechecked_lanes: host.swept.rechecked_lanes,
            recheck_seed: facts.score.seed,
            redone_lanes: host.swept.redone_lanes,
            device_s: host.swept.device_s,
        },
        plan_sha256: plan.hash().to_owned(),
        scenario_file_sha256: facts.scenario_file_sha256,
        left_out: facts.left_out,
        notes: facts.notes,
        recordings: facts.recordings,
        categories: category_records(study, &scores),
        lanes: plan.lane_count(),
        profile: plan.profile.clone(),
        mining: facts.mining,
        parameterization: facts.parameterization,
        score: facts.score,
        settings: host.settings,
        files: Vec::new(),
        timings: host.timings,
    };
    let claims = judge_claims(&scores, plan, partial);
    let best = best_parameterizations(&scores, plan, partial, Criterion::Collision);
    let picture = |(block, of): (usize, &CategoryFacts)| {
        Ok(CategoryPictures {
            headways: HeadwayFailures::of(plan, partial, block)?,
            parameters: of.parameters.clone(),
            modes: of.modes.clone(),
            svd_explained: of.svd_explained.clone(),
            close_following: CloseFollowing::of_recorded(plan, partial, block, &of.close_units)?,
        })
    };
    let pictures = study.facts().categories.iter().enumerate().map(picture).collect::<Result<_>>()?;
    let out = results.dir().to_path_buf();
    let mut report = StudyReport { scores, claims, best, pictures, run, published: facts.published, comparison };
    report.write(results)?;
    let width = console::width();
    let claims = if report.claims.is_empty() { "" } else { ", claims" };
    let rest = format!("TTC, BTN, every interval{claims}: --tables, or report.html and report.txt.");
    let answer = || format!("{}{}\n", report.answer(width), tables::wrap(&rest, width));
    format.print(|| if tables { report.text(width) } else { answer() }, || report.json())?;
    tracing::info!("{} files written; start with {}", report.run.files.len() + 1, out.join("report.html").display());
    Ok(if facts.incomplete { Exit::Incomplete } else { Exit::Ok })
}

fn category_records(study: &Study, scores: &ScoreTable) -> Vec<CategoryRecord> {
    let plan = study.plan();
    let record = |(block, of): (&crate::engine::Block, &CategoryFacts)| {
        let scored = scores.categories.iter().find(|c| c.category == block.category);
        let cells = || scored.iter().flat_map(|c| &c.cells).filter(|c| c.variant > 0);
        CategoryRecord {
            category: block.category.key(),
            found: of.found,
            kept: of.kept,
            variants: block.variants.clone(),
            lanes: plan.lanes_per_unit(block) * block.units.len(),
            capped_lanes: scored.map_or(0, |c| c.capped.iter().sum()),
            undefined_f1: cells().filter(|c| f1(&c.counts).is_none()).count() as u64,
            svd_explained: of.svd_explained.clone(),
        }
    };
    plan.blocks.iter().zip(&study.facts().categories).map(record).collect()
}
