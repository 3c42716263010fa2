//! `lanesweep check`: concrete cases against the regulation.

use std::path::{Path, PathBuf};

use clap::Args;

use super::case_flags::{GivenCase, from_table, from_toml};
use super::check_table::CheckedTable;
use super::configured::{Configured, load_profile};
use super::format::FormatFlag;
use super::source::{PlausibilityFlag, check_ending, scenarios_of};
use super::{COMMIT, Exit, Output};
use lanesweep_model::driver::ModelId;
use lanesweep_model::plausibility::Doubts;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Scenario;
use lanesweep_report::case_evidence::CaseIdentity;
use lanesweep_report::case_sheet::CaseSheet;
use lanesweep_run::check::{Check as Checked, Subject, retain_applicable};
use lanesweep_support::files::{check_output, write_atomically};
use lanesweep_support::input_file::{self, plain_name};
use lanesweep_support::plain_text::shown_in_line;
use lanesweep_support::table::TableFormat;
use lanesweep_support::{Error, Place, Result, option};

/// Default profiles; the first one decides.
const PROFILES: [&str; 6] = ["un-r157", "eu-2022-1426", "eu-2022-1426-standing", "jrc-2021", "paper", "paper-fit"];

/// Check concrete cases: do the reference drivers of UN R157 avoid the collision?
///
/// The case comes from flags, from a TOML file or a table (keys and columns are the flags' names with `_`, speeds with
/// their unit, `ego_speed_kmh`; flags override them), or from a scenario of a file. Every model runs
/// under every profile. The case is preventable if CCHDM or FSM, the drivers of Annex 3, avoids the collision under the
/// first profile. It has no conflict if nothing collides even when the ego never reacts. It is undecided if a
/// tenth of the time step or a measurement error of an input changes the answer. It is outside Annex 3 if the
/// annex does not describe such a case. The output also has the margins, the clauses, and the distance to another
/// answer along each parameter. A table without --row is judged whole, under one profile, with a line per row; its
/// exit status is that of its worst answer, in the order not preventable, undecided, outside Annex 3, preventable, no
/// conflict. Exit status: 0 preventable, 1 not preventable, 8 undecided, 9 no conflict, 10 outside
/// Annex 3, 4 parts of the input were skipped.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep check --category cut-in --ego-speed 60km/h --speed 40km/h --gap 15 --lateral-speed 1\n  \
                  lanesweep check cases.csv --row 2 --sheet case.html\n  \
                  lanesweep check scenarios.jsonl --scenario 01_cut_in_97_91_957 --thw 1.2")]
pub(super) struct Check {
    /// TOML file, table (.csv, .parquet) or scenario file (.jsonl) with the case
    #[arg(value_name = "FILE", help_heading = "Data")]
    file: Option<PathBuf>,
    /// Row of a table, from 1 after the header [default: all rows]
    #[arg(long, value_name = "N", requires = "file", help_heading = "Data")]
    row: Option<usize>,
    /// Scenario of a scenario file, by its id
    ///
    /// It starts with its observed gap, or with --gap or --thw.
    #[arg(long, value_name = "ID", requires = "file", conflicts_with = "row", help_heading = "Data")]
    scenario: Option<String>,
    #[command(flatten)]
    pub(super) case: GivenCase,
    /// Profiles; the first one decides [default: un-r157, and the five others]
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Models and criteria")]
    profiles: Vec<String>,
    /// Print the whole sheet of a case: other profiles, clauses, readings, hashes
    #[arg(long, help_heading = "Output")]
    full: bool,
    /// Also write the sheet of a case, a page to print
    #[arg(long, value_name = "FILE.html", help_heading = "Output")]
    sheet: Option<PathBuf>,
    /// Also write a table's answers, one row per case: .csv, .jsonl or .parquet
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(super) rows: Option<PathBuf>,
    /// Only the computed answers of a table, by lanes: a million rows take seconds
    ///
    /// No perturbation, clause or boundary is examined, so that no answer is robust.
    #[arg(long, help_heading = "Models and criteria")]
    pub(super) nominal: bool,
    /// Date of the run, as the sheet is to show it; the clock is not asked
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    date: Option<String>,
    /// Author, as the sheet is to show it
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    author: Option<String>,
    #[command(flatten)]
    pub(super) plausibility: PlausibilityFlag,
    #[command(flatten)]
    pub(super) format: FormatFlag,
}

