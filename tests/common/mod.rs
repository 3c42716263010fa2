//! Where tests find data that is not in the repository, and what they do where it is absent.

#![allow(dead_code)] // every test binary uses its own part

use std::io::Write;
use std::path::PathBuf;

pub mod counting;
pub mod device;
pub mod dice;
pub mod exid;
pub mod lane_sets;
#[cfg(feature = "parquet")]
pub mod made;
pub mod mined;
pub mod plans;
pub mod program;
pub mod reliability;
pub mod small;

/// A path below the shared folder (`../shared`, or the environment variable `LANESWEEP_SHARED`); where
/// it is absent, says so loudly and gives `None`: the test returns.
pub fn shared(rel: &str) -> Option<PathBuf> {
    let root = std::env::var_os("LANESWEEP_SHARED").map_or_else(|| in_crate("../shared"), PathBuf::from);
    let path = root.join(rel);
    if path.exists() {
        return Some(path);
    }
    skipped(&format!("needs ../shared/{rel} (set LANESWEEP_SHARED to the folder that holds it)"));
    None
}

/// Says that a test is skipped. Past the test harness, which shows the output of failing tests only.
pub fn skipped(why: &str) {
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
}

/// A folder of a test's own, which ends with it.
pub struct Folder(tempfile::TempDir);

pub fn folder() -> Folder {
    Folder(tempfile::tempdir().unwrap())
}

impl std::ops::Deref for Folder {
    type Target = std::path::Path;
    fn deref(&self) -> &std::path::Path {
        self.0.path()
    }
}

/// A table with a row per concrete case, as users write it.
pub const CASES: &str =
    "id,category,models,ego_speed_kmh,speed_mps,thw,gap,lateral_speed,acceleration,end_speed,ahead_gap,\
ahead_speed_kmh,duration_s,rate_hz
a,cut-in,FSM,108,20,1.2,,1.0,,,,,,
,lvd,RSS,108,30,,30,,-6,0,,,,10
c,cut-out,FSM,108,,1.2,,1.0,,,40,36,4,
";

pub fn in_crate(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)
}

pub fn text_of(path: &str) -> String {
    std::fs::read_to_string(in_crate(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

pub fn golden(name: &str) -> PathBuf {
    in_crate("tests/golden").join(name)
}

/// A golden file of JSON; the infinities that Python writes, which JSON does not know, are null.
pub fn golden_json(name: &str) -> serde_json::Value {
    serde_json::from_str(&text_of(&format!("tests/golden/{name}")).replace("-Infinity", "null")).unwrap()
}

/// Numbers, or rows of them.
pub fn numbers<T: serde::de::DeserializeOwned>(value: &serde_json::Value) -> Vec<T> {
    serde_json::from_value(value.clone()).unwrap()
}

/// Equal, or within a tolerance of one and their size.
pub fn near(ours: f64, theirs: f64, tolerance: f64) -> bool {
    ours == theirs || (ours - theirs).abs() <= tolerance * (1.0 + theirs.abs())
}

/// The share of a smooth motion that is done after a share of its time.
pub fn quintic(part: f64) -> f64 {
    let p = part.clamp(0.0, 1.0);
    p * p * p * (10.0 - 15.0 * p + 6.0 * p * p)
}

/// What `work` gives with so many threads.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// The four SUMO recordings of the shared folder, unpacked once below the target folder; says loudly why
/// where that cannot be done.
pub fn sumo_recordings() -> Option<PathBuf> {
    static UNPACKED: std::sync::OnceLock<Option<PathBuf>> = std::sync::OnceLock::new();
    UNPACKED.get_or_init(unpack_sumo_recordings).clone()
}

fn unpack_sumo_recordings() -> Option<PathBuf> {
    let archive = shared("data/sumo/sumo_highd.zip")?;
    let root = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let ready = root.join("sumo_highd");
    if ready.is_dir() {
        return Some(ready);
    }
    // Test binaries run side by side: each unpacks for itself, the first one's folder stays.
    let mine = root.join(format!("sumo_highd.{}", std::process::id()));
    let unpack = |program: &str, args: &[&std::ffi::OsStr]| {
        let run = std::process::Command::new(program).args(args).stdout(std::process::Stdio::null()).status();
        run.is_ok_and(|status| status.success())
    };
    let (archive, into) = (archive.as_os_str(), mine.as_os_str());
    let unpacked = unpack("unzip", &["-q".as_ref(), "-o".as_ref(), archive, "-d".as_ref(), into])
        || unpack("python3", &["-m".as_ref(), "zipfile".as_ref(), "-e".as_ref(), archive, into]);
    if !unpacked {
        skipped(&format!("needs `unzip` or `python3` to unpack {}", archive.display()));
        return None;
    }
    let tracks = program::names(&mine).into_iter().find(|name| name.ends_with("01_tracks.csv"))?;
    let content = mine.join(tracks).parent()?.to_owned();
    if std::fs::rename(&content, &ready).is_ok() || ready.is_dir() {
        let _ = std::fs::remove_dir_all(&mine);
        return Some(ready);
    }
    Some(content)
}
