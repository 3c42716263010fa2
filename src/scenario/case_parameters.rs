//! A concrete case from the few numbers that a user gives: on the command line, in a file, in a row of a table.

use super::{Category, LATERAL_DISTANCE_M, PlainCase};
use crate::support::plausibility::{Doubts, HELP, Quantity};
use crate::{Error, Place, Result};

/// What was given; speeds in m/s, lengths in m, accelerations in m/s². The names are the flags of `simulate`.
#[derive(Debug, Clone, Default, PartialEq)]
#[allow(missing_docs)] // see PlainCase
pub struct CaseParameters {
    pub category: Option<String>,
    pub ego_speed: Option<f64>,
    pub speed: Option<f64>,
    pub lateral_speed: Option<f64>,
    pub lateral_distance: Option<f64>,
    pub acceleration: Option<f64>,
    pub end_speed: Option<f64>,
    pub ahead_speed: Option<f64>,
    pub ahead_gap: Option<f64>,
    pub length: Option<f64>,
    pub width: Option<f64>,
}

impl CaseParameters {
    /// The kind of scenario.
    ///
    /// # Errors
    /// [`Error::Usage`] where it is missing or unknown.
    pub fn category(&self) -> Result<Category> {
        let text = needed(self.category.as_ref(), "category", "cut-in, cut-out or lvd")?;
        Category::parse(text).ok_or_else(|| {
            Error::usage(
                Place::item("category"),
                format!("there is no category `{text}`"),
                "use cut-in, cut-out or lvd",
            )
        })
    }

    /// Speeds that are noise of a standing vehicle become 0, and are counted; `place` says where a key stands.
    pub fn settle(&mut self, doubts: &mut Doubts, place: impl Fn(&str) -> String) {
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

    /// Looks at what was given.
    ///
    /// # Errors
    /// [`Error::Usage`] for a value beyond the physical range, unless such are accepted.
    pub fn judge(&self, doubts: &mut Doubts) -> Result<()> {
        let given = [
            ("ego_speed", Quantity::Speed, self.ego_speed),
            ("speed", Quantity::Speed, self.speed),
            ("end_speed", Quantity::Speed, self.end_speed),
            ("ahead_speed", Quantity::Speed, self.ahead_speed),
            ("lateral_speed", Quantity::LateralSpeed, self.lateral_speed),
            ("lateral_distance", Quantity::LateralPosition, self.lateral_distance),
            ("acceleration", Quantity::Acceleration, self.acceleration),
            ("ahead_gap", Quantity::Gap, self.ahead_gap),
            ("length", Quantity::Length, self.length),
            ("width", Quantity::Width, self.width),
        ];
        for (key, quantity, value) in given {
            let Some(value) = value else { continue };
            doubts
                .judge(quantity, value, || key.to_owned())
                .map_err(|problem| Error::usage(Place::item(key), problem, HELP))?;
        }
        Ok(())
    }

    /// The case; vehicles have the size given here by default.
    ///
    /// # Errors
    /// [`Error::Usage`] that names what is missing or out of range.
    pub fn plain_case(&self, length_m: f64, width_m: f64) -> Result<PlainCase> {
        let category = self.category()?;
        self.refuse_of_other_categories(category)?;
        let ego_speed_mps =
            at_least(*needed(self.ego_speed.as_ref(), "ego_speed", "a speed in m/s")?, 0.0, "ego_speed")?;
        let length_m = above_zero(self.length.unwrap_or(length_m), "length")?;
        let width_m = above_zero(self.width.unwrap_or(width_m), "width")?;
        let speed_mps = at_least(self.speed.unwrap_or(ego_speed_mps), 0.0, "speed")?;
        let acceleration_mps2 = at_least(self.acceleration.unwrap_or(0.0), f64::NEG_INFINITY, "acceleration")?;
        let end_speed_mps = self.end_speed.map(|v| at_least(v, 0.0, "end_speed")).transpose()?;
        let lateral_distance_m =
            at_least(self.lateral_distance.unwrap_or(LATERAL_DISTANCE_M), 0.0, "lateral_distance")?;
        let lateral_speed_mps = match category {
            Category::Lvd => 0.0,
            Category::CutIn | Category::CutOut => {
                let rate = *needed(self.lateral_speed.as_ref(), "lateral_speed", "a speed in m/s")?;
                above_zero(rate, "lateral_speed")?
            }
        };
        let (ahead_gap_m, ahead_speed_mps) = if category == Category::CutOut {
            let gap_m = at_least(*needed(self.ahead_gap.as_ref(), "ahead_gap", "a gap in m")?, 0.0, "ahead_gap")?;
            (gap_m, at_least(self.ahead_speed.unwrap_or(0.0), 0.0, "ahead_speed")?)
        } else {
            (0.0, 0.0)
        };
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
        })
    }

    /// Refuses parameters that the category does not have. 0 is accepted, as it means none.
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

/// What a user has to give.
fn needed<'a, T>(value: Option<&'a T>, key: &str, what: &str) -> Result<&'a T> {
    value.ok_or_else(|| {
        Error::usage(
            Place::item(key),
            "it is missing",
            format!("give {what} with option `{key}` or as `{key}` in the file"),
        )
    })
}

/// Beyond this no speed, length or acceleration is physical.
const MAX_MAGNITUDE: f64 = 1e6;

pub(crate) fn at_least(value: f64, least: f64, key: &str) -> Result<f64> {
    if value.abs() <= MAX_MAGNITUDE && value >= least {
        return Ok(value);
    }
    let expected = if least.is_finite() {
        format!("a number of at least {least} and at most 1e6")
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
