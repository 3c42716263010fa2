//! The files of a sampling run: tables and figures of its counts, the page, the record last.

use sha2::{Digest, Sha256};

use super::host::Host;
use super::html::PageFigure;
use super::records::publish;
use super::sampling::{DensityRecord, DrawRecord, SampleReport};
use super::sampling_figures::{FailureMaps, convergence};
use super::sampling_tables::{convergence_csv, model_ratios_csv, profile_ratios_csv, worst_csv};
use crate::engine::{Headway, LanePlan};
use crate::run::sampling::{CrudeRun, Estimator, Sample, SampleResult, WorstLane, proposal_text};
use crate::stats::density::DensityModel;
use crate::support::plain_text::hex;
use crate::support::run_folder::{ResultFiles, Results};
use crate::{Error, Result};

impl SampleReport {
    /// From a run and its result.
    ///
    /// # Errors
    /// As [`DensityModel::content_sha256`].
    pub fn of_sample(sample: &Sample, result: &SampleResult, host: Host) -> Result<SampleReport> {
        let plan_headways = sample.options.headways().to_vec();
        let drawn = result.crude.as_ref().zip(sample.lane_plan());
        Ok(SampleReport {
            density: DensityRecord::of(&sample.density)?,
            profile: sample.profile.clone(),
            options: sample.options.clone(),
            headways: match sample.density.space.has_thw() {
                true => vec!["sampled".to_owned()],
                false => plan_headways.iter().map(Headway::to_string).collect(),
            },
            plan_headways,
            plan_sha256: drawn.map(|(_, plan)| plan.hash().to_owned()),
            draws: drawn.map(|(crude, plan)| DrawRecord::of(&crude.tally, plan)),
            estimates: result.rows.clone(),
            injuries: result.injuries.clone(),
            targets: sample.targets(result),
            search: result.search.clone(),
            worst_sha256: None,
            host,
        })
    }

    /// Writes every file of the run to its folder, the record last; returns the names of the others.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&mut self, mut results: Results, sample: &Sample, result: &SampleResult) -> Result<ResultFiles> {
        let (density, mut figures) = (sample.density(), Vec::new());
        if let (Some(crude), Some(plan)) = (&result.crude, sample.lane_plan()) {
            figures = self.crude_files(&mut results, plan, density, crude)?;
        }
        let ratios = sample.model_ratios(result);
        if !ratios.is_empty() {
            results.add("models.csv", model_ratios_csv(&ratios).as_bytes())?;
        }
        if let Some(of) = &result.profiles {
            results.add("profiles.csv", profile_ratios_csv(&sample.profile.name, of).as_bytes())?;
        }
        if matches!(sample.options.estimator, Estimator::Given { .. }) {
            // A proposal in this folder may be an input of the run.
            results.keep(|name| name == "proposal.json");
        }
        if let Some(proposal) = &result.proposal {
            results.add("proposal.json", proposal_text(density, proposal)?.as_bytes())?;
        }
        results.add("density.json", &density.to_json()?)?;
        self.publish(results, figures)
    }

    /// Writes convergence, worst lanes and maps; returns the figures.
    fn crude_files(
        &mut self,
        results: &mut Results,
        plan: &LanePlan,
        density: &DensityModel,
        run: &CrudeRun,
    ) -> Result<Vec<PageFigure>> {
        let mut figures = Vec::new();
        if !run.convergence.is_empty() {
            results.add("convergence.csv", convergence_csv(&run.convergence).as_bytes())?;
            let svg = convergence(density, &run.convergence, self.level()).svg();
            figures.push(PageFigure::add_svg(results, "convergence", &svg, "convergence.csv")?);
        }
        let Some(generator) = plan.generator() else {
            return Err(Error::Internal("the plan has no generator".to_owned()));
        };
        let names: Vec<String> = density.space.parameters().iter().map(|p| p.name.clone()).collect();
        let worst = WorstLane::of_tally(plan, &run.tally, |key| {
            let drawn = generator.draw(key.unit).values;
            let point: Vec<f64> = drawn[..names.len()].iter().map(|&v| f64::from(v)).collect();
            let headway = density.space.thw_s(&point).map(|thw_s| format!("{thw_s}s"));
            Ok((point, headway))
        })?;
        self.add_worst(results, &worst, &names)?;
        if let Some(map) = &run.tally.map {
            let samples = run.tally.samples() - run.tally.voids;
            let maps = FailureMaps { density, plan, map, samples, criterion: self.options.criterion };
            for (model, id) in plan.models.iter().enumerate() {
                let (name, numbers) = (format!("map-{}", id.name()), format!("map-{}.csv", id.name()));
                results.add(&numbers, maps.csv(model).as_bytes())?;
                figures.push(PageFigure::add_svg(results, &name, &maps.figure(model).svg(), &numbers)?);
            }
        }
        Ok(figures)
    }

    /// Adds the table of the worst lanes, if the run has one, and its checksum to the record.
    ///
    /// # Errors
    /// [`Error::Io`].
    fn add_worst(&mut self, results: &mut Results, lanes: &[WorstLane], names: &[String]) -> Result<()> {
        if self.options.worst == 0 {
            return Ok(());
        }
        let table = worst_csv(lanes, names, self.options.criterion);
        self.worst_sha256 = Some(hex(&Sha256::digest(&table)));
        results.add("worst.csv", table.as_bytes())
    }

    /// Adds table and page of the estimates, then publishes all files with the record; returns their names.
    ///
    /// # Errors
    /// [`Error::Io`].
    fn publish(&self, mut results: Results, mut figures: Vec<PageFigure>) -> Result<ResultFiles> {
        if let Some(figure) = self.headways_figure() {
            figures.insert(0, PageFigure::add(&mut results, "headways", &figure)?);
        }
        results.add("estimates.csv", self.csv().as_bytes())?;
        for (name, table) in [("injuries.csv", self.injuries_table(true)), ("targets.csv", self.targets_table())] {
            if !table.rows.is_empty() {
                results.add(name, table.csv().as_bytes())?;
            }
        }
        results.add("report.html", self.html(figures).as_bytes())?;
        publish(results, |files| self.json(files))
    }
}
