//! Which failures come from headways below 0.5 s: a table used by study, comparison and sampling.

use super::tables::wrap;
use crate::engine::{CLOSE_HEADWAY_S, Headway};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::close_following::CloseFollowing;
use crate::scenario::Category;
use crate::support::readable::{count, value};
use crate::support::table::{NumberText, Table};

/// The counts of one category.
pub(super) struct CloseRow<'a> {
    pub category: Category,
    pub models: &'a [ModelId],
    pub close: &'a CloseFollowing,
}

/// A sentence about what is counted, then a row per category and criterion with such a headway; empty without counts.
/// `of_whom` says whose failures these are.
pub(super) fn close_following(rows: &[CloseRow], of_whom: &str, headways: &[Headway], width: usize) -> String {
    let Some(first) = rows.first() else { return String::new() };
    let cells = rows.iter().flat_map(|row| Criterion::ALL.map(|criterion| (row, criterion)));
    let text = |(row, criterion): (&CloseRow, Criterion), model: usize| {
        let of = (model < row.models.len())
            .then(|| row.close.failures.get(model * Criterion::ALL.len() + criterion.index()))
            .flatten();
        match of {
            Some([_, 0]) | None => NumberText("-".to_owned()),
            Some([close, all]) => NumberText(format!("{} of {}", count(*close), count(*all))),
        }
    };
    let cells = Table::of(cells)
        .column("scenario", |(row, _)| row.category.label())
        .column("criterion", |(_, criterion)| criterion.label())
        .columns(0..first.models.len(), |model| first.models[model].name(), text)
        .build();
    let [close, all] =
        rows.iter().fold([0, 0], |[close, all], row| [close + row.close.close_lanes, all + row.close.lanes]);
    let percent = value(100.0 * close as f64 / all.max(1) as f64);
    let thw_s = CLOSE_HEADWAY_S;
    let whence = match headways.iter().filter(|h| matches!(h, Headway::ThwS(s) if *s < thw_s)).count() {
        _ if Headway::is_observed(headways) => {
            format!("{} of {} recorded headways are below it", count(close), count(all))
        }
        imposed if imposed > 0 => format!(
            "{imposed} of the {} imposed headways are below it ({percent} % of the simulations), whatever was recorded",
            headways.len()
        ),
        _ => format!("{percent} % of the simulations start below it"),
    };
    let sentence = format!("Failures of {of_whom} from headways below {thw_s} s, of all its failures: {whence}.");
    let cells = if close > 0 { cells.text() } else { String::new() };
    format!("{}\n{cells}", wrap(&sentence, width))
}
