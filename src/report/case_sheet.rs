//! The sheet of one case against the regulation: the answer first, then the drivers, the clauses and the distance to the
//! boundary; as text, as JSON and as a page to print.

use serde_json::{Value, json};

use super::case_sentences::VARIED;
use super::html::{Page, PageFigure, PageTable, Section};
use super::records;
use super::tables::{WIDTH, aligned, table, wrap};
use super::trace::{TraceFigure, TraceSeries};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::check::{Boundary, Change, Judged, Judgement, Reading, Subject, Verdict};
use crate::run::grid::{MapQuantity, PARAMETERS};
use crate::support::readable::value;
use crate::{Error, Result};

/// Metres per second in kilometres per hour.
pub(super) const KMH: f64 = 3.6;
/// What the columns of the drivers are.
const DRIVERS: &str = "Drivers; smallest gap and TTC, largest BTN. At a contact: rear-end where the ego's front hits, side where \
                       the other vehicle hits the ego's side or rear; closing is the ego's speed minus the other's. A row that \
                       equals that of a profile above is left out";

/// A checked case with what has to be said of it.
pub struct CaseSheet<'a> {
    /// The case.
    pub subject: &'a Subject,
    /// Where it comes from, in a few words.
    pub origin: String,
    /// The data are the program's own.
    pub is_synthetic: bool,
    /// The profiles, in the order of the judgements.
    pub profiles: &'a [Profile],
    /// One per profile; the first one decides. At least one.
    pub judgements: &'a [Judgement],
    /// Command that makes the sheet again.
    pub command: String,
}

