//! A density with one driver and criterion as a function of points: what OpenTURNS, UQpy and SciPy call.

use std::path::PathBuf;
use std::sync::Arc;

use lanesweep::cli::embedded;
use lanesweep::engine::OpenBackend;
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{LaneLimitState, Question, SAMPLE_PURPOSE, SampleHeadways, truncated};
use lanesweep::stats::density::{DensityModel, read_density};
use lanesweep::stats::estimate::{
    Counts, Density as _, LimitState as _, StopReason, Warning, from_counts, importance_of_points,
};
use lanesweep::stats::random::Stream;
use lanesweep::{Error, Place, Result};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::cases::{headway_of, model_of};
use crate::error::exception;
use crate::verb::watched;

/// Points between two looks for signals: less than a second's work.
const BATCH: usize = 1 << 14;

/// Works on rows without the GIL; a signal (Ctrl-C) ends it after a batch.
fn in_batches<T: Send>(
    py: Python<'_>,
    rows: &[Vec<f64>],
    work: impl Fn(&[Vec<f64>]) -> Result<Vec<T>> + Sync,
) -> PyResult<Vec<T>> {
    let mut all = Vec::with_capacity(rows.len());
    for batch in rows.chunks(BATCH / 8) {
        all.extend(py.detach(|| work(batch)).map_err(|error| exception(py, &error))?);
        py.check_signals()?;
    }
    Ok(all)
}

struct Opened {
    density: DensityModel,
    profile: Profile,
    model: ModelId,
    criterion: Criterion,
    headway: SampleHeadways,
    backend: OpenBackend,
}

/// See `lanesweep.LimitState`.
#[pyclass(frozen, subclass, module = "lanesweep._core")]
pub struct LimitState(Arc<Opened>);

/// The arguments of `lanesweep.LimitState`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Arguments {
    density: PathBuf,
    model: String,
    criterion: String,
    thw: Option<String>,
    profile: String,
    backend: String,
    device: Option<String>,
}

fn open(arguments: &Arguments) -> Result<Opened> {
    let unknown = || {
        let keys = Criterion::ALL.map(Criterion::key);
        Error::unknown(Place::option("criterion"), "criterion", &arguments.criterion, keys, "")
    };
    let headway = match &arguments.thw {
        None => SampleHeadways::Sampled,
        Some(text) => SampleHeadways::Each(vec![headway_of(text)?]),
    };
    let opened = Opened {
        density: read_density(&arguments.density)?,
        profile: Profile::load(&arguments.profile)?,
        model: model_of(&arguments.model)?,
        criterion: Criterion::parse(&arguments.criterion).ok_or_else(unknown)?,
        headway,
        backend: OpenBackend::open(arguments.backend.parse()?, arguments.device.as_deref())?
            .with_cancel(embedded::token()),
    };
    // A wrong headway is an error of the construction, not of the first call.
    opened.values(&[opened.density.kde.points()[0].clone()])?;
    Ok(opened)
}

impl Opened {
    /// ln f̂ within the valid region, −∞ outside.
    fn log_densities(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        let truncated = truncated(&self.density)?;
        let log_fraction = truncated.validity_fraction().ln();
        let points: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        Ok(truncated.log_densities(&points).into_iter().map(|log| log - log_fraction).collect())
    }

    /// The limit state of valid points; infinite elsewhere.
    fn values_or_infinite(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        let is_valid = |point: &Vec<f64>| self.density.space.is_valid(point);
        let valid: Vec<Vec<f64>> = points.iter().filter(|point| is_valid(point)).cloned().collect();
        let mut found = if valid.is_empty() { Vec::new() } else { self.values(&valid)? }.into_iter();
        let value = |point| if is_valid(point) { found.next() } else { None }.unwrap_or(f64::INFINITY);
        Ok(points.iter().map(value).collect())
    }

    fn values(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        let question = Question { model: self.model, criterion: self.criterion, headway: 0 };
        let executor = self.backend.executor();
        let lanes = LaneLimitState::new(&self.density, &self.profile, &self.headway, &[question], executor);
        let mut values = Vec::with_capacity(points.len());
        for batch in points.chunks(BATCH) {
            embedded::token().check()?;
            // The first guide of a point is the limit state.
            values.extend(lanes.evaluate(batch)?.into_iter().step_by(lanes.guides()));
        }
        Ok(values)
    }
}

#[pymethods]
impl LimitState {
    #[new]
    fn new(py: Python<'_>, arguments: Arguments) -> PyResult<LimitState> {
        let work = move || embedded::exclusively(|| open(&arguments));
        Ok(LimitState(Arc::new(watched(py, None, None, work)?)))
    }

    /// Names of the parameters, with units.
    #[getter]
    fn parameters(&self) -> Vec<String> {
        self.0.density.space.parameters().iter().map(|parameter| parameter.name.clone()).collect()
    }

    /// The recorded scenarios as points, a row each.
    #[getter]
    fn points(&self) -> Vec<Vec<f64>> {
        self.0.density.kde.points().to_vec()
    }

    /// Bandwidth of every parameter: the standard deviation of the kernels around the points.
    #[getter]
    fn kernel_deviations(&self) -> Vec<f64> {
        self.0.density.kde.spread()
    }

    /// Fraction of the density before its truncation that lies in the valid region.
    #[getter]
    fn valid_share(&self) -> f64 {
        self.0.density.valid.estimate
    }

