//! What a case sheet rests on: identity with hashes, assumptions, the effect of the time step, the verdict by rule, and what no
//! sheet considers. Nothing is taken from the clock or the machine.

use serde::Serialize;
use serde_json::{Map, Value};

use super::case_sheet::{CaseSheet, signed};
use super::html::Section;
use super::lanes::outcome_record;
use super::records::{self, PROGRAM, record};
use super::tables::{WIDTH, indented, wrap};
use lanesweep_engine::version::Canonical;
use lanesweep_engine::{ENGINE_VERSION, Outcome};
use lanesweep_model::assumptions::Assumption;
use lanesweep_model::profile::Profile;
use lanesweep_run::check::{DriverRule, Judged, Judgement, RuleVerdicts, Subject};
use lanesweep_run::grid::{PARAMETERS, Perturbation};
use lanesweep_support::Result;
use lanesweep_support::readable::value;
use lanesweep_support::table::{Column, NumberText, Table};

/// What the columns of the rules show.
const RULES: &str = "The verdict if this driver alone decides; if any of the reference drivers suffices (in force); if all of them \
     have to avoid the collision. A row per profile with reference drivers, as it is and with each other reading where Annex 3 \
     is silent. *: differs from the answer of the sheet. Each verdict is robust or undecided as on the sheet";

