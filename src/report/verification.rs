//! A verification as text for the terminal.

use serde::Serialize;

use crate::lanes::outcome_record;
use crate::records::record;
use lanesweep_engine::verify::{Comparison, DifferingLane, GroupComparison};
use lanesweep_model::criterion::Criterion;
use lanesweep_support::readable::count;
use lanesweep_support::table::{NumberText, Table};

/// One set of lanes: what was compared per category and model, and the differences.
pub fn comparison(comparison: &Comparison, dt_s: f64) -> String {
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
        text += &format!("{} verdicts differ if only verdicts are requested\n", count(comparison.modes_differing));
    }
    for lane in &comparison.worst {
        text += &format!("  {} differs in {}\n", lane.key, lane.names().join(", "));
    }
    text + &comparison.worst.first().map_or(String::new(), |worst| lane(worst, dt_s))
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

/// How a lane ended on the CPU and on the device, with all digits, because a difference may be in the last one. The line
/// above names every word that differs: −0, and the speeds of a contact that did not happen, show no ≠.
fn lane(DifferingLane { key, cpu, tested }: &DifferingLane, dt_s: f64) -> String {
    let [cpu, tested] = [cpu, tested].map(|outcome| {
        let mut record = outcome_record(outcome, dt_s);
        record.insert("contact_with".to_owned(), outcome.contact_with.into());
        record.insert("end".to_owned(), format!("{:?}", outcome.end).into());
        record
    });
    let rows = Table::of(cpu.iter().zip(tested.values()))
        .column("value", |((name, _), _)| name.as_str())
        .column("CPU, f32", |((_, cpu), _)| NumberText(cpu.to_string()))
        .column("under test", |((_, cpu), tested)| {
            NumberText(format!("{tested}{}", if cpu == tested { "" } else { "  ≠" }))
        });
    format!("{key}\n{}", rows.build().text())
}
