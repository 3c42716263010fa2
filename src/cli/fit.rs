//! `lanesweep fit`: fits densities to the parameters of scenarios.

use std::path::{Path, PathBuf};

use clap::Args;

use super::arguments::from_arguments;
use super::configured::Configured;
use super::console::{self, Total};
use super::format::FormatFlag;
use super::lists;
use super::source::{self, SourceFlags};
use super::{COMMIT, Exit, Output};
use crate::report::case_identity::program;
use crate::report::coverage::{self, CoverageSheet};
use crate::report::density;
use crate::report::host::SettingRecord;
use crate::report::records;
use crate::scenario::parameterization::Parameterization;
use crate::scenario::{DataProvenance, Scenario};
use crate::stats::density::{DensityModel, FitOptions, write_density};
use crate::support::error::push_once;
use crate::support::files::{check_folder_of, file_name, make_folder_of, write_atomically};
use crate::support::input_file;
use crate::support::readable::counted;
use crate::support::run_folder::RunFolder;
use crate::{Error, Place, Result};

/// How are the parameters of scenarios distributed?
///
/// Fits a density to the kept scenarios of each category under each parameterization. Computes the physically
/// possible fraction of each density, how often such scenarios occur, and how well drawn scenarios represent unseen
/// real ones. Writes one density file per parameterization. Without data it uses generated recordings. Tables go to
/// stdout, files to --out.
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
    #[command(flatten)]
    parameterizations: lists::ParameterizationsFlag,
    /// Add the observed time headway as a parameter (thw_s)
    #[arg(long, help_heading = "Scenario")]
    with_thw: bool,
    /// Skip the comparison of drawn with unseen scenarios
    #[arg(long, help_heading = "Models and criteria", hide_short_help = true)]
    no_comparison: bool,
    /// Leave the recorded series out of the density files
    ///
    /// `sample` then cannot compare its rates with those of the recorded scenarios. Use it if you share the file but
    /// not the recordings.
    #[arg(long, help_heading = "Models and criteria", hide_short_help = true)]
    without_scenarios: bool,
    /// Tested cases, whose coverage is shown in place of that of the recorded ones
    ///
    /// A table of cases, such as cases.csv of `vary`, or a scenario file. They do not enter the density.
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    tested: Option<PathBuf>,
    /// Range of a parameter for the coverage [default: that of the recorded cases]; repeatable
    #[arg(long, value_name = "NAME=FROM..TO", help_heading = "Scenario")]
    range: Vec<String>,
    #[command(flatten)]
    exposure: lists::ExposureFlags,
    #[command(flatten)]
    format: FormatFlag,
}

from_arguments!(
    Fit { out, with_thw, no_comparison, without_scenarios, tested, range }
    groups { data, categories, parameterizations, exposure, format }
);

impl Fit {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let config = &configured.settings;
        let ids = self.ids()?;
        let typed = self.exposure.driven()?;
        let options = FitOptions {
            parameterization: config.of_densities(),
            with_thw: self.with_thw,
            kind: config.fit.density,
            rule: config.fit.bandwidth_rule,
            valid_draws: config.fit.valid_draws,
            seed: config.fit.seed,
            representativeness: !self.no_comparison,
        };
        let files = self.files(&ids, configured)?;
        let ranges = self.ranges()?;
        // Of any filter: what was tested counts.
        let mut about = vec![("program", program(COMMIT, 40))];
        let tested = match &self.tested {
            Some(path) => {
                about.push(("SHA-256 of the tested cases", input_file::sha256(path)?));
                Some((file_name(path), source::scenarios_of(path, self.data.policy())?.0))
            }
            None => None,
        };
        let (collection, facts) = self.data.load_with_exposure(configured, typed)?;

        // A single file needs no folder.
        let folder = (!self.is_single()).then(|| RunFolder::open_without_record(&self.out)).transpose()?;
        let mut fitted: Vec<FittedFile> = Vec::new();
        let (mut failed, mut complete) = (Vec::new(), collection.problems.is_empty());
        configured.with_bar(Total::Exact(ids.len() as u64), "fitting", |bar| {
            for (id, file) in ids.iter().zip(files) {
                let result = DensityModel::fit(id.clone(), &collection.scenarios, &facts, &options);
                bar.inc(1);
                let mut result = match result {
                    Ok(result) => result,
                    Err(error @ Error::Input { .. }) => {
                        push_once(&mut failed, error);
                        continue;
                    }
                    Err(error) => return Err(error),
                };
                bar.suspend(|| console::warn(result.left_out.iter().chain(&result.not_compared)));
                if self.without_scenarios {
                    result.model.scenarios.clear();
                }
                complete &= result.left_out.is_empty();
                let coverage = covered(&result.model, tested.as_ref(), &ranges, options.seed, &about)?;
                fitted.push(FittedFile { file, model: result.model, coverage });
            }
            Ok(())
        })?;
        let is_known = |name: &str| {
            fitted.iter().flat_map(|of| of.model.space.parameters()).any(|parameter| parameter.name == name)
        };
        if let Some((unknown, _)) = ranges.iter().find(|(name, _)| !fitted.is_empty() && !is_known(name)) {
            let problem = format!("no fitted density has the parameter `{unknown}`");
            return Err(Error::usage(Place::item("--range"), problem, "the table of a density names its parameters"));
        }
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

