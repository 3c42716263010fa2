//! The parameters that a grid can vary: their names with units, their ranges, and the categories that have them.

use crate::model::profile::Profile;
use crate::scenario::{Category, LANE_WIDTH_M, PlainCase, check_headway};
use crate::support::plain_text::nearest;
use crate::support::plausibility::{Doubts, HELP, Quantity as Of};
use crate::{Error, Place, Result};

/// The quantity that a parameter sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapQuantity {
    /// Initial speed of the ego.
    EgoSpeed,
    /// Initial speed of the vehicle that cuts in, cuts out or leads.
    OtherSpeed,
    /// That speed minus the ego's.
    RelativeSpeed,
    /// Initial gap to it, bumper to bumper.
    Gap,
    /// The initial gap as a time headway.
    Thw,
    /// Lateral speed of a lane change.
    LateralSpeed,
    /// Lateral distance of a lane change.
    LateralDistance,
    /// Deceleration of that other vehicle.
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
}

impl MapQuantity {
    /// Number of quantities.
    const COUNT: usize = 16;
}

/// A parameter as named in flags, tables and files.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapParameter {
    /// Name, including its unit.
    pub key: &'static str,
    /// Label of an axis.
    pub label: &'static str,
    /// Unit shown on an axis.
    pub unit: &'static str,
    /// The quantity that it sets.
    pub quantity: MapQuantity,
    /// Its quantity in the table of plausible values; that of a deceleration has the other sign.
    plausible: Of,
    /// Number of its units in one SI unit.
    pub per_si: f64,
    /// Minimum value, in its unit.
    pub min: f64,
    /// Maximum value, in its unit.
    pub max: f64,
    /// Categories that have it.
    pub categories: &'static [Category],
}

const EVERY: &[Category] = &Category::ALL;
const LANE_CHANGES: &[Category] = &[Category::CutIn, Category::CutOut];
const CUT_OUT: &[Category] = &[Category::CutOut];
const KMH: f64 = 3.6;

const fn parameter(
    key: &'static str,
    label: &'static str,
    unit: &'static str,
    (quantity, plausible): (MapQuantity, Of),
    per_si: f64,
    (min, max): (f64, f64),
    categories: &'static [Category],
) -> MapParameter {
    MapParameter { key, label, unit, quantity, plausible, per_si, min, max, categories }
}

/// All, in the order of help texts.
#[rustfmt::skip] // a table
pub const PARAMETERS: [MapParameter; 21] = [
    parameter("ego_speed_mps", "Speed of the ego", "m/s", (MapQuantity::EgoSpeed, Of::Speed), 1.0, (0.0, 150.0), EVERY),
    parameter("ego_speed_kmh", "Speed of the ego", "km/h", (MapQuantity::EgoSpeed, Of::Speed), KMH, (0.0, 540.0), EVERY),
    parameter("other_speed_mps", "Speed of the other vehicle", "m/s", (MapQuantity::OtherSpeed, Of::Speed), 1.0, (0.0, 150.0), EVERY),
    parameter("other_speed_kmh", "Speed of the other vehicle", "km/h", (MapQuantity::OtherSpeed, Of::Speed), KMH, (0.0, 540.0), EVERY),
    parameter("relative_speed_mps", "Speed of the other vehicle minus that of the ego", "m/s", (MapQuantity::RelativeSpeed, Of::Speed), 1.0, (-150.0, 150.0), EVERY),
    parameter("relative_speed_kmh", "Speed of the other vehicle minus that of the ego", "km/h", (MapQuantity::RelativeSpeed, Of::Speed), KMH, (-540.0, 540.0), EVERY),
    parameter("gap_m", "Initial gap", "m", (MapQuantity::Gap, Of::Gap), 1.0, (0.0, 1e4), EVERY),
    parameter("thw_s", "Initial time headway", "s", (MapQuantity::Thw, Of::Headway), 1.0, (0.0, 100.0), EVERY),
    parameter("lateral_speed_mps", "Lateral speed", "m/s", (MapQuantity::LateralSpeed, Of::LateralSpeed), 1.0, (0.0, 20.0), LANE_CHANGES),
    parameter("lateral_distance_m", "Lateral distance of the lane change", "m", (MapQuantity::LateralDistance, Of::LateralPosition), 1.0, (0.01, 20.0), LANE_CHANGES),
    parameter("deceleration_mps2", "Deceleration of the other vehicle", "m/s²", (MapQuantity::Deceleration, Of::Acceleration), 1.0, (0.0, 50.0), EVERY),
    parameter("end_speed_mps", "End speed of the other vehicle", "m/s", (MapQuantity::EndSpeed, Of::Speed), 1.0, (0.0, 150.0), EVERY),
    parameter("end_speed_kmh", "End speed of the other vehicle", "km/h", (MapQuantity::EndSpeed, Of::Speed), KMH, (0.0, 540.0), EVERY),
    parameter("ahead_speed_mps", "Speed of the vehicle ahead", "m/s", (MapQuantity::AheadSpeed, Of::Speed), 1.0, (0.0, 150.0), CUT_OUT),
    parameter("ahead_speed_kmh", "Speed of the vehicle ahead", "km/h", (MapQuantity::AheadSpeed, Of::Speed), KMH, (0.0, 540.0), CUT_OUT),
    parameter("ahead_gap_m", "Gap to the vehicle ahead", "m", (MapQuantity::AheadGap, Of::Gap), 1.0, (0.0, 1e4), CUT_OUT),
    parameter("length_m", "Length of the vehicles", "m", (MapQuantity::Length, Of::Length), 1.0, (0.1, 50.0), EVERY),
    parameter("width_m", "Width of the vehicles", "m", (MapQuantity::Width, Of::Width), 1.0, (0.1, 10.0), EVERY),
    parameter("ego_length_m", "Length of the ego", "m", (MapQuantity::EgoLength, Of::Length), 1.0, (0.1, 50.0), EVERY),
    parameter("ego_width_m", "Width of the ego", "m", (MapQuantity::EgoWidth, Of::Width), 1.0, (0.1, 10.0), EVERY),
    parameter("lane_width_m", "Width of the lanes", "m", (MapQuantity::LaneWidth, Of::LaneWidth), 1.0, (1.0, 20.0), LANE_CHANGES),
];

