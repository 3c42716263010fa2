//! The sheet of one case against the regulation: the answer, the drivers, the clauses and the distance to the boundary;
//! as text, as JSON and as a page to print.

use std::collections::BTreeMap;

use serde::Serialize;

use super::case_evidence::{CaseIdentity, NOT_CONSIDERED, assumptions, profile_sha256};
use super::html::{Page, PageFigure, Section};
use super::lanes::{outcome_record, with_outcomes};
use super::records::{self, PROGRAM, record};
use super::tables::{WIDTH, indented, wrap};
use super::trace::{TraceFigure, TraceSeries};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{CaseQuantity, KMH, NUMBERS};
use lanesweep_run::check::{Boundary, Change, Judged, Judgement, Reading, RunEnd, Subject, Verdict};
use lanesweep_run::grid::VARIED;
use lanesweep_support::readable::value;
use lanesweep_support::run_folder::NamedTable;
use lanesweep_support::table::{Cell, Column, NumberText, Table, json_number};
use lanesweep_support::{Result, option};

/// What the columns of the drivers show.
const DRIVERS: &str = "Smallest gap to a vehicle in the ego's path, smallest TTC, largest BTN. At a contact while the gap \
     closes, TTC is 0 and BTN ∞ by definition. Touches: no contact, but the smallest gap is below 1 cm, or becomes so as the \
     time step goes to 0. None: there is nothing to avoid. Open: the gap still closes at the end of the run. Contact: side \
     where the other vehicle hits the ego from behind or moves sideways into it, else rear-end; closing is the ego's speed minus the other's. Times count from the start of the case. Brakes: the time from which the ego brakes; CCHDM's coasting is no braking. \
     –: not before the end of the run; for TTC: the gap does not close. A row that equals that of a profile above is left out";
/// What the columns of the boundaries show.
const BOUNDARIES: &str = "One number is changed, all others stay, in 130 steps, fine near the case, to either end of its range (JSON: searched). \
     Changes at: the nearest values below and above, rounded to 4 digits, at which the computed answer is another one. The \
     answer may be undecided before that value. At least one change lies between the case and this value; a change that lasts \
     for less than a step of the scan is missed. –: no change found. The last columns: where each driver's collision changes";

/// A checked case with the facts that its sheet states.
pub struct CaseSheet<'a> {
    /// The case.
    pub subject: &'a Subject,
    /// Its source, in a few words.
    pub origin: String,
    /// Whether the data are synthetic.
    pub is_synthetic: bool,
    /// What is implausible about the numbers of the case.
    pub doubts: &'a [String],
    /// The profiles, in the order of the judgements.
    pub profiles: &'a [Profile],
    /// One judgement per profile, at least one; the first decides.
    pub judgements: &'a [Judgement],
    /// Command that reproduces the sheet.
    pub command: String,
    /// What the user and the build say of it.
    pub identity: CaseIdentity,
}

