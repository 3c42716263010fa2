//! Maps the names of a file to the parameters of a category, by equal names or by the user's renames, and converts
//! deterministic distributions to the axes of a grid.

use std::path::Path;

use super::distribution_file::{Deterministic, DistributionFile, Distributions, TextParameter, keep_distinct};
use crate::run::grid::{GridAxis, MAX_PANELS, MapParameter, Variations};
use crate::scenario::Category;
use crate::support::ranges::{GIVE_ONCE, repeated};
use crate::{Error, Place, Result};

/// The name of ours that ignores a parameter of a file.
const NONE: &str = "none";

/// `THEIRS=OURS` or `THEIRS=OURS*FACTOR`: our value is theirs times the factor. `THEIRS=none` ignores theirs.
#[derive(Debug, Clone, PartialEq)]
pub struct Rename {
    /// Name in the file.
    pub theirs: String,
    /// Name of one of our parameters.
    pub ours: String,
    /// Number of our units in one of theirs; below 0 for the opposite sign.
    pub factor: f64,
}

impl std::str::FromStr for Rename {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Rename, String> {
        const FORM: &str = "write THEIRS=OURS or THEIRS=OURS*FACTOR, such as Ego_Speed_kph=ego_speed_kmh";
        let (theirs, rest) = text.split_once('=').ok_or(FORM)?;
        let (ours, factor) = match rest.split_once('*') {
            None => (rest, 1.0),
            Some((ours, factor)) => {
                let factor = factor.trim().parse::<f64>().ok().filter(|f| (1e-9..=1e9).contains(&f.abs()));
                (ours, factor.ok_or("the factor must be a number that is not 0")?)
            }
        };
        if theirs.trim().is_empty() || ours.trim().is_empty() {
            return Err(FORM.to_owned());
        }
        Ok(Rename { theirs: theirs.trim().to_owned(), ours: ours.trim().to_owned(), factor })
    }
}

/// Names of a file in a category.
pub struct Names<'a> {
    /// Kind of scenario.
    pub category: Category,
    /// The user's renames.
    pub renames: &'a [Rename],
    /// The file, for messages.
    pub path: &'a Path,
}

impl Names<'_> {
    /// Finds the parameter of a name, and the factor to its unit; `None` for one that the user ignores.
    ///
    /// # Errors
    /// [`Error::Input`] for an unknown name without `--rename`; [`Error::Usage`] for a `--rename` to an unknown
    /// parameter.
    pub(super) fn find(&self, name: &str, line: u64) -> Result<Option<(&'static MapParameter, f64)>> {
        if let Some(rename) = self.renames.iter().find(|rename| rename.theirs == name) {
            if rename.ours == NONE {
                return Ok(None);
            }
            return Ok(Some((MapParameter::find(self.category, &rename.ours, "option `rename`")?, rename.factor)));
        }
        MapParameter::find(self.category, name, "").map(|parameter| Some((parameter, 1.0))).map_err(|error| {
            let Error::Usage { problem, help, .. } = error else { return error };
            let help = format!(
                "name it by option `rename` {name}=OURS or option `rename` {name}=OURS*FACTOR, or ignore it by option \
                 `rename` {name}={NONE}; {help}"
            );
            Error::input(Place::file(self.path).row(line).of(format!("parameter `{name}`")), problem, help)
        })
    }

    /// Converts a value to the parameter's unit, without rounding errors, and checks its range.
    ///
    /// # Errors
    /// [`Error::Input`] with the range.
    pub(crate) fn value(&self, (parameter, factor): (&MapParameter, f64), value: f64, line: u64) -> Result<f64> {
        let ours = if factor == 1.0 { value } else { (value * factor * 1e9).round() / 1e9 };
        parameter.check(ours, "").map_err(|error| {
            let place = Place::file(self.path).row(line).of(format!("parameter `{}`", parameter.key));
            Error::input(place, format!("{ours} cannot be used"), error.help().unwrap_or_default())
        })
    }

    /// The names of texts that no parameter takes, in one sentence; `None` without any.
    ///
    /// # Errors
    /// [`Error::Input`] for a text where a parameter needs a number; [`Error::Usage`] for a `--rename` to an unknown one.
    pub fn ignored_texts(&self, file: &DistributionFile) -> Result<Option<String>> {
        let mut ignored = Vec::new();
        for TextParameter { name, line, text } in &file.texts {
            let is_renamed = self.renames.iter().any(|rename| rename.theirs == *name);
            match self.find(name, *line) {
                Ok(None) => {}
                Ok(Some((parameter, _))) => {
                    let place = Place::file(self.path).row(*line).of(format!("parameter `{name}`"));
                    let problem = format!("`{text}` is not a number, and `{}` is one", parameter.key);
                    let help = "write a number: parameters and expressions are not evaluated";
                    return Err(Error::input(place, problem, help));
                }
                Err(error) if is_renamed => return Err(error),
                Err(_) => ignored.push(name.as_str()),
            }
        }
        let (of, list) = (file.path.display(), ignored.join(", "));
        Ok((!ignored.is_empty()).then(|| format!("{of}: texts are ignored, and nothing varies with them: {list}")))
    }

    /// Checks that every `--rename` names a parameter of the file, once.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(super) fn check_renames(&self, names: &[(&str, u64)]) -> Result<()> {
        for (at, rename) in self.renames.iter().enumerate() {
            if !names.iter().any(|(name, _)| *name == rename.theirs) {
                let known: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
                let problem = format!("the file has no parameter `{}`", rename.theirs);
                return Err(Error::usage(Place::option("rename"), problem, format!("it has {}", known.join(", "))));
            }
            if self.renames[..at].iter().any(|before| before.theirs == rename.theirs) {
                let problem = format!("`{}` is renamed twice", rename.theirs);
                return Err(Error::usage(Place::option("rename"), problem, "keep one of the two"));
            }
        }
        Ok(())
    }
}

