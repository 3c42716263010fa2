//! The sentences that lead a sheet: the case, the answer, what 5.2.5.2 demands.

use super::case_sheet::{CaseSheet, KMH};
use crate::model::driver::ModelId;
use crate::run::check::{Answer, REFERENCE_DRIVERS, Verdict};
use crate::run::grid::{MapQuantity, PARAMETERS};
use crate::support::readable::value;

/// What a robust verdict survives.
pub(super) const VARIED: &str = "half the time step, 1 cm of gap, 0.1 km/h of a speed";

impl CaseSheet<'_> {
    /// The case in one line: speeds along the road in km/h, all else in SI units.
    pub fn case(&self) -> String {
        let point = self.subject.point();
        let kmh = |name: &str, mps: f64| format!("{name} {} km/h", value(mps * KMH));
        let quantities = [
            (MapQuantity::EgoSpeed, "ego"),
            (MapQuantity::OtherSpeed, "other vehicle"),
            (MapQuantity::Gap, "gap"),
            (MapQuantity::Thw, "headway"),
            (MapQuantity::LateralSpeed, "across"),
            (MapQuantity::Deceleration, "other vehicle's deceleration"),
            (MapQuantity::EndSpeed, "to"),
            (MapQuantity::AheadSpeed, "vehicle ahead"),
            (MapQuantity::AheadGap, "its gap"),
        ];
        let parts = quantities.into_iter().filter_map(|(quantity, name)| {
            let si = point.get(quantity)?;
            let unit = PARAMETERS.iter().find(|parameter| parameter.quantity == quantity)?.unit;
            Some(match unit {
                "m/s" | "km/h" if quantity != MapQuantity::LateralSpeed => kmh(name, si),
                unit => format!("{name} {} {unit}", value(si)),
            })
        });
        format!("{}: {}", self.subject.category().label(), parts.collect::<Vec<_>>().join(", "))
    }

    /// The answer in one sentence; "robust" stands only where it holds for every verdict that is named.
    pub fn answer(&self) -> String {
        let first = self.first();
        let names = |list: &[ModelId]| list.iter().map(|m| m.name()).collect::<Vec<_>>().join(" and ");
        let answer = first.verdicts.answer();
        let avoided_by = first.verdicts.avoided_by();
        let collide: Vec<ModelId> = REFERENCE_DRIVERS.into_iter().filter(|m| !avoided_by.contains(m)).collect();
        let drivers = match (answer, &avoided_by[..], &collide[..]) {
            (Answer::NoConflict, ..) => "nothing collides even if the ego never reacts".to_owned(),
            (_, [], all) => format!("{} collide", names(all)),
            (_, all, []) => format!("{} avoid the collision", names(all)),
            (_, one, other) => format!("{} avoids the collision, {} collides", names(one), names(other)),
        };
        let changes = |flips: &[&str]| flips.join(", ");
        let of_drivers = REFERENCE_DRIVERS.into_iter().filter(|_| answer != Answer::NoConflict).filter_map(|model| {
            let flips = first.flips_of(model);
            (!flips.is_empty()).then(|| format!("the verdict of {} changes with {}", model.name(), changes(flips)))
        });
        let of_drivers: Vec<String> = of_drivers.collect();
        let robustness = match (&first.flips[..], &of_drivers[..]) {
            ([], []) => format!("robust: {VARIED} change none of it"),
            ([], of_drivers) => format!("the answer is robust; {}", of_drivers.join("; ")),
            (flips, _) => format!("the answer changes with {}", changes(flips)),
        };
        format!("{}: {drivers} (profile {}; {robustness})", first.verdict().label(), first.profile)
    }

    /// What 5.2.5.2 demands of the system, where it says something of this kind of scenario, and where that and the
    /// drivers disagree.
    pub fn demand(&self) -> Vec<String> {
        let first = self.first();
        let Some(is_demanded) = first.is_demanded() else { return Vec::new() };
        let unmet = first.unmet().map(|reading| {
            let is =
                reading.value.map_or("does not happen".to_owned(), |v| format!("is {} {}", value(v), reading.unit));
            let (sign, threshold) = (reading.relation.sign(), value(reading.threshold));
            format!("{} {is}, and has to be {sign} {threshold} {}", reading.quantity, reading.unit)
        });
        let unmet: Vec<String> = unmet.collect();
        let mut sentences = vec![match (is_demanded, &first.demand_flips[..]) {
            (true, []) => "5.2.5.2: the system has to avoid the collision (robust)".to_owned(),
            (false, []) => format!("5.2.5.2: no demand: {}", unmet.join("; ")),
            (_, flips) => format!(
                "5.2.5.2: undecided: whether the system has to avoid the collision changes with {}",
                flips.join(", ")
            ),
        }];
        // What rounding decides is no disagreement.
        if !first.demand_flips.is_empty() || first.verdict() == Verdict::Undecided {
            return sentences;
        }
        let model_collides = first.verdicts.collides(ModelId::Reg157);
        let model =
            format!("Reg157, the model of the clause, {}", if model_collides { "collides" } else { "avoids it" });
        match (is_demanded, first.verdicts.answer()) {
            (true, Answer::NotPreventable) => sentences.push(format!(
                "Clause and drivers disagree: 5.2.5.2 demands what CCHDM and FSM do not achieve; {model}"
            )),
            (true, Answer::Preventable) if model_collides => {
                sentences.push(format!("Clause and model disagree: 5.2.5.2 demands an avoidance, and {model}"));
            }
            (true, Answer::NoConflict) => {
                sentences.push("The conditions of 5.2.5.2 hold, but there is no collision to avoid".to_owned());
            }
            (false, Answer::Preventable) => sentences.push(
                "5.2.5.2 makes no demand here; that does not mean unavoidable: a driver of Annex 3 avoids the collision"
                    .to_owned(),
            ),
            _ => {}
        }
        sentences
    }
}
