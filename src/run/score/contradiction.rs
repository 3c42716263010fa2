//! Whether counts can be those of a plan's lanes: every lane of S' has one of S beside it, and every variant is compared
//! with the same S.

use crate::engine::{Confusion, LanePlan, Partial, UnitCounts};
use crate::model::criterion::Criterion;

/// What is wrong with the counts of a partial that has as many units as the plan; `None` where nothing is.
pub(super) fn contradiction(plan: &LanePlan, partial: &Partial) -> Option<String> {
    let units = partial.units();
    if let Some((at, unit)) = (0..).zip(units).find(|(at, unit)| unit.unit != *at) {
        return Some(format!("unit {} stands where unit {at} is expected", unit.unit));
    }
    if !partial.fits(plan) {
        return Some("a unit has other variants, models or criteria than the plan".to_owned());
    }
    let of_units =
        units.iter().find_map(|unit| of_unit(unit, plan).map(|problem| format!("unit {}: {problem}", unit.unit)));
    let by_headway = || (!partial.adds_up(plan)).then(|| "failures by headway do not add up".to_owned());
    of_units.or_else(by_headway)
}

/// The same for one unit, whose counts are as many as they must be.
fn of_unit(unit: &UnitCounts, plan: &LanePlan) -> Option<String> {
    let (headways, per_variant) = (plan.headways.len() as u64, plan.models.len() * Criterion::ALL.len());
    let sum = |counts: &[u32]| counts.iter().map(|&count| u64::from(count)).sum::<u64>();
    if let Some(capped) = unit.capped.iter().find(|&&capped| u64::from(capped) > headways) {
        return Some(format!("{capped} of {headways} lanes ended at the time cap"));
    }
    unit.cells.iter().enumerate().find_map(|(at, cell)| {
        let Confusion { tp, fn_, fp, tn } = *cell;
        let lanes = sum(&[tp, fn_, fp, tn]);
        if lanes != headways {
            return Some(format!("{lanes} lanes of {headways} headways"));
        }
        if at < per_variant && (fn_ > 0 || fp > 0) {
            return Some("S does not agree with itself".to_owned());
        }
        let failures = u64::from(unit.cells[at % per_variant].tp);
        let here = sum(&[tp, fn_]);
        (here != failures).then(|| format!("S fails {failures} times by itself and {here} times beside S'"))
    })
}
