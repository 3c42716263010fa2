//! Results of another simulator for the same cases, compared with a driver's lanes row by row. A difference is explained
//! by the first quantity, in the order of cause and effect, that differs.

use super::subject::Subject;
use crate::Result;
use crate::engine::{StepMark, Trace};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::stats::estimate::{Interval, clopper_pearson};

/// A quantity that two simulators can compare.
pub struct Compared {
    /// Column of the results, with its unit.
    pub column: &'static str,
    /// What it is, as the subject of a sentence.
    pub words: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Differences up to this are none: a time step of the other simulator, or its rounding.
    pub tolerance: f64,
    of: fn(&Trace) -> Option<f64>,
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn time_s(trace: &Trace, mark: StepMark) -> Option<f64> {
    trace.step_of(mark).map(|step| trace.time_s(step))
}

/// The smallest gap, m. Vehicles that touch have no gap left.
fn min_gap_m(trace: &Trace) -> Option<f64> {
    match trace.step_of(StepMark::Contact) {
        Some(_) => Some(trace.outcome.min_gap.min(0.0)),
        None => finite(trace.outcome.min_gap),
    }
}

const fn compared(
    (column, unit): (&'static str, &'static str),
    words: &'static str,
    tolerance: f64,
    of: fn(&Trace) -> Option<f64>,
) -> Compared {
    Compared { column, words, unit, tolerance, of }
}

/// The quantities, a cause before its effects.
#[rustfmt::skip] // a table: one line per quantity
pub const COMPARED: [Compared; 6] = [
    compared(("reaction_s", "s"), "the driver's first reaction", 0.05, |trace| time_s(trace, StepMark::Reaction)),
    compared(("braking_s", "s"), "the beginning of the braking", 0.05, |trace| time_s(trace, StepMark::Braking)),
    compared(("min_gap_m", "m"), "the smallest gap", 0.1, min_gap_m),
    compared(("min_ttc_s", "s"), "the smallest TTC", 0.05, |trace| finite(trace.outcome.min_ttc)),
    compared(("contact_s", "s"), "the contact", 0.05, |trace| time_s(trace, StepMark::Contact)),
    compared(("impact_speed_mps", "m/s"), "the ego's speed at the contact", 0.2, |trace| {
        trace.step_of(StepMark::Contact).map(|_| trace.outcome.impact_speed)
    }),
];

/// One row of the other simulator.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TheirResult {
    /// The case's id.
    pub id: String,
    /// Whether the vehicles touch.
    pub collides: bool,
    /// The values of [`COMPARED`] where the table has them.
    pub values: [Option<f64>; COMPARED.len()],
}

/// One case, theirs and ours.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedCase {
    /// The case's id.
    pub id: String,
    /// Whether the vehicles touch here, and there.
    pub collides: [bool; 2],
    /// Per quantity: theirs minus ours, where both have it.
    pub differences: [Option<f64>; COMPARED.len()],
    /// Index of the first quantity that differs by more than its tolerance, or that only they have.
    pub decides: Option<usize>,
    /// Per quantity, whether we have it and they have it.
    has: [[bool; 2]; COMPARED.len()],
}

/// A quantity over all cases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Index in [`COMPARED`].
    pub quantity: usize,
    /// Cases in which both have it.
    pub cases: usize,
    /// Cases in which it differs by more than the tolerance.
    pub beyond: usize,
    /// Cases in which only we have it, and in which only they have it.
    pub only: [usize; 2],
    /// Minimum, median and maximum of theirs minus ours; `None` if no case has both.
    pub range: Option<[f64; 3]>,
}

/// All cases.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultComparison {
    /// The driver.
    pub model: ModelId,
    /// In the order of the results.
    pub cases: Vec<ComparedCase>,
    /// The quantities that their table has, in the order of [`COMPARED`].
    pub differences: Vec<Difference>,
}

impl ResultComparison {
    /// Compares results with the lanes of a driver, in binary64; a pair per case that both have. `given`: the quantities that
    /// their table has.
    ///
    /// # Errors
    /// As [`Subject::lane`].
    pub fn new(
        pairs: &[(&Subject, &TheirResult)],
        given: [bool; COMPARED.len()],
        profile: &Profile,
        model: ModelId,
    ) -> Result<ResultComparison> {
        let cases = pairs.iter().map(|(subject, theirs)| {
            let trace = subject.lane(profile, subject.point())?.trace(profile, subject.category(), model);
            Ok(ComparedCase::of(&trace, theirs))
        });
        let cases: Vec<ComparedCase> = cases.collect::<Result<_>>()?;
        let difference = |(quantity, compared): (usize, &Compared)| {
            let mut all: Vec<f64> = cases.iter().filter_map(|case| case.differences[quantity]).collect();
            all.sort_by(f64::total_cmp);
            let beyond = all.iter().filter(|by| by.abs() > compared.tolerance).count();
            let range = all.first().zip(all.last()).map(|(min, max)| [*min, all[all.len() / 2], *max]);
            let alone = |who: usize| {
                cases.iter().filter(|case| case.has[quantity][who] && !case.has[quantity][1 - who]).count()
            };
            given[quantity].then(|| Difference {
                quantity,
                cases: all.len(),
                beyond,
                only: [alone(0), alone(1)],
                range,
            })
        };
        let differences = COMPARED.iter().enumerate().filter_map(difference).collect();
        Ok(ResultComparison { model, cases, differences })
    }

    /// Whether nothing differs in any case.
    pub fn is_equal(&self) -> bool {
        self.cases.iter().all(|case| case.decides.is_none() && case.collides[0] == case.collides[1])
    }

    /// Cases with the same answer to whether the vehicles touch.
    pub fn agreeing(&self) -> usize {
        self.cases.iter().filter(|case| case.collides[0] == case.collides[1]).count()
    }

    /// The interval of the fraction that agrees, if the cases are a random sample of those that matter.
    pub fn agreement(&self) -> Interval {
        let (cases, agreeing) = (self.cases.len() as u64, self.agreeing() as u64);
        clopper_pearson(agreeing, cases, 0.95)
    }

    /// The first quantity, in the order of cause and effect, that differs beyond its tolerance in most of the cases.
    pub fn cause(&self) -> Option<&Difference> {
        self.differences.iter().find(|difference| 2 * difference.beyond > difference.cases)
    }
}

impl ComparedCase {
    fn of(trace: &Trace, theirs: &TheirResult) -> ComparedCase {
        let ours = COMPARED.each_ref().map(|compared| (compared.of)(trace));
        let differences = std::array::from_fn(|k| Some(theirs.values[k]? - ours[k]?));
        let differs = |k: &usize| match (theirs.values[*k], ours[*k]) {
            (Some(theirs), Some(ours)) => (theirs - ours).abs() > COMPARED[*k].tolerance,
            // A table without the column says nothing; an empty field of an event does.
            (theirs, _) => theirs.is_some(),
        };
        let collides = [trace.step_of(StepMark::Contact).is_some(), theirs.collides];
        let decides = (0..COMPARED.len()).find(differs);
        let has = std::array::from_fn(|k| [ours[k].is_some(), theirs.values[k].is_some()]);
        ComparedCase { id: theirs.id.clone(), collides, differences, decides, has }
    }
}
