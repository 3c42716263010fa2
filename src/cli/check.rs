//! `lanesweep check`: one concrete case against the regulation.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Exit;
use super::case_flags::{CaseFlags, from_table, from_toml};
use super::configured::Configured;
use super::console;
use super::format::FormatFlag;
use super::source::{PlausibilityFlag, refuse_overwriting, scenarios_of};
use crate::interop::openscenario::read_scenario;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::case_sheet::CaseSheet;
use crate::report::trace::{self, TracePanels};
use crate::run::check::{Answer, Check as Checked, Subject, Verdict};
use crate::scenario::{Category, Scenario};
use crate::support::files::{make_folder_of, write_atomically};
use crate::{Error, Place, Result};

/// Default profiles; the first one decides.
const PROFILES: [&str; 6] = ["un-r157", "eu-2022-1426", "eu-2022-1426-standing", "jrc-2021", "paper", "paper-fit"];

/// Check one concrete case: do the reference drivers of UN R157 avoid the collision?
///
/// The case comes from flags, from a TOML file or a row of a table (keys and columns are the flags' names with `_`;
/// flags override them), from a scenario of a file, or from an OpenSCENARIO file of `export xosc`. Every model runs
/// under every profile. The case is preventable if CCHDM or FSM, the drivers of Annex 3, avoids the collision under the
/// first profile. It has no conflict if nothing collides even when the ego never reacts. It is undecided if one of
/// these changes the answer: a tenth of the time step, 1 cm of gap, 0.1 km/h of speed. It is outside Annex 3 if the
/// annex does not describe such a case. The output also has the margins, the clauses, and the distance to another
/// answer along each parameter. Exit status: 0 preventable, 1 not preventable, 8 undecided, 9 no conflict, 10 outside
/// Annex 3, 4 parts of the input were skipped.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep check --category cut-in --ego-speed 60km/h --speed 40km/h --gap 15 --lateral-speed 1.0 \\\n      \
                  --sheet case.html\n  \
                  lanesweep check cases.csv --row 2\n  \
                  lanesweep check scenarios.jsonl --scenario 01_cut_in_97_91_957 --thw 1.2")]
pub struct Check {
    /// TOML file, table (.csv, .parquet), scenario file (.jsonl) or OpenSCENARIO file (.xosc) with the case
    #[arg(value_name = "FILE", help_heading = "Data")]
    file: Option<PathBuf>,
    /// Row of a table, from 1 after the header
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Data")]
    row: usize,
    /// Scenario of a scenario file, by its id
    ///
    /// It starts with its observed gap, or with --gap or --thw.
    #[arg(long, value_name = "ID", requires = "file", conflicts_with = "row", help_heading = "Data")]
    scenario: Option<String>,
    #[command(flatten)]
    case: CaseFlags,
    /// Profiles; the first one decides [default: un-r157, the two of EU 2022/1426, jrc-2021, paper, paper-fit]
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Models and criteria")]
    profiles: Vec<String>,
    /// Also write the case sheet as an HTML page for printing
    #[arg(long, value_name = "FILE.html", help_heading = "Output")]
    sheet: Option<PathBuf>,
    /// Also write the vehicles in motion, from above, as an animated SVG
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    animation: Option<PathBuf>,
    /// Also write every step of every model under the first profile
    #[arg(long, value_name = "FILE.csv", help_heading = "Output")]
    series: Option<PathBuf>,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
    #[command(flatten)]
    format: FormatFlag,
}

/// The checked case, with facts for the reader.
struct CheckRequest {
    subject: Subject,
    origin: String,
    is_synthetic: bool,
    incomplete: bool,
}

impl Check {
    pub fn run(&self, configured: &Configured) -> Result<Exit> {
        configured.refuse_assigned(
            "has no effect on a check",
            "leave it out; --profiles names the profiles, which hold the time step",
        )?;
        self.guard_outputs()?;
        let names = if self.profiles.is_empty() { PROFILES.map(str::to_owned).to_vec() } else { self.profiles.clone() };
        let mut profiles = names.iter().map(|name| Profile::load(name.trim())).collect::<Result<Vec<_>>>()?;
        let request = self.request(&profiles[0])?;
        // A profile that only adds its own cut-in clause does not apply to other cases.
        if self.profiles.is_empty() && request.subject.category() != Category::CutIn {
            let first = profiles[0].clone();
            let is_first = |p: &Profile| {
                (&p.frame, &p.cchdm, &p.rss, &p.fsm) == (&first.frame, &first.cchdm, &first.rss, &first.fsm)
            };
            profiles.retain(|profile| profile.name == first.name || !is_first(profile));
        }
        let models = self.case.named_models()?.unwrap_or_else(|| ModelId::ALL.to_vec());
        let check = Checked { subject: request.subject, profiles, models };
        let judgements = check.run()?;
        let sheet = CaseSheet {
            subject: &check.subject,
            origin: request.origin,
            is_synthetic: request.is_synthetic,
            profiles: &check.profiles,
            judgements: &judgements,
            command: console::command_line(),
        };
        if let Some(path) = &self.sheet {
            write(path, sheet.html()?.as_bytes())?;
        }
        if let Some(path) = &self.animation {
            write(path, sheet.figure(TracePanels::Course).animation().svg().as_bytes())?;
        }
        if let Some(path) = &self.series {
            let named = judgements[0].models.iter().map(|judged| (judged.trace.model.name().to_owned(), &judged.trace));
            write(path, trace::table(&named.collect::<Vec<_>>()).csv().as_bytes())?;
        }
        self.format.print(|| sheet.text(), || sheet.json())?;
        Ok(match judgements[0].verdict() {
            // If input was skipped the answer is incomplete.
            _ if request.incomplete => Exit::Incomplete,
            Verdict::Undecided | Verdict::Answer(Answer::Open) => Exit::Undecided,
            Verdict::OutsideAnnex | Verdict::NotJudged => Exit::OutsideAnnex,
            Verdict::Answer(Answer::Preventable) => Exit::Ok,
            Verdict::Answer(Answer::NotPreventable) => Exit::NotPreventable,
            Verdict::Answer(Answer::NoConflict) => Exit::NoConflict,
        })
    }

