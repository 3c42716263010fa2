//! The lanes of a sampling run: progress, rows on request, and the files that come of the counts.

use std::path::Path;

use super::console::{self, Verbosity};
use crate::density::{DensityModel, write_density};
use crate::parts::Ledger;
use crate::report::files::{make_folder, write_atomically};
use crate::report::html::PageFigure;
use crate::report::sampled_rows;
use crate::report::sampling::EstimateFile;
use crate::report::sampling_figures;
use crate::report::sampling_tables::{WorstRow, convergence_csv, worst_csv};
use crate::sampling::{CrudeOptions, CrudeRun, Lanes, SampleTally, TallyOptions, sample_into};
use crate::sweep::{LanePlan, LaneRunner, Outcome};
use crate::table::{TableFacts, TableFormat, TableWriter};
use crate::{Error, Result};

/// Samples, with one row per lane where asked for.
pub(super) fn run(
    plan: &LanePlan,
    ledger: &mut Ledger<SampleTally>,
    how: &Lanes,
    counting: &TallyOptions,
    options: &CrudeOptions,
    rows: Option<(&Path, &DensityModel)>,
    verbosity: Verbosity,
) -> Result<CrudeRun> {
    let units = ledger.units();
    let left: u64 = ledger.missing(units)?.iter().map(|range| range.end - range.start).sum();
    let bar = console::progress(verbosity, left, "sampling");
    let Some((path, density)) = rows else {
        let run = sample_into(plan, ledger, how, counting, options, |chunk| {
            bar.inc(chunk.units.end - chunk.units.start);
            Ok(())
        });
        bar.finish_and_clear();
        return run;
    };
    // Rows hold every value, so the lanes must.
    let counting = TallyOptions { worst: counting.worst.max(1), ..counting.clone() };
    let facts = TableFacts {
        table: "samples",
        profile: Some(plan.profile.name.clone()),
        plan_sha256: Some(plan.hash().to_owned()),
        synthetic: density.provenance.synthetic,
    };
    let format = TableFormat::of(path, &TableFormat::EVERY, "--rows")?;
    let mut table = TableWriter::create(path, format, sampled_rows::columns(density), &facts)?;
    let run = sample_into(plan, ledger, how, &counting, options, |chunk| {
        bar.inc(chunk.units.end - chunk.units.start);
        sampled_rows::write_chunk(&mut table, plan, density, chunk)
    });
    bar.finish_and_clear();
    let run = run?;
    table.finish()?;
    Ok(run)
}

/// A folder that cannot be written to is known before the work.
pub(super) fn check_writable(out: &Path) -> Result<()> {
    crate::atomic_file::AtomicFile::create(&out.join("estimate.json")).map(drop)
}

/// Beginnings of the names of all files that a sampling run writes beside its input.
const OURS: [&str; 8] = [
    "estimate",
    "worst.csv",
    "convergence.",
    "map-",
    "proposal-",
    "headways.",
    "report.html",
    super::sample_distribution::KEPT,
];

/// Takes the files of an earlier run out of a folder, so that none stands beside the results of this one; keeps those
/// whose names begin so.
pub(super) fn clear(out: &Path, kept: &[&str]) -> Result<()> {
    let io = |e| Error::io(out, "list", e);
    for entry in std::fs::read_dir(out).map_err(io)? {
        let entry = entry.map_err(io)?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let begins = |list: &[&str]| list.iter().any(|beginning| name.starts_with(beginning));
        let is_result = [".json", ".csv", ".svg", ".html"].iter().any(|ending| name.ends_with(ending));
        if is_result && begins(&OURS) && !begins(kept) {
            std::fs::remove_file(entry.path()).map_err(|e| Error::io(entry.path(), "replace", e))?;
        }
    }
    Ok(())
}

