//! Scenario files: one JSON object per line.

use std::path::Path;

use super::Scenario;
use crate::{Error, Place, Result};

/// Reads all scenarios of a file.
pub fn read_scenarios(path: &Path) -> Result<Vec<Scenario>> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
    let parse = |(k, line): (usize, &str)| {
        serde_json::from_str(line)
            .map_err(|e| Error::input(Place::file(path).row(k as u64 + 1), e.to_string(), "expected one scenario"))
    };
    text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()).map(parse).collect()
}
