//! The dossier of a parameterization as one page: the conclusion first, then what it rests on.

use serde_json::json;

use super::html::PageTable;
use super::records;
use super::sampling::HostRecord;
use super::tables::{aligned, table};
use super::trace::{TraceFigure, TraceSeries};
use crate::model::profile::Profile;
use crate::run::justify::{Conclusion, Dossier, Finding, REGULATION, Rules, Scored, Share};
use crate::run::sampling::RateRecord;
use crate::stats::estimate::Ratio;
use crate::support::readable::{count, value};
use crate::support::run_dir::Results;
use crate::traffic::DataProvenance;
use crate::{Error, Result};

/// Hidden failures on the page at most; `hidden.csv` has all.
pub(super) const SHOWN: usize = 20;

/// A dossier with what has to be said of it.
pub struct DossierReport<'a> {
    /// What it says.
    pub dossier: &'a Dossier,
    /// The rules.
    pub rules: &'a Rules,
    /// Ratios within 1/margin to margin agree.
    pub margin: f64,
    /// Confidence of the intervals.
    pub confidence: f64,
    /// What the scenarios are of.
    pub provenance: &'a DataProvenance,
    /// Profile.
    pub profile: &'a Profile,
    /// Conformance tables of this category and profile that ship with the program: what, rows, passes.
    pub conformance: Vec<(String, u64, bool)>,
    /// Who answers for it, where that is given.
    pub author: Option<String>,
    /// Its date as given: the program writes none of its own, so that the same inputs give the same bytes.
    pub date: Option<String>,
    /// Command that makes it again.
    pub command: String,
    /// What belongs to the machine.
    pub host: HostRecord,
}

