//! Lanes step by step, as `simulate` shows them: figure, table, document and summaries.

use super::{TraceFigure, TraceSeries, table};
use crate::lanes::{outcome_record, with_outcomes};
use crate::records::{self, PROGRAM, record};
use lanesweep_engine::{EndReason, NO_STEP, Outcome, Trace};
use lanesweep_model::criterion::Criterion;
use lanesweep_run::reopen::{TracedLane, TracedLanes};
use lanesweep_support::Result;
use lanesweep_support::readable::value;
use lanesweep_support::run_folder::NamedTable;
use lanesweep_support::table::Table;

/// Lanes step by step, as figure, table, document and text.
pub struct TraceReport<'a>(pub &'a TracedLanes);

impl TraceReport<'_> {
    /// The lanes on one sheet, up to a time, s, or 2 s after the last decisive event.
    pub fn figure(&self, until_s: Option<f64>) -> TraceFigure<'_> {
        let (lanes, first) = (&self.0.lanes, &self.0.lanes[0]);
        let category = first.trace.category.label();
        let title = match lanes.len() {
            // The lanes of one case, by their drivers.
            _ if !first.key.contains('/') => format!("{category}, initial gap {} m", value(first.trace.initial_gap_m)),
            1 => format!("{category}: {}", first.key),
            many => format!("{category}: {} and {} more", first.key, many - 1),
        };
        let synthetic =
            if self.0.is_synthetic && !self.0.origin.contains("SYNTHETIC") { "SYNTHETIC DATA; " } else { "" };
        let series =
            self.0.lanes.iter().map(|lane| TraceSeries { name: lane.name.clone(), trace: &lane.trace }).collect();
        let subtitle = Some(format!("{synthetic}{}", self.0.origin));
        TraceFigure { title, subtitle, series, until_s }
    }

    /// Every step as CSV.
    pub fn csv(&self) -> String {
        table(&self.named()).csv()
    }

    /// A row per lane, and one per step.
    pub fn tables(&self) -> Vec<NamedTable> {
        let lanes = Table::of(&self.0.lanes)
            .column("lane", |lane| lane.key.as_str())
            .column("category", |lane| lane.trace.category.key())
            .column("model", |lane| lane.trace.model.name())
            .column("initial_gap_m", |lane| lane.trace.initial_gap_m);
        let lanes = with_outcomes(lanes.build(), self.0.lanes.iter().map(|lane| &lane.trace));
        vec![("lanes".to_owned(), lanes), ("steps".to_owned(), table(&self.named()))]
    }

    /// Outcomes and series as one document.
    ///
    /// # Errors
    /// None for a document of this program.
    pub fn json(&self) -> Result<String> {
        let lanes = self.0.lanes.iter().map(|lane| {
            record! {
                category: lane.trace.category.key(),
                initial_gap_m: lane.trace.initial_gap_m,
                lane: &lane.key,
                model: lane.trace.model.name(),
                outcome: outcome_record(&lane.trace.outcome, lane.trace.dt_s),
                reference: lane.reference.as_ref().map(|reference| outcome_record(reference, lane.trace.dt_s)),
            }
        });
        records::document(&record! {
            data: &self.0.origin,
            lanes: lanes.collect::<Vec<_>>(),
            program: PROGRAM,
            steps: table(&self.named()).records(),
            synthetic: self.0.is_synthetic,
        })
    }

    /// How the lanes ended, in words.
    pub fn text(&self) -> String {
        self.0.lanes.iter().map(|lane| summary(lane, self.0.lanes.len() > 1)).collect()
    }

    fn named(&self) -> Vec<(String, &Trace)> {
        self.0.lanes.iter().map(|lane| (lane.key.clone(), &lane.trace)).collect()
    }
}

/// How a lane ended, in words.
fn summary(lane: &TracedLane, is_one_of_many: bool) -> String {
    let TracedLane { key, trace, reference, .. } = lane;
    let time = |step: u32| match step {
        NO_STEP => "never".to_owned(),
        step => format!("{} s", value(trace.time_s(step))),
    };
    let outcome = &trace.outcome;
    let name = if is_one_of_many { format!("{key}: ") } else { String::new() };
    let (category, model, verdicts) = (trace.category.label(), trace.model.name(), verdicts(outcome));
    let ([reacted, last], end) =
        ([outcome.reaction_step, outcome.end_step].map(time), end(outcome, trace.contact_label()));
    let ttc = outcome.approach_ttc().map_or("–".to_owned(), |ttc_s| format!("{} s", value(ttc_s)));
    let [gap_m, btn, least_m] = [trace.initial_gap_m, outcome.max_btn, records::smallest_gap_m(outcome)].map(value);
    let mut text = format!(
        "{name}{category} {model}, initial gap {gap_m} m: {verdicts}\n  reacted: {reacted}  end: {last} ({end})\n  \
         min TTC {ttc}, max BTN {btn}, min gap {least_m} m\n"
    );
    if let Some(reference) = reference {
        text += &match &differences(outcome, reference, &time)[..] {
            [] => "  f64: the same verdicts, contact and times\n".to_owned(),
            list => format!("  f64 DIFFERS: {}\n", list.join("; ")),
        };
    }
    text
}

fn verdicts(outcome: &Outcome<f64>) -> String {
    let verdict = |c: Criterion| format!("{} {}", c.label(), if outcome.verdicts.failed(c) { "FAIL" } else { "pass" });
    Criterion::ALL.map(verdict).join(", ")
}

fn end(outcome: &Outcome<f64>, contact: &str) -> String {
    match outcome.end {
        EndReason::Contact => {
            let [closing, ego] = [outcome.impact_closing_speed, outcome.impact_speed].map(value);
            format!("{contact}, closing at {closing} m/s, the ego at {ego} m/s")
        }
        EndReason::Settled => "no further event is possible".to_owned(),
        EndReason::Standstill => "the ego is stationary".to_owned(),
        EndReason::Cap => "time cap".to_owned(),
        EndReason::Aborted => "aborted at a large TTC (jrc-2021)".to_owned(),
    }
}

/// Differences of the reference from the lane arithmetic. Values differ in their last digits and are not compared.
fn differences(ours: &Outcome<f64>, reference: &Outcome<f64>, time: &dyn Fn(u32) -> String) -> Vec<String> {
    let mut list = Vec::new();
    if ours.verdicts != reference.verdicts {
        list.push(verdicts(reference));
    }
    if ours.reaction_step != reference.reaction_step {
        list.push(format!("reacted: {}", time(reference.reaction_step)));
    }
    let how = |o: &Outcome<f64>| (o.end, o.end_step, o.contact, o.contact_with, o.contact_step);
    if how(ours) != how(reference) {
        list.push(format!("end: {} ({})", time(reference.end_step), end(reference, reference.contact.label())));
    }
    list
}
