//! `lanesweep justify`: is a parameterization appropriate for one driver model, kind of scenario and criterion?

use std::path::PathBuf;

use clap::Args;

use super::arguments::from_arguments;
use super::configured::Configured;
use super::console;
use super::format::FormatFlag;
use super::source::SourceFlags;
use super::{Exit, Output, lists};
use crate::model::driver::ModelId;
use crate::report::dossier::DossierReport;
use crate::report::dossier_changes::DossierFile;
use crate::run::justify::{Conclusion, JustifyOptions, justify};
use crate::scenario::Category;
use crate::scenario::Driven;
use crate::scenario::parameterization::Parameterization;
use crate::support::files::check_folder;
use crate::support::run_folder::{DOSSIER_RECORD, RunFolder};
use crate::{Error, Place, Result};

/// Is a parameterization appropriate for this driver model, scenario type and criterion?
///
/// Replays the recorded scenarios as recorded (S) and parameterized (S'), fits a density, and applies the rules of
/// [justify] in the configuration: appropriate, not appropriate, or undecided, with the amount of data that would
/// decide. The dossier (report.html) lists the failures that S' hides, shows the worst of them, and gives the risk
/// ratio, the coverage and the alternatives. Without data it uses generated recordings. Exit status: 0 appropriate, 11 not
/// appropriate, 8 undecided, 4 parts of the input were skipped.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep justify --parameterization 2 --models FSM\n  \
                  lanesweep justify recordings --parameterization iii --models CCHDM --criterion ttc --out dossier\n  \
                  lanesweep justify --scenarios scenarios.jsonl --parameterization 6 --models Reg157")]
pub(super) struct Justify {
    #[command(flatten)]
    data: SourceFlags,
    /// Parameterization: 1…7 (cut-in), a…g (cut-out), i…v (LVD), or a file of `search`
    #[arg(long, value_name = "KEY|FILE", help_heading = "Scenario")]
    parameterization: Option<String>,
    /// Driver model: Reg157, CCHDM, RSS, FSM
    #[arg(long, value_name = "NAME", help_heading = "Models and criteria")]
    models: Option<String>,
    #[command(flatten)]
    criterion: lists::CriterionFlag,
    #[command(flatten)]
    headways: lists::HeadwaysFlag,
    /// Another dossier (folder or dossier.json): list what differs from it
    ///
    /// Where DIR is a dossier too, nothing is simulated: both are compared, without their data.
    #[arg(long, value_name = "DOSSIER", help_heading = "Data")]
    against: Option<PathBuf>,
    /// Person responsible for the dossier [default: a line to fill in]
    #[arg(long, value_name = "NAME", help_heading = "Output", hide_short_help = true)]
    author: Option<String>,
    /// Date of the dossier [default: a line to fill in]
    #[arg(long, value_name = "YYYY-MM-DD", value_parser = date, help_heading = "Output", hide_short_help = true)]
    date: Option<String>,
    /// Folder for report.html, dossier.json and hidden.csv
    #[arg(long, value_name = "DIR", default_value = "lanesweep-dossier", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    format: FormatFlag,
}

from_arguments!(
    Justify { parameterization, models, against, author, out }
    parsed { date: date }
    groups { data, criterion, headways, format }
);

