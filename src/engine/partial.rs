//! Results of lanes as exact integer counts per unit, and the worst lanes by value. A chunk, a journal record and a
//! shard's part are partials. Merging is associative and commutative.

use std::ops::Range;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::backend::Chunk;
use super::confusion::Confusion;
use super::outcome::Verdicts;
use super::plan::LanePlan;
use crate::model::criterion::Criterion;
use crate::support::hex::hex;
use crate::{Error, Place, Result};

/// Default number of worst lanes that a partial keeps.
pub const WORST_LANES: usize = 20;

/// What the serialized form calls itself.
const FORMAT: &str = "lanesweep partial";
/// Version of the serialized form.
const VERSION: u64 = 3;

/// Counts of one unit: cells in the order variant, model, criterion.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnitCounts {
    /// Unit, counted over all blocks.
    pub unit: u64,
    /// One per variant × model × criterion.
    #[serde(with = "crate::engine::packed_counts")]
    pub cells: Vec<Confusion<u32>>,
    /// Lanes that ended at the time cap, one per variant × model.
    pub capped: Vec<u32>,
}

/// A lane with its smallest time to collision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorstLane {
    /// min TTC, s; infinite where the ego never closed in.
    pub min_ttc_s: f64,
    /// Lane index in the plan.
    pub lane: u64,
}

/// Counts of a set of units of one plan, and the worst lanes of those whose values were computed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Partial {
    plan_hash: String,
    /// Ascending by unit, each unit once.
    units: Vec<UnitCounts>,
    /// Failed lanes over all units, block by block: variant × headway × model × criterion.
    headway_failures: Vec<u64>,
    worst_limit: usize,
    /// Ascending by (value, lane), `worst_limit` at most.
    worst: Vec<WorstLane>,
    valued_lanes: u64,
}

impl Partial {
    /// Nothing yet; keeps [`WORST_LANES`] worst lanes.
    pub fn empty(plan: &LanePlan) -> Partial {
        Partial::empty_keeping(plan, WORST_LANES)
    }

    /// Nothing yet; keeps another number of worst lanes. Only partials that keep equally many can merge.
    pub fn empty_keeping(plan: &LanePlan, worst_limit: usize) -> Partial {
        Partial {
            plan_hash: plan.hash().to_owned(),
            units: Vec::new(),
            headway_failures: vec![0; plan.blocks.iter().map(|block| plan.headway_cells(block)).sum()],
            worst_limit,
            worst: Vec::new(),
            valued_lanes: 0,
        }
    }

    /// Counts a chunk's lanes. Keeps its [`WORST_LANES`] worst lanes where it has outcomes.
    ///
    /// # Errors
    /// [`Error::Internal`] if the chunk does not fit the plan.
    pub fn from_chunk(plan: &LanePlan, chunk: &Chunk) -> Result<Partial> {
        Partial::from_chunk_keeping(plan, chunk, WORST_LANES)
    }

    /// [`Partial::from_chunk`] with another number of worst lanes.
    ///
    /// # Errors
    /// [`Error::Internal`] if the chunk does not fit the plan.
    pub fn from_chunk_keeping(plan: &LanePlan, chunk: &Chunk, worst_limit: usize) -> Result<Partial> {
        chunk.check(plan)?;
        if u32::try_from(plan.headways.len()).is_err() {
            return Err(Error::Internal("a unit has more headways than u32 counts".to_owned()));
        }
        Ok(Partial::empty_keeping(plan, worst_limit).counting(plan, chunk))
    }

