//! Distance of a case from the boundary at which the answer changes: one number varies, all others stay. A scan, fine near
//! the case, finds the nearest change on either side; bisection then refines the value, and its values count for the answer
//! and for every driver. At least one change lies between the case and that value. Two changes between neighbouring values
//! are missed.

use super::subject::Subject;
use super::{CaseVerdicts, StepBudget, Verdict};
use crate::grid::{CaseQuantity, MapParameter, PARAMETERS};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_support::Result;

/// Number of evenly spaced values on each side, and of values whose distances grow from the resolution on.
const SCANNED: u32 = 100;
const NEAR: u32 = 30;

/// Varied quantities: name, minimum and maximum, resolution, all in the unit of the name.
const VARIED: [(&str, f64, f64, f64); 8] = [
    ("gap_m", 0.0, 300.0, 0.01),
    ("thw_s", 0.0, 10.0, 0.001),
    ("ego_speed_kmh", 0.0, 250.0, 0.01),
    ("other_speed_kmh", 0.0, 250.0, 0.01),
    ("lateral_speed_mps", 0.05, 5.0, 0.001),
    ("deceleration_mps2", 0.0, 15.0, 0.001),
    ("ahead_gap_m", 0.0, 300.0, 0.01),
    ("ahead_speed_kmh", 0.0, 250.0, 0.01),
];

/// Nearest values on both sides at which a verdict changes; `None` if it stays the same to the end of the range.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Change {
    /// Below the case's value.
    pub below: Option<f64>,
    /// Above it.
    pub above: Option<f64>,
}

/// One parameter of the case.
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// The parameter; all values have its unit.
    pub parameter: &'static MapParameter,
    /// Value of the case.
    pub value: f64,
    /// Range that is searched.
    pub range: (f64, f64),
    /// Values at which the answer changes.
    pub answer: Change,
    /// The answer below and above.
    pub becomes: [Option<Verdict>; 2],
    /// The same for every model, in the order of [`ModelId::ALL`].
    pub models: Vec<Change>,
}

/// The boundaries along all numbers of a case.
pub(super) fn boundaries(subject: &Subject, profile: &Profile, budget: &StepBudget) -> Result<Vec<Boundary>> {
    let mut found = Vec::new();
    for (key, min, max, resolution) in VARIED {
        let Some(parameter) = PARAMETERS.iter().find(|parameter| parameter.key == key) else { continue };
        let Some(si) = subject.point().get(parameter.quantity) else { continue };
        // An acceleration is outside the axis of decelerations.
        if parameter.quantity == CaseQuantity::Deceleration && si < 0.0 {
            continue;
        }
        let value = si * parameter.per_si;
        // `None` for a value that makes no case, and once the budget is spent.
        let verdicts = |value: f64| {
            let point = subject.point().with(parameter.quantity, parameter.si(value));
            let lane = subject.lane(profile, &point).ok().filter(|_| !budget.is_spent())?;
            Some(super::verdicts(&lane, &point, profile, subject.category(), budget))
        };
        let side = |end: f64| -> Vec<(f64, CaseVerdicts)> {
            let range = end - value;
            let step = range.abs() / f64::from(SCANNED);
            let even = (0..=SCANNED).map(|k| step * f64::from(k));
            let near = (0..NEAR).map(|k| resolution * libm::pow(step / resolution, f64::from(k) / f64::from(NEAR)));
            let mut distances: Vec<f64> = even.chain(near.filter(|_| step > resolution)).collect();
            distances.sort_by(f64::total_cmp);
            // The first value is that of the case; an invalid case ends the scan.
            let values = distances.into_iter().map(|distance| value + distance.copysign(range));
            values.map_while(|value| Some((value, verdicts(value)?))).collect()
        };
        let mut sides = [side(min.min(value)), side(max.max(value))];
        let mut answers = [None, None];
        let mut models = Vec::new();
        // The values that one bisection adds are seen by the others in the second pass.
        for _ in 0..2 {
            answers = nearest(&mut sides, resolution, &verdicts, &CaseVerdicts::verdict);
            let of_model = |model: &ModelId| {
                change_of(&nearest(&mut sides, resolution, &verdicts, &|verdicts| verdicts.collides(*model)))
            };
            models = ModelId::ALL.iter().map(of_model).collect();
        }
        found.push(Boundary {
            parameter,
            value,
            range: (min.min(value), max.max(value)),
            answer: change_of(&answers),
            becomes: answers.map(|found| found.map(|(_, answer)| answer)),
            models,
        });
        budget.check()?;
    }
    Ok(found)
}

/// The nearest values below and above at which a result changes, and the result there. The values of the bisection are added
/// to the scanned ones.
fn nearest<T: PartialEq>(
    sides: &mut [Vec<(f64, CaseVerdicts)>; 2],
    resolution: f64,
    verdicts: &dyn Fn(f64) -> Option<CaseVerdicts>,
    of: &dyn Fn(&CaseVerdicts) -> T,
) -> [Option<(f64, T)>; 2] {
    sides.each_mut().map(|side| {
        let case = of(&side.first()?.1);
        let mut at = (1..side.len()).find(|&at| of(&side[at].1) != case)?;
        while (side[at].0 - side[at - 1].0).abs() > resolution {
            let middle = (side[at].0 + side[at - 1].0) / 2.0;
            let Some(found) = verdicts(middle) else { break };
            let is_same = of(&found) == case;
            side.insert(at, (middle, found));
            at += usize::from(is_same);
        }
        Some(((side[at].0 / resolution).round() * resolution, of(&side[at].1)))
    })
}

fn change_of<T>([below, above]: &[Option<(f64, T)>; 2]) -> Change {
    let at = |found: &Option<(f64, T)>| found.as_ref().map(|(at, _)| *at);
    Change { below: at(below), above: at(above) }
}
