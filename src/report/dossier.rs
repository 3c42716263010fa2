//! The dossier of a parameterization as one page: the conclusion, then the evidence.

use serde_json::json;

use super::dossier_changes::{DossierChanges, DossierFile, VERSION};
use super::host::Host;
use super::records::{self, PROGRAM, record, smallest_gap_m};
use super::trace::{TraceFigure, TracePanels, TraceSeries};
use crate::engine::ENGINE_VERSION;
use crate::model::profile::Profile;
use crate::run::justify::{Dossier, Hidden, JustifyOptions, REGULATION, Scored, Share};
use crate::run::sampling::RateRecord;
use crate::scenario::DataProvenance;
use crate::scenario::parameterization::Parameterization;
use crate::stats::estimate::Ratio;
use crate::support::readable::{count, value};
use crate::support::run_folder::{ResultFiles, Results};
use crate::support::table::{Column, NumberText, Table};
use crate::traffic::mining::RecordingSummary;
use crate::{Error, Result};

/// Maximum number of hidden failures on the page; `hidden.csv` has all.
pub(super) const SHOWN: usize = 20;

/// A dossier with the facts that its page states.
pub struct DossierReport<'a> {
    /// The dossier.
    pub dossier: &'a Dossier,
    /// Rules, scores and comparison.
    pub options: &'a JustifyOptions,
    /// Provenance of the scenarios.
    pub provenance: &'a DataProvenance,
    /// The recordings that were mined; none for scenarios of a file.
    pub recordings: &'a [RecordingSummary],
    /// Profile.
    pub profile: &'a Profile,
    /// The person responsible, if given.
    pub author: Option<String>,
    /// Date as given. The program adds no date, so that the same inputs give the same bytes.
    pub date: Option<String>,
    /// Command that reproduces it.
    pub command: String,
    /// Facts about the machine.
    pub host: Host,
    /// Another dossier, from which the changes are listed.
    pub against: Option<&'a DossierFile>,
}