    fn request(&self, profile: &Profile) -> Result<CheckRequest> {
        let Some(path) = &self.file else {
            return self.of_flags(CaseFlags::default(), profile, "a case of flags".to_owned());
        };
        let origin = path.display().to_string();
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase()).unwrap_or_default();
        match (ending.to_str().unwrap_or_default(), &self.scenario) {
            ("xosc", None) => self.of_scenario(read_scenario(path)?, origin, false),
            ("toml", None) => self.of_flags(from_toml(path)?, profile, origin),
            ("csv" | "parquet", None) => {
                self.of_flags(from_table(path, self.row)?, profile, format!("{origin}, row {}", self.row))
            }
            ("jsonl" | "csv" | "parquet", Some(id)) => {
                let (scenarios, incomplete) = scenarios_of(path, self.plausibility.policy())?;
                let found = scenarios.iter().find(|scenario| scenario.id == *id).cloned();
                let found = found.ok_or_else(|| unknown(path, id, &scenarios))?;
                self.of_scenario(found, format!("{id} of {origin}"), incomplete)
            }
            ("jsonl", None) => {
                let help = "name one: --scenario ID";
                Err(Error::usage(Place::file(path), "a scenario file has many scenarios", help))
            }
            (_, Some(_)) => {
                let help = "give a .jsonl, .csv or .parquet file of scenarios";
                Err(Error::usage(Place::item("--scenario"), format!("{origin} has no scenarios"), help))
            }
            _ => {
                let help = "give a .toml, .csv, .parquet, .jsonl or .xosc file";
                Err(Error::usage(Place::file(path), "this kind of file holds no case", help))
            }
        }
    }

    fn of_flags(&self, file: CaseFlags, profile: &Profile, origin: String) -> Result<CheckRequest> {
        let flags = self.case.over(file);
        if !flags.says_a_case() {
            let help = "give a case (--category, --ego-speed, …) or a FILE";
            return Err(Error::usage(Place::item("lanesweep check"), "there is nothing to check", help));
        }
        let plain = flags.plain_case(profile, self.plausibility.policy())?;
        let subject = Subject::plain(&plain, flags.headway()?);
        Ok(CheckRequest { subject, origin, is_synthetic: false, incomplete: false })
    }

    fn of_scenario(&self, scenario: Scenario, origin: String, incomplete: bool) -> Result<CheckRequest> {
        let headway = if self.case.says_a_start() { Some(self.case.headway()?) } else { None };
        if self.case.says_more_than_a_start() {
            return Err(Error::usage(
                Place::item(origin),
                "the scenario is a complete case: the other flags would be ignored",
                "keep --gap or --thw, and leave out the other flags of a case",
            ));
        }
        let is_synthetic = scenario.synthetic;
        Ok(CheckRequest { subject: Subject::recorded(scenario, headway)?, origin, is_synthetic, incomplete })
    }

    /// Outputs must have the right file ending and must not replace an input.
    fn guard_outputs(&self) -> Result<()> {
        let inputs: Vec<PathBuf> = self.file.iter().cloned().collect();
        let outputs = [
            (&self.sheet, "html", "--sheet"),
            (&self.animation, "svg", "--animation"),
            (&self.series, "csv", "--series"),
        ];
        for (path, ending, flag) in outputs {
            let Some(path) = path else { continue };
            if path.extension().is_none_or(|found| !found.eq_ignore_ascii_case(ending)) {
                let problem = format!("{} does not end in .{ending}", path.display());
                return Err(Error::usage(Place::item(flag), problem, format!("give a name that ends in .{ending}")));
            }
            refuse_overwriting(path, &inputs, flag)?;
        }
        Ok(())
    }
}

fn unknown(path: &Path, id: &str, scenarios: &[Scenario]) -> Error {
    let example = scenarios
        .iter()
        .find(|scenario| scenario.kept)
        .map_or(String::new(), |scenario| format!(", for instance {}", scenario.id));
    let problem = format!("it has no scenario `{id}`");
    Error::usage(
        Place::file(path),
        problem,
        format!("give the id of one of its {} scenarios{example}", scenarios.len()),
    )
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    make_folder_of(path)?;
    write_atomically(path, bytes)
}