impl CaseSheet<'_> {
    pub(super) fn first(&self) -> &Judgement {
        &self.judgements[0]
    }

    /// The numbers of the case: name, value with unit.
    pub fn numbers(&self) -> Vec<(String, String)> {
        let point = self.subject.point();
        let mut list: Vec<(String, String)> = Vec::new();
        let shown = [
            MapQuantity::EgoSpeed,
            MapQuantity::OtherSpeed,
            MapQuantity::Gap,
            MapQuantity::Thw,
            MapQuantity::LateralSpeed,
            MapQuantity::LateralDistance,
            MapQuantity::Deceleration,
            MapQuantity::EndSpeed,
            MapQuantity::AheadSpeed,
            MapQuantity::AheadGap,
        ];
        for quantity in shown {
            let Some(parameter) = PARAMETERS.iter().find(|p| p.quantity == quantity) else { continue };
            let Some(si) = point.get(quantity) else { continue };
            let text = match parameter.unit {
                "m/s" if quantity != MapQuantity::LateralSpeed => {
                    format!("{} km/h ({} m/s)", value(si * KMH), value(si))
                }
                unit => format!("{} {unit}", value(si)),
            };
            list.push((parameter.label.to_owned(), text));
        }
        if let Some(duration_s) = self.subject.duration_s() {
            list.push(("Duration of the motions".to_owned(), format!("{} s", value(duration_s))));
        }
        let ego_mps = point.get(MapQuantity::EgoSpeed).unwrap_or(0.0);
        match (point.get(MapQuantity::Gap), point.get(MapQuantity::Thw)) {
            (Some(gap_m), _) if ego_mps > 0.0 => {
                list.push(("Initial time headway".to_owned(), format!("{} s", value(gap_m / ego_mps))));
            }
            (None, Some(thw_s)) => list.push(("Initial gap".to_owned(), format!("{} m", value(thw_s * ego_mps)))),
            _ => {}
        }
        list
    }

    fn drivers(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let header = [
            "profile",
            "model",
            "collision",
            "gap m",
            "TTC s",
            "BTN",
            "contact",
            "closing km/h",
            "reacts s",
            "brakes s",
            "changes with",
        ];
        let mut rows = Vec::new();
        for judgement in self.judgements {
            judgement.models.iter().for_each(|judged| push_new(&mut rows, driver_row(judgement, judged)));
        }
        (header.map(str::to_owned).to_vec(), rows)
    }

    fn clauses(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let header = ["clause", "condition", "where it holds", "at s", "value", "", "threshold", "unit", "holds"];
        let row = |reading: &Reading| {
            vec![
                reading.clause.clone(),
                reading.quantity.to_owned(),
                reading.then.to_owned(),
                reading.time_s.map_or("never".to_owned(), value),
                reading.value.map_or("–".to_owned(), value),
                reading.relation.sign().to_owned(),
                value(reading.threshold),
                if reading.unit == "1" { String::new() } else { reading.unit.to_owned() },
                if reading.holds() { "yes" } else { "no" }.to_owned(),
            ]
        };
        let mut rows: Vec<Vec<String>> = self.first().readings.iter().map(row).collect();
        // Of another clause, the conditions that differ.
        let mut clauses = vec![&self.first().clause];
        for judgement in &self.judgements[1..] {
            if !clauses.contains(&&judgement.clause) {
                judgement.conditions().map(row).for_each(|row| push_new(&mut rows, row));
                clauses.push(&judgement.clause);
            }
        }
        (header.map(str::to_owned).to_vec(), rows)
    }

    fn boundaries(&self) -> (Vec<String>, Vec<Vec<String>>) {
        let mut header = ["parameter", "value", "changes at", "distance"].map(str::to_owned).to_vec();
        header.extend(ModelId::ALL.iter().map(|model| format!("{} at", model.name())));
        let row = |boundary: &Boundary| {
            let parameter = boundary.parameter;
            let nearest = nearest(&boundary.answer, boundary.value);
            let mut row = vec![
                parameter.title(),
                value(boundary.value),
                becomes(boundary),
                nearest.map_or("–".to_owned(), |at| Rounded(at - boundary.value).to_string()),
            ];
            row.extend(boundary.models.iter().map(change));
            row
        };
        (header, self.first().boundaries.iter().map(row).collect())
    }

    /// The sheet as text.
    pub fn text(&self) -> String {
        let synthetic = if self.is_synthetic { "SYNTHETIC DATA: " } else { "" };
        let numbers: Vec<String> =
            self.numbers().iter().map(|(name, number)| format!("  {name}: {number}\n")).collect();
        let rows = |(header, rows): (Vec<String>, Vec<Vec<String>>), texts| {
            let mut table = table(header);
            rows.into_iter().for_each(|row| {
                table.add_row(row);
            });
            aligned(table, texts)
        };
        let sentences = self.demand().into_iter().chain(self.silent());
        let demand: Vec<String> = sentences.map(|sentence| format!("  {sentence}\n")).collect();
        format!(
            "{synthetic}{}\n{}\n{}{}\n{}\n{}\nClauses under {}\n{}\nWhere the \
             answer changes, and each driver's collision, under {}.\nAt least one change lies between the case and this value; \
             the answer may change again beyond it\n{}",
            self.case(),
            self.answer(),
            demand.concat(),
            numbers.concat(),
            wrap(DRIVERS, WIDTH),
            rows(self.drivers(), 3),
            self.first().profile,
            rows(self.clauses(), 3),
            self.first().profile,
            rows(self.boundaries(), 1),
        )
    }

    /// The sheet as one document.
    ///
    /// # Errors
    /// None for what this program made.
    pub fn json(&self) -> Result<String> {
        let judgement = |(judgement, profile): (&Judgement, &Profile)| {
            let models = judgement.models.iter().map(|judged| {
                let mut outcome = records::outcome(&judged.trace.outcome, judged.trace.dt_s);
                outcome["model"] = json!(judged.trace.model.name());
                outcome["t_brake_s"] = json!(judged.braking_s());
                outcome["changes_with"] = json!(judged.flips);
                outcome
            });
            let readings = judgement.readings.iter().map(|reading| {
                json!({
                    "clause": reading.clause, "condition": reading.quantity, "unit": reading.unit,
                    "value": reading.value, "relation": reading.relation.sign(), "threshold": reading.threshold,
                    "t_s": reading.time_s, "holds": reading.holds(), "then": reading.then,
                })
            });
            let boundaries = judgement.boundaries.iter().map(|boundary| {
                let models = ModelId::ALL.iter().zip(&boundary.models);
                let models: serde_json::Map<String, Value> =
                    models.map(|(model, at)| (model.name().to_owned(), ends(at))).collect();
                json!({
                    "parameter": boundary.parameter.key, "value": boundary.value, "searched": boundary.range,
                    "answer_changes_at": ends(&boundary.answer),
                    "answer_becomes": {"below": boundary.becomes[0].map(Verdict::label), "above": boundary.becomes[1].map(Verdict::label)},
                    "collision_changes_at": models,
                })
            });
            json!({
                "profile": judgement.profile,
                "dt_s": profile.frame.dt_s,
                "verdict": judgement.verdict().label(),
                "answer": judgement.verdicts.answer().label(),
                "clause": judgement.clause,
                "demanded": judgement.is_demanded(),
                "demand_changes_with": judgement.demand_flips,
                "outside_annex_3": judgement.outside_annex,
                "silent": judgement.silent,
                "avoided_by": judgement.verdicts.avoided_by().iter().map(|m| m.name()).collect::<Vec<_>>(),
                "changes_with": judgement.flips,
                "models": models.collect::<Vec<_>>(),
                "clauses": readings.collect::<Vec<_>>(),
                "boundaries": boundaries.collect::<Vec<_>>(),
            })
        };
        let point = self.subject.point();
        let numbers: serde_json::Map<String, Value> = PARAMETERS
            .iter()
            .filter(|parameter| parameter.per_si == 1.0)
            .filter_map(|parameter| Some((parameter.key.to_owned(), json!(point.get(parameter.quantity)?))))
            .chain(self.subject.duration_s().map(|duration_s| ("duration_s".to_owned(), json!(duration_s))))
            .collect();
        records::document(&json!({
            "program": program(),
            "data": self.origin,
            "synthetic": self.is_synthetic,
            "category": self.subject.category().key(),
            "case": numbers,
            "verdict": self.first().verdict().label(),
            "answer": self.answer(),
            "demand": self.demand(),
            "silent": self.silent(),
            "profiles": self.judgements.iter().zip(self.profiles).map(judgement).collect::<Vec<_>>(),
        }))
    }

    /// The course of the case under the first profile, as a figure.
    pub fn figure(&self) -> String {
        let first = self.first();
        let series = first
            .models
            .iter()
            .map(|judged| TraceSeries { name: judged.trace.model.name().to_owned(), trace: &judged.trace });
        let title = format!("{} under {}", self.subject.category().label(), first.profile);
        TraceFigure { title, subtitle: Some(self.origin.clone()), series: series.collect(), until_s: None }.svg()
    }

    /// The sheet as a page.
    ///
    /// # Errors
    /// [`Error::Internal`] where the template does not fit: a defect of this program.
    pub fn html(&self) -> Result<String> {
        let first = self.first();
        let page_table =
            |caption: &str, texts, (header, rows)| PageTable { caption: caption.to_owned(), header, texts, rows };
        let mut warnings = Vec::new();
        if self.is_synthetic {
            warnings.push("SYNTHETIC DATA: nothing on this sheet is a statement about real traffic.".to_owned());
        }
        if first.verdict() == Verdict::Undecided {
            warnings.push(format!("Undecided: the answer changes with {}.", first.flips.join(", ")));
        }
        let case = Section { facts: self.numbers(), ..Section::new("case", "Case") };
        let drivers = Section {
            intro: format!(
                "A collision is preventable where one of the two drivers of Annex 3, CCHDM or FSM, avoids it. Where nothing \
                 collides even if the ego never reacts, there is no conflict. Gap and TTC are the smallest, BTN is the \
                 largest. In a rear-end contact the ego's front hits the other vehicle; in a side contact the other vehicle \
                 hits the ego from the side or behind. \"Closing\" is the ego's speed minus the other's at the contact: \
                 negative where the ego is slower. \"Brakes\" is the time from which the ego brakes; CCHDM's coasting \
                 before it is no braking. \"Changes with\" names what turns the collision verdict, of {VARIED}."
            ),
            tables: vec![page_table("Drivers", 3, self.drivers())],
            ..Section::new("drivers", "Drivers")
        };
        let clauses = Section {
            intro: format!(
                "What the clauses say of the case, with the numbers of {}; then the conditions of other clauses of \
                 cut-ins that differ from these.",
                first.profile
            ),
            tables: vec![page_table("Clauses", 3, self.clauses())],
            ..Section::new("clauses", "Clauses")
        };
        let boundaries = Section {
            intro: "One number is changed, all others stay, in 100 steps to either end of its range. \"Changes at\" is the \
                    nearest value found on either side (below, above) at which the answer is another one, and what it is \
                    there: at least one change lies between, and one that lasts for less than a step of the scan is missed. \
                    The last columns say so of each model's collision."
                .to_owned(),
            tables: vec![page_table("Distance to the boundary", 1, self.boundaries())],
            ..Section::new("boundary", "Distance to another answer")
        };
        let course = Section {
            figures: vec![PageFigure::new(&self.figure(), &["this sheet"])],
            ..Section::new("course", "Course of the case")
        };
        let constants = serde_json::to_string_pretty(&self.profiles[0])
            .map_err(|e| Error::Internal(format!("a profile cannot be written: {e}")))?;
        let reproduction = Section {
            facts: vec![
                ("command".to_owned(), self.command.clone()),
                ("program".to_owned(), program()),
                ("data".to_owned(), self.origin.clone()),
                ("arithmetic".to_owned(), format!("binary64, time step {} s", self.profiles[0].frame.dt_s)),
            ],
            details: vec![(format!("Profile {}", first.profile), constants)],
            ..Section::new("reproduction", "Reproduction")
        };
        let page = Page {
            title: format!("One {} against UN R157", self.subject.category().label()),
            program: program(),
            lead: std::iter::once(self.case())
                .chain([self.answer()])
                .chain(self.demand())
                .chain(self.silent())
                .map(|sentence| format!("{sentence}."))
                .collect::<Vec<_>>()
                .join(" "),
            warnings,
            sections: vec![case, drivers, clauses, boundaries, course, reproduction],
        };
        page.html()
    }
}

