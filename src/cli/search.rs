//! `lanesweep search`: which description of a scenario keeps the outcomes with the fewest parameters?

use std::path::PathBuf;

use clap::Args;

use super::arguments::from_arguments;
use super::configured::Configured;
use super::console::Total;
use super::format::FormatFlag;
use super::source::{self, SourceFlags};
use super::{Exit, Output, lists};
use crate::report::search::SearchReport;
use crate::run::parts::Shard;
use crate::run::search::{self, Objective, SearchOptions};
use crate::scenario::{Category, Scenario};
use crate::support::files::{check_folder, make_folder};
use crate::support::readable::count;
use crate::support::run_folder::{RunFolder, SEARCH_RECORD};
use crate::traffic::Source;
use crate::{Error, Place, Result};

/// Search for a parameterization: the fewest parameters that keep the outcomes
///
/// Fits descriptions of many families and sizes: decompositions, physical features, polynomials, splines, constant
/// accelerations, and decompositions whose weights are tuned to the outcomes. Scores each by cross-validation over
/// recordings. The best of each size form a front beside the paper's parameterizations. The winner is a file for `study`,
/// `fit`, `sample` and `export`. Without data it uses generated recordings.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  lanesweep search --category lvd --criterion ttc\n  \
                        lanesweep search recordings --category cut-in --held-out others --out found")]
pub(super) struct Search {
    #[command(flatten)]
    data: SourceFlags,
    /// Data that the search does not read, to judge its front
    ///
    /// A folder of recordings, or a scenario file.
    #[arg(long, value_name = "PATH", help_heading = "Data")]
    held_out: Option<PathBuf>,
    /// Kind of scenario: cut-in, cut-out, lvd
    #[arg(long, value_name = "NAME", help_heading = "Scenario")]
    category: String,
    #[command(flatten)]
    models: lists::ModelsFlag,
    #[command(flatten)]
    criterion: lists::CriterionFlag,
    /// What to keep: F1, recall, or the ratio of failure rates
    #[arg(long, value_name = "f1|recall|risk", default_value = "f1", help_heading = "Models and criteria")]
    objective: String,
    #[command(flatten)]
    headways: lists::HeadwaysFlag,
    /// Give every scenario the outcomes of another one: no gain may be left on held-out data
    #[arg(long, help_heading = "Models and criteria", hide_short_help = true)]
    shuffled: bool,
    /// Folder for results and journals
    #[arg(long, value_name = "DIR", default_value = "lanesweep-search", help_heading = "Output")]
    out: PathBuf,
    /// Evaluate part I of N (from 0) only; without it: conclude
    ///
    /// Parts share the folder. The command without this flag, in the same folder, concludes.
    #[arg(long, value_name = "I/N", help_heading = "Run")]
    shard: Option<Shard>,
    #[command(flatten)]
    format: FormatFlag,
}

from_arguments!(
    Search { held_out, category, objective, shuffled, out }
    parsed { shard: str::parse }
    groups { data, models, criterion, headways, format }
);

impl Search {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let config = &configured.settings;
        let [category] = lists::categories(std::slice::from_ref(&self.category), "--category")?[..] else {
            return Err(Error::usage(
                Place::item("--category"),
                "one category is needed",
                "use cut-in, cut-out or lvd",
            ));
        };
        let profile = configured.profile()?;
        let options = SearchOptions {
            category,
            models: self.models.list()?,
            criterion: self.criterion.get()?,
            objective: objective(&self.objective)?,
            headways: self.headways.list()?,
            limits: config.search.clone(),
            parameterization: config.parameterization.clone(),
            score: config.score.clone(),
            shuffled: self.shuffled,
        };
        for name in ["report.html", SEARCH_RECORD, "fronts.csv", "candidates.csv", "winner.json"] {
            self.data.refuse_overwriting(&self.out.join(name), configured, "--out")?;
        }
        check_folder(&self.out)?;
        let opened = configured.open()?;
        let data = self.data.source(configured);
        let collection = self.data.report_and_load(configured)?;
        let held_out = self.held_out(configured, category)?;
        let sha256 = data.scenarios_sha256(&collection)?;
        if config.search.studies < config.search.min_studies() {
            tracing::warn!(
                "no weights are tuned: that takes {} studies for descriptions of up to {} parameters",
                config.search.min_studies(),
                config.search.max_parameters
            );
        }
        let search = search::Search::plan(&collection.scenarios, &profile, options)?;
        // Shards share the folder; the run that concludes has it alone.
        let folder = match self.shard {
            Some(_) => RunFolder::share(&self.out)?,
            None => RunFolder::open(&self.out, SEARCH_RECORD)?,
        };
        make_folder(folder.dir())?;
        let executor = opened.executor().with_recheck(config.score.seed);
        let unread = held_out.as_ref().map(|(scenarios, ..)| scenarios.as_slice());
        let (units, of) = (Total::Exact(config.search.studies as u64), (Some(folder.dir()), self.shard));
        let result = configured.with_bar(units, "searching", |bar| {
            search.run(unread, of, &executor, &|studies| bar.set_position(studies as u64))
        })?;
        let Some(result) = result else {
            tracing::info!("the candidates of this part are in {}", self.out.display());
            return Ok(Exit::Ok.into());
        };
        for (model, failing) in &result.left_out {
            tracing::warn!("{} is left out: S fails in {failing} scenarios only", model.name());
        }
        tracing::info!("{} studies", count(result.studies as u64));
        let kept: Vec<&Scenario> = collection.scenarios.iter().filter(|s| s.kept && s.category == category).collect();
        let report = SearchReport {
            modes: result
                .winner
                .as_ref()
                .and_then(|winner| winner.fitted_basis())
                .map_or(Ok(Vec::new()), |basis| basis.mode_shapes(&kept))?,
            result: &result,
            data: data.describe(collection.synthetic),
            held_out: held_out.as_ref().map(|(_, data, _)| data.clone()),
            scenarios_sha256: [sha256].into_iter().chain(held_out.map(|(.., sha256)| sha256)).collect(),
            synthetic: collection.synthetic,
            profile: &profile,
            command: configured.command.clone(),
            host: configured.host(&opened, 0, false),
        };
        let files = report.write(folder.results()?)?;
        let exit = if collection.problems.is_empty() { Exit::Ok } else { Exit::Incomplete };
        self.format.output_in(&self.out, exit, || report.text(), || report.json(&files))
    }

    /// The scenarios that the search does not read, their description, and their checksum.
    fn held_out(&self, configured: &Configured, category: Category) -> Result<Option<(Vec<Scenario>, String, String)>> {
        let Some(path) = &self.held_out else { return Ok(None) };
        let source = match path.is_dir() {
            true => Source::Recordings { path: path.clone(), preset: self.data.preset.preset.clone() },
            false => Source::Scenarios(path.clone()),
        };
        let collection = source::load(&source, configured, self.data.policy())?;
        let (data, sha256) = (source.describe(collection.synthetic), source.scenarios_sha256(&collection)?);
        let mut scenarios = collection.scenarios;
        scenarios.retain(|scenario| scenario.category == category);
        Ok(Some((scenarios, data, sha256)))
    }
}

fn objective(name: &str) -> Result<Objective> {
    match name.trim().to_lowercase().as_str() {
        "f1" => Ok(Objective::F1),
        "recall" => Ok(Objective::Recall),
        "risk" => Ok(Objective::Risk),
        _ => {
            let problem = format!("there is no objective `{name}`");
            Err(Error::usage(Place::item("--objective"), problem, "use f1, recall or risk"))
        }
    }
}
