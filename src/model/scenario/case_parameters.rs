//! A concrete case from the few numbers that a user gives: on the command line, in a file, or in a row of a table.

use std::ops::{Index, IndexMut};

use super::case_quantity::CaseQuantity::{self, Gap, Thw};
use super::case_quantity::{CaseNumber, NUMBERS, SPEED_ERROR_MPS};
use super::units::{self, Written};
use super::{Category, LANE_WIDTH_M, PlainCase, check_headway};
use crate::plausibility::{Doubts, HELP, NEAR_M, Quantity};
use lanesweep_support::table::{NameUnit, Resolved, resolve};
use lanesweep_support::{Error, Place, Result, option, readable};

/// The given values; speeds in m/s, lengths in m, accelerations in m/s², times in s. A quantity is its index:
/// `parameters[CaseQuantity::Gap]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CaseParameters {
    /// Kind of scenario, by name.
    pub category: Option<String>,
    /// By [`CaseQuantity`].
    pub numbers: [Option<f64>; NUMBERS.len()],
}

impl Index<CaseQuantity> for CaseParameters {
    type Output = Option<f64>;

    fn index(&self, quantity: CaseQuantity) -> &Option<f64> {
        &self.numbers[quantity as usize]
    }
}

impl IndexMut<CaseQuantity> for CaseParameters {
    fn index_mut(&mut self, quantity: CaseQuantity) -> &mut Option<f64> {
        &mut self.numbers[quantity as usize]
    }
}

/// A number of a case under the name that a user gives it: its key, with or without its unit at the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedNumber {
    at: usize,
    unit: NameUnit,
}

impl NamedNumber {
    /// Finds the number of a name; `None` if there is none.
    ///
    /// # Errors
    /// [`Error::Usage`] for a unit that the number cannot have.
    pub fn find(name: &str) -> Result<Option<NamedNumber>> {
        match resolve(name, &NUMBERS.each_ref().map(CaseNumber::named)) {
            Resolved::Field(at, unit) => Ok(Some(NamedNumber { at, unit })),
            Resolved::WrongUnit(problem, help) => Err(Error::usage(Place::item(name), problem, help)),
            Resolved::Unknown => Ok(None),
        }
    }

    /// The number of [`NUMBERS`] at an index, whose name has this unit.
    pub(crate) fn at(at: usize, unit: NameUnit) -> NamedNumber {
        NamedNumber { at, unit }
    }

    /// Its key, without a unit.
    pub fn key(self) -> &'static str {
        self.number().key
    }

    /// Its row of [`NUMBERS`].
    pub(crate) fn number(self) -> &'static CaseNumber {
        &NUMBERS[self.at]
    }

    /// A written value in SI units.
    ///
    /// # Errors
    /// As [`NamedNumber::set`].
    pub fn si(self, written: Written<'_>) -> Result<f64> {
        let number = self.number();
        units::si(written, number.unit(), self.unit).map_err(|unusable| {
            let help = unusable.help(number.key);
            Error::usage(Place::item(number.key), unusable.problem, help)
        })
    }

    /// Sets it to a written value.
    ///
    /// # Errors
    /// [`Error::Usage`] at the key: a text that is no such quantity, or a speed without a unit.
    pub fn set(self, case: &mut CaseParameters, written: Written<'_>) -> Result<()> {
        case[self.number().quantity] = Some(self.si(written)?);
        Ok(())
    }

    /// Names of all numbers, with their units at the end.
    pub fn names() -> Vec<String> {
        let ending = |unit| match unit {
            "m/s" => "mps",
            "m/s²" => "mps2",
            other => other,
        };
        NUMBERS.iter().map(|number| format!("{}_{}", number.key, ending(number.unit()))).collect()
    }
}

impl CaseParameters {
    /// Values of `self` where given, otherwise those of `other`. A gap replaces a headway, and vice versa.
    pub fn over(mut self, other: &CaseParameters) -> CaseParameters {
        let has_start = self[Gap].is_some() || self[Thw].is_some();
        for &CaseNumber { quantity, .. } in NUMBERS.iter().filter(|n| !(has_start && matches!(n.quantity, Gap | Thw))) {
            self[quantity] = self[quantity].or(other[quantity]);
        }
        self.category = self.category.or_else(|| other.category.clone());
        self
    }

