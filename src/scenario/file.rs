//! The file of scenarios, in the format that its name ends in.

use std::path::Path;

use super::{Scenario, jsonl, table_reader, table_writer};
use crate::Result;
use crate::table::TableFormat;

/// Formats that scenarios are written in, the one for names without an ending first.
const WRITTEN: [TableFormat; 2] = [TableFormat::JsonLines, TableFormat::Parquet];
/// Formats that they are read from.
const READ: [TableFormat; 3] = [TableFormat::JsonLines, TableFormat::Parquet, TableFormat::Csv];

/// Reads a file of scenarios: JSON Lines or Parquet as `lanesweep mine` writes them, or a table that a user made, with
/// a row per scenario, per instant of one, or per concrete case.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be read; [`crate::Error::Usage`] for a name with another ending;
/// [`crate::Error::Input`] naming the file, the line or row, the scenario where its id can be read, and the field or
/// column: a missing one, one of a wrong type or unit, series of unequal length or of fewer than two samples, a
/// negative speed, a size, lane width or sample rate that is not above 0, a kept cut-out without the vehicle ahead or
/// its gap, an id that came before, a file without scenarios, or a damaged one.
pub fn read_scenarios(path: &Path) -> Result<Vec<Scenario>> {
    match TableFormat::of(path, &READ, "the scenario file")? {
        TableFormat::JsonLines => jsonl::read(path),
        format => table_reader::read(path, format),
    }
}

/// Writes a file of scenarios: whole or not at all.
///
/// # Errors
/// [`crate::Error::Io`] if the folder cannot be written to; [`crate::Error::Usage`] for a name that ends neither in
/// `.jsonl` nor in `.parquet`; [`crate::Error::Input`] for a scenario that [`read_scenarios`] would refuse.
pub fn write_scenarios<'a>(path: &Path, scenarios: impl IntoIterator<Item = &'a Scenario>) -> Result<()> {
    write_scenarios_of(path, scenarios, false)
}

/// As [`write_scenarios`], for scenarios that are known to be made up by the program, if `synthetic`.
///
/// # Errors
/// As [`write_scenarios`].
pub fn write_scenarios_of<'a>(
    path: &Path,
    scenarios: impl IntoIterator<Item = &'a Scenario>,
    synthetic: bool,
) -> Result<()> {
    match check_scenario_file(path)? {
        TableFormat::JsonLines => jsonl::write(path, scenarios),
        format => {
            let scenarios: Vec<&Scenario> = scenarios.into_iter().collect();
            scenarios.iter().try_for_each(|scenario| jsonl::check_written(scenario))?;
            table_writer::write(path, format, scenarios, synthetic)
        }
    }
}

/// The format of a file of scenarios that is to be written: for what is known before the work.
///
/// # Errors
/// [`crate::Error::Usage`] as [`write_scenarios`].
pub fn check_scenario_file(path: &Path) -> Result<TableFormat> {
    TableFormat::of(path, &WRITTEN, "the scenario file")
}