    fn ranges(&self) -> Result<Vec<(String, [f64; 2])>> {
        self.range.iter().map(|text| lists::range(text).map(|(name, ends)| (name.to_owned(), ends))).collect()
    }

    /// The parameterizations to fit, in the registry's order.
    fn ids(&self) -> Result<Vec<Parameterization>> {
        self.parameterizations.list(&self.categories.list()?)
    }

    /// One file per density; none of them may be an input.
    fn files(&self, ids: &[Parameterization], configured: &Configured) -> Result<Vec<PathBuf>> {
        let single = self.is_single();
        if single && ids.len() != 1 {
            return Err(Error::usage(
                Place::item("--out"),
                format!("{} is one file, but {} densities are fitted", self.out.display(), ids.len()),
                "give a folder, or choose one with --parameterizations",
            ));
        }
        let name = |id: &Parameterization| match single {
            true => self.out.clone(),
            false => self.out.join(format!("{}-{}.json", id.category.key().replace('_', "-"), id.key)),
        };
        let files: Vec<PathBuf> = ids.iter().map(name).collect();
        let beside: Vec<PathBuf> = self.data.scenarios.as_deref().map(DataProvenance::path_of).into_iter().collect();
        let beside: Vec<PathBuf> = beside.into_iter().chain(self.tested.clone()).collect();
        for file in files.iter().flat_map(|file| [file.clone(), page_of(file)]) {
            let file = &file;
            self.data.refuse_overwriting(file, configured, "--out")?;
            source::refuse_overwriting(file, &beside, "--out")?;
            check_folder_of(file)?;
        }
        Ok(files)
    }

    fn is_single(&self) -> bool {
        self.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
    }
}

/// A density with its file and its coverage.
struct FittedFile {
    file: PathBuf,
    model: DensityModel,
    coverage: CoverageSheet,
}

/// The page beside a density file: `cut-in-2-coverage.html`.
fn page_of(file: &Path) -> PathBuf {
    file.with_file_name(format!("{}-coverage.html", file.file_stem().unwrap_or_default().to_string_lossy()))
}

/// The coverage of a density by its recorded cases, or by those tested cases of its category that have its parameters.
fn covered(
    model: &DensityModel,
    tested: Option<&(String, Vec<Scenario>)>,
    ranges: &[(String, [f64; 2])],
    seed: u64,
    about: &[(&'static str, String)],
) -> Result<CoverageSheet> {
    let points = tested.map(|(name, scenarios)| {
        let of_category = scenarios.iter().filter(|scenario| scenario.category == model.category());
        let (points, left_out): (Vec<_>, Vec<_>) =
            of_category.map(|scenario| model.space.point(scenario)).partition(Result::is_ok);
        if !left_out.is_empty() {
            let of = model.space.id().name();
            tracing::warn!("{} of {name} have not the parameters of {of}", counted(left_out.len(), "case"));
        }
        (name.as_str(), points.into_iter().flatten().collect::<Vec<Vec<f64>>>())
    });
    if let Some((name, _)) = points.as_ref().filter(|(_, points)| points.is_empty()) {
        let problem =
            format!("{name} has no {} with the parameters of {}", model.category().label(), model.space.id().name());
        let help = "give cases of this kind, or name other categories and parameterizations";
        return Err(Error::usage(Place::item("--tested"), problem, help));
    }
    coverage::sheet(model, points, ranges, seed, about)
}

/// Publishes all densities together. Each is an independent result with its checksum, so those of other runs are kept.
fn write(fitted: &[FittedFile], folder: Option<&RunFolder>) -> Result<()> {
    let Some(folder) = folder else {
        return fitted.iter().try_for_each(|of| {
            make_folder_of(&of.file)?;
            write_density(&of.file, &of.model)?;
            write_atomically(&page_of(&of.file), of.coverage.html.as_bytes())
        });
    };
    let mut results = folder.results()?;
    for of in fitted {
        results.add(&file_name(&of.file), &of.model.to_json()?)?;
        results.add(&file_name(&page_of(&of.file)), of.coverage.html.as_bytes())?;
    }
    results.publish_each()
}

fn text(facts: &DataProvenance, fitted: &[FittedFile]) -> String {
    let mut text = format!("{}\n\n", facts.data);
    for of in fitted {
        text.push_str(&density::text(&of.model));
        text.push_str(&format!("coverage   {}\n", of.coverage.text));
        text.push_str(&format!("file       {}\n\n", of.file.display()));
    }
    if fitted.len() > 1 {
        let models: Vec<&DensityModel> = fitted.iter().map(|of| &of.model).collect();
        text.push_str(&density::summary(&models));
    }
    if facts.synthetic {
        text.push_str("SYNTHETIC DATA: no number above is a statement about real traffic\n");
    }
    text
}

fn document(facts: &DataProvenance, fitted: &[FittedFile], settings: &[SettingRecord]) -> Result<String> {
    let densities = fitted.iter().map(|of| {
        let mut record = density::record(&of.model);
        record["coverage"] = of.coverage.json.clone();
        record["file"] = of.file.display().to_string().into();
        record
    });
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