impl Justify {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let against = self.against.as_deref().map(DossierFile::read).transpose()?;
        if let Some(path) = self.data.recordings.as_deref().filter(|path| DossierFile::is_at(path)) {
            return self.compared(&DossierFile::read(path)?, against.as_ref());
        }
        let config = &configured.settings;
        let id = parameterization(given(&self.parameterization, "--parameterization", "name one, such as 2 or iii")?)?;
        let models = given(&self.models, "--models", "name one driver model")?;
        let model = ModelId::parse(models.trim()).ok_or_else(|| {
            let problem = format!("`{models}` is not one driver model");
            Error::usage(Place::item("--models"), problem, format!("use one of {}", ModelId::names()))
        })?;
        let criterion = self.criterion.get()?;
        let headways = self.headways.list()?;
        let profile = configured.profile()?;
        for name in ["report.html", DOSSIER_RECORD, "hidden.csv", "hidden.svg"] {
            self.data.refuse_overwriting(&self.out.join(name), configured, "--out")?;
        }
        check_folder(&self.out)?;
        let opened = configured.open()?;
        let collection = self.data.report_and_load(configured)?;
        let facts = self.data.source(configured).provenance(&collection, Driven { hours: None, kilometres: None })?;
        let mut compare = config.comparison(vec![id.category], vec![model], headways, vec![id]);
        compare.study.folds = Some(config.search.folds);
        let options = JustifyOptions { compare, criterion, score: config.score.clone(), rules: config.justify.clone() };
        let folder = RunFolder::open(&self.out, DOSSIER_RECORD)?;
        let executor = opened.executor().with_recheck(config.compare.seed);
        let dossier = justify(&collection.scenarios, &facts, &profile, &options, &executor)?;
        console::warn(&dossier.left_out);
        let report = DossierReport {
            dossier: &dossier,
            options: &options,
            provenance: &facts,
            recordings: &collection.recordings,
            profile: &profile,
            author: self.author.clone(),
            date: self.date.clone(),
            command: configured.command.clone(),
            host: configured.host(&opened, dossier.summary.rechecked_lanes, false),
            against: against.as_ref(),
        };
        let files = report.write(folder.results()?)?;
        let is_complete = collection.problems.is_empty() && dossier.left_out.is_empty();
        let exit = if is_complete { exit_of(dossier.conclusion) } else { Exit::Incomplete };
        let text = report.text()?;
        self.format.output_in(&self.out, exit, || text, || report.json(&files))
    }

    /// Compares two dossiers; the status is the conclusion of the first.
    fn compared(&self, this: &DossierFile, against: Option<&DossierFile>) -> Result<Output> {
        let other = against.ok_or_else(|| {
            let help = "give option `against`, or recordings in its place";
            Error::usage(Place::item("DIR"), "it is a dossier, and nothing to compare it with is given", help)
        })?;
        let changes = this.changes_from(other);
        self.format.output(exit_of(this.conclusion), || changes.text(), || changes.json())
    }
}

/// A word that only the comparison of two dossiers does without.
fn given<'a>(word: &'a Option<String>, flag: &'static str, help: &str) -> Result<&'a str> {
    word.as_deref().ok_or_else(|| Error::usage(Place::item(flag), "it is missing", help))
}

fn exit_of(conclusion: Conclusion) -> Exit {
    match conclusion {
        Conclusion::Appropriate => Exit::Ok,
        Conclusion::NotAppropriate => Exit::NotAppropriate,
        Conclusion::Undecided => Exit::Undecided,
    }
}

/// Finds a parameterization by its key; keys are unique over the categories.
fn parameterization(key: &str) -> Result<Parameterization> {
    if lists::is_file(key) {
        return Parameterization::read(key.trim().as_ref());
    }
    let found = Category::ALL.into_iter().find_map(|category| Parameterization::find(category, key.trim()));
    found.ok_or_else(|| {
        let keys = Category::ALL.into_iter().flat_map(Parameterization::of).map(|id| id.key.to_string());
        let help = format!("use one of {}", keys.collect::<Vec<_>>().join(", "));
        Error::usage(Place::item("--parameterization"), format!("there is no parameterization `{key}`"), help)
    })
}

/// A date in ISO 8601.
fn date(text: &str) -> std::result::Result<String, String> {
    let parts: Vec<Option<u32>> = text.split('-').map(|part| part.parse().ok()).collect();
    let is_day = matches!(parts[..], [Some(_), Some(1..=12), Some(1..=31)]) && text.len() == 10;
    if is_day { Ok(text.to_owned()) } else { Err("write a day such as 2026-11-24".to_owned()) }
}
