//! The reader of `ParameterValueDistribution` files, ASAM OpenSCENARIO XML 1.1 to 1.3.
//!
//! Only elements and attributes that the standard allows are accepted; any other one is an error with its line, so that
//! nothing is ignored silently. The scenario that the file names is not read.

use std::path::{Path, PathBuf};

use super::distribution::{Distribution, MAX_POISSON, Range};
use super::xml_at::{At, parse};
use crate::run::grid::{GridAxis, MAX_VALUES};
use crate::support::input_file;
use crate::{Error, Place, Result};

/// The content of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct DistributionFile {
    /// The file, for messages.
    pub path: PathBuf,
    /// The distributions.
    pub distributions: Distributions,
}

/// The two kinds of distributions.
#[derive(Debug, Clone, PartialEq)]
pub enum Distributions {
    /// Every combination of listed values.
    Deterministic(Vec<Deterministic>),
    /// Random values.
    Stochastic(Stochastic),
}

/// One deterministic distribution.
#[derive(Debug, Clone, PartialEq)]
pub enum Deterministic {
    /// Values of one parameter: a set, or the steps of a range.
    Values {
        /// Name in the file.
        name: String,
        /// Line.
        line: u64,
        /// Values, at least one.
        values: Vec<f64>,
    },
    /// Combined values of several parameters.
    Sets {
        /// Names in the file.
        names: Vec<String>,
        /// Line.
        line: u64,
        /// Rows with one value per parameter; at least one row.
        rows: Vec<Vec<f64>>,
    },
}

/// Independent random parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Stochastic {
    /// `numberOfTestRuns`, ≥ 1.
    pub runs: u64,
    /// `randomSeed`, if given.
    pub seed: Option<u64>,
    /// Name, line and distribution of each parameter, in order.
    pub parameters: Vec<(String, u64, Distribution)>,
}

/// Reads a file.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] with line and element for another kind of file, an unknown element, or contradictory
/// values.
pub fn read_distribution(path: &Path) -> Result<DistributionFile> {
    parse_distribution(&input_file::read_text(path, input_file::MAX_XML_BYTES)?, path)
}

/// Parses a file's text; `path` is for messages.
///
/// # Errors
/// As [`read_distribution`].
pub fn parse_distribution(text: &str, path: &Path) -> Result<DistributionFile> {
    let document = parse(text, path)?;
    let at = At { node: document.root_element(), path };
    if at.name() != "OpenSCENARIO" {
        return Err(at.wrong("the root element is not `OpenSCENARIO`", "give a file of ASAM OpenSCENARIO XML"));
    }
    let has = |name: &str| at.all().any(|child| child.name() == name);
    if !has("ParameterValueDistribution") && (has("Storyboard") || has("Catalog")) {
        let help = "give the file whose `ParameterValueDistribution` varies the scenario's parameters";
        return Err(at.wrong("this is a scenario or a catalog, and no distribution of parameters", help));
    }
    at.children(&["FileHeader", "ParameterValueDistribution"])?;
    let header = at.only("FileHeader")?;
    let revision = (header.text("revMajor")?, header.text("revMinor")?);
    if !matches!(revision, ("1", "1" | "2" | "3")) {
        let problem = format!("it is of revision {}.{}", revision.0, revision.1);
        return Err(header.wrong(problem, "distributions are read of revisions 1.1 to 1.3"));
    }
    let content = at.only("ParameterValueDistribution")?;
    content.attributes(&[])?;
    content.children(&["ScenarioFile", "Deterministic", "Stochastic"])?;
    content.only("ScenarioFile")?.attributes(&["filepath"])?;
    let kinds: Vec<At> = content.all().filter(|child| child.name() != "ScenarioFile").collect();
    let [kind] = kinds[..] else {
        let help = "give one of `Deterministic` and `Stochastic`";
        return Err(content.wrong(format!("it has {} kinds of distributions", kinds.len()), help));
    };
    let distributions = if kind.name() == "Deterministic" {
        Distributions::Deterministic(deterministic(kind)?)
    } else {
        Distributions::Stochastic(stochastic(kind)?)
    };
    let file = DistributionFile { path: path.to_path_buf(), distributions };
    file.check_names()?;
    Ok(file)
}

