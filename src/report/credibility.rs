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
}

/// The file, which describes its fields.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ValidationFile {
    question: Vec<Question>,
    validation: Vec<ValidationRow>,
    discrepancy: Vec<ValidationRow>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    group: String,
    name: String,
    r#for: BTreeMap<RunKind, Answer>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Answer {
    measured: Option<String>,
    needs: String,
    each: String,
    item: String,
    none: Option<String>,
    missing: Option<String>,
}

#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ValidationRow {
    profile: String,
    runs: Vec<RunKind>,
    what: String,
    against: String,
    result: String,
    chapter: String,
    command: String,
}

const MISSING: &str = "MISSING";

/// The annex, from the text of a record. The caller adds what depends on the machine.
///
/// # Errors
/// [`Error::Internal`] for a record that is not one of this program.
pub(super) fn annex(kind: RunKind, record: &str) -> Result<Section> {
    let unread = |e: serde_json::Error| Error::Internal(format!("a record cannot be read: {e}"));
    let mut record: Value = serde_json::from_str(record).map_err(unread)?;
    record["widest"] = widest(&record);
    let profile: Profile = Profile::deserialize(&record["profile"]).map_err(unread)?;
    let file = input_file::parse_toml::<ValidationFile>(VALIDATION, &Place::item("validation.toml"), "")?;
    let answers = |group: &str| -> Vec<(String, &str, String)> {
        let of_group = file.question.iter().filter(|of| of.group == group);
        of_group.filter_map(|of| of.r#for.get(&kind)?.row(&of.name, &record)).collect()
    };
    let asked = |group: &str, caption: &str| {
        let rows = answers(group);
        let table = Table::of(&rows).column("question", |row| row.0.as_str()).column("state", |row| row.1);
        table.column("result, or what would measure it", |row| row.2.as_str()).build().captioned(caption)
    };
    let told = |group: &str, others: Vec<(String, String)>, caption: &str| {
        let own = answers(group).into_iter().map(|(what, state, text)| match state {
            MISSING => (what, format!("{MISSING}: {text}")),
            _ => (what, text),
        });
        let rows: Vec<_> = own.chain(others).collect();
        Table::of(&rows)
            .column("what", |row| row.0.as_str())
            .column("value", |row| row.1.as_str())
            .build()
            .captioned(caption)
    };
    let limits = NOT_CONSIDERED.map(|(what, how)| (format!("Not considered: {what}"), how.to_owned()));
    let commit = record["commit"].as_str().unwrap_or_default();
    let identity = vec![
        (format!("profile {}", profile.name), format!("SHA-256 {}", profile_sha256(&profile)?)),
        ("program".to_owned(), program(commit, 40)),
    ];
    let reproducible = match record["reproducible"] == false {
        true => "The clock ended this run, so another machine ends elsewhere.",
        false => {
            "The same input, profile, options and program give the same numbers on any CPU, and on a device whose lanes are equal."
        }
    };
    Ok(Section::new("credibility", "Credibility")
        .intro(format!(
            "For an assessment of the simulation's credibility: what the record beside this page holds, and what is known of the program. \
             {reproducible}"
        ))
        .tables([
            told("scope", limits.into(), "Scope and limits"),
            asked("numerical error", "Numerical error"),
            asked("uncertainty by source", "Uncertainty by source"),
            rows_of(kind, &profile, &file.validation, true).captioned("Validation of the program"),
            rows_of(kind, &profile, &file.discrepancy, false).captioned("Known discrepancies"),
            told("chain", identity, "Chain from inputs to numbers"),
        ])
        .parts([Section::new("", format!("Assumptions: every constant of {}", profile.name))
            .intro(format!("{}. {SOURCES}", profile.description))
            .tables([assumptions_table(&profile)])]))
}

/// The estimate over all headways whose interval is the widest, among those that tell the parts of their variance.
fn widest(record: &Value) -> Value {
    let all = list(&record["estimates"]);
    let is_overall = |row: &&Value| row["headway"] == "all" || all.iter().all(|row| row["headway"] != "all");
    let width = |row: &Value| at(row, "/estimate/relative_half_width").as_f64().unwrap_or(0.0);
    let known = all.iter().filter(is_overall).filter(|row| row["uncertainty"].is_object());
    known.max_by(|a, b| width(a).total_cmp(&width(b))).cloned().unwrap_or_default()
}

impl Answer {
    /// The name of a question, its state, and its text; `None` if it is not asked.
    fn row(&self, name: &str, record: &Value) -> Option<(String, &'static str, String)> {
        let measured = self.measured.as_ref().filter(|_| self.needs.is_empty() || !at(record, &self.needs).is_null());
        let (state, text) = match (measured, &self.none) {
            (Some(text), _) => {
                let items: Vec<String> = list(at(record, &self.each)).iter().map(|of| fill(&self.item, of)).collect();
                ("measured", fill(&text.replace("{*}", &items.join("; ")), record))
            }
            (None, Some(reason)) => ("does not apply", reason.clone()),
            (None, None) => (MISSING, self.missing.clone()?),
        };
        Some((name.to_owned(), state, text))
    }
}

/// The rows that belong to a run with this profile; with a word if none is of the profile itself.
fn rows_of(kind: RunKind, profile: &Profile, rows: &[ValidationRow], is_told: bool) -> Table {
    let shipped = Profile::names().find(|name| *name == profile.name).and_then(|name| Profile::load(name).ok());
    let changed = shipped.map(|shipped| differences(profile, &shipped));
    let is_shipped = changed.as_ref().is_some_and(Vec::is_empty);
    let key = |(key, value, of): &(String, Value, Value)| format!("{key} = {value} in place of {of}");
    let changed = changed.iter().flatten().map(key).collect::<Vec<_>>().join(", ");
    let missing = ValidationRow {
        what: format!("profile {}{}{changed}", profile.name, if changed.is_empty() { "" } else { " with " }),
        result: format!("{MISSING}: no validation of this profile; the rows below do not depend on the profile"),
        ..ValidationRow::default()
    };
    let is_own = |row: &&ValidationRow| {
        let is_of_profile = row.profile == "every" || is_shipped && row.profile == profile.name;
        is_of_profile && (row.runs.is_empty() || row.runs.contains(&kind))
    };
    let own: Vec<&ValidationRow> = rows.iter().filter(is_own).collect();
    let is_missing = is_told && own.iter().all(|row| row.profile == "every");
    Table::of(is_missing.then_some(&missing).into_iter().chain(own))
        .column("what", |row| row.what.as_str())
        .column("against", |row| row.against.as_str())
        .column("result", |row| row.result.as_str())
        .column("chapter of the book, command", |row| format!("{}\n{}", row.chapter, row.command).trim().to_owned())
        .build()
}

fn at<'a>(of: &'a Value, pointer: &str) -> &'a Value {
    of.pointer(pointer).unwrap_or(&Value::Null)
}

