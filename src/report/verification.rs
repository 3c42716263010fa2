//! A verification as text for the terminal.

use std::fmt::Write;

use serde::Serialize;

use crate::lanes::outcome_record;
use crate::records::record;
use lanesweep_engine::verify::{Comparison, DifferingLane, GroupComparison};
use lanesweep_engine::{Outcome, words};
use lanesweep_model::criterion::Criterion;
use lanesweep_support::readable::{count, value};
use lanesweep_support::table::{NumberText, Table};

/// One set of lanes: what was compared per category and model, and the differences.
pub fn comparison(comparison: &Comparison) -> String {
    let share = |tally: &GroupComparison, criterion: Criterion| {
        let mark = if tally.tests(criterion) { "" } else { "*" };
        NumberText(format!("{:.1}{mark}", 100.0 * tally.share(criterion)))
    };
    let shares = [(Criterion::Collision, "fail: coll %"), (Criterion::Ttc, "TTC %"), (Criterion::Btn, "BTN %")];
    let rows = Table::of(&comparison.tallies)
        .column("scenario", |tally| tally.category.label())
        .column("model", |tally| tally.model.name())
        .column("lanes", |tally| tally.lanes)
        .columns(shares, |(_, name)| name, |tally, (criterion, _)| share(tally, criterion))
        .column("steps", |tally| tally.steps as f64 / tally.lanes.max(1) as f64)
        .column("words ≠", |tally| tally.words_differing)
        .column("verdicts ≠", |tally| tally.verdicts_differing)
        .column("f32≠f64", |tally| tally.reference_differing)
        .build();
    let mut text = format!("{} (plan {})\n{}", comparison.set, &comparison.plan_sha256[..12], rows.text());
    let is_tested = |tally: &GroupComparison| Criterion::ALL.iter().all(|criterion| tally.tests(*criterion));
    if !comparison.tallies.iter().all(is_tested) {
        text += "* outside 5–95 %: these lanes hardly test this criterion\n";
    }
    if comparison.modes_differing > 0 {
        let _ = writeln!(text, "{} verdicts differ if only verdicts are requested", count(comparison.modes_differing));
    }
    for lane in &comparison.worst {
        let _ = writeln!(text, "  {} differs in {}", lane.key, lane.names().join(", "));
    }
    comparison.worst.first().map_or(text.clone(), |worst| text + &lane(worst))
}

/// The same as [`comparison`], as JSON.
pub fn record(comparison: &Comparison, dt_s: f64) -> impl Serialize + use<> {
    let tallies = Table::of(&comparison.tallies)
        .column("category", |tally| tally.category.key())
        .column("model", |tally| tally.model.name())
        .column("lanes", |tally| tally.lanes)
        .column("steps", |tally| tally.steps)
        .column("lanes_differing", |tally| tally.lanes_differing)
        .column("words_differing", |tally| tally.words_differing)
        .column("verdicts_differing", |tally| tally.verdicts_differing)
        .column("reference_differing", |tally| tally.reference_differing)
        .columns(Criterion::ALL, |of| format!("{}_failures", of.key()), |tally, of| tally.failed[of.index()])
        .build();
    let worst = comparison.worst.iter().map(|lane| {
        record! {
            cpu: outcome_record(&lane.cpu, dt_s),
            lane: lane.key.clone(),
            under_test: outcome_record(&lane.tested, dt_s),
            words: lane.names(),
        }
    });
    record! {
        equal: comparison.is_equal(),
        modes_differing: comparison.modes_differing,
        plan_sha256: comparison.plan_sha256.clone(),
        set: comparison.set.clone(),
        tallies: tallies.records(),
        worst: worst.collect::<Vec<_>>(),
    }
}

/// The words of a lane on the CPU and on the device.
fn lane(lane: &DifferingLane) -> String {
    let outcomes = [lane.cpu, lane.tested];
    let (all, shown) = (outcomes.map(|o| words(&o)), outcomes.map(|o| shown(&o)));
    let word = |at: usize, k: usize| {
        let mark = if k == 0 || all[0][at] == all[1][at] { "" } else { "  ≠" };
        NumberText(format!("{}{mark}", shown[k][at]))
    };
    let names = ["CPU, f32", "under test"];
    let rows =
        Table::of(0..all[0].len()).column("word", |at| all[0][at].0).columns(0..2, |k| names[k].to_owned(), word);
    format!("{}\n{}", lane.key, rows.build().text())
}

/// The words for people. Numbers have all digits, because a difference may be in the last one.
fn shown(o: &Outcome<f64>) -> [String; 17] {
    let number = |v: f64| if v.is_finite() { v.to_string() } else { value(v) };
    let step = |step: u32| if step == u32::MAX { "never".to_owned() } else { step.to_string() };
    [
        format!("{:04b}", o.verdicts.0),
        format!("{} ({})", o.contact.code(), o.contact.label()),
        o.contact_with.to_string(),
        format!("{:?}", o.end),
        step(o.reaction_step),
        step(o.contact_step),
        step(o.end_step),
        number(o.impact_speed),
        number(o.impact_closing_speed),
        number(o.min_ttc),
        number(o.max_btn),
        number(o.min_gap),
        number(o.min_thw),
        number(o.max_drac),
        o.tet_steps.to_string(),
        number(o.tit),
        o.pet.map_or_else(|| "none".to_owned(), number),
    ]
}
