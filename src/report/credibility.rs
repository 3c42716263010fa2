//! The credibility annex of a run: scope and limits, assumptions, numerical error, uncertainty by source, validation, known
//! discrepancies, and the chain from inputs to numbers. It reads the run's record and `configs/validation.toml` alone, so it
//! states nothing that they do not hold. What was not measured is listed as missing, with what would measure it.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::case_identity::{NOT_CONSIDERED, SOURCES, assumptions_table, profile_sha256, program};
use super::html::Section;
use crate::model::assumptions::differences;
use crate::model::profile::Profile;
use crate::support::input_file;
use crate::support::readable::{count, value};
use crate::support::run_folder::{DOSSIER_RECORD, ESTIMATE_RECORD, MAP_RECORD, STUDY_RECORD};
use crate::support::table::Table;
use crate::{Error, Place, Result};

const VALIDATION: &str = include_str!("../../configs/validation.toml");

/// The kind of run that an annex is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum RunKind {
    Study,
    Sample,
    Map,
    Dossier,
}

use RunKind::{Dossier, Map, Sample, Study};

/// The file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ValidationFile {
    question: Vec<Question>,
    row: Vec<ValidationRow>,
}

/// What the annex asks of a run; the file describes the fields.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    group: String,
    name: String,
    #[serde(default)]
    missing: BTreeMap<RunKind, String>,
    #[serde(default)]
    none: BTreeMap<RunKind, String>,
}

/// What was measured about the program, or is known to be wrong; the file describes the fields.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ValidationRow {
    kind: RowKind,
    profile: String,
    runs: Vec<RunKind>,
    what: String,
    against: String,
    result: String,
    chapter: String,
    command: String,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RowKind {
    #[default]
    Validation,
    Discrepancy,
}

const MISSING: &str = "MISSING";

/// The annex, from the text of a record. The caller adds what depends on the machine.
///
/// # Errors
/// [`Error::Internal`] for a record that is not one of this program.
pub(super) fn annex(kind: RunKind, record: &str) -> Result<Section> {
    let unread = |e: serde_json::Error| Error::Internal(format!("a record cannot be read: {e}"));
    let record = Record { kind, of: serde_json::from_str(record).map_err(unread)? };
    let profile: Profile = Profile::deserialize(record.at("/profile")).map_err(unread)?;
    let file = input_file::parse_toml::<ValidationFile>(VALIDATION, &Place::item("validation.toml"), "")?;
    let pairs = |rows: &[(String, String)], [what, how]: [&'static str; 2], caption: &str| {
        Table::of(rows).column(what, |row| row.0.as_str()).column(how, |row| row.1.as_str()).build().captioned(caption)
    };
    let answers = |group: &str, caption: &str| {
        let rows: Vec<_> =
            file.question.iter().filter(|of| of.group == group).map(|of| record.answer(of, &profile)).collect();
        let table = Table::of(&rows).column("question", |row| row.0).column("state", |row| row.1);
        table.column("result, or what would measure it", |row| row.2.as_str()).build().captioned(caption)
    };
    let reproducible = match record.at("/reproducible") == false {
        true => "The clock ended this run, so another machine ends elsewhere.",
        false => "The same input, profile, options and program give the same numbers on any machine.",
    };
    Ok(Section::new("credibility", "Credibility")
        .intro(format!(
            "For an assessment of the simulation's credibility. Every entry stands in {}, the record beside this page, or in the \
             list of what was measured about the program. {reproducible}",
            record.file()
        ))
        .tables([
            pairs(&record.scope(), ["what", "how"], "Scope and limits"),
            answers("numerical error", "Numerical error"),
            answers("uncertainty by source", "Uncertainty by source"),
        ])
        .tables(validation(kind, &profile, &file.row))
        .tables([pairs(&record.chain(&profile), ["step", "identity"], "Chain from inputs to numbers")])
        .parts([Section::new("", format!("Assumptions: every constant of {}", profile.name))
            .intro(format!("{}. {SOURCES}", profile.description))
            .tables([assumptions_table(&profile)])]))
}

/// A record with its kind.
struct Record {
    kind: RunKind,
    of: Value,
}

impl Record {
    fn at(&self, pointer: &str) -> &Value {
        at(&self.of, pointer)
    }

    /// The first of several values that there is.
    fn first(&self, pointers: &[&str]) -> Option<&Value> {
        pointers.iter().map(|pointer| self.at(pointer)).find(|of| !of.is_null())
    }

