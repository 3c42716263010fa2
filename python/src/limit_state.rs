//! A density with one driver and criterion as a function of points: what OpenTURNS, UQpy and SciPy call.

use std::path::PathBuf;
use std::sync::Arc;

use lanesweep::cli::embedded;
use lanesweep::engine::OpenBackend;
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::run::sampling::{LaneLimitState, Question, SampleHeadways, truncated};
use lanesweep::stats::density::{DensityModel, read_density};
use lanesweep::stats::estimate::{Density as _, LimitState as _};
use lanesweep::{Error, Place, Result};
use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::cases::headway_of;
use crate::error::exception;
use crate::verb::watched;

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

fn open(
    density: PathBuf,
    model: &str,
    criterion: &str,
    thw: Option<String>,
    profile: &str,
    backend: &str,
    device: Option<&str>,
) -> Result<Opened> {
    let density = read_density(&density)?;
    let model = ModelId::parse(model).ok_or_else(|| {
        let problem = format!("there is no driver model `{model}`");
        Error::usage(Place::option("models"), problem, format!("use one of {}, or a Driver", ModelId::names()))
    })?;
    let criterion = Criterion::parse(criterion).ok_or_else(|| {
        let problem = format!("there is no criterion `{criterion}`");
        Error::usage(Place::option("criterion"), problem, "use collision, ttc or btn")
    })?;
    let headway = match thw {
        None => SampleHeadways::Sampled,
        Some(text) => SampleHeadways::Each(vec![headway_of(&text)?]),
    };
    let backend = OpenBackend::open(backend.parse()?, device.map(str::parse).transpose()?.as_ref())?;
    let opened = Opened {
        density,
        profile: Profile::load(profile)?,
        model,
        criterion,
        headway,
        backend: backend.with_cancel(embedded::token()),
    };
    // A wrong headway is an error of the construction, not of the first call.
    opened.values(&[opened.density.kde.points()[0].clone()])?;
    Ok(opened)
}

impl Opened {
    fn values(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        let question = Question { model: self.model, criterion: self.criterion, headway: 0 };
        let executor = self.backend.executor();
        let lanes = LaneLimitState::new(&self.density, &self.profile, &self.headway, &[question], executor);
        // The first guide of a point is the limit state.
        Ok(lanes.evaluate(points)?.into_iter().step_by(lanes.guides()).collect())
    }
}

#[pymethods]
impl LimitState {
    #[new]
    #[pyo3(signature = (density, *, model, criterion, thw, profile, backend, device))]
    #[allow(clippy::too_many_arguments)] // keyword arguments of the Python class
    fn new(
        py: Python<'_>,
        density: PathBuf,
        model: String,
        criterion: String,
        thw: Option<String>,
        profile: String,
        backend: String,
        device: Option<String>,
    ) -> PyResult<LimitState> {
        let work = move || {
            embedded::exclusively(|| open(density, &model, &criterion, thw, &profile, &backend, device.as_deref()))
        };
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
        let points = self.rows(py, &points)?;
        let density = &self.0.density;
        let values = py.detach(|| {
            let truncated = truncated(density)?;
            let log_fraction = truncated.validity_fraction().ln();
            Ok(points.iter().map(|point| truncated.log_density(point) - log_fraction).collect::<Vec<f64>>())
        });
        Ok(PyArray1::from_vec(py, values.map_err(|error: Error| exception(py, &error))?))
    }

    /// The limit state of each point; infinite outside the valid region, where the density is 0.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = self.rows(py, &points)?;
        let opened = self.0.clone();
        let values = watched(py, None, None, move || {
            let is_valid: Vec<bool> = points.iter().map(|point| opened.density.space.is_valid(point)).collect();
            let valid = points.into_iter().zip(&is_valid).filter_map(|(point, is_valid)| is_valid.then_some(point));
            let valid: Vec<Vec<f64>> = valid.collect();
            let found = if valid.is_empty() { Vec::new() } else { embedded::exclusively(|| opened.values(&valid))? };
            let mut found = found.into_iter();
            let value = |is_valid: bool| if is_valid { found.next() } else { None }.unwrap_or(f64::INFINITY);
            Ok(is_valid.into_iter().map(value).collect())
        })?;
        Ok(PyArray1::from_vec(py, values))
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
