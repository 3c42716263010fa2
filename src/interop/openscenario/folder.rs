//! A folder of exported scenarios: a scenario and its road per lane, and an index of them.

use std::path::Path;

use super::concrete::Concrete;
use super::road::{Road, road_file};
use super::scenario_file::scenario_file;
use crate::Result;
use crate::support::run_dir::OutputDir;
use crate::support::table::Table;

/// Name of the index.
pub const INDEX: &str = "index.csv";

/// One line of the index.
#[derive(Debug, Clone, PartialEq)]
pub struct IndexRow {
    /// File of the scenario.
    pub file: String,
    /// File of the road.
    pub road: String,
    /// Lane key.
    pub lane: String,
}

/// Puts every scenario with its road and the index into a folder, in the place of an earlier export's.
///
/// # Errors
/// As [`scenario_file`]; [`crate::Error::Io`].
pub fn export_folder(dir: &Path, scenarios: &[Concrete]) -> Result<Vec<IndexRow>> {
    // Everything is made before anything is written: a lane that cannot be leaves the folder as it was.
    let mut made = Vec::new();
    for (at, scenario) in scenarios.iter().enumerate() {
        let stem = format!("{:03}-{}", at + 1, safe(&scenario.key));
        let row = IndexRow { file: format!("{stem}.xosc"), road: format!("{stem}.xodr"), lane: scenario.key.clone() };
        made.push((scenario_file(scenario, &row.road)?, road_file(&Road::around(scenario))?, row));
    }
    let folder = OutputDir::open(dir, INDEX)?;
    let mut results = folder.results()?;
    // The lane has a column of its own already.
    let names: Vec<String> = scenarios.first().map_or(Vec::new(), |s| {
        s.properties.iter().map(|(name, _)| name.clone()).filter(|name| name != "lanesweep.lane").collect()
    });
    let mut rows = Vec::new();
    for (text, road, row) in made {
        results.add(&row.road, &road)?;
        results.add(&row.file, &text)?;
        rows.push(row);
    }
    let property = |scenario: &Concrete, name: &String| {
        scenario.properties.iter().find(|(n, _)| n == name).map(|(_, value)| value.clone())
    };
    let table = Table::of(rows.iter().zip(scenarios))
        .column("file", |(row, _)| row.file.as_str())
        .column("road", |(row, _)| row.road.as_str())
        .column("lane", |(row, _)| row.lane.as_str())
        .column("category", |(_, scenario)| scenario.category.key())
        .columns(&names, |name| plain(name), |(_, scenario), name| property(scenario, name))
        .build();
    results.publish(table.csv().as_bytes())?;
    Ok(rows)
}

/// The name of a property as that of a column.
fn plain(property: &str) -> String {
    property.strip_prefix("lanesweep.").unwrap_or(property).to_owned()
}

/// A lane key as a part of a file name that every system takes.
fn safe(key: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-') { c } else { '_' };
    let name: String = key.chars().map(plain).take(100).collect();
    name.trim_matches(['.', '_']).to_owned()
}
