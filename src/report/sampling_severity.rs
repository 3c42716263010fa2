//! Injuries per hour of a sampling run, and rates against a target: tables and sentences.

use super::html::Section;
use super::sampling::{SampleReport, short, three_digits};
use super::sampling_tables::word;
use super::tables::{WIDTH, wrap};
use crate::model::severity::{InjuryCurve, mass_kg};
use crate::run::sampling::{InjuryRow, RiskRate, TargetRow, TargetVerdict};
use crate::support::readable::{count, value};
use crate::support::table::Table;

impl SampleReport {
    /// Injuries of every headway, or those over all headways.
    pub(super) fn injuries_table(&self, is_complete: bool) -> Table {
        let has_all = self.injuries.iter().any(|row| row.headway == "all");
        let rows = self.injuries.iter().filter(|row| is_complete || !has_all || row.headway == "all");
        let rate = |row: &InjuryRow, end: fn(RiskRate) -> f64| row.per_hour.map(end);
        Table::of(rows)
            .column("curve", |row| row.curve)
            .column("model", |row| row.model.name())
            .column("headway", |row| row.headway.as_str())
            .column("contacts", |row| row.contacts)
            .column("uncovered", |row| row.uncovered)
            .column(three_digits("risk"), |row| row.risk)
            .column(three_digits("risk_low"), |row| row.interval[0])
            .column(three_digits("risk_high"), |row| row.interval[1])
            .column(three_digits("per_hour"), |row| rate(row, |of| of.estimate))
            .column(three_digits("per_hour_low"), |row| rate(row, |of| of.low))
            .column(three_digits("per_hour_high"), |row| rate(row, |of| of.high))
            .build()
    }

    fn injuries_notes(&self) -> String {
        let mut curves: Vec<&InjuryCurve> = Vec::new();
        for curve in self.injuries.iter().filter_map(|row| InjuryCurve::find(row.curve).ok()) {
            curves.extend((!curves.contains(&curve)).then_some(curve));
        }
        let curves = curves.iter().map(|curve| {
            format!("{}: {} of the ego's occupants by ΔV; {}; {}.", curve.name, curve.injury, curve.of, curve.source)
        });
        let sizes = self.options.injury.as_ref().map(|injury| injury.sizes);
        let masses =
            sizes.map(|sizes| [sizes.ego, sizes.target].map(|size| value(mass_kg(size.length_m))).join(" and "));
        format!(
            "Injuries: contacts per hour times their mean risk, central contacts in line; {} kg of ego and other vehicle by the density's mean lengths. A contact that its curve does not \
             cover (from the side, of a truck, beyond its data) counts as no injury in the estimate and the lower end, as an injury in the upper end. \
             The interval of the mean risk covers the draws alone. {}",
            masses.unwrap_or_default(),
            curves.collect::<Vec<_>>().join(" ")
        )
    }

    /// A sentence per rate that has a target.
    fn target_sentences(&self) -> Vec<String> {
        let is_uncovered = |row: &TargetRow| {
            let of = (row.of, row.model, &row.headway);
            self.injuries
                .iter()
                .any(|injury| (injury.curve, injury.model, &injury.headway) == of && injury.uncovered > 0)
        };
        let sentence = |row: &TargetRow| {
            let [target, low, high] = [row.target, row.rate.low, row.rate.high].map(short);
            let level = value(100.0 * self.level());
            let more = match (row.samples, row.hours) {
                _ if row.rate.estimate <= row.target && is_uncovered(row) => {
                    "contacts that the curve does not cover count as injuries in the upper bound, so more samples do not decide"
                        .to_owned()
                }
                (None, None) => {
                    "no number of samples alone and no number of recorded hours alone would decide".to_owned()
                }
                (samples, hours) => {
                    let samples = samples.map(|samples| format!("about {} samples", count(samples.ceil() as u64)));
                    let hours = hours.map(|hours| format!("about {} recorded hours", short(hours)));
                    let either: Vec<String> = samples.into_iter().chain(hours).collect();
                    format!("{} in all would decide if the rate is as estimated", either.join(" or "))
                }
            };
            let verdict = match row.verdict {
                TargetVerdict::Below => format!("the upper bound of {high} per hour lies below the target of {target}"),
                TargetVerdict::Above => format!("the lower bound of {low} per hour lies above the target of {target}"),
                TargetVerdict::Undecided => {
                    format!("the target of {target} per hour lies within {low} to {high}, undecided; {more}")
                }
            };
            let headway = match row.headway.as_str() {
                _ if self.headways == ["sampled"] => "drawn headways".to_owned(),
                "all" => format!("imposed headways {}", self.headways.join(", ")),
                one => format!("imposed headway {one}"),
            };
            let (model, profile) = (row.model.name(), &self.profile.name);
            format!("{model} under {profile}, {}, {headway}: {verdict} (intervals at {level} %).", row.of)
        };
        self.targets.iter().map(sentence).collect()
    }

    /// The text after the estimates; empty without curves and without a target.
    pub(super) fn severity_text(&self) -> String {
        let mut text = String::new();
        if !self.injuries.is_empty() {
            text += &format!("{}\n{}", wrap(&self.injuries_notes(), WIDTH), self.injuries_table(false).text());
        }
        self.target_sentences().iter().for_each(|sentence| text += &format!("{}\n", wrap(sentence, WIDTH)));
        text
    }

    /// The chapters of injuries and target, if the run has them.
    pub(super) fn severity_sections(&self) -> Vec<Section> {
        let injuries = || {
            Section::new("injuries", "Injuries").intro(self.injuries_notes()).tables([self
                .injuries_table(false)
                .captioned("Contacts, their mean risk, and injuries per hour of driving")])
        };
        let target = || {
            Section::new("target", "Target")
                .intro(self.target_sentences().join(" "))
                .tables([self.targets_table().captioned("Rates per hour of driving against the target")])
        };
        let injuries = (!self.injuries.is_empty()).then(injuries);
        injuries.into_iter().chain((!self.targets.is_empty()).then(target)).collect()
    }

    /// `targets.csv`.
    pub(super) fn targets_table(&self) -> Table {
        Table::of(&self.targets)
            .column("of", |row| row.of)
            .column("model", |row| row.model.name())
            .column("headway", |row| row.headway.as_str())
            .column("verdict", |row| word(row.verdict))
            .column(three_digits("target_per_hour"), |row| row.target)
            .column(three_digits("per_hour"), |row| row.rate.estimate)
            .column(three_digits("low"), |row| row.rate.low)
            .column(three_digits("high"), |row| row.rate.high)
            .column(three_digits("samples_to_decide"), |row| row.samples)
            .column(three_digits("hours_to_decide"), |row| row.hours)
            .build()
    }
}
