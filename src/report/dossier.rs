//! The dossier of a parameterization as one page: the conclusion first, then what it rests on.

use serde_json::json;

use super::html::{Page, PageFigure, PageTable, Section};
use super::records;
use super::sampling::HostRecord;
use super::tables::{aligned, table};
use super::trace::{TraceFigure, TraceSeries};
use crate::model::profile::Profile;
use crate::run::justify::{Conclusion, Dossier, Finding, Need, Rules, Scored, Share};
use crate::run::sampling::RateRecord;
use crate::stats::estimate::Ratio;
use crate::support::readable::{count, value};
use crate::{Error, Result};

/// Hidden failures on the page at most; `hidden.csv` has all.
const SHOWN: usize = 20;

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
    /// What the scenarios are.
    pub data: String,
    /// The data are the program's own.
    pub is_synthetic: bool,
    /// SHA-256 of the scenarios.
    pub scenarios_sha256: String,
    /// Profile.
    pub profile: &'a Profile,
    /// Conformance tables that ship with the program: what, rows, passes.
    pub conformance: Vec<(String, u64, bool)>,
    /// Command that makes it again.
    pub command: String,
    /// What belongs to the machine.
    pub host: HostRecord,
}

impl DossierReport<'_> {
    /// The conclusion in one sentence.
    pub fn answer(&self) -> String {
        let Dossier { parameterization, model, criterion, conclusion, scenarios, lanes, .. } = self.dossier;
        format!(
            "{} is {} for {} and {} on this data ({} scenarios, {} simulations of S)",
            parameterization.name(),
            conclusion.text().to_uppercase(),
            model.name(),
            criterion.label(),
            count(*scenarios),
            count(*lanes)
        )
    }

    /// How much more data would decide, over all undecided rules.
    fn need(&self) -> Option<String> {
        if self.dossier.conclusion != Conclusion::Undecided {
            return None;
        }
        if self.dossier.scored.counts.tp + self.dossier.scored.counts.fn_ == 0 {
            return Some(
                "S never fails, so the data does not tell how many scenarios would decide: use more, or more severe ones."
                    .to_owned(),
            );
        }
        let times = self.dossier.findings.iter().filter_map(|finding| finding.need).map(|Need { times }| times);
        let times = times.fold(None, |most: Option<f64>, times| Some(most.map_or(times, |most| most.max(times))))?;
        let more = (times * self.dossier.scenarios as f64).ceil();
        Some(if times < 1000.0 {
            format!(
                "At least about {} scenarios ({} times as many) would decide, if the rates stay as they are: an interval narrows with \
                 the square root of their number.",
                count(more as u64),
                value(times)
            )
        } else {
            "The value lies on the limit: no realistic amount of data decides.".to_owned()
        })
    }

    fn findings(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let header = ["quantity", "rule", "conclusion", "value", "interval", "more data"];
        let row = |finding: &Finding| {
            vec![
                finding.quantity.to_owned(),
                finding.rule.clone(),
                finding.conclusion.text().to_owned(),
                finding.value.map_or("–".to_owned(), value),
                interval(finding.interval),
                finding.need.map_or(String::new(), |need| format!("{} times", value(need.times))),
            ]
        };
        (owned(&header), self.dossier.findings.iter().map(row).collect())
    }

    fn alternatives(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let header = ["name", "by its labels", "parameters", "hidden", "false alarms", "recall", "precision", "F1"];
        let row = |(id, scored, conclusion): &(_, Scored, Conclusion)| {
            let id: &crate::scenario::parameterization::Parameterization = id;
            let mark = if *id == self.dossier.parameterization { " ←" } else { "" };
            vec![
                format!("{}{mark}", id.name()),
                conclusion.text().to_owned(),
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

    fn groups(&self) -> (Vec<String>, Vec<Vec<String>>) {
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

    fn hidden(&self, most: usize) -> (Vec<String>, Vec<Vec<String>>) {
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

    fn risk(&self) -> Option<(Vec<String>, Vec<Vec<String>>)> {
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
                interval(ratio.low.zip(ratio.high)),
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
        let subtitle = format!("{}, profile {}; {}", self.dossier.model.name(), self.profile.name, self.data);
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
        let hidden = match self.dossier.hidden.len() {
            0 => String::new(),
            n => format!("\nHidden failures, the most severe of {}\n{}", count(n as u64), rows(self.hidden(5), 1)),
        };
        format!(
            "{}\n{}{need}\n{}{hidden}\nThe alternatives\n{}",
            self.data,
            format_args!("{}\n", self.answer()),
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
            "data": self.data,
            "synthetic": self.is_synthetic,
            "scenarios_sha256": self.scenarios_sha256,
            "profile": self.profile,
            "parameterization": dossier.parameterization.key,
            "category": dossier.parameterization.category.key(),
            "model": dossier.model.name(),
            "criterion": dossier.criterion.key(),
            "conclusion": dossier.conclusion,
            "rules": self.rules,
            "margin": self.margin,
            "confidence": self.confidence,
            "findings": dossier.findings,
            "scenarios": dossier.scenarios,
            "simulations": dossier.lanes,
            "scores": scored(&dossier.scored),
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

    /// The dossier as a page.
    ///
    /// # Errors
    /// [`Error::Internal`] where the template does not fit: a defect of this program.
    pub fn html(&self) -> Result<String> {
        let mut warnings = Vec::new();
        if self.is_synthetic {
            warnings.push("SYNTHETIC DATA: nothing on this page is a statement about real traffic.".to_owned());
        }
        let page = Page {
            title: format!("Is {} appropriate?", self.dossier.parameterization.name()),
            program: program(),
            lead: format!("{}. {}", self.answer(), self.data),
            warnings,
            sections: vec![
                self.conclusion_section(),
                self.hidden_section(),
                Section {
                    intro: "Thirds of the scenarios by the ego's speed, and of the failures of S by severity: closing speed at \
                            the contact, else the shortfall of TTC or the excess of BTN. Precision has no meaning within \
                            failures of S."
                        .to_owned(),
                    tables: vec![page_table("Scores by group, [interval over scenarios]", 2, self.groups())],
                    ..Section::new("groups", "By headway, speed and severity")
                },
                self.risk_section(),
                self.cost_section(),
                Section {
                    intro: "Every parameterization of this kind of scenario on the same data, by the rules for recall and \
                            precision alone."
                        .to_owned(),
                    tables: vec![page_table("Alternatives, [interval over scenarios]", 2, self.alternatives())],
                    ..Section::new("alternatives", "The alternatives")
                },
                self.credibility_section(),
                self.reproduction_section()?,
            ],
        };
        page.html()
    }

    fn conclusion_section(&self) -> Section {
        let share = |limit: f64| format!("{limit}: the whole interval at or above it passes, the whole below it fails");
        let (margin, lower) = (self.margin, value(1.0 / self.margin));
        Section {
            intro: self.need().unwrap_or_default(),
            tables: vec![page_table("What each rule finds; the worst decides", 3, self.findings())],
            facts: vec![
                ("recall, limit".to_owned(), share(self.rules.min_recall)),
                ("precision, limit".to_owned(), share(self.rules.min_precision)),
                (
                    "risk ratio, limits".to_owned(),
                    format!("{lower} to {margin}: the whole interval between them passes"),
                ),
                ("coverage, limit".to_owned(), format!("{} of the kept scenarios", self.rules.min_coverage)),
                ("statistical significance".to_owned(), format!("intervals of {} %", value(100.0 * self.confidence))),
                ("where to change them".to_owned(), "[justify], [score] and [compare] of the configuration".to_owned()),
            ],
            ..Section::new("conclusion", "Conclusion")
        }
    }

    fn hidden_section(&self) -> Section {
        let counts = &self.dossier.scored.counts;
        let failures = counts.tp + counts.fn_;
        let intro = match (failures, counts.fn_) {
            (0, _) => "S never fails: there is nothing to hide, and nothing to conclude from.".to_owned(),
            (_, 0) => format!("None of {} failures of S is hidden.", count(failures)),
            (_, hidden) => format!(
                "{} of {} failures of S are hidden: S fails, S' passes. The most severe {} stand here, all in hidden.csv. Recall \
                 {}, precision {}, F1 {}.",
                count(hidden),
                count(failures),
                count((SHOWN as u64).min(hidden)),
                share(&self.dossier.scored.recall),
                share(&self.dossier.scored.precision),
                share(&self.dossier.scored.f1)
            ),
        };
        let mut section = Section { intro, ..Section::new("hidden", "Failures that are hidden") };
        if counts.fn_ > 0 {
            section.tables.push(page_table("Hidden failures, the most severe first", 1, self.hidden(SHOWN)));
        }
        section.figures.extend(self.example().map(|svg| PageFigure::new(&svg, &["hidden.svg"])));
        section
    }

    fn risk_section(&self) -> Section {
        let mut section = Section::new("risk", "Risk");
        match (self.risk(), &self.dossier.no_density) {
            (Some(risk), _) => {
                section.intro =
                    "Rates of failure of the recorded scenarios (S), of their parameterized replays (S') and of a \
                                 density fitted on their parameters (P)."
                        .to_owned();
                section.tables.push(page_table("Rates and risk ratios", 1, risk));
            }
            (None, Some(error)) => section.intro = format!("There is no density: {error}."),
            (None, None) => section.intro = "There is no density.".to_owned(),
        }
        section
    }

    fn cost_section(&self) -> Section {
        let d = self.dossier.parameterization.parameter_count() as f64;
        let n = self.dossier.coverage.as_ref().map_or(self.dossier.scenarios, |coverage| coverage.points) as f64;
        let needed = n.powf((4.0 + d) / 5.0);
        let mut facts = vec![
            ("parameters".to_owned(), format!("{d}")),
            ("points of the density".to_owned(), count(n as u64)),
            (
                "cost of the dimension".to_owned(),
                format!(
                    "the squared error of a kernel density falls as n^(-4/(4+d)) (Silverman 1986, 4.3): as many as {} points \
                     would give {} parameters the accuracy that one parameter has at {}",
                    value(needed),
                    d,
                    count(n as u64)
                ),
            ),
        ];
        if let Some(coverage) = &self.dossier.coverage {
            facts.push((
                "coverage".to_owned(),
                format!(
                    "{} found, {} passed the filters, {} are points of the parameter space",
                    count(coverage.found),
                    count(coverage.kept),
                    count(coverage.points)
                ),
            ));
            let percent = value(100.0 * coverage.valid_share);
            facts.push(("share of the density inside its valid region".to_owned(), format!("{percent} %")));
            facts.push((
                "representativeness".to_owned(),
                coverage.representativeness.map_or("too few scenarios to split".to_owned(), |(metric, train_test)| {
                    let (metric, reached) = (value(metric), value(train_test));
                    format!("M = {metric}; as many recorded scenarios reach {reached} (smaller is better)")
                }),
            ));
        }
        Section { facts, ..Section::new("coverage", "Parameters and coverage") }
    }

    fn credibility_section(&self) -> Section {
        let rows = self.conformance.iter().map(|(what, rows, passes)| {
            vec![what.clone(), if *passes { "passes" } else { "FAILS" }.to_owned(), count(*rows)]
        });
        let table = (owned(&["table", "in this build", "rows"]), rows.collect());
        let recheck = format!(
            "{} lanes were computed again on the CPU with every step, and were equal to the bit",
            count(self.host.rechecked_lanes)
        );
        Section {
            intro: "Tables of the JRC's public simulator that ship with the program, under jrc-2021, computed in this run. \
                    `lanesweep verify conformance` takes more tables."
                .to_owned(),
            tables: vec![page_table("Conformance", 2, table)],
            facts: vec![
                ("exactness".to_owned(), recheck),
                ("not covered".to_owned(), "perception faults, vehicle dynamics beyond a deceleration with a jerk limit".to_owned()),
            ],
            ..Section::new("credibility", "Credibility of the simulation")
        }
    }

    fn reproduction_section(&self) -> Result<Section> {
        let profile = serde_json::to_string_pretty(self.profile)
            .map_err(|e| Error::Internal(format!("a profile cannot be written: {e}")))?;
        let density = self.dossier.density_sha256.clone().unwrap_or_else(|| "–".to_owned());
        Ok(Section {
            facts: vec![
                ("command".to_owned(), self.command.clone()),
                ("program".to_owned(), format!("{}, engine {}", program(), crate::engine::ENGINE_VERSION)),
                ("data".to_owned(), self.data.clone()),
                ("SHA-256 of the scenarios".to_owned(), self.scenarios_sha256.clone()),
                ("SHA-256 of the plan".to_owned(), self.dossier.plan_sha256.clone()),
                ("SHA-256 of the density".to_owned(), density),
                ("profile".to_owned(), format!("{}, time step {} s", self.profile.name, self.profile.frame.dt_s)),
            ],
            host: vec![("computed by".to_owned(), self.host.backend.clone())],
            details: vec![(format!("Profile {}", self.profile.name), profile)],
            ..Section::new("reproduction", "Reproduction")
        })
    }
}

fn owned(header: &[&str]) -> Vec<String> {
    header.iter().map(|name| (*name).to_owned()).collect()
}

fn page_table(caption: &str, texts: usize, (header, rows): (Vec<String>, Vec<Vec<String>>)) -> PageTable {
    PageTable { caption: caption.to_owned(), header, texts, rows }
}

fn share(share: &Share) -> String {
    match (share.value, share.interval) {
        (None, _) => "–".to_owned(),
        (Some(one), None) => format!("{one:.3} [few]"),
        (Some(one), Some((low, high))) => format!("{one:.3} [{low:.3} {high:.3}]"),
    }
}

fn interval(interval: Option<(f64, f64)>) -> String {
    interval.map_or("–".to_owned(), |(low, high)| format!("[{} {}]", value(low), value(high)))
}

fn program() -> String {
    format!("lanesweep {}", env!("CARGO_PKG_VERSION"))
}