impl DistributionFile {
    /// Names and lines of all parameters, in order.
    pub fn names(&self) -> Vec<(&str, u64)> {
        match &self.distributions {
            Distributions::Deterministic(list) => list
                .iter()
                .flat_map(|one| match one {
                    Deterministic::Values { name, line, .. } => vec![(name.as_str(), *line)],
                    Deterministic::Sets { names, line, .. } => names.iter().map(|n| (n.as_str(), *line)).collect(),
                })
                .collect(),
            Distributions::Stochastic(all) => all.parameters.iter().map(|(n, line, _)| (n.as_str(), *line)).collect(),
        }
    }

    fn check_names(&self) -> Result<()> {
        let names = self.names();
        for (at, (name, line)) in names.iter().enumerate() {
            if let Some((_, before)) = names[..at].iter().find(|(known, _)| known == name) {
                let problem = format!("`{name}` has a distribution already, in line {before}");
                return Err(Error::input(Place::file(&self.path).row(*line), problem, "keep one of the two"));
            }
        }
        Ok(())
    }
}

fn deterministic(at: At) -> Result<Vec<Deterministic>> {
    const SINGLE: &str = "DeterministicSingleParameterDistribution";
    const MULTI: &str = "DeterministicMultiParameterDistribution";
    at.attributes(&[])?;
    at.children(&[SINGLE, MULTI])?;
    let mut list = Vec::new();
    for one in at.all() {
        list.push(if one.name() == SINGLE { single(one)? } else { multi(one)? });
    }
    if list.is_empty() {
        return Err(at.wrong("there is no distribution in it", format!("add a `{SINGLE}`")));
    }
    Ok(list)
}

fn single(at: At) -> Result<Deterministic> {
    at.attributes(&["parameterName"])?;
    let name = at.text("parameterName")?.to_owned();
    let inner = at.choice(&["DistributionSet", "DistributionRange"])?;
    let values = if inner.name() == "DistributionSet" {
        inner.attributes(&[])?;
        let each = |element: At| {
            element.attributes(&["value"])?;
            element.children(&[])?;
            element.number("value")
        };
        inner.some("Element")?.into_iter().map(each).collect::<Result<Vec<_>>>()?
    } else {
        inner.attributes(&["stepWidth"])?;
        inner.children(&["Range"])?;
        let range = inner.only("Range")?.range()?;
        let step = inner.number("stepWidth")?;
        GridAxis::steps((range.low, range.high), step, "DistributionRange").map_err(|e| inner.because(&e))?
    };
    if values.len() > MAX_VALUES {
        return Err(inner.wrong(format!("{} values", values.len()), format!("give {MAX_VALUES} at most")));
    }
    Ok(Deterministic::Values { name, line: at.line(), values })
}

fn multi(at: At) -> Result<Deterministic> {
    at.attributes(&[])?;
    let inner = at.choice(&["ValueSetDistribution"])?;
    inner.attributes(&[])?;
    let mut known: Option<Vec<String>> = None;
    let mut rows = Vec::new();
    for set in inner.some("ParameterValueSet")? {
        set.attributes(&[])?;
        let mut values: Vec<(String, f64)> = Vec::new();
        for assignment in set.some("ParameterAssignment")? {
            assignment.attributes(&["parameterRef", "value"])?;
            assignment.children(&[])?;
            let name = assignment.text("parameterRef")?;
            if values.iter().any(|(before, _)| before == name) {
                return Err(
                    assignment.wrong(format!("`{name}` has a value in this set already"), "keep one of the two")
                );
            }
            values.push((name.to_owned(), assignment.number("value")?));
        }
        let names = known.get_or_insert_with(|| values.iter().map(|(name, _)| name.clone()).collect());
        let value = |name: &String| values.iter().find(|(n, _)| n == name).map(|(_, value)| *value);
        let row: Option<Vec<f64>> = names.iter().map(value).collect();
        match row.filter(|row| row.len() == values.len()) {
            Some(row) => rows.push(row),
            None => {
                let problem =
                    format!("this set does not assign the same parameters as the first ({})", names.join(", "));
                return Err(set.wrong(problem, "assign the same parameters in every set"));
            }
        }
    }
    Ok(Deterministic::Sets { names: known.unwrap_or_default(), line: at.line(), rows })
}

