//! The files of a sampling run: rows on request, and what comes of the counts.

use std::path::Path;

use sha2::{Digest, Sha256};

use crate::engine::{Chunk, LanePlan, LaneRunner};
use crate::model::criterion::Criterion;
use crate::report::convergence::ConvergenceFigure;
use crate::report::failure_map::FailureMap;
use crate::report::html::PageFigure;
use crate::report::lanes;
use crate::report::sampling::EstimateFile;
use crate::report::sampling_tables::{WorstRow, convergence_csv, worst_csv};
use crate::run::sampling::{CrudeRun, SampleOptions};
use crate::stats::density::DensityModel;
use crate::support::atomic_file::StagedFile;
use crate::support::hex::hex;
use crate::support::run_dir::Results;
use crate::support::table::{TableFacts, TableFormat, TableWriter};
use crate::{Error, Result};

/// One row per lane: a table that gets its name with the run's other results.
pub(super) struct RowTable<'a> {
    table: TableWriter,
    plan: &'a LanePlan,
    density: &'a DensityModel,
}

impl<'a> RowTable<'a> {
    pub fn create(path: &Path, plan: &'a LanePlan, density: &'a DensityModel) -> Result<Self> {
        let facts = TableFacts {
            table: "samples",
            profile: Some(plan.profile.name.clone()),
            plan_sha256: Some(plan.hash().to_owned()),
            synthetic: density.provenance.synthetic,
        };
        let format = TableFormat::of(path, &TableFormat::EVERY, "--rows")?;
        let table = TableWriter::create(path, format, lanes::sampled_columns(density), &facts)?;
        Ok(RowTable { table, plan, density })
    }

    pub fn add(&mut self, chunk: &Chunk) -> Result<()> {
        lanes::write_sampled_chunk(&mut self.table, self.plan, self.density, chunk)
    }

    pub fn stage(self) -> Result<StagedFile> {
        self.table.stage()
    }
}

/// Everything of a run but what [`write_estimates`] writes; returns the figures.
pub(super) fn write(
    results: &mut Results,
    plan: &LanePlan,
    density: &DensityModel,
    run: &CrudeRun,
    options: &SampleOptions,
    file: &mut EstimateFile,
) -> Result<Vec<PageFigure>> {
    let mut figures = Vec::new();
    let level = run.rows.first().map_or(0.95, |row| row.estimate.interval.level);
    if !run.convergence.is_empty() {
        results.add("convergence.csv", &convergence_csv(&run.convergence)?)?;
        let figure = ConvergenceFigure::of(density, &run.convergence, level).figure();
        let svg = figure.svg();
        results.add("convergence.svg", svg.as_bytes())?;
        figures.push(PageFigure::new(&svg, &["convergence.svg", "convergence.csv"]));
    }
    let names: Vec<String> = density.space.parameters().iter().map(|p| p.name.clone()).collect();
    if options.worst > 0 {
        let Some(generator) = plan.generator() else {
            return Err(Error::Internal("the plan has no generator".to_owned()));
        };
        let drawn = |sample: u64| {
            let point: Vec<f64> = generator.draw(sample).values[..names.len()].iter().map(|&v| f64::from(v)).collect();
            let headway = density.space.thw_s(&point).map(|thw_s| format!("{thw_s}s"));
            Ok((point, headway))
        };
        add_worst(results, plan, run, (&names, &drawn), options.criterion, file)?;
    }
    if let Some(map) = &run.tally.map {
        for (model, id) in plan.models.iter().enumerate() {
            let figure = FailureMap::of(density, map, model, *id, options.criterion);
            let (name, svg) = (format!("map-{}", id.name()), figure.figure().svg());
            results.add(&format!("{name}.csv"), figure.csv().as_bytes())?;
            results.add(&format!("{name}.svg"), svg.as_bytes())?;
            figures.push(PageFigure::new(&svg, &[&format!("{name}.svg"), &format!("{name}.csv")]));
        }
    }
    Ok(figures)
}

/// The point of a sample, and its headway where that is a parameter.
type DrawnPoint<'d> = dyn Fn(u64) -> Result<(Vec<f64>, Option<String>)> + 'd;

/// Adds the table of the worst lanes, and its checksum to the record.
pub(super) fn add_worst(
    results: &mut Results,
    plan: &LanePlan,
    run: &CrudeRun,
    (names, drawn): (&[String], &DrawnPoint),
    criterion: Criterion,
    file: &mut EstimateFile,
) -> Result<()> {
    let runner = LaneRunner::<f32>::new(plan);
    let mut rows = Vec::new();
    for (&model, lanes) in plan.models.iter().zip(&run.tally.worst) {
        for (at, &lane) in lanes.iter().enumerate() {
            let missing = || Error::Internal(format!("lane {} is not in the plan", lane.lane));
            let key = plan.key(lane.lane).ok_or_else(missing)?;
            let (point, headway) = drawn(key.unit)?;
            rows.push(WorstRow {
                rank: at + 1,
                lane,
                key: plan.key_text(&key),
                sample: key.unit,
                model,
                headway: headway.unwrap_or_else(|| plan.headways[key.headway].to_string()),
                point,
                outcome: runner.run(&key).widen(),
            });
        }
    }
    let table = worst_csv(&rows, names, criterion)?;
    file.worst_sha256 = Some(hex(&Sha256::digest(&table)));
    results.add("worst.csv", &table)
}

/// Adds density, table and page, and puts all of it into the folder with its record.
pub(super) fn write_estimates(
    mut results: Results,
    density: &DensityModel,
    file: &mut EstimateFile,
    figures: Vec<PageFigure>,
) -> Result<()> {
    results.add("density.json", &density.to_json()?)?;
    publish_estimates(results, file, figures)
}

/// Table and page of the estimates; then everything with its record.
pub(super) fn publish_estimates(
    mut results: Results,
    file: &mut EstimateFile,
    mut figures: Vec<PageFigure>,
) -> Result<()> {
    if let Some(figure) = file.headways_figure() {
        let svg = figure.svg();
        results.add("headways.svg", svg.as_bytes())?;
        results.add("headways.csv", &figure.csv()?)?;
        figures.insert(0, PageFigure::new(&svg, &["headways.svg", "headways.csv"]));
    }
    results.add("estimates.csv", &file.csv()?)?;
    results.add("report.html", file.html(figures)?.as_bytes())?;
    file.files = results.names();
    results.publish(file.json()?.as_bytes())
}