impl CaseSheet<'_> {
    pub(super) fn first(&self) -> &Judgement {
        &self.judgements[0]
    }

    /// The judgements whose clause is not that of one before.
    pub(super) fn other_clauses(&self) -> impl Iterator<Item = &Judgement> {
        let is_new = |at: usize| self.judgements[..at].iter().all(|of| of.clause != self.judgements[at].clause);
        (1..self.judgements.len()).filter(move |at| is_new(*at)).map(|at| &self.judgements[at])
    }

    /// The numbers of the case: name, value with unit.
    fn numbers(&self) -> Vec<(String, String)> {
        let point = self.subject.point();
        let mut list: Vec<(String, String)> = Vec::new();
        for number in &NUMBERS {
            let Some(si) = point.get(number.quantity) else { continue };
            let is_gained = number.quantity == CaseQuantity::Deceleration && si < 0.0;
            let label = if is_gained { "Acceleration of the other vehicle" } else { number.label };
            let mut text = self.number(number.quantity, if is_gained { -si } else { si });
            if number.needs_unit() {
                text += &format!(" ({} m/s)", value(si));
            }
            list.push((label.to_owned(), text));
        }
        if let Some(duration_s) = self.subject.duration_s() {
            list.push(("Duration of the motions".to_owned(), format!("{} s", value(duration_s))));
        }
        let ego_mps = point.get(CaseQuantity::EgoSpeed).unwrap_or(0.0);
        match (point.get(CaseQuantity::Gap), point.get(CaseQuantity::Thw)) {
            (Some(gap_m), _) if ego_mps > 0.0 => {
                list.push(("Initial time headway".to_owned(), format!("{} s", value(gap_m / ego_mps))));
            }
            (None, Some(thw_s)) => list.push(("Initial gap".to_owned(), format!("{} m", value(thw_s * ego_mps)))),
            _ => {}
        }
        list
    }

    /// The drivers by profile.
    fn judged(&self) -> impl Iterator<Item = (&Judgement, &Judged)> {
        self.judgements.iter().flat_map(|judgement| judgement.models.iter().map(move |judged| (judgement, judged)))
    }

    fn drivers(&self) -> Table {
        let contact = |judged: &Judged| judged.trace.contact_label().split(' ').next();
        let table = Table::of(self.judged())
            .column("profile", |(judgement, _)| judgement.profile.as_str())
            .column("model", |(_, judged)| judged.trace.model.name())
            .column("collision", |(judgement, judged)| verdict_of(judgement, judged))
            .column("gap m", |(_, judged)| records::smallest_gap_m(&judged.trace.outcome))
            .column(Column::from("TTC s").null("–"), |(_, judged)| judged.trace.outcome.approach_ttc())
            .column("BTN", |(_, judged)| judged.trace.outcome.max_btn)
            .column(Column::from("contact").null("–"), |(_, judged)| {
                contact(judged).filter(|_| judged.impact_closing_mps().is_some())
            })
            .column(Column::from("closing km/h").null("–"), |(_, judged)| {
                judged.impact_closing_mps().map(|v| v * KMH)
            })
            .column(Column::from("reacts s").null("–"), |(_, judged)| judged.reaction_s())
            .column(Column::from("brakes s").null("–"), |(_, judged)| judged.braking_s())
            .column("changes with", |(_, judged)| judged.flips.join(", "))
            .build();
        without_repeats(table, 0)
    }

    /// The drivers under the first profile, and those under the others that differ.
    fn drivers_by_profile(&self) -> [Table; 2] {
        let (Table { columns, rows, .. }, profile) = (self.drivers(), self.first().profile.as_str());
        let (of_first, of_others) = rows.into_iter().partition(|row| row[0] == Cell::text(profile));
        let table = |caption: String, rows| Table { caption, columns: columns.clone(), rows };
        [
            table(format!("Drivers under {profile}"), of_first),
            table("Drivers under other profiles".to_owned(), of_others),
        ]
    }

    fn clauses(&self) -> Table {
        let mut readings: Vec<&Reading> = self.first().readings.iter().collect();
        let own = readings.len();
        // For other clauses, only the conditions that differ.
        readings.extend(self.other_clauses().flat_map(Judgement::conditions));
        let table = Table::of(readings)
            .column("clause", |reading| reading.clause.as_str())
            .column("condition", |reading| reading.quantity)
            .column("where it holds", |reading| reading.then)
            .column(Column::from("at s").null("never"), |reading| reading.time_s)
            .column(Column::from("value").null("–"), |reading| reading.value)
            .column("", |reading| reading.relation.sign())
            .column("threshold", |reading| reading.threshold)
            .column("unit", |reading| if reading.unit == "1" { "" } else { reading.unit })
            .column("holds", |reading| reading.holds().label())
            .build();
        without_repeats(table, own)
    }

    fn boundaries(&self) -> Table {
        let distance = |boundary: &Boundary| {
            let at = nearest(&boundary.answer, boundary.value)?;
            Some(NumberText(signed(at - boundary.value)))
        };
        let mut table = Table::of(&self.first().boundaries)
            .column("parameter", |boundary| boundary.parameter.title())
            .column("value", |boundary| boundary.value);
        // Without reference drivers there is no answer that could change.
        if !self.first().verdicts.reference_drivers.is_empty() {
            table = table.column("changes at", becomes).column(Column::from("distance").null("–"), distance);
        }
        table
            .columns(
                ModelId::ALL.iter().enumerate(),
                |(_, model)| format!("{} at", model.name()),
                |boundary, (at, _)| boundary.models.get(at).map(change),
            )
            .build()
    }

    /// Where the case comes from, if from a file, the case, and the answer.
    fn head(&self) -> String {
        let synthetic = if self.is_synthetic { "SYNTHETIC DATA: " } else { "" };
        let origin = self.identity.file_sha256.as_ref().map_or(String::new(), |_| format!("{}:\n", self.origin));
        format!("{synthetic}{origin}{}\n{}\n", self.case(), self.answer())
    }

    /// The answer on one screen.
    pub fn brief(&self) -> String {
        let sentences = self.demand().into_iter().chain(self.silent()).chain(self.cautions());
        let sentences: String = sentences.map(|sentence| indented(&sentence)).collect();
        let ([drivers, _], boundaries) = (self.drivers_by_profile(), self.boundaries().text());
        let (head, drivers, [full, sheet]) = (self.head(), drivers.text(), ["full", "sheet"].map(option));
        format!(
            "{head}{sentences}{drivers}Where another answer begins, all else equal; the last columns: another collision\n{boundaries}\
             Other profiles, clauses, readings and hashes: {full}, or a page to print: {sheet}\n"
        )
    }

    /// The sheet as text.
    pub fn text(&self) -> String {
        let numbers: String = self.numbers().iter().map(|(name, number)| format!("  {name}: {number}\n")).collect();
        let cautions = self.rule().into_iter().chain(self.cautions()).map(|caution| indented(&caution));
        let unwrapped = self.demand().into_iter().chain(self.silent()).map(|sentence| format!("  {sentence}\n"));
        let (head, sentences, profile) =
            (self.head(), unwrapped.chain(cautions).collect::<String>(), &self.first().profile);
        let [drivers, clauses, boundaries] =
            [self.drivers(), self.clauses(), self.boundaries()].map(|table| table.text());
        let of_drivers = wrap(&format!("Drivers. {DRIVERS}"), WIDTH);
        let of_boundaries = wrap(&format!("Where the answer changes under {profile}. {BOUNDARIES}"), WIDTH);
        let (by_rule, identity) = (self.by_rule_text(), self.identity_text());
        format!(
            "{head}{sentences}{numbers}\n{of_drivers}\n{drivers}\nClauses under {profile}\n{clauses}\n{of_boundaries}\n\
             {boundaries}{by_rule}\n{identity}"
        )
    }

    /// A row per driver and profile, per constant, and per rule.
    pub fn tables(&self) -> Vec<NamedTable> {
        let profiles = Table::of(self.judged())
            .column("profile", |(of, _)| of.profile.as_str())
            .column("verdict", |(of, _)| of.verdict().label())
            .column("model", |(_, judged)| judged.trace.model.name())
            .column("braking_s", |(_, judged)| judged.braking_s())
            .column("changes_with", |(_, judged)| judged.flips.join(", "))
            .column("is_contact_like", |(_, judged)| judged.touches);
        let profiles = with_outcomes(profiles.build(), self.judged().map(|(_, judged)| &judged.trace));
        let tables =
            [("profiles", profiles), ("assumptions", assumptions(&self.profiles[0])), ("by_rule", self.rule_rows())];
        tables.map(|(name, table)| (name.to_owned(), table)).into()
    }

    /// The sheet as one document.
    ///
    /// # Errors
    /// None for a sheet of this program.
    pub fn json(&self) -> Result<String> {
        records::document(&record! {
            answer: self.answer(),
            assumptions: records::sorted(&self.profiles[0].assumptions()),
            by_rule: self.rule_rows().records(),
            case: self.case_numbers(),
            category: self.subject.category().key(),
            cautions: self.cautions(),
            data: &self.origin,
            demand: self.demand(),
            identity: self.identity_record()?,
            not_considered: NOT_CONSIDERED.map(|(what, how)| format!("{what}: {how}")),
            profiles: self.judgements.iter().zip(self.profiles).map(judged_record).collect::<Vec<_>>(),
            program: PROGRAM,
            rule: self.rule(),
            silent: self.silent(),
            synthetic: self.is_synthetic,
            verdict: self.first().verdict().label(),
        })
    }

    /// The figure of the case under the first profile, step by step, with the answer.
    fn figure(&self) -> TraceFigure<'_> {
        let first = self.first();
        let series = first
            .models
            .iter()
            .map(|judged| TraceSeries { name: judged.trace.model.name().to_owned(), trace: &judged.trace });
        let synthetic = if self.is_synthetic { "SYNTHETIC DATA. " } else { "" };
        TraceFigure {
            title: format!("{} under {}: {}", self.subject.category().label(), first.profile, first.verdict().label()),
            subtitle: Some(format!("{synthetic}{}. {}.", self.case(), self.answer())),
            series: series.collect(),
            until_s: None,
        }
    }

    /// The sheet as a page.
    pub fn html(&self) -> String {
        let first = self.first();
        let mut warnings = Vec::new();
        if first.verdict() == Verdict::Undecided {
            warnings.push(format!("{}.", self.answer()));
        }
        let case = Section::new("case", "Case").facts(self.numbers());
        let preventable = match &first.verdicts.reference_drivers[..] {
            [] => format!("{} has no reference drivers: it does not say what is preventable.", first.profile),
            drivers => format!(
                "A collision is preventable where one of the reference drivers ({}) avoids it. Where nothing collides \
                 even if the ego never reacts, there is no conflict.",
                drivers.iter().map(|model| model.name()).collect::<Vec<_>>().join(" or ")
            ),
        };
        let [of_first, of_others] = self.drivers_by_profile();
        let notes = [
            ("drivers", self.rule()),
            ("demand", self.demand()),
            ("readings", self.silent()),
            ("limits", self.cautions()),
        ];
        let notes = notes.into_iter().filter(|(_, sentences)| !sentences.is_empty());
        let answer = Section::new("answer", "Answer")
            .fact("answer", first.verdict().label())
            .fact("rule", preventable)
            .facts(notes.map(|(name, sentences)| (name, sentences.join(".\n") + ".")));
        let drivers = Section::new("drivers", "Drivers").intro(format!("{DRIVERS}.")).tables([of_first]);
        let others = Section::new("others", "Other profiles")
            .intro(format!("Columns as above. Changes with: what turns the collision verdict, of {VARIED}."))
            .tables([of_others]);
        let clauses = Section::new("clauses", "Clauses")
            .intro(format!(
                "What the clauses say of the case, with the numbers of {}; then the conditions of other clauses of \
                 cut-ins that differ from these.",
                first.profile
            ))
            .tables([self.clauses().captioned("Clauses")]);
        let boundaries = Section::new("boundary", "Distance to another answer")
            .intro(format!("{BOUNDARIES}."))
            .tables([self.boundaries().captioned("Distance to the boundary")]);
        let above = TraceFigure { subtitle: None, ..self.figure() };
        let course = Section::new("course", "Course of the case")
            .intro(self.recorded_motion().unwrap_or_default())
            .figures([self.figure().svg(), above.positions().svg()].map(|svg| PageFigure::new(&svg, &[])));
        // The profile's constants are a table for people; this is a copy for programs.
        let assumptions = self
            .assumptions_section()
            .parts([Section::options(format!("Profile {}", first.profile), &self.profiles[0])]);
        Page {
            title: format!("One {} under {}, case {}", self.subject.category().label(), first.profile, self.mark()),
            lead: format!("{}. {}.", self.case(), self.answer()),
            synthetic: self.is_synthetic,
            warnings,
            app: None,
            sections: [answer, case, drivers, self.identity_section(), self.identity.signatures(), course, others]
                .into_iter()
                .chain(self.by_rule_section())
                .chain([clauses, boundaries])
                .chain([self.numerics_section(), assumptions, CaseIdentity::not_considered()])
                .collect(),
        }
        .html()
    }
}

