//! The severity of the contacts of a case: changes of speed, and injury risks by published curves.

use super::case_sheet::CaseSheet;
use super::html::Section;
use super::tables::{WIDTH, wrap};
use crate::model::severity::{InjuryCurve, RESTITUTION, contact_delta_v_mps, mass_kg};
use crate::run::check::Judged;
use crate::scenario::{CaseQuantity, KMH};
use crate::support::readable::value;
use crate::support::table::{Column, Digits, Table};

impl CaseSheet<'_> {
    /// Changes of speed of ego and other vehicle in the contact of a driver's run, m/s; `None` without a central one.
    pub(super) fn delta_v_mps(&self, judged: &Judged) -> Option<[f64; 2]> {
        contact_delta_v_mps(judged.trace.outcome.contact, judged.impact_closing_mps()?, self.lengths_m()?)
    }

    /// As [`InjuryCurve::ego_risk`].
    pub(super) fn injury_risk(&self, delta_v_mps: Option<[f64; 2]>, curve: &InjuryCurve) -> Option<f64> {
        curve.ego_risk(delta_v_mps, self.lengths_m()?[0])
    }

    fn lengths_m(&self) -> Option<[f64; 2]> {
        let length_m = |quantity| self.subject.point().get(quantity);
        Some([length_m(CaseQuantity::EgoLength)?, length_m(CaseQuantity::Length)?])
    }

    fn severity(&self) -> Table {
        let contacts = self.first().models.iter().filter(|judged| judged.impact_closing_mps().is_some());
        let delta_v = |judged: &Judged, of: usize| self.delta_v_mps(judged).map(|both| both[of]);
        let risk = |judged: &Judged, curve: &InjuryCurve| {
            self.injury_risk(self.delta_v_mps(judged), curve).map(|risk| 100.0 * risk)
        };
        Table::of(contacts)
            .column("model", |judged| judged.trace.model.name())
            .column("closing km/h", |judged| judged.impact_closing_mps().map(|mps| mps * KMH))
            .column(Column::from("ΔV ego km/h").null("–"), |judged| delta_v(judged, 0).map(|mps| mps * KMH))
            .column(Column::from("ΔV other km/h").null("–"), |judged| delta_v(judged, 1).map(|mps| mps * KMH))
            .columns(
                self.injury,
                |curve| Column::from(format!("{} %", curve.name)).digits(Digits::Significant(2)).null("–"),
                |judged, curve| risk(judged, curve),
            )
            .build()
    }

    /// What the numbers rest on.
    fn severity_notes(&self) -> String {
        let [ego_kg, other_kg] = self.lengths_m().unwrap_or_default().map(|length_m| value(mass_kg(length_m)));
        let curves = self.injury.iter().map(|curve| {
            let to_kmh = value((curve.valid_to_mps * KMH).round());
            format!(
                "{}: {} of the ego's occupants by ΔV; {}; {}; to {to_kmh} km/h.",
                curve.name, curve.injury, curve.of, curve.source
            )
        });
        let masses = format!(
            "A central contact in line, by conservation of momentum: masses of {ego_kg} kg (ego) and {other_kg} kg by length, restitution \
             {RESTITUTION} (ours). –: a side contact, which is not of this kind; a risk beyond the data of its curve, or of the occupants of a truck. A risk is one of the crashes that a curve was fitted to, not of this vehicle."
        );
        std::iter::once(masses).chain(curves).collect::<Vec<_>>().join(" ")
    }

    /// The text of the severity; empty unless a curve was named.
    pub(super) fn severity_text(&self) -> String {
        match self.injury.is_empty() {
            true => String::new(),
            false => format!(
                "\n{}\n{}",
                wrap(&format!("Severity. {}", self.severity_notes()), WIDTH),
                self.severity().text()
            ),
        }
    }

    /// The chapter of the severity, if a curve was named.
    pub(super) fn severity_section(&self) -> Option<Section> {
        let section = || {
            Section::new("severity", "Severity")
                .intro(self.severity_notes())
                .tables([self.severity().captioned("Contacts")])
        };
        (!self.injury.is_empty()).then(section)
    }
}
