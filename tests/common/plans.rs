//! Plans and chunks without physics: every verdict is chosen by the test.
#![allow(dead_code)]

use std::sync::Arc;

use lanesweep::engine::{Block, CaseSource, Chunk, EndReason, Headway, LaneCase, LanePlan, NO_STEP, Outcome, Verdicts};
use lanesweep::model::criterion::{Contact, Criterion};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::scenario::{Case, Category, Lateral, Participant, Speed, Tables};

struct OneCase(LaneCase<f64>, Tables<f64>);

impl CaseSource for OneCase {
    fn case(&self, _: usize, _: u64, _: usize) -> LaneCase<f64> {
        self.0
    }
    fn tables(&self) -> &Tables<f64> {
        &self.1
    }
}

/// A plan of these (category, number of units, variants after S), all models, ten headways.
pub fn plan(blocks: &[(Category, usize, &[&str])]) -> LanePlan {
    let profile = Profile::load("paper").unwrap();
    let vehicle = Participant {
        length_m: 4.5,
        width_m: 1.8,
        speed: Speed::Sampled(vec![20.0]),
        lateral: Lateral::Sampled { position_m: vec![0.0], towards_mps: vec![0.0] },
    };
    let case = Case {
        category: Category::Lvd,
        ego_length_m: 4.5,
        ego_width_m: 1.8,
        lane_width_m: 3.5,
        ego_speed_mps: 25.0,
        principal: vehicle,
        ahead: None,
        horizon_s: 1.0,
    };
    let mut tables = Tables::default();
    let case = LaneCase::encode(&case, &profile, &mut tables);
    let blocks = blocks
        .iter()
        .map(|(category, units, variants)| Block {
            category: *category,
            units: (0..*units).map(|k| format!("{}_{k}", category.key())).collect(),
            variants: std::iter::once("S").chain(variants.iter().copied()).map(str::to_owned).collect(),
            first_unit: 0,
            first_lane: 0,
        })
        .collect();
    LanePlan::new(profile, ModelId::ALL.to_vec(), Headway::paper(), blocks, Arc::new(OneCase(case, tables))).unwrap()
}

/// Verdict bits from what failed.
pub fn verdicts(failed: &[Criterion]) -> Verdicts {
    Verdicts(failed.iter().map(|c| 1 << c.index()).sum())
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
    let outcome = |(verdicts, min_ttc): &(Verdicts, f64)| Outcome {
        verdicts: *verdicts,
        contact: Contact::None,
        contact_with: 0,
        end: EndReason::Settled,
        reaction_step: NO_STEP,
        contact_step: NO_STEP,
        end_step: 25,
        impact_speed: 0.0,
        impact_closing_speed: 0.0,
        min_ttc: *min_ttc,
        max_btn: 0.1,
        min_gap: 1.0,
        min_thw: 0.5,
        max_drac: 1.0,
        tet_steps: 2,
        tit: 0.1,
        pet: None,
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