fn list(of: &Value) -> &[Value] {
    of.as_array().map_or(&[], Vec::as_slice)
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
fn shown(of: &Value) -> String {
    match of {
        Value::Null => "unknown".to_owned(),
        Value::String(text) => text.clone(),
        Value::Bool(is_so) => is_so.to_string(),
        Value::Number(number) => number.as_u64().map_or_else(|| value(number.as_f64().unwrap_or(f64::NAN)), count),
        Value::Array(all) => all.iter().map(shown).collect::<Vec<_>>().join(", "),
        Value::Object(of) => {
            let name = ["value", "ratio", "rate", "estimate"].into_iter().find(|name| of.contains_key(*name));
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

    use super::RunKind::{Map, Sample, Study};
    use super::*;

    fn file() -> ValidationFile {
        toml::from_str(VALIDATION).unwrap()
    }

    fn state(kind: RunKind, record: &Value, name: &str) -> (&'static str, String) {
        let file = file();
        let question = file.question.iter().find(|of| of.name == name && of.group != "scope").unwrap();
        let (_, state, text) = question.r#for[&kind].row(name, record).unwrap();
        (state, text)
    }

    fn rows(kind: RunKind, profile: &Profile) -> Vec<String> {
        let rows = rows_of(kind, profile, &file().validation, true).shown().1;
        rows.iter().map(|row| row.join(" | ")).collect()
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
        let ValidationFile { validation, discrepancy, .. } = file();
        for row in validation.into_iter().chain(discrepancy) {
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
        assert_eq!((state_of, text.as_str()), (MISSING, "the same study with key `study.compare_reference`"));
        let compared = json!({"reference": {"lanes": 4, "verdicts": 12, "differing": 1}});
        assert_eq!(state(Study, &compared, question), ("measured", "1 of 12 verdicts of 4 lanes differ".to_owned()));
        assert_eq!(state(Map, &json!({"grids": [{"undecided": null}]}), "inputs").0, MISSING);
        assert_eq!(state(Study, &json!({}), "draws").0, "does not apply");
    }

    /// Every table asks every kind of run; a question without an answer has what would measure it, or a reason.
    #[test]
    fn no_question_on_error_or_uncertainty_is_left_out_of_a_kind_of_run() {
        for question in file()
            .question
            .iter()
            .filter(|of| ["numerical error", "uncertainty by source"].contains(&of.group.as_str()))
        {
            for kind in [Study, Sample, Map] {
                let (_, state, text) = question.r#for[&kind].row(&question.name, &json!({})).unwrap();
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
        assert!(
            of_changed[0].contains("no validation of this profile")
                && !of_changed.iter().any(|row| row.contains("twenty cases"))
        );
        let own = rows(Map, &Profile { name: "mine".to_owned(), ..shipped });
        assert!(own[0].starts_with("profile mine | ") && own[0].contains("no validation of this profile"), "{own:?}");
        assert_eq!(own.len(), of_changed.len());
        // A shipped profile may lack one, too.
        assert!(rows(Study, &Profile::load("paper-fit").unwrap())[0].starts_with("profile paper-fit | "));
    }
}
