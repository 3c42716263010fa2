//! `lanesweep fit`: fits densities to the parameters of scenarios.

use std::path::PathBuf;

use clap::Args;

use super::configured::Configured;
use super::console;
use super::format::FormatFlag;
use super::lists;
use super::source::SourceFlags;
use super::{Exit, Output};
use lanesweep_model::scenario::parameterization::{Parameterization, ParameterizationOptions};
use lanesweep_model::scenario::{DataProvenance, Driven};
use lanesweep_report::density;
use lanesweep_report::host::SettingRecord;
use lanesweep_report::records;
use lanesweep_stats::density::{DensityModel, FitOptions, write_density};
use lanesweep_support::error::push_once;
use lanesweep_support::files::{check_output, file_name, make_folder_of};
use lanesweep_support::readable::counted;
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::{Error, Place, Result, option};

/// How are the parameters of scenarios distributed?
///
/// Fits a density to the kept scenarios of each category under each parameterization. Computes the physically
/// possible fraction of each density, and how often such scenarios occur. Writes one density file per parameterization.
/// Without data it uses generated recordings. Tables go to stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  lanesweep fit recordings --out densities\n  lanesweep fit --scenarios \
                        scenarios.jsonl --hours 44.5 --km 4450\n  lanesweep fit recordings --parameterizations 2 \
                        --with-thw --out cut-in-2.json")]
pub(super) struct Fit {
    #[command(flatten)]
    data: SourceFlags,
    /// Folder of density files, or one file.json for one density
    #[arg(long, value_name = "DIR|FILE", default_value = "lanesweep-densities", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    categories: lists::CategoriesFlag,
    /// Parameterizations: 1…7, a…g, i…v [default: all]
    ///
    /// 1…7 are for cut-ins, a…g for cut-outs, i…v for leader decelerations.
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Scenario")]
    parameterizations: Vec<String>,
    /// Add the observed time headway as a parameter (thw_s)
    #[arg(long, help_heading = "Scenario")]
    with_thw: bool,
    /// Leave the recorded series out of the density files
    ///
    /// `sample` then cannot compare its rates with those of the recorded scenarios. Use it if you share the file but
    /// not the recordings.
    #[arg(long, help_heading = "Models and criteria")]
    without_scenarios: bool,
    /// Driven time of all egos [default: from the recordings]
    #[arg(long, value_name = "h", help_heading = "Data")]
    hours: Option<f64>,
    /// Driven distance of all egos [default: from the recordings]
    #[arg(long, value_name = "km", help_heading = "Data")]
    km: Option<f64>,
    #[command(flatten)]
    format: FormatFlag,
}

impl Fit {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let config = &configured.settings;
        let ids = lists::parameterizations(&self.parameterizations, &self.categories.list()?)?;
        let typed = Driven { hours: self.hours, kilometres: self.km };
        typed.validate()?;
        let options = FitOptions {
            parameterization: ParameterizationOptions {
                svd_lateral: config.fit.svd_lateral,
                ..config.parameterization.clone()
            },
            with_thw: self.with_thw,
            rule: config.fit.bandwidth_rule,
            valid_draws: config.fit.valid_draws,
            seed: config.fit.seed,
        };
        let files = self.files(&ids)?;
        let (collection, facts) = self.data.load_with_exposure(configured, typed)?;

        // A single file needs no folder.
        let folder = (!self.is_single()).then(|| RunFolder::open(&self.out, None)).transpose()?;
        let mut fitted: Vec<(PathBuf, DensityModel)> = Vec::new();
        let (mut failed, mut complete) = (Vec::new(), collection.problems.is_empty());
        configured.with_bar(ids.len() as u64, "fitting", |bar| {
            for (id, file) in ids.iter().zip(files) {
                let result = DensityModel::fit(*id, &collection.scenarios, &facts, &options);
                bar.inc(1);
                let mut result = match result {
                    Ok(result) => result,
                    Err(error @ Error::Input { .. }) => {
                        push_once(&mut failed, error);
                        continue;
                    }
                    Err(error) => return Err(error),
                };
                bar.suspend(|| console::warn(&result.left_out));
                if self.without_scenarios {
                    result.model.scenarios.clear();
                }
                complete &= result.left_out.is_empty();
                fitted.push((file, result.model));
            }
            Ok(())
        })?;
        if fitted.is_empty() && !failed.is_empty() {
            return Err(failed.swap_remove(0));
        }
        console::warn(&failed);
        write(&fitted, folder.as_ref())?;
        let exit = if complete && failed.is_empty() { Exit::Ok } else { Exit::Incomplete };
        let json = || document(&facts, &fitted, &configured.record(false));
        let output = self.format.output(exit, || text(&facts, &fitted), json)?;
        tracing::info!("{} written to {}", counted(fitted.len(), "density file"), self.out.display());
        Ok(output)
    }

    /// One file per density.
    fn files(&self, ids: &[Parameterization]) -> Result<Vec<PathBuf>> {
        let single = self.is_single();
        if single && ids.len() != 1 {
            let problem = format!("{} is one file, but {} densities are fitted", self.out.display(), ids.len());
            let help = format!("give a folder, or choose one with {}", option("parameterizations"));
            return Err(Error::usage(Place::option("out"), problem, help));
        }
        let name = |id: &Parameterization| match single {
            true => self.out.clone(),
            false => self.out.join(format!("{}-{}.json", id.category.key().replace('_', "-"), id.key)),
        };
        let files: Vec<PathBuf> = ids.iter().map(name).collect();
        files.iter().try_for_each(|file| check_output(file))?;
        Ok(files)
    }

    fn is_single(&self) -> bool {
        self.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
    }
}

/// Publishes all densities together, in place of those of an earlier run.
fn write(fitted: &[(PathBuf, DensityModel)], folder: Option<&RunFolder>) -> Result<()> {
    let Some(folder) = folder else {
        return fitted.iter().try_for_each(|(file, model)| {
            make_folder_of(file)?;
            write_density(file, model)
        });
    };
    let mut results = folder.results()?;
    for (file, model) in fitted {
        results.add(&file_name(file), &model.to_json()?)?;
    }
    results.publish_all()
}

fn text(facts: &DataProvenance, fitted: &[(PathBuf, DensityModel)]) -> String {
    let mut text = format!("{}\n\n", facts.data);
    for (file, model) in fitted {
        text.push_str(&density::text(model));
        text.push_str(&format!("file       {}\n\n", file.display()));
    }
    if fitted.len() > 1 {
        let models: Vec<&DensityModel> = fitted.iter().map(|(_, model)| model).collect();
        text.push_str(&density::summary(&models));
    }
    if facts.synthetic {
        text.push_str("SYNTHETIC DATA: no number above is a statement about real traffic\n");
    }
    text
}

fn document(facts: &DataProvenance, fitted: &[(PathBuf, DensityModel)], settings: &[SettingRecord]) -> Result<String> {
    let densities = fitted.iter().map(|(file, model)| density::record(model, file));
    records::document(&serde_json::json!({
        "program": format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
        "data": facts.data,
        "synthetic": facts.synthetic,
        "scenarios_sha256": facts.scenarios_sha256,
        "settings": settings,
        "driven": facts.driven,
        "densities": densities.collect::<Vec<_>>(),
    }))
}
