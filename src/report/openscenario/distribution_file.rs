//! The reader of `ParameterValueDistribution` files, ASAM OpenSCENARIO XML 1.1 to 1.3.
//!
//! Only elements and attributes that the standard allows are accepted; any other one is an error with its line, so that
//! nothing is ignored silently. Parameters whose values are texts (a road, a model of a vehicle) are kept by name alone. The
//! scenario that the file names is not read.

use std::collections::BTreeSet;
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
    /// The distributions of numbers.
    pub distributions: Distributions,
    /// The parameters with other values than numbers.
    pub texts: Vec<TextParameter>,
}

/// A parameter whose values are not all numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct TextParameter {
    /// Name in the file.
    pub name: String,
    /// Line of the first value that is not a number.
    pub line: u64,
    /// That value.
    pub text: String,
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
    content.shape(&[], &["ScenarioFile", "Deterministic", "Stochastic"])?;
    content.only("ScenarioFile")?.attributes(&["filepath"])?;
    let kinds: Vec<At> = content.all().filter(|child| child.name() != "ScenarioFile").collect();
    let [kind] = kinds[..] else {
        let help = "give one of `Deterministic` and `Stochastic`";
        return Err(content.wrong(format!("it has {} kinds of distributions", kinds.len()), help));
    };
    let mut texts = Vec::new();
    let distributions = if kind.name() == "Deterministic" {
        Distributions::Deterministic(deterministic(kind, &mut texts)?)
    } else {
        Distributions::Stochastic(stochastic(kind, &mut texts)?)
    };
    let file = DistributionFile { path: path.to_path_buf(), distributions, texts };
    file.check_names()?;
    Ok(file)
}

