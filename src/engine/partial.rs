//! Results of lanes as exact integer counts per unit. A chunk, a journal record and a shard's part are partials.
//! Merging is associative and commutative.

use serde::{Deserialize, Serialize};

use super::backend::Chunk;
use super::confusion::Confusion;
use super::outcome::Verdicts;
use super::plan::LanePlan;
use lanesweep_model::criterion::Criterion;
use lanesweep_support::{Error, Place, Result};

/// Counts of one unit: cells in the order variant, model, criterion.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnitCounts {
    /// Unit, counted over all blocks.
    pub unit: u64,
    /// One per variant × model × criterion.
    #[serde(with = "crate::confusion::packed")]
    pub cells: Vec<Confusion<u32>>,
    /// Lanes that ended at the time cap, one per variant × model.
    pub capped: Vec<u32>,
}

/// Counts of a set of units of one plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Partial {
    plan_hash: String,
    /// Ascending by unit, each unit once.
    units: Vec<UnitCounts>,
    /// Failed lanes over all units, block by block: variant × headway × model × criterion.
    headway_failures: Vec<u64>,
}

impl Partial {
    /// A partial without units.
    pub fn empty(plan: &LanePlan) -> Partial {
        Partial {
            plan_hash: plan.hash().to_owned(),
            units: Vec::new(),
            headway_failures: vec![0; plan.blocks.iter().map(|block| plan.headway_cells(block)).sum()],
        }
    }

    /// Counts a chunk's lanes.
    ///
    /// # Errors
    /// [`Error::Internal`] if the chunk does not fit the plan.
    pub fn from_chunk(plan: &LanePlan, chunk: &Chunk) -> Result<Partial> {
        chunk.check(plan)?;
        if u32::try_from(plan.headways.len()).is_err() {
            return Err(Error::Internal("a unit has more headways than u32 counts".to_owned()));
        }
        let mut counted = Partial::empty(plan);
        let mut at = 0;
        for (index, inside) in plan.segments(chunk.units.clone()) {
            let block = &plan.blocks[index];
            let first_cell: usize = plan.blocks[..index].iter().map(|before| plan.headway_cells(before)).sum();
            let failures = &mut counted.headway_failures[first_cell..first_cell + plan.headway_cells(block)];
            let per_unit = plan.lanes_per_unit(block) as usize;
            for unit in inside {
                let lanes = &chunk.verdicts[at..at + per_unit];
                counted.units.push(count_unit(plan, block.first_unit + unit, block.variants.len(), lanes));
                // Lanes are in the order of the cells: variant, headway, model.
                for (lane, cells) in lanes.iter().zip(failures.chunks_mut(Criterion::ALL.len())) {
                    Criterion::ALL.iter().zip(cells).for_each(|(c, cell)| *cell += u64::from(lane.failed(*c)));
                }
                at += per_unit;
            }
        }
        Ok(counted)
    }

    /// Merges the counts of other units of the same plan: associative and commutative.
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
        if self.headway_failures.len() != other.headway_failures.len() {
            let problem = "the two count failures of different numbers of headways";
            return Err(Error::input(Place::item("partial result"), problem, "compute these parts again"));
        }
        let mut headway_failures = self.headway_failures;
        headway_failures.iter_mut().zip(other.headway_failures).for_each(|(sum, more)| *sum = sum.saturating_add(more));
        Ok(Partial { plan_hash: self.plan_hash, units, headway_failures })
    }

    /// Hash of the plan that these counts belong to.
    pub fn plan_hash(&self) -> &str {
        &self.plan_hash
    }

    /// The counts, ascending by unit.
    pub fn units(&self) -> &[UnitCounts] {
        &self.units
    }

    /// Failed lanes of a block over all counted units: variant × headway × model × criterion, the last innermost.
    ///
    /// # Errors
    /// [`Error::Internal`] if the counts do not belong to this plan.
    pub fn headway_failures(&self, plan: &LanePlan, block: usize) -> Result<&[u64]> {
        let first: usize = plan.blocks[..block].iter().map(|before| plan.headway_cells(before)).sum();
        let cells = self.headway_failures.get(first..first + plan.headway_cells(&plan.blocks[block]));
        cells.ok_or_else(|| Error::Internal("a partial does not have the headways of its plan".to_owned()))
    }

    /// Whether every unit has as many counts as the plan's variants, models and criteria require.
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

    /// Whether it contains every unit of the plan.
    pub fn is_complete(&self, plan: &LanePlan) -> bool {
        self.plan_hash == plan.hash() && self.units.len() as u64 == plan.unit_count()
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