    /// The kind of scenario.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is missing or unknown.
    pub(crate) fn category(&self) -> Result<Category> {
        let text = self.category.as_ref().ok_or_else(|| missing("category"))?;
        Category::named(text, Place::item("category"))
    }

    /// Returns the case after all checks: vehicles without a given size have that of the arguments, m. Speeds that are
    /// noise are set to 0. `place` returns the place of a key.
    ///
    /// # Errors
    /// [`Error::Usage`] that names what is missing or out of range.
    pub fn checked_case(
        &mut self,
        [length_m, width_m]: [f64; 2],
        time_cap_s: f64,
        doubts: &mut Doubts,
        place: &dyn Fn(&str) -> String,
    ) -> Result<PlainCase> {
        for &CaseNumber { quantity, key, .. } in NUMBERS.iter().filter(|number| number.needs_unit()) {
            self[quantity] = self[quantity].map(|v| doubts.speed(v, || place(key)));
        }
        let plain = self.plain_case(length_m, width_m)?;
        for &CaseNumber { key, plausible, quantity, .. } in &NUMBERS {
            let is_near = |value: f64| quantity == Thw && value * plain.ego_speed_mps <= NEAR_M;
            let (Some(plausible), Some(value)) = (plausible, self[quantity].filter(|value| !is_near(*value))) else {
                continue;
            };
            doubts
                .check(plausible, value, || place(key))
                .map_err(|problem| Error::usage(Place::item(key), problem, HELP.as_str()))?;
        }
        plain.check_plausible(doubts, place);
        // An acceleration without an end can reach extreme speeds within the time cap.
        let last_mps = plain.last_speed_mps(time_cap_s)?;
        let place = || format!("{}: the speed that results", place("acceleration"));
        let is_plausible = doubts.check(Quantity::Speed, last_mps, place);
        is_plausible.map_err(|text| {
            let problem = format!("it results in a speed that no vehicle has: {text}");
            let help = format!("a deceleration is negative; an acceleration needs an end: {}", option("end_speed"));
            Error::usage(Place::item("acceleration"), problem, help)
        })?;
        Ok(plain)
    }

    /// Names of the given values.
    pub fn given(&self) -> Vec<&'static str> {
        let numbers = NUMBERS.iter().filter(|number| self[number.quantity].is_some()).map(|number| number.key);
        self.category.iter().map(|_| "category").chain(numbers).collect()
    }

    /// Returns the case; vehicles without a given size have the size of the arguments, m.
    ///
    /// # Errors
    /// [`Error::Usage`] that names what is missing or out of range.
    pub(crate) fn plain_case(&self, length_m: f64, width_m: f64) -> Result<PlainCase> {
        let category = self.category()?;
        let given = || NUMBERS.iter().filter_map(|number| Some((number, self[number.quantity]?)));
        // A lane has its width without lane changes too.
        let is_foreign = |n: &CaseNumber| !n.categories.contains(&category) && n.quantity != CaseQuantity::LaneWidth;
        // 0 means none.
        if let Some((number, _)) = given().find(|(number, value)| is_foreign(number) && *value != 0.0) {
            let problem = format!("{} has no such parameter", category.label());
            let help = "leave it out, or choose the category that has it";
            return Err(Error::usage(Place::item(number.key), problem, help));
        }
        if let Some(needed) = CaseQuantity::needed(category).iter().find(|needed| self[**needed].is_none()) {
            return Err(missing(needed.number().key));
        }
        given().filter(|(number, _)| !is_foreign(number)).try_for_each(|(number, value)| number.check(value))?;
        self.check_start()?;
        let acceleration_mps2 = self[CaseQuantity::Deceleration].unwrap_or(0.0);
        let plain =
            PlainCase { acceleration_mps2, ..PlainCase::of(category, &|quantity| self[quantity], length_m, width_m) };
        if let Some((end_mps, duration_s)) = plain.end_speed_mps.zip(plain.duration_s) {
            let last_mps = plain.speed_mps + acceleration_mps2 * duration_s;
            if (end_mps - last_mps) * acceleration_mps2.signum() > SPEED_ERROR_MPS {
                let [last, end] = [last_mps, end_mps].map(readable::value);
                let problem = format!("{end} m/s is not reached: after {duration_s} s the speed is {last} m/s");
                let help = "give a longer duration, another acceleration, or no end speed";
                return Err(Error::usage(Place::item("end_speed"), problem, help));
            }
        }
        Ok(plain)
    }

    /// Checks the initial distance, if given.
    ///
    /// # Errors
    /// [`Error::Usage`] if both gap and headway are given, if one is out of range, or for a headway of an ego at rest.
    pub fn check_start(&self) -> Result<()> {
        if self[Gap].is_some() && self[Thw].is_some() {
            let problem = "both gap and time headway are given";
            return Err(Error::usage(Place::item("thw"), problem, "leave one of the two empty"));
        }
        [Gap, Thw].iter().try_for_each(|start| self[*start].map_or(Ok(()), |value| start.number().check(value)))?;
        self[CaseQuantity::EgoSpeed].map_or(Ok(()), |ego_speed_mps| check_headway(ego_speed_mps, self[Thw]))
    }
}