/// The variations of a file.
///
/// # Errors
/// [`Error::Usage`] for a stochastic file; as `Names::find` and `Names::value`; [`Error::Input`] for a repeated
/// value, and for too many combinations of sets.
pub fn variations(file: &DistributionFile, names: &Names) -> Result<Variations> {
    names.check_renames(&file.names())?;
    names.ignored_texts(file)?;
    let Distributions::Deterministic(list) = &file.distributions else {
        let problem = format!("{} holds random parameters", file.path.display());
        let help = "draw from them by `sample`, with option `distribution` and option `category`";
        return Err(Error::usage(Place::option("distribution"), problem, help));
    };
    let mut all = Variations { axes: Vec::new(), set_axes: Vec::new(), set_rows: vec![Vec::new()] };
    for one in list {
        match one {
            Deterministic::Values { name, line, values } => {
                let Some(found) = names.find(name, *line)? else { continue };
                let values = values.iter().map(|v| names.value(found, *v, *line)).collect::<Result<Vec<_>>>()?;
                if let Some(problem) = repeated(values.iter().map(|v| (v.to_bits(), v))) {
                    let place = Place::file(&file.path).row(*line).of(format!("parameter `{name}`"));
                    return Err(Error::input(place, problem, GIVE_ONCE));
                }
                all.axes.push(GridAxis { parameter: found.0, values: rising(&values) });
            }
            Deterministic::Sets { names: of_set, line, rows } => {
                let all_found: Vec<Option<(&'static MapParameter, f64)>> =
                    of_set.iter().map(|name| names.find(name, *line)).collect::<Result<_>>()?;
                let row = |row: &Vec<f64>| {
                    let found = all_found.iter().zip(row).filter_map(|(found, value)| Some(((*found)?, value)));
                    found.map(|(f, v)| names.value(f, *v, *line)).collect::<Result<Vec<f64>>>()
                };
                let mut rows = rows.iter().map(row).collect::<Result<Vec<_>>>()?;
                let found: Vec<(&'static MapParameter, f64)> = all_found.iter().copied().flatten().collect();
                if found.len() < all_found.len() {
                    // Rows that differ in what is ignored alone are one.
                    keep_distinct(&mut rows);
                }
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

/// The distinct values in ascending order.
fn rising(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted
}