impl DossierReport<'_> {
    /// Writes page, table and figure to their folder, the record last; returns the names of the other files.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, mut results: Results) -> Result<ResultFiles> {
        results.add("report.html", self.html()?.as_bytes())?;
        results.add("hidden.csv", self.hidden_csv().as_bytes())?;
        if let Some(svg) = self.example() {
            results.add("hidden.svg", svg.as_bytes())?;
        }
        records::publish(results, |files| self.json(files))
    }

    /// What differs from the other dossier, if there is one.
    pub(super) fn changes(&self) -> Result<Option<DossierChanges>> {
        let Some(other) = self.against else { return Ok(None) };
        let this =
            DossierFile::of(self.document(&ResultFiles::default(), None)?.as_bytes()).map_err(Error::Internal)?;
        Ok(Some(this.changes_from(other)))
    }

    pub(super) fn findings(&self) -> Table {
        Table::of(&self.dossier.findings)
            .column("quantity", |finding| finding.quantity)
            .column("rule", |finding| finding.rule.as_str())
            .column("result", |finding| finding.conclusion.of_rule())
            .column(Column::from("value").null("–"), |finding| finding.value)
            .column("interval", |finding| interval(finding.interval))
            .column("more data", |finding| finding.need.map(|need| format!("{} times", value(need.times))))
            .build()
    }

    pub(super) fn alternatives(&self) -> Table {
        let name = |id: &Parameterization| {
            format!("{}{}", id.name(), if *id == self.dossier.parameterization { " ←" } else { "" })
        };
        let table = Table::of(&self.dossier.alternatives)
            .column("name", |(id, ..)| name(id))
            .column("by its labels", |(.., conclusion)| conclusion.of_rule())
            .column("parameters", |(id, ..)| id.parameter_count())
            .column("hidden", |(_, of, _)| of.counts.fn_)
            .column("false alarms", |(_, of, _)| of.counts.fp);
        table.columns(SCORES, |(score, _)| score, |(_, scored, _), (_, of)| share(of(scored))).build()
    }

    pub(super) fn groups(&self) -> Table {
        Table::of(&self.dossier.groups)
            .column("by", |group| group.by)
            .column("group", |group| group.name.as_str())
            .column("failures of S", |group| group.scored.counts.tp + group.scored.counts.fn_)
            .column("hidden", |group| group.scored.counts.fn_)
            .column("false alarms", |group| group.scored.counts.fp)
            .columns(SCORES, |(score, _)| score, |group, (_, of)| share(of(&group.scored)))
            .build()
    }

    pub(super) fn hidden(&self, max_rows: usize) -> Table {
        Table::of(self.dossier.hidden.iter().take(max_rows))
            .column("lane of S'", |hidden| hidden.key.as_str())
            .column(Column::from("S: contact").null("–"), Hidden::contact)
            .column(Column::from("S: closing km/h").null("–"), |hidden| {
                hidden.contact().map(|_| hidden.recorded.impact_closing_speed * 3.6)
            })
            .column(Column::from("S: TTC s").null("–"), |hidden| hidden.recorded.approach_ttc())
            .column("S: BTN", |hidden| hidden.recorded.max_btn)
            .column(Column::from("S': TTC s").null("–"), |hidden| hidden.parameterized.approach_ttc())
            .column("S': BTN", |hidden| hidden.parameterized.max_btn)
            .column("S': gap m", |hidden| smallest_gap_m(&hidden.parameterized))
            .build()
    }

    pub(super) fn risk(&self) -> Option<Table> {
        let cell = self.dossier.compared.as_ref()?;
        let counts = &self.dossier.scored.counts;
        let (failures, lanes) = (counts.tp + counts.fn_, self.dossier.lanes);
        let recorded = failures as f64 / lanes.max(1) as f64;
        let of = |rate: &RateRecord| (rate.failures, rate.lanes, rate.rate);
        let (replayed, sampled) = (&cell.replayed, &cell.sampled);
        type RiskRow<'r> = (&'static str, (u64, u64, f64), Option<(&'r RateRecord, &'r Ratio)>);
        let rows: [RiskRow; 3] = [
            ("S, recorded", (failures, lanes, recorded), None),
            ("S', replayed", of(&replayed.rate), Some((&replayed.rate, &replayed.ratio))),
            ("P, density", of(&sampled.rate), Some((&sampled.rate, &sampled.ratio))),
        ];
        let table = Table::of(rows)
            .column("scenarios", |(name, ..)| name)
            .column("failures", |(_, (failures, lanes, _), _)| {
                NumberText(format!("{} of {}", count(failures), count(lanes)))
            })
            .column("rate", |(_, (.., rate), _)| rate)
            .column("interval", |(.., of)| of.map(|(rate, _)| format!("[{} {}]", value(rate.low), value(rate.high))))
            .column(Column::from("ratio to S").null("–"), |(.., of)| of.map_or(Some(1.0), |(_, ratio)| ratio.ratio))
            .column("its interval", |(.., of)| of.map(|(_, ratio)| interval(ratio.interval())));
        Some(table.build())
    }

    /// The figure of the most severe hidden failure.
    pub(super) fn example(&self) -> Option<String> {
        let ([recorded, parameterized], hidden) = (self.dossier.example.as_ref()?, self.dossier.hidden.first()?);
        let key = &self.dossier.parameterization.key;
        let series = vec![
            TraceSeries { name: "S".to_owned(), trace: recorded },
            TraceSeries { name: key.to_string(), trace: parameterized },
        ];
        let title = format!("Hidden failure: {}, headway {}", hidden.scenario, hidden.headway);
        let subtitle =
            format!("{}, profile {}; {}", self.dossier.model.name(), self.profile.name, self.provenance.data);
        Some(TraceFigure { title, subtitle: Some(subtitle), series, until_s: None, panels: TracePanels::All }.svg())
    }

    /// The dossier as text.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn text(&self) -> Result<String> {
        let lines = |sentences: &[String]| {
            let present = sentences.iter().filter(|sentence| !sentence.is_empty());
            present.map(|sentence| format!("{sentence}\n")).collect::<String>()
        };
        let need = self.need().unwrap_or_default();
        let hidden = match self.dossier.hidden.len() {
            0 => String::new(),
            n => format!(
                "\nHidden failures, the most severe of {}\n{}{}",
                count(n as u64),
                self.hidden(5).text(),
                lines(&[self.beside(5)])
            ),
        };
        let changes = self.changes()?.map_or(String::new(), |changes| format!("\n{}", changes.text()));
        Ok(format!(
            "{}\n{}\n{}{}{hidden}\nThe alternatives, by the rules for recall and precision alone\n{}{changes}",
            self.provenance.data,
            lines(&[self.answer(), self.recall(), self.coverage(), self.close_following(), need]),
            self.findings().text(),
            lines(&[self.rule(), self.limits_of_rules()]),
            self.alternatives().text()
        ))
    }

    /// All hidden failures as CSV.
    fn hidden_csv(&self) -> String {
        Table::of(&self.dossier.hidden)
            .column("scenario", |hidden| hidden.scenario.as_str())
            .column("headway", |hidden| hidden.headway.as_str())
            .column("lane", |hidden| hidden.key.as_str())
            .column("s_contact", Hidden::contact)
            .column("s_impact_closing_speed_mps", |hidden| hidden.recorded.impact_closing_speed)
            .column("s_min_ttc_s", |hidden| hidden.recorded.approach_ttc())
            .column("s_max_btn", |hidden| hidden.recorded.max_btn)
            .column("sp_min_ttc_s", |hidden| hidden.parameterized.approach_ttc())
            .column("sp_max_btn", |hidden| hidden.parameterized.max_btn)
            .column("sp_min_gap_m", |hidden| smallest_gap_m(&hidden.parameterized))
            .build()
            .csv()
    }

    /// The dossier as one document.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn json(&self, files: &ResultFiles) -> Result<String> {
        self.document(files, self.changes()?)
    }

    fn document(&self, files: &ResultFiles, changes: Option<DossierChanges>) -> Result<String> {
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
                "points_of_kept": coverage.of_kept(), "points_of_found": coverage.of_found(),
                "valid_share": coverage.valid_fraction,
                "representativeness": coverage.representativeness.map(|(metric, train_test)| {
                    json!({"metric": metric, "train_test": train_test})
                }),
            })
        });
        records::document(&record! {
            lanesweep_dossier: VERSION,
            program: PROGRAM,
            engine: ENGINE_VERSION,
            commit: self.host.commit(),
            data: &self.provenance.data,
            synthetic: &self.provenance.synthetic,
            scenarios_sha256: &self.provenance.scenarios_sha256,
            recordings: &self.recordings,
            profile: &self.profile,
            parameterization: &dossier.parameterization.key,
            category: dossier.parameterization.category.key(),
            model: dossier.model.name(),
            criterion: dossier.criterion.key(),
            author: &self.author,
            date: &self.date,
            conclusion: &dossier.conclusion,
            sentence: self.answer(),
            rules: &self.options.rules,
            margin: &self.options.compare.enough.margin,
            confidence: &self.options.score.confidence,
            min_failures: &self.options.score.min_failures,
            findings: &dossier.findings,
            rule: self.rule(),
            found: &dossier.found,
            scenarios: &dossier.scenarios,
            simulations: &dossier.lanes,
            headways: dossier.headways.iter().map(ToString::to_string).collect::<Vec<_>>(),
            close_following: &dossier.close_following,
            scores: scored(&dossier.scored),
            regulation: dossier.regulation.as_ref().map(|of| json!({"profile": REGULATION, "scores": scored(of)})),
            groups: groups.collect::<Vec<_>>(),
            compared: &dossier.compared,
            coverage: coverage,
            no_density: dossier.no_density.as_ref().map(ToString::to_string),
            alternatives: alternatives.collect::<Vec<_>>(),
            hidden: dossier.hidden.len(),
            plan_sha256: &dossier.plan_sha256,
            density_sha256: &dossier.density_sha256,
            left_out: dossier.left_out.iter().map(ToString::to_string).collect::<Vec<_>>(),
            command: &self.command,
            #[serde(flatten)]
            changes: changes.map(|changes| record! { changes: changes }),
            settings: &self.host.settings,
            #[serde(flatten)]
            files: files,
            host: &self.host,
        })
    }
}

type ScoreOf = fn(&Scored) -> &Share;

/// Names of scores, and which they are.
const SCORES: [(&str, ScoreOf); 3] =
    [("recall", |of| &of.recall), ("precision", |of| &of.precision), ("F1", |of| &of.f1)];

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