impl MapParameter {
    /// Finds a parameter of a category by name; `flag` names the option in errors.
    ///
    /// # Errors
    /// [`Error::Usage`] with the most similar name.
    pub fn find(category: Category, key: &str, flag: &str) -> Result<&'static MapParameter> {
        let of_category = || PARAMETERS.iter().filter(|p| p.categories.contains(&category));
        if let Some(found) = of_category().find(|p| p.key == key) {
            return Ok(found);
        }
        let near = nearest(key, of_category().map(|p| p.key), 0.0);
        let keys: Vec<&str> = of_category().map(|p| p.key).collect();
        let help = match near {
            Some(near) => format!("did you mean `{near}`? There are {}", keys.join(", ")),
            None => format!("there are {}", keys.join(", ")),
        };
        let article = if category == Category::Lvd { "an" } else { "a" };
        let problem = format!("{article} {} has no parameter `{key}`", category.label());
        Err(Error::usage(Place::item(flag), problem, help))
    }

    /// Refuses two parameters that set one quantity.
    ///
    /// # Errors
    /// [`Error::Usage`] that names both.
    pub fn refuse_repeats(given: &[&MapParameter]) -> Result<()> {
        for (at, parameter) in given.iter().enumerate() {
            if let Some(before) = given[..at].iter().find(|p| p.says_the_same(parameter)) {
                let problem = format!("`{}` and `{}` say the same twice", before.key, parameter.key);
                return Err(Error::usage(Place::item(parameter.key), problem, "keep one of them"));
            }
        }
        Ok(())
    }

    /// Whether both set one quantity; a relative speed sets the speed of the other vehicle.
    fn says_the_same(&self, other: &MapParameter) -> bool {
        let of = |parameter: &MapParameter| match parameter.quantity {
            MapQuantity::RelativeSpeed => MapQuantity::OtherSpeed,
            quantity => quantity,
        };
        of(self) == of(other)
    }

    /// A value in SI units.
    pub fn si(&self, value: f64) -> f64 {
        value / self.per_si
    }

    /// `Initial gap (m)`, for axes.
    pub fn title(&self) -> String {
        format!("{} ({})", self.label, self.unit)
    }

    /// Checks the plausibility of a user's value.
    ///
    /// # Errors
    /// [`Error::Usage`] for a value beyond the physical range, unless such values are accepted.
    pub fn check_plausible(&self, value: f64, doubts: &mut Doubts) -> Result<()> {
        let si = match self.quantity {
            MapQuantity::RelativeSpeed => self.si(value).abs(),
            MapQuantity::Deceleration => -self.si(value),
            _ => self.si(value),
        };
        let judged = doubts.check(self.plausible, si, || self.key.to_owned());
        judged.map_err(|problem| Error::usage(Place::item(self.key), problem, HELP))
    }

    /// Checks the range of a value. A speed that is noise of a stationary vehicle becomes 0, with a warning.
    ///
    /// # Errors
    /// [`Error::Usage`] with the range.
    pub fn check(&self, value: f64, flag: &str) -> Result<f64> {
        let mut doubts = Doubts::default();
        let is_still = self.plausible == Of::Speed
            && self.quantity != MapQuantity::RelativeSpeed
            && doubts.speed(self.si(value), || format!("{} = {value}", self.key)) != self.si(value);
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        let value = if is_still { 0.0 } else { value };
        if (self.min..=self.max).contains(&value) {
            return Ok(value);
        }
        let problem = format!("{} = {value} cannot be used", self.key);
        let help = format!("give a number of at least {} and at most {} {}", self.min, self.max, self.unit);
        Err(Error::usage(Place::item(flag), problem, help))
    }
}

