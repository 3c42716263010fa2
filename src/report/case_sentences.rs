//! The leading sentences of a sheet: the case and its reading, the answer, and the demands of the cut-in clauses.

use super::case_sheet::{CaseSheet, KMH};
use crate::model::driver::ModelId;
use crate::run::check::{Answer, Judgement, REFERENCE_DRIVERS, Verdict};
use crate::run::grid::{MapQuantity, PARAMETERS};
use crate::support::readable::value;

/// Perturbations that a robust verdict survives.
pub(super) const VARIED: &str = "a tenth of the time step, 1 cm of gap, 0.1 km/h of a speed";

impl CaseSheet<'_> {
    /// The case in one line, with the deciding reading: speeds along the road in km/h, other values in SI units.
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
        let first = self.first();
        let reading = format!("{} under {} ({})", self.subject.category().label(), first.profile, first.danger);
        format!("{reading}: {}", parts.collect::<Vec<_>>().join(", "))
    }

    /// The answer in one sentence; "robust" is used only if it holds for every verdict named.
    pub fn answer(&self) -> String {
        let first = self.first();
        let names = |list: &[ModelId]| list.iter().map(|m| m.name()).collect::<Vec<_>>().join(" and ");
        let answer = first.verdicts.answer();
        let avoided_by = first.verdicts.avoided_by();
        let collide: Vec<ModelId> = REFERENCE_DRIVERS.into_iter().filter(|m| !avoided_by.contains(m)).collect();
        let drivers = match (answer, &avoided_by[..], &collide[..]) {
            (Answer::NoConflict, _, []) => "nothing collides even if the ego never reacts".to_owned(),
            (Answer::NoConflict, _, all) => format!(
                "an ego that never reacts does not collide; {} {} and collide{}",
                names(all),
                if all.len() > 1 { "react" } else { "reacts" },
                if all.len() > 1 { "" } else { "s" }
            ),
            (_, [], all) => format!("{} collide", names(all)),
            (_, all, []) => format!("{} avoid the collision", names(all)),
            (_, one, other) => format!("{} avoids the collision, {} collides", names(one), names(other)),
        };
        let changes = |flips: &[&str]| flips.join(", ");
        let is_named = |_: &ModelId| answer != Answer::NoConflict || !collide.is_empty();
        let of_drivers = REFERENCE_DRIVERS.into_iter().filter(is_named).filter_map(|model| {
            let flips = first.flips_of(model);
            (!flips.is_empty()).then(|| format!("the verdict of {} changes with {}", model.name(), changes(flips)))
        });
        let mut of_drivers: Vec<String> = of_drivers.collect();
        if !first.annex_flips.is_empty() {
            of_drivers.push(format!("the case leaves Annex 3 with {}", changes(&first.annex_flips)));
        }
        if let (Verdict::OutsideAnnex, Some(reason)) = (first.verdict(), &first.outside_annex) {
            return format!("{}: {reason}. Its drivers give no answer here ({drivers})", first.verdict().label());
        }
        let robustness = match (&first.flips[..], &of_drivers[..]) {
            ([], []) => format!("robust: {VARIED} change none of it"),
            ([], of_drivers) => format!("the answer is robust; {}", of_drivers.join("; ")),
            (flips, _) => format!("the answer changes with {}", changes(flips)),
        };
        format!("{}: {drivers} ({robustness})", first.verdict().label())
    }

    /// Readings for which the regulation is silent and another choice changes the answer.
    pub fn silent(&self) -> Vec<String> {
        self.first()
            .silent
            .iter()
            .map(|sentence| format!("Rests on a reading where Annex 3 is silent: {sentence}"))
            .collect()
    }

    /// What the cut-in clauses demand of the system, each clause once, and where the first profile's clause and the
    /// drivers disagree.
    pub fn demand(&self) -> Vec<String> {
        let mut sentences = self.demand_of_first();
        let mut clauses = vec![&self.first().clause];
        for judgement in &self.judgements[1..] {
            if !clauses.contains(&&judgement.clause) {
                sentences.extend(demand_of(judgement));
                clauses.push(&judgement.clause);
            }
        }
        sentences
    }

    fn demand_of_first(&self) -> Vec<String> {
        let first = self.first();
        let (Some(is_demanded), Some(demand)) = (first.is_demanded(), demand_of(first)) else { return Vec::new() };
        let (mut sentences, clause) = (vec![demand], &first.clause);
        // A verdict decided by rounding is not a disagreement.
        if !first.demand_flips.is_empty() || first.verdict() == Verdict::Undecided {
            return sentences;
        }
        let model_collides = first.verdicts.collides(ModelId::Reg157);
        let model =
            format!("Reg157, the model of the clause, {}", if model_collides { "collides" } else { "avoids it" });
        match (is_demanded, first.verdicts.answer()) {
            (true, Answer::NotPreventable) => sentences.push(format!(
                "Clause and drivers disagree: {clause} demands what CCHDM and FSM do not achieve; {model}"
            )),
            (true, Answer::Preventable) if model_collides => {
                sentences.push(format!("Clause and model disagree: {clause} demands an avoidance, and {model}"));
            }
            (true, Answer::NoConflict) => {
                sentences.push(format!("The conditions of {clause} hold, but there is no collision to avoid"));
            }
            (false, Answer::Preventable) => sentences.push(format!(
                "{clause} makes no demand here; that does not mean unavoidable: a driver of Annex 3 avoids the collision"
            )),
            _ => {}
        }
        sentences
    }
}

/// What the clause of a profile demands; `None` if it does not cover this kind of scenario.
fn demand_of(judgement: &Judgement) -> Option<String> {
    let clause = &judgement.clause;
    let unmet = judgement.unmet().map(|reading| {
        let is = reading.value.map_or("does not happen".to_owned(), |v| format!("is {} {}", value(v), reading.unit));
        let (sign, threshold) = (reading.relation.sign(), value(reading.threshold));
        format!("{} {is}, and has to be {sign} {threshold} {}", reading.quantity, reading.unit)
    });
    let unmet: Vec<String> = unmet.collect();
    Some(match (judgement.is_demanded()?, &judgement.demand_flips[..]) {
        (true, []) => format!("{clause}: the system has to avoid the collision (robust)"),
        (false, []) => format!("{clause}: no demand: {}", unmet.join("; ")),
        (_, flips) => {
            format!(
                "{clause}: undecided: whether the system has to avoid the collision changes with {}",
                flips.join(", ")
            )
        }
    })
}