impl DossierReport<'_> {
    /// Puts page, table and figure into their folder, the record last; returns the names of the files beside it.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, mut results: Results) -> Result<Vec<String>> {
        results.add("report.html", self.html()?.as_bytes())?;
        results.add("hidden.csv", &self.hidden_csv()?)?;
        if let Some(svg) = self.example() {
            results.add("hidden.svg", svg.as_bytes())?;
        }
        let files = results.names();
        results.publish(self.json(&files)?.as_bytes())?;
        Ok(files)
    }

    pub(super) fn findings(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let header = ["quantity", "rule", "result", "value", "interval", "more data"];
        let row = |finding: &Finding| {
            vec![
                finding.quantity.to_owned(),
                finding.rule.clone(),
                finding.conclusion.of_rule().to_owned(),
                finding.value.map_or("–".to_owned(), value),
                interval(finding.interval),
                finding.need.map_or(String::new(), |need| format!("{} times", value(need.times))),
            ]
        };
        (owned(&header), self.dossier.findings.iter().map(row).collect())
    }

    pub(super) fn alternatives(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let header = ["name", "by its labels", "parameters", "hidden", "false alarms", "recall", "precision", "F1"];
        let row = |(id, scored, conclusion): &(_, Scored, Conclusion)| {
            let id: &crate::scenario::parameterization::Parameterization = id;
            let mark = if *id == self.dossier.parameterization { " ←" } else { "" };
            vec![
                format!("{}{mark}", id.name()),
                conclusion.of_rule().to_owned(),
                id.parameter_count().to_string(),
                count(scored.counts.fn_),
                count(scored.counts.fp),
                share(&scored.recall),
                share(&scored.precision),
                share(&scored.f1),
            ]
        };
        (owned(&header), self.dossier.alternatives.iter().map(row).collect())
    }

    pub(super) fn groups(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let header = ["by", "group", "failures of S", "hidden", "false alarms", "recall", "precision", "F1"];
        let rows = self.dossier.groups.iter().map(|group| {
            let counts = &group.scored.counts;
            vec![
                group.by.to_owned(),
                group.name.clone(),
                count(counts.tp + counts.fn_),
                count(counts.fn_),
                count(counts.fp),
                share(&group.scored.recall),
                share(&group.scored.precision),
                share(&group.scored.f1),
            ]
        });
        (owned(&header), rows.collect())
    }

    pub(super) fn hidden(&self, most: usize) -> (Vec<String>, Vec<Vec<String>>) {
        let header = ["lane of S'", "S: impact km/h", "S: TTC s", "S: BTN", "S': TTC s", "S': BTN", "S': gap m"];
        let rows = self.dossier.hidden.iter().take(most).map(|hidden| {
            let (s, parameterized) = (&hidden.recorded, &hidden.parameterized);
            vec![
                hidden.key.clone(),
                value(s.impact_closing_speed * 3.6),
                value(s.min_ttc),
                value(s.max_btn),
                value(parameterized.min_ttc),
                value(parameterized.max_btn),
                value(parameterized.min_gap),
            ]
        });
        (owned(&header), rows.collect())
    }

    pub(super) fn risk(&self) -> Option<(Vec<String>, Vec<Vec<String>>)> {
        let cell = self.dossier.compared.as_ref()?;
        let counts = &self.dossier.scored.counts;
        let failures = counts.tp + counts.fn_;
        let recorded = failures as f64 / self.dossier.lanes.max(1) as f64;
        let row = |name: &str, rate: &RateRecord, ratio: &Ratio| {
            vec![
                name.to_owned(),
                format!("{} of {}", count(rate.failures), count(rate.lanes)),
                value(rate.rate),
                format!("[{} {}]", value(rate.low), value(rate.high)),
                ratio.ratio.map_or("–".to_owned(), value),
                interval(ratio.interval()),
                ratio.verdict.text().to_owned(),
            ]
        };
        let mut rows = vec![vec![
            "S, recorded".to_owned(),
            format!("{} of {}", count(failures), count(self.dossier.lanes)),
            value(recorded),
            String::new(),
            "1".to_owned(),
            String::new(),
            String::new(),
        ]];
        rows.push(row("S', replayed", &cell.replayed.rate, &cell.replayed.ratio));
        rows.push(row("P, density", &cell.sampled.rate, &cell.sampled.ratio));
        Some((owned(&["scenarios", "failures", "rate", "interval", "ratio to S", "its interval", "verdict"]), rows))
    }

    /// The figure of the most severe hidden failure.
    pub fn example(&self) -> Option<String> {
        let ([recorded, parameterized], hidden) = (self.dossier.example.as_ref()?, self.dossier.hidden.first()?);
        let key = &self.dossier.parameterization.key;
        let series = vec![
            TraceSeries { name: "S".to_owned(), trace: recorded },
            TraceSeries { name: key.to_string(), trace: parameterized },
        ];
        let title = format!("Hidden failure: {}, headway {}", hidden.scenario, hidden.headway);
        let subtitle =
            format!("{}, profile {}; {}", self.dossier.model.name(), self.profile.name, self.provenance.data);
        Some(TraceFigure { title, subtitle: Some(subtitle), series, until_s: None }.svg())
    }

    /// The dossier as text.
    pub fn text(&self) -> String {
        let rows = |(header, rows): (Vec<String>, Vec<Vec<String>>), texts| {
            let mut table = table(header);
            rows.into_iter().for_each(|row| {
                table.add_row(row);
            });
            aligned(table, texts)
        };
        let need = self.need().map_or(String::new(), |need| format!("{need}\n"));
        let sentences = [self.answer(), self.recall(), self.close_following()];
        let sentences: Vec<String> = sentences.into_iter().filter(|sentence| !sentence.is_empty()).collect();
        let hidden = match self.dossier.hidden.len() {
            0 => String::new(),
            n => format!("\nHidden failures, the most severe of {}\n{}", count(n as u64), rows(self.hidden(5), 1)),
        };
        format!(
            "{}\n{}\n{need}\n{}{hidden}\nThe alternatives\n{}",
            self.provenance.data,
            sentences.join("\n"),
            rows(self.findings(), 3),
            rows(self.alternatives(), 2)
        )
    }

    /// All hidden failures as CSV.
    ///
    /// # Errors
    /// [`Error::Internal`] where the table cannot be written.
    pub fn hidden_csv(&self) -> Result<Vec<u8>> {
        let broken = |e: csv::Error| Error::Internal(format!("hidden.csv cannot be written: {e}"));
        let mut out = csv::Writer::from_writer(Vec::new());
        out.write_record([
            "scenario",
            "headway",
            "lane",
            "s_impact_closing_speed_mps",
            "s_min_ttc_s",
            "s_max_btn",
            "sp_min_ttc_s",
            "sp_max_btn",
            "sp_min_gap_m",
        ])
        .map_err(broken)?;
        for hidden in &self.dossier.hidden {
            let (s, parameterized) = (&hidden.recorded, &hidden.parameterized);
            let numbers = [
                s.impact_closing_speed,
                s.min_ttc,
                s.max_btn,
                parameterized.min_ttc,
                parameterized.max_btn,
                parameterized.min_gap,
            ];
            let words = [&hidden.scenario, &hidden.headway, &hidden.key].map(Clone::clone);
            out.write_record(words.into_iter().chain(numbers.map(|number| number.to_string()))).map_err(broken)?;
        }
        out.into_inner().map_err(|e| Error::Internal(format!("hidden.csv cannot be written: {e}")))
    }

    /// The dossier as one document.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn json(&self, files: &[String]) -> Result<String> {
        let dossier = self.dossier;
        let scored = |scored: &Scored| {
            let one = |share: &Share| json!({"value": share.value, "interval": share.interval});
            json!({
                "tp": scored.counts.tp, "fp": scored.counts.fp, "fn": scored.counts.fn_, "tn": scored.counts.tn,
                "failing_scenarios": scored.failing_scenarios, "recall": one(&scored.recall),
                "precision": one(&scored.precision), "f1": one(&scored.f1),
            })
        };
        let groups = dossier.groups.iter().map(|group| {
            let mut record = scored(&group.scored);
            record["by"] = json!(group.by);
            record["group"] = json!(group.name);
            record
        });
        let alternatives = dossier.alternatives.iter().map(|(id, of, conclusion)| {
            let mut record = scored(of);
            record["parameterization"] = json!(id.key);
            record["parameters"] = json!(id.parameter_count());
            record["conclusion_by_labels"] = json!(conclusion);
            record
        });
        let coverage = dossier.coverage.as_ref().map(|coverage| {
            json!({
                "found": coverage.found, "kept": coverage.kept, "points": coverage.points,
                "valid_share": coverage.valid_share,
                "representativeness": coverage.representativeness.map(|(metric, train_test)| {
                    json!({"metric": metric, "train_test": train_test})
                }),
            })
        });
        let conformance =
            self.conformance.iter().map(|(what, rows, passes)| json!({"what": what, "rows": rows, "passes": passes}));
        records::document(&json!({
            "program": program(),
            "data": self.provenance.data,
            "synthetic": self.provenance.synthetic,
            "scenarios_sha256": self.provenance.scenarios_sha256,
            "profile": self.profile,
            "parameterization": dossier.parameterization.key,
            "category": dossier.parameterization.category.key(),
            "model": dossier.model.name(),
            "criterion": dossier.criterion.key(),
            "author": self.author,
            "date": self.date,
            "conclusion": dossier.conclusion,
            "sentence": self.answer(),
            "rules": self.rules,
            "margin": self.margin,
            "confidence": self.confidence,
            "findings": dossier.findings,
            "scenarios": dossier.scenarios,
            "simulations": dossier.lanes,
            "headways": dossier.headways.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "close_following": dossier.close_following,
            "scores": scored(&dossier.scored),
            "regulation": dossier.regulation.as_ref().map(|of| json!({"profile": REGULATION, "scores": scored(of)})),
            "groups": groups.collect::<Vec<_>>(),
            "compared": dossier.compared,
            "coverage": coverage,
            "no_density": dossier.no_density.as_ref().map(ToString::to_string),
            "alternatives": alternatives.collect::<Vec<_>>(),
            "hidden": dossier.hidden.len(),
            "conformance": conformance.collect::<Vec<_>>(),
            "plan_sha256": dossier.plan_sha256,
            "density_sha256": dossier.density_sha256,
            "left_out": dossier.left_out.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "command": self.command,
            "files": files,
            "host": self.host,
        }))
    }
}

pub(super) fn owned(header: &[&str]) -> Vec<String> {
    header.iter().map(|name| (*name).to_owned()).collect()
}

pub(super) fn page_table(caption: &str, texts: usize, (header, rows): (Vec<String>, Vec<Vec<String>>)) -> PageTable {
    PageTable { caption: caption.to_owned(), header, texts, rows }
}

pub(super) fn share(share: &Share) -> String {
    match (share.value, share.interval) {
        (None, _) => "–".to_owned(),
        (Some(one), None) => format!("{one:.3} [few]"),
        (Some(one), Some((low, high))) => format!("{one:.3} [{low:.3} {high:.3}]"),
    }
}

fn interval(interval: Option<(f64, f64)>) -> String {
    match interval {
        None => "–".to_owned(),
        // A ratio to S, which never fails.
        Some((low, f64::INFINITY)) => format!("above {}", value(low)),
        Some((low, high)) => format!("[{} {}]", value(low), value(high)),
    }
}

pub(super) fn program() -> String {
    format!("lanesweep {}", env!("CARGO_PKG_VERSION"))
}