/// What a profile says of the case, for programs.
fn judged_record<'a>((judgement, profile): (&'a Judgement, &'a Profile)) -> impl Serialize + use<'a> {
    let names = |models: &[ModelId]| models.iter().map(|model| model.name()).collect::<Vec<_>>();
    let models = judgement.models.iter().map(|judged| {
        let mut outcome = outcome_record(&judged.trace.outcome, judged.trace.dt_s);
        outcome.insert("model".to_owned(), judged.trace.model.name().into());
        outcome.insert("braking_s".to_owned(), judged.braking_s().into());
        outcome.insert("changes_with".to_owned(), judged.flips.clone().into());
        outcome.insert("is_contact_like".to_owned(), judged.touches.into());
        outcome
    });
    let clauses = judgement.readings.iter().map(|reading| {
        record! {
            clause: &reading.clause,
            condition: reading.quantity,
            holds: reading.holds().label(),
            relation: reading.relation.sign(),
            t_s: reading.time_s,
            then: reading.then,
            threshold: json_number(reading.threshold),
            unit: reading.unit,
            value: reading.value.map(json_number),
        }
    });
    let boundaries = judgement.boundaries.iter().map(|boundary| {
        let models = ModelId::ALL.iter().zip(&boundary.models);
        let [below, above] = boundary.becomes.map(|verdict| verdict.map(Verdict::label));
        record! {
            answer_becomes: record! { above: above, below: below },
            answer_changes_at: ends(&boundary.answer),
            collision_changes_at: models.map(|(model, at)| (model.name(), ends(at))).collect::<BTreeMap<_, _>>(),
            parameter: boundary.parameter.key,
            searched: boundary.range,
            value: boundary.value,
        }
    });
    let is_answer = matches!(judgement.verdict(), Verdict::Answer(_) | Verdict::Undecided);
    record! {
        avoided_by: names(&judgement.avoiders()),
        boundaries: boundaries.collect::<Vec<_>>(),
        changes_with: &judgement.flips,
        clause: &judgement.clause,
        clauses: clauses.collect::<Vec<_>>(),
        contact_like: names(&judgement.touching),
        demand_changes_with: &judgement.demand_flips,
        demanded: judgement.demand(),
        drives_through_s: judgement.drives_through_s,
        dt_s: profile.frame.dt_s,
        finer_step: CaseSheet::finer_record(judgement),
        models: models.collect::<Vec<_>>(),
        nominal_answer: is_answer.then(|| judgement.verdicts.answer().label()),
        outside_annex_3: &judgement.outside_annex,
        profile: &judgement.profile,
        sha256: profile_sha256(profile).unwrap_or_default(),
        silent: &judgement.silent,
        time_cap_s: profile.frame.time_cap_s,
        verdict: judgement.verdict().label(),
    }
}