    fn file(&self) -> &'static str {
        match self.kind {
            Study => STUDY_RECORD,
            Sample => ESTIMATE_RECORD,
            Map => MAP_RECORD,
            Dossier => DOSSIER_RECORD,
        }
    }

    fn scope(&self) -> Vec<(String, String)> {
        let simulated = match self.kind {
            Study => join(self.at("/categories"), "{category}: {kept} of {found} found scenarios, {lanes} lanes"),
            Sample if self.at("/density/kernels") == 0 => fill("distributions of {/density/parameters}", &self.of),
            Sample => fill(
                "{/density/category} {/density/parameterization}: density over {/density/kernels} scenarios; \
                 {/density/provenance/found} found, {/density/provenance/kept} kept",
                &self.of,
            ),
            Map => join(self.at("/grids"), "{name}: {cells} cells"),
            Dossier => fill(
                "{category} {parameterization}: {scenarios} of {found} found scenarios, {simulations} simulations of S",
                &self.of,
            ),
        };
        let drivers = match self.kind {
            Map => join(self.at("/grids/0/shares"), "{model}"),
            _ => self.first(&["/models", "/model"]).map(shown).unwrap_or_default(),
        };
        let data = self.first(&["/data", "/density/provenance/data"]).map(shown);
        let facts = [("data", data), ("simulated", Some(simulated)), ("drivers", Some(drivers))];
        let facts = facts.into_iter().filter_map(|(what, how)| Some((what.to_owned(), how?)));
        let limits = NOT_CONSIDERED.map(|(what, how)| (format!("Not considered: {what}"), how.to_owned()));
        facts.chain(limits).collect()
    }

    /// A question, its state, and the result or what would measure it.
    fn answer<'q>(&self, of: &'q Question, profile: &Profile) -> (&'q str, &'static str, String) {
        let (state, text) = match (self.measured(&of.name, profile), of.none.get(&self.kind)) {
            (Some(text), _) => ("measured", text),
            (None, Some(reason)) => ("does not apply", reason.clone()),
            (None, None) => (MISSING, of.missing.get(&self.kind).cloned().unwrap_or_default()),
        };
        (&of.name, state, text)
    }

    /// What the record says to a question of the file.
    fn measured(&self, question: &str, profile: &Profile) -> Option<String> {
        let here = |text: &str, needed: &str| (!self.at(needed).is_null()).then(|| fill(text, &self.of));
        match (question, self.kind) {
            ("precision: binary32 against binary64", _) => {
                let text =
                    "{/reference/differing} of {/reference/verdicts} verdicts of {/reference/lanes} lanes differ";
                here(text, "/reference")
            }
            ("time step" | "inputs", Map) => {
                let text = "{name}: {undecided} of {verdicts} verdicts";
                let what = "verdicts that a tenth of the step (in binary64) or an error of an input changes";
                (!self.at("/grids/0/undecided").is_null()).then(|| format!("{what}: {}", join(self.at("/grids"), text)))
            }
            ("time cap", Study) => {
                let capped = join(self.at("/categories"), "{category}: {capped_lanes} of {lanes}");
                Some(format!("lanes that end undecided at {} s: {capped}", value(profile.frame.time_cap_s)))
            }
            ("time cap", Sample) => here(
                "lanes that end undecided at {/profile/frame/time_cap_s} s: {/draws/capped_lanes} of {/draws/lanes}",
                "/draws",
            ),
            ("data", Study) => {
                let text = "{category}: {/f1_intervals/known} of {/f1_intervals/cells}, of median width \
                            {/f1_intervals/median_width}, at most {/f1_intervals/widest}";
                Some(format!("F1 with an interval over scenarios: {}", join(self.at("/categories"), text)))
            }
            ("data", Dossier) => {
                let text = "over scenarios: recall {/scores/recall}, precision {/scores/precision}, F1 {/scores/f1}";
                Some(fill(text, &self.of))
            }
            ("parameterization", Study) => {
                Some("it is the result of the study: the F1 of every S' (f1.csv)".to_owned())
            }
            ("density, against recorded scenarios", Dossier) => {
                here("risk ratio P/S {/compared/sampled/ratio}", "/compared")
            }
            ("parameterization", Dossier) => {
                here("ratio S'/S {/compared/replayed/ratio}; {hidden} hidden failures", "/compared")
            }
            ("draws", Dossier) => {
                here("rate of the density, over the draws alone: {/compared/sampled/rate}", "/compared")
            }
            (_, Sample) => self.of_widest(question),
            _ => None,
        }
    }

    /// What the estimate over all headways with the widest interval says of a source of uncertainty.
    fn of_widest(&self, question: &str) -> Option<String> {
        let all = list(self.at("/estimates"));
        let is_overall = |row: &&Value| row["headway"] == "all" || all.iter().all(|row| row["headway"] != "all");
        let width = |row: &Value| at(row, "/estimate/relative_half_width").as_f64().unwrap_or(0.0);
        let known = |row: &&Value| row["uncertainty"].is_object();
        let widest = all.iter().filter(is_overall).filter(known).max_by(|a, b| width(a).total_cmp(&width(b)))?;
        let (text, needed) = match question {
            "data" => (
                "{/uncertainty/scenarios} of the variance of ln risk from scenarios, {/uncertainty/exposure} from their frequency",
                "/uncertainty",
            ),
            "density, against recorded scenarios" => ("risk ratio P/S {/recorded/sampled}", "/recorded/sampled"),
            "parameterization" => ("ratio S'/S {/recorded/replayed}", "/recorded/replayed"),
            "draws" => ("{/uncertainty/draws} of the variance of ln risk", "/uncertainty"),
            _ => return None,
        };
        let interval = "{model} {criterion}, the widest of all estimates: P {/estimate/probability} [{/estimate/interval/low} {/estimate/interval/high}]; ";
        (!at(widest, needed).is_null()).then(|| fill(interval, widest) + &fill(text, widest))
    }

    /// From input files to result files. A step without a checksum is named.
    fn chain(&self, profile: &Profile) -> Vec<(String, String)> {
        let files: usize = list(self.at("/recordings")).iter().map(|of| list(&of["files"]).len()).sum();
        let inputs = match (self.kind, self.at("/scenario_file_sha256")) {
            (Map, _) => "none: the grids stand in the record".to_owned(),
            (Sample, _) => format!("{MISSING}: a density names its scenarios, not their recordings"),
            (_, sha) if sha.is_string() => fill("scenario file, SHA-256 {scenario_file_sha256}", &self.of),
            _ if files > 0 => format!("{files} files of recordings, SHA-256 of each in `recordings` of the record"),
            _ if list(self.at("/recordings")).is_empty() => "the scenario file of the next step".to_owned(),
            _ => "none: the recordings are generated, by `settings` of the record".to_owned(),
        };
        let sha = |step: &str, of: Option<&Value>| Some((step.to_owned(), format!("SHA-256 {}", of?.as_str()?)));
        let scenarios = self.first(&["/scenarios_sha256", "/density/provenance/scenarios_sha256"]);
        let without_plan = (self.kind == Sample && self.at("/plan_sha256").is_null())
            .then(|| ("plan".to_owned(), format!("{MISSING}: importance sampling has no plan")));
        let plans =
            list(self.at("/grids")).iter().flat_map(|grid| list(&grid["plans"]).iter().map(move |of| (grid, of)));
        let plans = plans.filter_map(|(grid, of)| sha(&fill("plan of {name}", grid), Some(&of["plan_sha256"])));
        let seeds = [("seed of draws", "/seed"), ("seed of intervals", "/score/seed")];
        let seeds = seeds.into_iter().filter_map(|(what, of)| Some((what.to_owned(), shown(self.first(&[of])?))));
        let command = self.first(&["/command"]).map(|of| ("command".to_owned(), shown(of)));
        let commit = self.at("/commit").as_str().unwrap_or_default();
        let results = format!("SHA-256 of every table and figure in `files_sha256` of {}", self.file());
        std::iter::once(("input files".to_owned(), inputs))
            .chain(sha("scenarios", scenarios))
            .chain(sha("density", self.first(&["/density/sha256", "/density_sha256"])))
            .chain([(
                format!("profile {}", profile.name),
                format!("SHA-256 {}", profile_sha256(profile).unwrap_or_default()),
            )])
            .chain(sha("plan, with every case", self.first(&["/plan_sha256"])))
            .chain(without_plan)
            .chain(plans)
            .chain(seeds)
            .chain(command)
            .chain([("program".to_owned(), program(commit, 40)), ("result files".to_owned(), results)])
            .collect()
    }
}

