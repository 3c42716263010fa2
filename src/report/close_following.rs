//! Which failures come from headways below 0.5 s, as a table that study, comparison and sampling share.

use super::tables::{aligned, table, wrap};
use crate::engine::{CLOSE_HEADWAY_S, Headway};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::close_following::CloseFollowing;
use crate::scenario::Category;
use crate::support::readable::{count, value};

/// The counts of one category.
pub(super) struct CloseRow<'a> {
    pub category: Category,
    pub models: &'a [ModelId],
    pub close: &'a CloseFollowing,
}

/// The sentence that says what was counted, then a row per category and criterion where there is such a headway; empty
/// without counts. `of_whom` says
/// whose failures these are.
pub(super) fn close_following(rows: &[CloseRow], of_whom: &str, headways: &[Headway], width: usize) -> String {
    let Some(first) = rows.first() else { return String::new() };
    let mut header = ["scenario", "criterion"].map(str::to_owned).to_vec();
    header.extend(first.models.iter().map(|model| model.name().to_owned()));
    let mut cells = table(header);
    for CloseRow { category, models, close } in rows {
        for criterion in Criterion::ALL {
            let of = |model: usize| close.failures.get(model * Criterion::ALL.len() + criterion.index());
            let text = |model: usize| match of(model) {
                Some([_, 0]) | None => "-".to_owned(),
                Some([close, all]) => format!("{} of {}", count(*close), count(*all)),
            };
            let mut row = vec![category.label().to_owned(), criterion.label().to_owned()];
            row.extend((0..models.len()).map(text));
            cells.add_row(row);
        }
    }
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
    let cells = if close > 0 { aligned(cells, 2) } else { String::new() };
    format!("{}\n{cells}", wrap(&sentence, width))
}