/// The collision verdict of a driver in a word.
pub(super) fn verdict_of(judgement: &Judgement, judged: &Judged) -> &'static str {
    match (judged.collides(), judged.touches) {
        (true, _) => "COLLIDES",
        (false, true) => "touches",
        (false, false) => match judgement.verdicts.unreacting {
            RunEnd::Contact => "avoids",
            RunEnd::Open if judged.trace.outcome.verdicts.capped() => "open",
            RunEnd::Open | RunEnd::Clear => "none",
        },
    }
}

/// Removes rows from index `first` on that repeat an earlier row except for the first cell: profiles have most drivers
/// in common, clauses most conditions.
fn without_repeats(mut table: Table, first: usize) -> Table {
    let (_, shown) = table.shown();
    let is_new = |at: usize| at < first || shown[..at].iter().all(|known| known[1..] != shown[at][1..]);
    let mut at = 0..;
    table.rows.retain(|_| at.next().is_some_and(is_new));
    table
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

/// The boundary at which the answer changes, and the new answer.
fn becomes(boundary: &Boundary) -> String {
    let ends = [boundary.answer.below, boundary.answer.above].into_iter().zip(boundary.becomes);
    let named = ends.filter_map(|(at, answer)| Some(format!("{}: {}", value(at?), answer?.label())));
    let named: Vec<String> = named.collect();
    if named.is_empty() { "–".to_owned() } else { named.join(", ") }
}

fn ends(change: &Change) -> impl Serialize + use<> {
    record! { above: change.above, below: change.below }
}

/// A number with its sign.
pub(super) fn signed(number: f64) -> String {
    format!("{}{}", if number < 0.0 { "-" } else { "+" }, value(number.abs()))
}
