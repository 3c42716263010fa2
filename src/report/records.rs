//! Documents in JSON, of `--format json` and of the records in the folders of runs.

use serde::Serialize;
use serde_json::Value;

use lanesweep_engine::{NO_STEP, Outcome};
use lanesweep_support::run_folder::{ResultFiles, Results};
use lanesweep_support::{Error, Result};

/// Program and version.
pub(super) const PROGRAM: &str = concat!("lanesweep ", env!("CARGO_PKG_VERSION"));

/// An object whose keys stand in the order given: `record! { program: PROGRAM, lanes: 3 }`.
macro_rules! record {
    ($($(#[$meta:meta])* $key:ident: $value:expr),* $(,)?) => {{
        #[expect(non_camel_case_types, reason = "every field has a type of its own, which is named like it")]
        mod object {
            #[derive(serde::Serialize)]
            pub(super) struct Record<$($key),*> {
                $($(#[$meta])* pub(super) $key: $key,)*
            }
        }
        object::Record { $($key: $value,)* }
    }};
}
pub(super) use record;

/// A value whose keys stand in the order of their letters, as in documents.
pub(super) fn sorted<T: Serialize + ?Sized>(value: &T) -> Value {
    // Texts and numbers, which JSON always has.
    serde_json::to_value(value).unwrap_or_default()
}

/// When an event happened, s, without the rounding error of the product; `None` if it did not.
pub(super) fn time_s(step: u32, dt_s: f64) -> Option<f64> {
    (step != NO_STEP).then(|| (f64::from(step) * dt_s * 1e9).round() / 1e9)
}

/// A value of the contact; `None` without one.
pub(super) fn at_contact(outcome: &Outcome<f64>, value: f64) -> Option<f64> {
    (outcome.contact_step != NO_STEP).then_some(value)
}

/// The smallest gap of a lane, m, as tables and records have it. The lane measures it to the vehicles that TTC and BTN
/// evaluate; a side contact may have none. Vehicles that touch have no gap left.
pub(crate) fn smallest_gap_m(outcome: &Outcome<f64>) -> f64 {
    if outcome.contact_step == NO_STEP { outcome.min_gap } else { outcome.min_gap.min(0.0) }
}

/// Publishes results with their record, which has the names and checksums of the other files; returns these. The page is without
/// one: it has the times of the run, and equal inputs give equal checksums.
pub(super) fn publish(
    mut results: Results,
    record: impl FnOnce(&ResultFiles) -> Result<String>,
) -> Result<ResultFiles> {
    let mut files = results.files();
    files.files_sha256.remove("report.html");
    results.publish(record(&files)?.as_bytes())?;
    Ok(files)
}

/// A document as text, with a final line break; NaN and infinity become null.
///
/// # Errors
/// None for a document of this program.
pub fn document<T: Serialize + ?Sized>(value: &T) -> Result<String> {
    let text = serde_json::to_string_pretty(value);
    text.map(|text| text + "\n").map_err(|e| Error::Internal(format!("a document cannot be written: {e}")))
}
