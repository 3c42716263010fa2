//! The compiled half of the Python package `lanesweep`: verbs of the program, tables as Arrow data, drivers and limit
//! states. `lanesweep/_core.pyi` documents the functions for Python.

mod cases;
mod driver;
mod error;
mod frame;
mod limit_state;
mod verb;

use lanesweep::support::error::{Notation, write_options_as};
use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    write_options_as(Notation::Argument);
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    error::add_to(module)?;
    module.add_class::<frame::Frame>()?;
    module.add_class::<limit_state::LimitState>()?;
    module.add_function(wrap_pyfunction!(verb::run, module)?)?;
    module.add_function(wrap_pyfunction!(verb::main, module)?)?;
    module.add_function(wrap_pyfunction!(verb::described, module)?)?;
    module.add_function(wrap_pyfunction!(verb::profile, module)?)?;
    module.add_function(wrap_pyfunction!(verb::lists, module)?)?;
    module.add_function(wrap_pyfunction!(frame::frame_of_columns, module)?)?;
    module.add_function(wrap_pyfunction!(frame::frame_of_stream, module)?)?;
    module.add_function(wrap_pyfunction!(cases::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(driver::register, module)?)
}