impl CaseSheet<'_> {
    /// The numbers of the case by key, in SI units.
    pub(super) fn case_numbers(&self) -> Map<String, Value> {
        let point = self.subject.point();
        let is_si = PARAMETERS.iter().filter(|parameter| parameter.per_si == 1.0 && !parameter.is_relative);
        is_si
            .filter_map(|parameter| Some((parameter.key.to_owned(), Value::from(point.get(parameter.quantity)?))))
            .chain(self.subject.duration_s().map(|duration_s| ("duration_s".to_owned(), Value::from(duration_s))))
            .collect()
    }

    /// SHA-256 of the case in canonical form: category, numbers and, if recorded, the scenario with its series.
    ///
    /// # Errors
    /// None for a case of this program.
    fn case_sha256(&self) -> Result<String> {
        let mut canonical = Canonical::new("case");
        canonical.text(self.subject.category().key());
        canonical.value(&self.case_numbers())?;
        if let Subject::Recorded(scenario, _) = self.subject {
            canonical.value(scenario)?;
        }
        Ok(canonical.finish())
    }

    /// The first digits of the case's hash.
    pub(super) fn mark(&self) -> String {
        self.case_sha256().map_or(String::new(), |sha256| sha256[..12].to_owned())
    }

    /// The sheet's identity as text: hashes by their first 12 digits.
    pub(super) fn identity_text(&self) -> String {
        let short = |hash: Result<String>| hash.map_or(String::new(), |hash| hash[..12].to_owned());
        let profiles =
            self.profiles.iter().map(|profile| format!("{} {}", profile.name, short(profile_sha256(profile))));
        let parts = [
            Some(format!("program: {}", program(self.identity.commit, 12))),
            self.identity.file_sha256.as_ref().map(|sha256| format!("file: {}", short(Ok(sha256.clone())))),
            Some(format!("case: {}", self.mark())),
            Some(format!("profiles: {}", profiles.collect::<Vec<_>>().join(", "))),
            self.identity.date.as_ref().map(|date| format!("date: {date}")),
            self.identity.author.as_ref().map(|author| format!("author: {author}")),
        ];
        let parts: String = parts.into_iter().flatten().map(|part| indented(&part)).collect();
        format!("Identity, with the first 12 digits of each SHA-256\n{parts}")
    }

    /// The sheet's identity for programs.
    ///
    /// # Errors
    /// None for a sheet of this program.
    pub(super) fn identity_record(&self) -> Result<impl Serialize> {
        let CaseIdentity { commit, file_sha256, date, author } = &self.identity;
        Ok(record! {
            author: author,
            case_sha256: self.case_sha256()?,
            command: &self.command,
            commit: (!commit.is_empty()).then_some(commit),
            date: date,
            engine_version: ENGINE_VERSION,
            file_sha256: file_sha256,
        })
    }

    /// The identity as the first chapter of the page.
    pub(super) fn identity_section(&self) -> Section {
        let file = self.identity.file_sha256.as_ref().map(|sha256| format!("{}\nSHA-256 {sha256}", self.origin));
        Section::new("identity", "Identity")
            .fact("program", program(self.identity.commit, 40))
            .fact("data", file.unwrap_or_else(|| self.origin.clone()))
            .facts([profile_fact(&self.profiles[0])])
            .fact("command", &self.command)
            .fact("case, canonical", format!("SHA-256 {}", self.case_sha256().unwrap_or_default()))
    }

    /// Every constant of the first profile with its source.
    pub(super) fn assumptions_section(&self) -> Section {
        let name = &self.profiles[0].name;
        Section::new("assumptions", "Assumptions")
            .intro(format!("Every constant and option of {name}: {}. {SOURCES}", self.profiles[0].description))
            .tables([assumptions_table(&self.profiles[0])])
            .facts(self.profiles[1..].iter().map(profile_fact))
    }

    /// Time step, cap, arithmetic, and what a tenth of the step changes.
    pub(super) fn numerics_section(&self) -> Section {
        let (first, frame) = (self.first(), &self.profiles[0].frame);
        let finer = first
            .finer
            .iter()
            .flat_map(|finer| first.models.iter().zip(&finer.outcomes).map(|both| (both, finer.dt_s)));
        type Finer<'a> = ((&'a Judged, &'a Outcome<f64>), f64);
        let by = |of: Finer, value: &dyn Fn(&Outcome<f64>, f64) -> Option<f64>| {
            let ((judged, outcome), dt_s) = of;
            let (coarse, fine) = (value(&judged.trace.outcome, judged.trace.dt_s), value(outcome, dt_s));
            match (coarse, fine) {
                (Some(coarse), Some(fine)) if coarse.is_finite() && fine.is_finite() => {
                    // Below the digits that the sheet prints, and without a sign of rounding.
                    let by = fine - coarse;
                    Some(NumberText(if by.abs() < 1e-6 { "0".to_owned() } else { signed(by) }))
                }
                (Some(_), None) => Some(NumberText("ceases".to_owned())),
                (None, Some(_)) => Some(NumberText("begins".to_owned())),
                _ => None,
            }
        };
        let column = |name: &'static str| Column::from(name).null("–");
        let table = Table::of(finer)
            .column("driver", |((judged, _), _)| judged.trace.model.name())
            .column("collision verdict", |((judged, _), _)| {
                if judged.flips.contains(&Perturbation::FINER_STEP.label()) { "CHANGES" } else { "the same" }
            })
            .column(column("smallest gap m"), |of| by(of, &|outcome, _| Some(records::smallest_gap_m(outcome))))
            .column(column("smallest TTC s"), |of| by(of, &|outcome, _| outcome.approach_ttc()))
            .column(column("largest BTN"), |of| by(of, &|outcome, _| Some(outcome.max_btn)))
            .column(column("reacts s"), |of| by(of, &|outcome, dt_s| records::time_s(outcome.reaction_step, dt_s)))
            .column(column("contact s"), |of| by(of, &|outcome, dt_s| records::time_s(outcome.contact_step, dt_s)));
        let dt_s = first.finer.as_ref().map_or(frame.dt_s, |finer| finer.dt_s);
        Section::new("numerics", "Arithmetic and time step")
            .fact("arithmetic", "IEEE 754 binary64 in a fixed order, without random numbers")
            .fact("time step", format!("{} s", value(frame.dt_s)))
            .fact("cap", format!("a run ends after {} s", value(frame.time_cap_s)))
            .fact(
                "answer with a tenth of the step",
                if first.turns_with_a_finer_step() { "CHANGES" } else { "the same" },
            )
            .tables([table
                .build()
                .captioned(format!("What a time step of {dt_s} s in place of {} s adds", frame.dt_s))])
    }

    /// The runs with a tenth of the time step for programs; null without them.
    pub(super) fn finer_record(judgement: &Judgement) -> Option<impl Serialize + use<>> {
        let finer = judgement.finer.as_ref()?;
        let models = judgement.models.iter().zip(&finer.outcomes).map(|(judged, outcome)| {
            let mut outcome = outcome_record(outcome, finer.dt_s);
            outcome.insert("model".to_owned(), judged.trace.model.name().into());
            outcome
        });
        Some(record! {
            changes_answer: judgement.turns_with_a_finer_step(),
            dt_s: finer.dt_s,
            models: models.collect::<Vec<_>>(),
        })
    }

    /// The rows of every profile.
    fn rules(&self) -> impl Iterator<Item = (&str, &RuleVerdicts)> {
        self.judgements.iter().flat_map(|of| of.by_rule.iter().map(move |rules| (of.profile.as_str(), rules)))
    }

    /// What each reference driver alone says, and the rule that is in force with its source.
    pub(super) fn rule(&self) -> Vec<String> {
        let Some(RuleVerdicts { verdicts, .. }) = self.first().by_rule.first() else { return Vec::new() };
        let alone = verdicts.iter().filter_map(|(rule, verdict)| match rule {
            DriverRule::Alone(model) => Some(format!("{}: {}", model.name(), verdict.label())),
            DriverRule::Any | DriverRule::All => None,
        });
        let alone = alone.collect::<Vec<_>>().join("; ");
        vec![format!(
            "If one driver alone decides: {alone}. In force: a collision is preventable where any reference driver avoids it. {}",
            DriverRule::SOURCE
        )]
    }

    /// A row per profile and reading, a column per rule.
    fn by_rule(&self) -> Table {
        let mut rules: Vec<DriverRule> = Vec::new();
        for (_, row) in self.rules() {
            rules.extend(
                row.verdicts.iter().map(|(rule, _)| rule).filter(|rule| !rules.contains(rule)).collect::<Vec<_>>(),
            );
        }
        // The drivers first; a profile may have others than the first one.
        rules.sort_by_key(|rule| !matches!(rule, DriverRule::Alone(_)));
        let in_force = self.first().verdict();
        let verdict = |row: &RuleVerdicts, rule: &DriverRule| {
            let (_, verdict) = row.verdicts.iter().find(|(of, _)| of == rule)?;
            Some(format!("{}{}", verdict.label(), if *verdict == in_force { "" } else { "*" }))
        };
        Table::of(self.rules().collect::<Vec<_>>())
            .column("profile", |(profile, _)| profile)
            .column("reading", |(_, row)| row.reading.unwrap_or("as it is"))
            .columns(&rules, |rule| rule.label(), |(_, row), rule| verdict(row, rule))
            .build()
    }

    /// The same as text; empty without reference drivers.
    pub(super) fn by_rule_text(&self) -> String {
        if self.rules().next().is_none() {
            return String::new();
        }
        format!("{}\n{}", wrap(&format!("\nWhich driver decides. {RULES}"), WIDTH), self.by_rule().text())
    }

    /// The same as a chapter.
    pub(super) fn by_rule_section(&self) -> Option<Section> {
        self.rules().next()?;
        let intro = self.rule().into_iter().map(|sentence| format!("{sentence}. ")).collect::<String>();
        let table = self.by_rule().captioned("Verdict by rule, reading and profile");
        Some(Section::new("rule", "Which driver decides").intro(format!("{intro}{RULES}.")).tables([table]))
    }

    /// The same with a row per profile, reading and rule.
    pub(super) fn rule_rows(&self) -> Table {
        let in_force = self.first().verdict();
        Table::of(self.rules().flat_map(|(profile, row)| row.verdicts.iter().map(move |of| (profile, row.reading, of))))
            .column("profile", |(profile, ..)| profile)
            .column("reading", |(_, reading, _)| reading)
            .column("rule", |(.., (rule, _))| rule.label())
            .column("verdict", |(.., (_, verdict))| verdict.label())
            .column("differs", |(.., (_, verdict))| *verdict != in_force)
            .build()
    }
}