    /// An empty partial with the counts of a chunk.
    fn counting(mut self, plan: &LanePlan, chunk: &Chunk) -> Partial {
        let mut at = 0;
        for (index, inside) in plan.segments(chunk.units.clone()) {
            let block = &plan.blocks[index];
            let first_cell: usize = plan.blocks[..index].iter().map(|before| plan.headway_cells(before)).sum();
            let failures = &mut self.headway_failures[first_cell..first_cell + plan.headway_cells(block)];
            let per_unit = plan.lanes_per_unit(block) as usize;
            for unit in inside {
                let lanes = &chunk.verdicts[at..at + per_unit];
                self.units.push(count_unit(plan, block.first_unit + unit, block.variants.len(), lanes));
                // Lanes lie in the order of the cells: variant, headway, model.
                for (lane, cells) in lanes.iter().zip(failures.chunks_mut(Criterion::ALL.len())) {
                    Criterion::ALL.iter().zip(cells).for_each(|(c, cell)| *cell += u64::from(lane.failed(*c)));
                }
                at += per_unit;
            }
        }
        let lanes = chunk.outcomes.iter().zip(chunk.first_lane..);
        let lanes = lanes.map(|(outcome, lane)| WorstLane { min_ttc_s: outcome.min_ttc, lane }).collect();
        self.worst = keep_worst(lanes, self.worst_limit);
        self.valued_lanes = chunk.outcomes.len() as u64;
        self
    }

    /// Joins the counts of other units of the same plan: associative, and the same in any order.
    ///
    /// # Errors
    /// If the plans differ, the two keep different numbers of worst lanes, or a unit is in both.
    pub fn merge(self, other: Partial) -> Result<Partial> {
        if self.plan_hash != other.plan_hash {
            return Err(Error::input(
                Place::item("partial result"),
                format!("it belongs to plan {}, not to {}", other.plan_hash, self.plan_hash),
                "merge only parts of the same study",
            ));
        }
        if self.worst_limit != other.worst_limit {
            return Err(Error::input(
                Place::item("partial result"),
                format!("it keeps {} worst lanes, the other {}", other.worst_limit, self.worst_limit),
                "make all parts with the same number of worst lanes",
            ));
        }
        let mut units = self.units;
        units.extend(other.units);
        units.sort_by_key(|u| u.unit);
        if let Some(pair) = units.windows(2).find(|pair| pair[0].unit == pair[1].unit) {
            return Err(Error::input(
                Place::item(format!("unit {}", pair[0].unit)),
                "it is in both parts",
                "merge every part once",
            ));
        }
        if self.headway_failures.len() != other.headway_failures.len() {
            let problem = "the two count failures of different numbers of headways";
            return Err(Error::input(Place::item("partial result"), problem, "compute these parts again"));
        }
        let mut headway_failures = self.headway_failures;
        headway_failures.iter_mut().zip(other.headway_failures).for_each(|(sum, more)| *sum = sum.saturating_add(more));
        let mut worst = self.worst;
        worst.extend(other.worst);
        Ok(Partial {
            plan_hash: self.plan_hash,
            units,
            headway_failures,
            worst_limit: self.worst_limit,
            worst: keep_worst(worst, self.worst_limit),
            valued_lanes: self.valued_lanes.saturating_add(other.valued_lanes),
        })
    }

    /// Hash of the plan that these counts belong to.
    pub fn plan_hash(&self) -> &str {
        &self.plan_hash
    }

    /// The counts, ascending by unit.
    pub fn units(&self) -> &[UnitCounts] {
        &self.units
    }

    /// Failed lanes of a block, over all units counted: variant × headway × model × criterion, the last innermost.
    ///
    /// # Errors
    /// [`Error::Internal`] where the counts are not those of this plan.
    pub fn headway_failures(&self, plan: &LanePlan, block: usize) -> Result<&[u64]> {
        let first: usize = plan.blocks[..block].iter().map(|before| plan.headway_cells(before)).sum();
        let cells = self.headway_failures.get(first..first + plan.headway_cells(&plan.blocks[block]));
        cells.ok_or_else(|| Error::Internal("a partial does not have the headways of its plan".to_owned()))
    }

    /// The lanes with the smallest min TTC, ascending; ties by lane. Only lanes whose values were computed
    /// compete ([`Partial::valued_lanes`]).
    pub fn worst(&self) -> &[WorstLane] {
        &self.worst
    }

    /// Number of lanes whose values were computed, not only their verdicts.
    pub fn valued_lanes(&self) -> u64 {
        self.valued_lanes
    }

