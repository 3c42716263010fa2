//! The dossier's page: its chapters.

use super::dossier::{DossierReport, SHOWN, share};
use super::html::{Page, PageFigure, Section};
use super::records::PROGRAM;
use crate::support::readable::{count, value};

impl DossierReport<'_> {
    /// The dossier as a page.
    pub fn html(&self) -> String {
        let page = Page {
            title: format!("Is {} appropriate under {}?", self.dossier.parameterization.name(), self.profile.name),
            lead: format!("{}. {} {} {}", self.answer(), self.recall(), self.coverage(), self.provenance.data),
            synthetic: self.provenance.synthetic,
            warnings: Vec::new(),
            sections: vec![
                self.conclusion_section(),
                self.hidden_section(),
                Section {
                    intro: "Thirds of the scenarios by the ego's speed, and of the failures of S by severity: closing speed at \
                            the contact, else the shortfall of TTC or the excess of BTN. Precision has no meaning within \
                            failures of S."
                        .to_owned(),
                    tables: vec![self.groups().captioned("Scores by group, [interval over scenarios]")],
                    ..Section::new("groups", "By headway, speed and severity")
                },
                self.risk_section(),
                self.cost_section(),
                Section {
                    intro: "Every parameterization of this kind of scenario on the same data, by the rules for recall and \
                            precision alone."
                        .to_owned(),
                    tables: vec![self.alternatives().captioned("Alternatives, [interval over scenarios]")],
                    ..Section::new("alternatives", "The alternatives")
                },
                self.credibility_section(),
                Section { facts: self.limits(), ..Section::new("limits", "Limits of use") },
                self.reproduction_section(),
                Section { facts: self.signature(), ..Section::new("signature", "Signature") },
            ],
        };
        page.html()
    }

    fn conclusion_section(&self) -> Section {
        Section {
            intro: [self.need().unwrap_or_default(), self.close_following()].join(" ").trim().to_owned(),
            tables: vec![self.findings().captioned("What each rule finds; the worst decides")],
            facts: vec![
                ("rule".to_owned(), self.rule()),
                ("source of the limits".to_owned(), self.limits_of_rules()),
                (
                    "statistical significance".to_owned(),
                    format!("intervals of {} % over scenarios", value(100.0 * self.score.confidence)),
                ),
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
            let caption = format!("Hidden failures, the most severe first. {}", self.beside(SHOWN));
            section.tables.push(self.hidden(SHOWN).captioned(caption.trim()));
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
                section.tables.push(risk.captioned("Rates and risk ratios"));
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
            facts.push(("coverage".to_owned(), self.coverage()));
            let percent = value(100.0 * coverage.valid_fraction);
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
        let recheck = format!(
            "{} lanes were computed again on the CPU with every step, and were equal to the bit",
            count(self.host.rechecked_lanes)
        );
        Section {
            facts: vec![
                ("exactness".to_owned(), recheck),
                (
                    "not covered".to_owned(),
                    "perception faults, vehicle dynamics beyond a deceleration with a jerk limit".to_owned(),
                ),
            ],
            ..Section::new("credibility", "Credibility of the simulation")
        }
    }

    fn reproduction_section(&self) -> Section {
        let density = self.dossier.density_sha256.clone().unwrap_or_else(|| "–".to_owned());
        Section {
            facts: vec![
                ("command".to_owned(), self.command.clone()),
                ("program".to_owned(), format!("{PROGRAM}, engine {}", crate::engine::ENGINE_VERSION)),
                ("data".to_owned(), self.provenance.data.clone()),
                ("SHA-256 of the scenarios".to_owned(), self.provenance.scenarios_sha256.clone()),
                ("SHA-256 of the plan".to_owned(), self.dossier.plan_sha256.clone()),
                ("SHA-256 of the density".to_owned(), density),
                ("profile".to_owned(), format!("{}, time step {} s", self.profile.name, self.profile.frame.dt_s)),
            ],
            host: vec![("computed by".to_owned(), self.host.backend.clone())],
            parts: vec![Section::options(format!("Profile {}", self.profile.name), self.profile)],
            ..Section::new("reproduction", "Reproduction")
        }
    }
}