/// The program's own validation with this profile, and the discrepancies known of it.
fn validation(kind: RunKind, profile: &Profile, rows: &[ValidationRow]) -> [Table; 2] {
    let shipped = Profile::names().find(|name| *name == profile.name).and_then(|name| Profile::load(name).ok());
    let changed = shipped.map(|shipped| differences(profile, &shipped));
    let is_shipped = changed.as_ref().is_some_and(Vec::is_empty);
    let key = |(key, value, of): &(String, Value, Value)| format!("{key} = {value} in place of {of}");
    let changed = changed.iter().flatten().map(key).collect::<Vec<_>>().join(", ");
    let missing = ValidationRow {
        what: format!("profile {}{}{changed}", profile.name, if changed.is_empty() { "" } else { " with " }),
        result: format!("{MISSING}: this profile is not validated; the rows below hold for every profile"),
        ..ValidationRow::default()
    };
    let is_own = |row: &&ValidationRow| {
        let is_of_profile = row.profile == "every" || is_shipped && row.profile == profile.name;
        is_of_profile && (row.runs.is_empty() || row.runs.contains(&kind))
    };
    let rows: Vec<_> = (!is_shipped).then_some(&missing).into_iter().chain(rows.iter().filter(is_own)).collect();
    let tables = [(RowKind::Validation, "Validation of the program"), (RowKind::Discrepancy, "Known discrepancies")];
    tables.map(|(kind, caption)| {
        Table::of(rows.iter().filter(|row| row.kind == kind))
            .column("what", |row| row.what.as_str())
            .column("against", |row| row.against.as_str())
            .column("result", |row| row.result.as_str())
            .column("source", |row| format!("{}\n{}", row.chapter, row.command).trim().to_owned())
            .build()
            .captioned(caption)
    })
}

