//! The quantities of a concrete case: one table, from which flags, columns, axes of maps, ranges, plausibility and
//! measurement errors follow.

use super::CaseParameters;
use super::check::Bound;
use super::units::{self, Written};
use crate::category::Category;
use crate::plausibility::Quantity;
use lanesweep_support::table::{NameUnit, Named};
use lanesweep_support::{Error, Place, Result};

/// A quantity of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CaseQuantity {
    /// Initial speed of the ego.
    EgoSpeed,
    /// Initial speed of the vehicle that cuts in, cuts out or leads.
    OtherSpeed,
    /// Initial gap to it, bumper to bumper.
    Gap,
    /// The initial gap as a time headway.
    Thw,
    /// Lateral speed of a lane change.
    LateralSpeed,
    /// Lateral distance of a lane change.
    LateralDistance,
    /// Deceleration of that other vehicle: minus the acceleration of [`CaseParameters`].
    Deceleration,
    /// Speed at which its deceleration ends.
    EndSpeed,
    /// Speed of the vehicle ahead of the one that cuts out.
    AheadSpeed,
    /// Gap between these two, bumper to bumper.
    AheadGap,
    /// Length of the vehicles, without a length of its own also of the ego.
    Length,
    /// Their width.
    Width,
    /// Length of the ego.
    EgoLength,
    /// Width of the ego.
    EgoWidth,
    /// Width of the lanes.
    LaneWidth,
    /// Duration of the other vehicles' motion.
    Duration,
}