    /// The covered units as disjoint intervals, ascending.
    pub fn covered(&self) -> Vec<Range<u64>> {
        let mut intervals: Vec<Range<u64>> = Vec::new();
        for unit in self.units.iter().map(|u| u.unit) {
            match intervals.last_mut() {
                Some(last) if last.end == unit => last.end = unit + 1,
                _ => intervals.push(unit..unit + 1),
            }
        }
        intervals
    }

    /// Whether counts that were read from a file can be those of a study.
    ///
    /// # Errors
    /// What contradicts itself.
    pub fn check(&self) -> std::result::Result<(), String> {
        if self.units.windows(2).any(|pair| pair[0].unit >= pair[1].unit) {
            return Err("its units are not in order, or not each there once".to_owned());
        }
        if self.units.last().is_some_and(|last| last.unit >> 63 != 0) {
            return Err("a unit is beyond any plan".to_owned());
        }
        if self.worst.len() > self.worst_limit {
            return Err("it has more worst lanes than it keeps".to_owned());
        }
        Ok(())
    }

    /// Whether counts that were read from a file can be those of this plan.
    ///
    /// # Errors
    /// What differs.
    pub fn check_of(&self, plan: &LanePlan) -> std::result::Result<(), String> {
        if self.plan_hash != plan.hash() {
            return Err(format!("they belong to plan {}, not to {}", self.plan_hash, plan.hash()));
        }
        if !self.fits(plan) {
            return Err("they do not fit the units, variants and models of the plan".to_owned());
        }
        match self.worst.iter().find(|worst| worst.lane >= plan.lane_count()) {
            Some(worst) => Err(format!("lane {} is not in the plan", worst.lane)),
            None => Ok(()),
        }
    }

    /// Do the counts by headway add up to the failures of the units? The units must fit the plan.
    pub fn adds_up(&self, plan: &LanePlan) -> bool {
        (0..plan.blocks.len()).all(|block| self.block_adds_up(plan, block))
    }

    fn block_adds_up(&self, plan: &LanePlan, index: usize) -> bool {
        let block = &plan.blocks[index];
        let (models, criteria) = (plan.models.len(), Criterion::ALL.len());
        let Ok(by_headway) = self.headway_failures(plan, index) else { return false };
        let mut sums = vec![0_u64; block.variants.len() * models * criteria];
        for (at, count) in by_headway.iter().enumerate() {
            let (variant, in_lane) = (at / (plan.headways.len() * models * criteria), at % (models * criteria));
            let sum = &mut sums[variant * models * criteria + in_lane];
            *sum = sum.saturating_add(*count);
        }
        let first = self.units.partition_point(|unit| unit.unit < block.first_unit);
        let units = self.units[first..].iter().take_while(|unit| unit.unit < block.first_unit + block.units.len());
        let mut of_units = vec![0_u64; sums.len()];
        for unit in units {
            for (sum, cell) in of_units.iter_mut().zip(&unit.cells) {
                *sum += u64::from(cell.tp) + u64::from(cell.fp);
            }
        }
        sums == of_units
    }

    /// Has every unit the counts that the plan's variants, models and criteria make?
    pub fn fits(&self, plan: &LanePlan) -> bool {
        let models = plan.models.len();
        self.units.iter().all(|unit| {
            let block = plan.blocks.iter().rev().find(|block| block.first_unit <= unit.unit && !block.units.is_empty());
            block.is_some_and(|block| {
                let cells = block.variants.len() * models;
                unit.unit < block.first_unit + block.units.len()
                    && unit.cells.len() == cells * Criterion::ALL.len()
                    && unit.capped.len() == cells
            })
        })
    }

    /// Does it hold every unit of the plan?
    pub fn is_complete(&self, plan: &LanePlan) -> bool {
        self.plan_hash == plan.hash() && self.units.len() as u64 == plan.unit_count()
    }

    /// As JSON with version and checksum.
    pub fn to_json(&self) -> Result<String> {
        let unwritable = |e: serde_json::Error| Error::Internal(format!("a partial cannot be written: {e}"));
        let content = serde_json::to_value(self).map_err(unwritable)?;
        let sealed = serde_json::json!({
            "format": FORMAT, "version": VERSION, "sha256": self.checksum()?, "partial": content,
        });
        serde_json::to_string(&sealed).map_err(unwritable)
    }