/// Values of some quantities, in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Point([Option<f64>; MapQuantity::COUNT]);

impl Point {
    /// Sets the quantity of a parameter from a value in the parameter's unit.
    pub fn set(&mut self, parameter: &MapParameter, value: f64) {
        self.0[parameter.quantity as usize] = Some(parameter.si(value));
    }

    /// The same point with another value of a quantity, in SI units.
    #[must_use]
    pub fn with(mut self, quantity: MapQuantity, si: f64) -> Point {
        self.0[quantity as usize] = Some(si);
        self
    }

    /// The value of a quantity; `None` if not set. A relative speed sets the other vehicle's.
    pub fn get(&self, quantity: MapQuantity) -> Option<f64> {
        self.0[quantity as usize].or_else(|| {
            let relative_mps =
                self.0[MapQuantity::RelativeSpeed as usize].filter(|_| quantity == MapQuantity::OtherSpeed)?;
            let other_mps = self.0[MapQuantity::EgoSpeed as usize]? + relative_mps;
            // Different units leave a rounding error of a standstill.
            Some(if other_mps.abs() < 1e-9 { 0.0 } else { other_mps })
        })
    }

    /// The value of a quantity that a case has; one that is not set follows from others: the other vehicle is as fast
    /// as the ego, all vehicles have one size, a lane change covers one lane.
    pub(super) fn value(&self, quantity: MapQuantity) -> Option<f64> {
        self.get(quantity).or_else(|| match quantity {
            MapQuantity::OtherSpeed => self.get(MapQuantity::EgoSpeed),
            MapQuantity::EgoLength => self.get(MapQuantity::Length),
            MapQuantity::EgoWidth => self.get(MapQuantity::Width),
            MapQuantity::LateralDistance => self.value(MapQuantity::LaneWidth),
            MapQuantity::LaneWidth => Some(LANE_WIDTH_M),
            MapQuantity::AheadSpeed => Some(0.0),
            _ => None,
        })
    }

    /// The plain case of these values; unset quantities have the defaults of `simulate`.
    ///
    /// # Errors
    /// [`Error::Usage`] for a time headway of a stationary ego.
    pub fn plain_case(&self, category: Category, profile: &Profile) -> Result<PlainCase> {
        let value = |quantity, otherwise: f64| self.get(quantity).unwrap_or(otherwise);
        let ego_speed_mps = value(MapQuantity::EgoSpeed, 0.0);
        let deceleration = value(MapQuantity::Deceleration, 0.0);
        check_headway(ego_speed_mps, self.get(MapQuantity::Thw))?;
        let speed_mps = value(MapQuantity::OtherSpeed, ego_speed_mps);
        if speed_mps < 0.0 {
            let problem = format!("the other vehicle would drive backwards, at {speed_mps} m/s");
            let help = "give relative speeds of at least minus the ego's speed; a map leaves such panels out, where both \
                        speeds belong to the panels (name other axes by option `x` and option `y`)";
            return Err(Error::usage(Place::item("relative_speed"), problem, help));
        }
        let length_m = value(MapQuantity::Length, profile.frame.default_length_m);
        let width_m = value(MapQuantity::Width, profile.frame.default_width_m);
        let lane_width_m = value(MapQuantity::LaneWidth, LANE_WIDTH_M);
        Ok(PlainCase {
            category,
            ego_speed_mps,
            speed_mps,
            // Avoids a negative zero.
            acceleration_mps2: if deceleration > 0.0 { -deceleration } else { 0.0 },
            end_speed_mps: self.get(MapQuantity::EndSpeed),
            lateral_speed_mps: value(MapQuantity::LateralSpeed, 0.0),
            lateral_distance_m: value(MapQuantity::LateralDistance, lane_width_m),
            ahead_speed_mps: value(MapQuantity::AheadSpeed, 0.0),
            ahead_gap_m: value(MapQuantity::AheadGap, 0.0),
            length_m,
            width_m,
            ego_length_m: value(MapQuantity::EgoLength, length_m),
            ego_width_m: value(MapQuantity::EgoWidth, width_m),
            lane_width_m,
            duration_s: None,
        })
    }
}
