//! Where tests find data that is not in the repository, and what they do where it is absent.

#![allow(dead_code)] // every test binary uses its own part

use std::path::PathBuf;

pub mod small;

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

/// Folder with the four SUMO recordings of `../shared/data/sumo/sumo_highd.zip`, unpacked once into the
/// system's temporary folder; where archive or Python is absent, says so loudly and gives `None`.
pub fn sumo_dir() -> Option<PathBuf> {
    static UNPACKED: std::sync::OnceLock<Option<PathBuf>> = std::sync::OnceLock::new();
    UNPACKED.get_or_init(|| unpack_sumo(&shared("data/sumo/sumo_highd.zip")?)).clone()
}

fn unpack_sumo(archive: &std::path::Path) -> Option<PathBuf> {
    let bytes = std::fs::metadata(archive).ok()?.len();
    let target = std::env::temp_dir().join(format!("lanesweep-test-sumo-{bytes}"));
    if !target.is_dir() {
        // Test binaries run side by side: each unpacks beside the place, the first one to finish gives
        // its folder the name, and nobody ever sees half of it.
        let own = std::env::temp_dir().join(format!("lanesweep-test-sumo-{bytes}-{}", std::process::id()));
        let done = std::process::Command::new("python3").args(["-m", "zipfile", "-e"]).arg(archive).arg(&own).status();
        if !done.is_ok_and(|status| status.success()) {
            eprintln!("SKIPPED: needs python3 to unpack {}", archive.display());
            return None;
        }
        if std::fs::rename(&own, &target).is_err() {
            let _ = std::fs::remove_dir_all(&own);
        }
    }
    // The archive may hold the files in a folder of its own.
    let holds = |dir: &PathBuf| dir.join("01_tracks.csv").is_file();
    let inner = std::fs::read_dir(&target).ok()?.flatten().map(|entry| entry.path());
    std::iter::once(target).chain(inner).find(holds)
}
