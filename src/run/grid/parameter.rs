//! The parameters that a grid can vary: their names with units, their ranges, and the categories that have them.

use std::sync::LazyLock;

use lanesweep_model::plausibility::{Doubts, HELP, Quantity};
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{CaseNumber, CaseQuantity, Category, LANE_WIDTH_M, NUMBERS, PlainCase, check_headway};
use lanesweep_support::{Error, Place, Result, option};

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
    pub quantity: CaseQuantity,
    /// The other vehicle's speed relative to the ego's.
    pub is_relative: bool,
    /// Number of its units in one SI unit.
    pub per_si: f64,
    /// Minimum value, in its unit.
    pub min: f64,
    /// Maximum value, in its unit.
    pub max: f64,
    /// Categories that have it.
    pub categories: &'static [Category],
}

/// All, in the order of help texts: the axes of every quantity of a case.
pub static PARAMETERS: LazyLock<Vec<MapParameter>> = LazyLock::new(|| NUMBERS.iter().flat_map(of_number).collect());

fn of_number(number: &'static CaseNumber) -> Vec<MapParameter> {
    let &CaseNumber { quantity, label, axes, axis_range: (min_si, max_si), categories, .. } = number;
    let of = |(key, unit, per_si): (&'static str, &'static str, f64)| {
        // Whole numbers: 150 m/s are 540 km/h.
        let [min, max] = [min_si, max_si].map(|si| if per_si == 1.0 { si } else { (si * per_si).round() });
        MapParameter { key, label, unit, quantity, is_relative: false, per_si, min, max, categories }
    };
    let mut all: Vec<MapParameter> = axes.iter().copied().map(of).collect();
    if quantity == CaseQuantity::OtherSpeed {
        let label = "Speed of the other vehicle minus that of the ego";
        let relative = |(key, of): (&'static str, &MapParameter)| MapParameter {
            key,
            label,
            is_relative: true,
            min: -of.max,
            ..*of
        };
        let keys = ["relative_speed_mps", "relative_speed_kmh"];
        let of_both: Vec<MapParameter> = keys.into_iter().zip(&all).map(relative).collect();
        all.extend(of_both);
    }
    all
}

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
        let what = format!("parameter of {}s", category.label());
        Err(Error::unknown(Place::item(flag), &what, key, of_category().map(|p| p.key), ""))
    }

    /// Refuses two parameters that set one quantity; a relative speed sets the speed of the other vehicle.
    ///
    /// # Errors
    /// [`Error::Usage`] that names both.
    pub(crate) fn refuse_repeats(given: &[&MapParameter]) -> Result<()> {
        for (at, parameter) in given.iter().enumerate() {
            if let Some(before) = given[..at].iter().find(|p| p.quantity == parameter.quantity) {
                let problem = format!("`{}` and `{}` say the same twice", before.key, parameter.key);
                return Err(Error::usage(Place::item(parameter.key), problem, "keep one of them"));
            }
        }
        Ok(())
    }

    /// A value in SI units.
    pub(crate) fn si(&self, value: f64) -> f64 {
        value / self.per_si
    }

    /// `ego` of a speed, else `lateral speed`: a word for headings.
    pub fn name(&self) -> String {
        match self.key.split_once("_speed") {
            Some((vehicle, _)) => vehicle.to_owned(),
            None => self.key.rsplit_once('_').map_or(self.key, |(name, _)| name).replace('_', " "),
        }
    }

    /// `Initial gap (m)`, for axes.
    pub fn title(&self) -> String {
        format!("{} ({})", self.label, self.unit)
    }

    /// Checks the plausibility of a user's value.
    ///
    /// # Errors
    /// [`Error::Usage`] for a value beyond the physical range, unless such values are accepted.
    pub(crate) fn check_plausible(&self, value: f64, doubts: &mut Doubts) -> Result<()> {
        let Some(plausible) = self.quantity.number().plausible else { return Ok(()) };
        let si = match self.quantity {
            _ if self.is_relative => self.si(value).abs(),
            CaseQuantity::Deceleration => -self.si(value),
            _ => self.si(value),
        };
        let checked = doubts.check(plausible, si, || self.key.to_owned());
        checked.map_err(|problem| Error::usage(Place::item(self.key), problem, HELP.as_str()))
    }

    /// Checks the range of a value. A speed that is noise of a stationary vehicle becomes 0, with a warning.
    ///
    /// # Errors
    /// [`Error::Usage`] with the range.
    pub(crate) fn check(&self, value: f64, flag: &str) -> Result<f64> {
        let mut doubts = Doubts::default();
        let is_still = self.quantity.number().plausible == Some(Quantity::Speed)
            && !self.is_relative
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
pub struct Point {
    values: [Option<f64>; NUMBERS.len()],
    /// Speed of the other vehicle minus the ego's.
    relative_mps: Option<f64>,
}

impl Point {
    /// Values in SI units.
    pub(crate) fn of(given: impl IntoIterator<Item = (CaseQuantity, Option<f64>)>) -> Point {
        let mut point = Point::default();
        given.into_iter().for_each(|(quantity, si)| point.values[quantity as usize] = si);
        point
    }

    /// Sets the quantity of a parameter from a value in the parameter's unit.
    pub(crate) fn set(&mut self, parameter: &MapParameter, value: f64) {
        let set =
            if parameter.is_relative { &mut self.relative_mps } else { &mut self.values[parameter.quantity as usize] };
        *set = Some(parameter.si(value));
    }

    /// The same point with another value of a quantity, in SI units.
    #[must_use]
    pub(crate) fn with(mut self, quantity: CaseQuantity, si: f64) -> Point {
        self.values[quantity as usize] = Some(si);
        self
    }

    /// The value of a quantity; `None` if not set. A relative speed sets the other vehicle's.
    pub fn get(&self, quantity: CaseQuantity) -> Option<f64> {
        self.values[quantity as usize].or_else(|| {
            let relative_mps = self.relative_mps.filter(|_| quantity == CaseQuantity::OtherSpeed)?;
            let other_mps = self.values[CaseQuantity::EgoSpeed as usize]? + relative_mps;
            // Different units leave a rounding error of a standstill.
            Some(if other_mps.abs() < 1e-9 { 0.0 } else { other_mps })
        })
    }

    /// The value of a quantity that a case has; one that is not set follows from others: the other vehicle is as fast
    /// as the ego, all vehicles have one size, a lane change covers one lane.
    pub(super) fn value(&self, quantity: CaseQuantity) -> Option<f64> {
        self.get(quantity).or_else(|| match quantity {
            CaseQuantity::OtherSpeed => self.get(CaseQuantity::EgoSpeed),
            CaseQuantity::EgoLength => self.get(CaseQuantity::Length),
            CaseQuantity::EgoWidth => self.get(CaseQuantity::Width),
            CaseQuantity::LateralDistance => self.value(CaseQuantity::LaneWidth),
            CaseQuantity::LaneWidth => Some(LANE_WIDTH_M),
            CaseQuantity::AheadSpeed => Some(0.0),
            _ => None,
        })
    }

    /// The plain case of these values; unset quantities have the defaults of `simulate`.
    ///
    /// # Errors
    /// [`Error::Usage`] for a time headway of a stationary ego.
    pub fn plain_case(&self, category: Category, profile: &Profile) -> Result<PlainCase> {
        let frame = &profile.frame;
        let case = PlainCase::of(category, &|of| self.get(of), frame.default_length_m, frame.default_width_m);
        let deceleration = self.get(CaseQuantity::Deceleration).unwrap_or(0.0);
        check_headway(case.ego_speed_mps, self.get(CaseQuantity::Thw))?;
        let speed_mps = case.speed_mps;
        if speed_mps < 0.0 {
            let problem = format!("the other vehicle would drive backwards, at {speed_mps} m/s");
            let help = format!(
                "give relative speeds of at least minus the ego's speed; a map leaves such panels out, where both \
                        speeds belong to the panels (name other axes by {} and {})",
                option("x"),
                option("y")
            );
            return Err(Error::usage(Place::item("relative_speed"), problem, help));
        }
        // Avoids a negative zero.
        Ok(PlainCase { acceleration_mps2: if deceleration > 0.0 { -deceleration } else { 0.0 }, ..case })
    }
}