    /// The points of standard normal numbers, before truncation.
    #[pyo3(name = "from_standard_normal")]
    fn of_standard_normal<'py>(
        &self,
        py: Python<'py>,
        u: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = in_batches(py, &self.rows(py, &u)?, |rows| {
            let mixture = self.0.density.kde.mixture()?;
            Ok(rows.par_iter().map(|u| mixture.from_standard_normal(u)).collect())
        });
        Ok(PyArray2::from_vec2(py, &points?)?)
    }

    /// Whether each point is valid: the density is 0 elsewhere.
    fn is_valid<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let points = self.rows(py, &points)?;
        Ok(PyArray1::from_iter(py, points.iter().map(|point| self.0.density.space.is_valid(point))))
    }

    /// log f̂ of each point; −inf outside the valid region.
    fn log_density<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = in_batches(py, &self.rows(py, &points)?, |points| self.0.log_densities(points))?;
        Ok(PyArray1::from_vec(py, values))
    }

    /// The limit state of each point; infinite outside the valid region, where the density is 0.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = self.rows(py, &points)?;
        let opened = self.0.clone();
        let values = watched(py, None, None, move || embedded::exclusively(|| opened.values_or_infinite(&points)))?;
        Ok(PyArray1::from_vec(py, values))
    }

    /// Valid draws of the density.
    fn _draw<'py>(&self, py: Python<'py>, count: usize, seed: u64) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let density = &self.0.density;
        let drawn = py.detach(|| {
            let mixture = density.kde.mixture()?;
            let stream = Stream { seed, purpose: SAMPLE_PURPOSE };
            let draws = (0_u64..).map(|index| mixture.draw(&stream, index, 0));
            Ok(draws.filter(|point| density.space.is_valid(point)).take(count).collect::<Vec<_>>())
        });
        let drawn = drawn.map_err(|error: Error| exception(py, &error))?;
        Ok(PyArray2::from_vec2(py, &drawn)?)
    }

    /// The estimate from points as JSON.
    fn _estimate(
        &self,
        py: Python<'_>,
        points: PyReadonlyArray2<'_, f64>,
        log_density: Option<PyReadonlyArray1<'_, f64>>,
        level: f64,
    ) -> PyResult<String> {
        let points = self.rows(py, &points)?;
        let logs = log_density.map(|logs| logs.as_array().to_vec());
        let refused = match &logs {
            Some(logs) if logs.len() != points.len() => {
                Some((format!("{} densities for {} points", logs.len(), points.len()), "give one per point"))
            }
            Some(logs) if logs.iter().any(|log| !log.is_finite()) => {
                Some(("a density is not finite".to_owned(), "give ln of the density that each point was drawn from"))
            }
            _ if points.is_empty() => Some(("there is no point".to_owned(), "give at least one")),
            _ if !(0.0..1.0).contains(&level) => Some((format!("level {level}"), "give one from 0 to below 1")),
            _ => None,
        };
        if let Some((problem, help)) = refused {
            return Err(exception(py, &Error::input(Place::item("points"), problem, help)));
        }
        let opened = self.0.clone();
        watched(py, None, None, move || {
            let fails: Vec<bool> = embedded::exclusively(|| opened.values_or_infinite(&points))?
                .iter()
                .map(|value| *value <= 0.0)
                .collect();
            let is_valid = |point: &&Vec<f64>| opened.density.space.is_valid(point);
            let valid = points.iter().filter(is_valid).count() as u64;
            let mut mean_weight = None;
            let estimate = match logs {
                Some(logs) => {
                    let ratios: Vec<f64> =
                        opened.log_densities(&points)?.iter().zip(logs).map(|(f, g)| f - g).collect();
                    mean_weight = Some(ratios.iter().map(|ratio| ratio.exp()).sum::<f64>() / ratios.len() as f64);
                    importance_of_points(&ratios, &fails, level)
                }
                None => {
                    let failures = fails.iter().filter(|fails| **fails).count() as u64;
                    let counts = Counts { runs: valid, failures, voids: 0 };
                    let mut estimate = from_counts(&counts, level, StopReason::Samples);
                    estimate.trust.warnings.push(Warning::DataLeftOut);
                    estimate
                }
            };
            let warnings = estimate.trust.warnings.iter().map(ToString::to_string).collect::<Vec<_>>();
            let record = serde_json::json!({
                "probability": estimate.probability,
                "low": estimate.interval.low,
                "high": estimate.interval.high,
                "level": level,
                "points": points.len(),
                "valid": valid,
                "failures": estimate.failures,
                "effective_failures": estimate.weights.map(|weights| weights.effective_failures),
                "mean_weight": mean_weight,
                "verdict": estimate.trust.draws(),
                "warnings": warnings,
            });
            Ok(record.to_string())
        })
    }
}

impl LimitState {
    /// Checks the points and copies them into rows.
    fn rows(&self, py: Python<'_>, points: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Vec<f64>>> {
        let points = points.as_array();
        let dimensions = self.0.density.space.dimensions();
        let refuse = |problem: String, help: String| exception(py, &Error::input(Place::item("points"), problem, help));
        if points.ncols() != dimensions {
            let problem = format!("they have {} columns", points.ncols());
            return Err(refuse(problem, format!("give {dimensions} columns: {}", self.parameters().join(", "))));
        }
        if let Some(((row, column), value)) = points.indexed_iter().find(|(_, value)| !value.is_finite()) {
            let problem = format!("row {row} has {value} in column {column}");
            return Err(refuse(problem, "give finite numbers".to_owned()));
        }
        Ok(points.rows().into_iter().map(|row| row.to_vec()).collect())
    }
}
