//! Deterministic distributions as the axes of a grid.

use super::distribution_file::{Deterministic, DistributionFile, Distributions};
use super::parameters::Names;
use crate::run::grid::{GridAxis, MAX_PANELS, MapParameter, Variations};
use crate::support::ranges::{GIVE_ONCE, repeated};
use crate::{Error, Place, Result};

/// The variations of a file.
///
/// # Errors
/// [`Error::Usage`] for a stochastic file; as [`Names::find`] and [`Names::value`]; [`Error::Input`] for a value that is
/// there twice, and for too many combinations of sets.
pub fn variations(file: &DistributionFile, names: &Names) -> Result<Variations> {
    names.check_renames(&file.names())?;
    let Distributions::Deterministic(list) = &file.distributions else {
        let problem = format!("{} holds random parameters", file.path.display());
        let help = "draw from them by `sample`, with option `distribution` and option `category`";
        return Err(Error::usage(Place::option("distribution"), problem, help));
    };
    let mut all = Variations { axes: Vec::new(), set_axes: Vec::new(), set_rows: vec![Vec::new()] };
    for one in list {
        match one {
            Deterministic::Values { name, line, values } => {
                let found = names.find(name, *line)?;
                let values = values.iter().map(|v| names.value(found, *v, *line)).collect::<Result<Vec<_>>>()?;
                if let Some(problem) = repeated(values.iter().map(|v| (v.to_bits(), v))) {
                    let place = Place::file(&file.path).row(*line).of(format!("parameter `{name}`"));
                    return Err(Error::input(place, problem, GIVE_ONCE));
                }
                all.axes.push(GridAxis { parameter: found.0, values: rising(&values) });
            }
            Deterministic::Sets { names: of_set, line, rows } => {
                let found: Vec<(&'static MapParameter, f64)> =
                    of_set.iter().map(|name| names.find(name, *line)).collect::<Result<_>>()?;
                let row = |row: &Vec<f64>| {
                    found.iter().zip(row).map(|(f, v)| names.value(*f, *v, *line)).collect::<Result<Vec<f64>>>()
                };
                let rows = rows.iter().map(row).collect::<Result<Vec<_>>>()?;
                let text = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
                if let Some(problem) = repeated(rows.iter().map(text).map(|row| (row.clone(), row))) {
                    let place = Place::file(&file.path).row(*line).of("value sets");
                    return Err(Error::input(place, problem, GIVE_ONCE));
                }
                if all.set_rows.len().saturating_mul(rows.len()) > MAX_PANELS {
                    let place = Place::file(&file.path).row(*line);
                    let help = format!("a map has {MAX_PANELS} panels at most: give fewer sets");
                    return Err(Error::input(place, "the sets make too many combinations", help));
                }
                for (at, (parameter, _)) in found.iter().enumerate() {
                    let values = rising(&rows.iter().map(|row| row[at]).collect::<Vec<_>>());
                    all.set_axes.push(GridAxis { parameter, values });
                }
                let joined = |before: &Vec<f64>| {
                    let before = before.clone();
                    rows.iter().map(move |row| [&before[..], row].concat()).collect::<Vec<_>>()
                };
                all.set_rows = all.set_rows.iter().flat_map(joined).collect();
            }
        }
    }
    Ok(all)
}

/// Every value once, in rising order.
fn rising(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted
}
