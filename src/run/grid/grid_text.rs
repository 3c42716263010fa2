//! Makes a grid from the text of options, and from the variations of a distribution file. Describes the fixed values of
//! all its cells.

use super::axis::GridAxis;
use super::parameter::MapParameter;
use super::{CaseStyle, Grid, GridParts, MAX_PANELS, jrc_case};
use crate::model::profile::Profile;
use crate::scenario::{CaseQuantity, Category, LANE_WIDTH_M};
use crate::support::plausibility::Doubts;
use crate::{Error, Place, Result};

/// A grid as text: an axis is `NAME=FROM..TO/STEP` or `NAME=A,B,C`.
#[derive(Debug, Clone, Default)]
pub struct GridText {
    /// Horizontal axis; with variations also the name of one of them.
    pub x: Option<String>,
    /// Vertical axis, as `x`.
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

/// The variations of a distribution file.
#[derive(Debug, Clone, PartialEq)]
pub struct Variations {
    /// Independent parameters in the file's order; values ascend.
    pub axes: Vec<GridAxis>,
    /// Parameters that vary together; values are those of all rows.
    pub set_axes: Vec<GridAxis>,
    /// Their rows: every combination of the file's value sets. One empty row if there are none.
    pub set_rows: Vec<Vec<f64>>,
}

impl GridText {
    /// Makes the grid. With variations, the first two parameters with several values are the axes, unless `x` and `y`
    /// name others; the remaining ones make the panels.
    ///
    /// # Errors
    /// [`Error::Usage`] with the option that is missing, is not an axis, or makes too many panels.
    pub fn parts(&self, category: Category, variations: Option<Variations>) -> Result<GridParts> {
        let is_of_file = variations.is_some();
        let none = Variations { axes: Vec::new(), set_axes: Vec::new(), set_rows: vec![Vec::new()] };
        let Variations { axes: mut left, set_axes, set_rows: mut rows } = variations.unwrap_or(none);
        let mut axis = |text: &Option<String>, name: &str| -> Result<GridAxis> {
            let wrong = |problem: String, help: String| Error::usage(Place::item(name), problem, help);
            match text.as_deref().map(str::trim) {
                Some(text) if text.contains('=') || !is_of_file => GridAxis::parse(category, text, name),
                None if !is_of_file => {
                    let help = "give both option `x` and option `y`, or option `preset`";
                    Err(wrong("it is missing".to_owned(), help.to_owned()))
                }
                Some(key) => {
                    let parameter = MapParameter::find(category, key, name)?;
                    let at = left.iter().position(|axis| axis.parameter == parameter);
                    at.map(|at| left.remove(at)).ok_or_else(|| {
                        let problem = format!("the file has no separate distribution of `{key}`");
                        wrong(problem, format!("give its values: {name} {key}=FROM..TO/STEP"))
                    })
                }
                None => {
                    // Panels can leave out relative speeds that are none, axes cannot.
                    let has_relative = left.iter().any(|axis| axis.parameter.is_relative);
                    let is_speed = |axis: &GridAxis| {
                        let is_ego = axis.parameter.quantity == CaseQuantity::EgoSpeed;
                        has_relative && (is_ego || axis.parameter.is_relative)
                    };
                    let several = left.iter().position(|axis| axis.len() > 1 && !is_speed(axis));
                    let several = several.or_else(|| left.iter().position(|axis| axis.len() > 1));
                    let at = several.or(if left.is_empty() { None } else { Some(0) });
                    at.map(|at| left.remove(at)).ok_or_else(|| {
                        let problem = "the file has fewer than two parameters with separate distributions";
                        let help = format!("a map has two axes: give one by {name} NAME=FROM..TO/STEP");
                        wrong(problem.to_owned(), help)
                    })
                }
            }
        };
        // Excludes the parameter of `y` from the candidates for `x`.
        let (x, y) = if self.x.is_none() && self.y.is_some() {
            let y = axis(&self.y, "option `y`")?;
            (axis(&self.x, "option `x`")?, y)
        } else {
            let x = axis(&self.x, "option `x`")?;
            (x, axis(&self.y, "option `y`")?)
        };
        let mut fixed = self.set.iter().map(|text| value(category, text)).collect::<Result<Vec<_>>>()?;
        fixed.extend(left.iter().filter(|axis| axis.len() == 1).map(|axis| (axis.parameter, axis.values[0])));
        left.retain(|axis| axis.len() > 1);
        let panel = |text: &String| GridAxis::parse(category, text, "option `panel`");
        left.extend(self.panel.iter().map(panel).collect::<Result<Vec<_>>>()?);
        for axis in left.iter().filter(|_| is_of_file) {
            if rows.len().saturating_mul(axis.len()) > MAX_PANELS {
                let help = format!("give fewer values: a sheet has at most {MAX_PANELS} panels");
                return Err(Error::usage(Place::option("distribution"), "too many panels", help));
            }
            let with = |row: &Vec<f64>, value: f64| [&row[..], &[value]].concat();
            rows = rows.iter().flat_map(|row| axis.values.iter().map(move |v| with(row, *v))).collect();
        }
        Ok(GridParts {
            panel_axes: set_axes.into_iter().chain(left).collect(),
            fixed,
            native_gap: self.native_gap,
            closing_only: self.closing_only,
            panel_rows: is_of_file.then_some(rows),
            ..GridParts::new(category.key(), category, x, y)
        })
    }
}

fn value(category: Category, text: &str) -> Result<(&'static MapParameter, f64)> {
    let axis = GridAxis::parse(category, text, "option `set`")?;
    match axis.values[..] {
        [value] => Ok((axis.parameter, value)),
        _ => {
            let problem = format!("`{text}` has {} values", axis.len());
            Err(Error::usage(Place::option("set"), problem, "give one, or make it an axis with option `panel`"))
        }
    }
}

impl GridParts {
    /// Checks the plausibility of every value and collects implausible ones.
    ///
    /// # Errors
    /// [`Error::Usage`] for a physically impossible value, unless such values are accepted.
    pub fn check_plausible(&self, doubts: &mut Doubts) -> Result<()> {
        for axis in [&self.x, &self.y].into_iter().chain(&self.panel_axes) {
            axis.values.iter().try_for_each(|value| axis.parameter.check_plausible(*value, doubts))?;
        }
        self.fixed.iter().try_for_each(|(parameter, value)| parameter.check_plausible(*value, doubts))
    }
}

impl Grid {
    /// Phrases such as `initial time headway 2 s`: the fixed values, then defaults of parameters that the grid does not
    /// set.
    pub fn held(&self, profile: &Profile) -> Vec<String> {
        let number = |value: f64| format!("{}", (value * 1e6).round() / 1e6);
        let mut held: Vec<String> = (self.fixed().iter())
            .map(|(parameter, value)| {
                let mut label = parameter.label.to_owned();
                label[..1].make_ascii_lowercase();
                format!("{label} {} {}", number(*value), parameter.unit)
            })
            .collect();
        let (category, is_jrc) = (self.category(), self.style() != CaseStyle::Plain);
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
