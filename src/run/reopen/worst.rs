//! The worst lanes of a reopened run. For a study they are computed from its lanes; for a sampling run they are read
//! from its table `worst.csv`.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::{Reopened, SampleRecord};
use crate::engine::{Backend, Chunk, CpuBackend, Executor, LaneKey, LanePlan, Wanted, Watch};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::sampling::{WorstSample, limit_state, marks_of};
use crate::run::study::{Study, WINDOW};
use crate::support::input_file;
use crate::support::plain_text::hex;
use crate::support::ranges::refuse_repeats;
use crate::support::run_folder::ESTIMATE_RECORD;
use crate::support::table::text_of_cell;
use crate::{Error, Place, Result};

/// Maximum number of returned lanes.
const MAX_LANES: usize = 10_000;

/// Number of scenarios in the first piece of a study, for whose lanes all values are computed.
const FIRST_UNITS: u64 = 64;

/// Which of the worst lanes are requested.
pub struct WorstOptions<'a> {
    /// Number of lanes of each model, at least 1.
    pub count: usize,
    /// Criterion of the ranking [default: collision, or that of the table].
    pub criterion: Option<Criterion>,
    /// Variants of a study; empty selects all.
    pub variants: &'a [String],
    /// Models [default: all].
    pub models: Option<&'a [ModelId]>,
}

impl Reopened {
    /// Returns the worst lanes of each model.
    ///
    /// For a study: each scenario has one worst lane over variants and headways, that with the smallest
    /// [limit state](limit_state) of the criterion. The result is the first `count` of these lanes, in ascending order;
    /// equal values are in the plan's order. For a sampling run: the first `count` lanes of the model in `worst.csv`.
    ///
    /// # Errors
    /// [`Error::Usage`] for variants, models or a criterion that the run does not have, and for no or too many lanes;
    /// [`Error::Io`]; [`Error::Input`] for a sampling run whose table is missing or damaged.
    pub fn worst(&self, dir: &Path, options: &WorstOptions) -> Result<Vec<LaneKey>> {
        if options.count == 0 {
            return Err(Error::usage(Place::option("worst"), "0 is out of range", "give 1 or more"));
        }
        let models = match options.models {
            None => (0..self.plan().models.len()).collect(),
            Some(list) => list.iter().map(|id| self.model(*id)).collect::<Result<Vec<_>>>()?,
        };
        if models.len().saturating_mul(options.count) > MAX_LANES {
            let problem = format!("{} lanes of {} models are too many files", options.count, models.len());
            return Err(Error::usage(Place::option("worst"), problem, format!("write at most {MAX_LANES} at once")));
        }
        match self.as_study() {
            Some(study) => worst_of_study(study, options, &models),
            None => self.worst_of_table(dir, options, &models),
        }
    }

