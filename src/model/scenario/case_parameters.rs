//! A concrete case from the few numbers that a user gives: on the command line, in a file, or in a row of a table.

use super::case_quantity::{CaseNumber, NUMBERS};
use super::units::{self, Written};
use super::{Category, LANE_WIDTH_M, PlainCase, check_headway, missing_parameter};
use crate::profile::FrameProfile;
use lanesweep_support::plausibility::{Doubts, HELP, Quantity};
use lanesweep_support::table::{NameUnit, Resolved, resolve};
use lanesweep_support::{Error, Place, Result, option};

/// Shortest and longest duration, s: the longest is the time cap of the paper's profile.
pub(super) const DURATIONS_S: (f64, f64) = (0.1, 120.0);

/// The given values; speeds in m/s, lengths in m, accelerations in m/s², times in s. The names are the flags of
/// `simulate`.
#[derive(Debug, Clone, Default, PartialEq)]
#[allow(missing_docs)] // see PlainCase
pub struct CaseParameters {
    pub category: Option<String>,
    pub ego_speed: Option<f64>,
    pub speed: Option<f64>,
    pub gap: Option<f64>,
    pub thw: Option<f64>,
    pub lateral_speed: Option<f64>,
    pub lateral_distance: Option<f64>,
    pub acceleration: Option<f64>,
    pub end_speed: Option<f64>,
    pub ahead_speed: Option<f64>,
    pub ahead_gap: Option<f64>,
    pub length: Option<f64>,
    pub width: Option<f64>,
    pub ego_length: Option<f64>,
    pub ego_width: Option<f64>,
    pub lane_width: Option<f64>,
    pub duration: Option<f64>,
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
    pub fn number(self) -> &'static CaseNumber {
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
        *(self.number().field)(case) = Some(self.si(written)?);
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
        let has_start = self.gap.is_some() || self.thw.is_some();
        for number in NUMBERS.iter().filter(|number| !(has_start && matches!(number.key, "gap" | "thw"))) {
            let field = (number.field)(&mut self);
            *field = field.or((number.get)(other));
        }
        self.category = self.category.or_else(|| other.category.clone());
        self
    }

    /// The kind of scenario.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is missing or unknown.
    pub fn category(&self) -> Result<Category> {
        let text = self.category.as_ref().ok_or_else(|| missing("category"))?;
        Category::named(text, Place::item("category"))
    }

    /// Sets speeds that are noise of a standing vehicle to 0 and counts them; `place` returns the place of a key.
    pub(super) fn settle(&mut self, doubts: &mut Doubts, place: impl Fn(&str) -> String) {
        let speeds = [
            ("ego_speed", &mut self.ego_speed),
            ("speed", &mut self.speed),
            ("end_speed", &mut self.end_speed),
            ("ahead_speed", &mut self.ahead_speed),
        ];
        for (key, speed) in speeds {
            *speed = speed.map(|v| doubts.speed(v, || place(key)));
        }
    }

    /// Checks the plausibility of the given values.
    ///
    /// # Errors
    /// [`Error::Usage`] for a value outside the physical range, unless such values are accepted.
    pub fn check_plausible(&self, doubts: &mut Doubts) -> Result<()> {
        for CaseNumber { key, plausible, get, .. } in &NUMBERS {
            let (Some(quantity), Some(value)) = (*plausible, get(self)) else { continue };
            doubts
                .check(quantity, value, || (*key).to_owned())
                .map_err(|problem| Error::usage(Place::item(*key), problem, HELP.as_str()))?;
        }
        Ok(())
    }

    /// Returns the case after all checks: vehicles without a given size have that of the frame. Speeds that are noise
    /// are set to 0.
    ///
    /// # Errors
    /// [`Error::Usage`] that names what is missing or out of range.
    pub fn checked_case(&mut self, frame: &FrameProfile, doubts: &mut Doubts) -> Result<PlainCase> {
        self.settle(doubts, str::to_owned);
        let plain = self.plain_case(frame.default_length_m, frame.default_width_m)?;
        self.check_plausible(doubts)?;
        // An acceleration without an end can reach extreme speeds within the time cap.
        let last_mps = plain.last_speed_mps(frame.time_cap_s)?;
        let is_plausible =
            doubts.check(Quantity::Speed, last_mps, || "the speed that results from the acceleration".to_owned());
        is_plausible.map_err(|text| {
            let problem = format!("it results in a speed that no vehicle has: {text}");
            let help = format!("a deceleration is negative; an acceleration needs an end: {}", option("end_speed"));
            Error::usage(Place::item("acceleration"), problem, help)
        })?;
        Ok(plain)
    }

    /// Names of the given values.
    pub fn given(&self) -> Vec<&'static str> {
        let numbers = NUMBERS.iter().filter_map(|number| (number.get)(self).map(|_| number.key));
        self.category.iter().map(|_| "category").chain(numbers).collect()
    }

    /// Returns the case; vehicles without a given size have the size of the arguments, m.
    ///
    /// # Errors
    /// [`Error::Usage`] that names what is missing or out of range.
    pub fn plain_case(&self, length_m: f64, width_m: f64) -> Result<PlainCase> {
        let category = self.category()?;
        self.refuse_of_other_categories(category)?;
        let number = |key: &str| NUMBERS.iter().find(|number| number.key == key).and_then(|number| (number.get)(self));
        if let Some(key) = missing_parameter(category, |key| number(key).is_some()) {
            return Err(missing(key));
        }
        let given = |key: &str| number(key).unwrap_or(0.0);
        let ego_speed_mps = at_least(given("ego_speed"), 0.0, "ego_speed")?;
        self.check_start()?;
        let length_m = above_zero(self.length.unwrap_or(length_m), "length")?;
        let width_m = above_zero(self.width.unwrap_or(width_m), "width")?;
        let ego_length_m = above_zero(self.ego_length.unwrap_or(length_m), "ego_length")?;
        let ego_width_m = above_zero(self.ego_width.unwrap_or(width_m), "ego_width")?;
        let lane_width_m = above_zero(self.lane_width.unwrap_or(LANE_WIDTH_M), "lane_width")?;
        let speed_mps = at_least(self.speed.unwrap_or(ego_speed_mps), 0.0, "speed")?;
        let acceleration_mps2 = at_least(self.acceleration.unwrap_or(0.0), f64::NEG_INFINITY, "acceleration")?;
        let end_speed_mps = self.end_speed.map(|v| at_least(v, 0.0, "end_speed")).transpose()?;
        let (lateral_speed_mps, lateral_distance_m) = match category {
            Category::Lvd => (0.0, lane_width_m),
            Category::CutIn | Category::CutOut => (
                above_zero(given("lateral_speed"), "lateral_speed")?,
                above_zero(self.lateral_distance.unwrap_or(lane_width_m), "lateral_distance")?,
            ),
        };
        let (ahead_gap_m, ahead_speed_mps) = match category {
            Category::CutOut => (
                at_least(given("ahead_gap"), 0.0, "ahead_gap")?,
                at_least(self.ahead_speed.unwrap_or(0.0), 0.0, "ahead_speed")?,
            ),
            Category::CutIn | Category::Lvd => (0.0, 0.0),
        };
        let (shortest_s, longest_s) = DURATIONS_S;
        if let Some(duration_s) = self.duration.filter(|s| !(shortest_s..=longest_s).contains(s)) {
            let help = format!("give seconds of at least {shortest_s} and at most {longest_s}");
            return Err(Error::usage(Place::item("duration"), format!("{duration_s} cannot be used"), help));
        }
        Ok(PlainCase {
            category,
            ego_speed_mps,
            speed_mps,
            acceleration_mps2,
            end_speed_mps,
            lateral_speed_mps,
            lateral_distance_m,
            ahead_speed_mps,
            ahead_gap_m,
            length_m,
            width_m,
            ego_length_m,
            ego_width_m,
            lane_width_m,
            duration_s: self.duration,
        })
    }

    /// Checks the initial distance, if given.
    ///
    /// # Errors
    /// [`Error::Usage`] if both gap and headway are given, if one is out of range, or for a headway of an ego at rest.
    pub fn check_start(&self) -> Result<()> {
        if self.gap.is_some() && self.thw.is_some() {
            let problem = "both gap and time headway are given";
            return Err(Error::usage(Place::item("thw"), problem, "leave one of the two empty"));
        }
        self.gap.map_or(Ok(0.0), |gap_m| at_least(gap_m, 0.0, "gap"))?;
        self.thw.map_or(Ok(0.0), |thw_s| at_least(thw_s, 0.0, "thw"))?;
        self.ego_speed.map_or(Ok(()), |ego_speed_mps| check_headway(ego_speed_mps, self.thw))
    }

    /// Refuses parameters that the category does not have. 0 is accepted because it means none.
    fn refuse_of_other_categories(&self, category: Category) -> Result<()> {
        let given = [
            ("lateral_speed", self.lateral_speed, category == Category::Lvd),
            ("lateral_distance", self.lateral_distance, category == Category::Lvd),
            ("ahead_speed", self.ahead_speed, category != Category::CutOut),
            ("ahead_gap", self.ahead_gap, category != Category::CutOut),
        ];
        match given.iter().find(|(_, value, is_foreign)| *is_foreign && value.is_some_and(|value| value != 0.0)) {
            None => Ok(()),
            Some((key, ..)) => {
                let problem = format!("{} has no such parameter", category.label());
                Err(Error::usage(Place::item(*key), problem, "leave it out, or choose the category that has it"))
            }
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

/// Maximum magnitude of a physical speed, length or acceleration.
const MAX_MAGNITUDE: f64 = 1e6;

fn at_least(value: f64, min: f64, key: &str) -> Result<f64> {
    if value.abs() <= MAX_MAGNITUDE && value >= min {
        return Ok(value);
    }
    let expected = if min.is_finite() {
        format!("a number of at least {min} and at most 1e6")
    } else {
        "a number between -1e6 and 1e6".into()
    };
    Err(Error::usage(Place::item(key), format!("{value} cannot be used"), format!("give {expected}")))
}

fn above_zero(value: f64, key: &str) -> Result<f64> {
    if value > 0.0 && value <= MAX_MAGNITUDE {
        return Ok(value);
    }
    Err(Error::usage(Place::item(key), format!("{value} cannot be used"), "give a number above 0 and at most 1e6"))
}
