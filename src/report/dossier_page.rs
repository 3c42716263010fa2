//! The dossier's page: its chapters.

use super::credibility::{RunKind, annex};
use super::dossier::{DossierReport, SHOWN, share};
use super::html::{Page, PageFigure, Section};
use crate::Result;
use crate::support::readable::{count, value};
use crate::support::run_folder::ResultFiles;

impl DossierReport<'_> {
    /// The dossier as a page.
    pub(super) fn html(&self) -> Result<String> {
        let page = Page {
            title: format!("Is {} appropriate under {}?", self.dossier.parameterization.name(), self.profile.name),
            lead: format!("{}. {} {} {}", self.answer(), self.recall(), self.coverage(), self.provenance.data),
            synthetic: self.provenance.synthetic,
            warnings: Vec::new(),
            sections: std::iter::once(self.conclusion_section())
                .chain(self.changes()?.map(|changes| changes.section()))
                .chain([
                self.hidden_section(),
                Section::new("groups", "By headway, speed and severity")
                    .intro(
                        "Thirds of the scenarios by the ego's speed, and of the failures of S by severity: closing \
                         speed at the contact, else the shortfall of TTC or the excess of BTN. Precision has no \
                         meaning within failures of S.",
                    )
                    .tables([self.groups().captioned("Scores by group, [interval over scenarios]")]),
                self.risk_section(),
                self.cost_section(),
                Section::new("alternatives", "The alternatives")
                    .intro(
                        "Every parameterization of this kind of scenario on the same data, by the rules for recall and \
                         precision alone.",
                    )
                    .tables([self.alternatives().captioned("Alternatives, [interval over scenarios]")]),
                Section::new("limits", "Limits of use").facts(self.limits()),
                annex(RunKind::Dossier, &self.json(&ResultFiles::default())?)?.host(self.host.facts()),
                Section::new("signature", "Signature").facts(self.signature()),
            ])
            .collect(),
        };
        Ok(page.html())
    }

    fn conclusion_section(&self) -> Section {
        let significance = format!("intervals of {} % over scenarios", value(100.0 * self.options.score.confidence));
        Section::new("conclusion", "Conclusion")
            .intro([self.need().unwrap_or_default(), self.close_following()].join(" ").trim())
            .tables([self.findings().captioned("What each rule finds; the worst decides"), self.limits_table()])
            .fact("rule", self.rule())
            .fact("statistical significance", significance)
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
        let caption = format!("Hidden failures, the most severe first. {}", self.beside(SHOWN));
        Section::new("hidden", "Failures that are hidden")
            .intro(intro)
            .tables((counts.fn_ > 0).then(|| self.hidden(SHOWN).captioned(caption.trim())))
            .figures(self.example().map(|svg| PageFigure::new(&svg, &["hidden.svg"])))
    }

    fn risk_section(&self) -> Section {
        let risk = self.risk();
        let intro = match (&risk, &self.dossier.no_density) {
            (Some(_), _) => {
                "Rates of failure of the recorded scenarios (S), of their parameterized replays (S') and of \
                             a density fitted on their parameters (P)."
                    .to_owned()
            }
            (None, Some(error)) => format!("There is no density: {error}."),
            (None, None) => "There is no density.".to_owned(),
        };
        Section::new("risk", "Risk").intro(intro).tables(risk.map(|risk| risk.captioned("Rates and risk ratios")))
    }

    fn cost_section(&self) -> Section {
        let d = self.dossier.parameterization.parameter_count() as f64;
        let n = self.dossier.coverage.as_ref().map_or(self.dossier.scenarios, |coverage| coverage.points) as f64;
        let needed = n.powf((4.0 + d) / 5.0);
        let cost = format!(
            "the squared error of a kernel density falls as n^(-4/(4+d)) (Silverman 1986, 4.3): as many as {} points \
             would give {d} parameters the accuracy that one parameter has at {}",
            value(needed),
            count(n as u64)
        );
        let section = Section::new("coverage", "Parameters and coverage")
            .fact("parameters", d.to_string())
            .fact("points of the density", count(n as u64))
            .fact("cost of the dimension", cost);
        let Some(coverage) = &self.dossier.coverage else { return section };
        let represents = |(metric, train_test)| {
            let (metric, reached) = (value(metric), value(train_test));
            format!("M = {metric}; as many recorded scenarios reach {reached} (smaller is better)")
        };
        let unknown = || "too few scenarios to split".to_owned();
        section
            .fact("coverage", self.coverage())
            .fact(
                "share of the density inside its valid region",
                format!("{} %", value(100.0 * coverage.valid_fraction)),
            )
            .fact("representativeness", coverage.representativeness.map_or_else(unknown, represents))
    }
}
