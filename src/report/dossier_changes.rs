//! What differs between two dossiers: question, data, program, profile, options, and the numbers that follow. It reads both
//! records alone, so two parties can compare dossiers without the data.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::credibility::{list, shown};
use super::html::Section;
use super::records::document;
use super::tables::{WIDTH, wrap};
use crate::model::profile::Profile;
use crate::run::justify::Conclusion;
use crate::support::input_file;
use crate::support::plain_text::hex;
use crate::support::run_folder::DOSSIER_RECORD;
use crate::support::table::{NumberText, Table};
use crate::{Error, Place, Result};

/// Version of a dossier's record.
pub(super) const VERSION: u64 = 1;

/// Tables of the configuration that a dossier depends on, besides its data and profile.
const OPTIONS: [&str; 7] = ["mining.", "parameterization.", "score.", "fit.", "compare.", "search.folds", "justify."];

/// Numbers beside the findings: name, and place in the record.
const NUMBERS: [(&str, &str); 10] = [
    ("found scenarios", "/found"),
    ("kept scenarios", "/scenarios"),
    ("hidden failures", "/scores/fn"),
    ("false alarms", "/scores/fp"),
    ("failures of S and S'", "/scores/tp"),
    ("F1", "/scores/f1"),
    ("recall under un-r157", "/regulation/scores/recall"),
    ("rate of S'", "/compared/replayed/rate"),
    ("rate of the density", "/compared/sampled/rate"),
    ("failures per hour", "/compared/sampled/risk/per_hour"),
];

/// What a change needs of a dossier's record.
#[derive(Debug, Clone, Deserialize)]
pub struct DossierFile {
    lanesweep_dossier: u64,
    profile: Profile,
    /// What it concludes.
    pub conclusion: Conclusion,
    scenarios_sha256: String,
    recordings: Vec<Value>,
    findings: Vec<Value>,
    settings: Vec<Value>,
    commit: Option<String>,
    #[serde(skip)]
    record: Value,
    #[serde(skip)]
    sha256: String,
}

/// What a change is of.
const KINDS: [&str; 5] = ["question", "data", "program", "profile", "options"];

/// A difference in question, data, program, profile or options.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Change {
    kind: &'static str,
    key: String,
    this: Value,
    other: Value,
}

/// A difference in a result.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct NumberChange {
    quantity: String,
    this: Value,
    other: Value,
    difference: Option<f64>,
}

/// The changes from another dossier to this one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DossierChanges {
    other_sha256: String,
    sentences: Vec<String>,
    changes: Vec<Change>,
    numbers: Vec<NumberChange>,
}

impl DossierFile {
    /// Whether a path is a dossier's folder, or a file whose name ends like that of its record.
    pub fn is_at(path: &Path) -> bool {
        path.join(DOSSIER_RECORD).is_file() || path.is_file() && path.to_string_lossy().ends_with(DOSSIER_RECORD)
    }

    /// Reads a dossier: its folder, or its record.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for a file that is no dossier, is damaged or of another version.
    pub fn read(path: &Path) -> Result<DossierFile> {
        let path = if path.is_dir() { path.join(DOSSIER_RECORD) } else { path.to_path_buf() };
        let text = input_file::read(&path, input_file::MAX_TABLE_BYTES)?;
        DossierFile::of(&text).map_err(|problem| {
            let help = "give the folder of a dossier of this version of the program, or its dossier.json";
            Error::input(Place::file(&path), problem, help)
        })
    }

    /// A dossier from the text of its record; the error says what is wrong.
    pub(super) fn of(text: &[u8]) -> std::result::Result<DossierFile, String> {
        let record: Value = serde_json::from_slice(text).map_err(|e| format!("it is no dossier: {e}"))?;
        let file = DossierFile::deserialize(&record).map_err(|e| format!("it is no dossier, or damaged: {e}"))?;
        match file.lanesweep_dossier {
            VERSION => Ok(DossierFile { record, sha256: hex(&Sha256::digest(text)), ..file }),
            version => Err(format!("version {version}, but this program reads {VERSION}")),
        }
    }

    /// What differs from another dossier.
    pub fn changes_from(&self, other: &DossierFile) -> DossierChanges {
        let (mut these, mut others) = (self.facts(), other.facts());
        let keys: BTreeSet<(usize, String)> = these.keys().chain(others.keys()).cloned().collect();
        let change = |of: (usize, String)| Change {
            this: these.remove(&of).unwrap_or_default(),
            other: others.remove(&of).unwrap_or_default(),
            kind: KINDS[of.0],
            key: of.1,
        };
        let changes: Vec<Change> = keys.into_iter().map(change).filter(|of| of.this != of.other).collect();
        let number = |((quantity, this), (_, other)): ((String, &Value), (String, &Value))| NumberChange {
            difference: value_of(this).zip(value_of(other)).map(|(this, other)| this - other),
            quantity,
            this: this.clone(),
            other: other.clone(),
        };
        let numbers = self.numbers().into_iter().zip(other.numbers()).map(number);
        let numbers: Vec<NumberChange> = numbers.filter(|of| of.this != of.other).collect();
        let sentences = sentences(self, other, &changes, numbers.len());
        DossierChanges { other_sha256: other.sha256.clone(), sentences, changes, numbers }
    }