fn profile_fact(profile: &Profile) -> (String, String) {
    (format!("profile {}", profile.name), format!("SHA-256 {}", profile_sha256(profile).unwrap_or_default()))
}

/// What the sources of [`assumptions_table`] mean.
const SOURCES: &str = "\"Ours\": no source gives it. UN R157 is the 01 series; its tables and data sheets were at hand, \
     the running text of Annex 3, 3.4.2, was not. Paper: arXiv 2409.01117. JRC: its public simulator of 2021.";

/// Every constant and option of a profile with its source.
fn assumptions_table(profile: &Profile) -> Table {
    let assumptions = profile.assumptions();
    let table = Table::of(&assumptions)
        .column("constant", |of| of.key.as_str())
        .column("meaning", |of| of.meaning.as_deref().unwrap_or("not recorded"))
        .column("source", source)
        .column("value", |of| NumberText(plain(&of.value)))
        .column("unit", |of| NumberText(of.unit.to_owned()));
    table.build().captioned(format!("Constants of {}", profile.name))
}

/// Every constant and option of a profile, as texts.
pub(super) fn assumptions(profile: &Profile) -> Table {
    let all = profile.assumptions();
    Table::of(&all)
        .column("key", |of| of.key.as_str())
        .column("value", |of| plain(&of.value))
        .column("unit", |of| of.unit.to_owned())
        .column("meaning", |of| of.meaning.as_deref())
        .column("source", |of| of.source.as_deref())
        .build()
}

