//! Where tests find data that is not in the repository, and what they do where it is absent.

#![allow(dead_code)] // every test binary uses its own part

use std::path::PathBuf;

/// A path below the shared folder (`../shared`, or the environment variable `LANESWEEP_SHARED`); where
/// it is absent, says so loudly and gives `None`: the test returns.
pub fn shared(rel: &str) -> Option<PathBuf> {
    let root = std::env::var_os("LANESWEEP_SHARED")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let path = root.join(rel);
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: needs ../shared/{rel} (set LANESWEEP_SHARED to the folder that holds it)");
    None
}

/// A file of `tests/golden`.
pub fn golden(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)
}