    /// What a dossier rests on, by the place of its kind among [`KINDS`] and its key. Where the data are read from is none of
    /// it: the same scenarios may stand elsewhere.
    fn facts(&self) -> BTreeMap<(usize, String), Value> {
        let keys = ["category", "parameterization", "model", "criterion", "headways"].map(|key| (0, key));
        let keys = keys.into_iter().chain([(2, "program"), (2, "engine"), (2, "commit")]);
        let own = keys.map(|(kind, key)| (kind, key.to_owned(), self.record[key].clone()));
        let scenarios = [(1, "scenarios_sha256".to_owned(), self.scenarios_sha256.clone().into())];
        let files = self.recordings.iter().flat_map(|of| list(&of["files"]));
        let files = files.map(|of| (1, shown(&of["file"]), of["sha256"].clone()));
        let constants = self.profile.assumptions().into_iter().map(|of| (3, of.key, of.value));
        let options = self.settings.iter().map(|of| (4, shown(&of["key"]), of["value"].clone()));
        let options = options.filter(|(_, key, _)| OPTIONS.iter().any(|table| key.starts_with(table)));
        own.chain(scenarios)
            .chain(files)
            .chain(constants)
            .chain(options)
            .map(|(kind, key, value)| ((kind, key), value))
            .collect()
    }

    /// The findings and [`NUMBERS`].
    fn numbers(&self) -> Vec<(String, &Value)> {
        let findings = self.findings.iter().map(|of| (shown(&of["quantity"]), of));
        let numbers = NUMBERS.map(|(name, at)| (name.to_owned(), self.record.pointer(at).unwrap_or(&Value::Null)));
        findings.chain(numbers).collect()
    }
}

/// A value for people: of a checksum the first digits.
fn short(of: &Value) -> String {
    match of {
        Value::String(text) if text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit()) => {
            format!("{}…", &text[..12])
        }
        Value::Null => "–".to_owned(),
        other => shown(other),
    }
}

/// The number of a value with its interval.
fn value_of(of: &Value) -> Option<f64> {
    of.as_f64().or_else(|| ["value", "rate", "estimate"].iter().find_map(|name| of[*name].as_f64()))
}

/// What differs in kind, and what follows from that. A cause is named only where a single kind differs.
fn sentences(this: &DossierFile, other: &DossierFile, changes: &[Change], numbers: usize) -> Vec<String> {
    let mut kinds: Vec<&str> = changes.iter().map(|change| change.kind).collect();
    kinds.dedup();
    let [ours, theirs] = [this, other].map(|of| of.conclusion.text());
    let conclusions = match ours == theirs {
        true => format!("Both dossiers conclude: {ours}."),
        false => format!("This dossier concludes {ours}, the other one {theirs}."),
    };
    let why = match (&kinds[..], numbers) {
        ([], 0) => "Question, data, program, profile, options and numbers are the same.".to_owned(),
        ([], _) => {
            "Question, data, program, profile and options are the same, but numbers differ: the records name no cause."
                .to_owned()
        }
        (several, 0) => format!("Different: {}. No number differs.", several.join(", ")),
        ([one], _) => format!(
            "Different: {one}, and nothing else, so every difference of a number follows from it. What its single rows do was not \
             separated."
        ),
        (several, _) => format!(
            "Different: {}. Which of them changed which number was not separated; a dossier with one of them changed alone does that.",
            several.join(", ")
        ),
    };
    let unknown = |of: &DossierFile| of.commit.as_ref().is_none_or(|commit| commit.contains(' '));
    let is_unknown = (unknown(this) || unknown(other)) && !kinds.contains(&"program");
    let commit =
        "A program's commit is unknown, or its sources were changed: that both programs are the same is not shown.";
    [conclusions, why].into_iter().chain(is_unknown.then(|| commit.to_owned())).collect()
}

impl DossierChanges {
    fn tables(&self) -> impl Iterator<Item = Table> {
        let changes = Table::of(&self.changes)
            .column("kind", |change| change.kind)
            .column("what", |change| change.key.as_str())
            .column("this dossier", |change| short(&change.this))
            .column("the other", |change| short(&change.other));
        let numbers = Table::of(&self.numbers)
            .column("number", |number| number.quantity.as_str())
            .column("this dossier", |number| NumberText(shown(&number.this)))
            .column("the other", |number| NumberText(shown(&number.other)))
            .column("difference", |number| number.difference);
        let captioned = [(changes.build(), "What differs"), (numbers.build(), "Numbers that differ")];
        captioned
            .into_iter()
            .filter(|(table, _)| !table.rows.is_empty())
            .map(|(table, caption)| table.captioned(caption))
    }

