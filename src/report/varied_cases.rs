//! Tables of concrete cases as `check` and `simulate` read them.

use crate::run::check::{Subject, VariedCase};
use crate::scenario::{CaseNumber, CaseQuantity, NUMBERS, NamedNumber};
use crate::support::table::Table;

/// The numbers of the cases, with the columns of every table of cases.
pub fn case_table(cases: &[VariedCase]) -> Table {
    let names = NamedNumber::names();
    let has = |number: &CaseNumber| cases.iter().any(|case| value(&case.subject, number.quantity).is_some());
    let columns = NUMBERS.iter().zip(&names).filter(|(number, _)| has(number));
    Table::of(cases)
        .column("id", |case| case.id.as_str())
        .column("category", |case| case.subject.category().key())
        .columns(columns, |(_, name)| name.clone(), |case, (number, _)| value(&case.subject, number.quantity))
        .build()
}

/// A number of a case as tables have it: an acceleration, not a deceleration.
fn value(subject: &Subject, quantity: CaseQuantity) -> Option<f64> {
    let value = subject.point().get(quantity);
    match quantity {
        CaseQuantity::Deceleration => value.map(|mps2| 0.0 - mps2),
        CaseQuantity::Duration => subject.duration_s(),
        _ => value,
    }
}
