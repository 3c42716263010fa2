//! What remains of lanes: exact integer counts per unit. A chunk, a journal record and a shard's part are
//! all partials; merging is associative and does not depend on the order.

use std::ops::Range;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::backend::Chunk;
use super::outcome::Verdicts;
use super::plan::{LanePlan, hex};
use crate::criterion::Criterion;
use crate::{Error, Place, Result};

/// Version of the serialized form.
const VERSION: u32 = 1;

/// Agreement of S' with S over the headways of one unit, variant, model and criterion. For variant 0 (S
/// against itself) `both` counts the failures of S and `neither` its passes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Confusion {
    /// TP: S and S' fail.
    pub both: u32,
    /// FN: only S fails.
    pub only_s: u32,
    /// FP: only S' fails.
    pub only_s_prime: u32,
    /// TN: both pass.
    pub neither: u32,
}

impl Confusion {
    /// Counts one lane of S' against its lane of S.
    pub fn count(&mut self, s: bool, s_prime: bool) {
        match (s, s_prime) {
            (true, true) => self.both += 1,
            (true, false) => self.only_s += 1,
            (false, true) => self.only_s_prime += 1,
            (false, false) => self.neither += 1,
        }
    }

    /// Sum.
    pub fn add(&mut self, other: &Confusion) {
        self.both += other.both;
        self.only_s += other.only_s;
        self.only_s_prime += other.only_s_prime;
        self.neither += other.neither;
    }
}

/// Counts of one unit: cells in the order variant, model, criterion.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnitCounts {
    /// Unit, counted over all blocks.
    pub unit: u64,
    /// One per variant × model × criterion.
    pub cells: Vec<Confusion>,
    /// Lanes that ended at the time cap, one per variant × model.
    pub capped: Vec<u32>,
}

/// Counts of a set of units of one plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Partial {
    plan_hash: String,
    /// Ascending by unit, each unit once.
    units: Vec<UnitCounts>,
}

#[derive(Serialize, Deserialize)]
struct Envelope {
    version: u32,
    sha256: String,
    partial: Partial,
}

impl Partial {
    /// Nothing yet.
    pub fn empty(plan: &LanePlan) -> Partial {
        Partial { plan_hash: plan.hash().to_owned(), units: Vec::new() }
    }

    /// Counts a chunk's lanes.
    pub fn of(plan: &LanePlan, chunk: &Chunk) -> Partial {
        let mut partial = Partial::empty(plan);
        let mut at = 0;
        for (block, inside) in plan.segments(chunk.units.clone()) {
            let block = &plan.blocks[block];
            let per_unit = plan.lanes_per_unit(block) as usize;
            for unit in inside {
                let lanes = &chunk.verdicts[at..at + per_unit];
                partial.units.push(count_unit(plan, block.first_unit + unit, block.variants.len(), lanes));
                at += per_unit;
            }
        }
        partial
    }

    /// Joins the counts of other units of the same plan.
    ///
    /// # Errors
    /// If the plans differ, or a unit is in both.
    pub fn merge(self, other: Partial) -> Result<Partial> {
        if self.plan_hash != other.plan_hash {
            return Err(Error::input(
                Place::item("partial result"),
                format!("it belongs to plan {}, not to {}", other.plan_hash, self.plan_hash),
                "merge only parts of the same study",
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
        Ok(Partial { plan_hash: self.plan_hash, units })
    }

    /// Hash of the plan that these counts belong to.
    pub fn plan_hash(&self) -> &str {
        &self.plan_hash
    }

    /// The counts, ascending by unit.
    pub fn units(&self) -> &[UnitCounts] {
        &self.units
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

    /// Does it hold every unit of the plan?
    pub fn is_complete(&self, plan: &LanePlan) -> bool {
        self.plan_hash == plan.hash() && self.units.len() as u64 == plan.unit_count()
    }

    /// As JSON with version and checksum.
    pub fn to_json(&self) -> Result<String> {
        let envelope = Envelope { version: VERSION, sha256: self.checksum()?, partial: self.clone() };
        serde_json::to_string(&envelope).map_err(|e| Error::Internal(format!("a partial cannot be written: {e}")))
    }

    /// From JSON; `place` names the file in errors.
    ///
    /// # Errors
    /// If it is no partial, of another version, or damaged.
    pub fn from_json(text: &str, place: Place) -> Result<Partial> {
        let damaged = |problem: String| Error::input(place.clone(), problem, "delete it and compute this part again");
        let envelope: Envelope =
            serde_json::from_str(text).map_err(|e| damaged(format!("this is no partial result: {e}")))?;
        if envelope.version != VERSION {
            return Err(damaged(format!("version {} of a partial result, expected {VERSION}", envelope.version)));
        }
        if envelope.partial.checksum()? != envelope.sha256 {
            return Err(damaged("the checksum does not fit: the file is damaged".to_owned()));
        }
        Ok(envelope.partial)
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
