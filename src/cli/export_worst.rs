//! The worst lanes of a finished run, to be exported.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::rerun::record_of;
use super::simulate_lanes::{find, model};
use crate::engine::{Backend, Chunk, CpuBackend, Executor, LaneKey, LanePlan, Wanted};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::sampling::limit_state;
use crate::run::study::{StudyCases, WINDOW};
use crate::support::hex::hex;
use crate::support::input_file;
use crate::support::repeats::refuse_repeats;
use crate::support::table::text_of_cell;
use crate::{Error, Place, Result};

/// Lanes that one export writes at most.
const MAX_LANES: usize = 10_000;

/// Of a study: per model the scenarios with the smallest limit state of the criterion (see [`limit_state`]), each with
/// its worst lane over the variants and headways; smallest first, equal ones in the plan's order. The study's lanes are
/// run again on the CPU.
///
/// # Errors
/// [`Error::Usage`] for variants or models that the run does not have, and for too many lanes.
pub(super) fn worst_of_study(
    study: &StudyCases,
    is_reference: bool,
    count: usize,
    criterion: Criterion,
    variants: &[String],
    models: Option<&[ModelId]>,
) -> Result<Vec<LaneKey>> {
    let plan = study.outline();
    let models = wanted_models(plan, models, count)?;
    refuse_repeats(|| Place::item("--variant"), variants.iter().map(|name| (name.trim(), name.trim())))?;
    for name in variants {
        if !plan.blocks.iter().any(|b| b.variants.iter().any(|v| v == name.trim())) {
            let mut known: Vec<&str> = plan.blocks.iter().flat_map(|b| &b.variants).map(String::as_str).collect();
            known.sort_unstable();
            known.dedup();
            let problem = format!("no lane of this run has the variant `{name}`");
            return Err(Error::usage(Place::item("--variant"), problem, format!("use {}", known.join(", "))));
        }
    }
    let (narrow, wide) = (CpuBackend::lane_arithmetic(), CpuBackend::reference());
    let backend: &dyn Backend = if is_reference { &wide } else { &narrow };
    let mut worst: Vec<Vec<(f64, u64)>> = vec![Vec::new(); plan.models.len()];
    let mut each = |chunk: Chunk| {
        // The unit whose lanes are looked at, and its worst lane so far, per model.
        let mut unit: Option<(usize, u64)> = None;
        let mut of_unit: Vec<Option<(f64, u64)>> = vec![None; plan.models.len()];
        for (at, outcome) in chunk.outcomes.iter().enumerate() {
            let lane = chunk.first_lane + at as u64;
            let Some(key) = plan.key(lane) else { continue };
            if unit != Some((key.block, key.unit)) {
                unit = Some((key.block, key.unit));
                keep(&mut worst, &mut of_unit, count);
            }
            let variant = &plan.blocks[key.block].variants[key.variant];
            if !models.contains(&key.model) || !(variants.is_empty() || variants.iter().any(|v| v.trim() == variant)) {
                continue;
            }
            let found = (limit_state(&plan.profile, criterion, outcome), lane);
            let so_far = &mut of_unit[key.model];
            if so_far.is_none_or(|known| is_worse(&found, &known)) {
                *so_far = Some(found);
            }
        }
        keep(&mut worst, &mut of_unit, count);
        Ok(())
    };
    study.in_windows(0..plan.unit_count(), WINDOW, |plan, units| {
        Executor::new(backend).sweep(plan, units, Wanted::Outcomes, &mut each).map(drop)
    })?;
    let lanes = models.iter().flat_map(|model| worst[*model].iter());
    Ok(lanes.filter_map(|(_, lane)| plan.key(*lane)).collect())
}

fn is_worse(a: &(f64, u64), b: &(f64, u64)) -> bool {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).is_lt()
}

/// Moves the worst lanes of a unit among those of the run.
fn keep(worst: &mut [Vec<(f64, u64)>], of_unit: &mut [Option<(f64, u64)>], count: usize) {
    for (kept, found) in worst.iter_mut().zip(of_unit) {
        let Some(found) = found.take() else { continue };
        let at = kept.partition_point(|known| is_worse(known, &found));
        kept.insert(at, found);
        kept.truncate(count);
    }
}

/// Of a sampling run: the first lanes of each model in `worst.csv`.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a run without such a table; [`Error::Usage`] for models that it does not have, and
/// for another criterion than the table's.
pub(super) fn worst_of_sample(
    dir: &Path,
    plan: &LanePlan,
    count: usize,
    criterion: Option<Criterion>,
    models: Option<&[ModelId]>,
) -> Result<Vec<LaneKey>> {
    let models = wanted_models(plan, models, count)?;
    let path = dir.join("worst.csv");
    if !path.exists() {
        let help = "run `lanesweep sample` with --worst above 0, or name lanes with --lane";
        return Err(Error::input(Place::file(&path), "this run listed no worst lanes", help));
    }
    let text = input_file::read_text(&path, input_file::MAX_TABLE_BYTES)?;
    if record_of(dir)?.worst_sha256.is_none_or(|sha256| hex(&Sha256::digest(&text)) != sha256) {
        let problem = "checksum mismatch with estimate.json: the table was changed or damaged";
        return Err(Error::input(
            Place::file(&path),
            problem,
            "run `lanesweep sample` again, or name lanes with --lane",
        ));
    }
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let wrong = |row: u64, problem: String| {
        let help = "give the folder of a `lanesweep sample` run by this version";
        Error::input(Place::file(&path).row(row), problem, help)
    };
    let header = reader.headers().map_err(|e| wrong(1, e.to_string()))?.clone();
    let column =
        header.iter().position(|name| name == "lane").ok_or_else(|| wrong(1, "no column `lane`".to_owned()))?;
    let by = header.iter().position(|name| name == "criterion");
    let mut per_model: Vec<Vec<LaneKey>> = vec![Vec::new(); plan.models.len()];
    for (at, record) in reader.records().enumerate() {
        let record = record.map_err(|e| wrong(at as u64 + 2, e.to_string()))?;
        let ranked_by = by.and_then(|by| record.get(by)).unwrap_or_default();
        if let Some(asked) = criterion.filter(|asked| asked.key() != ranked_by) {
            let problem = format!("worst.csv ranks its lanes by {ranked_by}, not by {}", asked.key());
            let help = format!("leave it out, or run `lanesweep sample --criterion {}`", asked.key());
            return Err(Error::usage(Place::item("--criterion"), problem, help));
        }
        let key = find(plan, text_of_cell(record.get(column).unwrap_or("")))?;
        if per_model[key.model].len() < count {
            per_model[key.model].push(key);
        }
    }
    let short = models.iter().map(|model| per_model[*model].len()).min().unwrap_or(0);
    if short < count {
        tracing::warn!("the run lists {short} worst lanes of a model, not {count}: `sample --worst` sets the number");
    }
    Ok(models.iter().flat_map(|model| per_model[*model].clone()).collect())
}

fn wanted_models(plan: &LanePlan, models: Option<&[ModelId]>, count: usize) -> Result<Vec<usize>> {
    let all = match models {
        None => (0..plan.models.len()).collect(),
        Some(list) => list.iter().map(|id| model(plan, *id)).collect::<Result<Vec<_>>>()?,
    };
    if all.len().saturating_mul(count) > MAX_LANES {
        let problem = format!("{count} lanes of {} models are too many files", all.len());
        return Err(Error::usage(Place::item("--worst"), problem, format!("write at most {MAX_LANES} at once")));
    }
    Ok(all)
}
