//! One parameter and its values on a grid.

use lanesweep_model::scenario::Category;
use lanesweep_support::{Error, Place, Result};

use super::parameter::MapParameter;

/// Maximum number of values of one axis.
const MAX_VALUES: usize = 100_000;

/// A parameter with its values.
#[derive(Debug, Clone, PartialEq)]
pub struct GridAxis {
    /// The parameter.
    pub parameter: &'static MapParameter,
    /// Values in its unit, in order; at least one.
    pub values: Vec<f64>,
}

impl GridAxis {
    /// Parses `NAME=FROM..TO/STEP` (both ends included if the steps reach them), `NAME=A,B,C` or `NAME=A`; `flag` names
    /// the option in errors.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that the category does not have, for values that are not numbers or are out of the
    /// parameter's range, and for an empty list.
    pub fn parse(category: Category, text: &str, flag: &str) -> Result<GridAxis> {
        const FORM: &str = "write NAME=FROM..TO/STEP or NAME=A,B,C, for instance gap_m=1..60/1";
        let wrong = |problem: String, help: &str| Error::usage(Place::item(flag), problem, help);
        let (key, values) = text.split_once('=').ok_or_else(|| wrong(format!("`{text}` has no values"), FORM))?;
        let parameter = MapParameter::find(category, key.trim(), flag)?;
        let number = |part: &str| {
            let value = part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| wrong(format!("`{}` in `{text}` is not a number", part.trim()), FORM))
        };
        let values = match values.split_once("..") {
            None => values.split(',').map(number).collect::<Result<Vec<_>>>()?,
            Some((from, rest)) => {
                let (to, step) = rest.split_once('/').ok_or_else(|| wrong(format!("`{text}` has no step"), FORM))?;
                range((number(from)?, number(to)?), number(step)?, text, flag)?
            }
        };
        let values = values.into_iter().map(|value| parameter.check(value, flag)).collect::<Result<Vec<_>>>()?;
        if let Some(pair) = values.windows(2).find(|pair| pair[0] >= pair[1]) {
            let problem = format!("{} follows {} in `{text}`", pair[1], pair[0]);
            return Err(wrong(problem, "give every value once, in rising order"));
        }
        Ok(GridAxis { parameter, values })
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are no values; false for every parsed axis.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Edges of the values' cells: midpoints between neighbours; the outermost cells are symmetric around their values.
    /// One more than values.
    pub fn edges(&self) -> Vec<f64> {
        let v = &self.values;
        let Some((&first, &last)) = v.first().zip(v.last()) else { return Vec::new() };
        let before = v.get(1).map_or(0.5, |second| (second - first) / 2.0);
        let after = v.len().checked_sub(2).map_or(0.5, |k| (last - v[k]) / 2.0);
        let between = v.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0);
        std::iter::once(first - before).chain(between).chain(std::iter::once(last + after)).collect()
    }
}

/// FROM, FROM + STEP, … up to TO, rounded to decimals: 0.3 instead of 3 · 0.1.
fn range((from, to): (f64, f64), step: f64, text: &str, flag: &str) -> Result<Vec<f64>> {
    let wrong = |problem: String, help: &str| Error::usage(Place::item(flag), problem, help);
    if step <= 0.0 {
        return Err(wrong(format!("a step of {step} in `{text}` leads nowhere"), "give a step above 0"));
    }
    if to < from {
        return Err(wrong(format!("`{text}` is empty: {to} is below {from}"), "give the smaller end first"));
    }
    let steps = ((to - from) / step + 1e-9).floor();
    if steps >= MAX_VALUES as f64 {
        let help = format!("use a longer step: an axis holds {MAX_VALUES} values at most");
        return Err(wrong(format!("`{text}` has {:.0} values", steps + 1.0), &help));
    }
    Ok((0..=steps as u32).map(|k| decimal(from + f64::from(k) * step)).collect())
}

/// Rounds to nine decimals.
fn decimal(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}