/// A quantity of a case: its names, its ranges, what it is measured in, and its field.
pub struct CaseNumber {
    /// The quantity.
    pub quantity: CaseQuantity,
    /// Name in files, tables and options.
    pub key: &'static str,
    /// Its row of the table of plausible values; a time span has none.
    pub plausible: Option<Quantity>,
    /// Meaning, with the default in brackets.
    pub help: &'static str,
    /// Label of an axis.
    pub label: &'static str,
    /// Names on the axes of maps, each with its unit and the number of these units in one SI unit.
    pub axes: &'static [(&'static str, &'static str, f64)],
    /// Range on the axes of maps, SI units.
    pub axis_range: (f64, f64),
    /// Categories that have it.
    pub categories: &'static [Category],
    /// A usual measurement error, SI units, and the words for adding and for subtracting it; `None` for what is not
    /// varied.
    pub error: Option<(f64, [&'static str; 2])>,
}

/// Kilometres per hour in one metre per second.
pub const KMH: f64 = 3.6;
/// Measurement error of a gap, a lateral distance, a width or a length, m.
pub const GAP_ERROR_M: f64 = 0.01;
/// Measurement error of a speed along the road, m/s: 0.1 km/h.
pub const SPEED_ERROR_MPS: f64 = 0.1 / KMH;
const LATERAL_SPEED_ERROR_MPS: f64 = 0.01;
const DECELERATION_ERROR_MPS2: f64 = 0.05;

const EVERY: &[Category] = &Category::ALL;
const LANE_CHANGES: &[Category] = &[Category::CutIn, Category::CutOut];
const CUT_OUT: &[Category] = &[Category::CutOut];

macro_rules! error {
    (none) => {
        None
    };
    ($words:literal, $si:expr, $text:literal) => {
        Some(($si, [concat!($words, " + ", $text), concat!($words, " - ", $text)]))
    };
}

macro_rules! number {
    ($of:ident $key:ident, $help:literal, $label:literal, [$($axis:tt),*] $range:expr, $plausible:expr, $categories:expr, ($($error:tt)*)) => {
        CaseNumber {
            quantity: CaseQuantity::$of,
            key: stringify!($key),
            plausible: $plausible,
            help: $help,
            label: $label,
            axes: &[$($axis),*],
            axis_range: $range,
            categories: $categories,
            error: error!($($error)*),
        }
    };
}

/// Every quantity, in the order of [`CaseQuantity`].
#[rustfmt::skip] // a table
pub static NUMBERS: [CaseNumber; 16] = [
    number!(EgoSpeed ego_speed, "Initial speed of the ego, with its unit: 60km/h", "Speed of the ego",
        [("ego_speed_mps", "m/s", 1.0), ("ego_speed_kmh", "km/h", KMH)] (0.0, 150.0), Some(Quantity::Speed), EVERY,
        ("ego", SPEED_ERROR_MPS, "0.1 km/h")),
    number!(OtherSpeed speed, "Initial speed of the other vehicle, with its unit [default: the ego's]", "Speed of the other vehicle",
        [("other_speed_mps", "m/s", 1.0), ("other_speed_kmh", "km/h", KMH)] (0.0, 150.0), Some(Quantity::Speed), EVERY,
        ("other", SPEED_ERROR_MPS, "0.1 km/h")),
    number!(Gap gap, "Initial gap, bumper to bumper", "Initial gap",
        [("gap_m", "m", 1.0)] (0.0, 1e4), Some(Quantity::Gap), EVERY, ("gap", GAP_ERROR_M, "1 cm")),
    number!(Thw thw, "Initial time headway instead of the gap", "Initial time headway",
        [("thw_s", "s", 1.0)] (0.0, 100.0), Some(Quantity::Headway), EVERY, (none)),
    number!(LateralSpeed lateral_speed, "Cut-in, cut-out: lateral speed", "Lateral speed",
        [("lateral_speed_mps", "m/s", 1.0)] (0.0, 20.0), Some(Quantity::LaneChangeSpeed), LANE_CHANGES,
        ("lateral speed", LATERAL_SPEED_ERROR_MPS, "0.01 m/s")),
    number!(LateralDistance lateral_distance, "Cut-in: lateral distance at the start; cut-out: at the end [default: the lane's width]",
        "Lateral distance of the lane change",
        [("lateral_distance_m", "m", 1.0)] (0.01, 20.0), Some(Quantity::LateralPosition), LANE_CHANGES,
        ("lateral distance", GAP_ERROR_M, "1 cm")),
    number!(Deceleration acceleration, "Acceleration of the other vehicle; an LVD needs one [default: 0]", "Deceleration of the other vehicle",
        [("deceleration_mps2", "m/s²", 1.0)] (0.0, 50.0), Some(Quantity::Acceleration), EVERY,
        ("deceleration", DECELERATION_ERROR_MPS2, "0.05 m/s²")),
    number!(EndSpeed end_speed, "Speed at which the acceleration ends, with its unit [default: standstill, or never]", "End speed of the other vehicle",
        [("end_speed_mps", "m/s", 1.0), ("end_speed_kmh", "km/h", KMH)] (0.0, 150.0), Some(Quantity::Speed), EVERY,
        ("end speed", SPEED_ERROR_MPS, "0.1 km/h")),
    number!(AheadSpeed ahead_speed, "Cut-out: speed of the vehicle ahead of the cutting-out one, with its unit [default: 0]", "Speed of the vehicle ahead",
        [("ahead_speed_mps", "m/s", 1.0), ("ahead_speed_kmh", "km/h", KMH)] (0.0, 150.0), Some(Quantity::Speed), CUT_OUT,
        ("vehicle ahead", SPEED_ERROR_MPS, "0.1 km/h")),
    number!(AheadGap ahead_gap, "Cut-out: gap between the two, bumper to bumper", "Gap ahead of the other vehicle",
        [("ahead_gap_m", "m", 1.0)] (0.0, 1e4), Some(Quantity::Gap), CUT_OUT, ("gap of the vehicle ahead", GAP_ERROR_M, "1 cm")),
    number!(Length length, "Length of every vehicle [default: the profile's]", "Length of the vehicles",
        [("length_m", "m", 1.0)] (0.1, 50.0), Some(Quantity::Length), EVERY, ("length", GAP_ERROR_M, "1 cm")),
    number!(Width width, "Width of every vehicle [default: the profile's]", "Width of the vehicles",
        [("width_m", "m", 1.0)] (0.1, 10.0), Some(Quantity::Width), EVERY, ("width", GAP_ERROR_M, "1 cm")),
    number!(EgoLength ego_length, "Length of the ego [default: that of every vehicle]", "Length of the ego",
        [("ego_length_m", "m", 1.0)] (0.1, 50.0), Some(Quantity::Length), EVERY, ("ego's length", GAP_ERROR_M, "1 cm")),
    number!(EgoWidth ego_width, "Width of the ego [default: that of every vehicle]", "Width of the ego",
        [("ego_width_m", "m", 1.0)] (0.1, 10.0), Some(Quantity::Width), EVERY, ("ego's width", GAP_ERROR_M, "1 cm")),
    number!(LaneWidth lane_width, "Width of the lanes [default: the scenario's, else 3.5]", "Width of the lanes",
        [("lane_width_m", "m", 1.0)] (1.0, 20.0), Some(Quantity::LaneWidth), LANE_CHANGES, ("lane's width", GAP_ERROR_M, "1 cm")),
    number!(Duration duration, "Duration of the other vehicles' motion", "Duration of the motions", [] (0.0, 0.0), None, EVERY, (none)),
];

impl CaseQuantity {
    /// Its row of [`NUMBERS`].
    pub fn number(self) -> &'static CaseNumber {
        &NUMBERS[self as usize]
    }

    /// What a category needs, besides the initial distance.
    pub fn needed(category: Category) -> &'static [CaseQuantity] {
        match category {
            Category::CutIn => &[CaseQuantity::EgoSpeed, CaseQuantity::LateralSpeed],
            Category::CutOut => &[CaseQuantity::EgoSpeed, CaseQuantity::LateralSpeed, CaseQuantity::AheadGap],
            Category::Lvd => &[CaseQuantity::EgoSpeed, CaseQuantity::Deceleration],
        }
    }
}

