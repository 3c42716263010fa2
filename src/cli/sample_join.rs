//! `lanesweep sample --join`: the parts of a run over a given proposal become one result, the same as if it had never
//! been split.

use std::path::{Path, PathBuf};

use super::rerun::facts_of;
use super::sample_lanes;
use super::{Exit, console};
use crate::estimate::{StopReason, from_weight_sums};
use crate::report::files::{make_folder, write_atomically};
use crate::report::sampling::{EstimateFile, HostRecord};
use crate::sampling::{EstimateRow, Risk, WeightedPart, read_weighted_part};
use crate::{Error, Place, Result};

/// Joins the parts in these folders.
///
/// # Errors
/// [`Error::Input`] where a folder holds no part, parts are of different runs, or a sample is in two.
pub(super) fn run(folders: &[PathBuf], out: &Path, level: f64) -> Result<Exit> {
    let [first, rest @ ..] = folders else {
        return Err(Error::usage(Place::item("--join"), "no part", "give the folders of the parts"));
    };
    let place = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    if folders.iter().any(|folder| place(folder) == place(out)) {
        let problem = format!("{} is one of the parts", out.display());
        return Err(Error::usage(Place::item("--out"), problem, "choose another folder for the result"));
    }
    if let Some(part) = read_weighted_part(&first.join("part.json"))? {
        return join_weighted(first, part, rest, out, level);
    }
    let problem = "it is no part of a run over a given proposal";
    let help = "the parts of crude Monte Carlo, made with --shard, are joined by `lanesweep merge`";
    Err(Error::input(Place::file(first.join("part.json")), problem, help))
}

/// Parts of a run over a given proposal.
fn join_weighted(first: &Path, mut part: WeightedPart, rest: &[PathBuf], out: &Path, level: f64) -> Result<Exit> {
    let (facts, density, _) = facts_of(first)?;
    for folder in rest {
        let path = folder.join("part.json");
        let placed = |error: Error| match error {
            Error::Input { problem, help, .. } | Error::Usage { problem, help, .. } => {
                Error::Input { place: Box::new(Place::file(&path)), problem, help }
            }
            other => other,
        };
        let other = read_weighted_part(&path)?.ok_or_else(|| {
            let problem = "it is no part of a run over a given proposal, as the first one is";
            Error::input(Place::file(&path), problem, "join only parts of one run")
        })?;
        part.merge(other).map_err(placed)?;
    }
    let missing = part.samples - part.covered().min(part.samples);
    if missing > 0 {
        tracing::warn!("{missing} of {} samples are in no part; this result is that of the rest", part.samples);
    }
    make_folder(out)?;
    sample_lanes::check_writable(out)?;
    let row = |(model, sums): &(crate::driver::ModelId, crate::estimate::BlockSums<crate::estimate::WeightSums>)| {
        let total = sums.total().unwrap_or_default();
        let estimate = from_weight_sums(&total, false, level, StopReason::Samples);
        let risk = Risk::of(&estimate, density.exposure.as_ref());
        EstimateRow { model: *model, criterion: part.criterion, headway: part.headway.clone(), estimate, risk }
    };
    let rows = part.sums.iter().map(row).collect();
    let host = HostRecord {
        backend: format!("{} parts joined", 1 + rest.len()),
        device: None,
        rechecked_lanes: 0,
        seconds: 0.0,
        threads: rayon::current_num_threads(),
    };
    let file = EstimateFile::new(&density, facts, rows, host)?;
    sample_lanes::clear(out, &[])?;
    crate::density::write_density(&out.join("density.json"), &density)?;
    write_atomically(&out.join("estimates.csv"), &file.csv()?)?;
    write_atomically(&out.join("estimate.json"), &file.to_json()?)?;
    console::print(&file.text())?;
    Ok(if missing > 0 { Exit::Incomplete } else { Exit::Ok })
}
