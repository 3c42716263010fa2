//! The files of a sampling run: tables and figures of its counts, the page, the record last.

use super::host::Host;
use super::html::PageFigure;
use super::records::publish;
use super::sampling::{DensityRecord, DrawRecord, SampleReport};
use super::sampling_figures::convergence;
use super::sampling_tables::convergence_table;
use lanesweep_engine::Headway;
use lanesweep_run::sampling::{Sample, SampleResult, proposal_text};
use lanesweep_support::Result;
use lanesweep_support::run_folder::{ResultFiles, Results, TABLES};

impl SampleReport {
    /// From a run and its result.
    ///
    /// # Errors
    /// As `DensityModel::content_sha256`.
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
            search: result.search.clone(),
            host,
        })
    }

    /// Writes every file of the run to its folder, the record last; returns the names of the others.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Io`].
    pub fn write(&self, mut results: Results, sample: &Sample, result: &SampleResult) -> Result<ResultFiles> {
        let (density, mut figures) = (&sample.density, Vec::new());
        if let Some(run) = &result.crude {
            let numbers = format!("{TABLES}convergence.csv");
            results.add_table(&numbers, convergence_table(&run.convergence))?;
            let svg = convergence(density, &run.convergence, self.level()).svg();
            figures.push(PageFigure::add_svg(&mut results, "convergence", &svg, &numbers)?);
        }
        if let Some(proposal) = &result.proposal {
            results.add("proposal.json", proposal_text(density, proposal)?.as_bytes())?;
        }
        results.add("density.json", &density.to_json()?)?;
        if let Some(figure) = self.headways_figure() {
            figures.insert(0, PageFigure::add(&mut results, "headways", &figure, false)?);
        }
        results.add_table("estimates.csv", self.estimate_rows())?;
        results.add("report.html", self.html(figures).as_bytes())?;
        publish(results, |files| self.json(files))
    }
}
