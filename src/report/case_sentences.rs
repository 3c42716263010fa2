//! The leading sentences of a sheet: the case and its reading, the answer, and the demands of the cut-in clauses.

use super::case_sheet::CaseSheet;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::{CaseQuantity, Category, KMH, SPEED_ERROR_MPS};
use lanesweep_run::check::{Answer, Demand, Holds, Judged, Judgement, Subject, Verdict};
use lanesweep_run::grid::VARIED;
use lanesweep_support::readable::{exact, value};

/// The clause of a leader that brakes.
pub(super) const CLAUSE_OF_LEADERS: &str = "UN R157, 5.2.5.1 still holds, whatever the drivers of Annex 3 do: the system has \
     to avoid a collision with a leader that brakes up to its full performance";

impl CaseSheet<'_> {
    /// The case in one line, with the deciding reading: speeds along the road in km/h, other values in SI units.
    pub(super) fn case(&self) -> String {
        let point = self.subject.point();
        let quantities = [
            (CaseQuantity::EgoSpeed, "ego"),
            (CaseQuantity::OtherSpeed, "other vehicle"),
            (CaseQuantity::Gap, "gap"),
            (CaseQuantity::Thw, "headway"),
            (CaseQuantity::LateralSpeed, "across"),
            (CaseQuantity::Deceleration, "other vehicle's deceleration"),
            (CaseQuantity::EndSpeed, "to"),
            (CaseQuantity::AheadSpeed, "vehicle ahead"),
            (CaseQuantity::AheadGap, "its gap"),
        ];
        let parts = quantities.into_iter().filter_map(|(quantity, name)| {
            let si = point.get(quantity)?;
            Some(match quantity {
                CaseQuantity::Deceleration if si < 0.0 => {
                    format!("other vehicle's acceleration {}", self.number(quantity, -si))
                }
                _ => format!("{name} {}", self.number(quantity, si)),
            })
        });
        let first = self.first();
        let reading = format!("{} under {} ({})", self.subject.category().label(), first.profile, first.danger);
        format!("{reading}: {}", parts.collect::<Vec<_>>().join(", "))
    }

    /// A number of the case with its unit, so that it can be repeated from paper; a recorded one cannot.
    pub(super) fn number(&self, quantity: CaseQuantity, si: f64) -> String {
        let number = quantity.number();
        let (unit, per_si) = if number.needs_unit() { ("km/h", KMH) } else { (number.unit(), 1.0) };
        match self.subject {
            Subject::Plain(..) => format!("{} {unit}", exact(si, per_si)),
            Subject::Recorded(..) => format!("{} {unit}", value(si * per_si)),
        }
    }

    /// The answer in one sentence; "robust" is used only if it holds for every verdict named, and says what varied.
    pub(super) fn answer(&self) -> String {
        let first = self.first();
        let (answer, references) = (first.verdicts.answer(), &first.verdicts.reference_drivers);
        let (avoided_by, collide) = (first.verdicts.avoided_by(), first.verdicts.collided_by());
        let drivers = match (answer, &avoided_by[..], &collide[..]) {
            (Answer::Open, ..) => past_the_cap(first),
            (Answer::NoConflict, _, []) => {
                "nothing collides even if the ego never reacts, until the gap no longer closes".to_owned()
            }
            (Answer::NoConflict, _, all) => format!(
                "an ego that never reacts does not collide; {} react{} and collide{}",
                names(all),
                s(all),
                s(all)
            ),
            (_, [], all) => format!("{} collide", names(all)),
            (_, all, []) => format!("{} avoid{} the collision", names(all), s(all)),
            (_, one, other) => {
                format!("{} avoid{} the collision, {} collide{}", names(one), s(one), names(other), s(other))
            }
        };
        let verdict = first.verdict();
        match verdict {
            Verdict::OutsideAnnex => {
                let reason = first.outside_annex.as_deref().unwrap_or_default();
                return format!(
                    "{} under {}: {reason}. Its drivers give no answer here (computed all the same: {drivers})",
                    verdict.label(),
                    first.profile
                );
            }
            Verdict::NotJudged => {
                return format!(
                    "{}: profile {} has no reference drivers, so it does not say what is preventable",
                    verdict.label(),
                    first.profile
                );
            }
            _ => {}
        }
        let is_split = answer == Answer::Preventable && !collide.is_empty();
        let suffices = if is_split { "; one that avoids suffices (ours)" } else { "" };
        let changes = |flips: &[&str]| flips.join(", ");
        let is_named = |_: &&ModelId| answer != Answer::NoConflict || !collide.is_empty();
        let of_drivers = references.iter().filter(is_named).filter_map(|model| {
            let flips = first.flips_of(*model);
            (!flips.is_empty()).then(|| format!("the verdict of {} changes with {}", model.name(), changes(flips)))
        });
        let mut of_drivers: Vec<String> = of_drivers.collect();
        if !first.annex_flips.is_empty() {
            of_drivers.push(format!("the case leaves Annex 3 with {}", changes(&first.annex_flips)));
        }
        if !first.reading_turns.is_empty() {
            let names = names(&first.reading_turns);
            of_drivers.push(format!("the verdict of {names} rests on a reading where Annex 3 is silent"));
        }
        of_drivers.extend(touching(first));
        of_drivers.extend(drives_through(first.drives_through_s));
        let robustness = match (&first.flips[..], &of_drivers[..]) {
            _ if answer == Answer::Open => "longer runs are not computed".to_owned(),
            ([], _) if first.reading_turns_answer => {
                "no change listed below alters it, but another reading where Annex 3 is silent does".to_owned()
            }
            ([], of_drivers) if first.rests_on_touching() => {
                format!("the answer rests on it: {}", of_drivers.join("; "))
            }
            ([], []) if !first.open_with.is_empty() => format!(
                "robust within the {} s of a run: with {} the gap still closes at its end",
                value(first.time_cap_s),
                changes(&first.open_with)
            ),
            ([], []) => "robust: no change listed below alters it".to_owned(),
            ([], of_drivers) => format!("the answer is robust; {}", of_drivers.join("; ")),
            (flips, _) => format!("the answer changes with {}", changes(flips)),
        };
        format!("{} under {}: {drivers}{suffices} ({robustness})", verdict.label(), first.profile)
    }

    /// What limits the answer: the changes that *robust* refers to, a Brake Threat Number above 1 of a driver that avoids,
    /// and vehicles that drive through one another.
    pub(super) fn cautions(&self) -> Vec<String> {
        let first = self.first();
        let above = |judged: &&Judged| !judged.collides() && !judged.touches && judged.trace.outcome.max_btn > 1.0;
        let above: Vec<&str> = first.models.iter().filter(above).map(|judged| judged.trace.model.name()).collect();
        let mut all =
            vec![format!("Robust refers to these changes, each alone, as far as the case has the input: {VARIED}")];
        all.extend(self.doubts.iter().map(|doubt| format!("Implausible input: {doubt}")));
        if !above.is_empty() {
            all.push(format!(
                "A BTN above 1 does not contradict an avoided collision ({}): it asks whether braking that begins at that \
                 instant still suffices, while the driver brakes already",
                above.join(", ")
            ));
        }
        all
    }

    /// Readings for which the regulation is silent and another choice changes the answer.
    pub(super) fn silent(&self) -> Vec<String> {
        self.first().silent.iter().map(|sentence| format!("Rests on a reading: {sentence}")).collect()
    }

    /// What the cut-in clauses demand of the system, each clause once, and where the first profile's clause and the
    /// drivers disagree.
    pub(super) fn demand(&self) -> Vec<String> {
        let of_others = self.other_clauses().filter_map(demand_of);
        self.demand_of_first().into_iter().chain(of_others).chain(self.clause_of_leaders()).collect()
    }

    /// What the recorded motion shows, in a sentence; `None` for a case of plain numbers.
    pub(super) fn recorded_motion(&self) -> Option<String> {
        let Subject::Recorded(scenario, _) = self.subject else { return None };
        let end_s = scenario.target.v.len().saturating_sub(1) as f64 / scenario.fps;
        Some(format!(
            "The other vehicles move as recorded, at {} samples per second until {} s; after that they keep speed and \
             lateral position.",
            value(scenario.fps),
            value(end_s)
        ))
    }

    /// The clause of a leader that brakes, which names no driver.
    fn clause_of_leaders(&self) -> Option<String> {
        let brakes = match self.subject {
            Subject::Plain(_, point) => point.get(CaseQuantity::Deceleration).is_some_and(|a| a > 0.0),
            Subject::Recorded(scenario, _) => {
                let v = &scenario.target.v;
                v.iter().any(|later| later + SPEED_ERROR_MPS < v[0])
            }
        };
        (self.subject.category() == Category::Lvd && brakes)
            .then(|| format!("{CLAUSE_OF_LEADERS} (its conditions are not tested here)"))
    }

    fn demand_of_first(&self) -> Vec<String> {
        let first = self.first();
        let (Some(demand), Some(sentence)) = (first.demand(), demand_of(first)) else { return Vec::new() };
        let (mut sentences, clause) = (vec![sentence], &first.clause);
        // A verdict decided by rounding is not a disagreement.
        if !first.demand_flips.is_empty() || matches!(first.verdict(), Verdict::Undecided | Verdict::NotJudged) {
            return sentences;
        }
        let model_collides = first.verdicts.collides(ModelId::Reg157);
        let model =
            format!("Reg157, the model of the clause, {}", if model_collides { "collides" } else { "avoids it" });
        match (demand, first.verdicts.answer()) {
            (Demand::Avoid, Answer::NotPreventable) => sentences.push(format!(
                "Clause and drivers disagree: {clause} demands what CCHDM and FSM do not achieve; {model}"
            )),
            (Demand::Avoid, Answer::Preventable) if model_collides => {
                sentences.push(format!("Clause and model disagree: {clause} demands an avoidance, and {model}"));
            }
            (Demand::Avoid, Answer::NoConflict) => {
                sentences.push(format!("The conditions of {clause} hold, but there is no collision to avoid"));
            }
            (Demand::Nothing, Answer::Preventable) => sentences.push(format!(
                "{clause} makes no demand here; that does not mean unavoidable: a driver of Annex 3 avoids the collision"
            )),
            _ => {}
        }
        sentences
    }
}