fn at<'a>(of: &'a Value, pointer: &str) -> &'a Value {
    of.pointer(pointer).unwrap_or(&Value::Null)
}

fn list(of: &Value) -> &[Value] {
    of.as_array().map_or(&[], Vec::as_slice)
}

/// The text for every item, filled in.
fn join(of: &Value, text: &str) -> String {
    list(of).iter().map(|of| fill(text, of)).collect::<Vec<_>>().join("; ")
}

/// A text with the values that it names in braces, as keys or as pointers.
fn fill(text: &str, of: &Value) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some((before, (name, after))) = rest.split_once('{').and_then(|(a, b)| Some((a, b.split_once('}')?))) {
        let value = if name.starts_with('/') { at(of, name) } else { &of[name] };
        out.extend([before, &shown(value)]);
        rest = after;
    }
    out + rest
}

/// A value as people read it. Of a number with an interval: both.
pub(super) fn shown(of: &Value) -> String {
    match of {
        Value::Null => "unknown".to_owned(),
        Value::String(text) => text.clone(),
        Value::Bool(is_so) => is_so.to_string(),
        Value::Number(number) => number.as_u64().map_or_else(|| value(number.as_f64().unwrap_or(f64::NAN)), count),
        Value::Array(all) => all.iter().map(shown).collect::<Vec<_>>().join(", "),
        Value::Object(of) => {
            let name = ["value", "ratio", "rate"].into_iter().find(|name| of.contains_key(*name));
            let one = name.map_or(&Value::Null, |name| &of[name]);
            let end = |at: usize, key: &str| of.get("interval").map_or(of.get(key), |interval| interval.get(at));
            let end = |at, key| end(at, key).filter(|end| !end.is_null()).map_or("–".to_owned(), shown);
            format!("{} [{} {}]", shown(one), end(0, "low"), end(1, "high"))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use serde_json::json;

    use super::*;

    fn file() -> ValidationFile {
        toml::from_str(VALIDATION).unwrap()
    }

    fn state(kind: RunKind, record: &Value, name: &str) -> (&'static str, String) {
        let record = Record { kind, of: record.clone() };
        let (file, profile) = (file(), Profile::load("paper").unwrap());
        let question = file.question.iter().find(|of| of.name == name).unwrap();
        let (_, state, text) = record.answer(question, &profile);
        (state, text)
    }

    fn rows(kind: RunKind, profile: &Profile) -> Vec<String> {
        validation(kind, profile, &file().row)
            .iter()
            .flat_map(|table| table.shown().1)
            .map(|row| row.join(" | "))
            .collect()
    }

    /// Text in one line, without marks of emphasis and of tables.
    fn plain(text: &str) -> String {
        text.replace("**", "").replace("\\|", "|").split_whitespace().collect::<Vec<_>>().join(" ")
    }

    fn numbers(text: &str) -> HashSet<String> {
        let words =
            text.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == ',')).map(|w| w.trim_matches(['.', ',']));
        words.filter(|word| !word.is_empty()).map(str::to_owned).collect()
    }

    /// The text under a heading of a chapter, with its parts.
    fn under(chapter: &str, anchor: &str) -> String {
        let level = |line: &str| line.find(|c| c != '#').filter(|level| *level > 0 && line[*level..].starts_with(' '));
        let slug = |line: &str| line.trim_matches(['#', ' ']).to_lowercase().replace(' ', "-");
        let mut lines = chapter.lines().skip_while(|line| level(line).is_none() || slug(line) != anchor);
        let heading = lines.next().unwrap_or_else(|| panic!("#{anchor}"));
        let is_inside = |line: &&str| level(line).is_none_or(|of| Some(of) > level(heading));
        lines.take_while(is_inside).collect::<Vec<_>>().join("\n")
    }

    /// So that neither can change without the other.
    #[test]
    fn every_row_has_a_shipped_profile_and_stands_in_the_chapter_that_it_names() {
        let book = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src/");
        for row in file().row {
            assert!(row.profile == "every" || Profile::names().any(|name| name == row.profile), "{row:?}");
            let (chapter, anchor) = row.chapter.split_once('#').unwrap();
            let chapter = std::fs::read_to_string(format!("{book}{chapter}")).unwrap();
            let (part, quoted) = (under(&chapter, anchor), plain(&row.result));
            let (known, all) = (numbers(&part), numbers(&row.result));
            assert!(plain(&part).contains(&quoted) || !all.is_empty() && all.is_subset(&known), "{row:?}");
            assert!(plain(&chapter).contains(row.command.trim_start_matches("lanesweep ")), "{row:?}");
        }
    }

    #[test]
    fn what_was_not_compared_is_missing_and_says_what_would_measure_it() {
        let question = "precision: binary32 against binary64";
        let (state_of, text) = state(Study, &json!({"reference": null}), question);
        assert_eq!((state_of, text.as_str()), (MISSING, "the same study with option `compare_reference`"));
        let compared = json!({"reference": {"lanes": 4, "verdicts": 12, "differing": 1}});
        assert_eq!(state(Study, &compared, question), ("measured", "1 of 12 verdicts of 4 lanes differ".to_owned()));
        assert_eq!(state(Map, &json!({"grids": [{"undecided": null}]}), "inputs").0, MISSING);
        assert_eq!(state(Study, &json!({}), "draws").0, "does not apply");
        for question in file().question {
            for kind in [Study, Sample, Map, Dossier] {
                let (state, text) = state(kind, &json!({}), &question.name);
                assert!(!text.is_empty(), "{kind:?} {}: {state}", question.name);
            }
        }
    }

    #[test]
    fn a_number_stands_beside_its_interval_and_an_unknown_one_is_named_so() {
        let share = json!({"value": 0.25, "interval": [0.125, 0.5]});
        let ratio = json!({"ratio": 2.0, "low": 1.5, "high": null, "verdict": "undecided"});
        let of = json!({"share": share, "none": {"value": null, "interval": null}, "a": {"ratio": ratio}});
        assert_eq!(
            fill("{share}, {none}, {/a/ratio}, {b}", &of),
            "0.25 [0.125 0.5], unknown [– –], 2 [1.5 –], unknown"
        );
    }

    /// A constant that differs makes another profile, whatever its name.
    #[test]
    fn rows_of_a_profile_belong_to_its_values_and_a_profile_of_ones_own_has_none() {
        let shipped = Profile::load("un-r157").unwrap();
        assert!(
            rows(Map, &shipped).iter().any(|row| row.contains("twenty cases"))
                && !rows(Map, &shipped)[0].contains(MISSING)
        );
        let mut changed = shipped.clone();
        changed.cchdm.delay_s = 0.7;
        let of_changed = rows(Map, &changed);
        assert!(
            of_changed[0].starts_with("profile un-r157 with cchdm.delay_s = 0.7 in place of 0.75 | "),
            "{of_changed:?}"
        );
        assert!(of_changed[0].contains("not validated") && !of_changed.iter().any(|row| row.contains("twenty cases")));
        let own = rows(Map, &Profile { name: "mine".to_owned(), ..shipped });
        assert!(own[0].starts_with("profile mine | ") && own[0].contains("not validated"), "{own:?}");
        assert_eq!(own.len(), of_changed.len());
    }
}