impl DistributionFile {
    /// Names and lines of all parameters: in order, then those with texts.
    pub(crate) fn names(&self) -> Vec<(&str, u64)> {
        let mut names: Vec<(&str, u64)> = match &self.distributions {
            Distributions::Deterministic(list) => list
                .iter()
                .flat_map(|one| match one {
                    Deterministic::Values { name, line, .. } => vec![(name.as_str(), *line)],
                    Deterministic::Sets { names, line, .. } => names.iter().map(|n| (n.as_str(), *line)).collect(),
                })
                .collect(),
            Distributions::Stochastic(all) => all.parameters.iter().map(|(n, line, _)| (n.as_str(), *line)).collect(),
        };
        names.extend(self.texts.iter().map(|text| (text.name.as_str(), text.line)));
        names
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

/// The values of an attribute of some elements; `None` if one is not a number, and then the parameter is among the texts.
fn values(name: &str, of: &[At], attribute: &str, texts: &mut Vec<TextParameter>) -> Result<Option<Vec<f64>>> {
    let mut numbers = Vec::new();
    for one in of {
        match one.value(attribute) {
            // A missing attribute is an error, a text is not.
            Some(text) if one.number(attribute).is_err() => {
                texts.push(TextParameter { name: name.to_owned(), line: one.line(), text: text.to_owned() });
                return Ok(None);
            }
            _ => numbers.push(one.number(attribute)?),
        }
    }
    Ok(Some(numbers))
}

fn deterministic(at: At, texts: &mut Vec<TextParameter>) -> Result<Vec<Deterministic>> {
    const SINGLE: &str = "DeterministicSingleParameterDistribution";
    const MULTI: &str = "DeterministicMultiParameterDistribution";
    at.shape(&[], &[SINGLE, MULTI])?;
    let mut list = Vec::new();
    for one in at.all() {
        list.extend(if one.name() == SINGLE { single(one, texts)? } else { multi(one, texts)? });
    }
    if list.is_empty() && texts.is_empty() {
        return Err(at.wrong("there is no distribution in it", format!("add a `{SINGLE}`")));
    }
    Ok(list)
}

fn single(at: At, texts: &mut Vec<TextParameter>) -> Result<Option<Deterministic>> {
    at.attributes(&["parameterName"])?;
    let name = at.text("parameterName")?.to_owned();
    let inner = at.choice(&["DistributionSet", "DistributionRange"])?;
    let values = if inner.name() == "DistributionSet" {
        inner.attributes(&[])?;
        let elements = inner.some("Element")?;
        elements.iter().try_for_each(|element| element.shape(&["value"], &[]))?;
        let Some(values) = values(&name, &elements, "value", texts)? else { return Ok(None) };
        values
    } else {
        inner.shape(&["stepWidth"], &["Range"])?;
        let range = inner.only("Range")?.range()?;
        let step = inner.number("stepWidth")?;
        GridAxis::steps((range.low, range.high), step, "DistributionRange")
            .map_err(|e| inner.wrong(e.to_string(), e.help().unwrap_or_default()))?
    };
    if values.len() > MAX_VALUES {
        return Err(inner.wrong(format!("{} values", values.len()), format!("give {MAX_VALUES} at most")));
    }
    Ok(Some(Deterministic::Values { name, line: at.line(), values }))
}

fn multi(at: At, texts: &mut Vec<TextParameter>) -> Result<Option<Deterministic>> {
    at.attributes(&[])?;
    let inner = at.choice(&["ValueSetDistribution"])?;
    inner.attributes(&[])?;
    let mut names: Vec<&str> = Vec::new();
    // By parameter, in the order of the first set.
    let mut columns: Vec<Vec<At>> = Vec::new();
    for (row, set) in inner.some("ParameterValueSet")?.into_iter().enumerate() {
        set.attributes(&[])?;
        for assignment in set.some("ParameterAssignment")? {
            assignment.shape(&["parameterRef", "value"], &[])?;
            let name = assignment.text("parameterRef")?;
            if row == 0 && !names.contains(&name) {
                names.push(name);
                columns.push(Vec::new());
            }
            match names.iter().position(|known| *known == name).map(|at| &mut columns[at]) {
                Some(column) if column.len() == row => column.push(assignment),
                Some(column) if column.len() > row => {
                    let problem = format!("`{name}` has a value in this set already");
                    return Err(assignment.wrong(problem, "keep one of the two"));
                }
                _ => return Err(other_parameters(set, &names)),
            }
        }
        if columns.iter().any(|column| column.len() <= row) {
            return Err(other_parameters(set, &names));
        }
    }
    let (mut numeric, mut rows) = (Vec::new(), vec![Vec::new(); columns.first().map_or(0, Vec::len)]);
    for (name, column) in names.iter().zip(&columns) {
        if let Some(values) = values(name, column, "value", texts)? {
            numeric.push((*name).to_owned());
            rows.iter_mut().zip(values).for_each(|(row, value): (&mut Vec<f64>, f64)| row.push(value));
        }
    }
    // Sets that differ in texts alone are one.
    if numeric.len() < names.len() {
        keep_distinct(&mut rows);
    }
    Ok((!numeric.is_empty()).then(|| Deterministic::Sets { names: numeric, line: at.line(), rows }))
}

/// Keeps the first of equal rows.
pub(super) fn keep_distinct(rows: &mut Vec<Vec<f64>>) {
    let mut known = BTreeSet::new();
    rows.retain(|row| known.insert(row.iter().map(|value| value.to_bits()).collect::<Vec<u64>>()));
}

fn other_parameters(set: At, names: &[&str]) -> Error {
    let problem = format!("this set does not assign the same parameters as the first ({})", names.join(", "));
    set.wrong(problem, "assign the same parameters in every set")
}

fn stochastic(at: At, texts: &mut Vec<TextParameter>) -> Result<Stochastic> {
    at.shape(&["numberOfTestRuns", "randomSeed"], &["StochasticDistribution"])?;
    // Below 2^53 a double represents every integer.
    let is_whole = |value: f64| value.fract() == 0.0 && (0.0..9_007_199_254_740_992.0).contains(&value);
    let runs = at.number("numberOfTestRuns")?;
    if !is_whole(runs) || runs < 1.0 {
        let problem = format!("the attribute `numberOfTestRuns` is {runs}");
        return Err(at.wrong(problem, "write a whole number of at least 1 and below 2^53"));
    }
    // Seeds are doubles in the standard. One that is no such integer is the seed of its bits.
    let seed = |value: f64| if is_whole(value) { value as u64 } else { value.to_bits() };
    let seed = at.value("randomSeed").is_some().then(|| at.number("randomSeed").map(seed)).transpose()?;
    let mut parameters = Vec::new();
    for one in at.some("StochasticDistribution")? {
        one.attributes(&["parameterName"])?;
        let name = one.text("parameterName")?;
        if let Some(found) = distribution(one, name, texts)? {
            parameters.push((name.to_owned(), one.line(), found));
        }
    }
    Ok(Stochastic { runs: runs as u64, seed, parameters })
}

/// The type of a `UserDefinedDistribution` that is read, and its form.
const LOG_NORMAL: (&str, &str) =
    ("log-normal", "<UserDefinedDistribution type=\"log-normal\">mu=3.2 sigma=0.4</UserDefinedDistribution>");

/// The distribution; `None` for a set of texts.
fn distribution(at: At, name: &str, texts: &mut Vec<TextParameter>) -> Result<Option<Distribution>> {
    let inner = at.choice(&[
        "ProbabilityDistributionSet",
        "NormalDistribution",
        "UniformDistribution",
        "PoissonDistribution",
        "Histogram",
        "UserDefinedDistribution",
        "LogNormalDistribution",
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
            inner.shape(&[], &["Range"])?;
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
                bin.shape(&["weight"], &["Range"])?;
                let range = bin.only("Range")?.range()?;
                if bins.last().is_some_and(|(before, _)| range.low < before.high) {
                    let help = "give bins in rising order, none over another";
                    return Err(bin.wrong("this bin begins before the one above it ends", help));
                }
                bins.push((range, at_least_zero(bin, "weight")?));
            }
            Distribution::Steps(bins)
        }
        "UserDefinedDistribution" => log_normal(inner)?,
        "LogNormalDistribution" => {
            let problem = "its attributes may be moments of the value or of its logarithm, and nothing tells which";
            return Err(inner.wrong(problem, format!("write {}, with the moments of the logarithm", LOG_NORMAL.1)));
        }
        _ => {
            inner.attributes(&[])?;
            let elements = inner.some("Element")?;
            let mut weights = Vec::new();
            for element in &elements {
                element.shape(&["value", "weight"], &[])?;
                weights.push(at_least_zero(*element, "weight")?);
            }
            let Some(values) = values(name, &elements, "value", texts)? else { return Ok(None) };
            Distribution::Steps(values.into_iter().map(Range::point).zip(weights).collect())
        }
    };
    if found.within(Range::ALL).is_none() {
        let help = "give a range that holds some of the distribution, and a weight above 0";
        return Err(inner.wrong("no value of it is possible", help));
    }
    Ok(Some(found))
}

/// A `UserDefinedDistribution` of the type `log-normal`: its text gives mean and standard deviation of the logarithm.
fn log_normal(at: At) -> Result<Distribution> {
    at.children(&[])?;
    let wrong =
        |problem: String| at.wrong(problem, format!("of this kind, a log-normal one is read: {}", LOG_NORMAL.1));
    if at.text("type")? != LOG_NORMAL.0 {
        return Err(wrong(format!("the type `{}` is not known", at.text("type")?)));
    }
    let content = at.node.text().unwrap_or_default();
    let mut words: Vec<&str> = content.split(|c: char| c.is_whitespace() || ",;".contains(c)).collect();
    words.retain(|word| !word.is_empty());
    let number = |key: &str| {
        let given = words.iter().filter_map(|word| word.split_once('=')).find(|(known, _)| *known == key);
        given.and_then(|(_, text)| text.parse::<f64>().ok()).filter(|value| value.abs() <= 100.0)
    };
    match (number("mu"), number("sigma"), words.len()) {
        (Some(mu), Some(sigma), 2) if sigma >= 0.0 => Ok(Distribution::LogNormal { mu, sigma }),
        _ => Err(wrong(format!("`{}` does not give mu and sigma, each at most 100", content.trim()))),
    }
}