    /// The changes as text.
    pub fn text(&self) -> String {
        let sentences = wrap(&self.sentences.join(" "), WIDTH);
        let tables: String = self.tables().map(|table| format!("\n{}\n{}", table.caption, table.text())).collect();
        format!("Changes since the other dossier (SHA-256 {})\n{sentences}\n{tables}", &self.other_sha256[..12])
    }

    /// The changes as one document.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn json(&self) -> Result<String> {
        document(self)
    }

    /// The changes as a chapter.
    pub(super) fn section(&self) -> Section {
        Section::new("changes", "Changes since the other dossier")
            .intro(self.sentences.join(" "))
            .tables(self.tables())
            .fact("SHA-256 of the other dossier.json", &self.other_sha256)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn record() -> Value {
        let share = json!({"value": 0.7, "interval": [0.5, 0.9]});
        json!({
            "lanesweep_dossier": VERSION, "program": "lanesweep 0", "engine": 5, "commit": "abc", "profile": Profile::load("paper").unwrap(),
            "conclusion": "undecided", "scenarios_sha256": "1", "data": "recordings in a", "found": 10, "scenarios": 5,
            "recordings": [{"files": [{"file": "01_tracks.csv", "sha256": "2"}]}],
            "findings": [{"quantity": "recall", "value": 0.7, "interval": [0.5, 0.9]}],
            "scores": {"fn": 3, "fp": 1, "tp": 7, "f1": share},
            "settings": [{"key": "justify.min_recall", "value": 0.9}, {"key": "run.threads", "value": 4}],
        })
    }

    fn changes(change: impl Fn(&mut Value)) -> DossierChanges {
        let (of, mut changed) = (|record: &Value| DossierFile::of(record.to_string().as_bytes()).unwrap(), record());
        change(&mut changed);
        of(&changed).changes_from(&of(&record()))
    }

    #[test]
    fn identical_dossiers_and_those_of_other_machines_and_folders_have_an_empty_diff() {
        for same in [
            changes(|_| ()),
            changes(|of| of["settings"][1]["value"] = json!(8)),
            changes(|of| of["data"] = json!("b")),
        ] {
            assert_eq!((&same.changes[..], &same.numbers[..]), (&[][..], &[][..]));
            let expected = "Question, data, program, profile, options and numbers are the same.";
            assert_eq!(same.sentences, ["Both dossiers conclude: undecided.", expected]);
        }
    }

    #[test]
    fn a_changed_constant_is_named_with_both_values_and_explains_the_numbers_alone() {
        let of = changes(|of| {
            of["profile"]["cchdm"]["delay_s"] = json!(0.75);
            of["findings"][0] = json!({"quantity": "recall", "value": 0.5, "interval": null});
            of["conclusion"] = json!("not_appropriate");
        });
        let key = "cchdm.delay_s".to_owned();
        assert_eq!(of.changes, [Change { kind: "profile", key, this: json!(0.75), other: json!(0.6) }]);
        let [number] = &of.numbers[..] else { panic!("{:?}", of.numbers) };
        assert!((number.difference.unwrap() + 0.2).abs() < 1e-12);
        assert_eq!(of.sentences[0], "This dossier concludes not appropriate, the other one undecided.");
        assert!(of.sentences[1].starts_with("Different: profile, and nothing else"), "{:?}", of.sentences);
        assert!(of.text().contains("0.7 [0.5 0.9]"), "{}", of.text());
    }

    #[test]
    fn of_several_kinds_none_is_named_as_the_cause() {
        let of = changes(|of| {
            of["scenarios_sha256"] = json!("3");
            of["recordings"][0]["files"][0]["sha256"] = json!("4");
            of["settings"][0]["value"] = json!(0.8);
            of["found"] = json!(12);
        });
        let keys: Vec<&str> = of.changes.iter().map(|change| change.key.as_str()).collect();
        assert_eq!(keys, ["01_tracks.csv", "scenarios_sha256", "justify.min_recall"]);
        assert!(of.sentences[1].starts_with("Different: data, options. Which of them"));
        let unexplained = changes(|of| of["found"] = json!(12));
        assert!(unexplained.sentences[1].contains("the records name no cause"));
        let unknown = changes(|of| of["commit"] = json!("abc with changes"));
        assert_eq!(unknown.changes[0].kind, "program");
    }

    #[test]
    fn what_is_no_dossier_or_damaged_is_refused_by_its_key() {
        let refusal = |text: &str| DossierFile::of(text.as_bytes()).unwrap_err();
        assert!(refusal("{").contains("it is no dossier: EOF"), "{}", refusal("{"));
        assert!(refusal("{\"program\": \"lanesweep 0\"}").contains("missing field `lanesweep_dossier`"));
        let with = |key: &str, value: Value| {
            let mut record = record();
            record[key] = value;
            refusal(&record.to_string())
        };
        assert!(with("lanesweep_dossier", json!(2)).contains("version 2, but this program reads 1"));
        assert!(with("findings", Value::Null).contains("damaged: invalid type: null, expected a sequence"));
        assert!(with("profile", json!({"name": "a"})).contains("damaged: missing field"));
    }
}