fn names(list: &[ModelId]) -> String {
    list.iter().map(|model| model.name()).collect::<Vec<_>>().join(" and ")
}

/// The ending of a verb after a list of drivers.
fn s(list: &[ModelId]) -> &'static str {
    if list.len() > 1 { "" } else { "s" }
}

/// Which reference drivers avoid the collision by a gap that is not distinguishable from a contact.
pub(super) fn touching(judgement: &Judgement) -> Option<String> {
    let is_named = |model: &ModelId| judgement.touching.contains(model);
    let touching: Vec<ModelId> = judgement.verdicts.avoided_by().into_iter().filter(is_named).collect();
    let is_some = judgement.verdicts.answer() == Answer::Preventable && !touching.is_empty();
    is_some.then(|| {
        let s = s(&touching);
        format!("{} stop{s} so close that the time step does not tell it from a contact", names(&touching))
    })
}

/// Why a case cannot be traffic.
pub(super) fn drives_through(time_s: Option<f64>) -> Option<String> {
    let time_s = value(time_s?);
    Some(format!("no such traffic: the vehicle that cuts out drives through the one ahead of it from {time_s} s on"))
}

/// How a run ends whose gap still closes at the cap.
pub(super) fn past_the_cap(judgement: &Judgement) -> String {
    let cap_s = value(judgement.time_cap_s);
    format!("no contact within the {cap_s} s of a run, at whose end the gap still closes")
}

