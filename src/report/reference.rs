//! The comparison of the lane arithmetic with the f64 reference, as text and as a table.

use crate::model::criterion::Criterion;
use crate::run::study::ReferenceComparison;
use crate::support::readable::{count, count_of};
use crate::support::table::Table;

/// One line for the terminal, and the first differences.
pub fn text(comparison: &ReferenceComparison) -> String {
    let mut text = format!(
        "f32 against the f64 reference: {} of {} verdicts differ ({} lanes; the cap differs in {})\n",
        count_of(comparison.differences.len()),
        count(comparison.lanes * Criterion::ALL.len() as u64),
        count(comparison.lanes),
        count(comparison.cap_differs)
    );
    for d in comparison.differences.iter().take(20) {
        let side = if d.failed_in_f32 { "fails in f32 only" } else { "fails in f64 only" };
        text += &format!("  {} {}: {side}, {:.3e} from the threshold\n", d.lane, d.criterion.label(), d.distance);
    }
    text
}

/// All differences, one per row.
pub fn table(comparison: &ReferenceComparison) -> Table {
    Table::of(&comparison.differences)
        .column("lane", |of| of.lane.as_str())
        .column("criterion", |of| of.criterion.key())
        .column("failed_in_f32", |of| u8::from(of.failed_in_f32))
        .column("distance_to_threshold", |of| of.distance)
        .build()
}