impl PlainCase {
    /// The case of some quantities without an acceleration; others have the defaults of `simulate`, vehicles the size of
    /// the arguments, m. What the category needs must be there.
    pub fn of(category: Category, get: &dyn Fn(CaseQuantity) -> Option<f64>, length_m: f64, width_m: f64) -> PlainCase {
        let value = |quantity, otherwise: f64| get(quantity).unwrap_or(otherwise);
        let ego_speed_mps = value(CaseQuantity::EgoSpeed, 0.0);
        let length_m = value(CaseQuantity::Length, length_m);
        let width_m = value(CaseQuantity::Width, width_m);
        let lane_width_m = value(CaseQuantity::LaneWidth, LANE_WIDTH_M);
        PlainCase {
            category,
            ego_speed_mps,
            speed_mps: value(CaseQuantity::OtherSpeed, ego_speed_mps),
            acceleration_mps2: 0.0,
            end_speed_mps: get(CaseQuantity::EndSpeed),
            lateral_speed_mps: value(CaseQuantity::LateralSpeed, 0.0),
            lateral_distance_m: value(CaseQuantity::LateralDistance, lane_width_m),
            ahead_speed_mps: value(CaseQuantity::AheadSpeed, 0.0),
            ahead_gap_m: value(CaseQuantity::AheadGap, 0.0),
            length_m,
            width_m,
            ego_length_m: value(CaseQuantity::EgoLength, length_m),
            ego_width_m: value(CaseQuantity::EgoWidth, width_m),
            lane_width_m,
            duration_s: get(CaseQuantity::Duration),
        }
    }

    /// Counts values that contradict one another; `place` returns the place of a key.
    pub fn check_plausible(&self, doubts: &mut Doubts, place: &dyn Fn(&str) -> String) {
        let (others, ego) = ((self.length_m, self.width_m), (self.ego_length_m, self.ego_width_m));
        doubts.check_shape(others.0, others.1, || place("length"));
        if ego != others {
            doubts.check_shape(ego.0, ego.1, || place("ego_length"));
        }
        if self.category == Category::CutIn {
            doubts.note_cutter(self.speed_mps > self.ego_speed_mps);
        }
        if self.category == Category::Lvd {
            doubts.note_leader(self.acceleration_mps2);
        } else if self.lateral_speed_mps > self.speed_mps {
            let [lateral, along] = [self.lateral_speed_mps, self.speed_mps].map(readable::value);
            let text = format!("{}: {lateral} m/s, but the vehicle drives at {along} m/s", place("lateral_speed"));
            doubts.contradict(Quantity::LaneChangeSpeed, text);
        }
    }
}

/// The error for a missing value.
fn missing(key: &str) -> Error {
    let what = match key {
        "category" => "cut-in, cut-out or lvd",
        "ahead_gap" => "a gap in m",
        "acceleration" => "an acceleration in m/s², below 0 for a leader that brakes,",
        "lateral_speed" => "a speed in m/s",
        _ => "a speed with its unit, such as 60km/h,",
    };
    let help = format!("give {what} with {} or as `{key}` in the file", option(key));
    Error::usage(Place::item(key), "it is missing", help)
}