impl CaseNumber {
    /// Sets it to a text: a speed along the road needs its unit (`60km/h`), others may have theirs.
    ///
    /// # Errors
    /// What to write.
    pub fn set_text(&self, case: &mut CaseParameters, text: &str) -> std::result::Result<(), String> {
        let unit = if self.needs_unit() { NameUnit::Needed } else { NameUnit::Customary };
        let si = units::si(Written::Text(text), self.unit(), unit);
        case[self.quantity] = Some(si.map_err(|unusable| match unusable.lacks_unit {
            true => format!("{}; write {}", unusable.problem, unusable.write),
            false => format!("write {}", unusable.write),
        })?);
        Ok(())
    }

    /// Checks that a value is possible.
    ///
    /// # Errors
    /// [`Error::Usage`] with the range.
    pub(super) fn check(&self, value: f64) -> Result<()> {
        let bound = match self.plausible {
            Some(Quantity::Acceleration) => Bound::Finite,
            Some(Quantity::Speed | Quantity::Gap | Quantity::Headway) => Bound::AtLeastZero,
            Some(_) => Bound::AboveZero,
            None => Bound::Duration,
        };
        if bound.holds(value) {
            return Ok(());
        }
        let (problem, help) = (format!("{value} cannot be used"), format!("give {}", bound.words()));
        Err(Error::usage(Place::item(self.key), problem, help))
    }

    /// Whether a value needs a unit: a speed along the road, which people give in km/h and in m/s.
    pub fn needs_unit(&self) -> bool {
        self.plausible == Some(Quantity::Speed)
    }

    /// Its SI unit.
    pub fn unit(&self) -> &'static str {
        self.plausible.map_or("s", |quantity| quantity.limits().unit)
    }

    /// The name that users give it. A speed along the road needs a unit; every other quantity has one customary unit.
    pub(super) fn named(&self) -> Named {
        Named { name: self.key.to_owned(), unit: self.unit(), needs_unit: self.needs_unit() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CaseFile, NamedNumber};
    use super::*;

    /// A key that no quantity has is an error, never 0.
    #[test]
    fn a_misspelt_key_is_an_error() {
        assert_eq!(NamedNumber::find("ego_sped").unwrap(), None);
        let file = |text: &str| toml::from_str::<CaseFile>(text).map(|file| file.parameters);
        assert!(file("ego_sped = '60km/h'").unwrap_err().to_string().contains("unknown field `ego_sped`"));
        assert_eq!(file("gap = 10").unwrap()[CaseQuantity::Gap], Some(10.0));
        let lacking = file("category = 'lvd'\nego_speed = '60km/h'").unwrap();
        let error = lacking.plain_case(4.3, 1.9).unwrap_err().to_string();
        assert!(error.contains("acceleration") && error.contains("it is missing"), "{error}");
    }

    #[test]
    fn the_table_has_the_order_of_the_quantities() {
        for (at, number) in NUMBERS.iter().enumerate() {
            assert_eq!(number.quantity as usize, at, "{}", number.key);
        }
    }
}