/// Everything of a run but what [`write_estimates`] writes; returns the figures.
pub(super) fn write(
    out: &Path,
    plan: &LanePlan,
    density: &DensityModel,
    run: &CrudeRun,
    counting: &TallyOptions,
) -> Result<Vec<PageFigure>> {
    // It was there before the work; where it vanished meanwhile, the result is worth another one.
    make_folder(out)?;
    clear(out, &[])?;
    let mut figures = Vec::new();
    if !run.convergence.is_empty() {
        write_atomically(&out.join("convergence.csv"), &convergence_csv(&run.convergence)?)?;
        let figure = sampling_figures::convergence(density, &run.convergence);
        let svg = figure.svg();
        write_atomically(&out.join("convergence.svg"), svg.as_bytes())?;
        figures.push(PageFigure::new(&svg, &["convergence.svg", "convergence.csv"]));
    }
    let names: Vec<String> = density.space.parameters().iter().map(|p| p.name.clone()).collect();
    if counting.worst > 0 {
        let runner = LaneRunner::<f32>::new(plan);
        let mut rows: Vec<(WorstRow, Outcome<f64>)> = Vec::new();
        let Some(generator) = plan.generator() else {
            return Err(Error::Internal("the plan has no generator".to_owned()));
        };
        let mut listed = Vec::new();
        for (model, lanes) in run.tally.worst.iter().enumerate() {
            for (at, &lane) in lanes.iter().enumerate() {
                let key = plan
                    .key(lane.lane)
                    .ok_or_else(|| Error::Internal(format!("lane {} is not in the plan", lane.lane)))?;
                listed.push((plan.models[model], at + 1, lane, key, runner.run(&key).widen()));
            }
        }
        for (model, rank, lane, key, outcome) in &listed {
            let drawn = generator.draw(key.unit);
            let point: Vec<f64> = drawn.values[..names.len()].iter().map(|&v| f64::from(v)).collect();
            let headway =
                density.space.thw_s(&point).map_or(plan.headways[key.headway].to_string(), |t| format!("{t}s"));
            let row = WorstRow {
                rank: *rank,
                lane: *lane,
                key: plan.key_text(key),
                sample: key.unit,
                model: *model,
                headway,
                point,
                outcome,
            };
            rows.push((row, *outcome));
        }
        let rows: Vec<WorstRow> = rows.into_iter().map(|(row, _)| row).collect();
        write_atomically(&out.join("worst.csv"), &worst_csv(&rows, &names, counting.criterion)?)?;
    }
    if let Some(map) = &run.tally.map {
        for (model, id) in plan.models.iter().enumerate() {
            let figure = sampling_figures::failure_map(density, map, model, *id, counting.criterion);
            let (name, svg) = (format!("map-{}", id.name()), figure.svg());
            write_atomically(&out.join(format!("{name}.csv")), figure.csv().as_bytes())?;
            write_atomically(&out.join(format!("{name}.svg")), svg.as_bytes())?;
            figures.push(PageFigure::new(&svg, &[&format!("{name}.svg"), &format!("{name}.csv")]));
        }
    }
    Ok(figures)
}

/// Density, table, page and record; the record comes last, so a folder that has one is whole.
pub(super) fn write_estimates(
    out: &Path,
    density: &DensityModel,
    file: &EstimateFile,
    mut figures: Vec<PageFigure>,
) -> Result<()> {
    write_density(&out.join("density.json"), density)?;
    if let Some(figure) = file.headways_figure() {
        let svg = figure.svg();
        write_atomically(&out.join("headways.svg"), svg.as_bytes())?;
        write_atomically(&out.join("headways.csv"), &figure.csv()?)?;
        figures.insert(0, PageFigure::new(&svg, &["headways.svg", "headways.csv"]));
    }
    write_atomically(&out.join("estimates.csv"), &file.csv()?)?;
    write_atomically(&out.join("report.html"), file.html(figures)?.as_bytes())?;
    write_atomically(&out.join("estimate.json"), file.json()?.as_bytes())
}