    /// From JSON; `place` names the file in errors.
    ///
    /// # Errors
    /// If it is no partial, of another version, or damaged.
    pub fn from_json(text: &str, place: Place) -> Result<Partial> {
        let error = |problem: String, help: &str| Error::input(place.clone(), problem, help);
        let damaged = "delete it and compute this part again";
        let mut sealed: serde_json::Value =
            serde_json::from_str(text).map_err(|e| error(format!("this is no complete JSON: {e}"), damaged))?;
        if sealed.get("format").and_then(|f| f.as_str()) != Some(FORMAT) {
            let problem = format!("this is no partial result: its `format` is not `{FORMAT}`");
            return Err(error(problem, "give a file that lanesweep wrote as a partial result"));
        }
        let version = sealed.get("version").and_then(|v| v.as_u64());
        if version != Some(VERSION) {
            let found = version.map_or("missing".to_owned(), |v| v.to_string());
            let problem = format!("its version is {found}; this program reads version {VERSION}");
            return Err(error(problem, "compute this part again with this version of lanesweep"));
        }
        let content = sealed.get_mut("partial").map(serde_json::Value::take).unwrap_or_default();
        let partial: Partial =
            serde_json::from_value(content).map_err(|e| error(format!("its content is damaged: {e}"), damaged))?;
        if sealed.get("sha256").and_then(|s| s.as_str()) != Some(partial.checksum()?.as_str()) {
            return Err(error("the checksum does not fit: the file is damaged".to_owned(), damaged));
        }
        partial.check().map_err(|problem| error(format!("its counts cannot be: {problem}"), damaged))?;
        Ok(partial)
    }

    fn checksum(&self) -> Result<String> {
        let body =
            serde_json::to_vec(self).map_err(|e| Error::Internal(format!("a partial cannot be written: {e}")))?;
        Ok(hex(&Sha256::digest(body)))
    }
}

fn count_unit(plan: &LanePlan, unit: u64, variants: usize, lanes: &[Verdicts]) -> UnitCounts {
    let (headways, models) = (plan.headways.len(), plan.models.len());
    let criteria = Criterion::ALL.len();
    let mut counts = UnitCounts {
        unit,
        cells: vec![Confusion::default(); variants * models * criteria],
        capped: vec![0; variants * models],
    };
    for variant in 0..variants {
        for headway in 0..headways {
            for model in 0..models {
                let s = lanes[headway * models + model];
                let s_prime = lanes[(variant * headways + headway) * models + model];
                counts.capped[variant * models + model] += u32::from(s_prime.capped());
                for criterion in Criterion::ALL {
                    let cell = (variant * models + model) * criteria + criterion.index();
                    counts.cells[cell].count(s.failed(criterion), s_prime.failed(criterion));
                }
            }
        }
    }
    counts
}

/// The smallest of them, ascending by (value, lane): a total order, so that what is kept depends on the set
/// alone.
fn keep_worst(mut lanes: Vec<WorstLane>, limit: usize) -> Vec<WorstLane> {
    let order = |a: &WorstLane, b: &WorstLane| a.min_ttc_s.total_cmp(&b.min_ttc_s).then(a.lane.cmp(&b.lane));
    if lanes.len() > limit && limit > 0 {
        lanes.select_nth_unstable_by(limit - 1, order);
    }
    lanes.truncate(limit);
    lanes.sort_unstable_by(order);
    lanes
}

// JSON has no infinity: it is written as null.
impl Serialize for WorstLane {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        (self.min_ttc_s.is_finite().then_some(self.min_ttc_s), self.lane).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for WorstLane {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let (min_ttc_s, lane) = <(Option<f64>, u64)>::deserialize(deserializer)?;
        Ok(WorstLane { min_ttc_s: min_ttc_s.unwrap_or(f64::INFINITY), lane })
    }
}
