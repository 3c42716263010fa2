//! Makes a grid from the text of options. Describes the fixed values of all its cells.

use super::axis::GridAxis;
use super::parameter::MapParameter;
use super::{CaseStyle, Grid, GridParts, jrc_case};
use lanesweep_model::plausibility::Doubts;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{CaseQuantity, Category, LANE_WIDTH_M};
use lanesweep_support::{Error, Place, Result, option};

/// A grid as text: an axis is `NAME=FROM..TO/STEP` or `NAME=A,B,C`.
#[derive(Debug, Clone, Default)]
pub struct GridText {
    /// Horizontal axis.
    pub x: Option<String>,
    /// Vertical axis.
    pub y: Option<String>,
    /// Axes of the panels.
    pub panel: Vec<String>,
    /// `NAME=VALUE`: values that are equal in every cell.
    pub set: Vec<String>,
    /// Each model starts at its own distance.
    pub native_gap: bool,
    /// Skips panels in which the ego is not faster than the other vehicle.
    pub closing_only: bool,
}

impl GridText {
    /// Makes the grid.
    ///
    /// # Errors
    /// [`Error::Usage`] with the option that is missing or is not an axis.
    pub fn parts(&self, category: Category) -> Result<GridParts> {
        let axis = |text: &Option<String>, name: &str| match text.as_deref().map(str::trim) {
            Some(text) => GridAxis::parse(category, text, name),
            None => {
                let help = format!("give both {} and {}, or {}", option("x"), option("y"), option("preset"));
                Err(Error::usage(Place::item(name), "it is missing", help))
            }
        };
        let (x, y) = (axis(&self.x, &option("x"))?, axis(&self.y, &option("y"))?);
        let panel = |text: &String| GridAxis::parse(category, text, &option("panel"));
        Ok(GridParts {
            fixed: self.set.iter().map(|text| value(category, text)).collect::<Result<_>>()?,
            panel_axes: self.panel.iter().map(panel).collect::<Result<_>>()?,
            native_gap: self.native_gap,
            closing_only: self.closing_only,
            ..GridParts::new(category.key(), category, x, y)
        })
    }
}

fn value(category: Category, text: &str) -> Result<(&'static MapParameter, f64)> {
    let axis = GridAxis::parse(category, text, &option("set"))?;
    match axis.values[..] {
        [value] => Ok((axis.parameter, value)),
        _ => {
            let problem = format!("`{text}` has {} values", axis.len());
            Err(Error::usage(
                Place::option("set"),
                problem,
                format!("give one, or make it an axis with {}", option("panel")),
            ))
        }
    }
}

impl Grid {
    /// Checks the plausibility of every value and cell, and collects implausible ones.
    ///
    /// # Errors
    /// [`Error::Usage`] for a physically impossible value, unless such values are accepted.
    pub fn check_plausible(&self, profile: &Profile, doubts: &mut Doubts) -> Result<()> {
        for axis in [&self.x, &self.y].into_iter().chain(&self.panel_axes) {
            axis.values.iter().try_for_each(|value| axis.parameter.check_plausible(*value, doubts))?;
        }
        self.fixed.iter().try_for_each(|(parameter, value)| parameter.check_plausible(*value, doubts))?;
        for cell in 0..self.cell_count() {
            // A cell that is no case is refused later.
            let Ok(case) = self.point(cell).plain_case(self.category, profile) else { continue };
            case.check_plausible(doubts, &|key| format!("cell {cell}, {key}"));
        }
        Ok(())
    }

    /// Phrases such as `initial time headway 2 s`: the fixed values, then defaults of parameters that the grid does not
    /// set.
    pub fn held(&self, profile: &Profile) -> Vec<String> {
        let number = |value: f64| format!("{}", (value * 1e6).round() / 1e6);
        let mut held: Vec<String> = (self.fixed.iter())
            .map(|(parameter, value)| {
                let mut label = parameter.label.to_owned();
                label[..1].make_ascii_lowercase();
                format!("{label} {} {}", number(*value), parameter.unit)
            })
            .collect();
        let (category, is_jrc) = (self.category, self.style != CaseStyle::Plain);
        let point = self.point(0);
        let sets = |quantity| point.get(quantity).is_some();
        if !sets(CaseQuantity::OtherSpeed) {
            held.push("the other vehicle starts as fast as the ego".to_owned());
        }
        if !sets(CaseQuantity::Deceleration) {
            held.push("the other vehicle keeps its speed".to_owned());
        } else if !sets(CaseQuantity::EndSpeed) {
            held.push("the other vehicle decelerates to a standstill".to_owned());
        }
        if category == Category::CutOut && !sets(CaseQuantity::AheadSpeed) {
            held.push("the vehicle ahead stands".to_owned());
        }
        if category != Category::Lvd && !sets(CaseQuantity::LateralDistance) {
            let distance_m = match (is_jrc, category) {
                (false, _) => point.get(CaseQuantity::LaneWidth).unwrap_or(LANE_WIDTH_M),
                (true, Category::CutOut) => jrc_case::CUT_OUT_LATERAL_M,
                (true, _) => jrc_case::CUT_IN_LATERAL_M,
            };
            held.push(format!("lateral distance {} m", number(distance_m)));
        }
        // A size that the grid sets is not a default.
        let size = |quantity, of_jrc_m: f64, of_profile_m: f64| {
            (!sets(quantity)).then(|| format!("{} m", number(if is_jrc { of_jrc_m } else { of_profile_m })))
        };
        let length = size(CaseQuantity::Length, jrc_case::LENGTH_M, profile.frame.default_length_m);
        let width = size(CaseQuantity::Width, jrc_case::WIDTH_M, profile.frame.default_width_m);
        held.extend(match (length, width) {
            (Some(length), Some(width)) => Some(format!("vehicles {length} × {width}")),
            (Some(length), None) => Some(format!("vehicles {length} long")),
            (None, Some(width)) => Some(format!("vehicles {width} wide")),
            (None, None) => None,
        });
        if is_jrc && category == Category::CutOut {
            held.push(format!("a standing vehicle ahead {} m long", number(jrc_case::STANDING_LENGTH_M)));
        }
        held.push(format!("time step {} s", number(profile.frame.dt_s)));
        held
    }
}
