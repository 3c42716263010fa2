//! A verification as text for the terminal.

use std::fmt::Write;

use super::tables::{aligned, table};
use crate::engine::verify::{Comparison, WORDS};
use crate::engine::{Outcome, words};
use crate::model::criterion::Criterion;
use crate::support::readable::{count, value};

/// One set of lanes: per category and model what was compared, and what differs.
pub fn comparison(comparison: &Comparison) -> String {
    let header =
        ["scenario", "model", "lanes", "fail: coll %", "TTC %", "BTN %", "steps", "words ≠", "verdicts ≠", "f32≠f64"];
    let mut rows = table(header.map(str::to_owned).to_vec());
    let mut untested = Vec::new();
    for tally in &comparison.tallies {
        let share = |criterion: Criterion| {
            let mark = if tally.tests(criterion) { "" } else { "*" };
            format!("{:.1}{mark}", 100.0 * tally.share(criterion))
        };
        if Criterion::ALL.iter().any(|c| !tally.tests(*c)) {
            untested.push(tally.model);
        }
        let mut row = vec![tally.category.label().to_owned(), tally.model.name().to_owned(), count(tally.lanes)];
        row.extend(Criterion::ALL.map(share));
        row.push(value(tally.steps as f64 / tally.lanes.max(1) as f64));
        row.extend([tally.words_differing, tally.verdicts_differing, tally.reference_differing].map(count));
        rows.add_row(row);
    }
    let mut text = format!("{} (plan {})\n{}", comparison.set, &comparison.plan_sha256[..12], aligned(rows, 2));
    if !untested.is_empty() {
        text += "* outside 5–95 %: these lanes hardly test this criterion\n";
    }
    if comparison.modes_differing > 0 {
        let _ = writeln!(text, "{} verdicts differ if only verdicts are requested", count(comparison.modes_differing));
    }
    for lane in &comparison.worst {
        let _ = writeln!(text, "  {} differs in {}", lane.key, lane.names().join(", "));
    }
    if !comparison.worst.is_empty() {
        text += "  run one again, word by word: `verify` with its key and the same options\n";
    }
    text
}

/// The same as [`comparison`], as JSON.
pub fn record(comparison: &Comparison) -> serde_json::Value {
    let tallies = comparison.tallies.iter().map(|tally| {
        let mut record = serde_json::json!({
            "category": tally.category.key(),
            "model": tally.model.name(),
            "lanes": tally.lanes,
            "steps": tally.steps,
            "lanes_differing": tally.lanes_differing,
            "words_differing": tally.words_differing,
            "verdicts_differing": tally.verdicts_differing,
            "reference_differing": tally.reference_differing,
        });
        for criterion in Criterion::ALL {
            record[format!("{}_failures", criterion.key())] = tally.failed[criterion.index()].into();
        }
        record
    });
    let worst = comparison.worst.iter().map(|lane| serde_json::json!({"lane": lane.key, "words": lane.names()}));
    serde_json::json!({
        "set": comparison.set,
        "plan_sha256": comparison.plan_sha256,
        "equal": comparison.is_equal(),
        "modes_differing": comparison.modes_differing,
        "tallies": tallies.collect::<Vec<_>>(),
        "worst": worst.collect::<Vec<_>>(),
    })
}

/// One lane's words on each backend, side by side.
pub fn lane(key: &str, names: [&str; 3], outcomes: &[Outcome<f64>; 3]) -> String {
    let mut rows = table(["word"].into_iter().chain(names).map(str::to_owned).collect());
    let all = outcomes.map(|o| words(&o));
    let shown = outcomes.map(|o| shown(&o));
    for (at, name) in WORDS.into_iter().enumerate() {
        let mark = if all[2][at] == all[1][at] { "" } else { "  ≠" };
        let cells = shown.iter().enumerate().map(|(k, v)| format!("{}{}", v[at], if k == 2 { mark } else { "" }));
        rows.add_row(std::iter::once(name.to_owned()).chain(cells));
    }
    format!("{key}\n{}", aligned(rows, 1))
}

/// The words as people read them. Numbers with every digit: a difference may be in the last one.
fn shown(o: &Outcome<f64>) -> [String; 12] {
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
    ]
}