fn driver_row(judgement: &Judgement, judged: &Judged) -> Vec<String> {
    let outcome = &judged.trace.outcome;
    let closing_mps = judged.impact_closing_mps();
    let time = |time: Option<f64>| time.map_or("never".to_owned(), value);
    vec![
        judgement.profile.clone(),
        judged.trace.model.name().to_owned(),
        if judged.collides() { "COLLIDES" } else { "avoids" }.to_owned(),
        value(outcome.min_gap),
        value(outcome.min_ttc),
        value(outcome.max_btn),
        judged
            .trace
            .outcome
            .contact
            .label()
            .split(' ')
            .next()
            .filter(|_| closing_mps.is_some())
            .unwrap_or("–")
            .to_owned(),
        closing_mps.map_or("–".to_owned(), |mps| value(mps * KMH)),
        time(judged.reaction_s()),
        time(judged.braking_s()),
        judged.flips.join(", "),
    ]
}

/// Adds a row that differs from all others in more than its first cell: profiles share most drivers, clauses most
/// conditions.
fn push_new(rows: &mut Vec<Vec<String>>, row: Vec<String>) {
    if rows.iter().all(|known| known[1..] != row[1..]) {
        rows.push(row);
    }
}

fn nearest(change: &Change, from: f64) -> Option<f64> {
    let distance = |at: &f64| (at - from).abs();
    change.below.into_iter().chain(change.above).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

fn change(change: &Change) -> String {
    match (change.below, change.above) {
        (None, None) => "–".to_owned(),
        (Some(at), None) | (None, Some(at)) => value(at),
        (Some(below), Some(above)) => format!("{}, {}", value(below), value(above)),
    }
}

/// Where the answer changes, and what it becomes.
fn becomes(boundary: &Boundary) -> String {
    let ends = [boundary.answer.below, boundary.answer.above].into_iter().zip(boundary.becomes);
    let named = ends.filter_map(|(at, answer)| Some(format!("{}: {}", value(at?), answer?.label())));
    let named: Vec<String> = named.collect();
    if named.is_empty() { "–".to_owned() } else { named.join(", ") }
}

fn ends(change: &Change) -> Value {
    json!({"below": change.below, "above": change.above})
}

/// A number with its sign.
struct Rounded(f64);

impl std::fmt::Display for Rounded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = if self.0 < 0.0 { "-" } else { "+" };
        write!(f, "{sign}{}", value(self.0.abs()))
    }
}

fn program() -> String {
    format!("lanesweep {}", env!("CARGO_PKG_VERSION"))
}
