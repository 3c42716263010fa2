//! A plan as data: everything that the lanes need, so that a process that reads it recomputes nothing.

use serde::{Deserialize, Serialize};

use super::lane_case::LaneCase;
use super::plan::{Block, CaseSource, Headway, LanePlan};
use crate::driver::ModelId;
use crate::profile::Profile;
use crate::scenario::{Category, LATERAL_SAMPLED, Motion, SPEED_SAMPLED, Tables};
use crate::{Error, Place, Result};

/// A plan over a table of cases.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanContent {
    plan_sha256: String,
    profile: Profile,
    models: Vec<ModelId>,
    headways: Vec<Headway>,
    blocks: Vec<BlockContent>,
    tables: Tables<f64>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BlockContent {
    category: Category,
    units: Vec<String>,
    variants: Vec<String>,
    /// Unit-major, variant-minor.
    cases: Vec<LaneCase<f64>>,
}

struct CaseList {
    cases: Vec<Vec<LaneCase<f64>>>,
    variants: Vec<usize>,
    tables: Tables<f64>,
}

impl CaseSource for CaseList {
    fn case(&self, block: usize, unit: u64, variant: usize) -> LaneCase<f64> {
        self.cases[block][unit as usize * self.variants[block] + variant]
    }

    fn tables(&self) -> &Tables<f64> {
        &self.tables
    }
}

impl PlanContent {
    /// Of a plan over a table.
    ///
    /// # Errors
    /// [`Error::Internal`] for a plan that makes its own cases: its density is its content.
    pub fn of(plan: &LanePlan) -> Result<PlanContent> {
        if plan.generator().is_some() {
            return Err(Error::Internal("a generated plan is written as its density".to_owned()));
        }
        let content = |(at, block): (usize, &Block)| {
            let keys = (0..block.units.len()).flat_map(|unit| (0..block.variants.len()).map(move |v| (unit, v)));
            BlockContent {
                category: block.category,
                units: (0..block.units.len()).map(|unit| block.units.name(unit).into_owned()).collect(),
                variants: block.variants.clone(),
                cases: keys.map(|(unit, variant)| plan.case(at, unit, variant)).collect(),
            }
        };
        Ok(PlanContent {
            plan_sha256: plan.hash().to_owned(),
            profile: plan.profile.clone(),
            models: plan.models.clone(),
            headways: plan.headways.clone(),
            blocks: plan.blocks.iter().enumerate().map(content).collect(),
            tables: plan.tables().clone(),
        })
    }

    /// The plan, with the same hash.
    ///
    /// # Errors
    /// [`Error::Input`] at `place` where the content contradicts itself or its hash.
    pub fn into_plan(self, place: &Place) -> Result<LanePlan> {
        let wrong = |problem: &str| Error::input(place.clone(), problem, "make the plan again with --plan-only");
        self.profile.check(place)?;
        for block in &self.blocks {
            if block.cases.len() != block.units.len().saturating_mul(block.variants.len()) {
                return Err(wrong("it does not have one case per unit and variant"));
            }
            let motions = block.cases.iter().flat_map(|case| &case.others).map(|other| &other.motion);
            if !motions.into_iter().all(|motion| is_inside(motion, &self.tables)) {
                return Err(wrong("a motion points outside the tables"));
            }
        }
        let PlanContent { plan_sha256, profile, models, headways, blocks, tables } = self;
        let variants = blocks.iter().map(|b| b.variants.len()).collect();
        let mut list = CaseList { cases: Vec::new(), variants, tables };
        let mut made = Vec::new();
        for BlockContent { category, units, variants, cases } in blocks {
            list.cases.push(cases);
            let units = units.into_iter().collect();
            made.push(Block { category, units, variants, first_unit: 0, first_lane: 0 });
        }
        let plan = LanePlan::new(profile, models, headways, made, Box::new(list))?;
        if plan.hash() != plan_sha256 {
            return Err(wrong("its content is not that of its hash: another version of lanesweep made it"));
        }
        Ok(plan)
    }
}

fn is_inside(motion: &Motion<f64>, tables: &Tables<f64>) -> bool {
    let fits = |bit: u32, offset: u32, len: u32, entries: usize| {
        motion.kind & bit == 0 || (len > 0 && (offset as usize).saturating_add(len as usize) <= entries)
    };
    fits(SPEED_SAMPLED, motion.speed_offset, motion.speed_len, tables.speed.len())
        && fits(LATERAL_SAMPLED, motion.lateral_offset, motion.lateral_len, tables.lateral.len())
}