fn stochastic(at: At) -> Result<Stochastic> {
    at.attributes(&["numberOfTestRuns", "randomSeed"])?;
    at.children(&["StochasticDistribution"])?;
    // Seeds are doubles in the standard; below 2^53 a double represents every integer.
    let whole = |name: &str, min: f64| {
        let value = at.number(name)?;
        if value.fract() == 0.0 && (min..9_007_199_254_740_992.0).contains(&value) {
            return Ok(value as u64);
        }
        let problem = format!("the attribute `{name}` is {value}");
        Err(at.wrong(problem, format!("write a whole number of at least {min} and below 2^53")))
    };
    let seed = at.has("randomSeed").then(|| whole("randomSeed", 0.0)).transpose()?;
    let mut parameters = Vec::new();
    for one in at.some("StochasticDistribution")? {
        one.attributes(&["parameterName"])?;
        parameters.push((one.text("parameterName")?.to_owned(), one.line(), distribution(one)?));
    }
    Ok(Stochastic { runs: whole("numberOfTestRuns", 1.0)?, seed, parameters })
}

fn distribution(at: At) -> Result<Distribution> {
    let inner = at.choice(&[
        "ProbabilityDistributionSet",
        "NormalDistribution",
        "UniformDistribution",
        "PoissonDistribution",
        "Histogram",
    ])?;
    let within = || match inner.all().next() {
        Some(_) => {
            inner.children(&["Range"])?;
            inner.only("Range")?.range()
        }
        None => Ok(Range::ALL),
    };
    let at_least_zero = |one: At, name: &str| {
        let value = one.number(name)?;
        if value >= 0.0 {
            return Ok(value);
        }
        Err(one.wrong(format!("the attribute `{name}` is {value}"), "write a number of at least 0"))
    };
    let found = match inner.name() {
        "UniformDistribution" => {
            inner.attributes(&[])?;
            inner.children(&["Range"])?;
            Distribution::Uniform(inner.only("Range")?.range()?)
        }
        "NormalDistribution" => {
            inner.attributes(&["expectedValue", "variance"])?;
            let deviation = at_least_zero(inner, "variance")?.sqrt();
            Distribution::Normal { mean: inner.number("expectedValue")?, deviation, range: within()? }
        }
        "PoissonDistribution" => {
            inner.attributes(&["expectedValue"])?;
            let mean = at_least_zero(inner, "expectedValue")?;
            if mean > MAX_POISSON {
                let help = format!("write at most {MAX_POISSON}, or a normal distribution, which it nearly is");
                return Err(inner.wrong(format!("the attribute `expectedValue` is {mean}"), help));
            }
            Distribution::Poisson { mean, range: within()? }
        }
        "Histogram" => {
            inner.attributes(&[])?;
            let mut bins: Vec<(Range, f64)> = Vec::new();
            for bin in inner.some("Bin")? {
                bin.attributes(&["weight"])?;
                bin.children(&["Range"])?;
                let range = bin.only("Range")?.range()?;
                if bins.last().is_some_and(|(before, _)| range.low < before.high) {
                    let help = "give bins in rising order, none over another";
                    return Err(bin.wrong("this bin begins before the one above it ends", help));
                }
                bins.push((range, at_least_zero(bin, "weight")?));
            }
            Distribution::Histogram(bins)
        }
        _ => {
            inner.attributes(&[])?;
            let mut values = Vec::new();
            for element in inner.some("Element")? {
                element.attributes(&["value", "weight"])?;
                element.children(&[])?;
                values.push((element.number("value")?, at_least_zero(element, "weight")?));
            }
            Distribution::Set(values)
        }
    };
    if found.within(Range::ALL).is_none() {
        let help = "give a range that holds some of the distribution, and a weight above 0";
        return Err(inner.wrong("no value of it is possible", help));
    }
    Ok(found)
}