fn source(of: &Assumption) -> &str {
    of.source.as_deref().unwrap_or("no source recorded: the profile's own value")
}

/// A value without quotes.
fn plain(of: &Value) -> String {
    match of {
        Value::String(text) => text.clone(),
        Value::Array(list) => list.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

/// What no simulation of the program considers. The chapter for assessors has the same list.
pub(super) const NOT_CONSIDERED: [(&str, &str); 9] = [
    ("The system under assessment", "only reference drivers are simulated; nothing is said of what the system does"),
    (
        "Steering",
        "no vehicle evades; the ego stays in the middle of its lane, the others keep to the motion of the case",
    ),
    ("Road", "straight and level, with lanes of one width; no curve, slope, bank or missing marking"),
    ("Surface and weather", "every deceleration of the profile is reached: no wet, icy or uneven surface, no wind"),
    (
        "Perception",
        "positions and speeds are known without error, loss or occlusion, in every light and weather; delays are those of the profile",
    ),
    (
        "Vehicle dynamics",
        "braking is a deceleration, with a limited jerk where the model has one: no tyres, load, trailer, brake temperature or \
         control system",
    ),
    ("0.85 g after full overlap (Annex 3, table 1)", "the profile's maximum deceleration applies throughout"),
    ("Other traffic", "only the vehicles of the case exist: nothing follows the ego, and no vehicle reacts to it"),
    ("Consequences", "vehicles are rectangles along the road; no yaw, no second collision, no injuries"),
];

/// What the user and the build say of a sheet.
#[derive(Debug, Clone, Default)]
pub struct CaseIdentity {
    /// Commit of the program's sources; empty if unknown.
    pub commit: &'static str,
    /// SHA-256 of the file with the case, if there is one.
    pub file_sha256: Option<String>,
    /// Date of the run, as the user gives it.
    pub date: Option<String>,
    /// Author, as the user gives it.
    pub author: Option<String>,
}

impl CaseIdentity {
    /// Lines to sign on, and what the drivers do not stand for.
    pub(super) fn signatures(&self) -> Section {
        let given = |text: &Option<String>| text.clone().unwrap_or_default();
        Section::new("signature", "Signatures")
            .intro("The system under assessment was not simulated: the drivers are those of the profile.")
            .fact("system under assessment, version", "")
            .fact("technical service", "")
            .fact("date of the run", given(&self.date))
            .fact("author", given(&self.author))
            .fact("signature", "")
            .fact("checked by, date", "")
    }

    /// What is not considered.
    pub(super) fn not_considered() -> Section {
        Section::new("not-considered", "Not considered").facts(NOT_CONSIDERED)
    }
}

/// Program, version, commit by its first digits, and version of the lanes.
pub(super) fn program(commit: &str, digits: usize) -> String {
    let (commit, changes) = commit.split_at(commit.find(' ').unwrap_or(commit.len()));
    let commit = match commit {
        "" => "commit unknown".to_owned(),
        commit => format!("commit {}{changes}", commit.get(..digits).unwrap_or(commit)),
    };
    format!("{PROGRAM}, {commit}, engine {ENGINE_VERSION}")
}

/// SHA-256 of a profile's values in canonical form: white space and comments of its file do not change it.
///
/// # Errors
/// None for a profile of this program.
pub(super) fn profile_sha256(profile: &Profile) -> Result<String> {
    let mut canonical = Canonical::new("profile");
    canonical.value(profile)?;
    Ok(canonical.finish())
}