    fn worst_of_table(&self, dir: &Path, options: &WorstOptions, models: &[usize]) -> Result<Vec<LaneKey>> {
        let (path, count) = (dir.join("worst.csv"), options.count);
        // A plan without results has no record.
        let record = dir.join(ESTIMATE_RECORD).exists().then(|| SampleRecord::read(dir)).transpose()?;
        let Some(sha256) = record.and_then(|run| run.worst_sha256) else {
            let help = "run `lanesweep sample` with option `worst` above 0, or name lanes with option `lane`";
            return Err(Error::input(Place::file(dir), "the run was made without a table of worst lanes", help));
        };
        let wrong = |problem: &str| {
            let help = "run `lanesweep sample` into this folder again, or name lanes with option `lane`";
            Err(Error::input(Place::file(&path), problem, help))
        };
        if !path.exists() {
            return wrong("the run's table of worst lanes is missing");
        }
        let text = input_file::read_text(&path, input_file::MAX_TABLE_BYTES)?;
        if hex(&Sha256::digest(&text)) != sha256 {
            return wrong("checksum mismatch with estimate.json: the table was changed or damaged");
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
        let mut per_model: Vec<Vec<LaneKey>> = vec![Vec::new(); self.plan().models.len()];
        for (at, record) in reader.records().enumerate() {
            let record = record.map_err(|e| wrong(at as u64 + 2, e.to_string()))?;
            let ranked_by = by.and_then(|by| record.get(by)).unwrap_or_default();
            if let Some(requested) = options.criterion.filter(|requested| requested.key() != ranked_by) {
                let problem = format!("worst.csv ranks its lanes by {ranked_by}, not by {}", requested.key());
                let help =
                    format!("leave it out, or run `lanesweep sample` with option `criterion = {}`", requested.key());
                return Err(Error::usage(Place::option("criterion"), problem, help));
            }
            let key = self.find(text_of_cell(record.get(column).unwrap_or("")))?;
            if per_model[key.model].len() < count {
                per_model[key.model].push(key);
            }
        }
        let short = models.iter().map(|model| per_model[*model].len()).min().unwrap_or(0);
        if short < count {
            let more = "`sample` lists more with option `worst`";
            tracing::warn!("the run lists {short} worst lanes of a model, not {count}: {more}");
        }
        Ok(models.iter().flat_map(|model| per_model[*model].clone()).collect())
    }
}

/// Reruns the lanes on the CPU. Once every list is full, values are computed only for lanes that can enter a list.
fn worst_of_study(study: &Study, options: &WorstOptions, models: &[usize]) -> Result<Vec<LaneKey>> {
    let &WorstOptions { count, variants, .. } = options;
    let (plan, criterion) = (study.plan(), options.criterion.unwrap_or(Criterion::Collision));
    refuse_repeats(|| Place::option("variant"), variants.iter().map(|name| (name.trim(), name.trim())))?;
    for name in variants {
        if !plan.blocks.iter().any(|b| b.variants.iter().any(|v| v == name.trim())) {
            let mut known: Vec<&str> = plan.blocks.iter().flat_map(|b| &b.variants).map(String::as_str).collect();
            known.sort_unstable();
            known.dedup();
            let problem = format!("no lane of this run has the variant `{name}`");
            return Err(Error::usage(Place::option("variant"), problem, format!("use {}", known.join(", "))));
        }
    }
    let (narrow, wide) = (CpuBackend::lane_arithmetic(), CpuBackend::reference());
    let backend: &dyn Backend = if study.facts().reference { &wide } else { &narrow };
    let executor = Executor::new(backend).with_recheck(study.facts().score.seed);
    let is_wanted = |key: &LaneKey| {
        let variant = &plan.blocks[key.block].variants[key.variant];
        models.contains(&key.model) && (variants.is_empty() || variants.iter().any(|v| v.trim() == variant))
    };
    let mut worst: Vec<Vec<WorstSample>> = vec![Vec::new(); plan.models.len()];
    study.cases().in_windows(0..plan.unit_count(), WINDOW, |plan, units| {
        let mut from = units.start;
        while from < units.end {
            // A piece is as large as all pieces before it, so that about equally many new lanes of each piece enter a
            // list.
            let to = units.end.min(FIRST_UNITS.max(2 * from));
            let wanted = wanted(plan, &worst, options, criterion, models);
            executor.sweep(plan, from..to, wanted, |chunk| {
                add(plan, &chunk, criterion, &is_wanted, &mut worst, count);
                Ok(())
            })?;
            from = to;
        }
        Ok(())
    })?;
    let lanes = models.iter().flat_map(|model| worst[*model].iter());
    Ok(lanes.filter_map(|worst| plan.key(worst.lane)).collect())
}

/// Results that the next lanes must return, so that the lists are the same as with the values of all lanes.
fn wanted(
    plan: &LanePlan,
    worst: &[Vec<WorstSample>],
    options: &WorstOptions,
    criterion: Criterion,
    models: &[usize],
) -> Wanted {
    let mut watch = Watch::NOTHING;
    for &model in models {
        let last = worst[model].get(options.count - 1).map(|last| last.value);
        // `Some` criterion means that all its failures are marked. A study has too many failures for that, so all
        // values are computed.
        match last.and_then(|last| marks_of(&plan.profile, criterion, last)) {
            Some((marks, None)) => watch.0[plan.models[model].index()] = marks,
            _ => return Wanted::Outcomes,
        }
    }
    Wanted::Watched(watch)
}

/// Inserts the worst lane of each scenario of a chunk into the lists.
fn add(
    plan: &LanePlan,
    chunk: &Chunk,
    criterion: Criterion,
    is_wanted: &dyn Fn(&LaneKey) -> bool,
    worst: &mut [Vec<WorstSample>],
    count: usize,
) {
    let valued = chunk.valued.iter().flatten().map(|(lane, outcome)| (*lane, outcome));
    // The current scenario, and per model its worst lane so far.
    let (mut unit, mut of_unit) = (None, vec![None; worst.len()]);
    for (lane, outcome) in (chunk.first_lane..).zip(&chunk.outcomes).chain(valued) {
        let Some(key) = plan.key(lane).filter(is_wanted) else { continue };
        if unit != Some((key.block, key.unit)) {
            unit = Some((key.block, key.unit));
            keep(worst, &mut of_unit, count);
        }
        let found = WorstSample { value: limit_state(&plan.profile, criterion, outcome), lane };
        let so_far = &mut of_unit[key.model];
        if so_far.is_none_or(|known| found.is_worse_than(&known)) {
            *so_far = Some(found);
        }
    }
    keep(worst, &mut of_unit, count);
}

fn keep(worst: &mut [Vec<WorstSample>], of_unit: &mut [Option<WorstSample>], count: usize) {
    for (kept, found) in worst.iter_mut().zip(of_unit) {
        found.take().into_iter().for_each(|found| found.enter(kept, count));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::profile::Profile;
    use crate::traffic::mining::{MiningOptions, mine_generated};
    use crate::traffic::trajectory::generator::GeneratorOptions;

    #[test]
    fn the_worst_lanes_of_a_study_are_those_that_all_values_give() {
        let generated = GeneratorOptions { recordings: 10, ..GeneratorOptions::default() };
        let mined = mine_generated(&generated, &MiningOptions::default(), || Ok(())).unwrap();
        let study = Study::builder(&mined, Profile::load("paper").unwrap()).plan().unwrap();
        let plan = study.plan();
        assert!(plan.unit_count() > 4 * FIRST_UNITS, "{} scenarios", plan.unit_count());
        let (backend, every_model) = (CpuBackend::lane_arithmetic(), [0, 1, 2, 3]);
        let mut is_watched = false;
        for criterion in Criterion::ALL {
            let mut every: Vec<Vec<WorstSample>> = vec![Vec::new(); plan.models.len()];
            let sweep = |every: &mut [Vec<WorstSample>], count| {
                let units = 0..plan.unit_count();
                study.cases().sweep(units, Wanted::Outcomes, &Executor::new(&backend), |plan, chunk| {
                    add(plan, &chunk, criterion, &|_| true, every, count);
                    Ok(())
                })
            };
            sweep(&mut every, 5).unwrap();
            let options = WorstOptions { count: 5, criterion: Some(criterion), variants: &[], models: None };
            let expected: Vec<LaneKey> = every.iter().flatten().filter_map(|worst| plan.key(worst.lane)).collect();
            assert_eq!(worst_of_study(&study, &options, &every_model).unwrap(), expected, "{criterion:?}");
            is_watched |= wanted(plan, &every, &options, criterion, &every_model) != Wanted::Outcomes;
        }
        assert!(is_watched, "no criterion leaves lanes without a value");
    }
}