/// The checked case, with facts for the reader.
struct CheckRequest {
    subject: Subject,
    origin: String,
    is_synthetic: bool,
    incomplete: bool,
    /// What is implausible and was let pass.
    doubts: Vec<String>,
}

impl Check {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        configured.refuse_lane_keys(
            false,
            "has no effect on a check",
            &format!("leave it out; {} names the profiles, which hold the time step", option("profiles")),
        )?;
        self.guard_outputs()?;
        let names = if self.profiles.is_empty() { PROFILES.map(str::to_owned).to_vec() } else { self.profiles.clone() };
        let mut profiles = names.iter().map(|name| load_profile(name.trim())).collect::<Result<Vec<_>>>()?;
        let models = self.case.named_models()?.unwrap_or_else(|| ModelId::ALL.to_vec());
        let table = self.whole_table();
        self.guard_flags(table)?;
        if let Some(path) = table {
            return CheckedTable { check: self, path, profile: &profiles[0], models: &models }.run(configured);
        }
        let request = self.request(&profiles[0])?;
        if self.profiles.is_empty() {
            retain_applicable(&mut profiles, request.subject.category());
        }
        let check = Checked { subject: request.subject, profiles, models };
        let judgements = check.run()?;
        let sheet = CaseSheet {
            subject: &check.subject,
            origin: request.origin,
            is_synthetic: request.is_synthetic,
            doubts: &request.doubts,
            profiles: &check.profiles,
            judgements: &judgements,
            command: configured.command.clone(),
            identity: CaseIdentity {
                commit: COMMIT,
                file_sha256: self.file.as_deref().map(input_file::sha256).transpose()?,
                date: self.date.clone(),
                author: self.author.clone(),
            },
        };
        if let Some(path) = &self.sheet {
            write_atomically(path, sheet.html().as_bytes())?;
        }
        // If input was skipped the answer is incomplete.
        let exit = if request.incomplete { Exit::Incomplete } else { Exit::from(judgements[0].verdict()) };
        let text = || if self.full { sheet.text() } else { sheet.brief() };
        Ok(self.format.output(exit, text, || sheet.json())?.with_tables(|| sheet.tables()))
    }

    /// The table to be judged with all rows.
    fn whole_table(&self) -> Option<&Path> {
        let path = self.file.as_deref().filter(|_| self.row.is_none() && self.scenario.is_none())?;
        let ending = plain_name(path);
        let ending = ending.extension()?;
        ["csv", "parquet"].iter().any(|table| ending.eq_ignore_ascii_case(table)).then_some(path)
    }

    /// Refuses flags of one case for a whole table, and flags of a table for one case.
    fn guard_flags(&self, table: Option<&Path>) -> Result<()> {
        let of_one = [
            ("sheet", self.sheet.is_some()),
            ("date", self.date.is_some()),
            ("author", self.author.is_some()),
            ("profiles", self.profiles.len() > 1),
        ];
        let of_tables = [("rows", self.rows.is_some()), ("nominal", self.nominal)];
        let (flags, problem, help) = match table {
            Some(path) => {
                let problem =
                    format!("it needs one case, and {} is judged with all its rows, under one profile", path.display());
                (&of_one[..], problem, format!("choose a row: {}, from 1 after the header", option("row = N")))
            }
            None => {
                let help = format!("give a table (.csv, .parquet) without {}, or leave it out", option("row"));
                (&of_tables[..], "it is of a table of cases, and this is one case".to_owned(), help)
            }
        };
        let given = flags.iter().find(|(_, is_given)| *is_given);
        given.map_or(Ok(()), |(flag, _)| Err(Error::usage(Place::option(flag), problem, help)))
    }

    fn request(&self, profile: &Profile) -> Result<CheckRequest> {
        let Some(path) = &self.file else {
            return self.of_flags(GivenCase::default(), profile, "a case of flags".to_owned());
        };
        let origin = path.display().to_string();
        let ending = plain_name(path).extension().map(|ending| ending.to_ascii_lowercase()).unwrap_or_default();
        let without_row = format!("leave out {}, or give a table (.csv, .parquet)", option("row"));
        let with_id = format!("name one: {}", option("scenario = ID"));
        let (problem, help) = match (ending.to_str().unwrap_or_default(), &self.scenario) {
            ("toml", None) if self.row.is_none() => return self.of_flags(from_toml(path)?, profile, origin),
            ("csv" | "parquet", None) => {
                let row = self.row.unwrap_or(1);
                let case = from_table(path, Some(row))?;
                let id = case.id.as_ref().map_or(String::new(), |id| format!(", id {}", shown_in_line(id)));
                return self.of_flags(case, profile, format!("{origin}, row {row}{id}"));
            }
            ("jsonl" | "csv" | "parquet", Some(id)) => {
                let (scenarios, incomplete) = scenarios_of(path, self.plausibility.policy())?;
                let found = scenarios.iter().find(|scenario| scenario.id == *id).cloned();
                let found = found.ok_or_else(|| unknown(path, id, &scenarios))?;
                return self.of_scenario(found, format!("{id} of {origin}"), incomplete);
            }
            ("toml", None) => ("one case has no rows", &*without_row),
            ("jsonl", None) => ("a scenario file has many scenarios", &*with_id),
            ("xosc", _) => (
                "OpenSCENARIO files are not read as cases",
                "give a .jsonl scenario file; OpenSCENARIO is written by `simulate`, not read",
            ),
            (_, Some(_)) => ("it has no scenarios", "give a .jsonl, .csv or .parquet file of scenarios"),
            _ => ("this kind of file holds no case", "give a .toml, .csv, .parquet or .jsonl file"),
        };
        Err(Error::usage(Place::file(path), problem, help))
    }

    fn of_flags(&self, file: GivenCase, profile: &Profile, origin: String) -> Result<CheckRequest> {
        let given = self.case.over(file);
        if given.is_empty() {
            let help = format!("give a case ({}, {}, …) or a file", option("category"), option("ego_speed"));
            return Err(Error::usage(Place::item("lanesweep check"), "there is nothing to check", help));
        }
        let mut doubts = Doubts::new(self.plausibility.policy());
        let subject = given.subject(profile, &mut doubts)?;
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        Ok(CheckRequest { subject, origin, is_synthetic: false, incomplete: false, doubts: doubts.sentences() })
    }

    fn of_scenario(&self, scenario: Scenario, origin: String, incomplete: bool) -> Result<CheckRequest> {
        let headway = self.case.start()?;
        if self.case.gives_more_than(&["gap", "thw"]) {
            let problem = "the scenario is a complete case: the others would be ignored";
            let help = format!("keep {} or {}, and leave out the others of a case", option("gap"), option("thw"));
            return Err(Error::usage(Place::item(origin), problem, help));
        }
        let is_synthetic = scenario.synthetic;
        let subject = Subject::recorded(scenario, headway)?;
        Ok(CheckRequest { subject, origin, is_synthetic, incomplete, doubts: Vec::new() })
    }

    /// Outputs must have the right file ending.
    fn guard_outputs(&self) -> Result<()> {
        if let Some(path) = &self.rows {
            TableFormat::of(path, &TableFormat::EVERY, &option("rows"))?;
            check_output(path)?;
        }
        self.sheet.as_ref().map_or(Ok(()), |path| check_ending(path, "html", "sheet"))
    }
}

fn unknown(path: &Path, id: &str, scenarios: &[Scenario]) -> Error {
    let example = scenarios.iter().find(|of| of.kept).map_or(String::new(), |of| format!(", for instance {}", of.id));
    let help = format!("give the id of one of its {} scenarios{example}", scenarios.len());
    Error::usage(Place::file(path), format!("it has no scenario `{id}`"), help)
}