/// What the clause of a profile demands; `None` if it does not cover this kind of scenario.
fn demand_of(judgement: &Judgement) -> Option<String> {
    let clause = &judgement.clause;
    let quantities = |holds: Holds| {
        let of_kind = judgement.conditions().filter(move |reading| reading.holds() == holds);
        of_kind.map(|reading| {
            let is = match (reading.value, reading.time_s) {
                (Some(v), _) => format!("is {} {}", value(v), reading.unit),
                (None, Some(_)) => "does not exist, because the other vehicle is behind the ego then".to_owned(),
                (None, None) => "does not happen".to_owned(),
            };
            let (sign, threshold) = (reading.relation.sign(), value(reading.threshold));
            format!("{} {is}; the clause applies where it is {sign} {threshold} {}", reading.quantity, reading.unit)
        })
    };
    let listed = |holds| quantities(holds).collect::<Vec<_>>().join("; ");
    Some(match (judgement.demand()?, &judgement.demand_flips[..]) {
        (Demand::Avoid, []) => {
            let robust = if judgement.reading_turns_demand {
                "lane intrusion by a front tyre 0.1 m within the box turns this"
            } else {
                "robust"
            };
            format!("{clause}: the system has to avoid the collision ({robust})")
        }
        (Demand::Nothing, []) => format!("{clause}: no demand: {}", listed(Holds::No)),
        (Demand::Unknown, []) => format!(
            "{clause}: unknown whether the system has to avoid the collision, because the case begins after the movement \
             or the lane intrusion began. Of what the case shows: {}",
            listed(Holds::Unknown)
        ),
        (_, flips) => {
            format!("{clause}: undecided: what the clause demands changes with {}", flips.join(", "))
        }
    })
}
