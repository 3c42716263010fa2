//! Plans and chunks without physics: every verdict is chosen by the test.
use std::sync::Arc;

use lanesweep::engine::{Block, CaseSource, Chunk, LaneCase, LanePlan, LaneRunner, Verdicts};
use lanesweep::prelude::*;
use lanesweep::scenario::{Case, Lateral, Participant, Speed, Tables};

struct OneCase(LaneCase<f64>, Tables<f64>);

impl CaseSource for OneCase {
    fn case(&self, _: usize, _: u64, _: usize) -> LaneCase<f64> {
        self.0
    }
    fn tables(&self) -> &Tables<f64> {
        &self.1
    }
}

/// An ego and a vehicle as fast, with so much from one middle to the other across.
pub fn beside(y_m: f64) -> Case {
    let lateral = Lateral::Kinematic { start_m: y_m, rate_mps: 0.0, end_m: y_m };
    let principal = Participant { length_m: 4.0, width_m: 2.0, speed: Speed::constant(20.0), lateral };
    let (category, ego_speed_mps, horizon_s) = (Category::Lvd, 20.0, 0.0);
    let (ego_length_m, ego_width_m, lane_width_m) = (4.0, 2.0, 3.5);
    Case { category, ego_length_m, ego_width_m, lane_width_m, ego_speed_mps, principal, ahead: None, horizon_s }
}

pub fn block(category: Category, units: usize, variants: &[&str]) -> Block {
    let units = (0..units).map(|k| format!("{}_{k}", category.key())).collect();
    let variants = std::iter::once("S").chain(variants.iter().copied()).map(str::to_owned).collect();
    Block { category, units, variants, first_unit: 0, first_lane: 0 }
}

/// A plan of these (category, number of units, variants after S), all models, ten headways.
pub fn plan(blocks: &[(Category, usize, &[&str])]) -> LanePlan {
    let profile = Profile::load("paper").unwrap();
    let mut tables = Tables::default();
    let case = LaneCase::encode(&beside(0.0), &profile, &mut tables);
    let blocks = blocks.iter().map(|(category, units, variants)| block(*category, *units, variants)).collect();
    LanePlan::new(profile, ModelId::ALL.to_vec(), Headway::paper(), blocks, Arc::new(OneCase(case, tables))).unwrap()
}

/// A chunk of a plan whose lanes fail as told; min TTC as told too.
pub fn chunk(
    plan: &LanePlan,
    units: std::ops::Range<u64>,
    lane: &dyn Fn(u64) -> (Verdicts, f64),
    with_outcomes: bool,
) -> Chunk {
    let (first_lane, end) = (plan.first_lane_of(units.start), plan.first_lane_of(units.end));
    let lanes: Vec<(Verdicts, f64)> = (first_lane..end).map(lane).collect();
    let outcome = |(verdicts, min_ttc): &(Verdicts, f64)| {
        let of_any = LaneRunner::<f64>::new(plan).run(&plan.key(first_lane).unwrap());
        Outcome { verdicts: *verdicts, min_ttc: *min_ttc, ..of_any }
    };
    Chunk {
        units,
        first_lane,
        verdicts: lanes.iter().map(|l| l.0).collect(),
        outcomes: if with_outcomes { lanes.iter().map(outcome).collect() } else { Vec::new() },
        counted: None,
        redone_and_rechecked: [0; 2],
    }
}

/// A reproducible number in 0..2^64 per index (SplitMix64).
pub fn mixed(seed: u64, index: u64) -> u64 {
    let mut z = seed.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
